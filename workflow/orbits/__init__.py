"""Steady rubs of the exact model: periodic orbits, their stability, their branches, and runaways.

P is the Poincaré map of the states of the exact model over one common period T of all loads. A rub of order k is a
fixed point of Pᵏ but of no smaller power; its Floquet multipliers are the eigenvalues of DPᵏ.
"""

from workflow.orbits._boundary import ENDS, MOST_CURVES, Boundaries, Number, bifurcation_shifts, boundaries
from workflow.orbits._branch import BIFURCATIONS, Followed, branch, follow, tabulate
from workflow.orbits._curve import Problem
from workflow.orbits._orbit import STATES
from workflow.orbits._settle import Options, steady_rubs
