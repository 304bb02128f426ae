"""Compiled kernels: found again by the next process, compiled anew after any change of a source."""

from __future__ import annotations

import fcntl
import importlib
import math
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import pytest

import workflow
from workflow.kernels import cache, sources

RUN = """
import sys
sys.path.insert(0, {package!r})
from pathlib import Path
from workflow.kernels import cache, elementwise, sources
from workflow.schemes import moreau
value = float(elementwise.exp(1.0))
hits = sum(elementwise._exp.dispatcher.stats.cache_hits.values())
print(value, hits, cache.root(), sources.digest("workflow.schemes.moreau", Path({package!r}, "sources.json")))
"""
"""A kernel that compiles in a second, and the digest of one that takes ten."""


class Ran(NamedTuple):
    value: float
    hits: int
    root: Path
    moreau: str


def run(package: Path, code: str = RUN, **environment: str) -> Ran:
    """Run it with no other directory of numba's than is given, whatever the tests themselves are run with."""
    around = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    value, hits, root, moreau = subprocess.run(
        [sys.executable, "-c", code.format(package=str(package))],
        capture_output=True, text=True, check=True, cwd=package, env={**around, **environment},
    ).stdout.split()  # fmt: skip
    return Ran(float(value), int(hits), Path(root), moreau)


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """A copy of the package whose sources may change."""
    shutil.copytree(Path(workflow.__file__).parent, tmp_path / "workflow", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ran]:
    """Such a copy in which the kernel has been compiled, and what came of it."""
    directory = tmp_path_factory.mktemp("compiled")
    shutil.copytree(
        Path(workflow.__file__).parent, directory / "workflow", ignore=shutil.ignore_patterns("__pycache__")
    )
    return directory, run(directory)


@pytest.fixture
def ran(compiled: tuple[Path, Ran], tmp_path: Path) -> tuple[Path, Ran]:
    """A copy of that one, kernels and all, in its place."""
    directory, first = compiled
    shutil.copytree(directory / "workflow", tmp_path / "workflow")
    assert tmp_path not in first.root.parents
    return tmp_path, first._replace(root=tmp_path / first.root.relative_to(directory))


def edit(package: Path, module: str, before: str, after: str) -> None:
    path = package / "workflow" / f"{module}.py"
    source = path.read_text(encoding="utf-8")
    assert before in source
    path.write_text(source.replace(before, after, 1), encoding="utf-8")


def test_a_change_in_an_inlined_module_is_noticed(ran: tuple[Path, Ran]) -> None:
    copied, before = ran
    again = run(copied)
    assert (before.hits, again.hits) == (0, 1)
    assert again.value == before.value
    edit(copied, "kernels/elementary", "return float(_scaled(1.0 +", "return float(_scaled(2.0 +")
    edit(copied, "schemes/_fixed/tip_load", "return mean + (amplitude", "return 2.0 * mean + (amplitude")
    changed = run(copied)
    assert changed.hits == 0
    assert changed.value == pytest.approx(before.value + 2.0, rel=1e-12)  # e = 2 (1 + r)
    assert changed.moreau != before.moreau


def test_docstrings_comments_and_other_modules_compile_nothing_anew(ran: tuple[Path, Ran]) -> None:
    copied, first = ran
    before = {path: path.stat().st_mtime_ns for path in first.root.rglob("*.nb?")}
    for module in ("schemes/_fixed/tip_load", "schemes/moreau", "kernels/elementary", "kernels/elementwise"):
        edit(copied, module, '"""', '"""Another word, on more lines.\n\n')
    edit(copied, "kernels/lanes", "from __future__", "# a comment\nfrom __future__")
    edit(
        copied,
        "schemes/_exact/response",
        "from __future__ import annotations",
        "from __future__ import annotations; _NEW = 1",
    )
    assert run(copied) == first._replace(hits=1)
    assert {path: path.stat().st_mtime_ns for path in first.root.rglob("*.nb?")} == before


def test_damaged_files_of_the_cache_are_compiled_anew(ran: tuple[Path, Ran]) -> None:
    copied, first = ran
    for damaged in (b"", b"\0" * 4096, b"none"):
        for kind in ("*.nbi", "*.nbc"):
            for file in first.root.rglob(kind):
                file.write_bytes(damaged)
            assert run(copied) == first
            assert run(copied) == first._replace(hits=1)


def test_a_cache_on_a_full_disk_keeps_nothing(ran: tuple[Path, Ran]) -> None:
    copied, first = ran
    for file in first.root.rglob("*.nb?"):
        file.unlink()
    limited = RUN.replace("import sys", "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))")
    for _ in range(2):
        assert run(copied, limited) == first
    assert not list(first.root.rglob("*.tmp*"))


def test_directories_of_older_sources_are_removed(ran: tuple[Path, Ran]) -> None:
    """But not within a day, nor while a process has them, nor what is not of this program."""
    copied, (_, _, root, _) = ran
    (own,) = root.glob("workflow.kernels.elementwise-*")
    older, held, new, others = (
        root / f"workflow.kernels.{name}"
        for name in ("elementwise-0123456789abcdef", "elementwise-" + "1" * 16, "elementwise-" + "2" * 16, "other")
    )
    for directory in (older, held, new, others):
        shutil.copytree(own, directory)
    for directory in (older, held, others, own):
        os.utime(directory / cache._LOCK, (1, 1))
    with (held / cache._LOCK).open() as file:
        fcntl.flock(file, fcntl.LOCK_SH)
        assert run(copied).hits == 1
    assert [each.is_dir() for each in (own, older, held, new, others)] == [True, False, True, True, True]
    os.utime(own / cache._LOCK, (1, 1))
    run(copied)
    assert (own.is_dir(), held.is_dir()) == (True, False)
    assert not list(root.glob("removed-*"))


def test_a_source_that_changed_since_the_process_began_is_not_trusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Machine code of what was imported would be kept as that of the source as it is now."""
    store = tmp_path / "sources.json"
    name = "workflow.schemes.moreau"
    assert sources.digest(name, store) is not None
    sources._sources.cache_clear()
    monkeypatch.setattr(sources, "_BEGUN", 1.0)
    with pytest.raises(sources.ChangedSourceError):
        sources.digest(name, store)
    sources._sources.cache_clear()


def test_imports_are_followed_to_the_module_that_defines_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "made_up"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("from made_up.inner import used\nfrom made_up.aside import other\n")
    (package / "inner" / "__init__.py").write_text("from .deep import used\nfrom .unused import another\n")
    for name, text in {"deep": "from ..base import C\ndef used():\n    return C\n", "unused": "another = 1\n"}.items():
        (package / "inner" / f"{name}.py").write_text(text)
    for name, text in {"base": "C = 1\n", "aside": "other = 1\n", "kernels": "from made_up import used\n"}.items():
        (package / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.import_module("made_up.kernels")

    def digest() -> str | None:
        sources._sources.cache_clear()
        monkeypatch.setattr(sources, "_BEGUN", time.time() + 60)
        return sources.digest("made_up.kernels", tmp_path / "sources.json")

    first = digest()
    for name in ("aside", "inner/unused"):
        (package / f"{name}.py").write_text("other = another = 2\n")
    assert digest() == first
    (package / "base.py").write_text("C = 2  # and more\n")
    assert digest() != first


def test_nothing_writable_means_a_temporary_cache(copied: Path) -> None:
    """Files where the cache directories should be: neither of them can be made."""
    (copied / "home").write_text("")
    cache = copied / "workflow" / "kernels" / "__pycache__"
    cache.write_text("")
    ran = run(copied, XDG_CACHE_HOME=str(copied / "home"), PYTHONDONTWRITEBYTECODE="1")
    assert ran.hits == 0
    assert copied not in ran.root.parents
    assert ran.value == pytest.approx(math.e)
    shutil.rmtree(ran.root)
