"""Libraries may crash, or never end, on a file whose bytes have changed: a process of its own reads it first."""

from __future__ import annotations

import os
import signal
import warnings
from pathlib import Path

from workflow.archive._files import ArchiveError
from workflow.archive._open import open_archive, provenance
from workflow.archive._stored import STATUS, opened

_SECONDS = 4.0
"""Processor time after which reading counts as endless; archives of 1e5 chunks take a tenth of it."""


def require_readable(path: Path) -> None:
    """Refuse an archive that crashes a process that reads it, or keeps it busy; who opens it tells what else is wrong.

    Raises
    ------
    ArchiveError
        It is such a file.
    """
    if not path.is_file():
        return
    import h5py  # noqa: F401 - libraries that the new process then has
    import netCDF4  # noqa: F401
    import xarray  # noqa: F401

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # about threads, none of which reads archives now
        process = os.fork()
    if not process:
        try:
            signal.setitimer(signal.ITIMER_PROF, _SECONDS)
            _read(path)
        finally:
            os._exit(0)
    if os.WIFSIGNALED(os.waitpid(process, 0)[1]):
        raise ArchiveError(
            f"{path}: damaged, libraries that read it crash or do not end; restore a copy, or move it away and run its "
            "study again"
        )


def _read(path: Path) -> None:
    """Read all that HDF5 follows pointers to; values in chunks have checksums."""
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    with open_archive(path) as dataset:
        dataset[[STATUS]].load()
    provenance(path)
    with opened(path) as file:
        for entry in file.values():
            if getattr(entry, "chunks", None):
                entry.id.get_num_chunks()
