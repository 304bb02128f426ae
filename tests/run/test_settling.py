"""What is said of rubs whose impulses have not settled, by ``run`` and by whatever shows an archive."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quick import quick
from workflow import run_study
from workflow.judges.load_periods import change_of_impulse
from workflow.run import Outcome, warnings_of


def ran(place: Path, periods: int = 16, **more: Any) -> Outcome:
    """A lump near its resonance, undamped, and one that settles in some periods."""
    axes = {"scheme": "event_driven", "h": None, "e": 0.5, "alpha": 0, "scene.chain.damping.mass": [0, 4e3]}
    scene = {"load.frequency": 6.25e3, "load.amplitude": 40, "casing.gap": 5e-5, "duration": periods / 6.25e3}
    study = quick(axes, scene=scene, output={"interval": 4 / 6.25e3 / 16, "histories": [], **more})
    return run_study(study, place / "a.nc", threads=1)


def told(outcome: Outcome) -> list[str]:
    return [line for line in outcome.warnings if "settled" in line]


def test_a_rub_that_has_not_settled_is_told_with_the_case_that_changes_most(tmp_path: Path) -> None:
    outcome = ran(tmp_path)
    (line,) = told(outcome)
    assert line.startswith(
        "1 of 2 ok cases have not settled: the mean impulse of a load period changes by more than 5%"
    )
    with outcome.dataset as archive:
        impulse = archive["period_impulse"].squeeze(drop=True).transpose("mass", "period").values
        last, before = impulse[:, 12:].mean(axis=1), impulse[:, 8:12].mean(axis=1)
        change = np.abs(last - before) / np.maximum(last, before)
        assert change[0] > 0.05 > change[1] > 0
        np.testing.assert_allclose(change_of_impulse(impulse), change)
        assert f"most, {change[0]:.0%}: mass = 0; make `duration` longer" in line
        assert line in warnings_of(archive)
        assert not [one for one in warnings_of(archive.isel(mass=1)) if "settled" in one]


@pytest.mark.parametrize(("periods", "output"), [(7, {}), (16, {"steady": True})])
def test_few_periods_are_not_judged_and_steady_rubs_say_it_themselves(
    periods: int, output: dict[str, Any], tmp_path: Path
) -> None:
    assert told(ran(tmp_path, periods, **output)) == []
