"""Lanes: memory layout of a block of cases, one case per lane.

Numbers of each case lie in a few arrays ``(row, lane)`` or records of named rows, not in one array per quantity, and a
kernel asserts before its first step that a row of an array has ``ROW`` numbers. Both are for speed: with a stride known
at compile time the compiler can prove that rows do not overlap and computes eight lanes at once; else it compares
addresses before each short loop, or computes lane by lane. Idle lanes pad the last pack (a tip at rest that never
touches), so that the vectorised loop serves every lane and a case's numbers do not depend on its position in a
batch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import prod
from typing import Any, TypeVar, cast

import numpy as np

from workflow.kernels import Array

LANES = 64
"""Largest number of lanes of a block: they share the fixed cost of a step."""

CACHED = 32 * 1024
"""Largest size of the rows of a block, bytes: two thirds of the first-level cache of the processor of the measurement,
which leaves room for samples and coefficients."""

ROW = LANES + 8
"""Stride of rows: an odd number of cache lines, since rows a power of two apart compete for the same lines of the
cache. It gains a few percent."""

PACK = 8
"""Lanes of a narrow pack: a register of the widest processors."""

FEWEST_LANES = 16
"""Smallest number of lanes of a block: with fewer the fixed cost of a step weighs more than rows beyond the cache."""


def cached_lanes(rows: int) -> int:
    """Return the number of lanes of a block that uses ``rows`` in a step: whole packs that fit in the cache."""
    lanes = LANES
    while lanes > FEWEST_LANES and 8 * rows * lanes > CACHED:
        lanes //= 2
    return lanes


class Rows:
    """Named rows of lanes, or of all cases: a subclass annotates a name for each.

    Its objects are NumPy records (:func:`named_rows`) with the rows as fields, whose offsets are constants in kernels.
    """


R = TypeVar("R", bound=Rows)


def rows_in(kind: type[Rows]) -> int:
    """Return the number of rows of a kind."""
    return len(kind.__annotations__)


def named_rows(kind: type[R], rows: Array) -> R:
    """Return contiguous rows ``(…, row, lane)`` as a record of a kind, or as an array of records."""
    record: Any = _record(cast(Any, kind), rows.shape[-1])
    pieces: Any = rows.reshape(*rows.shape[:-2], rows.shape[-2] * rows.shape[-1]).view(record)
    named: R = pieces[..., 0][()]
    return named


def several_rows(kind: type[R], rows: Array) -> Sequence[R]:
    """Return contiguous rows ``(number, row, lane)`` as records for kernels: of one a tuple, which costs nothing."""
    several: Any = (named_rows(kind, rows[0]),) if len(rows) == 1 else named_rows(kind, rows)
    records: Sequence[R] = several
    return records


@cache
def _record(kind: type[Rows], width: int) -> Any:
    """Return the type of a record; cached, as numba analyses each new object of an equal type again at every call."""
    return np.dtype((np.record, np.dtype([(name, float, (width,)) for name in kind.__annotations__], align=True)))


def lane_rows(*shape: int) -> Array:
    """Return zeros of shape ``(*shape, ROW)``, aligned to 64 bytes.

    Rows that straddle cache lines halve the speed of memory; NumPy aligns to 16 bytes only.
    """
    size = ROW * int(np.prod(shape))
    raw = np.zeros(size + 8)
    first = -raw.ctypes.data % 64 // 8
    return raw[first : first + size].reshape(*shape, ROW)


@dataclass(frozen=True, eq=False)
class LaneTable:
    """Numbers of a batch in two arrays: those of all cases, and the lanes of the block of cases that a kernel steps."""

    values: Array
    """``(row, case)``: a kernel copies a block of cases to the lanes and back."""
    buffer: Array
    """The lanes, ``(row, ROW)``."""
    cases: dict[str, Array]
    lanes: dict[str, Array]
    """``cases``, ``lanes``: views of both by name, ``(…, case)`` and ``(…, ROW)``."""


def lane_table(parts: Mapping[str, Array]) -> LaneTable:
    """Return the table of named parts ``(…, case)``, whose values it copies."""
    flat = [part.reshape(prod(part.shape[:-1]), part.shape[-1]) for part in parts.values()]
    values, sizes = np.concatenate(flat), [len(rows) for rows in flat]
    buffer, ends = lane_rows(len(values)), np.cumsum(sizes)[:-1]
    cases, lanes = (
        {
            name: rows.reshape(*part.shape[:-1], rows.shape[-1])
            for (name, part), rows in zip(parts.items(), np.split(whole, ends), strict=True)
        }
        for whole in (values, buffer)
    )
    return LaneTable(values, buffer, cases, lanes)
