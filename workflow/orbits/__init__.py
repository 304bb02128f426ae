"""Steady rubs of the exact scheme: where a rub settles, how stable it is, and where it runs away.

P is the map of one common period T of all loads on the states of the exact model. A rub of order k is a fixed point of
Pᵏ that is none of a smaller power; its Floquet multipliers are the eigenvalues of DPᵏ.
"""

from workflow.orbits._branch import BIFURCATIONS, branch
from workflow.orbits._curve import Problem
from workflow.orbits._orbit import STATES
from workflow.orbits._rubs import steady_rubs
from workflow.orbits._settle import Options
