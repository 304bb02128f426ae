"""``reduction`` in a study: a setting like the counts of modes, an axis, part of a zip and of the reference."""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from quick import hashes_of, quick
from studies import SCENE, parsed
from workflow import reduction
from workflow.archive import open_archive
from workflow.cases import arrange, case_hashes
from workflow.run import run_study
from workflow.solve import solve
from workflow.study import StudyError

OTHER = '''
"""Displacements as Krylov's, temperatures as the default's."""

from workflow.reduction import craig_bampton, krylov

thermal = craig_bampton.thermal


def mechanical(structure, count, duration):
    """As krylov."""
    assert duration == 0.06
    return krylov.mechanical(structure, count, duration)
'''


@pytest.fixture
def other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A basis from outside."""
    (tmp_path / "other.py").write_text(OTHER)
    monkeypatch.setattr(reduction, "__path__", [*reduction.__path__, str(tmp_path)])
    yield "other"
    sys.modules.pop("workflow.reduction.other", None)


def study(text: str) -> str:
    return f"study: a\n{SCENE}output: {{interval: 1 ms}}\n{text}\n"


def test_the_default_keeps_the_identity_of_cases_that_were_run_before_there_were_bases() -> None:
    assert hashes_of(quick({"reduction": "craig_bampton"})) == hashes_of(quick({}))


def test_a_basis_from_outside_is_an_axis(other: str, tmp_path: Path) -> None:
    text = study(
        f"axes: {{reduction: [craig_bampton, krylov, {other}], mechanical_modes: [1, 2], thermal_modes: 2, h: 1e-4}}"
    )
    grid = arrange(parsed(text))
    assert [name for name, _ in grid.dims] == ["reduction", "mechanical_modes"]
    assert len(set(map(bytes, case_hashes(grid)))) == 6
    outcome = run_study(parsed(text), tmp_path / "a.nc", threads=1)
    assert outcome.counts["ok"] == 6
    with open_archive(tmp_path / "a.nc") as archive:
        assert archive.reduction.values.tolist() == ["craig_bampton", "krylov", other]
        default, krylov, same = archive.displacement.sel(mechanical_modes=2).values
        assert np.array_equal(same, krylov)
        assert not np.array_equal(same, default)


def test_it_may_be_zipped_and_stand_in_the_reference(other: str) -> None:
    text = study(
        f"zip: {{model: {{reduction: [craig_bampton, {other}], mechanical_modes: [1, 2]}}}}\n"
        "axes: {thermal_modes: 2, h: 1e-4}\n"
        f"reference: {{scheme: moreau, reduction: {other}, mechanical_modes: 2}}"
    )
    grid = arrange(parsed(text))
    errors = [solve(grid, outer, np.arange(1)).values["displacement_error"].item() for outer in (0, 1)]
    assert errors[0] > errors[1] == 0.0


def test_full_is_not_reduced_on_either_side(other: str) -> None:
    """Mechanical 3 is full for four nodes: the other basis is not asked for displacements."""
    text = study(f"axes: {{reduction: [craig_bampton, {other}], thermal_modes: 1, h: 1e-4}}")
    grid = arrange(parsed(text))
    runs = [solve(grid, outer, np.arange(1)).values["displacement"] for outer in (0, 1)]
    assert np.array_equal(*runs)


@pytest.mark.parametrize("place", ["axes: {{reduction: {}}}", "reference: {{reduction: {}}}"])
def test_the_message_of_an_unknown_basis_names_those_there_are(place: str) -> None:
    with pytest.raises(StudyError, match="`rubin`"):
        parsed(study(place.format("rubbin")))
