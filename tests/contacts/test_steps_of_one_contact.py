"""One contact as a row of any coordinates is stepped as the tip is, by every scheme with a fixed step."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import WAVES, cases, everything_acts, heavy_chain, sampling, sliding, step, with_dashpot, with_tip_first
from workflow.models import Array, Structure
from workflow.schemes import Results, Status

OVER = sampling(0.0303, 3e-4, balances=True)
"""In a duration that is no multiple of the step."""
H = 3.9e-6
SCHEMES: list[tuple[str, dict[str, Any]]] = [
    ("moreau", {"theta": 0.5}),
    ("moreau", {"theta": 1.0}),
    ("carpenter", {"heat": "explicit"}),
    ("carpenter", {"damping": "lagged"}),
    ("paoli_schatzman", {}),
    ("penalty", {}),
    ("penalty", {"damping": 20.0}),
    ("penalty", {"integration": "implicit", "theta": 0.6}),
    ("penalty", {"integration": "implicit", "damping": 20.0}),
    ("penalty", {"integration": "implicit", "damping": 20.0, "theta": 0.5}),
]
ENERGY, HEAT = "energy_residual", "heat_residual"


def structure_of(kind: str, nodes: int = 6) -> Structure:
    """Return a chain; along its second node the casing slides too, or a dashpot couples its modes besides."""
    structure = heavy_chain(nodes=nodes).matrices()
    if kind == "coupled":
        structure = with_dashpot(structure, 1, 3, 20.0)
    return structure if kind in ("cold", "warm") else sliding(structure, np.eye(nodes)[1])


def apart(ours: Array, truth: Array) -> float:
    """Return the largest difference over the largest value."""
    return float(np.abs(ours - truth).max() / max(np.abs(truth).max(), 1e-9))


def compared(ours: Results, truth: Results, within: float) -> None:
    """Compare all results but the residuals of balances."""
    assert truth.status.tolist() == ours.status.tolist() == [Status.OK] * 3, ours.messages
    for name in ("period_impulse", "period_temperature", "period_contact"):
        assert apart(getattr(ours, name), getattr(truth, name)) < within, name
    for arrays, others in (
        (ours.histories, truth.histories),
        (ours.metrics, truth.metrics),
        (ours.sections, truth.sections),
    ):
        assert arrays.keys() == others.keys()
        for name in sorted(set(others) - {ENERGY, HEAT}):
            assert apart(arrays[name], others[name]) < within, name


KINDS = ["cold", "warm", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("slides", "coupled"))]
"""The last two compile kernels of packs of their own."""


@pytest.mark.parametrize(("method", "options"), SCHEMES)
@pytest.mark.parametrize("kind", KINDS)
def test_one_contact_as_a_row_is_the_tip(method: str, options: dict[str, Any], kind: str) -> None:
    """Without heat balances of the energy are the same too: with it packs have the energy relative to its motion."""
    structure = structure_of(kind)
    rub: dict[str, Any] = {"gap": 1.5e-5, "e": [0.0, 0.3, 0.8]}
    if kind == "cold":
        batch = cases(structure, 3, amplitude=100.0, frequency=200.0, **rub)
    else:
        waves: dict[str, Any] = WAVES if kind == "slides" or method == "moreau" else {}
        batch = everything_acts(structure, 3, alpha=[0.0, 20.0, 50.0], **rub, **waves)
    if structure.contacts.slides:
        batch = replace(batch, friction=np.array([0.0, 0.1, 0.3]))
    ways = with_tip_first(structure), structure
    ours, one = (step(each, each.received(batch), H, OVER, method, **options) for each in ways)
    assert one.metrics["impacts"].min() > 3
    compared(ours, one, 1e-10)
    assert np.abs(ours.metrics[HEAT]).max() < 1e-10
    closes = np.abs(one.metrics[ENERGY]) < 1e-12
    assert np.abs(ours.metrics[ENERGY][closes]).max(initial=0) < 1e-12
    assert kind != "cold" or np.abs(ours.metrics[ENERGY] - one.metrics[ENERGY]).max() < 1e-12
