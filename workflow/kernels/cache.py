"""Directories in which compiled kernels are kept, one for each state of the sources that kernels are made of.

Kernels inline functions, constants and named tuples of other modules, so that machine code is right as long as none of
these sources changes. A directory is named by a digest of all sources of the physics floor, of those of the package
that a scheme from outside comes from, and of the versions of Python and numba. Those of other states that no process
has used for a day are removed: whoever goes back and forth between two states compiles nothing anew.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

from workflow.registry import digest, source_digest

PLAIN = "WORKFLOW_PLAIN_NUMBA"
"""Environment variable that has numba's own compiler used."""

UNUSED_SECONDS = 24 * 3600.0

_NAME = "rotor-stator-workflow"
_WITHOUT_KERNELS = {"judges", "study", "grid", "archive", "run", "analysis", "plots", "report", "cli"}
"""Directories of the package whose sources no kernel is made of."""


@cache
def root() -> Path:
    """Return the directory of all compiled kernels.

    It lies in ``NUMBA_CACHE_DIR`` where that is set, else beside the sources, else in the user's cache; it is a
    temporary one where none of them can be written.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for parent in [Path(chosen)] if chosen else [Path(__file__).parent / "__pycache__", home]:
        directory = parent / _NAME
        try:
            directory.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=directory):
                return directory
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix=f"{_NAME}-"))


def is_lasting() -> bool:
    """Tell whether other processes find the same directory."""
    return root().name == _NAME


def directory_of(module: str) -> Path | None:
    """Return where the compiled kernels of an imported module are kept; ``None`` where its source is no file."""
    return _directory_of(module.split(".")[0], bool(os.environ.get(PLAIN)))


@cache
def _directory_of(package: str, plain: bool) -> Path | None:
    state: tuple[object, ...] = (_DIGEST, sys.version_info[:3], version("numba"), plain)
    if package != __name__.split(".")[0]:
        outside = source_digest(package)
        if outside is None:
            return None
        state += (outside,)
    directory = root() / hashlib.sha256(repr(state).encode()).hexdigest()[:16]
    directory.mkdir(parents=True, exist_ok=True)
    os.utime(directory)
    for other in root().iterdir():
        with suppress(OSError):  # another process removes it
            if time.time() - other.stat().st_mtime > UNUSED_SECONDS:
                shutil.rmtree(other, ignore_errors=True)
    return directory


_DIGEST = digest(Path(__file__).parents[1], "**/*.py", _WITHOUT_KERNELS)
"""Taken when the process begins: a source that changes later is not the one that was imported."""
