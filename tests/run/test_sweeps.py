"""Sweeps: each point of an axis starts from the state in which the one before ended, and a line is one unit."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quick import counted, interrupted
from studies import cut_finely, refusal, written
from terminal import told
from workflow import plots
from workflow.analysis import NothingSteadyError, labels, limits
from workflow.archive import are_among, content_hash, open_archive
from workflow.cases import arrange, case_hashes
from workflow.plan import plan_study
from workflow.run import run_study, verify
from workflow.schemes import Status
from workflow.solve import _solve, solve
from workflow.study import Study, checks, read_study

FREQUENCY = "scene.load.frequency"
CHAIN: dict[str, Any] = {
    "nodes": 4, "mass": 2.5e-3, "stiffness": 4e6, "damping": {"mass": 10, "stiffness": 2e-7}, "spacing": 2.5e-3,
    "expansion": 8.6e-6, "heat_capacity": 1.3, "conductance": 0.6, "convection": 0.02,
}  # fmt: skip


def sweep(axes: dict[str, Any] | None = None, scene: dict[str, Any] | None = None, **more: Any) -> Study:
    """Return a study of a chain that rubs while the frequency of its load goes up."""
    load = {"mean": 20.0, "amplitude": 100.0, "frequency": 50.0, "phase": 0.3}
    moving = {"chain": CHAIN, "casing": {"gap": 5e-5}, "load": load, "duration": 0.03, **(scene or {})}
    own = {"h": 1e-5, "alpha": 20.0, FREQUENCY: {"sweep": [50.0, 90.0, 5]}, **(axes or {})}
    output = {"interval": 1e-3, "histories": ["displacement", "velocity", "temperature"]}
    return read_study({"study": "swept", "scene": moving, "axes": own, "output": output, **more})


def given_that_state(study: Study, start: Any, value: float) -> Study:
    """Return the study of one point of a sweep: a case that starts so, with the phases that have gone on."""
    scene = study.scene
    axis = study.swept
    assert axis is not None
    initial = {name: getattr(start, name)[0].tolist() for name in ("displacement", "velocity", "temperature")}
    turned: dict[str, Any] = {"scene.load.phase": scene.load.phase + 2 * np.pi * start.load_turns[0, 0]}
    for group, turns in (("load", start.load_turns[0, 1:]), ("casing", start.casing_turns[0])):
        for k, entry in enumerate(getattr(scene, group).harmonics):
            turned[f"scene.{group}.harmonics.{k}.phase"] = entry.phase + 2 * np.pi * turns[k]
    return study.with_({"scene.initial": initial, f"axes.{axis.path}": value, **turned})


HARMONICS = [{"order": 2, "amplitude": 30.0}]
MOVING = {
    "speed": 50.0,
    "load": {"mean": 60.0, "amplitude": 60.0, "frequency": 70.0, "harmonics": HARMONICS},
    "casing": {"gap": 5e-5, "harmonics": [{"order": 1, "amplitude": 5e-6, "phase": 0.4}]},
}
OVER_SPEED = {FREQUENCY: 70.0, "scene.speed": {"sweep": [50.0, 40.0, 4]}}
SCHEMES = (
    *("event_driven", "moreau"),
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("carpenter", "paoli_schatzman", "penalty")),
)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    ("scene", "axes"),
    [
        ({}, {}),
        ({"initial": "static"}, {"e": 0.5, "mechanical_modes": 2, "thermal_modes": 1}),
        ({}, {"alpha": {"sweep": [30.0, 0.0, 3]}, FREQUENCY: 60.0}),
        (MOVING, OVER_SPEED),
        (MOVING | {"chain": CHAIN | {"spin": {"radius": 0.1}}}, OVER_SPEED),
    ],
    ids=["frequency", "reduced", "alpha", "speed", "structure"],
)
def test_a_point_equals_a_case_given_the_state_before(
    scheme: str, scene: Any, axes: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit, also where a tip is inside its casing, as schemes may leave it, or by rounding."""
    monkeypatch.setattr(checks, "_start", lambda *words: [])
    study = sweep({"scheme": scheme, **axes}, scene)
    grid = arrange(study)
    assert study.swept is not None
    every = solve(grid, 0, np.arange(grid.inner_count))
    assert (every.values["status"] == Status.OK).all()
    start = None
    for point, value in enumerate(study.swept.values):
        one = _solve._solve_or_tell(grid, 0, np.array([point]), None, start)
        alone = one if start is None else solve(arrange(given_that_state(study, start, value)), 0, np.array([0]))
        for name, array in every.values.items():
            if name != "processor_time" and not name.startswith("period"):
                assert alone.values[name][0].tobytes() == array[point].tobytes(), (point, name)
        start = one.following


@pytest.mark.parametrize("scheme", ["event_driven", "moreau"])
@pytest.mark.parametrize("moves", [False, True], ids=["still", "moving"])
@pytest.mark.parametrize("kind", ["given", *(pytest.param(k, marks=pytest.mark.slow) for k in ("reduced", "several"))])
def test_a_tip_that_is_held_stays_held(scheme: str, moves: bool, kind: str, tmp_path: Path) -> None:
    """Through coordinates of a file in which its place is a sum: no impact that rounding makes, and no refusal."""
    size, casing = 6, {"gap": 5e-5}
    links = np.eye(size) - np.eye(size, k=-1)
    row = np.array([0.1, -0.2, 0.3, 0.1, 0.5, 0.8])
    entries = {
        "mass": np.diag(np.linspace(1, 0.6, size)),
        "stiffness": 2e5 * links.T @ links,
        "damping": 20 * np.eye(size),
    }
    rows = np.stack([row, np.eye(size)[3]]) if kind == "several" else row
    np.savez(tmp_path / "blade.npz", contact=rows, load=row, **entries)
    if moves:
        casing |= {"harmonics": [{"frequency": 130.0, "amplitude": 5e-6, "phase": 0.2}]}
    scene = {
        "matrices": {"file": str(tmp_path / "blade.npz"), **({"contact": "contact"} if kind == "several" else {})},
        "casing": casing,
        "load": {"mean": 60.0, "amplitude": 1.0, "frequency": 7.3},
        "initial": "static",
        "duration": 0.5,
    }
    axes = {"scheme": scheme, "h": 1e-4, "mechanical_modes": 2 if kind == "reduced" else "full"}
    axes |= {"scene.load.mean": {"sweep": [60.0, 66.0, 5]}}
    output = {"interval": 1e-2, "histories": []}
    grid = arrange(read_study({"study": "held", "scene": scene, "axes": axes, "output": output}))
    values = solve(grid, 0, np.arange(5)).values
    held = values["contact_time"].reshape(5, -1).max(axis=1)
    assert held == pytest.approx(0.5, rel=1e-9)
    assert (values["impacts"].reshape(5, -1)[:, 0] == (scheme == "moreau")).all()  # whose contacts begin at t = 0


LINES = {"scheme": ["event_driven", "moreau"], "e": [0.0, 0.4, 0.8]}
SHORT, LONG = ({FREQUENCY: {"sweep": [50.0, last, count]}} for last, count in ((90.0, 5), (110.0, 7)))


@pytest.mark.parametrize("stop", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_stopped_and_extended_sweeps_are_as_from_nothing(
    stop: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line is one unit: a task computes whole lines of what is missing; points that are stored stay as they are."""
    cut_finely(monkeypatch, 1)
    archive = tmp_path / "a.nc"
    with counted() as asked:
        interrupted(sweep({**LINES, **SHORT}), archive, stop)
    assert len(asked) == stop + 1
    assert all(inner == list(range(inner[0], inner[0] + 5)) and inner[0] % 5 == 0 for inner in asked)
    outcome = run_study(sweep({**LINES, **SHORT}), archive)
    assert (outcome.ok, outcome.resumed) == (True, 5 * stop)
    with open_archive(archive) as data:
        times = data["processor_time"].load()
    with counted() as asked:
        assert run_study(sweep({**LINES, **LONG}), archive).resumed == 30
    assert sorted(asked) == sorted(2 * [[7 * line + k for k in (5, 6)] for line in range(3)])
    with open_archive(archive) as data:
        assert data["frequency"].attrs["sweep"].startswith("each point starts")
        assert list(data["status"].dims)[-1] == "frequency"
        assert (data["processor_time"].isel(frequency=slice(5)).values == times.values).all()
    monkeypatch.undo()
    run_study(sweep({**LINES, **LONG}), tmp_path / "b.nc", threads=2)
    assert content_hash(archive) == content_hash(tmp_path / "b.nc")
    assert list(verify(archive, 3))[-1].detail.startswith("3 lines of the sweep run again, the same ")


def test_another_first_point_makes_other_cases(tmp_path: Path) -> None:
    """A hash is of all points before: what follows another point is dropped, a line from the other end is another."""
    up = case_hashes(arrange(sweep(SHORT)))
    for other in ([60.0, 90.0, 4], [90.0, 50.0, 5]):
        assert not are_among(case_hashes(arrange(sweep({FREQUENCY: {"sweep": other}}))), up).any()
    assert are_among(case_hashes(arrange(sweep({FREQUENCY: [50.0, 60.0]}))), up).tolist() == [True, False]


def test_after_a_point_that_failed_its_line_does_not_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its neighbour does; all that failed is run again by --retry, from the line's first point on."""
    run = _solve.run_batch

    def failing(settings: Any, cases: Any, sampling: Any, **asked: Any) -> Any:
        if ((cases.e == 0.4) & (cases.load_harmonics.frequency[:, 0] == 70.0)).any():
            raise FloatingPointError("the blade is gone")
        return run(settings, cases, sampling, **asked)

    monkeypatch.setattr(_solve, "run_batch", failing)
    study, archive = sweep({"scheme": "event_driven", "e": [0.0, 0.4], **SHORT}), tmp_path / "a.nc"
    outcome = run_study(study, archive)
    assert outcome.counts == {"ok": 7, "failed": 3}
    with open_archive(archive) as data:
        messages = data["message"].sel(e=0.4).values.tolist()
    ended = "not run: the sweep ended at frequency = 70.0, which is failed"
    assert messages == ["", "", "FloatingPointError: the blade is gone", ended, ended]
    monkeypatch.undo()
    assert run_study(study, archive, retry=True).resumed == 7
    run_study(study, tmp_path / "b.nc")
    assert content_hash(archive) == content_hash(tmp_path / "b.nc")
    before = sweep({"scheme": "event_driven", "e": [0.0, 0.4], FREQUENCY: {"sweep": [90.0, 50.0, 5]}})
    assert run_study(before, archive, drop=True).resumed == 0


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"axes": {"scene.casing.gap": {"sweep": [1e-5, 2e-5, 3]}, FREQUENCY: 50.0}}, "gap: cannot be swept"),
    ({"axes": {"e": {"sweep": [0, 0.5, 3]}, FREQUENCY: 50.0}}, "e: cannot be swept"),
    ({"axes": {"alpha": {"sweep": [0, 5, 3]}}}, "is a second sweep"),
    ({"axes": {"alpha": {"branch": [0, 5, 3]}, "scheme": "event_driven"}}, "is a sweep beside a branch"),
    ({"reference": {"scheme": "event_driven"}}, "is a sweep beside a reference"),
    ({"axes": {"mechanical_modes": "auto", "tolerance": 1e-3}}, "is a sweep beside `auto`"),
    ({"zip": {"z": {"sample": "random", "points": 4, "of": {"e": [0, 1]}}}}, "is a sweep beside drawn numbers"),
    (
        {"zip": {"z": {"alpha": {"sweep": [0, 5, 3]}}}},
        "write a list or lin: what is followed, or swept, is a real-valued axis",
    ),
    (
        {"axes": {"h": 7e-5}},
        "7e-05 s does not divide the duration, as a sweep needs; write e.g. 6.993006993",
    ),
    ({"axes": {FREQUENCY: {"sweep": [5, 5, 3]}}}, "begins and ends with the same value"),
]


@pytest.mark.parametrize(("parts", "message"), REFUSED)
def test_what_a_sweep_does_not_stand_beside_is_refused(parts: dict[str, Any], message: str) -> None:
    assert message in refusal(sweep, **parts)


def test_steps_end_with_the_duration_up_to_rounding() -> None:
    assert 9 * 1e-3 != 0.009
    assert sweep(scene={"duration": 9 * 1e-3}).swept is not None


def test_a_plan_counts_lines(tmp_path: Path) -> None:
    study = sweep({**LINES, **SHORT})
    plan = plan_study(study)
    assert (plan.cases, plan.points, plan.dims[-1]) == (30, 5, ("frequency", 5))
    status, said = told("plan", written(study.text, tmp_path))
    assert status == 0
    assert "6 lines × 5 points, each from the state at the end of the one before; a line is one unit of work" in said


def test_a_scheme_without_an_end_state_is_refused_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    run = _solve.run_batch
    monkeypatch.setattr(_solve, "run_batch", lambda *words, **asked: replace(run(*words, **asked), end=None))
    solved = solve(arrange(sweep()), 0, np.arange(5))
    assert (solved.values["status"] == Status.FAILED).all()
    assert solved.messages[0].startswith("ContractError: the scheme gives no `end`, the state from which")


def test_limits_are_not_of_points_that_depend_on_others(tmp_path: Path) -> None:
    data = run_study(sweep({"scheme": "event_driven"}), tmp_path / "a.nc").dataset
    with pytest.raises(NothingSteadyError, match="holds a sweep"):
        limits(data)


def flagged(branch: Any, name: str) -> float:
    """Return the frequency of the one bifurcation of a kind."""
    (at,) = np.flatnonzero(labels(branch["bifurcation"]).values == name)
    return float(branch["frequency"].values[at])


@pytest.mark.slow
def test_both_jumps_of_an_impact_oscillator_are_where_branches_end(tmp_path: Path) -> None:
    """Swept up, impacts end at the fold of their branch; swept down, they begin where motion without them grazes."""
    scene = {
        "chain": {"nodes": 1, "mass": 1, "stiffness": 1, "damping": {"mass": 0.1}, "heat_capacity": 1},
        "casing": {"gap": 1},
        "load": {"amplitude": 0.2},
        "duration": 600,
    }

    def run(name: str, axis: Any, start: float = 0.0) -> Any:
        axes = {"scheme": "event_driven", "e": 0.3, FREQUENCY: axis}
        own = {**scene, "initial": {"displacement": start}}
        study = {"study": name, "scene": own, "axes": axes, "output": {"interval": 1, "histories": []}}
        return run_study(study, tmp_path / f"{name}.nc").dataset

    impacts = run("impacts", {"branch": [0.18, 0.2, 60]}, -3.0)
    fold, grazing = flagged(impacts, "fold"), flagged(run("free", {"branch": [0.17, 0.19, 20]}), "grazing")
    up, down = run("up", {"sweep": [0.16, 0.2, 41]}), run("down", {"sweep": [0.2, 0.16, 41]})
    last = [swept["period_impulse"].isel(period=95).values for swept in (up, down)]  # one of 96 to 120
    frequency = up["frequency"].values
    assert grazing < fold - 0.01
    assert abs(frequency[last[0] > 0].max() - fold) < 1e-3
    assert abs(frequency[::-1][last[1] > 0].max() - grazing) < 1e-3
    outside = (frequency < grazing - 1e-3) | (frequency > fold + 1e-3)
    np.testing.assert_allclose(last[0][outside], last[1][::-1][outside], rtol=1e-6)
    figure = plots.sweep(up, "period_impulse", down, impacts)
    named = figure.axes[0].get_legend_handles_labels()[1]
    assert named == ["branch, stable", "branch, unstable", "sweep up", "sweep down"]
    every_third = up["period_impulse"].where(up["period_impulse"].isnull(), np.arange(up.sizes["period"]) % 3 == 0)
    means = plots.sweep(up.assign(period_impulse=every_third), "period_impulse").axes[0].get_lines()[-1].get_ydata()
    assert np.ptp(means) < 1e-12 * np.max(means)
