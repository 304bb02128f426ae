"""Paths, terminals and limits that no command likes: one clear line, exit status 2, nothing lost."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import h5py
import pytest
from typer.testing import CliRunner

from hostile import changed
from studies import SINGLE, parsed, written
from workflow.cli import app
from workflow.run import run_study


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sound") / "a.nc"
    run_study(parsed(SINGLE), path)
    return path


def workflow(*words: str | Path, status: int = 2) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == status, result.output
    return result.output


@pytest.mark.parametrize("command", ["show", "report", "verify", "run", "plan"])
def test_a_pipe_is_not_waited_for_and_a_loop_of_links_is_said(command: str, tmp_path: Path) -> None:
    pipe, loop = tmp_path / "a.nc", tmp_path / "b.nc"
    os.mkfifo(pipe)
    loop.symlink_to(loop)
    assert str(pipe) in workflow(command, pipe)
    assert "too many levels of symbolic links" in workflow(command, loop).lower()


@pytest.mark.parametrize("kind", ["pipe", "loop", "bytes", "backslash"])
def test_a_place_that_can_be_no_archive_is_refused_before_the_work(kind: str, tmp_path: Path) -> None:
    study, archive = written(SINGLE, tmp_path), tmp_path / "a.nc"
    if kind == "pipe":
        os.mkfifo(archive)
    elif kind == "loop":
        archive.symlink_to(archive)
    else:
        archive = tmp_path / os.fsdecode(b"a\xff.nc" if kind == "bytes" else b"a\\b.nc")
    before = sorted(tmp_path.iterdir())
    result = CliRunner().invoke(app, ["run", str(study), "-o", str(archive)])
    assert result.exit_code == 2
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(("name", "fault"), [(b"a\xff", "its name is not UTF-8"), (b"a\\b", "has a backslash")])
def test_a_directory_whose_name_no_archive_can_have(
    name: bytes, fault: str, sound: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sound archive in it was said to be damaged."""
    directory = tmp_path / os.fsdecode(name)
    directory.mkdir()
    (directory / "a.nc").write_bytes(sound.read_bytes())
    monkeypatch.chdir(directory)
    for command in ("show", "verify"):
        assert fault in workflow(command, "a.nc")


def test_a_name_that_begins_with_a_space(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    workflow("run", written(SINGLE, tmp_path), "-o", " a.nc", status=0)
    assert (tmp_path / " a.nc").exists()
    (tmp_path / "a.nc").touch()
    assert "verified" in workflow("verify", " a.nc", status=0)


def test_brackets_in_a_path_are_no_markup(sound: Path, tmp_path: Path) -> None:
    archive = tmp_path / "a[red]b[bold].nc"
    archive.write_bytes(sound.read_bytes())
    assert f"{archive}: " in workflow("show", archive, status=0)


def test_a_file_in_the_place_of_the_shards(tmp_path: Path) -> None:
    study, parts = written(SINGLE, tmp_path), tmp_path / "a.nc.parts"
    parts.write_text("mine")
    assert f"{parts}: a file, where a run keeps its shards" in workflow("run", study, "-o", tmp_path / "a.nc")
    assert parts.read_text() == "mine"


@pytest.mark.parametrize("name", ["other", "other.npz"])
def test_a_foreign_directory_among_the_shards_stays(name: str, tmp_path: Path) -> None:
    study, foreign = written(SINGLE, tmp_path), tmp_path / "a.nc.parts" / name
    foreign.mkdir(parents=True)
    (foreign / "thesis.tex").write_text("mine")
    assert f"holds {name}, which no run left there" in workflow("run", study, "-o", tmp_path / "a.nc")
    assert (foreign / "thesis.tex").read_text() == "mine"


@pytest.mark.parametrize(
    "texts",
    [
        {"resolved": "{}"},
        {"resolved": "[" * 100_000},
        {"resolved": "no JSON"},
        {"resolved": '{"scene": {"duration": "long"}}'},
        {"resolved": '{"scene": 3}'},
        {"study": "[" * 50_000},
        {"study": ""},
        {"versions": "[" * 50_000},
        {"solver_version": "\x1b[31m"},
    ],
    ids=lambda texts: next(f"{name} {text[:9]!a}" for name, text in texts.items()),
)
def test_provenance_that_no_run_wrote(texts: dict[str, str], sound: Path, tmp_path: Path) -> None:
    archive = changed(sound, tmp_path / "a.nc", lambda file: file["provenance"].setncatts(texts))
    for words in (
        ("report", archive),
        ("run", archive, "-o", tmp_path / "b.nc"),
        ("verify", archive),
        ("plan", archive),
    ):
        result = CliRunner().invoke(app, [str(word) for word in words])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        assert result.exit_code in (0, 1, 2), result.output
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", result.output)


def test_a_page_of_an_archive_that_lacks_a_variable_says_that_its_bytes_have_changed(tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    run_study(parsed(f"{SINGLE}reference: {{scheme: event_driven}}\n"), path)
    with h5py.File(path, "r+") as file:
        del file["temperature_error"]
    assert f"{path}: damaged, its bytes are not those that were written" in workflow("report", path)


def command(*words: str | Path, memory: int | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    def limit() -> None:
        if memory is not None:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))

    return subprocess.run(
        [sys.executable, "-m", "workflow", *map(str, words)],
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        env={**os.environ, **environment},
        preexec_fn=limit,
    )


def test_a_terminal_that_knows_ascii_only(tmp_path: Path) -> None:
    study = written(SINGLE.replace("study: single", "study: single\ntitle: Schaufel spürt 5 µm…"), tmp_path)
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    planned, schema = command("plan", study, **plain), command("schema", **plain)
    for completed in (planned, schema):
        assert completed.returncode == 0, completed.stderr
        assert completed.stdout.isascii()
    assert "Schaufel sp\\xfcrt 5 um..." in planned.stdout
    completed = command("show", "spürt.nc", **plain).stderr
    assert "its name is UTF-8, but this process reads names as ascii; set PYTHONUTF8=1" in completed


@pytest.mark.parametrize("megabytes", [300, 600])
def test_too_little_memory_is_said(megabytes: int, tmp_path: Path) -> None:
    completed = command("run", written(SINGLE, tmp_path), "-o", tmp_path / "a.nc", memory=megabytes * 10**6)
    assert completed.returncode == 2
    assert completed.stderr.startswith("there is not enough memory")
    assert completed.stderr.count("\n") == 1


def test_a_defect_exits_with_three_and_no_traceback(tmp_path: Path) -> None:
    study = written(SINGLE, tmp_path)
    broken = "import workflow.study as s\ndef fail(*_): raise KeyError('x')\ns.read_study = fail\n"
    call = [sys.executable, "-c", f"{broken}from workflow.cli import main\nmain()", "plan", str(study)]
    brief = subprocess.run(call, capture_output=True, text=True)
    assert brief.returncode == 3
    assert brief.stderr.startswith("a defect of this program: KeyError")
    assert "Traceback" not in brief.stderr
    detailed = subprocess.run(call, capture_output=True, text=True, env={**os.environ, "WORKFLOW_TRACEBACK": "1"})
    assert detailed.returncode == 3
    assert "Traceback" in detailed.stderr
