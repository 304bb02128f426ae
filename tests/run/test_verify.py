"""`workflow verify`: passes on what was written, and names what was not."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import netCDF4
import numpy as np
import pytest
from scipy import sparse

from hostile import write
from matrix_files import as_npz, matrices_of
from quick import quick
from scenes import heavy_chain, tip_flexibility
from studies import CHAOS, archived, parsed, pinned, written
from terminal import told
from workflow import schemes
from workflow.archive import ArchiveError, _provenance, content_hash, provenance
from workflow.archive._checksums import seal
from workflow.cases import arrange
from workflow.declare import File
from workflow.models import mechanical_modes
from workflow.models._matrix_entries import ROUNDED, shaken
from workflow.models.matrices import Parameters, assemble
from workflow.models.modes import HEAT_COLUMNS, read_table
from workflow.run import _study, _verify, run_study, verify
from workflow.run._verify import sensitivity
from workflow.solve import solve
from workflow.study import read_study

STUDY = quick(
    {"alpha": [0.0, 5.0, 1e9], "scheme": ["moreau", "half"]}, schemes={"half": {"method": "moreau", "theta": 0.5}}
)
"""Of its 18 cases those with the largest alpha are ill-posed."""


whole = archived(STUDY)


@pytest.fixture
def copied(whole: Path, tmp_path: Path) -> Path:
    path = tmp_path / "copied.nc"
    path.write_bytes(whole.read_bytes())
    return path


def wrong(path: Path, sample: int = 18) -> set[str]:
    return {check.name for check in verify(path, sample) if not check.holds}


def resealed(path: Path) -> None:
    """Make content hash and checksum fit what is there, as whoever edits by hand may know how to do."""
    digest = content_hash(path)
    with netCDF4.Dataset(path, "a") as file:
        file["provenance"].setncattr("content_hash", digest)
    seal(path)


@pinned
def test_a_fresh_archive_passes(whole: Path) -> None:
    checks = list(verify(whole, 18))
    assert [check.name for check in checks] == ["bytes", "content", "versions", "cases", "sample"]
    assert all(check.holds and check.judged for check in checks)
    assert checks[-1].detail == "18 cases run again, the same bit for bit"


def test_a_sample_has_each_scheme_and_status(whole: Path) -> None:
    grid = arrange(STUDY)
    with h5py.File(whole) as file:
        status = file["status"][...].ravel()
    kinds = {(cell // grid.inner_count, status[cell]) for cell in range(18)}
    chosen = _verify._sample(whole, grid, provenance(whole), len(kinds))
    assert {(cell // grid.inner_count, status[cell]) for cell in chosen} == kinds


def test_what_other_versions_made_is_repeated_and_not_judged(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its bytes are judged, and its content hash; what its cases differ by is said."""
    edit("contact_impulse", (0, 1, 1), lambda x: 2 * x)(copied)
    resealed(copied)
    assert wrong(copied) == {"sample"}
    monkeypatch.setattr(_verify.archive, "versions", lambda: {**_provenance.versions(), "numpy": "0.1"})
    status, text = told("verify", copied, "--sample", "18")
    assert status == 0
    assert re.search(r"^  versions not judged: numpy [0-9.]+, here 0\.1$", text, re.MULTILINE)
    assert re.search(
        r"^  sample   not judged: .*e = 0\.5, alpha = 5: contact_impulse is \S+ in the archive, \S+ now$",
        text,
        re.MULTILINE,
    )
    edit("contact_impulse", (0, 1, 1), lambda x: 2 * x)(copied)
    assert told("verify", copied)[0] == 1
    seal(copied)
    assert wrong(copied) == {"content"}


def test_what_cannot_be_repeated_is_said_and_by_other_versions_not_judged(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_verify, "solve", lambda *_: {}["displacement"])
    [check] = [c for c in verify(whole) if not c.holds]
    assert (check.name, check.detail) == ("values", "cannot be compared: that ended with KeyError: 'displacement'")
    monkeypatch.setattr(_verify.archive, "code_revision", lambda: "another")
    *_, last = verify(whole)
    assert (last.name, last.holds, last.judged) == ("values", True, False)


def test_cases_of_other_software_in_an_unfinished_run_are_not_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive, revision = tmp_path / "a.nc", _provenance.code_revision()
    for begun_by in ("another", revision):  # what another began stays known
        with monkeypatch.context() as patch:
            patch.setattr(_provenance, "code_revision", lambda begun_by=begun_by: begun_by)
            patch.setattr(_study.archive, "gather", lambda *_: (_ for _ in ()).throw(ArchiveError("stopped")))
            with pytest.raises(ArchiveError, match="stopped"):
                run_study(STUDY, archive)
    run_study(STUDY, archive)
    [found] = [check for check in verify(archive, 0) if check.name == "versions"]
    assert (found.judged, found.detail) == (False, "some cases by others")


def edit(name: str, place: tuple[int, ...], change: Callable[[float], float]) -> Callable[[Path], None]:
    def editing(path: Path) -> None:
        with netCDF4.Dataset(path, "a") as file:
            file.set_auto_mask(False)
            file[name][place] = change(file[name][place])

    return editing


def rewritten(path: Path) -> None:
    with netCDF4.Dataset(path, "a") as file:
        write(file["message"], (0, 0, 2), "another message")


EDITS = {
    "last bit of a metric": edit("contact_impulse", (0, 1, 1), lambda x: np.nextafter(x, 1)),
    "a sample of a history": edit("displacement", (1, 1, 1, 8), lambda x: x * (1 + 1e-15) + 1e-22),
    "a status": edit("status", (1, 1, 1), lambda x: 1),
    "a NaN that has become a number": edit("contact_impulse", (0, 0, 2), lambda x: 1.0),
    "a message": rewritten,
}


@pinned
@pytest.mark.parametrize("editing", EDITS.values(), ids=EDITS.keys())
def test_a_value_edited_by_hand_is_noticed(copied: Path, editing: Callable[[Path], None]) -> None:
    editing(copied)
    assert wrong(copied, 0) == {"bytes"}
    seal(copied)
    assert wrong(copied, 0) == {"content"}
    resealed(copied)
    assert wrong(copied, 0) == set()  # hashes fit again: only running the cases tells
    assert wrong(copied) == {"sample"}


@pinned
def test_another_architecture_may_change_what_rounding_does_and_no_more(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_verify.archive, "processor", lambda: "another one")
    edit("contact_impulse", (0, 1, 1), lambda x: x * (1 + 1e-13))(copied)
    resealed(copied)
    [*_, last] = verify(copied, 18)
    detail = "18 cases run again, the same within the effect of rounding on each (other architecture)"
    assert (last.holds, last.detail) == (True, detail)
    edit("contact_impulse", (0, 1, 1), lambda x: x * (1 + 1e-8))(copied)  # a fixed share of 1e-8 let this pass
    resealed(copied)
    assert wrong(copied) == {"sample"}


@pinned
def test_another_processor_of_the_same_architecture_changes_no_bit(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        _verify.archive, "processor", lambda: f"{provenance(copied)['processor'].split()[0]} another one"
    )
    [*_, last] = verify(copied, 18)
    assert (last.holds, last.detail) == (True, "18 cases run again, the same bit for bit")
    edit("contact_impulse", (0, 1, 1), lambda x: np.nextafter(x, 1))(copied)
    resealed(copied)
    assert wrong(copied) == {"sample"}


def test_errors_that_decided_counts_of_modes_are_compared_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They belong to no history: the changed case has them as the stored one does."""
    auto: dict[str, Any] = {"mechanical_modes": "auto", "thermal_modes": "auto"}
    axes = {"e": 0.0, "alpha": [0.0, 5.0], **auto, "tolerance": 1e-2}
    reference = {"scheme": "event_driven", **auto, "tolerance": 1e-4}
    archive = tmp_path / "a.nc"
    run_study(quick(axes, scene={"chain.nodes": 4}, reference=reference), archive)
    with h5py.File(archive) as file:
        assert {"basis_error", "reference_basis_error"} < set(file)
    monkeypatch.setattr(_verify.archive, "processor", lambda: "another one")
    edit("contact_impulse", (0,), lambda x: x * (1 + 1e-13))(archive)
    resealed(archive)
    assert wrong(archive) == set()


def test_model_errors_of_a_case_that_blew_up_answer_to_rounding_as_those_of_others() -> None:
    axes = {"e": 0.0, "alpha": 5.0, "scheme": ["event_driven", "carpenter"], "h": 4e-4, "mechanical_modes": 2}
    grid = arrange(quick(axes, scene={"chain.nodes": 4}, reference={"scheme": "event_driven"}))
    allowed, ended = [], []
    for outer in range(grid.outer_count):
        solved = solve(grid, outer, np.array([0]))
        ended.append(int(solved.values["status"][0]))
        allowed.append(sensitivity(grid, outer, np.array([0]), solved))
    assert ended == [int(schemes.Status.OK), int(schemes.Status.DIVERGED)]
    for name in ("displacement", "temperature", "impulse"):
        sound, blown_up = (each[f"{name}_model_error"] for each in allowed)
        assert 0.1 < blown_up / sound < 10


def test_a_case_without_digits_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its motion is chaotic: within 0.3 s a change of its data by 1e-12 grows to half of the motion and more."""
    archive = tmp_path / "chaos.nc"
    text = CHAOS.replace("FREQUENCY", "900 Hz").replace("DURATION", "0.3 s") + "output: {interval: 1 ms}\n"
    run_study(parsed(text), archive)
    monkeypatch.setattr(_verify.archive, "processor", lambda: "another one")
    with netCDF4.Dataset(archive, "a") as file:
        file["displacement"][-1] = 0.5 * file["displacement"][-1]
    resealed(archive)
    [*_, last] = verify(archive, 1)
    assert last.holds
    assert "rounding leaves no digit to compare of the case (displacement" in last.detail


@pytest.mark.parametrize(
    ("name", "place", "change", "said"),
    [
        ("alpha", (1,), lambda x: 6.0, "other coordinates than the study gives: alpha"),
        ("provenance/case_hash", (0, 0, 0, 0), lambda x: x ^ 1, ""),
    ],
)
def test_an_edited_case_is_noticed(name: str, place: Any, change: Any, said: str, copied: Path) -> None:
    edit(name, place, change)(copied)
    resealed(copied)
    [check] = [check for check in verify(copied, 0) if not check.holds]
    assert (check.name, check.detail) == ("cases", said or check.detail)


def test_an_edited_study_is_noticed(copied: Path) -> None:
    def study(old: str, new: str) -> None:
        with netCDF4.Dataset(copied, "a") as file:
            text = file["provenance"].getncattr("study")
            assert text.count(old) == 1
            file["provenance"].setncattr("study", text.replace(old, new))
        resealed(copied)

    study('"mass": 0.0025', '"mass": 0.0026')
    assert "cases" in wrong(copied, 0)
    study('"mass": 0.0026', '"mass": 0.0025')
    assert wrong(copied, 0) == set()
    study('"mass"', '"ma:ss"')
    assert wrong(copied, 0) == {"study"}


@pinned
def test_cases_that_failed_are_not_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from workflow.solve import _solve

    def failing(*_: object) -> None:
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(_solve, "run_batch", failing)
        run_study(quick(), tmp_path / "a.nc")
    checks = list(verify(tmp_path / "a.nc"))
    assert all(check.holds for check in checks)
    assert checks[-1].detail.endswith("0 cases run again, the same bit for bit; 9 that failed hold nothing to compare")


BLADE = Path(__file__).parents[2] / "data" / "compressor_blade.npz"

LARGE = """
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
    study = written(LARGE, directory)
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
