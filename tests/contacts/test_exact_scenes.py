"""``event_driven`` with several contacts against exact answers of an independent solver in 80 bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from workflow.archive import open_archive
from workflow.run import run_study
from workflow.study import read_study

SCENES = Path(__file__).parent / "exact"
NAMES = sorted(place.stem for place in SCENES.glob("*.yaml"))


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_is_that_of_the_exact_solver(name: str, tmp_path: Path) -> None:
    outcome = run_study(read_study(SCENES / f"{name}.yaml"), tmp_path / "a.nc", threads=1)
    assert outcome.ok, outcome.failures
    with open_archive(tmp_path / "a.nc") as archive, np.load(SCENES / f"{name}_exact.npz") as exact:
        one = archive.squeeze()
        assert one["contact"].values.tolist() == exact["contact"].tolist()
        for about in ("displacement", "impulse", "temperature", "contact_impulse"):
            if about in exact:
                np.testing.assert_allclose(one[about], exact[about], rtol=0, atol=1e-9 * np.abs(exact[about]).max())
        np.testing.assert_allclose(one["contact_time"], exact["contact_time"], rtol=2e-5, atol=1e-12)
