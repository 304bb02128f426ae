"""Paths and texts that no command likes: one clear line, exit status 2, nothing lost."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hostile import changed
from studies import FALLING_BALL, SINGLE, archived, parsed, written
from terminal import typed, workflow

sound = archived(parsed(SINGLE))


def refused(*words: str | Path) -> str:
    ended = workflow(*words, cwd=Path())
    assert ended.returncode == 2, ended
    return ended.stderr


@pytest.mark.parametrize("command", ["show", "report", "verify", "run", "plan"])
def test_a_pipe_is_not_waited_for_and_a_loop_of_links_is_said(command: str, tmp_path: Path) -> None:
    pipe, loop = tmp_path / "a.nc", tmp_path / "b.nc"
    os.mkfifo(pipe)
    loop.symlink_to(loop)
    assert str(pipe) in refused(command, pipe)
    assert "too many levels of symbolic links" in refused(command, loop).lower()


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
    refused("run", study, "-o", archive)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(("name", "fault"), [(b"a\xff", "its name is not UTF-8"), (b"a\\b", "has a backslash")])
def test_a_directory_whose_name_no_archive_can_have(
    name: bytes, fault: str, sound: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = tmp_path / os.fsdecode(name)
    directory.mkdir()
    (directory / "a.nc").write_bytes(sound.read_bytes())
    monkeypatch.chdir(directory)
    for command in ("show", "verify"):
        assert fault in refused(command, "a.nc")


def test_a_name_that_begins_with_a_space(tmp_path: Path) -> None:
    assert workflow("run", written(SINGLE, tmp_path), "-o", " a.nc", cwd=tmp_path).returncode == 0
    (tmp_path / "a.nc").touch()
    assert "verified" in workflow("verify", " a.nc", cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("", "a.nc.parts: a file, where a run keeps its shards"),
        ("other/thesis.tex", "holds other, which no run left there"),
        ("other.shard/thesis.tex", "holds other.shard, which no run left there"),
    ],
)
def test_what_is_somebody_else_s_in_the_place_of_the_shards_stays(name: str, fault: str, tmp_path: Path) -> None:
    study, foreign = written(SINGLE, tmp_path), tmp_path / "a.nc.parts" / name
    foreign.parent.mkdir(parents=True, exist_ok=True)
    foreign.write_text("mine")
    assert fault in refused("run", study, "-o", tmp_path / "a.nc")
    assert foreign.read_text() == "mine"


@pytest.mark.parametrize(
    "texts",
    [
        {"resolved": "[" * 100_000, "study": ""},
        pytest.param({"resolved": '{"scene": {"duration": "long"}}', "study": "[" * 50_000}, marks=pytest.mark.slow),
        {"resolved": "no JSON", "versions": "[" * 50_000, "solver_version": "\x1b[31m"},
    ],
    ids=lambda texts: next(f"{name} {text[:9]!a}" for name, text in texts.items()),
)
def test_provenance_that_no_run_wrote(texts: dict[str, str], sound: Path, tmp_path: Path) -> None:
    archive = changed(sound, tmp_path / "a.nc", lambda file: file["provenance"].setncatts(texts))
    for command, *output in (("report",), ("run", "-o", tmp_path / "b.nc"), ("verify",), ("plan",)):
        ended = workflow(command, archive, *output, cwd=tmp_path)
        assert ended.returncode in (0, 1, 2), ended
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", ended.stdout + ended.stderr)


def test_characters_that_the_output_lacks_are_written_as_codes(tmp_path: Path) -> None:
    study = written(SINGLE.replace("study: single", "study: single\ntitle: 5 µm"), tmp_path)
    planned = typed("plan", study, cwd=tmp_path, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert planned.returncode == 0, planned.stderr
    assert "5 \\xb5m" in planned.stdout


def test_a_defect_exits_with_three_and_no_traceback(tmp_path: Path) -> None:
    study = written(SINGLE, tmp_path)
    broken = "import workflow.study as s\ndef fail(*_): raise KeyError('x')\ns.read_study = fail\n"
    call = [sys.executable, "-c", f"{broken}from workflow.cli import main\nmain()", "plan", str(study)]
    for more, detailed in (({}, False), ({"WORKFLOW_TRACEBACK": "1"}, True)):
        ended = subprocess.run(call, capture_output=True, text=True, env=os.environ | more)
        assert ended.returncode == 3
        assert "a defect of this program: KeyError" in ended.stderr
        assert ("Traceback" in ended.stderr) == detailed


def test_what_a_shell_asks_of_windows_and_servers_changes_no_page(sound: Path, tmp_path: Path) -> None:
    nonsense = dict.fromkeys(("MPLBACKEND", "BOKEH_MINIFIED", "BOKEH_LOG_LEVEL"), "nonsense")
    ended = typed("report", sound, "-o", "page.html", cwd=tmp_path, env={**os.environ, **nonsense})
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_free_mass_has_no_stiffness_that_a_contact_spring_could_follow(tmp_path: Path) -> None:
    """Neither alone nor as the reference of others."""
    for part in (
        "axes: {scheme: [penalty, moreau], h: 1e-3}",
        "axes: {h: 1e-3}\nreference: {scheme: penalty, h: 1e-4}",
    ):
        study = written(f"study: free\n{FALLING_BALL}{part}\n", tmp_path)
        planned = workflow("plan", study, cwd=tmp_path)
        assert planned.returncode == 0, planned.stderr
        assert ("penalty fails, as a free mass has no stiffness" in planned.stdout) == ("moreau" in part)
        assert (
            workflow("plan", study, "-s", "schemes.penalty={method: penalty, stiffness: 1e6}", cwd=tmp_path).returncode
            == 0
        )


@pytest.mark.parametrize("epoch", ["", "now"])
def test_a_source_date_that_is_none_stops_nothing(epoch: str) -> None:
    """numpy.f2py, which SciPy imports, ends in a traceback by it."""
    ended = typed("--version", cwd=Path(), env={**os.environ, "SOURCE_DATE_EPOCH": epoch})
    assert (ended.returncode, ended.stderr) == (0, "")
