"""A checksum of a whole file inside the file: any byte that changes later is noticed."""

from __future__ import annotations

import hashlib
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
    """Tell whether a file is, byte for byte, the one that was sealed with a checksum.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    if len(checksum) != len(BLANK):
        return False
    try:
        return _checksum(path, _only_place(path, checksum)) == checksum
    except ValueError:
        return False


def _only_place(path: Path, text: str) -> int:
    """Return where a text stands in a file, read in pieces: a mapped file would count as memory of this process."""
    pattern, places, start, overlap = text.encode(), [], 0, b""
    with open(path, "rb") as file:
        while piece := file.read(_PIECE):
            piece = overlap + piece
            at = piece.find(pattern)
            while at >= 0:
                places.append(start + at)
                at = piece.find(pattern, at + 1)
            overlap = piece[1 - len(pattern) :]
            start += len(piece) - len(overlap)
    if len(places) != 1:
        raise ValueError("the place of the checksum is not found")
    return places[0]


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
