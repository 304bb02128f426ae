"""An archive holds its data itself, each piece once: what leads elsewhere is refused before any of it is read."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from workflow.archive._files import ArchiveError
from workflow.archive._stored import STATUS

_MOST_DEFLATED = 1032
"""Bytes that one byte of zlib's stands for, at most (RFC 1951: 258 bytes in two bits)."""


def require_own_data(path: Path, file: Any) -> None:
    """Refuse an HDF5 file with links that are no plain names, with data elsewhere, or with larger sizes than its bytes.

    Soft and external links, external files of raw data and virtual datasets lead out of it; a second name of one object
    may lead round in a circle. Parameters are its path and the file as h5py has opened it.

    Raises
    ------
    ArchiveError
        It is such a file.
    """
    from h5py import h5d, h5l, h5o

    seen, names, size = {h5o.get_info(file.id).addr}, list[bytes](), path.stat().st_size

    def is_odd(name: bytes, link: Any) -> bytes | None:
        """Return the name of a link that is odd, which ends the visit."""
        if link.type != h5l.TYPE_HARD or link.u in seen:
            return name
        seen.add(link.u)
        names.append(name)
        return None

    odd = file.id.links.visit(is_odd, info=True)
    for name in names if odd is None else ():
        entry = h5o.open(file.id, name)
        if isinstance(entry, h5d.DatasetID):
            made = entry.get_create_plist()
            if made.get_layout() == h5d.VIRTUAL or made.get_external_count():
                odd = name
                break
            count = math.prod(entry.shape)
            # a case takes its hash of 16 bytes, which is not compressed
            if count * entry.get_type().get_size() > _MOST_DEFLATED * size or (
                name == STATUS.encode() and count > size
            ):
                raise ArchiveError(f"{path}: damaged, `{_shown(name)}` has more values than its bytes; restore a copy")
    if odd is not None:
        raise ArchiveError(
            f"{path}: `{_shown(odd)}` leads to other data, as in no archive that `workflow run` wrote; nothing of it "
            "is read: ask for one from where it came"
        )


def _shown(name: bytes) -> str:
    return name.decode(errors="replace")
