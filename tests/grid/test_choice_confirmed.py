"""What trials cannot confirm is not said to be confirmed: too many vectors, and conditions inside the corners."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scenes import relative
from workflow.analysis import decided
from workflow.archive import open_archive
from workflow.cli import app
from workflow.grid import arrange, plan_study, solve
from workflow.run import run_study
from workflow.study import read_study

AUDIT = Path(__file__).parent / "audit"


def test_more_than_half_of_what_trials_measure_against_is_not_confirmed() -> None:
    """Of 330 coordinates, true errors at a tolerance of 1e-6 with 100 + 100 vectors are 4.61e-5 and 6.66e-5."""
    study = read_study(AUDIT / "auto_of_330_coordinates.yaml")
    grid = arrange(study)
    solved = solve(grid, 0, np.zeros(1, dtype=np.int64))
    assert np.isnan(solved.values["basis_error"]).all()
    assert solved.values["status"].tolist() == [0]
    assert "not confirmed" in solved.messages[0]
    assert any("not confirmed" in text for text in plan_study(study).warnings)


@pytest.mark.slow  # the full solution of 330 + 330 coordinates
def test_what_half_of_the_vectors_confirm_is_true() -> None:
    study = read_study(AUDIT / "auto_of_330_coordinates.yaml").with_({"axes.tolerance": 1e-2})
    grid = arrange(study)
    choice = grid.choice(0)
    assert choice is not None
    assert max(choice.mechanical_modes, choice.thermal_modes) <= 50
    full = study.with_({"axes.mechanical_modes": "full", "axes.thermal_modes": "full"})
    reduced, truth = (solve(arrange(one), 0, np.zeros(1, dtype=np.int64)).values for one in (study, full))
    error = max(relative(reduced[name], truth[name]) for name in ("displacement", "temperature"))
    assert choice.error == pytest.approx(error, rel=0.05)


@pytest.mark.parametrize(("name", "where", "error"), [("1", 12, 2.25e-2), ("2", 14, 5.27e-2)])
def test_a_condition_inside_the_corners_that_misses_the_tolerance_has_its_own_error(
    name: str, where: int, error: float
) -> None:
    grid = arrange(read_study(AUDIT / f"auto_inside_an_axis_{name}.yaml"))
    choice = grid.choice(0)
    assert choice is not None
    values = solve(grid, 0, np.arange(grid.inner_count)).values
    expected = np.full(18, choice.error)
    expected[where] = max(values[f"{history}_model_error"][where] for history in ("displacement", "temperature"))
    assert values["basis_error"] == pytest.approx(expected, rel=1e-12)
    assert expected[where] == pytest.approx(error, rel=5e-3)


def test_a_reference_poorer_than_the_case_tells_no_error_of_its_basis() -> None:
    study = read_study(AUDIT / "auto_inside_an_axis_1.yaml")
    reference = study.reference
    assert reference is not None
    poor = replace(study, reference=replace(reference, values={**reference.values, "mechanical_modes": 2}))
    grid = arrange(poor)
    choice = grid.choice(0)
    assert choice is not None
    assert solve(grid, 0, np.arange(18)).values["basis_error"].tolist() == [choice.error] * 18


def test_show_and_plan_count_the_conditions_that_meet_the_tolerance(tmp_path: Path) -> None:
    study, path = AUDIT / "auto_inside_an_axis_1.yaml", tmp_path / "a.nc"
    run_study(read_study(study), path, threads=1)
    with open_archive(path) as archive:
        [one] = decided(archive)
    assert (one.met, one.conditions) == (17, 18)
    for command in (["show", str(path)], ["plan", str(study), "-o", str(path)]):
        assert "met in 17 of 18 conditions" in " ".join(CliRunner().invoke(app, command).output.split())
