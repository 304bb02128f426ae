"""The one lock around netCDF-C and HDF5, which are not safe to use from several threads.

This module is loaded on demand: dask takes a tenth of a second to import.
"""

from __future__ import annotations

import threading

from dask.utils import SerializableLock

_HELD = threading.RLock()


class _ArchiveLock(SerializableLock):
    """One per process, wherever it is unpickled; the thread that holds it may take it again.

    It is handed to xarray for lazy reads, and held around xarray's own opening of a file: opening
    reads metadata without a lock and coordinates with it.
    """

    def __init__(self, token: str) -> None:
        super().__init__(token)
        self.lock = _HELD  # type: ignore[assignment]


LOCK = _ArchiveLock("rotor-stator-workflow.archive")
