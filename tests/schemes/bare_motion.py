"""A motion as kernels of the exact scheme read it, made of tables alone: no structure, no case."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.schemes._exact.tables import block, expansion, first, state, wave


class Sums(NamedTuple):
    """Memory of an expansion."""

    sums: Array
    terms: Array
    explicit: Array


class BareMotion(NamedTuple):
    """The names that expansions, searches and the sum of chattering read of a motion."""

    blocks: int
    firsts: int
    explicits: int
    aperiodics: int
    block: Array
    first: Array
    outputs: Array
    waves: Array
    differences: Array
    expansion: Sums
    now: Array
    between: Array
    growth: float
    cooling: bool


def bare_motion(blocks: int, firsts: int = 0, waves: int = 0, growth: float = 0.0, cooling: bool = False) -> BareMotion:
    """Return a motion whose tables are 0."""
    columns = block.padded(blocks)
    return BareMotion(
        blocks, firsts, 0, 0, np.zeros((block.ROWS, columns)), np.zeros((first.ROWS, 8)), np.zeros(2),
        np.full((waves, wave.COLUMNS), np.nan), np.zeros((9, 4), complex),
        Sums(np.zeros((expansion.ROWS, blocks + 1)), np.zeros((expansion.ROWS, columns)), np.zeros(20)),
        np.zeros((state.ROWS, 8)), np.zeros((state.ROWS, 8)), growth, cooling,
    )  # fmt: skip


def add_decay(m: BareMotion, share: float, rate: float) -> None:
    """Set the only first-order state, of size 1 at t = 0, and the signal per size."""
    m.first[first.RATE, 0], m.first[first.SIGNAL, 0] = rate, share
    m.now[state.FIRST, 0], m.now[state.FIRST_SLOPE, 0] = 1.0, -rate
