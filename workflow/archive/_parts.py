"""The directory beside an unfinished archive: its layout, and what to clear away."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workflow.archive._files import ArchiveError, commit, reason, require_directory, sync, usable, writing
from workflow.archive._hold import HOLDER
from workflow.archive._layout import FORMAT, Attributes, Coordinate, Layout, Variable
from workflow.archive._shard import SUFFIX
from workflow.archive._stored_cells import STORED_CELLS, StoredCells, saved_file

LAYOUT = "layout.json"


def parts_of(path: str | Path) -> Path:
    """Return the directory that holds an archive's shards while its study runs; a link is followed."""
    path = usable(path)
    path = path.resolve() if path.is_symlink() else path
    return path.with_name(path.name + ".parts")


def start_parts(parts: str | Path, layout: Layout) -> None:
    """Make the directory for the shards of a layout, or take up one that a run left behind.

    The layout is stored in it (JSON, atomically), leftovers of interrupted writes are swept, shards
    stay. One run at a time: whoever calls this holds the directory.

    Raises
    ------
    ArchiveError
        The directory holds shards of another study or what no run left there, or cannot be written.
    """
    parts = Path(parts)
    require_directory(parts)
    with writing("the directory of the shards", parts.parent):
        parts.mkdir(exist_ok=True)
        sync(parts.parent)
    if (parts / LAYOUT).exists() and read_layout(parts).key != layout.key:
        raise ArchiveError(
            f"{parts}: holds unfinished results of another study or solver version; finish that one, "
            "remove the directory, or choose another archive"
        )
    if others := _others(parts):
        raise ArchiveError(
            f"{parts}: holds {others[0]}, which no run left there; move it away, or choose another archive with -o"
        )
    with writing("the layout", parts):
        for leftover in parts.glob("*.tmp"):
            leftover.unlink(missing_ok=True)
        commit(parts / LAYOUT, json.dumps(_to_json(layout)).encode())


def _is_ours(file: Path) -> bool:
    """Tell whether a run may have left a file: only such files go in the end."""
    named = (
        file.name in (LAYOUT, HOLDER, STORED_CELLS) or file.suffix in (".tmp", SUFFIX) or file.name.startswith(".nfs")
    )
    return named and file.is_file()


def _others(parts: Path) -> list[str]:
    """Return the names of what no run left in the directory of the shards."""
    return sorted(file.name for file in parts.iterdir() if not _is_ours(file))


def read_layout(parts: str | Path) -> Layout:
    """Return the layout that :func:`start_parts` stored.

    Raises
    ------
    ArchiveError
        There is none, or it is not one that this version wrote.
    """
    path = Path(parts) / LAYOUT
    try:
        stored = json.loads(path.read_bytes())
        if stored["format"] != FORMAT:
            raise ArchiveError(
                f"{path}: format {stored['format']}, this version reads {FORMAT}; use the version that began it"
            )
        return _from_json(stored)
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {reason(error)}; a run's directory of shards has it") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ArchiveError(
            f"{path}: damaged; remove the directory and give the command again, the study runs anew"
        ) from error


def is_begun(parts: str | Path, layout: Layout, archive: Path) -> bool:
    """Tell whether a run of this very layout has begun there and found this very file under the archive's name.

    Raises
    ------
    ArchiveError
        What that run left is damaged.
    """
    parts = Path(parts)
    if not (parts / LAYOUT).exists() or read_layout(parts).key != layout.key:
        return False
    return saved_file(parts) == StoredCells(archive, np.empty(0, dtype=np.int64)).file


def clear_parts(parts: str | Path) -> None:
    """Remove what runs left in the directory of the shards but the file of the run that holds it."""
    for file in Path(parts).iterdir():
        if file.name != HOLDER and _is_ours(file):
            file.unlink(missing_ok=True)


def remove_parts(parts: str | Path) -> None:
    """Remove the directory of the shards, if there is one; the archive must be in place before.

    Raises
    ------
    ArchiveError
        It cannot be removed.
    """
    parts = Path(parts)
    try:
        for file in filter(_is_ours, parts.iterdir()):
            file.unlink(missing_ok=True)
        parts.rmdir()
    except FileNotFoundError:
        return
    except OSError as error:
        if parts.is_dir() and all(file.name.startswith(".nfs") for file in parts.iterdir()):
            return  # NFS keeps what is still open under such names; the next run finds an empty directory
        if parts.is_dir() and (others := _others(parts)):
            raise ArchiveError(
                f"{parts}: the archive is complete; the directory stays because it holds {others[0]}, which no run "
                "left there: move it away and remove the directory"
            ) from error
        raise ArchiveError(
            f"{parts}: the archive is complete, but its shards could not be removed: {reason(error)}; "
            "remove the directory by hand"
        ) from error


def _to_json(layout: Layout) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "key": layout.key,
        "dims": layout.dims,
        "tails": dict(layout.tails),
        "chunk": layout.chunk,
        "coordinates": [
            {"name": c.name, "dims": c.dims, "type": "text" if c.text else c.values.dtype.str,
             "values": c.values.tolist(), "attrs": _plain(c.attrs)}
            for c in layout.coordinates
        ],
        "variables": [
            {"name": v.name, "kind": v.kind, "dtype": v.dtype, "attrs": _plain(v.attrs), "optional": v.optional}
            for v in layout.variables
        ],
        "attrs": dict(layout.attrs),
        "provenance": dict(layout.provenance),
    }  # fmt: skip


def _from_json(stored: Mapping[str, Any]) -> Layout:
    coordinates = tuple(
        Coordinate(c["name"], tuple(c["dims"]), np.array(c["values"], _dtype(c["type"])), c["attrs"])
        for c in stored["coordinates"]
    )
    return Layout(
        dims=tuple((name, size) for name, size in stored["dims"]),
        tails=stored["tails"],
        chunk=stored["chunk"],
        coordinates=coordinates,
        variables=tuple(Variable(**v) for v in stored["variables"]),
        attrs=stored["attrs"],
        provenance=stored["provenance"],
        key=stored["key"],
    )


def _dtype(name: str) -> Any:
    return object if name == "text" else np.dtype(name)


def _plain(attrs: Attributes) -> dict[str, str | Sequence[int] | Sequence[float]]:
    return {k: value if isinstance(value, str) else np.asarray(value).tolist() for k, value in attrs.items()}
