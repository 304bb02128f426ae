"""Figures for papers, drawn with plain arguments as the reference shows; quantities of single scenes."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from scripts import script
from workflow import open_archive, plots

DATA = Path(__file__).parents[2] / "data"


LONG = ("sobol_indices", "sweep", "clearance")
"""Examples that run larger studies."""


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in script("reference").FIGURES]
)
def test_the_examples_of_the_reference_draw(name: str) -> None:
    reference = script("reference")
    assert (reference.FILE.with_name("figures") / f"{name}.png").exists()
    assert all(panel.has_data() for panel in reference.drawn(name).axes)


def test_histories_along_a_dimension() -> None:
    with open_archive(DATA / "abstract_figure.nc") as archive:
        figure = plots.histories(archive.sel(alpha=30).isel(scheme=0), along="model")
        drawn = [one for one in figure.axes[1].get_lines() if np.size(one.get_xdata()) == archive.sizes["t"]]
        for k, one in enumerate(drawn):
            expected = archive["temperature"].sel(alpha=30).isel(scheme=0, model=k).values
            assert np.asarray(one.get_ydata()) == pytest.approx(expected)
        assert len(drawn) == 2
        assert figure._repr_png_().startswith(b"\x89PNG")  # a notebook shows it, with no magic line
        with pytest.raises(ValueError, match=r"`h` is no dimension of the cases; they lie along scheme, model, alpha"):
            plots.histories(archive, along="h")
        with pytest.raises(ValueError, match="keeps no histories"):
            plots.histories(archive.drop_dims("t"))


def test_a_map_of_one_metric_and_lines_of_a_selection() -> None:
    with open_archive(DATA / "work_precision.nc") as archive:
        full = archive.isel(model=0).sel(scheme="event_driven", e=0)
        panel, _ = plots.scene_map(full, "alpha", "h", "max_temperature").axes
        shown = np.ma.filled(panel.collections[0].get_array(), np.nan)
        assert shown == pytest.approx(full["max_temperature"].transpose("h", "alpha").values)
        with pytest.raises(
            ValueError, match="`scheme` is no dimension with numbers; the cases lie along scheme, model"
        ):
            plots.scene_map(archive, "scheme", "h")
        with pytest.raises(ValueError, match="`t` is no metric"):
            plots.scene_map(full, "alpha", "h", "t")
        lines = plots.convergence(archive.sel(e=0.9, alpha=1).isel(model=0)).axes[0].get_lines()
        euler = archive["impulse_error"].sel(scheme="implicit_euler", e=0.9, alpha=1).isel(model=0).values
        drawn = np.asarray(lines[0].get_ydata())
        assert drawn == pytest.approx(euler[euler < 3])
        for draw in (plots.work_precision, plots.convergence):
            with pytest.raises(ValueError, match="several steps `h`"):
                draw(full.isel(h=0))


def test_energy_that_an_impact_leaves() -> None:
    """A mass of 2 kg hits at 3 m/s with e = 0.5: it keeps e² of its energy, whatever the step."""
    case = xr.Dataset(
        {"velocity": ("t", [3.0, 3.0, -1.5, -1.5]), "impulse": ("t", [0.0, 0.0, 9.0, 9.0]), "energy_residual": 0.01},
        coords={"t": [0.0, 1.0, 2.0, 3.0]},
    )
    assert script("scene_pictures").energy_kept(case, energy=9.0) == pytest.approx(0.25 + 0.01)
