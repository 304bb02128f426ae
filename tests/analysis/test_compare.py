"""Differences of datasets: those of known arrays, and the errors that an archive holds."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from quick import quick
from workflow import compare
from workflow.archive import open_archive
from workflow.run import run_study


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
