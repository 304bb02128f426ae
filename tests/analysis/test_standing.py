"""Who stays stable and accurate: verdicts by their rule, on archives made for it."""

import numpy as np
import pytest
import xarray as xr

from workflow.analysis import ranges, standings
from workflow.schemes import Status
from workflow.variables import COMPARED

H = [1e-5, 1e-4, 1e-3]


def archive(status: object, error: object, residual: object = 0.0, depth: object = 0.0) -> xr.Dataset:
    """One scheme at three steps with two cases each."""
    shape = (1, 3, 2)

    def spread(values: object) -> tuple[tuple[str, ...], np.ndarray]:
        of_step = np.asarray(values)
        return ("scheme", "h", "e"), np.array(np.broadcast_to(of_step[..., None] if of_step.ndim else of_step, shape))

    return xr.Dataset(
        {
            "status": spread(np.asarray(status, dtype=np.int8)),
            **{f"{name}_error": spread(error if name == "impulse" else 0.0) for name in COMPARED},
            "processor_time": spread(1.0),
            "energy_residual": spread(residual),
            "max_penetration": spread(depth),
        },
        coords={"scheme": ["one"], "h": ("h", H, {"units": "s"}), "e": [0.0, 0.5], "gap": 1e-3},
    )


@pytest.mark.parametrize(
    ("status", "error", "residual", "verdict"),
    [
        (Status.OK, 0.01, 0.0, "within 1 %"),
        (Status.OK, 0.0101, 0.0, "within 10 %"),
        (Status.OK, 0.11, -5.0, "beyond 10 %"),
        (Status.OK, np.inf, 0.0, "beyond 10 %"),
        (Status.OK, np.nan, 0.0, "stable"),
        (Status.OK, 0.001, 0.02, "gains energy"),
        (Status.DIVERGED, 0.0, 0.0, "diverged"),
        (Status.ILL_POSED, 0.0, 0.0, "ill-posed"),
        (Status.FAILED, 0.0, 0.0, "failed"),
    ],
)
def test_verdicts_follow_the_rule(status: Status, error: float, residual: float, verdict: str) -> None:
    assert {row.verdict for row in standings(archive(status, error, residual))} == {verdict}


def test_a_part_that_is_lost_is_reported() -> None:
    dataset = archive(Status.OK, 0.0)
    dataset["status"][0, 1, 1] = Status.DIVERGED
    assert [row.verdict for row in standings(dataset)] == ["within 0.1 %", "diverged in part", "within 0.1 %"]
    assert [row.counts for row in standings(dataset)][1] == {"ok": 1, "diverged": 1}


def test_a_gain_shows_beside_a_larger_loss() -> None:
    dataset = archive(Status.OK, 0.001)
    dataset["energy_residual"][0, 0] = [-0.4, 0.03]
    dataset["energy_residual"][0, 1] = [-0.4, 0.0]
    assert [row.verdict for row in standings(dataset)] == ["gains energy", "within 0.1 %", "within 0.1 %"]
    assert standings(dataset)[0].residual == -0.4


def test_ranges_end_before_the_first_step_that_is_not_good() -> None:
    dataset = archive([Status.OK, Status.OK, Status.DIVERGED], [0.001, 0.05, 7.0], depth=[1e-6, 4e-4, 3.0])
    (row,) = ranges(dataset)
    assert (row.stable, row.accurate) == ("0.0001 s", "1e-05 s")
    assert (row.ok, row.cases) == (4, 6)
    assert (row.finest, row.coarsest) == (0.001, 0.05)  # what diverged has no error
    assert row.penetration == pytest.approx(0.4)
    assert row.verdicts == ("within 0.1 %", "within 10 %", "diverged")


def test_steps_near_a_limit_are_told_apart() -> None:
    """Four digits named both 0.00010028 s, the last that holds, and 0.00010031 s, which diverges."""
    dataset = archive([Status.OK, Status.OK, Status.DIVERGED], 0.0)
    near = dataset.assign_coords(h=("h", [1e-4, 1.0028e-4, 1.0031e-4], {"units": "s"}))
    assert ranges(near)[0].stable == "0.00010028 s"


def test_every_and_no_step() -> None:
    (good,) = ranges(archive(Status.OK, 0.0))
    (bad,) = ranges(archive(Status.DIVERGED, 0.0))
    assert (good.stable, good.accurate) == ("every h", "every h")
    assert (bad.stable, bad.accurate) == ("no h", "")


def test_steps_in_any_order() -> None:
    dataset = archive([Status.OK, Status.OK, Status.DIVERGED], [0.001, 0.05, 7.0])
    assert ranges(dataset.isel(h=[2, 0, 1])) == ranges(dataset)


def test_an_archive_without_scheme_step_and_errors() -> None:
    dataset = archive(Status.OK, 0.0).drop_vars(["impulse_error", "energy_residual"]).isel(scheme=0, h=0)
    (row,) = standings(dataset)
    assert (row.scheme, row.step, row.verdict) == ("one", "", "stable")
    assert np.isnan(row.error)
