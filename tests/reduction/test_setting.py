"""``reduction`` in a study: a setting like the counts of modes, an axis, part of a zip and of the reference."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from quick import hashes_of, quick
from studies import SCENE, parsed
from workflow import reduction
from workflow.archive import open_archive
from workflow.grid import arrange, case_hashes, plan_study, solve
from workflow.run import run_study
from workflow.study import StudyError, read_study

FEWER = '''"""One vector fewer than asked for, to be told from the default."""

from workflow.reduction import craig_bampton


def mechanical(structure, count, duration):
    """As the default."""
    assert duration == 0.06
    return craig_bampton.mechanical(structure, max(count - 1, 0), duration)


def thermal(structure, count, duration):
    """As the default."""
    return craig_bampton.thermal(structure, count, duration)
'''


@pytest.fixture
def fewer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A basis from outside."""
    (tmp_path / "fewer.py").write_text(FEWER)
    monkeypatch.setattr(reduction, "__path__", [*reduction.__path__, str(tmp_path)])
    yield "fewer"
    sys.modules.pop("workflow.reduction.fewer", None)


def study(text: str) -> str:
    return f"study: a\n{SCENE}output: {{interval: 1 ms}}\n{text}\n"


def test_it_is_a_scalar_coordinate_where_a_study_says_nothing() -> None:
    [scalar] = [s for s in parsed(study("")).scalars if s.path == "reduction"]
    assert scalar.values == ("craig_bampton",)


def test_the_default_keeps_the_identity_of_cases_that_were_run_before_there_were_bases() -> None:
    assert hashes_of(quick({"reduction": "craig_bampton"})) == hashes_of(quick({}))


def test_a_basis_from_outside_is_an_axis(fewer: str, tmp_path: Path) -> None:
    text = study(f"axes: {{reduction: [craig_bampton, {fewer}], mechanical_modes: [1, 2], thermal_modes: 2, h: 1e-4}}")
    grid = arrange(parsed(text))
    assert [name for name, _ in grid.dims] == ["reduction", "mechanical_modes"]
    assert len(set(map(bytes, case_hashes(grid)))) == 4
    outcome = run_study(parsed(text), tmp_path / "a.nc", threads=1)
    assert outcome.counts["ok"] == 4
    with open_archive(tmp_path / "a.nc") as archive:
        assert archive.reduction.values.tolist() == ["craig_bampton", fewer]
        same = archive.displacement.sel(reduction=fewer, mechanical_modes=2).values
        assert np.array_equal(same, archive.displacement.sel(reduction="craig_bampton", mechanical_modes=1).values)
        assert not np.array_equal(same, archive.displacement.sel(reduction="craig_bampton", mechanical_modes=2).values)


def test_it_may_be_zipped_and_stand_in_the_reference(fewer: str) -> None:
    text = study(
        f"zip: {{model: {{reduction: [craig_bampton, {fewer}], mechanical_modes: [1, 2]}}}}\n"
        "axes: {thermal_modes: 2, h: 1e-4}\n"
        "reference: {scheme: moreau, reduction: craig_bampton, mechanical_modes: 1}"
    )
    grid = arrange(parsed(text))
    errors = [solve(grid, outer, np.arange(1)).values["displacement_error"].item() for outer in (0, 1)]
    assert errors == [0.0, 0.0]


def test_full_is_not_reduced_on_either_side(fewer: str) -> None:
    """Mechanical 3 is full for four nodes: the basis that drops a vector is not asked for displacements."""
    text = study(f"axes: {{reduction: [craig_bampton, {fewer}], thermal_modes: 1, h: 1e-4}}")
    grid = arrange(parsed(text))
    runs = [solve(grid, outer, np.arange(1)).values["displacement"] for outer in (0, 1)]
    assert np.array_equal(*runs)


def test_plan_names_it() -> None:
    plan = plan_study(parsed(study("axes: {mechanical_modes: 1}")))
    assert [v.text for v in plan.scene if v.path == "reduction"] == ["craig_bampton"]


@pytest.mark.parametrize("place", ["axes: {{reduction: {}}}", "reference: {{reduction: {}}}"])
def test_the_message_of_an_unknown_basis_names_those_there_are(place: str) -> None:
    with pytest.raises(StudyError, match="`rubin`"):
        parsed(study(place.format("rubbin")))


@pytest.mark.parametrize(
    "content", ["raise RuntimeError('torn')\n", "def mechanical(structure, count, duration): ...\n"]
)
def test_a_broken_basis_breaks_only_studies_that_name_it(
    content: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "torn.py").write_text(content)
    monkeypatch.setattr(reduction, "__path__", [*reduction.__path__, str(tmp_path)])
    parsed(study("axes: {mechanical_modes: 1}"))
    for text in ("axes: {reduction: torn}", "axes: {reduction: [craig_bampton, torn]}", "reference: {reduction: torn}"):
        with pytest.raises(StudyError, match=r"torn.*cannot be used|cannot be used.*torn"):
            read_study(study(text))
    sys.modules.pop("workflow.reduction.torn", None)
