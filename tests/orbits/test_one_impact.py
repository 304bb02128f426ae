"""Branches of one heated mass that strikes once per load period, and rubs at the edges of their kind."""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from test_branch import along, flagged, states

from scenes import cases, chain
from workflow.analysis import limits
from workflow.models import Cases, Rayleigh, Structure
from workflow.orbits import BIFURCATIONS, STATES, Options, branch, steady_rubs

PLACE = 1e-6
"""Relative accuracy of a place."""


def followed(gap: float, e: float, damping: float, frequency: float, heat: tuple[float, float], points: int) -> Any:
    """The branch over a load of 3 to 30 N of a mass of 1 g, with its expansion and conductance."""
    lump = {"mass": 1e-3, "stiffness": 1e5, "damping": Rayleigh(damping, 0.0), "spacing": 1.0}
    structure = chain(nodes=1, expansion=heat[0], conductance=heat[1], **lump)
    scene = cases(structure, gap=gap, e=e, alpha=1.0, amplitude=1.0, frequency=frequency)
    return branch(along("amplitude", structure, scene), 3.0, 30.0, points, Options(periods=2, samples=4))[0]


def archive(values: dict[str, Any], name: str) -> xr.Dataset:
    kept = ("steady_state", "bifurcation", "steady_periods", "steady_max_temperature")
    meanings = {"steady_state": STATES, "bifurcation": BIFURCATIONS}
    variables: dict[str, Any] = {key: ("point", values[key]) for key in kept}
    for key, words in meanings.items():
        variables[key] = ("point", values[key], {"flag_values": range(len(words)), "flag_meanings": " ".join(words)})
    variables |= {name: ("point", values["value"], {"units": "1"}), "status": ((), np.int8(0))}
    return xr.Dataset(variables)


def test_a_section_that_is_moved_does_not_turn_a_branch_round() -> None:
    values = followed(1.352e-5, 0.0, 274.72, 2845.2, (2.1319e-3, 128.78), 12)
    assert values["value"][[0, -1]].tolist() == [3.0, 30.0]
    assert np.all(np.diff(values["value"]) > 0)
    assert set(states(values)) == {"settles"}


@pytest.mark.parametrize("points", [12, pytest.param(200, marks=pytest.mark.slow)])
def test_a_rub_is_unstable_from_grazing_to_its_doubling(points: int) -> None:
    """Both loads are those of an independent integrator."""
    values = followed(1.828e-4, 0.3, 1722.92, 1244.5, (2.2629e-4, 49.458), points)
    grazing, doubling = 7.517809027648, 8.729449824
    assert values["value"][flagged(values, "grazing")[0]] == pytest.approx(grazing, rel=1e-12)
    assert values["value"][flagged(values, "period_doubling")].tolist() == [pytest.approx(doubling, rel=PLACE)]
    between = (values["value"] > grazing * (1 + PLACE)) & (values["value"] < doubling * (1 - PLACE))
    assert {states(values)[i] for i in np.flatnonzero(between)} == {"unstable"}
    found = limits(archive(values, "amplitude"))
    marginal = np.isin(values["bifurcation"], [BIFURCATIONS.index(name) for name in ("fold", "period_doubling")])
    assert found.beyond == {"unstable": np.sum((np.array(states(values)) == "unstable") | marginal)}
    below = {key: each[values["value"] < doubling + 1e-5] for key, each in values.items()}
    [first] = limits(archive(below, "amplitude")).limits
    assert (first.start, first.limited_by) == (3.0, "grazing")
    assert first.stop == first.next == pytest.approx(grazing, rel=PLACE)


def judged(structure: Structure, batch: Cases) -> str:
    return STATES[steady_rubs(structure, batch, Options())[0]["steady_state"][0]]


@pytest.mark.slow
def test_a_motion_that_touches_for_ever_is_not_free() -> None:
    """It touches to period 597 of 600 with an exponent above 0, though a free motion exists and is stable."""
    structure = chain(nodes=3, mass=1.0, stiffness=4e5, damping=Rayleigh(4.89, 0.0))
    batch = cases(structure, gap=0.03365, amplitude=1000.0, frequency=126.6)
    assert judged(structure, batch) == "not_found"


@pytest.mark.parametrize(
    ("alpha", "state"),
    [(0.02, "not_found"), pytest.param(0.2, "not_found", marks=pytest.mark.slow), (0.55, "runs_away")],
)
def test_a_flutter_that_lifts_the_tip_does_not_run_away(alpha: float, state: str) -> None:
    """At 0.2 it hammers with at most 150.66 K over 1 s; α_c is 0.5."""
    lumps = {"mass": 1e-3, "stiffness": 1e6, "spacing": 0.01, "expansion": 1e-5, "heat_capacity": 1e-5}
    structure = chain(nodes=4, conductance=0.1, damping=Rayleigh(10.0, 0.0), **lumps)
    loads = {"mean": 7.5, "amplitude": 0.05, "frequency": 2e5, "gap": -1e-5}
    start = np.linalg.solve(structure.stiffness_matrix, [0, 0, 0, 1.0])
    start = start * loads["gap"] / start[-1]
    assert judged(structure, cases(structure, alpha=alpha, e=0.5, displacement=start, **loads)) == state
