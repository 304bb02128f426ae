"""Lanes: where the cases of a block lie beside each other in memory.

Numbers of each case lie in a few arrays ``(row, lane)`` or records of rows that have names, not in one array per
quantity, and a kernel asserts before its first step that a row of an array is ``ROW`` long. Both are for speed: where
the distance between two rows is known at compile time, the compiler can prove that rows do not overlap and steps eight
lanes at once; else it compares their addresses before each short loop, or steps lane by lane. Idle lanes fill up the
last pack (all zero: a tip at rest, far from its casing), so that the vectorised loop serves every lane and a case's
numbers do not depend on its place in a batch.
"""

from __future__ import annotations

from functools import cache
from typing import Any, TypeVar, cast

import numpy as np

from workflow.kernels import Array

LANES = 64
"""Most lanes of a block: they share what a step costs beside its lanes."""

CACHED = 32 * 1024
"""Bytes that the rows of a block may take: two thirds of the first-level cache of the processor they were chosen on,
which leaves room for samples and coefficients."""

ROW = LANES + 8
"""Numbers from one row to the next: an odd number of cache lines, since rows a power of two apart compete
for the same lines of the cache. Worth a few percent."""

PACK = 8
"""Lanes of a narrow pack: a register of the widest processors."""

FEWEST_LANES = 16
"""Lanes that a block has at least: they share what a step costs beside its lanes."""


def cached_lanes(rows: int) -> int:
    """Return the lanes of a block that goes through so many rows in a step: whole packs that stay in the cache."""
    lanes = LANES
    while lanes > FEWEST_LANES and 8 * rows * lanes > CACHED:
        lanes //= 2
    return lanes


class Rows:
    """Named rows of lanes, or of all cases: a subclass annotates a name for each.

    Its objects are records of NumPy's (:func:`named_rows`), whose fields are the rows: kernels know where each lies.
    """


R = TypeVar("R", bound=Rows)


def rows_in(kind: type[Rows]) -> int:
    """Return the number of rows of a kind."""
    return len(kind.__annotations__)


def named_rows(kind: type[R], rows: Array) -> R:
    """Return rows ``(…, row, lane)``, which lie in one piece, as a record of a kind, or an array of records."""
    record: Any = _record(cast(Any, kind), rows.shape[-1])
    pieces: Any = rows.reshape(*rows.shape[:-2], rows.shape[-2] * rows.shape[-1]).view(record)
    named: R = pieces[..., 0][()]
    return named


@cache
def _record(kind: type[Rows], width: int) -> Any:
    """Return the type of a record; kept, as numba analyses each new object of it, though equal, at every call."""
    return np.dtype((np.record, np.dtype([(name, float, (width,)) for name in kind.__annotations__], align=True)))


def lane_rows(*shape: int) -> Array:
    """Return zeros of shape ``(*shape, ROW)`` that begin at a multiple of 64 bytes.

    Rows that straddle cache lines halve the speed of memory; NumPy aligns to 16 bytes only.
    """
    size = ROW * int(np.prod(shape))
    raw = np.zeros(size + 8)
    first = -raw.ctypes.data % 64 // 8
    return raw[first : first + size].reshape(*shape, ROW)


def fill_lanes(rows: Array, values: Array) -> None:
    """Put values ``(…, case)`` in the first lanes of ``rows`` and zeros in the rest."""
    count = values.shape[-1]
    rows[..., :count] = values
    rows[..., count:] = 0.0
