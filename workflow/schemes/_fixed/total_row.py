"""Rows of what a march adds up for its balances, ``(row, lane)``, ``(row, case)`` or of one case ``(row,)``."""

from __future__ import annotations

FIRST_ENERGY, LAST_ENERGY, LARGEST_ENERGY, DISSIPATED = range(4)
"""Energy at t = 0, at the end and the largest; dissipated less work of loads and contact [J]."""

LOST, TURNED_OVER, FRICTION_HEAT = range(4, 7)
"""Heat lost, turned over by loss, and taken in by friction [J]."""

ROWS = FRICTION_HEAT + 1
