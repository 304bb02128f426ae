"""Rows of the coefficients of a step along a chain, of a node and the spring below it, ``(row, node)``."""

from __future__ import annotations

SPRING, EXPANSION, DAMPING = range(3)
"""h k, h k a ℓ/2 and h a_M m."""

INVERSE_PIVOT, SHARE, HEAT_MOTION = range(3, 6)
"""Of the elimination to the tip: the inverse pivot, the share that it hands to the node beyond and that the node later
takes back from there, and the eliminated g over the pivot."""

CONDUCTION, CONVECTION, HEAT_INVERSE_PIVOT, HEAT_SHARE, HEAT_ANSWER = range(6, 11)
"""hκ, hb; of the elimination to the root, the inverse pivot and the share handed to the node before and taken back; and
w, the temperatures per unit heat at the tip."""

ROWS = HEAT_ANSWER + 1
