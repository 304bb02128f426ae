"""Branches of steady rubs from the study to the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studies import BLADE_SCENE, parsed
from workflow import run_study
from workflow.analysis import labels, limits
from workflow.report import write_report
from workflow.run import verify

STUDY = f"""study: branches{BLADE_SCENE}axes:
  scheme: event_driven
  scene.casing.gap: [15 um, 20 um]
  alpha: {{branch: [0, 20, 40]}}
  mechanical_modes: 3
  thermal_modes: 12
output: {{steady: true}}
"""


@pytest.mark.slow
def test_the_fold_of_the_blade_is_stored_verified_told_and_drawn(tmp_path: Path) -> None:
    archive = tmp_path / "branches.nc"
    dataset = run_study(parsed(STUDY.replace("duration: 2 s", "duration: 1 s")), archive, threads=2).dataset.load()
    flags = labels(dataset["bifurcation"]).values
    folds = [float(dataset["alpha"].values[k][row == "fold"][0]) for k, row in enumerate(flags)]
    assert folds == pytest.approx([5.412509721, 8.4308307735], abs=2e-7)  # 1e-8 of the range
    assert np.all(dataset["status"] == 0)
    assert all(check.holds for check in verify(archive))
    [limit] = limits(dataset).limits
    assert (limit.axis, limit.start, limit.limited_by) == ("alpha", 0.0, "fold")
    assert limit.next == pytest.approx(folds[0])
    page = write_report(archive).page
    assert page is not None
    assert "runs away or jumps" in page.read_text(encoding="utf-8")
