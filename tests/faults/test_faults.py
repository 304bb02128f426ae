"""Disks that are full, shards that are damaged, archives that are hostile: clear errors, nothing lost."""

import errno
import json
import math
import os
import pickle
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

from quick import interrupted, quick
from studies import cut_finely, written
from terminal import told
from workflow.archive import ArchiveError, _files, content_hash, open_archive, parts_of, run_lock
from workflow.archive._checksums import seal
from workflow.run import run_study

STUDY = quick({"e": [0.0, 0.2, 0.5, 0.9], "alpha": [0.0, 5.0, 20.0, 50.0]})


@pytest.fixture(autouse=True)
def finely(monkeypatch: pytest.MonkeyPatch) -> None:
    """A task, and a shard, for each of the four rows."""
    cut_finely(monkeypatch)


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> str:
    archive = tmp_path_factory.mktemp("faults") / "whole.nc"
    run_study(STUDY, archive)
    return content_hash(archive)


@pytest.mark.parametrize("extended", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_disk_that_is_full_at_any_flush(
    extended: bool, tmp_path: Path, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each flush of a run fails in turn; the same command then goes on."""
    archive, sync = tmp_path / "a.nc", os.fsync
    calls, before = [0], None
    if extended:
        run_study(quick({"e": [0.5, 0.0]}), archive)
        before = archive.read_bytes()
    for failing in range(1, 40):
        archive.unlink(missing_ok=True)
        if before is not None:
            archive.write_bytes(before)
        calls[0] = 0

        def full(descriptor: int, failing: int = failing) -> None:
            calls[0] += 1
            if calls[0] == failing:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            sync(descriptor)

        with monkeypatch.context() as patch:
            patch.setattr(_files.os, "fsync", full)
            try:
                run_study(STUDY, archive, threads=1)
            except ArchiveError as error:
                assert "no space left on device" in str(error)  # noqa: PT017 - the last ones do not fail
        if calls[0] < failing:
            break
        if before is None or archive.read_bytes() != before:
            assert not archive.exists() or content_hash(archive) == expected
        run_study(STUDY, archive, threads=1)
        assert content_hash(archive) == expected
        assert list(tmp_path.iterdir()) == [archive]
    assert failing > 10


def test_a_second_run_exits_with_two_and_says_who_has_it(tmp_path: Path) -> None:
    text, archive = written(STUDY.text, tmp_path), tmp_path / "a.nc"
    with run_lock(parts_of(archive)):
        status, output = told("run", text, "-o", archive)
    assert status == 2
    assert f"another run has it (process {os.getpid()})" in output
    assert told("run", text, "-o", archive)[0] == 0


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK, errno.EINVAL])
def test_a_file_system_without_locks_is_said_to_be_one(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Lustre is where it is mounted without them: no other run has anything."""

    def flock(*_: Any) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", flock)
    with pytest.raises(
        ArchiveError, match=r"its file system has no locks .*; choose an archive on another one with -o"
    ):
        run_study(STUDY, tmp_path / "a.nc")


def test_an_unfinished_archive_is_not_verified(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    interrupted(STUDY, archive, 2)
    said = f"{archive}: unfinished, only its shards are there; run the study to its end first\n"
    assert told("verify", archive) == (2, said)


class Trap:
    """What would leave a file behind if anybody unpickled it."""

    def __init__(self, where: Path) -> None:
        self.where = where

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (self.where,))


def test_a_shard_never_holds_objects(tmp_path: Path) -> None:
    """They would be pointers, or pickles."""
    archive = tmp_path / "a.nc"
    for name in ("status", "case_hash", "message", "displacement"):
        interrupted(STUDY, archive, 1)
        [shard] = parts_of(archive).glob("*.shard")
        head, values = shard.read_bytes().split(b"\n", 1)
        about = json.loads(head.split(b" ", 1)[1])
        kind, shape, crc = about[name]
        about[name] = ["|O", [math.prod(shape) * np.dtype(kind).itemsize // 8], crc]
        head = json.dumps(about).encode()
        shard.write_bytes(b"%08x " % zlib.crc32(head) + head + b"\n" + values)
        assert run_study(STUDY, archive).ok
        archive.unlink()


def test_opening_an_archive_executes_nothing(tmp_path: Path) -> None:
    """Neither one whose checksum fits nor one whose checksum does not."""
    plain, hostile, sprung = tmp_path / "plain.nc", tmp_path / "hostile.nc", tmp_path / "sprung"
    run_study(STUDY, plain)
    hostile.write_bytes(plain.read_bytes())
    trap = pickle.dumps(Trap(sprung), protocol=0).decode()
    code = f"__import__('pathlib').Path({str(sprung)!r}).touch()"
    with netCDF4.Dataset(hostile, "a") as file:
        file["provenance"].setncattr("study", f"study: !!python/object/apply:eval [{code!r}]\n")
        file["provenance"].setncattr("versions", trap)
        file.setncattr("title", trap)
        file.setncattr("history", f"{{{{{code}}}}}")
        file["status"].setncattr("long_name", code)
    damaged = tmp_path / "damaged.nc"
    damaged.write_bytes(hostile.read_bytes())
    seal(hostile)
    for path in (damaged, hostile):
        with suppress(ArchiveError), open_archive(path) as data:
            data.load()
            repr(data)
        for command in ("show", "report", "verify", "plan"):
            told(command, path)
    assert not sprung.exists()
