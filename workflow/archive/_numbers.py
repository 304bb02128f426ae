"""An index of numbers that finds one written with other last digits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

_SAME = 1e-9
"""Relative difference up to which two numbers are one: values of an archive have twelve digits at least."""


class Numbers(pd.Index):  # type: ignore[misc]
    """An index that finds a number within :data:`_SAME`, and its slices begin and end there; its parts do so too."""

    def get_loc(self, key: Any) -> Any:
        return super().get_loc(self._held(key)[()])

    def get_indexer(self, target: Any, *how: Any, **kind: Any) -> Any:
        return super().get_indexer(self._held(target), *how, **kind)

    def get_slice_bound(self, label: Any, side: Any) -> Any:
        return super().get_slice_bound(self._held(label)[()], side)

    def _held(self, wanted: Any) -> Any:
        """Return numbers as the index holds them, others as they are."""
        numbers = np.asarray(wanted)
        if numbers.dtype.kind not in "fiu" or not self.size:
            return numbers
        held = np.sort(self.values)
        above = np.searchsorted(held, numbers)
        low, high = held.take(above - 1, mode="clip"), held.take(above, mode="clip")
        near = np.where(numbers - low < high - numbers, low, high)
        return np.where(np.abs(near - numbers) <= _SAME * np.abs(numbers), near, numbers)


def find_near(index: pd.Index) -> pd.Index:
    """Make an index of numbers one of :class:`Numbers`, whatever class pandas calls, and return it."""
    if index.dtype.kind == "f":
        index.__class__ = Numbers
    return index
