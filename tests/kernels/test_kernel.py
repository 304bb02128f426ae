"""Compiled kernels: found again by the next process, compiled anew after a change of what their module imports."""

import math
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest

import workflow

RUN = """
import sys
sys.path.insert(0, {package!r})
from workflow.kernels import compiled, elementwise
from workflow.schemes import moreau
value = float(elementwise.sine_cosine(1.0)[0])
hits = sum(elementwise._sine_cosine.dispatcher.stats.cache_hits.values())
print(value, hits, compiled.directory_of("workflow.kernels.elementwise"))
"""
"""A kernel that compiles in a few seconds."""

OUTSIDE = """
import sys
sys.path.insert(0, {package!r})
from workflow.kernels import compiled
from outside.scheme import force
print(force(1.0), sum(force.dispatcher.stats.cache_hits.values()), compiled.directory_of("outside.scheme"))
"""


class Ran(NamedTuple):
    value: float
    hits: int
    directory: Path


def run(package: Path, code: str = RUN, **environment: str) -> Ran:
    """Run it with no other directory of numba's than is given, whatever the tests themselves are run with."""
    around = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    value, hits, directory = subprocess.run(
        [sys.executable, "-c", code.format(package=str(package))],
        capture_output=True, text=True, check=True, cwd=package, env={**around, **environment},
    ).stdout.split()  # fmt: skip
    return Ran(float(value), int(hits), Path(directory))


def copy_of_the_package(directory: Path) -> Path:
    copy, without = directory / "workflow", shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(workflow.__file__).parent, copy, ignore=without)
    return directory


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    return copy_of_the_package(tmp_path)


@pytest.fixture(scope="module")
def compiled_copy(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ran]:
    """Such a copy in which two processes at once have compiled the kernel, and what came of it."""
    directory = copy_of_the_package(tmp_path_factory.mktemp("compiled"))
    with ThreadPoolExecutor() as both:
        first, second = both.map(run, [directory] * 2)
    assert first._replace(hits=0) == second._replace(hits=0)
    return directory, first._replace(hits=0)


@pytest.fixture
def ran(compiled_copy: tuple[Path, Ran], tmp_path: Path) -> tuple[Path, Ran]:
    """A copy of that one, kernels and all, in its place."""
    directory, first = compiled_copy
    shutil.copytree(directory / "workflow", tmp_path / "workflow")
    return tmp_path, first._replace(directory=tmp_path / first.directory.relative_to(directory))


def edit(package: Path, module: str, before: str, after: str) -> None:
    path = package / "workflow" / f"{module}.py"
    source = path.read_text(encoding="utf-8")
    assert before in source
    path.write_text(source.replace(before, after, 1), encoding="utf-8")


def test_a_change_in_an_inlined_module_is_noticed(ran: tuple[Path, Ran]) -> None:
    copied, before = ran
    assert run(copied) == before._replace(hits=1)
    edit(copied, "kernels/elementary", "else (s, c)", "else (s + 2.0, c)")
    changed = run(copied)
    assert changed.hits == 0
    assert changed.value == pytest.approx(before.value + 2.0, rel=1e-12)


def test_a_change_in_what_is_not_imported_compiles_nothing_anew(ran: tuple[Path, Ran]) -> None:
    copied, first = ran
    for module in ("cli/__init__", "kernels/algebra", "schemes/_fixed/march"):
        edit(copied, module, '"""', '"""Another word.\n\n')
    assert run(copied) == first._replace(hits=1)


def test_a_change_in_a_module_from_outside_is_noticed(copied: Path) -> None:
    """Whichever module of its package the kernel inlines."""
    outside = copied / "outside"
    outside.mkdir()
    (outside / "__init__.py").write_text("")
    (outside / "law.py").write_text("STIFFNESS = 2.0\n")
    text = "from workflow.kernels.compiled import kernel\nfrom outside import law\n\n\n"
    (outside / "scheme.py").write_text(text + "@kernel\ndef force(x):\n    return law.STIFFNESS * x\n")
    assert [run(copied, OUTSIDE)[:2] for _ in range(2)] == [(2.0, 0), (2.0, 1)]
    (outside / "law.py").write_text("STIFFNESS = 3.0\n")
    assert run(copied, OUTSIDE)[:2] == (3.0, 0)


def test_directories_of_older_sources_are_removed(ran: tuple[Path, Ran]) -> None:
    """But not within a day."""
    copied, (_, _, own) = ran
    older, new = own.with_name("1" * 16), own.with_name("2" * 16)
    for directory in (older, new):
        shutil.copytree(own, directory)
    for directory in (older, own):
        os.utime(directory, (1, 1))
    assert run(copied).hits == 1
    assert [each.is_dir() for each in (own, older, new)] == [True, False, True]


def test_nothing_writable_means_that_nothing_is_kept(copied: Path) -> None:
    """Files where the cache directories should be: neither of them can be made."""
    (copied / "home").write_text("")
    (copied / "workflow" / "kernels" / "__pycache__").write_text("")
    ran = run(copied, XDG_CACHE_HOME=str(copied / "home"), PYTHONDONTWRITEBYTECODE="1")
    assert ran == (pytest.approx(math.sin(1.0)), 0, Path("None"))
