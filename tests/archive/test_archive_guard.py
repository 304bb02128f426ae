"""Files are tried out in another process: whatever happens there, this one tells it and goes on."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from workflow.archive import ArchiveError, _guard
from workflow.archive._guard import try_out


def hang(path: Path) -> str:
    time.sleep(60)
    return ""


def crash(path: Path) -> str:
    os.kill(os.getpid(), signal.SIGSEGV)
    return ""


def refuse(path: Path) -> str:
    raise ArchiveError(f"{path}: no")


def fail(path: Path) -> str:
    raise ValueError("odd")


def leave(path: Path) -> str:
    with open(path.with_name("notes"), "a") as notes:
        notes.write(f"{os.getpid()}\n")
    return "done"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.nc"
    path.write_bytes(b"1")
    return path


@pytest.mark.parametrize(
    ("work", "message"),
    [
        (hang, r"a\.nc: damaged.*comes to no end"),
        (crash, r"a\.nc: damaged.*ends with SIGSEGV"),
        (refuse, r"a\.nc: no$"),
        (fail, r"a\.nc: damaged.*\(odd\)"),
    ],
)
def test_an_outcome_in_the_other_process_is_reported_here(
    work: object, message: str, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_guard, "LONGEST", 0.3)
    with pytest.raises(ArchiveError, match=message):
        try_out(file, work)  # type: ignore[arg-type]


def test_a_file_is_tried_again_when_it_has_changed(file: Path) -> None:
    for content in (b"1", b"1", b"12"):
        if file.read_bytes() != content:
            file.write_bytes(content)
        assert try_out(file, leave) == "done"
        assert try_out(file, leave) == "done"
    processes = file.with_name("notes").read_text().split()
    assert len(processes) == 2
    assert str(os.getpid()) not in processes
