"""A stranger's path: a study of their own from the README's snippets, run, decided on, reported, sliced in Python."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from terminal import workflow

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")

OWN = {
    "study: rub": "study: mine",
    "length: 40 mm": "length: 60 mm",
    "thickness: 1 mm": "thickness: 1.5 mm",
    "density: 4430": "density: 7800",
    "amplitude: 24": "amplitude: 30",
}
"""What a stranger changes in the README's study to have their own blade in it."""

AXES = """axes:
  scheme: [moreau, midpoint, event_driven]
  h: [1e-5, 1e-4]
  alpha: 30
  e: [0, 0.5]
  scene.casing.gap: [20 um, 24 um]
"""


def printed_here(source: str, file: str) -> str:
    """Return what a program prints in this process."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exec(compile(source, file, "exec"), {"__name__": "__main__", "__file__": file})
    return output.getvalue().strip()


def block(language: str, holding: str = "") -> str:
    """Return the README's first block of code in a language that holds some text."""
    texts = re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)
    return str(next(text for text in texts if holding in text))


def own_study() -> str:
    """Return the README's study with another blade and axes of their own."""
    text = block("yaml")
    for old, new in OWN.items():
        assert old in text
        text = text.replace(old, new)
    return re.sub(r"axes:.*?(?=zip:)", AXES, text, flags=re.DOTALL)


def executed(file: Path) -> str:
    """Return what a file of Python prints, run in this process and in its own directory."""
    with contextlib.chdir(file.parent):
        return printed_here(file.read_text(encoding="utf-8"), file.name)


def follow(
    directory: Path, run: Callable[..., subprocess.CompletedProcess[str]], python: Callable[[Path], str]
) -> None:
    """Go the whole path in a directory, with commands and with what prints the output of a file of Python there."""

    def say(*words: str) -> str:
        done = run(*words, cwd=directory)
        assert done.returncode == 0, done.stderr
        assert all("elapsed" in line for line in done.stderr.splitlines())  # of a run that takes minutes
        return done.stdout

    (directory / "mine.yaml").write_text(own_study(), encoding="utf-8")
    assert "mine: " in say("plan", "mine.yaml")
    assert "mine.nc: 72 cases" in say("run", "mine.yaml")
    assert "status: 72 ok" in say("show", "mine.nc")
    said = say("recommend", "mine.nc", "--tolerance", "2%")
    assert said.startswith("Within 2 % in all ")
    answer = json.loads(say("recommend", "mine.nc", "--tolerance", "2%", "--json"))
    assert answer["tolerance"] == 0.02
    assert answer["worst"]["error"] <= 0.02
    assert answer["scheme"] in said
    assert "page   mine.html" in say("report", "mine.nc")
    page = (directory / "mine.html").read_text(encoding="utf-8")
    assert 10_000 < len(page) < 6e6
    sliced = block("python", "open_archive").replace('"blade.nc"', '"mine.nc"').replace("alpha=30, ", "")
    script = f"import matplotlib\nmatplotlib.use('Agg')\n{sliced}\n{CURVE}"
    (directory / "slice.py").write_text(script, encoding="utf-8")
    assert python(directory / "slice.py").split() == ["('t',)", "2001", "N", "True"]


CURVE = """
curve = hot["contact_force"].sel(e=0, h=1e-5)
print(curve.dims, curve.size, curve.attrs["units"], bool(curve.max() > 1))
"""


def test_a_study_of_their_own(tmp_path: Path) -> None:
    """In this process; the slow test starts the commands that are installed."""
    follow(tmp_path, workflow, executed)


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    """`In Python` as it stands, beside the studies it names."""
    shutil.copytree(ROOT / "studies", tmp_path / "studies", ignore=shutil.ignore_patterns("*.ipynb", "*.png"))
    (tmp_path / "in_python.py").write_text(block("python", "run_study"), encoding="utf-8")
    assert "{'ok': " in executed(tmp_path / "in_python.py")
    assert (tmp_path / "coarse.nc").exists()


@pytest.mark.slow
def test_a_stranger_installs_it_first(tmp_path: Path) -> None:
    """The README's own commands in a fresh copy of what is under version control, then the whole path."""
    copy = tmp_path / "copy"
    subprocess.run(["git", "clone", "-q", str(ROOT), str(copy)], check=True)
    install = re.search(r"<!-- run -->\n```sh\n(.*?)\n```", README, re.DOTALL)
    assert install is not None
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(
        install[1], shell=True, cwd=copy, capture_output=True, text=True, timeout=1800, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert (copy / "blade.nc").exists()
    assert (copy / "blade.html").exists()
    (tmp_path / "work").mkdir()
    binary = copy / ".venv" / "bin"

    def installed(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
        command = [str(binary / "workflow"), *words]
        return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)

    def executed_there(file: Path) -> str:
        command = [str(binary / "python"), file.name]
        return subprocess.run(command, cwd=file.parent, capture_output=True, text=True, timeout=120, check=True).stdout

    follow(tmp_path / "work", installed, executed_there)
