"""The state in which cases end: what goes on from it is what would have gone on."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import WAVES, chain, everything_acts, heavy_chain, sampling, step, with_dashpot
from workflow.models import Cases, Harmonics, Rayleigh, Structure
from workflow.schemes import Results, Sampling

SMALL = heavy_chain(nodes=4)
LAGGED = {"damping": "lagged"}
COUPLED = with_dashpot(SMALL, 0, 2, 50.0)
ELSEWHERE = replace(SMALL.matrices(), load=np.array([0.0, 1.0, 0.0, 0.5]))
FREE = with_dashpot(chain(nodes=3, mass=0.01, stiffness=[0.0, 1e5, 1e5], damping=Rayleigh(10.0, 0.0)), 0, 1, 5.0)
ADIABATIC = heavy_chain(nodes=4, conductance=[0.0, 0.605, 0.605, 0.605], convection=0.0)
STRUCTURES = {"small": SMALL, "coupled": COUPLED, "away": ELSEWHERE, "free": FREE, "adiabatic": ADIABATIC}
SCHEMES: list[tuple[str, dict[str, Any]]] = [
    ("event_driven", {}),
    ("moreau", {"theta": 1.0}),
    ("moreau", {"theta": 0.5}),
    ("penalty", {"stiffness": 1e8}),
    ("penalty", {"stiffness": 1e8, "integration": "implicit"}),
    ("carpenter", {}),
    ("paoli_schatzman", {}),
]


def later(batch: Cases, results: Results, duration: float) -> Cases:
    """Return cases that start where those of a batch ended."""

    def turned(harmonics: Harmonics) -> Harmonics:
        return harmonics.turned((harmonics.frequency * duration) % 1.0)

    assert results.end is not None
    moved = {name: turned(getattr(batch, name)) for name in ("load_harmonics", "casing_harmonics")}
    return replace(batch, **results.end._asdict(), **moved)


def halves(
    structure: Structure, batch: Cases, h: float, over: Sampling, method: str, **options: Any
) -> tuple[Results, Results, Results]:
    """Return a motion, its first half, and what follows the end of that."""
    first = replace(over, duration=over.duration / 2, count=over.count // 2 + 1)
    begun = step(structure, batch, h, first, method, **options)
    return (
        step(structure, batch, h, over, method, **options),
        begun,
        step(structure, later(batch, begun, first.duration), h, first, method, **options),
    )


@pytest.mark.parametrize(("method", "options"), SCHEMES)
@pytest.mark.parametrize(
    "structure", [SMALL, COUPLED, ELSEWHERE, FREE, ADIABATIC], ids=["small", "coupled", "away", "free", "adiabatic"]
)
@pytest.mark.parametrize("waves", [{}, WAVES], ids=["still", "moving"])
def test_a_case_goes_on_from_the_state_in_which_another_ended(
    structure: Structure, method: str, options: dict[str, Any], waves: dict[str, Any]
) -> None:
    """Every load acts, contact begins and ends; impacts magnify rounding."""
    batch, over = everything_acts(structure, 2, e=[0.0, 0.4], gap=5e-6, **waves), sampling(0.02, 1e-3)
    whole, begun, rest = halves(structure, batch, 1e-5, over, method, **options)
    assert begun.metrics["contact_time"].min() > 0 or method == "event_driven"
    assert rest.metrics["contact_time"].max() > 0
    for name in ("displacement", "velocity", "temperature"):
        expected, scale = whole.histories[name][:, 10:], np.abs(whole.histories[name]).max()
        np.testing.assert_allclose(rest.histories[name], expected, rtol=0, atol=1e-7 * scale)
        np.testing.assert_allclose(begun.end._asdict()[name][:, -1], begun.histories[name][:, -1], atol=1e-12 * scale)
