"""Chunks as HDF5's filters store them, made outside HDF5: zlib and NumPy let other threads run meanwhile."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.grid import LEVEL

_RAMP = np.arange(2**15)


def encode_chunk(values: NDArray[Any]) -> bytes:
    """Return one chunk as HDF5's filters Fletcher-32, shuffle and deflate would store it."""
    size, image = values.dtype.itemsize, np.ascontiguousarray(values).view(np.uint8).ravel()
    image = np.concatenate([image, np.frombuffer(fletcher32(image), np.uint8)])
    whole, shuffled = image.size // size * size, np.empty_like(image)
    shuffled[:whole].reshape(size, -1)[...] = image[:whole].reshape(-1, size).T
    shuffled[whole:] = image[whole:]
    return zlib.compress(shuffled.data, LEVEL)


def fletcher32(image: NDArray[np.uint8]) -> bytes:
    """Return HDF5's checksum of some bytes, b_k: Σ w_k and Σ (n - k) w_k of their n words w_k, modulo 65535.

    Words are big-endian; those of little-endian words are 256 times as large, modulo 65535. A sum that is not 0 ends
    as 65535 where its remainder is 0.
    """
    words = np.append(image, np.zeros(image.size % 2, np.uint8)).view("<u2")
    sums = [0, 0]
    for start in range(0, words.size, _RAMP.size):
        some = words[start : start + _RAMP.size].astype(np.int64)
        total = int(some.sum())
        sums = [sums[0] + total, sums[1] + (words.size - start) * total - int(some @ _RAMP[: some.size])]
    first, second = ((256 * value - 1) % 65535 + 1 if value else 0 for value in sums)
    return (second << 16 | first).to_bytes(4, "little")
