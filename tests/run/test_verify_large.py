"""`workflow verify` of structures from files: what a processor's linear algebra makes of them passes, and no more."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from test_verify import edit, resealed

from matrix_files import as_npz, matrices_of
from scenes import heavy_chain, tip_flexibility
from studies import written
from workflow.declare import File
from workflow.models import mechanical_modes
from workflow.models._matrix_entries import ROUNDED, shaken
from workflow.models.matrices import Parameters, assemble
from workflow.models.modes import HEAT_COLUMNS, read_table
from workflow.run import _verify, run_study, verify
from workflow.study import read_study

BLADE = Path(__file__).parents[2] / "data" / "compressor_blade.npz"

STUDY = """
study: large
scene:
  matrices: {file: blade.npz, damping: {mass: 8, stiffness: 1.0e-6}}
  casing: {gap: 30 um}
  load: {amplitude: 20, frequency: 150 Hz}
  duration: 0.02 s
axes: {alpha: 2, h: 1e-5, reduction: krylov, mechanical_modes: 6, thermal_modes: 12}
output: {interval: 0.5 ms}
"""
"""A twisted blade of 810 displacements; reduced by LAPACK, two kinds of processor agree to 1e-9."""


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("large")
    (directory / "blade.npz").symlink_to(BLADE)
    study = written(STUDY, directory)
    run_study(read_study(study), directory / "large.nc")
    return directory / "large.nc"


NAMES = ("contact_impulse", "max_temperature", "critical_alpha")


def test_what_is_not_pinned_is_compared_within_rounding_and_no_more(
    large: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another processor's BLAS changes these numbers by up to 1e-9; one changed by 1e-6 is found."""
    monkeypatch.setattr(_verify, "is_pinned", lambda: False)
    samples = []
    for change in (2e-10, 1e-6):
        path = tmp_path / f"{change}.nc"
        path.write_bytes(large.read_bytes())
        for name in NAMES:
            edit(name, (), lambda x, change=change: x * (1 + change))(path)  # type: ignore[misc]
        resealed(path)
        samples.append([check for check in verify(path) if check.name == "sample"])
    [rounded], falsified = samples
    assert rounded.holds
    assert "within the effect of rounding on each (other linear algebra)" in rounded.detail
    assert not any(check.holds for check in falsified)
    assert [name for name in NAMES if any(f"{name} is" in check.detail for check in falsified)] == list(NAMES)


@pytest.mark.slow
@pytest.mark.parametrize("core", ["Nehalem", "Haswell", "Zen", "SkylakeX"])
def test_it_is_verified_on_every_kind_of_processor(large: Path, core: str) -> None:
    if core == "SkylakeX" and "avx512f" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("this processor has no AVX-512")
    environment = {**os.environ, "OPENBLAS_CORETYPE": core}
    done = subprocess.run(
        [sys.executable, "-m", "workflow", "verify", str(large)], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_matrices_of_a_file_are_shaken(tmp_path: Path) -> None:
    """Frequencies by the share, and what depends on small differences of large entries by more."""
    entries = {**matrices_of(heavy_chain()), "labels": np.arange(20)}
    path = as_npz(entries, tmp_path)
    file = File("", "blade.npz", str(path))
    old, new = (assemble(Parameters(replace(file, shaken=share), contact=19)) for share in (0.0, 1e-9))
    ratio = mechanical_modes(new).values / mechanical_modes(old).values
    assert 1 - ratio == pytest.approx(1e-9, rel=1e-2)  # M grows by the share, K1 falls
    assert tip_flexibility(new) / tip_flexibility(old) - 1 == pytest.approx(1e-9, rel=1e-2)
    for written_as in (entries, {name: sparse.csr_array(entries[name]) for name in ("mass", "stiffness", "coupling")}):
        changed = shaken(written_as, 1e-9)
        for name in ("mass", "stiffness"):
            now, before = (
                np.asarray(m.todense() if sparse.issparse(m) else m) for m in (changed[name], written_as[name])
            )
            assert np.array_equal(now, now.T)
            there = before != 0
            apart = np.abs(now[there] / before[there] - 1)
            assert apart.max() - apart.min() <= 3 * ROUNDED
            assert np.array_equal(now == 0, ~there)


def test_tables_of_modes_are_shaken(tmp_path: Path) -> None:
    (tmp_path / "heat.csv").write_text("rate,tip\n3,2\n5,1\n")
    file = File("", "heat.csv", str(tmp_path / "heat.csv"), shaken=1e-9)
    ratio = read_table(file, HEAT_COLUMNS) / np.array([[3.0, 2.0], [5.0, 1.0]])
    assert ratio - 1 == pytest.approx(np.array([[1e-9, -1e-9]] * 2), rel=1e-6)
