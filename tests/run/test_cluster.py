"""A study on worker processes: same bits, whatever dies."""

import json
import os
import re
import signal
import socket
import subprocess
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import dask
import pytest
from distributed import KilledWorker

from studies import SCENE, parsed, written
from terminal import PATIENCE, alive, started, until
from workflow.archive import Command, content_hash, parts_of, start_parts
from workflow.run import ClusterError, _cluster, run_study
from workflow.run._cluster import Session, join, software

PRELOAD = Path(__file__).with_name("watched_worker.py")
Process = subprocess.Popen[str]

STUDY = (
    "study: many\n"
    + SCENE
    + """
axes:
  h: [1e-5, 2e-5]
  e: [0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8, 0.9]
  alpha: {lin: [0, 63, 10]}
output: {interval: 1 ms, histories: [displacement]}
"""
)
"""160 cases in 16 units of storage."""

FINELY = """
import os, workflow.solve._tasks as cutting, workflow.run._cluster as cluster
cutting.LONGEST, cutting.unit = 1e-9, lambda grid, *_: grid.inner_shape[-1]
cluster._PATIENCE = float(os.environ.get("WATCHED_PATIENCE", 60.0))
from workflow.cli import main
main()
"""
"""The command line with a task for each unit; ``WATCHED_PATIENCE`` seconds are waited for workers that have left."""


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> str:
    archive = tmp_path_factory.mktemp("threads") / "many.nc"
    run_study(parsed(STUDY), archive)
    return content_hash(archive)


def environment(notes: Path, **settings: str) -> dict[str, str]:
    preload = {"DASK_DISTRIBUTED__WORKER__PRELOAD": json.dumps([str(PRELOAD)])}
    return {**os.environ, **preload, "WATCHED_NOTES": str(notes), **settings}


@contextmanager
def scheduler(cwd: Path) -> Iterator[tuple[str, Process]]:
    """Start a scheduler by its own command and give its address, and the process."""
    file = cwd / "scheduler.json"
    words = ("--port", "0", "--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", file)
    with started("-m", "distributed.cli.dask_scheduler", *words, cwd=cwd) as process:
        until(lambda: file.exists() and file.stat().st_size > 0)
        yield json.loads(file.read_text())["address"], process


@contextmanager
def worker(address: str, cwd: Path, notes: Path, **settings: str) -> Iterator[Process]:
    """Start a worker by its own command, without a nanny that would raise it from the dead."""
    words = (address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", cwd)
    with started("-m", "distributed.cli.dask_worker", *words, cwd=cwd, env=environment(notes, **settings)) as process:
        yield process


def computed(notes: Path) -> list[tuple[int, str]]:
    """Return process and segment of everything that was begun."""
    lines = notes.read_text().splitlines() if notes.exists() else []
    return [(int(line.split()[0]), line.split(maxsplit=1)[1]) for line in lines]


@pytest.mark.slow
def test_a_worker_of_a_real_scheduler_is_killed_in_the_middle(tmp_path: Path, expected: str) -> None:
    study, notes, archive = written(STUDY, tmp_path), tmp_path / "notes", tmp_path / "many.nc"
    with (
        scheduler(tmp_path) as (address, _),
        worker(address, tmp_path, notes, WATCHED_SLEEP="0.1") as first,
        worker(address, tmp_path, notes, WATCHED_SLEEP="0.1"),
        started("-c", FINELY, "run", study, "--scheduler", address, cwd=tmp_path) as run,
    ):
        until(lambda: sum(process == first.pid for process, _ in computed(notes)) >= 3)
        os.kill(first.pid, signal.SIGKILL)
        out, err = run.communicate(timeout=PATIENCE)
        assert run.returncode == 0, err
        assert "160 ok" in out
    assert content_hash(archive) == expected
    assert not parts_of(archive).exists()
    begun = computed(notes)
    assert len({process for process, _ in begun}) == 2
    twice = [segment for segment, count in Counter(segment for _, segment in begun).items() if count > 1]
    last = [segment for process, segment in begun if process == first.pid][-2:]
    assert set(twice) <= set(last)  # what it was computing, and what it had not reported yet


@pytest.mark.slow
@pytest.mark.parametrize("how", ["killed", "interrupted"])
def test_workers_end_with_their_parent_and_the_next_run_goes_on(how: str, tmp_path: Path, expected: str) -> None:
    study, notes, archive = written(STUDY, tmp_path), tmp_path / "notes", tmp_path / "many.nc"
    settings = environment(notes, WATCHED_SLEEP="0.3")
    with started("-c", FINELY, "run", study, "--workers", "2", cwd=tmp_path, env=settings) as run:
        until(lambda: len(computed(notes)) >= 5)
        if how == "killed":
            os.kill(run.pid, signal.SIGKILL)
        else:
            os.killpg(run.pid, signal.SIGINT)  # as a terminal does: the workers get it too
        _, err = run.communicate(timeout=PATIENCE)
        assert run.returncode == (-signal.SIGKILL if how == "killed" else 130)
        assert not re.search("Traceback|Warning", err)
        workers = {process for process, _ in computed(notes)}
        assert len(workers) == 2
        until(lambda: not any(map(alive, workers)))
    assert not archive.exists()
    done = len(list(parts_of(archive).glob("*.shard")))
    assert done >= 2
    again = tmp_path / "again"
    with started("-c", FINELY, "run", study, "--workers", "1", cwd=tmp_path, env=environment(again)) as run:
        out, err = run.communicate(timeout=PATIENCE)
        assert run.returncode == 0, err
        assert "stored before" in out
    assert content_hash(archive) == expected
    assert len(computed(again)) == 16 - done


@pytest.mark.slow
def test_a_run_whose_workers_have_all_left_ends_and_the_next_one_goes_on(tmp_path: Path, expected: str) -> None:
    study, notes, archive = written(STUDY, tmp_path), tmp_path / "notes", tmp_path / "many.nc"
    words = ("run", study, "--scheduler")
    with scheduler(tmp_path) as (address, _):
        with (
            worker(address, tmp_path, notes, WATCHED_SLEEP="0.1") as only,
            started("-c", FINELY, *words, address, cwd=tmp_path, env={**os.environ, "WATCHED_PATIENCE": "1"}) as run,
        ):
            until(lambda: len(computed(notes)) >= 3)
            os.kill(only.pid, signal.SIGKILL)
            _, err = run.communicate(timeout=PATIENCE)
            assert run.returncode == 2
        assert f"{address}: all workers of the scheduler have left" in err
        assert "for 1 s none has come" in err
        stored = len(list(parts_of(archive).glob("*.shard")))
        assert re.search(rf"; (\d+) of 160 cases are stored beside {archive.name}\n", err)[1] == str(10 * stored)
        assert "Traceback" not in err
        again = tmp_path / "again"
        with worker(address, tmp_path, again), started("-c", FINELY, *words, address, cwd=tmp_path) as run:
            _, err = run.communicate(timeout=PATIENCE)
            assert run.returncode == 0, err
    assert content_hash(archive) == expected
    assert len(computed(again)) == 16 - stored


@pytest.mark.slow
def test_a_scheduler_that_goes_ends_the_run_with_a_message(tmp_path: Path) -> None:
    study, notes = written(STUDY, tmp_path), tmp_path / "notes"
    with (
        scheduler(tmp_path) as (address, process),
        worker(address, tmp_path, notes, WATCHED_SLEEP="0.5"),
        started("-c", FINELY, "run", study, "--scheduler", address, cwd=tmp_path) as run,
    ):
        until(lambda: len(computed(notes)) >= 2)
        process.kill()
        _, err = run.communicate(timeout=PATIENCE)
        assert run.returncode == 2
    assert "the connection to the dask scheduler is lost; what is stored is kept" in err
    assert "Traceback" not in err


def session(parts: Path) -> Session:
    return Session(str(parts), 5, software())


def test_a_worker_that_sees_other_files_is_refused(tmp_path: Path) -> None:
    own, parts = session(tmp_path / "a.nc.parts"), tmp_path / "a.nc.parts"
    with pytest.raises(ClusterError, match="does not share"):
        join(own)
    texts = {"key": "key", "resolved": '{"study": "a"}'}
    start_parts(parts, Command(texts, begun=4))
    with pytest.raises(ClusterError, match="does not share"):
        join(own)
    start_parts(parts, Command(texts, begun=5))
    assert join(own).begun == 5


def test_a_worker_with_another_solver_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = session(tmp_path / "a.nc.parts")
    monkeypatch.setattr(_cluster, "SOLVER_VERSION", 999)
    with pytest.raises(ClusterError, match="other software than this run: solver 999 instead of"):
        join(own)


def test_what_listens_and_says_nothing_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_cluster, "_ANSWER", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        ended = threading.Timer(PATIENCE, listening.close)
        ended.start()
        address = f"tcp://127.0.0.1:{listening.getsockname()[1]}"
        with pytest.raises(ClusterError, match="no dask scheduler answers there"), _cluster.connected(None, address):
            pass
        ended.cancel()
        assert listening.fileno() >= 0  # it was not asked in vain until its end
    assert dask.config.get("scheduler", None) is None  # what is computed next does not wait for it


def minutes(walltime: str) -> float:
    hours, rest, seconds = map(int, walltime.split(":"))
    return 60 * hours + rest + seconds / 60


@pytest.mark.filterwarnings("default")  # those of dask-jobqueue
def test_the_workers_of_the_example_for_slurm_leave_before_their_walltime() -> None:
    pytest.importorskip("dask_jobqueue")
    from workflow.examples import slurm as example

    with example.slurm_cluster() as cluster:
        job = cluster.job_script()
    assert "--nworkers 16" in job
    assert "--nthreads 1 " in job
    walltime = re.search(r"#SBATCH -t (\S+)", job)
    lifetime = re.search(r"--lifetime (\d+)m --lifetime-stagger (\d+)m", job)
    assert walltime is not None
    assert lifetime is not None
    assert int(lifetime[1]) + int(lifetime[2]) < minutes(walltime[1])


class Blamed(NamedTuple):
    """A future of dask that has ended."""

    key: str
    value: Any

    def add_done_callback(self, done: Callable[[Any], None]) -> None:
        done(self)

    def result(self, timeout: float) -> Any:
        if self.value is None:
            raise KilledWorker(self.key, None, 0)
        return self.value

    def release(self) -> None: ...


class Blaming:
    """A client of dask on which a task kills its worker, which has been given all tasks of a graph."""

    deadly = 3

    def nthreads(self) -> dict[str, int]:
        return {"here": 1}

    def run(self, function: Callable[..., Any], *words: Any, on_error: str) -> dict[str, Any]:
        return {"here": function(*words)}

    def get(self, nodes: dict[str, tuple[Any, ...]], keys: list[str], sync: bool) -> list[Blamed]:
        dies = any(nodes[key][1].number == self.deadly for key in keys)
        return [Blamed(key, None if dies else dask.get(nodes, key)) for key in keys]


def test_only_the_task_that_kills_its_worker_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All are blamed, and each is tried again alone."""
    monkeypatch.setattr("workflow.solve._tasks.LONGEST", 1e-9)
    monkeypatch.setattr("workflow.solve._tasks.unit", lambda grid, *_: grid.inner_shape[-1])
    monkeypatch.setattr("workflow.run._study.connected", lambda *_: nullcontext(Blaming()))
    assert run_study(parsed(STUDY), tmp_path / "many.nc", workers=1).counts == {"ok": 150, "failed": 10}
