"""The cache directories of compiled kernels, one for each module with kernels and each state of what it imports.

Kernels inline functions, constants and named tuples of other modules, so that machine code is valid as long as none of
the sources changes that its module imports, directly or not. A directory is named by a digest of these, and of the
versions of Python and numba; for a module from outside by all physics packages and its own package. Directories that no
process has used for a day are removed, so that a switch between two states needs no new compilation.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

from workflow.registry import source_digest

PLAIN = "WORKFLOW_PLAIN_NUMBA"
"""Environment variable that selects numba's own compiler."""

UNUSED_SECONDS = 24 * 3600.0

_WITHOUT_KERNELS = {"judges", "study", "grid", "archive", "run", "analysis", "plots", "report", "cli"}
"""Directories of the package that no module with kernels imports."""

_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+)?import[ \t]+(\([^)]*\)|.*)", re.MULTILINE)
"""An import: the package, and the names. A syntax tree of all sources takes a tenth of a second longer."""


def _read_sources() -> dict[str, str]:
    """Return the sources of this package by the names of their modules."""
    root, sources = Path(__file__).parents[1], {}
    for path in root.rglob("*.py"):
        place = path.relative_to(root.parent)
        if place.parts[1] not in _WITHOUT_KERNELS:
            module = place.parent if place.name == "__init__.py" else place.with_suffix("")
            sources[".".join(module.parts)] = path.read_text(encoding="utf-8")
    return sources


_SOURCES = _read_sources()
"""Sources at the start of the process: one that changes later is not the one that was imported."""


@cache
def _imported(module: str) -> frozenset[str]:
    """Return the modules of this package that a module imports."""
    found = set()
    for package, names in _IMPORT.findall(_SOURCES[module]):
        found |= {package, *(f"{package}.{name}".lstrip(".") for name in re.findall(r"[\w.]+", names))}
    return frozenset(found & _SOURCES.keys())


def _closure(module: str) -> set[str]:
    """Return the modules of this package that a module imports, directly or not, and itself."""
    found: set[str] = set()
    due = {module}
    while due:
        found |= due
        due = {name for each in due for name in _imported(each)} - found
    return found


@cache
def directory_of(module: str) -> Path | None:
    """Return the cache directory for the kernels of an imported module; ``None`` where there is none.

    It is below ``NUMBA_CACHE_DIR`` where that is set, else next to the sources or in the user's cache. There is none
    where the module's source is no file, or no directory can be written.
    """
    is_ours = module in _SOURCES
    source = module if is_ours else source_digest(module.split(".")[0])
    if source is None:
        return None
    used = [(name, _SOURCES[name]) for name in sorted(_closure(module) if is_ours else _SOURCES)]
    state = used, source, sys.version_info[:3], version("numba"), bool(os.environ.get(PLAIN))
    name = hashlib.sha256(repr(state).encode()).hexdigest()[:16]
    of_user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    for parent in [Path(chosen)] if chosen else [Path(__file__).parent / "__pycache__", of_user]:
        with suppress(OSError, RuntimeError):  # it cannot be written, or the user has no home
            directory = parent.expanduser() / "rotor-stator-workflow" / name
            directory.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=directory):
                os.utime(directory)
            _remove_unused(directory.parent)
            return directory
    return None


def _remove_unused(root: Path) -> None:
    """Remove the directories that no process has used for :data:`UNUSED_SECONDS`."""
    for directory in root.iterdir():
        with suppress(OSError):  # another process removes it
            if time.time() - directory.stat().st_mtime > UNUSED_SECONDS:
                shutil.rmtree(directory, ignore_errors=True)
