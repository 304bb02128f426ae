"""Shards: the results of some cases in a file of arrays, whose presence says that they are done.

A shard is an ``.npz`` of one array for each variable, ``(case, …)``, with the messages of its cases and their hashes;
each array has a CRC. It is written aside in one go, flushed and renamed.
"""

from __future__ import annotations

import io
import os
import struct
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.archive._files import ArchiveError, commit, reason, writing
from workflow.archive._stored import CASE_HASH, MESSAGE, STATUS, Hashes, Source

if TYPE_CHECKING:
    import xarray as xr

SUFFIX = ".npz"

LONGEST_MESSAGE = 4000
"""Bytes of a case's message that are kept; those of this package have a few hundred."""


def write_shard(
    parts: str | Path,
    name: str,
    hashes: Hashes,
    values: Mapping[str, NDArray[Any]],
    messages: Mapping[int, str],
    template: xr.Dataset,
) -> Path:
    """Store the results of some cases durably and return the shard's path.

    Threads and processes may write at the same time. When this returns the shard survives a crash;
    when it does not, there is none.

    Parameters
    ----------
    parts
        The directory that :func:`start_parts` made.
    name
        Of the shard; of two that hold the same case the one whose name comes last counts.
    hashes
        Identity of each case, ``(case, byte)``.
    values
        One array for each variable of the template, ``(case, …)``.
    messages
        What a case has to say, by its position.

    Raises
    ------
    ArchiveError
        The disk is full, or the directory missing or not writable.
    """
    parts, image = Path(parts), io.BytesIO()
    encoded = {k: truncated_message(text).encode() for k, text in messages.items()}
    texts = np.zeros(len(hashes), f"S{max([1, *map(len, encoded.values())])}")
    for k, text in encoded.items():
        texts[k] = text
    np.savez(
        image,
        allow_pickle=False,
        **{str(name): _as_stored(values[str(name)], template.variables[name].dtype) for name in template.data_vars},
        **{MESSAGE: texts, CASE_HASH: hashes},
    )
    path = parts / f"{name}{SUFFIX}"
    with writing("a shard", parts):
        commit(path, image.getbuffer())
    return path


def find_shards(parts: str | Path, since: str = "") -> list[Source]:
    """Return the sound shards in the order of their names; with ``since``, only those not named before it.

    Every byte is compared with its checksum now; with ``since``, which a run gives for its own shards, when it is used.
    A damaged shard is left where it is: its cases are run again.
    """
    sources = []
    for path in sorted(one for one in Path(parts).glob(f"*{SUFFIX}") if one.name >= since):
        with suppress(Exception):  # whatever changed bytes make of the libraries
            members = _members(path)
            for name in () if since else members:
                _read(path, members, name)
            kinds = {name: (member.dtype, member.shape[1:]) for name, member in members.items()}
            hashes, status = (_read(path, members, name) for name in (CASE_HASH, STATUS))
            sources.append(Source(hashes, status, partial(_read, path, members), kinds, path.name))
    return sources


def truncated_message(text: str) -> str:
    """Return a case's message cut to :data:`LONGEST_MESSAGE` bytes."""
    encoded = text.encode(errors="replace")
    if len(encoded) <= LONGEST_MESSAGE:
        return encoded.decode()
    return encoded[: LONGEST_MESSAGE - 3].decode(errors="ignore") + "…"


def _as_stored(values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    with np.errstate(over="ignore"):  # a diverged float64 is an infinite float32
        values = np.asarray(values, dtype=dtype.newbyteorder("<"))
    if values.dtype.kind == "f" and (missing := np.isnan(values)).any():
        values = np.where(missing, np.array(np.nan, values.dtype), values)  # one NaN, whatever made it
    return values


class _Member(NamedTuple):
    """An array in a shard: where its bytes begin, header included, their number and CRC, and what they are."""

    begin: int
    size: int
    crc: int
    header: int
    shape: tuple[int, ...]
    order: Literal["C", "F"]
    dtype: np.dtype[Any]


def _members(path: Path) -> dict[str, _Member]:
    """Return the arrays of a shard by name."""
    members = {}
    with open(path, "rb") as file, zipfile.ZipFile(file) as arrays:
        for info in arrays.infolist():
            file.seek(info.header_offset + 26)  # of the lengths of name and extra field, which the bytes follow
            length, extra = struct.unpack("<HH", file.read(4))
            if file.read(length) != info.filename.encode():
                raise ValueError(f"{info.filename} has two names")
            begin = file.seek(extra, os.SEEK_CUR)
            np.lib.format.read_magic(file)
            shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
            about = begin, info.file_size, info.CRC, file.tell() - begin, shape
            members[info.filename.removesuffix(".npy")] = _Member(*about, "F" if is_fortran else "C", dtype)
    return members


def _read(path: Path, members: Mapping[str, _Member], name: str) -> NDArray[Any]:
    """Return an array, read against its checksum: by NumPy and its zip it takes ten times as long."""
    try:
        member = members[name]
        with open(path, "rb") as file:
            file.seek(member.begin)
            image = file.read(member.size)
        if zlib.crc32(image) != member.crc:
            raise ValueError(f"checksum of {name}")
        return np.frombuffer(image, member.dtype, offset=member.header).reshape(member.shape, order=member.order)
    except Exception as error:
        raise ArchiveError(f"{path}: damaged meanwhile ({reason(error)}); give the command again") from error
