"""Files that a study names are replaced while it runs: what was hashed is what is assembled."""

import os
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from matrix_files import MECHANICAL, WRITERS, matrices_of
from scenes import heavy_chain
from studies import refusal, written
from terminal import told
from workflow import models
from workflow.archive import content_hash, provenance
from workflow.run import run_study, verify
from workflow.study import Study, files, read_study

STUDY = """study: replaced
scene:
  {model}
  casing: {{gap: 5e-5}}
  load: {{amplitude: 400, frequency: 200}}
  duration: 2e-3
axes: {{scheme: {schemes}, h: 1e-5, e: [0, 0.5], alpha: [0, 0.5]}}
{more}output: {{interval: 1e-4}}
"""


def given_matrices(write: Callable[[Mapping[str, Any], Path], Path]) -> Callable[[Path, float], str]:
    """Return what writes a chain, some times as stiff, and names it."""

    def give(directory: Path, times: float) -> str:
        entries = matrices_of(heavy_chain(nodes=4))
        place = write({**entries, "stiffness": times * entries["stiffness"]}, directory)
        return f"matrices: {{file: {place.name}, contact: 3}}"

    return give


def given_modes(directory: Path, times: float) -> str:
    (directory / "modes.csv").write_text(
        f"frequency [Hz],damping_ratio,tip\n{300 * times},0.01,9\n{900 * times},0.01,-7\n"
    )
    (directory / "heat.csv").write_text(f"rate [1/s],tip\n{20 * times},0.9\n")
    (directory / "coupling.csv").write_text("-30\n20\n")
    return "modes: {table: modes.csv, heat: heat.csv, coupling: coupling.csv}"


KINDS: dict[str, Callable[[Path, float], str]] = {
    **{write.__name__: given_matrices(write) for write in (*WRITERS, *MECHANICAL)},
    "modes": given_modes,
}


def read(directory: Path, give: Callable[[Path, float], str], schemes: str = "moreau", more: str = "") -> Study:
    return read_study(written(STUDY.format(model=give(directory, 1.0), schemes=schemes, more=more), directory))


def cut(directory: Path, give: Callable[[Path, float], str]) -> None:
    """Cut off the second half of all files of a structure."""
    for path in directory.rglob("*.*"):
        if path.suffix != ".yaml" and path.is_file() and "a.nc" not in str(path):
            os.truncate(path, path.stat().st_size // 2)


def gone(directory: Path, give: Callable[[Path, float], str]) -> None:
    for path in directory.iterdir():
        if path.suffix != ".yaml" and "a.nc" not in path.name:
            shutil.rmtree(path) if path.is_dir() else path.unlink()


@pytest.fixture(autouse=True)
def forgetful() -> None:
    """Have structures assembled anew."""
    models.structure_of.cache_clear()


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_hashed_is_what_is_assembled(kind: str, tmp_path: Path) -> None:
    places = tmp_path / "kept", tmp_path / "changed"
    places[0].mkdir()
    read(places[0], KINDS[kind])
    shutil.copytree(*places)  # a file of MATLAB holds the second in which it was written
    studies = [read_study(place / "study.yaml") for place in places]
    KINDS[kind](places[1], 3.0)
    models.structure_of.cache_clear()  # as in another process
    run_study(studies[1], tmp_path / "changed.nc", threads=1)
    models.structure_of.cache_clear()
    run_study(studies[0], tmp_path / "kept.nc", threads=1)
    assert content_hash(tmp_path / "changed.nc") == content_hash(tmp_path / "kept.nc")
    assert provenance(tmp_path / "changed.nc")["files"] == provenance(tmp_path / "kept.nc")["files"]
    models.structure_of.cache_clear()
    assert all(check.holds for check in verify(tmp_path / "changed.nc", 2))


@pytest.mark.parametrize("change", [cut, gone])
def test_references_and_auto_need_no_file_any_more(change: Callable[..., None], tmp_path: Path) -> None:
    more = "reference: {scheme: event_driven}\n"
    schemes = "[moreau, event_driven], mechanical_modes: auto, thermal_modes: auto, tolerance: 0.1"
    study = read(tmp_path, KINDS["as_npz"], schemes, more)
    change(tmp_path, KINDS["as_npz"])
    models.structure_of.cache_clear()
    assert run_study(study, tmp_path / "a.nc", threads=1).ok


def test_an_archive_repeats_its_study_without_the_files(tmp_path: Path) -> None:
    first, second = tmp_path / "a.nc", tmp_path / "b.nc"
    run_study(read(tmp_path, KINDS["as_directory"]), first, threads=1)
    gone(tmp_path, KINDS["as_directory"])
    assert "is no file" in refusal(read_study, tmp_path / "study.yaml")
    for words in (("run", first, "-o", second), ("verify", first), ("plan", first, "-s", "axes.e=[0]")):
        status, said = told(*words)
        assert status == 0, said
    assert content_hash(first) == content_hash(second)


def test_files_lie_nowhere_when_they_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    room = tmp_path / "room"
    room.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(room))
    study = read(tmp_path, KINDS["as_directory"])
    run_study(study, tmp_path / "a.nc", threads=1)
    files.unpacked(provenance(tmp_path / "a.nc")["files"])
    assert list(room.iterdir()) == []
    room.rmdir()
    models.structure_of.cache_clear()
    with pytest.raises(FileNotFoundError):
        models.structure_of("matrices", study.scene.parameters)


def test_a_file_too_large_to_hold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "MOST_BYTES", 100)
    said = refusal(read, tmp_path, KINDS["as_npz"])
    assert re.search(r"blade\.npz has \d{3,} bytes, and at most 100 are read", said)
