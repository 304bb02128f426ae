"""The directory in which compiled kernels are kept, one for each state of the sources that kernels are made of.

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

_WITHOUT_KERNELS = {"judges", "study", "grid", "archive", "run", "analysis", "plots", "report", "cli"}
"""Directories of the package whose sources no kernel is made of."""

_DIGEST = digest(Path(__file__).parents[1], "**/*.py", _WITHOUT_KERNELS)
"""Taken when the process begins: a source that changes later is not the one that was imported."""


@cache
def directory_of(module: str) -> Path | None:
    """Return where the compiled kernels of an imported module are kept; ``None`` where they cannot be.

    That is where its source is no file, or no directory can be written: below ``NUMBA_CACHE_DIR`` where that is set,
    else beside the sources or in the user's cache.
    """
    package, ours = module.split(".")[0], __name__.split(".")[0]
    source = _DIGEST if package == ours else source_digest(package)
    if source is None:
        return None
    state = _DIGEST, source, sys.version_info[:3], version("numba"), bool(os.environ.get(PLAIN))
    name = hashlib.sha256(repr(state).encode()).hexdigest()[:16]
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    for parent in [Path(chosen)] if chosen else [Path(__file__).parent / "__pycache__", home]:
        directory = parent / "rotor-stator-workflow" / name
        with suppress(OSError):
            directory.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=directory):
                os.utime(directory)
            _remove_unused(directory.parent)
            return directory
    return None


def _remove_unused(root: Path) -> None:
    """Remove the directories that no process has used for long."""
    for directory in root.iterdir():
        with suppress(OSError):  # another process removes it
            if time.time() - directory.stat().st_mtime > UNUSED_SECONDS:
                shutil.rmtree(directory, ignore_errors=True)
