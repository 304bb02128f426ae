"""The house: imports go to the left and down, rooms stay small, the command line starts light."""

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import workflow
from workflow.kernels import compiled

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
FLOOR = ("study", "cases", "solve", "plan", "archive", "run", "analysis", "plots", "report", "cli", "examples")
ORDER = {room: place for place, room in enumerate((*PHYSICS, *FLOOR))}
HEAVY = ("bokeh", "xarray", "netCDF4", "h5py", "dask", "distributed", "numba", "matplotlib", "scipy", "pint")


def sources() -> list[Path]:
    return sorted(ROOT.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imports_of(path: Path) -> set[str]:
    """Names that a file imports, with their modules, wherever in it the import stands."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_left_and_down(path: Path) -> None:
    room = room_of(path)
    if room in ("__init__", "__main__"):
        return
    assert room in ORDER, f"{room} is no room of ARCHITECTURE"
    others = {name.split(".")[1] for name in imports_of(path) if name.startswith("workflow.")}
    wrong = {other for other in others & set(ORDER) if ORDER[other] > ORDER[room]}
    assert not wrong, f"{path.name} imports {wrong}, which lie to its right"


def test_modules_of_physics_import_in_no_circle() -> None:
    """Nor for types alone."""
    modules = {
        ".".join(p.relative_to(ROOT.parent).with_suffix("").parts): p for p in sources() if room_of(p) in PHYSICS
    }
    modules = {name.removesuffix(".__init__"): path for name, path in modules.items()}
    graph = {
        name: {other if other in modules else other.rpartition(".")[0] for other in imports_of(path)} - {name}
        for name, path in modules.items()
    }
    TopologicalSorter(graph).prepare()


def test_rooms_whose_edits_compile_nothing_anew_are_those_there_are() -> None:
    """Kernels from outside are valid as long as no source of the other rooms changes."""
    assert set(FLOOR) < compiled._WITHOUT_KERNELS < set(ORDER)
    assert all((ROOT / room).is_dir() for room in compiled._WITHOUT_KERNELS)
    assert not {name.split(".")[1] for name in compiled._SOURCES if "." in name} & compiled._WITHOUT_KERNELS


@pytest.mark.parametrize("path", [p for p in sources() if room_of(p) in PHYSICS], ids=lambda p: p.name)
def test_physics_knows_arrays_only(path: Path) -> None:
    labelled = {"xarray", "dask", "distributed", "netCDF4", "h5py", "pydantic", "pint"}
    assert not labelled & {name.split(".")[0] for name in imports_of(path)}


MODULE_LINES = 700


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_are_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MODULE_LINES


def test_the_public_names_are_listed() -> None:
    assert set(workflow.__all__) == set(dir(workflow))
    assert all(getattr(workflow, name) is not None for name in dir(workflow))


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
