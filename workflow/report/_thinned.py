"""Arrays of a page in few bytes: histories thinned to what a screen can show, numbers rounded, all compressed."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

BUCKETS = 400
"""Pieces of the duration of each of which a thinned history keeps the least and the largest value, at least."""

MISSING = 0
"""Level of a sample that is not finite; the others lie between 1 and :data:`LEVELS`."""

LEVELS = 65535

_MANTISSA, _LAST = np.uint32(0xFFFFF000), np.uint32(0x1000)
"""Keeps 11 of 23 bits of a 32-bit float, and the last of them: 3 digits, more than a colour or a marker shows."""

_DIGITS = 3
"""Digits of a number that a page shows."""


def thinned_times(t: NDArray[np.float64], buckets: int = BUCKETS) -> NDArray[np.float64]:
    """Return the times at which :func:`thinned` values are drawn."""
    if t.size <= 2 * buckets:
        return t
    edges = np.linspace(t[0], t[-1], buckets, endpoint=False)
    return np.asarray(np.repeat(edges, 2) + np.tile([0.25, 0.75], buckets) * (t[-1] - t[0]) / buckets)


def thinned(values: NDArray[np.float64], buckets: int = BUCKETS) -> NDArray[np.float64]:
    """Return the least and the largest value of every piece of a history, in the order in which they occur.

    A history of at most two samples a piece stays as it is. A piece with a sample that is not finite is NaN.
    """
    if values.size <= 2 * buckets:
        return values
    edges = np.linspace(0, values.size, buckets + 1).round().astype(int)
    inside = edges[:-1, None] + np.arange(np.diff(edges).max())
    pieces = np.where(np.isfinite(values), values, np.nan)[np.minimum(inside, edges[1:, None] - 1)]
    extremes = np.sort(np.stack([pieces.argmin(axis=1), pieces.argmax(axis=1)], axis=1), axis=1)
    return np.take_along_axis(pieces, extremes, axis=1).ravel()


def levels(values: NDArray[np.float64]) -> tuple[NDArray[np.uint16], float, float]:
    """Return values as differences of 16-bit levels, and the values of the lowest and the highest level."""
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    span = high / 2 - low / 2
    share = (np.where(finite, values, low) / 2 - low / 2) / span if span > 0 else np.zeros(values.shape)
    level = np.where(finite, 1 + np.rint(share * (LEVELS - 1)), MISSING).astype(np.uint16)
    return np.diff(level, prepend=np.uint16(0)), low, high


def rounded(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return numbers of 11 bits that show the three digits of the given ones, infinite ones as NaN."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        single = np.where(np.isfinite(values), values, np.nan).astype(np.float32)
        single[np.isinf(single)] = np.nan
        below = single.view(np.uint32) & _MANTISSA
        lower, upper = below.view(np.float32), (below + _LAST).view(np.float32)
        unit = 10.0 ** (np.floor(np.log10(np.abs(values))) - (_DIGITS - 1))
        alike = np.rint(lower / unit) == np.rint(values / unit)
    kept = np.where(alike | (below == 0) | (lower == single), lower, upper)
    return np.where(np.isnan(single), np.float32(np.nan), kept).astype(np.float32)


class PackedArrays:
    """Arrays one after the other in one compressed block, each described by a plain entry of JSON."""

    def __init__(self) -> None:
        self._compressor = zlib.compressobj(9)
        self._bytes = b""
        self._length = 0

    @property
    def size(self) -> int:
        """Characters that the block takes in a page so far."""
        return 4 * -(-len(self._bytes) // 3)

    def add(self, array: NDArray[Any]) -> dict[str, Any]:
        """Take in an array and return where it lies; 32-bit floats are stored by bytes of equal weight."""
        kind = {"float32": "f4", "float64": "f8", "uint16": "u2", "int8": "i1", "int32": "i4"}[array.dtype.name]
        plain = np.ascontiguousarray(array.ravel())
        raw = plain.view(np.uint8).reshape(-1, 4).T.tobytes() if kind == "f4" else plain.tobytes()
        entry = {"type": kind, "at": self._length, "n": int(plain.size)}
        self._length += len(raw)
        self._bytes += self._compressor.compress(raw) + self._compressor.flush(zlib.Z_SYNC_FLUSH)
        return entry

    def text(self) -> str:
        """Return the block in base64."""
        return base64.b64encode(self._bytes + self._compressor.copy().flush()).decode()
