"""A checksum of a whole file at its end: any byte that changes later is noticed before a library reads the file.

HDF5 reads no further than the end that it has noted itself, and cuts off what follows when it writes.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

_MARK = b"\nsha256 "
_LENGTH = len(_MARK) + 64

_PIECE = 2**20
"""Bytes read at a time."""


def seal(path: Path) -> None:
    """Append the SHA-256 of a finished file to it.

    Raises
    ------
    OSError
        The file cannot be read or written.
    """
    with open(path, "r+b") as file:
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
    with open(path, "rb") as file:
        file.seek(max(0, path.stat().st_size - _LENGTH))
        return file.read(len(_MARK)) == _MARK


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
