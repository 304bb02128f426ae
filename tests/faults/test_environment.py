"""Faults of what a run is started in: compilers, forks, workers that die, little memory, modes of files."""

import errno
import os
import signal
import subprocess
import sys
import textwrap
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quick import quick
from studies import written
from terminal import children, started, told, typed, until
from workflow.archive import ArchiveError, content_hash, parts_of
from workflow.archive._files import commit
from workflow.cases import arrange
from workflow.plan import plan_study
from workflow.run import Advance, ClusterError, _cluster, run_study
from workflow.solve import _solve, _tasks, solve_in_parts

STUDY = quick()


@pytest.mark.parametrize("setting", ["NUMBA_DISABLE_JIT=1", "NUMBA_NUM_THREADS=0"])
def test_what_stops_numba_is_named_before_any_case(setting: str, tmp_path: Path) -> None:
    name, value = setting.split("=")
    ran = typed("run", written(STUDY.text, tmp_path), cwd=tmp_path, env={**os.environ, name: value})
    assert ran.returncode == 2
    assert ran.stderr.startswith("numba cannot be used here: ")
    assert setting in ran.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["study.yaml"]


FORKED = """
    import os, sys
    import workflow; workflow.pin()
    from workflow import run_study
    threads = int(sys.argv[1])
    first = run_study("study.yaml", "parent.nc", threads=threads).counts
    child = os.fork()
    if not child:
        os._exit(0 if run_study("study.yaml", "child.nc", threads=threads).counts == first else 1)
    print(os.waitpid(child, 0)[1])
"""


def test_a_forked_process_runs_studies_too(tmp_path: Path) -> None:
    written(STUDY.text, tmp_path)
    call = [sys.executable, "-c", textwrap.dedent(FORKED), "2"]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.stdout == "0\n", done.stderr
    assert content_hash(tmp_path / "child.nc") == content_hash(tmp_path / "parent.nc")


def workers(process: int) -> list[int]:
    """Return the processes that a process has started and that are to become workers."""
    return [one for one in children(process) if b"spawn_main" in Path(f"/proc/{one}/cmdline").read_bytes()]


@pytest.mark.skipif(version("distributed") < "2025", reason="its nannies start such a worker again, for ever")
def test_a_worker_that_dies_as_it_starts_is_told(tmp_path: Path) -> None:
    study = written(STUDY.text, tmp_path)
    with started("-m", "workflow", "run", study, "-o", tmp_path / "a.nc", "--workers", "1") as process:
        until(lambda: bool(workers(process.pid)))
        time.sleep(0.2)
        os.kill(workers(process.pid)[0], signal.SIGKILL)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 2, said
    assert "worker processes could not be started: " in said
    assert "stored beside" not in said


@pytest.mark.parametrize("mode", [0o640, 0o600, 0o664])
def test_an_archive_that_is_extended_keeps_its_mode(mode: int, tmp_path: Path) -> None:
    archive, link = tmp_path / "a.nc", tmp_path / "link.nc"
    run_study(quick({"e": [0.0, 0.5]}), archive)
    archive.chmod(mode)
    link.symlink_to(archive)
    run_study(STUDY, link)
    assert link.is_symlink()
    assert archive.stat().st_mode & 0o777 == mode
    assert run_study(STUDY, archive).resumed == 9


def test_an_archive_that_nobody_may_write_is_refused(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    run_study(quick({"e": [0.0, 0.5]}), archive)
    before = archive.read_bytes()
    archive.chmod(0o444)
    status, said = told("run", written(STUDY.text, tmp_path), "-o", archive)
    assert (status, "read-only; make it writable" in said) == (2, True)
    assert archive.read_bytes() == before
    assert not parts_of(archive).exists()
    assert told("run", written(quick({"e": [0.0, 0.5]}).text, tmp_path), "-o", archive)[0] == 0  # nothing to do


def test_a_page_keeps_its_mode_and_its_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And its content, where it may not be written or the disk is full, which is said with its place."""
    page, link = tmp_path / "page.html", tmp_path / "link.html"
    page.write_text("before")
    page.chmod(0o640)
    link.symlink_to(page)
    commit(link, b"after")
    assert (link.is_symlink(), page.read_text(), page.stat().st_mode & 0o777) == (True, "after", 0o640)
    page.chmod(0o444)
    with pytest.raises(ArchiveError, match=r"page\.html: read-only"):
        commit(link, b"again")
    page.chmod(0o640)

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match=r"page\.html"):
        commit(link, b"again")
    assert page.read_text() == "after"
    assert len(list(tmp_path.iterdir())) == 2


SWEPT = quick({"scene.load.frequency": {"sweep": [900.0, 1000.0, 6]}, "alpha": 5.0})


@pytest.mark.parametrize(("limit", "most"), [("TASK_BYTES", 1), ("LONGEST", 0.0)])
def test_points_of_a_sweep_are_stored_as_they_end(
    limit: str, most: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In shards of their own where they are large or take long; what is stored when a run stops stays, and is told."""
    ended = [places.tolist() for places, _ in solve_in_parts(arrange(SWEPT), 0, np.arange(18))]
    assert ended == [[point, 6 + point, 12 + point] for point in range(6)]
    monkeypatch.setattr(f"workflow.run._task.{limit}", most)
    archive, step = tmp_path / "a.nc", _solve._solve_or_tell

    def stopping(grid: Any, outer: int, inner: Any, *words: Any) -> Any:
        if inner[0] % 6 == 4:
            raise KeyboardInterrupt
        return step(grid, outer, inner, *words)

    with monkeypatch.context() as patch:
        patch.setattr(_solve, "_solve_or_tell", stopping)
        with pytest.raises(KeyboardInterrupt):
            run_study(SWEPT, archive, threads=1)
    assert len(list(parts_of(archive).glob("*.shard"))) == 4
    told = list[Advance]()
    assert run_study(SWEPT, archive, progress=told.append).resumed == 12
    assert [advance.stored for advance in told] == [12, 15, 18]
    assert [advance.work for advance in told] == pytest.approx([0, 1 / 2, 1])  # a line begins anew
    run_study(SWEPT, tmp_path / "b.nc")
    assert content_hash(archive) == content_hash(tmp_path / "b.nc")


def test_cases_that_do_not_fit_in_memory_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_tasks, "_memory_there_is", lambda: 1e4)
    status, said = told("run", written(STUDY.text, tmp_path), "-o", tmp_path / "a.nc", "--threads", "3")
    assert status == 2
    assert "there is not enough memory: 3 at once need " in said
    assert [path.name for path in tmp_path.iterdir()] == ["study.yaml"]


def test_a_plan_says_the_memory_of_the_cases_that_are_held_at_once() -> None:
    """Ten arrays of each sample at least, of a sweep those of one point, whatever the number of its points."""
    long = {"scene": {"duration": 4.0}, "output": {"interval": 1e-5}}
    one = plan_study(quick({"e": 0.5, "alpha": 5.0, "h": 1e-5}, **long)).memory
    assert 10 * 8 * 4e5 < one < 20 * 8 * 4e5
    points = {"scene.load.frequency": {"sweep": [900.0, 1000.0, 50]}}
    assert plan_study(quick({"e": 0.5, "alpha": 5.0, "h": 1e-5, **points}, **long)).memory < 1.2 * one


def test_a_fork_of_a_process_that_had_workers_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The threads of distributed are not in it, and it would wait for them."""
    _cluster._first_process()
    monkeypatch.setattr(os, "getpid", lambda: -1)
    with pytest.raises(ClusterError, match="forked from one that has run on workers"):
        run_study(STUDY, tmp_path / "a.nc", workers=1)
