"""The state in which cases end: what goes on from it is what would have gone on."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from contacts.random_contacts import DURATION, drawn
from scenes import WAVES, cases, chain, everything_acts, halves, heavy_chain, sampling, with_dashpot
from workflow.models import Rayleigh

SMALL = heavy_chain(nodes=4)
COUPLED = with_dashpot(SMALL, 0, 2, 50.0)
ELSEWHERE = replace(SMALL.matrices(), load=np.array([0.0, 1.0, 0.0, 0.5]))
FREE = with_dashpot(chain(nodes=3, mass=0.01, stiffness=[0.0, 1e5, 1e5], damping=Rayleigh(10.0, 0.0)), 0, 1, 5.0)
ADIABATIC = heavy_chain(nodes=4, conductance=[0.0, 0.605, 0.605, 0.605], convection=0.0)
STRUCTURES = {"small": SMALL, "coupled": COUPLED, "away": ELSEWHERE, "free": FREE, "adiabatic": ADIABATIC}
SCHEMES: list[tuple[str, dict[str, Any]]] = [
    ("event_driven", {}),
    ("moreau", {"theta": 1.0}),
    ("moreau", {"theta": 0.5}),
    ("penalty", {"stiffness": 1e7}),
    ("penalty", {"stiffness": 1e7, "integration": "implicit"}),
    ("carpenter", {}),
    ("paoli_schatzman", {}),
]


def is_rough(method: str, options: dict[str, Any]) -> bool:
    """Tell whether a scheme goes by central differences."""
    return method in ("carpenter", "paoli_schatzman") or options == {"stiffness": 1e7}


def quick(method: str) -> tuple[str, bool]:
    """Return the structure, and whether its casing moves, of which kernels are compiled for other tests too."""
    return ("coupled", True) if method in ("event_driven", "moreau") else ("small", False)


@pytest.mark.parametrize(
    ("method", "options", "structure", "moves"),
    [
        pytest.param(method, options, *kind, marks=() if kind == quick(method) else pytest.mark.slow)
        for method, options in SCHEMES
        for kind in product(STRUCTURES, (False, True))
    ],
)
def test_a_case_goes_on_from_the_state_in_which_another_ended(
    method: str, options: dict[str, Any], structure: str, moves: bool
) -> None:
    """Every load acts, contact begins and ends.

    Of central differences the state has half the heat and the rebound of an impulse that is due at the end, and a
    spring that is pressed bounces fast: without contact they go on as exactly.
    """
    rough = is_rough(method, options)
    own, over, waves = STRUCTURES[structure], sampling(0.02, 1e-3), WAVES if moves else {}
    for gap in (5e-6, 1.0) if rough else (5e-6,):
        batch = everything_acts(own, 2, e=[0.0, 0.4], gap=gap, **waves)
        whole, begun, rest = halves(own, batch, 1e-5, over, method, **options)
        assert (rest.metrics["contact_time"].max() > 0) == (gap < 1)
        share = 5e-2 if rough and gap < 1 else 1e-10
        for name, end in zip(("displacement", "velocity", "temperature"), begun.end, strict=True):
            expected, scale = whole.histories[name][:, 10:], np.abs(whole.histories[name]).max()
            np.testing.assert_allclose(rest.histories[name], expected, rtol=0, atol=share * scale)
            np.testing.assert_allclose(end[:, -1], begun.histories[name][:, -1], atol=1e-12 * scale)


@pytest.mark.parametrize("options", [{}, {"integration": "implicit", "theta": 0.5}], ids=["explicit", "implicit"])
def test_a_spring_that_is_pressed_goes_on(options: dict[str, Any]) -> None:
    """Its force at the border belongs to both halves, with its damper's, and heats once."""
    batch = cases(SMALL, alpha=20.0, gap=1e-5, mean=200.0, amplitude=20.0, frequency=90.0)
    whole, begun, rest = halves(
        SMALL, batch, 1e-5, sampling(0.02, 1e-3), "penalty", stiffness=1e7, damping=20.0, **options
    )
    assert begun.end.displacement[0, -1] > 1e-5
    for name in ("displacement", "temperature"):
        np.testing.assert_allclose(rest.histories[name], whole.histories[name][:, 10:], rtol=1e-7)
    heated = rest.histories["impulse"][:, -1] + begun.histories["impulse"][:, -1] - whole.histories["impulse"][:, -1]
    np.testing.assert_allclose(heated, 0.0, atol=1e-7 * whole.histories["impulse"].max())


@pytest.mark.parametrize(("method", "options"), SCHEMES)
@pytest.mark.parametrize("kind", [pytest.param("mass", marks=pytest.mark.slow), "massless", "elastic"])
def test_several_contacts_go_on(method: str, options: dict[str, Any], kind: str) -> None:
    """The first velocity of contacts without mass is that of the modes alone."""
    if is_rough(method, options) or (kind == "elastic" and method == "penalty"):
        pytest.skip("it has another state, or takes a rigid casing")
    touched, over = 0, sampling(DURATION, DURATION / 40)
    for seed in range(6):
        scene = drawn(seed, kind == "massless")
        structure = scene.structure.on_casing(1e-6) if kind == "elastic" else scene.structure
        whole, _, rest = halves(structure, scene.cases, 5e-6, over, method, **options)
        assert whole.status == rest.status == 0
        touched += int(rest.metrics["contact_time"].max() > 0)
        for name in ("displacement", "velocity", "temperature"):
            expected, scale = whole.histories[name][..., 21:], np.abs(whole.histories[name]).max()
            np.testing.assert_allclose(rest.histories[name][..., 1:], expected, rtol=0, atol=1e-8 * scale + 1e-20)
    assert touched > 2
