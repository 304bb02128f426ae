"""Whether an archive is, byte for byte, the file that was written: asked wherever an archive is used."""

from __future__ import annotations

import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

from workflow.archive._create import CASE_HASH, PROVENANCE
from workflow.archive._files import ArchiveError, reason
from workflow.archive._guard import identity, is_vouched_for
from workflow.archive._judge import as_text
from workflow.archive._seal import FILE_CHECKSUM, is_sealed_with

DAMAGED = "its bytes are not those that were written"

_LOST = "lost"
"""Stands for the checksum of a file that must have had one."""


def stored_checksum(file: Any) -> str:
    """Return the checksum in an archive that h5py has opened, empty for one of a version that stored none.

    Such versions did not keep the identity of cases either: where that is there, the checksum was too.
    """
    group = file.get(PROVENANCE, {})
    if FILE_CHECKSUM in group:
        return as_text(group[FILE_CHECKSUM][()].tobytes())
    return _LOST if CASE_HASH in group else ""


def is_whole(path: Path, checksum: str) -> bool:
    """Tell whether a file is as it was written, by the checksum in it; one without a checksum passes.

    All bytes are read, at about 1.5 GB/s from memory, once for a file that does not change while this process lasts.
    A file that this process has made and read back is not read again.

    Raises
    ------
    ArchiveError
        The file cannot be read.
    """
    if not checksum or is_vouched_for(path):
        return True
    try:
        return _is_whole(path, checksum, *identity(path))
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {reason(error)}") from error


def require_whole(path: Path, checksum: str, damaged: bool = False) -> bool:
    """Refuse a damaged archive, or warn of it where it is wanted all the same; return whether it is whole.

    Raises
    ------
    ArchiveError
        It is damaged, and ``damaged`` is false.
    """
    if is_whole(path, checksum):
        return True
    if damaged:
        warnings.warn(f"{path}: damaged, {DAMAGED}; any value may be wrong", stacklevel=4)
        return False
    raise ArchiveError(
        f"{path}: damaged, {DAMAGED}; restore a copy, or run its study again with --recompute. It is opened as it is "
        "by open_archive(path, damaged=True) and by --damaged of `workflow show` and `workflow report`"
    )


@lru_cache(maxsize=1024)
def _is_whole(path: Path, checksum: str, *_unchanged: int) -> bool:
    return is_sealed_with(path, checksum)
