"""Corners of a study's scene: the cases in which reduced models are tried.

A corner takes of each dimension the hardest or the mildest value: the largest or smallest heat coupling, the smallest
or largest gap, the load frequency at which the tip answers most or least, the largest or smallest magnitude of
everything else but phases; of axes that vary together alpha decides first, then the gap, then the frequency, then the
others by name, and of equals the first. Of more than 16 corners those are taken that have the fewest mild or the fewest
hard values.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np

from workflow.models import Array, Structure, mechanical_modes
from workflow.study import Dimension

_FREQUENCY = "scene.load.frequency"
_ORDER = ("alpha", "scene.casing.gap", _FREQUENCY)

_WIDTH = 0.01
"""Damping ratio with which the answers of load frequencies are ranked, so that none is infinite."""

_MOST = 16
"""Corners that are tried: those of four dimensions."""

Corner = tuple[tuple[str, float], ...]
"""Path and value of every axis."""


def corners_of(inner: Sequence[Dimension], structure: Structure) -> list[Corner]:
    """Return the corners of some dimensions; the first has the hardest value of each."""
    ends = [_ends(dimension, structure) for dimension in inner]
    places = sorted(product(*(range(len(end)) for end in ends)), key=lambda mild: _unlike(mild, len(ends)))
    return [_values(inner, [end[k] for end, k in zip(ends, place, strict=True)]) for place in places[:_MOST]]


def corner_text(corner: Iterable[tuple[str, float]]) -> str:
    """Return the values of a corner by their path."""
    return ", ".join(f"{path.removeprefix('scene.')} = {value:.6g}" for path, value in corner)


def _unlike(mild: tuple[int, ...], count: int) -> tuple[int, tuple[int, ...]]:
    """Rank corners by how few values differ from all hard, or all mild."""
    return min(sum(mild), count - sum(mild)), mild


def _values(inner: Sequence[Dimension], places: Sequence[int]) -> Corner:
    pairs = zip(inner, places, strict=True)
    return tuple({axis.path: float(axis.values[k]) for dimension, k in pairs for axis in dimension.axes}.items())


def _ends(dimension: Dimension, structure: Structure) -> list[int]:
    """Return the places of the hardest and of the mildest value of a dimension."""
    axes = sorted(dimension.axes, key=lambda axis: (_rank(axis.path), axis.path))
    keys = [_severity(axis.path, np.asarray(axis.values, dtype=np.float64), structure) for axis in axes]
    order = np.lexsort([-key for key in reversed(keys)])
    return [int(order[0]), int(order[-1])] if order.size > 1 else [0]


def _rank(path: str) -> int:
    return _ORDER.index(path) if path in _ORDER else len(_ORDER)


def _severity(path: str, values: Array, structure: Structure) -> Array:
    """Return how hard each value of an axis makes a case; larger is harder."""
    if path == "scene.casing.gap":
        return -values
    if path.endswith(".phase"):
        return np.zeros_like(values)
    if path == _FREQUENCY:
        modes, omega = mechanical_modes(structure), 2 * np.pi * values
        return np.array([_answer(modes.values, modes.tip, float(w)) for w in omega])
    return np.abs(values)


def _answer(omega: Array, tip: Array, w: float) -> float:
    """Return the squared tip displacement by a unit force of angular frequency ``w``, m²/N²; rigid modes left out."""
    elastic = omega > 0
    square, share = omega[elastic] ** 2, tip[elastic] ** 2
    real, imaginary = square - w * w, 2 * _WIDTH * omega[elastic] * w
    size = real * real + imaginary * imaginary
    return np.sum(share * real / size) ** 2 + np.sum(share * imaginary / size) ** 2
