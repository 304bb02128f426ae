"""The house: imports go to the left and down, rooms stay small, the command line starts light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import workflow

ROOT = Path(workflow.__file__).parent
PHYSICS = ("declare", "models", "reduction", "schemes")
FLOOR = ("study", "grid", "archive", "run", "analysis", "plots", "report", "cli")
ORDER = {room: place for place, room in enumerate((*PHYSICS, *FLOOR))}
HEAVY = ("xarray", "netCDF4", "h5py", "dask", "distributed", "numba", "matplotlib", "scipy", "pint")


def sources() -> list[Path]:
    return sorted(ROOT.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imports_of(path: Path) -> set[str]:
    """Rooms of this package that a file imports, wherever in it the import stands."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module] if node.module != "workflow" else [f"workflow.{a.name}" for a in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        found |= {name.split(".")[1] for name in names if name.startswith("workflow.")}
    return found & set(ORDER)


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_left_and_down(path: Path) -> None:
    room = room_of(path)
    if room in ("__init__", "__main__"):
        return
    assert room in ORDER, f"{room} is no room of ARCHITECTURE"
    wrong = {other for other in imports_of(path) if ORDER[other] > ORDER[room]}
    assert not wrong, f"{path.name} imports {wrong}, which lie to its right"


@pytest.mark.parametrize("path", [p for p in sources() if room_of(p) in PHYSICS], ids=lambda p: p.name)
def test_physics_knows_arrays_only(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            for name in names:
                assert name.split(".")[0] not in (
                    "xarray",
                    "dask",
                    "distributed",
                    "netCDF4",
                    "h5py",
                    "pydantic",
                    "pint",
                )


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_stay_under_400_lines(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) < 400


@pytest.mark.parametrize("module", ["workflow", "workflow.cli"])
def test_starting_imports_nothing_heavy(module: str) -> None:
    code = f"import sys, {module}; print(*[m for m in {HEAVY!r} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []


def test_reserved_names_are_those_the_archive_has() -> None:
    """An axis may not take a variable's name; the study's list covers what the archive declares."""
    from workflow.archive import _describe as declared
    from workflow.study.axes import VARIABLES

    names = {
        *declared._HISTORIES,
        *declared._METRICS,
        *declared._ERRORS,
        *declared._PERIODS,
        "status",
        "runaway",
        "message",
    }
    assert names <= set(VARIABLES)
