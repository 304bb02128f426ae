"""The cache directory of compiled kernels, one for each state of their sources.

Kernels inline functions, constants and named tuples of other modules, so that machine code is valid as long as none of
these sources changes. A directory is named by a digest of all sources of the physics packages, of those of the package
of an external scheme, and of the versions of Python and numba. Directories that no process has used for a day are
removed, so that a switch between two states needs no new compilation.
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
"""Environment variable that selects numba's own compiler."""

UNUSED_SECONDS = 24 * 3600.0

_WITHOUT_KERNELS = {"judges", "study", "grid", "archive", "run", "analysis", "plots", "report", "cli"}
"""Directories of the package without sources of kernels."""

_DIGEST = digest(Path(__file__).parents[1], "**/*.py", _WITHOUT_KERNELS)
"""Digest at the start of the process: a source that changes later is not the one that was imported."""


@cache
def directory_of(module: str) -> Path | None:
    """Return the cache directory for the kernels of an imported module; ``None`` where there is none.

    It is below ``NUMBA_CACHE_DIR`` where that is set, else next to the sources or in the user's cache. There is none
    where the module's source is no file, or no directory can be written.
    """
    package, ours = module.split(".")[0], __name__.split(".")[0]
    source = _DIGEST if package == ours else source_digest(package)
    if source is None:
        return None
    state = _DIGEST, source, sys.version_info[:3], version("numba"), bool(os.environ.get(PLAIN))
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
