"""A checksum of a whole file inside the file: any byte that changes later is noticed."""

from __future__ import annotations

import hashlib
import mmap
from pathlib import Path

FILE_CHECKSUM = "file_checksum"
"""Text of the provenance group: the SHA-256 of the file in which :data:`BLANK` stands in its place.

Characters of a contiguous variable, which HDF5 does not protect by a checksum of its own as it does attributes."""

BLANK = hashlib.sha256(b"rotor-stator-workflow: here the checksum of this file will stand").hexdigest()
"""As long as a checksum, and found nowhere else in a file."""

_PIECE = 2**20
"""Bytes read at a time."""


def seal(path: Path) -> None:
    """Put the checksum of a finished file in the place of :data:`BLANK`.

    Raises
    ------
    OSError
        The file cannot be read or written.
    ValueError
        The place is not there, or not the only one.
    """
    place = _only_place(path, BLANK)
    checksum = _checksum(path, place)
    with open(path, "r+b") as file:
        file.seek(place)
        file.write(checksum.encode())


def is_sealed_with(path: Path, checksum: str) -> bool:
    """Tell whether a file is, byte for byte, the one that was sealed with a checksum."""
    try:
        return _checksum(path, _only_place(path, checksum)) == checksum
    except ValueError:
        return False


def _only_place(path: Path, text: str) -> int:
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        place = data.find(text.encode())
        if place < 0 or data.find(text.encode(), place + 1) >= 0:
            raise ValueError("the place of the checksum is not found")
        return place


def _checksum(path: Path, place: int) -> str:
    """Return the checksum of a file in which :data:`BLANK` stands at a place."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        for start, stop in ((0, place), (place + len(BLANK), path.stat().st_size)):
            file.seek(start)
            while start < stop:
                piece = file.read(min(_PIECE, stop - start))
                digest.update(piece)
                start += len(piece)
            if stop == place:
                digest.update(BLANK.encode())
    return digest.hexdigest()
