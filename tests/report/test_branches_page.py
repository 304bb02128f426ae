"""Branches of steady rubs from the study to the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from workflow import run_study
from workflow.analysis import labels, limits
from workflow.report import write_report
from workflow.run import verify
from workflow.study import parse_study

STUDY = """
study: branches
scene:
  blade: {nodes: 20, length: 40 mm, width: 30 mm, thickness: 1 mm, density: 4430, specific_heat: 560, conductivity: 7.0,
          convection: 400, expansion: 9.0e-6, tip_stiffness: 1.0e6, damping: {mass: 10.0, stiffness: 2.0e-7}}
  casing: {gap: 20 um}
  load: {amplitude: 24, frequency: 5 Hz}
  duration: 1 s
axes:
  scheme: event_driven
  scene.casing.gap: [15 um, 20 um]
  alpha: {branch: [0, 20, 40]}
  mechanical_modes: 3
  thermal_modes: 12
output: {steady: true}
"""


@pytest.mark.slow
def test_the_fold_of_the_blade_is_stored_verified_told_and_drawn(tmp_path: Path) -> None:
    archive = tmp_path / "branches.nc"
    dataset = run_study(parse_study(STUDY, "branches.yaml"), archive, threads=2).dataset.load()
    folds = [
        float(dataset["alpha"].values[k][row == "fold"][0])
        for k, row in enumerate(labels(dataset["bifurcation"]).values)
    ]
    assert folds == pytest.approx([5.412509721, 8.4308307735], abs=2e-7)  # 1e-8 of the range
    assert np.all(dataset["status"] == 0)
    assert all(check.holds for check in verify(archive))
    [limit] = limits(dataset).limits
    assert (limit.axis, limit.start, limit.limited_by) == ("alpha", 0.0, "fold")
    assert limit.next == pytest.approx(folds[0])
    page = write_report(archive).page
    assert page is not None
    assert "runs away or jumps" in page.read_text(encoding="utf-8")
