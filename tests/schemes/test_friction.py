"""Friction of a casing that slides: the contact force acts along n - µt, in all schemes.

Closed forms are those of a mass on two springs that lean on each other (:func:`sliding.slider`): with the coordinates
y (tangential) and x (normal), K = [[k, c], [c, k]] and the load F on the tip

    k y + c x = µ λ,   c y + k x = F - λ   at rest on the casing, x = d.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_event_driven_random import against_reference

from scenes import cases, movable, same_bits, sampling, sliding, static_equilibrium, step
from sliding import TANGENT, random_structure, slider
from workflow.models import Cases, NoEquilibriumError, Rayleigh, critical_alpha, critical_friction
from workflow.schemes import Results, Sampling, Status

FIXED: dict[str, tuple[str, dict[str, Any]]] = {
    "implicit_euler": ("moreau", {"theta": 1.0}),
    "midpoint": ("moreau", {"theta": 0.5}),
    "carpenter": ("carpenter", {}),
    "paoli_schatzman": ("paoli_schatzman", {}),
    "spring": ("penalty", {"stiffness": 2e4, "damping": 3.0}),
    "implicit_spring": ("penalty", {"stiffness": 2e4, "damping": 3.0, "theta": 0.5, "integration": "implicit"}),
}
SLOW = {name: pytest.param(name, marks=pytest.mark.slow) for name in FIXED if name != "implicit_euler"}
"""Each scheme compiles a kernel of its own for friction."""

EVERY = ["implicit_euler", *SLOW.values()]
RIGID = ["implicit_euler", SLOW["midpoint"], SLOW["carpenter"], SLOW["paoli_schatzman"], "event_driven"]


def ran(structure: Any, batch: Cases, scheme: str, h: float, over: Sampling) -> Results:
    """Run a scheme with balances, on a casing that could move: one kernel serves all tests."""
    method, options = FIXED.get(scheme, (scheme, {}))
    return step(structure, movable(batch), h, over, method, **options)


def rubbing(structure: Any, count: int = 1, **values: Any) -> Cases:
    """A tip that strikes a casing in motion, slides and leaves it."""
    rub = {"e": 0.4, "alpha": 0.02, "gap": 1e-3, "amplitude": 6.0, "frequency": 3.0, "velocity": 0.2, "steady": 1.0}
    return cases(structure, count, **{**rub, "casing_harmonics": [[2e-4, 5.0, 0.3]], **values})


@pytest.mark.parametrize(
    ("friction", "alpha", "e", "damping"),
    [
        (0.6, 0.0, 0.0, Rayleigh(0.5, 1e-4)),
        (0.6, 0.5, 0.6, Rayleigh(0.5, 1e-4)),
        (0.3, 0.5, 0.0, Rayleigh(0.5, 1e-4)),
        (0.3, 0.02, 0.0, Rayleigh(ratio=0.02)),
    ],
    ids=str,
)
def test_the_exact_solution(friction: float, alpha: float, e: float, damping: Rayleigh) -> None:
    """A damping ratio couples the modes of a tip that slides."""
    structure = replace(random_structure(np.random.default_rng(7), 3), damping=damping)
    batch = rubbing(structure, friction=friction, alpha=alpha, e=e)
    assert against_reference(structure, batch, sampling(0.3, 0.01)) <= 1e-10


def pressed(friction: float, load: float, gap: float, cross: float, k: float = 100.0) -> tuple[float, float]:
    """Tangential displacement and contact force at rest."""
    force = (load - k * gap + cross**2 * gap / k) / (1 + friction * cross / k)
    return (friction * force - cross * gap) / k, force


@pytest.mark.parametrize("scheme", RIGID)
def test_a_pressed_tip_that_slides_stays_where_it_is(scheme: str) -> None:
    structure, load, gap = slider(cross=-30.0), 5.0, 0.01
    friction = np.array([0.0, 0.5, 1.2])
    rest = [static_equilibrium(structure, np.array([0.0, load]), np.zeros(1), gap, mu)[0] for mu in friction]
    expected = np.array([pressed(mu, load, gap, -30.0) for mu in friction])
    np.testing.assert_allclose(np.array(rest)[:, TANGENT], expected[:, 0], rtol=1e-13)
    batch = cases(structure, 3, friction=friction, mean=load, gap=gap, displacement=rest)
    results = ran(structure, batch, scheme, 1e-3, sampling(2.0, 0.1))
    np.testing.assert_allclose(results.histories["displacement"], gap, rtol=1e-13)
    np.testing.assert_allclose(results.histories["impulse"][:, -1], expected[:, 1] * 2.0, rtol=1e-3)


def test_what_friction_jams_has_no_place_on_the_casing() -> None:
    """1 + µ c/k <= 0: a force pushes the tip that is held tangentially by a spring deeper into its casing."""
    structure = slider(cross=-50.0)
    assert critical_friction(structure)[0].standstill == pytest.approx(2.0, rel=1e-12)
    with pytest.raises(NoEquilibriumError):
        static_equilibrium(structure, np.array([0.0, 5.0]), np.zeros(1), 0.01, 2.1)
    assert critical_alpha(structure, 2.1) == 0.0


@pytest.mark.parametrize("e", [0.0, 0.6])
@pytest.mark.parametrize("scheme", RIGID)
def test_where_an_impulse_pushes_inwards_contact_has_no_solution(scheme: str, e: float) -> None:
    """Painlevé: nᵀM⁻¹(n - µt) = (1 + µ m)/(1 - m²) <= 0. A tip that stays clear is none the wiser."""
    structure = slider(inertia=-0.5)
    assert critical_friction(structure)[0].impact == pytest.approx(2.0, rel=1e-12)
    start = {"velocity": [0.0, 0.5], "gap": [0.01, 0.01, 1.0, 0.01]}
    batch = cases(structure, 4, e=e, friction=[1.9, 2.1, 2.1, 0.0], **start)
    results = ran(structure, batch, scheme, 1e-3, sampling(0.1, 0.01))
    assert results.status.tolist() == [Status.OK, Status.ILL_POSED, Status.OK, Status.OK]
    assert "friction" in results.messages[1]
    assert np.isnan(results.histories["displacement"][1, -1])


@pytest.mark.parametrize("scheme", [*EVERY, "event_driven"])
def test_without_friction_bits_are_those_without_a_direction(scheme: str) -> None:
    structure = random_structure(np.random.default_rng(1), 4)
    batch, over = rubbing(structure, 3, e=[0.0, 0.4, 0.9]), sampling(0.05, 1e-2)
    plain = ran(sliding(structure, np.zeros(structure.mechanical_size)), batch, scheme, 2e-4, over)
    assert same_bits(ran(structure, batch, scheme, 2e-4, over), plain)
    beside = replace(batch, friction=np.array([0.0, 0.3, 0.0]))
    mixed = ran(structure, beside, scheme, 2e-4, over)
    for case in (0, 2):
        assert mixed.histories["displacement"][case].tobytes() == plain.histories["displacement"][case].tobytes()
        assert mixed.metrics["contact_time"][case] == plain.metrics["contact_time"][case]
