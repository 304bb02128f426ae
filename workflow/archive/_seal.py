"""Checksums at the end of a file, of its head and of the whole: a changed byte is noticed before a library reads it.

HDF5 reads no further than the end that it has noted itself, and cuts off what follows when it writes. It has checksums
for all that an archive holds but for the references from variables to their dimensions, on which netCDF-C crashes or
never ends: they lie in the head, which every reader compares.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

_MARK = b"\nsha256 "
_LENGTH = len(_MARK) + 64

_HEAD = re.compile(rb"\nhead +(\d+) ([0-9a-f]{64})$")
_HEAD_LENGTH = len(b"\nhead %16d " % 0) + 64

_FIRST_CHUNKS = b"TREE"
"""Signature of an index of chunks; the file's head ends at the first."""

_PIECE = 2**20
"""Bytes read at a time, and the longest head."""


def seal(path: Path) -> None:
    """Append the SHA-256 of the head and of the whole of a finished file to it.

    Raises
    ------
    OSError
        The file cannot be read or written.
    """
    with open(path, "r+b") as file:
        head = file.read(_PIECE).split(_FIRST_CHUNKS)[0]
        file.seek(0, 2)
        file.write(b"\nhead %16d %s" % (len(head), hashlib.sha256(head).hexdigest().encode()))
        file.seek(0)
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(0, 2)
        file.write(_MARK + digest.encode())


def is_sealed(path: Path) -> bool:
    """Tell whether a file ends with a checksum, right or wrong.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    return _end(path, _LENGTH).startswith(_MARK)


def has_sound_head(path: Path) -> bool:
    """Tell whether the head of a file is the one that was sealed; where there is no checksum of it, it counts as sound.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    found = _HEAD.match(_end(path, _LENGTH + _HEAD_LENGTH)[:_HEAD_LENGTH])
    if not found:
        return True
    with open(path, "rb") as file:
        return hashlib.sha256(file.read(int(found[1]))).hexdigest().encode() == found[2]


def _end(path: Path, length: int) -> bytes:
    """Return the last bytes of a file."""
    with open(path, "rb") as file:
        file.seek(max(0, path.stat().st_size - length))
        return file.read(length)


def is_intact(path: Path) -> bool:
    """Tell whether a file is, byte for byte, the one that was sealed.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    digest, left = hashlib.sha256(), path.stat().st_size - _LENGTH
    with open(path, "rb") as file:
        while left > 0:
            piece = file.read(min(_PIECE, left))
            digest.update(piece)
            left -= len(piece) or left
        return file.read() == _MARK + digest.hexdigest().encode()
