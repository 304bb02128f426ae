"""Lanes: where the cases of a block lie beside each other in memory.

Everything that is kept per lane lies in a few arrays ``(row, lane)``, not in one array per name,
and functions that loop over lanes assert that a row is ``ROW`` long. Both are for speed:
where the distance between two rows is known at compile time, the compiler can
prove that rows do not overlap and steps eight lanes at once; else it compares all addresses with
each other before each short loop, or gives up. Lanes are padded to whole packs with idle ones
(all zero: a tip at rest that touches its casing without force), so that the vectorised loop
serves every lane and a case's numbers do not depend on where in a batch it stands.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Array

LANES = 64
"""Lanes of a block: enough to share what a loop costs before its first lane, while the states of
20 + 20 modes (3 x 8 bytes x 20 x 64 = 31 kB) stay in the first-level cache."""

ROW = LANES + 8
"""Numbers from one row to the next: an odd number of cache lines, since rows a power of two apart fall
upon each other in the cache. Worth a few percent."""

PACK, WIDE = 8, 16
"""Lanes are used in packs of this many: a register of the widest processors, or two."""


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
