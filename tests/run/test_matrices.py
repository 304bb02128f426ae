"""Studies of structures from files: the built-in ones exported and read back, and archives that need no file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from matrix_files import as_directory, as_npz, matrices_of
from scenes import blade, heavy_chain
from studies import written
from terminal import told
from workflow.archive import provenance
from workflow.models import Structure
from workflow.run import run_study
from workflow.study import StudyError, read_study

STUDY = """
study: rub
scene:
  {model}
  casing: {{gap: {gap}}}
  load: {{amplitude: {amplitude}, frequency: {frequency}}}
  duration: {duration}
axes:
  scheme: [{schemes}]
  alpha: [0, {alpha}]
  h: [{h}]
  e: [0, 0.5]
zip:
  model: {{mechanical_modes: [3, full], thermal_modes: [12, full]}}
"""
HEAVY = """chain: {nodes: 20, mass: 2.5e-3, stiffness: 2.0e7, damping: DAMPING, spacing: 2.5e-3,
          expansion: 8.6e-6, heat_capacity: 1.315, conductance: 0.605, convection: 0.02}"""
BLADE = """blade: {nodes: 20, length: 40 mm, width: 30 mm, thickness: 1 mm, density: 4430, specific_heat: 560,
          conductivity: 7.0, convection: 400, expansion: 9.0e-6, tip_stiffness: 1.0e6, damping: DAMPING}"""
RAYLEIGH = "{mass: 10, stiffness: 2.0e-7}"
RUBS = {
    "chain": (HEAVY, {"gap": 5e-5, "amplitude": 100, "frequency": 20, "duration": 0.1, "alpha": 0.5, "h": 1e-5}),
    "blade": (BLADE, {"gap": 2e-5, "amplitude": 24, "frequency": 5, "duration": 0.1, "alpha": 30, "h": 5e-7}),
}
ALL = "moreau, carpenter, penalty, event_driven"


def ran(directory: Path, name: str, model: str, rub: Mapping[str, Any], schemes: str = ALL) -> xr.Dataset:
    study = written(STUDY.format(model=model, schemes=schemes, **rub), directory, f"{name}.yaml")
    return run_study(read_study(study), directory / f"{name}.nc").dataset.load()


def apart(results: xr.Dataset, reference: xr.Dataset) -> float:
    """Largest difference of a variable, over its largest value along time; balances are rounding and left out."""
    worst = 0.0
    for name in (
        "displacement",
        "temperature",
        "contact_force",
        "contact_impulse",
        "max_temperature",
        "critical_alpha",
    ):
        axis = tuple(k for k, dim in enumerate(reference[name].dims) if dim == "t")
        off, size = np.abs(results[name].values - reference[name].values), np.abs(reference[name].values)
        off, size = (off.max(axis), size.max(axis)) if axis else (off, size)
        worst = max(worst, float(np.max(np.divide(off, size, out=np.zeros_like(off), where=off > 0))))
    return worst


def compared(directory: Path, kind: str, structure: Structure, damping: str, schemes: str) -> None:
    model, rub = RUBS[kind]
    entries = matrices_of(structure)
    as_npz(entries, directory)
    built_in = ran(directory, "built_in", model.replace("DAMPING", damping), rub, schemes)
    assert float(built_in["impacts"].min()) > 0
    for name, words in (("npz", "file: blade.npz, contact: 19"), ("text", "file: blade, contact: 19")):
        as_directory(entries, directory)
        from_file = ran(directory, name, f"matrices: {{{words}, damping: {damping}}}", rub, schemes)
        assert apart(from_file, built_in) < 1e-10
        assert np.array_equal(from_file["impacts"], built_in["impacts"])


def test_the_chain_read_back_rubs_as_it_does(tmp_path: Path) -> None:
    compared(tmp_path, "chain", heavy_chain(), RAYLEIGH, "moreau, event_driven")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["chain", "blade"])
@pytest.mark.parametrize("damping", [RAYLEIGH, "{ratio: 0.01}"])
def test_built_in_structures_read_back_in_every_scheme(kind: str, damping: str, tmp_path: Path) -> None:
    compared(tmp_path, kind, heavy_chain() if kind == "chain" else blade(), damping, ALL)


def test_an_archive_repeats_its_study_without_the_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    as_directory(matrices_of(heavy_chain(nodes=4)), tmp_path / "there")
    model = "matrices: {file: there/blade, contact: 3}"
    rub = {**RUBS["chain"][1], "duration": 0.01, "amplitude": 400}
    text = (
        STUDY.format(model=model, schemes="moreau", **rub)
        .replace("[3, full]", "[1, full]")
        .replace("[12, full]", "[2, full]")
    )
    written(text, tmp_path)
    run_study(read_study(tmp_path / "study.yaml"), "first.nc")
    (tmp_path / "there").rename(tmp_path / "gone")
    with pytest.raises(StudyError, match="is no file"):
        read_study(tmp_path / "study.yaml")
    for command in (
        ["run", "first.nc", "-o", "second.nc"],
        ["verify", "first.nc"],
        ["plan", "first.nc", "-s", "axes.e=[0]"],
    ):
        status, output = told(*command)
        assert status == 0, output
    assert provenance("first.nc")["content_hash"] == provenance("second.nc")["content_hash"]


def test_a_plan_says_what_factors_take_and_warns_before_large_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("workflow.models._factors.MOST_BY_SUPERLU", 100)
    monkeypatch.setattr("workflow.plan._plan.MOST_BY_SUPERLU", 100)
    monkeypatch.setattr("workflow.models._factors._MANY_BYTES", 1e3)
    as_npz(matrices_of(blade(310)), tmp_path)
    text = "study: s\nscene:\n  matrices: {file: blade.npz, contact: 309}\n  casing: {gap: 1e-5}\n  duration: 1e-3\n"
    written(text + "axes: {mechanical_modes: 2, thermal_modes: 2}\n", tmp_path)
    status, output = told("plan", "study.yaml")
    assert status == 0, output
    for kind in ("displacements", "temperatures"):
        assert f"310 {kind}: " in output
        assert f"beware: each factorisation of a compact body of 310 {kind}" in " ".join(output.split())
