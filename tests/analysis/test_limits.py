"""Ranges of axes in which every rub settles within bounds, of maps and of branches."""

import numpy as np
import pytest
import xarray as xr

from workflow.analysis import NothingSteadyError, limit_sentence, limits

STATES = ("settles", "no_contact", "permanent_contact", "unstable", "runs_away", "not_found", "not_asked")
BIFURCATIONS = ("none", "fold")
STATE, BIFURCATION = (
    {"flag_values": range(len(words)), "flag_meanings": " ".join(words)} for words in (STATES, BIFURCATIONS)
)
ALPHA, GAP = [30.0, 0.0, 10.0, 20.0], [1e-5, 2e-5, 4e-5]


def steady_map(states: list[list[str]], temperature: list[list[float]]) -> xr.Dataset:
    """An archive of α × gap."""
    dims = ("alpha", "gap")
    variables = {
        "steady_state": (
            dims,
            np.array([[STATES.index(name) for name in row] for row in states], dtype=np.int8),
            STATE,
        ),
        "steady_max_temperature": (dims, np.array(temperature)),
        "status": (dims, np.zeros((4, 3), dtype=np.int8)),
    }
    alpha, gap = ("alpha", ALPHA, {"units": "W N-1"}), ("gap", GAP, {"units": "m"})
    return xr.Dataset(variables, coords={"alpha": alpha, "gap": gap, "h": 1e-4})


S, N, R, Q = "settles", "no_contact", "runs_away", "not_asked"
MAP = steady_map(
    [[R, R, N], [S, S, N], [S, S, "permanent_contact"], [S, S, S]],
    [[np.nan, np.nan, 0], [20, 10, 0], [50, 20, 5], [60, 45, 20]],
)


def test_a_range_begins_at_its_mild_end_and_ends_where_a_case_runs_away() -> None:
    found = limits(MAP)
    alpha, gap = found.limits
    assert (found.cases, found.within) == (12, 10)
    assert (alpha.axis, alpha.start, alpha.stop, alpha.next, alpha.limited_by) == ("alpha", 0, 20, 30, "runs_away")
    assert alpha.at == {"gap": 1e-5}
    assert (gap.start, gap.stop, gap.next, gap.limited_by) == (4e-5, 4e-5, 2e-5, "runs_away")
    assert gap.at == {"alpha": 30}
    [alone] = limits(MAP.isel(gap=0)).limits
    assert (alone.stop, alone.next, alone.limited_by, alone.at) == (20, 30, "runs_away", {})
    text = limit_sentence(alpha, MAP, {})
    assert text == "alpha from 0 to 20 W/N: all cases are within; at 30 W/N the rub runs away (gap = 1e-05 m)."


def test_a_bound_ends_a_range_earlier() -> None:
    found = limits(MAP, temperature=40.0)
    alpha, _ = found.limits
    assert (alpha.stop, alpha.next, alpha.limited_by, found.within) == (0, 10, "temperature", 7)
    assert "at 10 W/N the temperature exceeds 40 K" in limit_sentence(alpha, MAP, {"temperature": 40.0})
    none, _ = limits(MAP, temperature=15.0).limits
    assert (none.start, none.stop, none.next) == (None, None, 0)
    assert "no value" in limit_sentence(none, MAP, {"temperature": 15.0})


def test_other_axes_have_the_longest_interval_and_other_schemes_do_not_count() -> None:
    states = [[Q, S, S], [R, S, S], [Q, R, S], [Q, S, S]]
    speed = steady_map(states, [[0.0] * 3] * 4).rename(alpha="frequency")
    found = limits(speed)
    frequency, _ = found.limits
    assert (found.cases, found.within) == (9, 7)
    assert (frequency.start, frequency.stop, frequency.next, frequency.at) == (20, 30, 10, {"gap": 2e-5})
    whole = limits(steady_map([[S] * 3] * 4, [[0.0] * 3] * 4))
    assert [(one.start, one.stop, one.next, one.limited_by) for one in whole.limits] == [
        (0, 30, None, None),
        (4e-5, 1e-5, None, None),
    ]


def branches() -> xr.Dataset:
    """Two branches in α: one folds back at 12, one ends with its range; behind the last point there is nothing."""
    alpha = np.array([[0, 6, 10, 12, 8, 2], [0, 10, 20, np.nan, np.nan, np.nan]], dtype=float)
    names = [[S, S, S, "unstable", "unstable", "unstable"], [S, S, S, *["not_found"] * 3]]
    state = np.array([[STATES.index(name) for name in row] for row in names], dtype=np.int8)
    fold = np.zeros((2, 6), dtype=np.int8)
    fold[0, 3] = BIFURCATIONS.index("fold")
    dims = ("gap", "point")
    variables = {
        "alpha": (dims, alpha, {"units": "W N-1"}),
        "steady_state": (dims, state, STATE),
        "steady_periods": (dims, np.where(np.isnan(alpha), np.nan, 1.0)),
        "steady_max_temperature": (dims, alpha),
        "bifurcation": (dims, fold, BIFURCATION),
        "status": ("gap", np.zeros(2, dtype=np.int8)),
    }
    return xr.Dataset(variables, coords={"gap": ("gap", GAP[:2], {"units": "m"})})


@pytest.mark.parametrize("turned", [False, True])
def test_a_fold_ends_a_branch(turned: bool) -> None:
    dataset = branches().isel(point=slice(None, None, -1)) if turned else branches()
    found = limits(dataset)
    [alpha] = found.limits
    assert (found.cases, found.within) == (9, 6)
    assert (alpha.start, alpha.stop, alpha.next, alpha.limited_by) == (0, 10, 12, "fold")
    assert alpha.at == {"gap": 1e-5}
    assert [(one.start, one.stop, one.next, one.at["gap"]) for one in found.each] == [
        (0, 10, 12, 1e-5),
        (0, 20, None, 2e-5),
    ]
    sentences = [limit_sentence(one, dataset, {}, of_one=True) for one in found.each]
    assert sentences == [
        "gap = 1e-05 m: alpha from 0 to 10 W/N; at 12 W/N a fold ends the branch.",
        "gap = 2e-05 m: alpha from 0 to 20 W/N, as far as it was varied.",
    ]
    assert "at 12 W/N a fold ends the branch (gap = 1e-05 m)" in limit_sentence(alpha, dataset, {})
    cooler = limits(dataset, temperature=7.0).limits[0]
    assert (cooler.stop, cooler.next, cooler.limited_by) == (0, 10, "temperature")


def test_archives_without_steady_rubs_are_refused() -> None:
    with pytest.raises(NothingSteadyError, match="steady"):
        limits(MAP.drop_vars("steady_state"))
    with pytest.raises(NothingSteadyError, match="event_driven"):
        limits(steady_map([[Q] * 3] * 4, [[0.0] * 3] * 4))
