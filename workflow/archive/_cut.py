"""Cutting the cells of an archive in blocks: rectangles whose cells follow each other in C order."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Cut:
    """Blocks of ``size`` cells: whole dimensions innermost, then a part of one dimension, then one long.

    A row is everything along the dimension that is cut and those inside it. Its last block may have fewer cells.
    Without dimensions there is one cell, one row and one block.

    Attributes
    ----------
    shape
        Sizes of the dimensions, outermost first.
    size
        Cells of a block.

    Raises
    ------
    ValueError
        Blocks of this size are no rectangles.
    """

    shape: tuple[int, ...]
    size: int

    def __post_init__(self) -> None:
        inside, cut = self._place
        most = inside * (self.shape[cut] if self.shape else 1)
        if not 1 <= self.size <= most or self.size % inside:
            raise ValueError(f"chunk of {self.size} cells of {self.shape}: it must be a rectangle of at most all cells")

    @cached_property
    def _place(self) -> tuple[int, int]:
        """Return the product of the dimensions that are whole, and which dimension is cut."""
        inside = 1
        for cut in range(len(self.shape) - 1, 0, -1):
            if self.size <= inside * self.shape[cut]:
                return inside, cut
            inside *= self.shape[cut]
        return inside, 0

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """Lengths of a block along the dimensions."""
        if not self.shape:
            return ()
        inside, cut = self._place
        return (*(1 for _ in range(cut)), self.size // inside, *self.shape[cut + 1 :])

    @cached_property
    def row(self) -> int:
        """Cells of a row."""
        inside, cut = self._place
        return inside * self.shape[cut] if self.shape else 1

    @cached_property
    def per_row(self) -> int:
        """Blocks of a row."""
        return -(-self.row // self.size)

    @cached_property
    def cells(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @cached_property
    def count(self) -> int:
        """Number of blocks."""
        return self.cells // self.row * self.per_row

    def cells_of(self, block: int) -> range:
        """Return the cells of a block, without the padding of a row's last one."""
        row, k = divmod(block, self.per_row)
        start = k * self.size
        return range(row * self.row + start, row * self.row + min(start + self.size, self.row))

    def block_of(self, cell: int) -> tuple[int, int]:
        """Return the block that holds a cell, and the cell's place in it."""
        row, place = divmod(cell, self.row)
        return row * self.per_row + place // self.size, place % self.size

    def offset_of(self, block: int) -> tuple[int, ...]:
        """Return the index of a block's first cell along the dimensions."""
        return tuple(int(i) for i in np.unravel_index(self.cells_of(block).start, self.shape))


def largest_cut(shape: tuple[int, ...], most: int) -> Cut:
    """Return the cut in the largest blocks of at most ``most`` cells, at least one."""
    size = 1
    for length in reversed(shape):
        extent = max(1, min(length, most // size))
        size *= extent
        if extent < length:
            break
    return Cut(shape, size)
