"""Rows of a state of motion, ``(ROWS, column)``, less the particular solution."""

from __future__ import annotations

VALUE = 0  # η of each block
SLOPE = 1  # η' of each block
FIRST = 2  # ξ of each first-order state
FIRST_SLOPE = 3  # ξ' of each first-order state

ROWS = 4
