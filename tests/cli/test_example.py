"""The examples that ship with the program: each is printed, and planned by no more than its first lines say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from terminal import workflow

NAMES = (
    "blade",
    "coating",
    "interaction_map",
    "modes",
    "own_chord",
    "own_matrices",
    "plate",
    "slurm",
    "steady_rub",
    "worn_casing",
)


def printed(name: str, cwd: Path) -> str:
    shown = workflow("example", name, cwd=cwd)
    assert shown.returncode == 0, shown.stderr
    return shown.stdout


def test_they_are_listed_each_with_its_title(tmp_path: Path) -> None:
    lines = workflow("example", cwd=tmp_path).stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(NAMES)
    assert all(len(line.split()) > 3 for line in lines)


def test_one_that_is_not_there(tmp_path: Path) -> None:
    asked = workflow("example", "blades", cwd=tmp_path)
    assert asked.returncode == 2
    assert "there is no example `blades`; take one of blade, coating, interaction_map" in asked.stderr


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the matrices of the plate."""
    directory = tmp_path_factory.mktemp("plate")
    (directory / "plate.py").write_text(printed("plate", directory), encoding="utf-8")
    subprocess.run([sys.executable, "plate.py"], cwd=directory, check=True)
    return directory


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("plate", "slurm")])
def test_each_study_is_planned(name: str, plate: Path) -> None:
    text = printed(name, plate)
    (plate / f"{name}.yaml").write_text(text, encoding="utf-8")
    planned = workflow("plan", f"{name}.yaml", cwd=plate)
    assert planned.returncode == 0, planned.stderr
    assert planned.stdout.startswith(f"{name}: ")
    if "plate.npz" in text:
        assert re.findall(r"^#   (.*)$", text, re.MULTILINE) == ["workflow example plate > plate.py", "python plate.py"]
