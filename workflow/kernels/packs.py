"""Packs: the numbers of 8, 16 or 32 adjacent lanes, on which a kernel computes at once.

The compiler vectorises a plain loop over eight lanes where it can prove that no two rows overlap, and
compares addresses before each loop where it cannot; sums over modes it stores and reloads every few
modes. Packs are explicit vectors, and a pack stays in registers for a whole step::

    for first in range(0, lanes, PACK):
        lane = narrow(first)
        heat = pack(own.heat, lane)
        store(own.heat, lane, where(heat > 0.0, 2.0 * heat, heat))

A broad pack shares the reads and branches common to all lanes among more of them, and has more sums in
progress at a time. Each lane's bits are those of the plain loop.

Only kernels can call these operations, but for :func:`view`; their code is in :mod:`workflow.kernels.pack_operations`,
which needs numba.
"""

from __future__ import annotations

from math import prod
from typing import NoReturn, Protocol

from workflow.kernels import Array


def _only_in_kernels() -> NoReturn:
    raise TypeError("only a compiled kernel can call operations on packs")


class Mask(Protocol):
    """A condition for each lane."""

    def __and__(self, other: Mask) -> Mask: ...
    def __invert__(self) -> Mask: ...


class Pack(Protocol):
    """A number for each lane."""

    def __add__(self, other: Pack | float) -> Pack: ...
    def __radd__(self, other: float) -> Pack: ...
    def __sub__(self, other: Pack | float) -> Pack: ...
    def __rsub__(self, other: float) -> Pack: ...
    def __mul__(self, other: Pack | float) -> Pack: ...
    def __rmul__(self, other: float) -> Pack: ...
    def __truediv__(self, other: Pack | float) -> Pack: ...
    def __rtruediv__(self, other: float) -> Pack: ...
    def __neg__(self) -> Pack: ...
    def __lt__(self, other: Pack | float) -> Mask: ...
    def __le__(self, other: Pack | float) -> Mask: ...
    def __gt__(self, other: Pack | float) -> Mask: ...
    def __ge__(self, other: Pack | float) -> Mask: ...


class Lane:
    """First lane of a pack in a row, and its width, as :func:`narrow` and :func:`broad` return them."""


At = Lane | tuple[int | Lane, ...]
"""Index of a pack in a row, or in an array of rows."""


def narrow(first: int) -> Lane:
    """Return the lane of a pack of :data:`workflow.kernels.lanes.PACK` lanes."""
    _only_in_kernels()


def broad(first: int, beside: object) -> Lane:
    """Return the lane of a pack of as many registers as do not spill, fewer where there are sums ``beside`` it."""
    _only_in_kernels()


def lanes_of(lane: Lane) -> tuple[int, int]:
    """Return the first lane of a pack and the one after its last."""
    _only_in_kernels()


def pack(rows: Array, at: At) -> Pack:
    """Load the pack at an index: ``pack(own.heat, lane)``, ``pack(tau, (k, lane))``."""
    _only_in_kernels()


def store(rows: Array, at: At, numbers: Pack) -> None:
    """Store a pack at an index: ``store(own.heat, lane, numbers)``."""
    _only_in_kernels()


def shared(array: Array, at: tuple[int, ...], lane: Lane) -> Pack:
    """Return a number of an array for all lanes of a pack.

    Nothing may write to the array while the kernel runs: the number is read once and stays in a register if one is
    free.
    """
    _only_in_kernels()


def where(condition: Mask, this: Pack | float, other: Pack | float) -> Pack:
    """Return each lane's number from the first pack where its condition holds, else from the second."""
    _only_in_kernels()


def some(condition: Mask) -> bool:
    """Tell whether a condition holds in some lane."""
    _only_in_kernels()


def raised(row: Array, lane: Lane) -> bool:
    """Tell whether a pack's flag is raised; it lies in a row at the pack's first lane."""
    _only_in_kernels()


def flag(row: Array, lane: Lane, up: bool) -> None:
    """Raise or lower a pack's flag."""
    _only_in_kernels()


def some_nonzero(numbers: Pack) -> bool:
    """Tell whether a number in some lane is not 0; a NaN is not."""
    _only_in_kernels()


def fused(factor: Pack, other: Pack, number: Pack) -> Pack:
    """Return ``factor * other + number``, rounded once: the same bits everywhere, slow without that instruction."""
    _only_in_kernels()


def magnitude(numbers: Pack) -> Pack:
    """Return the numbers without their signs."""
    _only_in_kernels()


def spread(number: float, lane: Lane) -> Pack:
    """Return a pack of one number."""
    _only_in_kernels()


def view(row: Array, at: int, shape: tuple[int, ...]) -> Array:
    """Return the table of a shape that begins at a place of a contiguous row; without a call in kernels."""
    return row[at : at + prod(shape)].reshape(shape)
