"""Contact phases, growth of impulses, and differences of datasets, of known arrays and of archives."""

import numpy as np
import pytest
import xarray as xr

from quick import quick
from studies import FALLING_BALL, parsed
from workflow import compare, contact_phases
from workflow.analysis import impulse_growth
from workflow.archive import open_archive
from workflow.run import run_study

T = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


def forces(*rows: list[float]) -> xr.Dataset:
    coords = {"alpha": np.arange(len(rows), dtype=float), "t": T, "gap": 3.0}
    return xr.Dataset({"contact_force": (("alpha", "t"), np.array(rows))}, coords)


def test_phases_of_known_forces() -> None:
    phases = contact_phases(forces([0, 2, 4, 0, 0, 1], [0, 0, 0, 0, 0, 0], [0, 0, 0, 5, 0, 0], [0, 1, 1, 1, 1, 1]))
    assert dict(phases.sizes) == {"alpha": 4, "phase": 2}
    assert phases["begin"].values == pytest.approx(
        np.array([[0, 0.4], [np.nan, np.nan], [0.2, np.nan], [0, np.nan]]), nan_ok=True
    )
    assert phases["end"].values == pytest.approx(
        np.array([[0.2, 0.5], [np.nan, np.nan], [0.3, np.nan], [0.5, np.nan]]), nan_ok=True
    )
    assert phases["impulse"].sel(alpha=0).values == pytest.approx([0.6, 0.1])
    assert phases["peak_force"].sel(alpha=[0, 2], phase=1).values == pytest.approx([4, 5])
    assert list(phases["phase"].values) == [1, 2]
    assert float(phases["gap"]) == 3.0
    assert phases["impulse"].attrs["units"] == "N s"


def test_a_single_case_and_one_without_contact() -> None:
    one = contact_phases(forces([0, 2, 4, 0, 0, 1]).isel(alpha=0))
    assert one["begin"].dims == ("phase",)
    none = contact_phases(forces([0.0] * 6, [np.nan] * 6))
    assert dict(none.sizes) == {"alpha": 2, "phase": 0}


def test_without_forces_there_are_no_phases() -> None:
    with pytest.raises(ValueError, match=r"no history `contact_force`; name it in `output\.histories`"):
        contact_phases(forces([0.0] * 6).drop_vars("contact_force"))


def test_phases_of_a_ball_hold_its_impacts(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """A ball from 1 m: the first phase holds the first impact, and all of them bear the whole impulse."""
    rest = "axes: {scheme: event_driven, e: [0, 0.7]}\noutput: {interval: 1 ms, histories: [contact_force]}\n"
    run_study(parsed(f"study: ball{FALLING_BALL}{rest}"), tmp_path / "ball.nc")
    with open_archive(tmp_path / "ball.nc") as archive:
        phases = contact_phases(archive)
        assert np.all(phases["begin"].sel(phase=1) <= np.sqrt(2 / 9.81))
        assert np.all(phases["end"].sel(phase=1) >= np.sqrt(2 / 9.81))
        assert phases["impulse"].sum("phase").values == pytest.approx(archive["contact_impulse"].values, rel=1e-9)
        assert int(phases["begin"].sel(e=0).count()) == 1  # it lies where it fell
        bounces = phases["impulse"].sel(e=0.7, phase=[1, 2, 3]).values
        assert bounces == pytest.approx(1.7 * 2 * np.sqrt(2 * 9.81) * 0.7 ** np.arange(3), rel=1e-9)


def cases(scale: float = 1.0, interval: float = 0.1, alphas: tuple[float, ...] = (0.0, 1.0)) -> xr.Dataset:
    t = interval * np.arange(round(1.2 / interval) + 1)
    alpha = np.array(alphas)
    return xr.Dataset(
        {
            "displacement": (("alpha", "t"), scale * (1 + alpha[:, None]) * np.sin(t)),
            "contact_impulse": ("alpha", scale * alpha),
            "critical_alpha": ("alpha", np.full(alpha.size, np.inf)),
            "processor_time": ("alpha", np.full(alpha.size, scale)),
            "status": ("alpha", np.zeros(alpha.size, dtype=np.int8)),
        },
        coords={"alpha": alpha, "t": t, "h": 1e-3 * scale},
    )


def test_differences_of_known_arrays() -> None:
    differences = compare(cases(1.02), cases())
    assert set(differences) == {"displacement", "contact_impulse", "critical_alpha"}
    assert differences["displacement"].values == pytest.approx([0.02, 0.02])
    assert differences["contact_impulse"].values == pytest.approx([0.0, 0.02])
    assert differences["critical_alpha"].values == pytest.approx([0.0, 0.0])
    assert compare(cases(), cases(0.0))["displacement"].values == pytest.approx([np.inf, np.inf])
    assert compare(cases(0.0), cases(0.0))["displacement"].values == pytest.approx([0.0, 0.0])


def test_cases_are_paired_by_label_and_samples_by_instant() -> None:
    """0.3 is not three times 0.1 in binary: instants count, not their bits."""
    differences = compare(cases(1.02, 0.1, (1.0, 3.0, 2.0)), cases(1.0, 0.3, (2.0, 1.0, 5.0)))
    assert sorted(differences["alpha"].values) == [1.0, 2.0]
    assert differences["displacement"].values == pytest.approx([0.02, 0.02])
    finer, coarser = cases(1.0, 0.1), cases(1.0, 0.3)
    finer["displacement"][:, 1::3] = 99.0  # at no common instant
    assert compare(finer, coarser)["displacement"].values == pytest.approx([0, 0], abs=1e-15)
    one = compare(cases(), cases().sel(alpha=1.0))
    assert one["displacement"].values == pytest.approx([0.5, 0.0])


def test_what_cannot_be_compared_is_said() -> None:
    with pytest.raises(ValueError, match="no result in common"):
        compare(cases()[["processor_time"]], cases())
    with pytest.raises(ValueError, match="no `alpha` in common"):
        compare(cases(), cases(1.0, 0.1, (7.0,)).sel(alpha=[7.0]))
    late = cases().assign_coords(t=cases()["t"] + 0.05)
    with pytest.raises(ValueError, match="no two samples `t` in common"):
        compare(cases(), late)


def test_a_comparison_with_the_exact_case_is_the_error_in_the_archive(tmp_path) -> None:  # type: ignore[no-untyped-def]
    axes = {"scheme": ["event_driven", "moreau"], "h": [1e-5, 2e-5], "e": None, "alpha": [0.0, 5.0]}
    output = {"histories": ["displacement", "temperature", "impulse"]}
    study = quick(axes, reference={"scheme": "event_driven"}, output=output, scene={"load.frequency": 250.0})
    run_study(study, tmp_path / "a.nc", threads=1)
    with open_archive(tmp_path / "a.nc") as archive:
        differences = compare(archive, archive.sel(scheme="event_driven").isel(h=0))
        for name in ("displacement", "temperature", "impulse"):
            error = archive[f"{name}_error"].transpose(*differences[name].dims)
            assert float(error.max()) > 1e-6
            assert differences[name].values == pytest.approx(error.values, rel=1e-9, abs=1e-15)


def test_growth_of_the_impulse_is_of_the_last_complete_period_over_the_first() -> None:
    nan = np.nan
    impulse = [[2.0, 3.0, 5.0], [2.0, 3.0, nan], [2.0, nan, nan], [0.0, 1.0, 2.0], [nan, nan, nan]]
    growth = impulse_growth(xr.Dataset({"period_impulse": (("case", "period"), impulse)}))
    assert growth == pytest.approx([2.5, 1.5, nan, nan, nan], nan_ok=True)
    assert impulse_growth(xr.Dataset({"period_impulse": (("case", "period"), [[1.0]])})) is None
    assert impulse_growth(xr.Dataset()) is None
