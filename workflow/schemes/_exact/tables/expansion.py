"""Rows of the tables of an expansion, see :class:`workflow.schemes._exact.layout.Expansion`.

In ``terms`` column k belongs to one block. In ``sums`` column K is the sum over the slow terms (loads, first-order
states, explicit blocks) and the K slowest blocks; the blocks from K on are bounded as a group.
"""

from __future__ import annotations

D0 = 0  # output s
D1 = 1  # its derivatives s', s'', s'''
D2 = 2
D3 = 3
FOURTH = 4  # bound of |s''''|
TAIL = 5  # terms: bound of |s|; sums: bound of |s| of the blocks from K on
TAIL_SLOPE = 6  # likewise of |s'|
FOURTH_GROWTH = 7  # sums, column 0: largest rate at which the bound of |s''''| grows; terms: not used
SIZE = 8  # sums, column 0: sum of the magnitudes of all terms of s; terms: not used

ROWS = 9
