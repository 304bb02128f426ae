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
    """Refuse an archive, as h5py has opened it, that leads out of its file, in a circle, or to more than it can hold.

    Soft and external links, raw data in other files and virtual datasets lead out, a second name of one object may lead
    in a circle.

    Raises
    ------
    ArchiveError
        It is such a file.
    """
    from h5py import h5d, h5l, h5o, h5t

    seen, size = {h5o.get_info(file.id).addr: b"/"}, file.id.get_filesize()

    def leads_away(name: bytes, link: Any) -> bytes | None:
        """Return the name of a link that does, which ends the visit."""
        return name if link.type != h5l.TYPE_HARD or seen.setdefault(link.u, name) != name else None

    odd = file.id.links.visit(leads_away, info=True)
    for name in seen.values() if odd is None else ():
        entry = h5o.open(file.id, name)
        if isinstance(entry, h5d.DatasetID):
            made = entry.get_create_plist()
            if made.get_layout() == h5d.VIRTUAL or made.get_external_count():
                odd = name
                break
            kind, count = entry.get_type(), math.prod(entry.shape)
            is_text = isinstance(kind, h5t.TypeStringID) and (kind.is_variable_str() or kind.get_size() == 1)
            if not (is_text or isinstance(kind, h5t.TypeIntegerID | h5t.TypeFloatID)):
                raise ArchiveError(f"{path}: `{name.decode()}` has neither numbers nor texts; get a sound copy")
            most = size if name == STATUS.encode() else _MOST_DEFLATED * size / kind.get_size()
            if count > most:  # a case takes its hash, which is not compressed
                raise ArchiveError(f"{path}: `{name.decode()}` has more values than there are bytes; restore a copy")
    if odd is not None:
        raise ArchiveError(
            f"{path}: `{odd.decode(errors='replace')}` leads to other data, as in no archive that `workflow run` "
            "wrote; nothing of it is read: get a sound copy"
        )
