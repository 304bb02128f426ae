"""Ranges of axes in which every rub settles within bounds, of maps and of branches."""

import numpy as np
import pytest
import xarray as xr

from workflow.analysis import NothingSteadyError, limit_lines, limit_sentence, limits

STATES = ("settles", "no_contact", "permanent_contact", "unstable", "runs_away", "not_found", "not_asked")
BIFURCATIONS = ("none", "fold", "period_doubling", "torus", "grazing", "branch_point")
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


def branch(name: str, ends: tuple[float, float], points: list[tuple[float, str, str]], unit: str = "m") -> xr.Dataset:
    """One branch between two ends, of points with a value, a state and a bifurcation."""
    values, states, flags = zip(*points, strict=True)
    variables = {
        name: ("point", np.array(values), {"units": unit, "branch": ends}),
        "steady_state": ("point", np.array([STATES.index(one) for one in states], dtype=np.int8), STATE),
        "steady_periods": ("point", np.where(np.isnan(values), np.nan, 1.0)),
        "steady_max_temperature": ("point", np.array(values)),
        "bifurcation": ("point", np.array([BIFURCATIONS.index(one) for one in flags], dtype=np.int8), BIFURCATION),
        "status": ((), np.int8(0)),
    }
    return xr.Dataset(variables)


U = "unstable"
HIDDEN = [(4.0, N, "none"), (0.9, N, "grazing"), (2.0, U, "none"), (3.5, U, "fold"), (2.0, S, "none"), (0.1, S, "none")]


def branches() -> xr.Dataset:
    """Two branches in α: one folds back at 12, one ends with its range; behind the last point there is nothing."""
    stable = [[(alpha, S, "none") for alpha in alphas] for alphas in ((0.0, 6.0, 10.0), (0.0, 10.0, 20.0))]
    folded = [*stable[0], (12.0, U, "fold"), (8.0, U, "none"), (2.0, U, "none")]
    whole = [*stable[1], *[(np.nan, "not_found", "none")] * 3]
    both = [branch("alpha", (0.0, 20.0), points, "W N-1") for points in (folded, whole)]
    return xr.concat(both, "gap").assign_coords(gap=("gap", GAP[:2], {"units": "m"}))


@pytest.mark.parametrize("turned", [False, True])
def test_a_fold_ends_a_branch(turned: bool) -> None:
    dataset = branches().isel(point=slice(None, None, -1)) if turned else branches()
    found = limits(dataset)
    [alpha] = found.limits
    assert (found.cases, found.within) == (9, 6)
    assert (alpha.start, alpha.stop, alpha.next, alpha.limited_by) == (0, 12, 12, "fold")
    assert alpha.at == {"gap": 1e-5}
    assert [(one.start, one.stop, one.next, one.at["gap"]) for one in found.each] == [
        (0, 12, 12, 1e-5),
        (0, 20, None, 2e-5),
    ]
    sentences = [limit_sentence(one, dataset, {}, of_one=True) for one in found.each]
    assert sentences == [
        "gap = 1e-05 m: alpha from 0 to 12 W/N the rub settles; there a fold ends it.",
        "gap = 2e-05 m: alpha from 0 to 20 W/N the rub settles, as far as it was varied.",
    ]
    text = limit_sentence(alpha, dataset, {})
    assert text == "alpha from 0 to 12 W/N all branches keep within; there a fold ends it (gap = 1e-05 m)."
    cooler = limits(dataset, temperature=7.0).limits[0]
    assert (cooler.stop, cooler.next, cooler.limited_by) == (0, 10, "temperature")


def lines(dataset: xr.Dataset, **bounds: float) -> list[str]:
    return limit_lines(limits(dataset, **bounds), dataset, bounds)


@pytest.mark.parametrize("turned", [False, True])
def test_every_arm_of_a_branch_is_told_with_its_ends(turned: bool) -> None:
    """A free motion ends at a grazing; a rub lives behind a fold far beyond it."""
    points = HIDDEN[::-1] if turned else HIDDEN
    assert lines(branch("gap", (4.0, 0.1), points)) == [
        "gap from 4 to 0.9 m nothing is touched; there an impact begins or ends.",
        "gap from 0.1 to 3.5 m the rub settles; there a fold ends it.",
        "4 of 6 within; 2 unstable.",
        "Ranges are of the arms of this branch: another start may lead to another rub.",
    ]


@pytest.mark.parametrize("turned", [False, True])
def test_an_unstable_arm_at_the_same_values_does_not_count(turned: bool) -> None:
    points = [(1.0, S, "none"), (3.5, U, "fold"), (2.0, U, "none"), (1.0, U, "none")]
    dataset = branch("gap", (1.0, 4.0), points[::-1] if turned else points)
    assert lines(dataset)[0] == "gap from 1 to 3.5 m the rub settles; there a fold ends it."
    [limit] = limits(dataset).each
    assert (limit.start, limit.stop, limit.next, limit.limited_by, limit.begun_by) == (1, 3.5, 3.5, "fold", None)


def test_an_arm_between_two_folds_has_both_ends_and_a_bound_cuts_it() -> None:
    points = (0.0, U, "none"), (5.0, U, "fold"), (4.0, S, "none"), (3.0, S, "none"), (2.0, U, "fold"), (9.0, U, "none")
    dataset = branch("flow", (0.0, 9.0), [*points])
    assert lines(dataset)[0] == "flow from 2 to 5 m the rub settles; at 2 m a fold ends it and at 5 m a fold ends it."
    cut = "flow from 2 to 3 m the rub settles; at 2 m a fold ends it and at 4 m the temperature exceeds 3 K."
    assert lines(dataset, temperature=3.0)[0] == cut


@pytest.mark.parametrize(
    ("last", "ending"),
    [
        ((7.0, S, "none"), "to 7 m the rub settles; there its points end."),
        ((9.0, S, "none"), "to 9 m the rub settles, as far as it was varied."),
        ((7.0, S, "grazing"), "to 7 m the rub settles; there an impact begins or ends."),
        ((7.0, U, "branch_point"), "to 7 m the rub settles; there branches cross."),
        ((7.0, U, "none"), "to 5 m the rub settles; at 7 m the rub is unstable."),
    ],
)
def test_the_end_of_a_branch_is_said(last: tuple[float, str, str], ending: str) -> None:
    assert lines(branch("flow", (0.0, 9.0), [(0.0, S, "none"), (5.0, S, "none"), last]))[0] == f"flow from 0 {ending}"


def test_a_grazing_with_stable_rubs_on_both_sides_ends_nothing() -> None:
    points = [(4.0, N, "none"), (3.0, N, "grazing"), (2.0, S, "none")]
    assert lines(branch("gap", (4.0, 2.0), points))[0] == "gap from 4 to 2 m it keeps within, as far as it was varied."


def transients(contacts: int) -> xr.Dataset:
    """Plain cases over a gap, without steady rubs, of which the one at 1e-5 has not settled at its last contact."""
    own = ("contact",) if contacts else ()
    impulse = np.ones((3, max(contacts, 1), 16))
    impulse[0, -1] = np.linspace(1, 2, 16)
    impulse[2, :, 12:] = np.nan  # fewer periods than the others
    impulse[1, -1, -1], impulse[2, -1, 11] = 1.05, 1.1
    shaped = impulse if contacts else impulse[:, 0]
    hottest = np.array([60.0, 40.0, 20.0])[:, None] + np.arange(max(contacts, 1))
    x = np.zeros((3, max(contacts, 1), 5))
    x[:, 0, 2] = [1e-6, -3e-5, 2e-5]
    variables = {
        "period_impulse": (("gap", *own, "period"), shaped),
        "max_temperature": (("gap", *own), hottest if contacts else hottest[:, 0]),
        "displacement": (("gap", *own, "t"), x if contacts else x[:, 0]),
        "status": ("gap", np.zeros(3, dtype=np.int8)),
        "runaway": ("gap", np.zeros(3, dtype=np.int8)),
    }
    return xr.Dataset(variables, coords={"gap": ("gap", GAP, {"units": "m"})})


@pytest.mark.parametrize("contacts", [0, 2])
@pytest.mark.parametrize(
    ("bounds", "stop", "word"),
    [
        ({}, 2e-5, "unsettled"),
        ({"temperature": 30.0}, 4e-5, "temperature"),
        ({"displacement": 2.5e-5}, 4e-5, "displacement"),
        ({"impulse": 1.2}, 2e-5, "impulse"),
        ({"impulse": 1.08}, None, "impulse"),
    ],
)
def test_plain_transients_are_within_where_they_settle_and_keep_the_bounds(
    contacts: int, bounds: dict[str, float], stop: float | None, word: str
) -> None:
    found = limits(transients(contacts), **bounds)
    [gap] = found.limits
    assert (gap.stop, gap.limited_by) == (stop, word)
    assert gap.start == (None if stop is None else 4e-5)
    assert "from this start" in found.remarks[0]


def test_sensors_of_displacements_count_and_what_is_not_there_is_asked_for() -> None:
    plain = transients(0).drop_vars("displacement")
    with pytest.raises(NothingSteadyError, match="histories or sensors of displacements"):
        limits(plain, displacement=1.0)
    with pytest.raises(NothingSteadyError, match="load periods"):
        limits(plain.drop_vars("period_impulse"), impulse=1.0)
    extremes = {"sensor_max": [[9.0, 1e-6]] * 3, "sensor_min": [[0.0, -2e-6], [0.0, -4e-6], [0.0, -2e-6]]}
    sensed = plain.assign({name: (("gap", "sensor"), np.array(values)) for name, values in extremes.items()})
    sensed = sensed.assign_coords(sensor_unit=("sensor", np.array(["K", "m"], dtype=object)))
    [gap] = limits(sensed, displacement=3e-6).limits
    assert (gap.stop, gap.next, gap.limited_by) == (4e-5, 2e-5, "displacement")
    assert limits(sensed, displacement=5e-6).limits[0].limited_by == "unsettled"


def test_a_case_that_is_not_ok_ends_a_range_and_few_periods_are_said() -> None:
    plain = transients(0)
    plain["status"][1] = 2
    assert limits(plain).limits[0].limited_by == "failed"
    short = plain.isel(period=slice(7))
    assert limits(short, temperature=90.0).remarks[1].startswith("2 of 3 cases have fewer than 8 load periods")
    many = plain.expand_dims(start=[0.0, 1.0]).assign_coords(
        start=("start", [0.0, 1.0], {"study_path": "scene.initial.velocity"})
    )
    assert "from these starts" in limits(many).remarks[0]


def test_few_load_periods_judge_nothing_alone_and_no_case_that_may_run_away() -> None:
    short = transients(0).isel(period=slice(7))
    with pytest.raises(NothingSteadyError, match="no 8 load periods"):
        limits(short)
    short["runaway"][1] = 1
    [gap] = limits(short, temperature=90.0).limits
    assert (gap.stop, gap.next, gap.limited_by) == (4e-5, 2e-5, "unsettled")


def test_archives_without_steady_rubs_are_refused() -> None:
    with pytest.raises(NothingSteadyError, match="coating"):
        limits(transients(0).assign(worn_depth=("gap", np.zeros(3))))
    with pytest.raises(NothingSteadyError, match="steady"):
        limits(MAP.drop_vars("steady_state"))
    with pytest.raises(NothingSteadyError, match="event_driven"):
        limits(steady_map([[Q] * 3] * 4, [[0.0] * 3] * 4))
