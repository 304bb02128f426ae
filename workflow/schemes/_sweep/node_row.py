"""Rows of the nodes of a chain that is stepped along them, ``(row, node)``, node 0 being the root."""

from __future__ import annotations

X, V, TAU, WARMED, ELIMINATED, FORMER_V = range(6)
"""Its state: x, v and τ at the step's beginning,
then end; δτ without the contact's heat; what an elimination leaves at a node, of the heat on its way
to the root, then of the motion on its way to the tip; v at the step's beginning, for balances.
Heat and motion share a row as a pass waits longest for rows that it writes and has not read."""

ROWS = FORMER_V + 1

LOAD_STEADY, LOAD_HEATING = range(2)
"""Rows of a case's constant loads in a step ``(row, node)``: h f [N s], h q [J]."""

LOAD_ROWS = LOAD_HEATING + 1
