"""Boundaries and uncertain numbers from a study to its archive; the words of both, and what is refused."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from workflow import labels, plots, read_study, run_study
from workflow.analysis import limit_lines, limits
from workflow.archive import open_archive
from workflow.cases import arrange, case_hashes
from workflow.cli import app
from workflow.cli._studies import _lines
from workflow.plan import plan_study
from workflow.study import StudyError

CHAIN = {"nodes": 1, "mass": 0.01, "stiffness": 40000, "damping": {"mass": 40}, "spacing": 0.1, "expansion": 2.4e-5}
HEAT = {"heat_capacity": 0.2, "conductance": 1.1, "convection": 0.4, "heating": 2}
START = {"displacement": -0.0014792908130043729, "velocity": 0.17700865732665788, "temperature": 85.60599937488763}
SCENE = {
    "chain": CHAIN | HEAT,
    "casing": {"gap": 0.0013},
    "load": {"amplitude": 10.0, "frequency": 2500 / (2 * np.pi)},
    "initial": START,
    "duration": 1,
}
GAP, ALPHA = "scene.casing.gap", {"boundary": [8.0, 15.0, 12]}
FOLDS = {8.0: 1.647611482479e-3, 15.0: 1.735289106109e-3}
"""Gap of the fold by alpha, by a solver of 40 digits; its slope at 8 W/N is 1e-6/.0797663246."""


def study(axes: dict[str, Any] | None = None, uncertain: dict[str, Any] | None = None) -> dict[str, Any]:
    varied = {"scheme": "event_driven", "e": 0.4, GAP: {"branch": [0.0013, 0.0018, 12]}, "alpha": ALPHA}
    steady = {"periods": 1, "samples": 4} | ({} if uncertain is None else {"uncertain": uncertain})
    axes = {path: content for path, content in (varied | (axes or {})).items() if content is not None}
    return {"study": "folds", "scene": SCENE, "axes": axes, "output": {"steady": steady}}


@pytest.fixture(scope="module")
def folds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fold of a heated mass over alpha and gap, and what a slower load and a change of mass do to its gap."""
    place = tmp_path_factory.mktemp("folds") / "folds.nc"
    outcome = run_study(study(uncertain={"alpha": 1, "e": 0.01}), place, threads=1)
    assert outcome.ok
    return place


def read(place: Path) -> xr.Dataset:
    with open_archive(place) as opened:
        return opened.load()


def test_a_fold_is_followed_over_both_numbers(folds: Path) -> None:
    archive = read(folds)
    assert archive["alpha"].item() == 8.0  # of the branch, which is no dimension
    assert labels(archive["boundary_kind"]).values.tolist() == ["fold", *7 * ["none"]]
    assert labels(archive["boundary_end"]).values.tolist() == ["range", *7 * ["none"]]
    assert archive["boundary_gap"].dims == archive["boundary_alpha"].dims == ("curve", "curve_point")
    assert archive["boundary_gap"].attrs["units"] == "m"
    assert archive["boundary_alpha"].attrs["units"] == "W N-1"
    curve = archive.isel(curve=0)
    for k, (alpha, gap) in zip((0, -1), FOLDS.items(), strict=True):
        assert float(curve["boundary_alpha"][k]) == pytest.approx(alpha, abs=1e-9)
        assert float(curve["boundary_gap"][k]) == pytest.approx(gap, rel=1e-9)
    assert (curve["boundary_other"] < 1).all()
    np.testing.assert_allclose(curve["boundary_angle"], 0.0, atol=1e-6)
    assert archive.isel(curve=slice(1, None))["boundary_gap"].isnull().all()


def test_the_shift_of_a_bifurcation_is_that_of_its_boundary(folds: Path) -> None:
    archive = read(folds)
    at = int(np.argmax(archive["bifurcation"].values > 0))
    assert archive["bifurcation_shift"].dims == ("uncertain", "point")
    assert archive["bifurcation_shift"].attrs["units"] == "m"
    assert archive["uncertain"].values.tolist() == ["alpha", "e"]
    assert archive["uncertain_value"].values.tolist() == [1.0, 0.01]
    assert archive["uncertain_unit"].values.tolist() == ["W N-1", "1"]
    alpha, e = archive["bifurcation_shift"].isel(point=at).values
    assert alpha == pytest.approx(1e-6 / 0.0797663246, rel=1e-8)
    assert e == pytest.approx(1e-6 / 0.0797663246 * 2.404591992697, rel=1e-7)
    assert archive["bifurcation_shift"].drop_isel(point=at).isnull().all()


def test_heat_acts_beside_a_branch_without(tmp_path: Path) -> None:
    """A branch at α = 0 has the temperatures of its boundary, and of a coupling that is not quite 0."""
    cold: dict[str, Any] = study({"alpha": {"boundary": [0.0, 2.0, 3]}}, {"alpha": 0.1})
    begins = {name: value for name, value in START.items() if name != "temperature"}
    cold["scene"] = SCENE | {"chain": CHAIN | HEAT | {"heating": 0}, "initial": begins}
    assert run_study(cold, tmp_path / "cold.nc", threads=1).ok
    archive = read(tmp_path / "cold.nc")
    gap, alpha = (archive[name].isel(curve=0).values for name in ("boundary_gap", "boundary_alpha"))
    assert alpha == pytest.approx([0, 1, 2], abs=1e-6)
    shift = archive["bifurcation_shift"].isel(uncertain=0).max().item()
    assert shift == pytest.approx(0.1 * (4 * gap[1] - 3 * gap[0] - gap[2]) / 2, rel=1e-3)


def test_a_range_without_bifurcations_has_no_boundary_and_a_message(tmp_path: Path) -> None:
    plain = study({GAP: {"branch": [0.0013, 0.0014, 3]}, "alpha": {"boundary": [8.0, 9.0, 3]}})
    outcome = run_study(plain, tmp_path / "none.nc", threads=1)
    assert outcome.ok
    archive = read(tmp_path / "none.nc")
    assert (archive["boundary_kind"] == 0).all()
    assert "no branch has a bifurcation" in str(archive["message"].values)


STIFF = {
    "chain": {"nodes": 1, "mass": 1, "stiffness": 1, "damping": {"mass": 0.04}, "heat_capacity": 1},
    "casing": {"gap": 1.2, "flexibility": 0.04},
    "load": {"mean": 0.1, "amplitude": 1, "frequency": 1.609368218015 / (2 * np.pi), "phase": 0.25},
    "initial": {"displacement": -2.4981210350381513, "velocity": 4.2020412256701025},
    "duration": 1,
}
"""A mass whose rub has a fold at a flexibility of 0.05 m/N."""


@pytest.mark.parametrize(
    ("scene", "name", "ends", "fold"),
    [
        (SCENE, "clearance", [0.0, 5e-4], FOLDS[8.0] - 0.0013),
        (STIFF, "flexibility", [0.045, 0.055], 0.05),
    ],
)
def test_branches_along_numbers_of_the_casing(
    tmp_path: Path, scene: dict[str, Any], name: str, ends: list[float], fold: float
) -> None:
    plain = study({GAP: None, "alpha": 8.0 if scene is SCENE else None, f"scene.casing.{name}": {"branch": [*ends, 6]}})
    outcome = run_study(plain | {"scene": scene}, tmp_path / "branch.nc", threads=1)
    assert outcome.ok
    archive = read(tmp_path / "branch.nc")
    folds = archive[name].values[labels(archive["bifurcation"]).values == "fold"]
    assert folds == pytest.approx([fold], rel=1e-9)


def test_both_are_words_of_the_case_and_no_words_change_none() -> None:
    def hashed(given: dict[str, Any]) -> bytes:
        return case_hashes(arrange(read_study(given))).tobytes()

    several = [
        study(),
        study({"alpha": 8.0}),
        study({"alpha": {"boundary": [8.0, 14.0, 12]}}),
        study({"alpha": {"boundary": [8.0, 15.0, 13]}}),
        study(uncertain={"e": 0.01}),
        study(uncertain={"e": 0.02}),
        study(uncertain={"e": 0.02, "alpha": 1}),
        study(uncertain={"alpha": 1, "e": 0.02}),
    ]
    assert len(set(map(hashed, several))) == len(several)
    assert hashed(study({"alpha": 8.0}, {})) != hashed(study({"alpha": 8.0}, {"e": 0.01}))
    assert "uncertain" not in str(read_study(study()).resolved())


def test_a_plan_says_what_is_followed() -> None:
    plan = plan_study(study(uncertain={GAP.replace("gap", "clearance"): "1 um", "e": 0.01}))
    texts = {value.path: value.text for value in plan.scene}
    assert texts["alpha"] == "8 W/N to 15 W/N, over which boundaries are followed"
    assert "  of a branch  point 12, curve 8, curve_point 12" in [*_lines(plan)]
    assert texts["output.steady.uncertain"] == "scene.casing.clearance: 1 µm, e: 0.01"


@pytest.mark.parametrize(
    ("axes", "uncertain", "message"),
    [
        ({GAP: None}, None, r"axes.alpha: is a boundary without a branch; write `\{branch: \[from, to, count\]\}`"),
        ({"e": {"boundary": [0.4, 0.5, 3]}}, None, "cannot be followed; write one boundary only"),
        ({"h": {"boundary": [1e-5, 1e-4, 3]}, "alpha": 1}, None, "axes.h: cannot be followed"),
        ({"alpha": {"boundary": [8.0, 8.0, 3]}}, None, "begins and ends with the same value"),
        ({"alpha": {"boundary": [8.0, 9.0, 1]}}, None, "is out of range"),
        ({"alpha": {"boundary": [8.0, -1.0, 3]}}, None, "is out of range"),
        ({"scene.chain.nodes": {"boundary": [1, 3, 3]}, "alpha": 8}, None, "a real-valued axis of its own"),
        ({GAP: {"boundary": [-1e-2, 1e-3, 3]}, "alpha": {"branch": [8, 9, 3]}}, None, "starts inside the casing"),
        ({GAP: 0.0013, "alpha": 8}, {"e": 0.1}, "uncertain: moves bifurcations of a branch, and no axis is one"),
        ({}, {GAP: "1 um"}, "uncertain.scene.casing.gap: is the number that is branched"),
        ({}, {"scene.casing.gap.tip": "1 um"}, "gap.tip: is no number of this scene"),
        ({}, {"scene.friction.coefficient": 0.1}, "coefficient: is no number of this scene"),
        ({}, {"scene.load.frequncy": 0.1}, "did you mean `scene.load.frequency`"),
        ({}, {"scene.load.frequency": "1 um"}, "is not a frequency"),
    ],
)
def test_what_cannot_be_followed_or_uncertain_is_refused(
    axes: dict[str, Any], uncertain: dict[str, Any] | None, message: str
) -> None:
    with pytest.raises(StudyError, match=message):
        read_study(study(axes, uncertain))


def test_limits_print_the_boundary_and_how_its_end_moves(folds: Path) -> None:
    told = CliRunner().invoke(app, ["limits", str(folds)])
    assert told.exit_code == 0
    first, moves, head, *rows, count, arms = told.output.splitlines()
    assert first == "gap from 0.0013 to 0.00164761 m the rub settles; there a fold ends it."
    assert moves == "gap up to 0.00164761 ± 1.3e-05 m (alpha ± 1 W/N), ± 3e-05 m (e ± 0.01), to first order."
    assert head == "boundary 1: fold, its end: range"
    assert rows[0] == "  gap 0.00164761 m at alpha 8 W/N"
    assert rows[-1] == "  gap 0.00173529 m at alpha 15 W/N"
    assert len(rows) == 5
    assert "within" in count
    assert "arms of this branch" in arms
    archive = read(folds)
    lacks = archive.assign(bifurcation_shift=archive["bifurcation_shift"].where(archive["uncertain"] != "e"))
    moves = limit_lines(limits(lacks), lacks, {})[1]
    assert moves == "gap up to 0.00164761 ± 1.3e-05 m (alpha ± 1 W/N), ± unknown (e ± 0.01), to first order."


def shaded(archive: xr.Dataset) -> list[Any]:
    """Corners of the areas that a picture of boundaries shades, ``(corner, 2)`` each."""
    [panel] = plots.boundary(archive).axes
    return [area.get_paths()[0].vertices for area in panel.collections]


def test_the_guide_s_study_gives_what_it_says(tmp_path: Path) -> None:
    guide = (Path(__file__).parents[2] / "studies" / "GUIDE.md").read_text(encoding="utf-8")
    (text,) = (block for block in re.findall(r"```yaml\n(.*?)```", guide, re.DOTALL) if "boundary: [" in block)
    archive = tmp_path / "folds.nc"
    assert run_study(read_study(text).with_({"axes.alpha": {"boundary": [8, 33, 3]}}), archive, threads=1).ok
    line = CliRunner().invoke(app, ["limits", str(archive)]).stdout.splitlines()[1]
    assert f"`limits` adds `{line}`" in " ".join(guide.split())


def test_the_picture_shades_below_the_fold(folds: Path) -> None:
    archive = read(folds)
    [corners] = shaded(archive)
    alpha, gap = corners.T
    np.testing.assert_allclose([alpha.min(), alpha.max()], [8.0, 15.0])
    np.testing.assert_allclose([gap.min(), gap[alpha == 8.0].max()], [1.3, 1e3 * FOLDS[8.0]], rtol=1e-9)  # mm
    np.testing.assert_allclose(gap.max(), 1e3 * FOLDS[15.0], rtol=1e-9)


@pytest.mark.parametrize(("kind", "reach"), [(1, 15.0), (2, 11.0)])
def test_a_boundary_that_only_the_other_end_has_ends_the_area_but_a_fold(folds: Path, kind: int, reach: float) -> None:
    archive = read(folds)
    points = np.linspace(0, 1, 12)
    archive["boundary_kind"][1] = kind
    archive["boundary_alpha"][1], archive["boundary_gap"][1] = 15 - 4 * points, np.full(12, 0.0014)
    archive["boundary_other"][1] = 0.5
    [corners] = shaded(archive)
    assert corners[:, 0].max() == pytest.approx(reach)
    archive["boundary_other"][1] = 1.5  # not of stability
    [corners] = shaded(archive)
    assert corners[:, 0].max() == pytest.approx(15.0)


def test_a_boundary_that_turns_or_loses_stability_ends_the_area(folds: Path) -> None:
    archive = read(folds)
    archive["boundary_other"][0, 7:] = 1.1
    [corners] = shaded(archive)
    assert corners[:, 0].max() == pytest.approx(float(archive["boundary_alpha"][0, 6]))
    turn = float(archive["boundary_alpha"][0, 4])
    archive["boundary_alpha"][0, 5:] = turn - 0.1 * np.arange(1, 8)
    [corners] = shaded(archive)
    assert corners[:, 0].max() == pytest.approx(turn)
    with pytest.raises(ValueError, match="there are no boundaries"):
        plots.boundary(archive.drop_vars([name for name in archive.data_vars if str(name).startswith("boundary_")]))
