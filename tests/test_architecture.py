"""The house: imports go to the left and down, rooms stay small, the command line starts light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import workflow

ROOT = Path(workflow.__file__).parent
REPOSITORY = Path(__file__).parents[1]
KEPT = REPOSITORY / "data" / "hard" / "grazing.nc"
WITH_ERRORS = REPOSITORY / "data" / "work_precision.nc"
PHYSICS = (
    "pinning",
    "declare",
    "variables",
    "registry",
    "kernels",
    "models",
    "reduction",
    "poles",
    "schemes",
    "orbits",
    "judges",
)
FLOOR = ("study", "grid", "archive", "run", "analysis", "plots", "report", "cli")
ORDER = {room: place for place, room in enumerate((*PHYSICS, *FLOOR))}
HEAVY = ("bokeh", "xarray", "netCDF4", "h5py", "dask", "distributed", "numba", "matplotlib", "scipy", "pint")


def sources() -> list[Path]:
    return sorted(ROOT.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imports_of(path: Path) -> set[str]:
    """Rooms of this package that a file imports, wherever in it the import stands."""
    rooms = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module] if node.module != "workflow" else [f"workflow.{a.name}" for a in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        rooms |= {name.split(".")[1] for name in names if name.startswith("workflow.")}
    return rooms & set(ORDER)


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


def functions() -> list[tuple[str, int, int]]:
    """Place, lines and parameters of every function, ``self`` counted."""
    sizes = []
    for path in sources():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                arguments = node.args
                count = len(arguments.posonlyargs) + len(arguments.args) + len(arguments.kwonlyargs)
                count += (arguments.vararg is not None) + (arguments.kwarg is not None)
                place = f"{path.relative_to(ROOT)}:{node.name}"
                sizes.append((place, node.end_lineno - node.lineno + 1, count))
    return sizes


MODULE_LINES, SCHEME_LINES = 400, 150
FUNCTION_LINES, MOST_FUNCTION_LINES = 60, 25
PARAMETERS, MOST_PARAMETERS = 8, 4
"""The longest that is allowed anywhere, and what nine of ten keep."""


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_are_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MODULE_LINES


@pytest.mark.parametrize("path", sorted((ROOT / "schemes").glob("[!_]*.py")), ids=lambda p: p.stem)
def test_a_scheme_is_read_at_one_sitting(path: Path) -> None:
    """Its file holds the method: equations, contact rule, options; what a structure is stepped by lies below."""
    assert len(path.read_text(encoding="utf-8").splitlines()) <= SCHEME_LINES


def test_functions_are_short_and_take_few_parameters() -> None:
    """``most`` is the 90th percentile of all functions of the package; the parameters of a command are its options."""
    sizes = functions()
    assert [place for place, lines, _ in sizes if lines > FUNCTION_LINES] == []
    assert [place for place, _, count in sizes if count > PARAMETERS and place != "cli/run.py:run"] == []
    most = int(0.9 * len(sizes))
    assert sorted(lines for _, lines, _ in sizes)[most] <= MOST_FUNCTION_LINES
    assert sorted(count for _, _, count in sizes)[most] <= MOST_PARAMETERS


def imported_by(*commands: str, directory: Path) -> set[str]:
    """Return the modules that a process has imported after some commands, one after the other."""
    files = {"A": KEPT, "E": WITH_ERRORS, "S": REPOSITORY / "studies" / "blade.yaml"}
    calls = [["workflow", *(str(files.get(word, word)) for word in command.split())] for command in commands]
    code = (
        "import sys, workflow.cli\n"
        f"for sys.argv in {calls!r}:\n"
        "    try:\n        workflow.cli.main()\n"
        "    except SystemExit as end:\n        assert not end.code, sys.argv\n"
        "print('\\nIMPORTED', *sorted(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=directory)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.rsplit("IMPORTED", 1)[1].split())


def test_commands_that_compute_nothing_import_no_compiler(tmp_path: Path) -> None:
    modules = imported_by("schema", "show A", "recommend E", "report A -o page.html", directory=tmp_path)
    assert "workflow.schemes" in modules
    assert (tmp_path / "page.html").exists()
    assert not {"numba", "llvmlite"} & modules


def test_planning_imports_nothing_to_run_or_store_with(tmp_path: Path) -> None:
    """It needs singular values, which kernels compute: it imports numba."""
    modules = imported_by("plan S", directory=tmp_path)
    assert "workflow.schemes" in modules
    assert not {"xarray", "dask", "h5py", "netCDF4", "matplotlib", "scipy.sparse"} & modules


@pytest.mark.parametrize("module", ["workflow", "workflow.cli"])
def test_starting_imports_nothing_heavy(module: str) -> None:
    code = f"import sys, {module}; print(*[m for m in {HEAVY!r} if m in sys.modules])"
    completed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert completed.stdout.split() == []


def test_processes_that_tests_start_import_one_package(tmp_path: Path) -> None:
    """In whatever directory they are started; which one it is is up to who starts the tests."""
    command = [sys.executable, "-c", "import workflow; print(workflow.__file__)"]
    places = (REPOSITORY, tmp_path)
    assert len({subprocess.run(command, capture_output=True, check=True, cwd=place).stdout for place in places}) == 1


def test_no_two_modules_of_the_tests_share_a_name() -> None:
    """Their directories are no packages: pytest and other tests import each by its bare name."""
    names = [path.stem for path in Path(__file__).parent.rglob("*.py") if path.name != "conftest.py"]
    assert sorted(name for name in set(names) if names.count(name) > 1) == []
