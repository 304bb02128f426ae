"""Packs: numbers of 8 lanes, or of 16 or 32, side by side, on which a kernel computes at once.

The compiler steps eight lanes of a plain loop at once where it can prove that no two rows overlap, and
compares addresses before each loop where it can't; sums over modes it takes to memory and back for
every few modes. Packs say it outright, and a pack goes through a whole step in registers::

    for first in range(0, lanes, PACK):
        lane = narrow(first)
        heat = pack(own.heat, lane)
        store(own.heat, lane, where(heat > 0.0, 2.0 * heat, heat))

A broad pack shares what is read and asked for all lanes among more of them, where there are so many, and has
more sums in progress at a time. Each lane's bits are those of the plain loop.

Only kernels can call these operations: what they do is in :mod:`workflow.kernels.pack_operations`, which needs numba.
"""

from __future__ import annotations

from typing import NoReturn, Protocol

from workflow.kernels import Array


def _only_in_kernels() -> NoReturn:
    raise TypeError("only a compiled kernel can call operations on packs")


class Mask(Protocol):
    """A condition of each lane."""

    def __and__(self, other: Mask) -> Mask: ...
    def __invert__(self) -> Mask: ...


class Pack(Protocol):
    """A number of each lane."""

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
    """Where a pack begins in a row, and how wide it is: what :func:`narrow` and :func:`broad` return."""


At = Lane | tuple[int | Lane, ...]
"""Where a pack begins in a row, or in an array of rows."""


def align_stack() -> None:
    """Let the kernel that says so keep packs for which it has no register where they fill whole lines of the cache.

    Else they lie across two, at a distance that depends on who called it.
    """
    _only_in_kernels()


def narrow(first: int) -> Lane:
    """Return the lane that begins a pack of :data:`workflow.kernels.lanes.PACK`."""
    _only_in_kernels()


def broad(first: int) -> Lane:
    """Return the lane that begins a pack of :func:`broadest`."""
    _only_in_kernels()


def lanes_of(lane: Lane) -> tuple[int, int]:
    """Return the first lane of a pack and the one behind its last."""
    _only_in_kernels()


def broadest() -> int:
    """Return the lanes of the largest packs on this processor, a constant of the compiled kernel.

    Four registers where a register holds eight numbers: more than four overflow them.
    """
    _only_in_kernels()


def pack(rows: Array, at: At) -> Pack:
    """Return the pack that begins at a place: ``pack(own.heat, lane)``, ``pack(tau, (k, lane))``."""
    _only_in_kernels()


def store(rows: Array, at: At, numbers: Pack) -> None:
    """Put a pack where it begins: ``store(own.heat, lane, numbers)``."""
    _only_in_kernels()


def shared(array: Array, at: tuple[int, ...], lane: Lane) -> Pack:
    """Return a number of an array for all lanes of a pack.

    Nothing may write to the array while the kernel runs: the number is read once and stays in a register where there
    is one.
    """
    _only_in_kernels()


def fetch(array: Array, at: tuple[int, ...]) -> None:
    """Let the line of the cache that holds a number of an array be fetched, which is written some steps later."""
    _only_in_kernels()


def where(condition: Mask, this: Pack | float, other: Pack | float) -> Pack:
    """Return each lane's number of the first pack where its condition holds, else of the second."""
    _only_in_kernels()


def some(condition: Mask) -> bool:
    """Tell whether a condition holds in some lane."""
    _only_in_kernels()


def raised(row: Array, lane: Lane) -> bool:
    """Tell whether a pack's flag is up, which lies in a row where the pack begins."""
    _only_in_kernels()


def flag(row: Array, lane: Lane, up: bool) -> None:
    """Put a pack's flag up or down."""
    _only_in_kernels()


def some_nonzero(numbers: Pack) -> bool:
    """Tell whether a number in some lane is not 0, as a NaN is."""
    _only_in_kernels()


def fused(factor: Pack, other: Pack, number: Pack) -> Pack:
    """Return ``factor * other + number``, rounded once: the same bits everywhere, slow where no instruction does it."""
    _only_in_kernels()


def magnitude(numbers: Pack) -> Pack:
    """Return the numbers without their signs."""
    _only_in_kernels()


def spread(number: float, lane: Lane) -> Pack:
    """Return a pack of one number."""
    _only_in_kernels()
