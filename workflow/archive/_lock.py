"""The one lock around netCDF-C and HDF5, which are not safe to use from several threads."""

from __future__ import annotations

import threading


class _ArchiveLock:
    """One per process, wherever it is unpickled; the thread that holds it may take it again.

    It is handed to xarray for lazy reads, and held around xarray's own opening of a file: opening
    reads metadata without a lock and coordinates with it. dask has such locks too, but takes a tenth
    of a second to import.
    """

    def __init__(self) -> None:
        held = threading.RLock()
        self.acquire, self.release = held.acquire, held.release

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def __reduce__(self) -> str:
        return "LOCK"


LOCK = _ArchiveLock()
