"""One contact written as a row is stepped as the tip is in packs, by every scheme with a fixed step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import WAVES, everything_acts, heavy_chain, sampling, step, with_dashpot
from workflow.models import Array, Contacts, Structure
from workflow.schemes import Results, Status

OVER = sampling(0.0303, 3e-4, balances=True)
"""In a duration that is no multiple of the step."""
H = 1.3e-6 * 3
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


def as_row(structure: Structure) -> Structure:
    """Return a structure whose one contact, the tip, is written as the row of a contact."""
    n, m = structure.mechanical_size, structure.thermal_size
    tip, tangent = np.eye(n)[-1:], np.zeros(n) if structure.tangent is None else structure.tangent
    return replace(structure, tangent=None, contacts=Contacts(("1",), tip, tangent[None], np.eye(m)[-1:], np.zeros(1)))


def sliding(nodes: int = 6, dashpot: float = 0.0) -> Structure:
    """Return a chain along whose second node the casing slides too, if it does; a dashpot couples its modes."""
    structure = heavy_chain(nodes=nodes).matrices()
    if dashpot:
        structure = with_dashpot(structure, 1, 3, dashpot)
    return replace(structure, tangent=np.eye(nodes)[1])


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


@pytest.mark.parametrize(("method", "options"), SCHEMES)
@pytest.mark.parametrize("kind", ["warm", "slides on a casing that moves", "coupled"])
def test_one_contact_as_a_row_is_the_tip(method: str, options: dict[str, Any], kind: str) -> None:
    structure = sliding(dashpot=20.0 * (kind == "coupled"))
    waves: dict[str, Any] = WAVES if kind.startswith("slides") else {}
    batch = everything_acts(structure, 3, gap=1.5e-5, alpha=[0.0, 20.0, 50.0], e=[0.0, 0.3, 0.8], **waves)
    if kind != "warm":
        batch = replace(batch, friction=np.array([0.0, 0.1, 0.3]))
    ours, one = (step(each, batch, H, OVER, method, **options) for each in (as_row(structure), structure))
    assert one.metrics["impacts"].min() > 3
    compared(ours, one, 1e-9)
    for name in (ENERGY, HEAT):
        print(name, ours.metrics[name], one.metrics[name])
