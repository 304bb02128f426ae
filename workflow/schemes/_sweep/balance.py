"""Energy and heat of a chain that is stepped node by node, whose modes are not known.

The energy residual is that of :mod:`workflow.schemes._fixed.dense_balance`, E = ½ vᵀM v + ½ xᵀK1 x of the whole motion,
with a load at the tip alone, b = e_n, and no friction, µ = 0; the matrices are sums over nodes and springs.
"""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels.compiled import inlined
from workflow.models import Array, Chain
from workflow.schemes._fixed import total_row
from workflow.schemes._sweep import node_row, step_row
from workflow.schemes._sweep.sweeps import Nodes, node_rows

WEIGHT_MASS, WEIGHT_SPRING, WEIGHT_MASS_DAMPING, WEIGHT_SPRING_DAMPING, WEIGHT_EXPANSION, WEIGHT_LOSS = range(6)
"""Coefficients of a node and the spring below it ``(row, node)``: m, k, a_M m, a_K k, k a ℓ/2, and the heat the node
loses to root and surroundings [W/K]."""


class Account(NamedTuple):
    """The balances of a case."""

    weight: Array
    """``(row, node)``, rows ``WEIGHT_…``; no rows where no balances are asked for."""
    totals: Array
    """Rows of :mod:`~workflow.schemes._fixed.total_row`; the case is in lane 0, ``(row, lane)``."""


def weights(chain: Chain) -> Array:
    """Return the coefficients of the nodes 0 … n and the springs below them, ``(row, node)``."""
    weight = node_rows(WEIGHT_LOSS + 1, chain.mechanical_size)
    damping, inside = chain.damping, slice(1, chain.mechanical_size + 1)
    weight[WEIGHT_MASS, inside], weight[WEIGHT_SPRING, inside] = chain.masses, chain.springs
    weight[WEIGHT_MASS_DAMPING, inside] = damping.mass * chain.masses
    weight[WEIGHT_SPRING_DAMPING, inside] = damping.stiffness * chain.springs
    weight[WEIGHT_EXPANSION, inside] = chain.springs * chain.free_expansion / 2
    weight[WEIGHT_LOSS, inside] = chain.convection
    weight[WEIGHT_LOSS, 1] += chain.conduction[0]
    return weight


@inlined
def start_account(nodes: Nodes, account: Account) -> None:
    """Set the totals to the energy at t = 0 and keep the velocities for the first step."""
    state, weight, totals = nodes.state, account.weight, account.totals
    totals[:] = 0.0
    energy = place = 0.0
    for i in range(1, nodes.tip + 1):
        stretch, place, speed = state[node_row.X, i] - place, state[node_row.X, i], state[node_row.V, i]
        energy += weight[WEIGHT_MASS, i] * (speed * speed) + weight[WEIGHT_SPRING, i] * (stretch * stretch)
        state[node_row.FORMER_V, i] = speed
    totals[total_row.FIRST_ENERGY, 0] = totals[total_row.LARGEST_ENERGY, 0] = 0.5 * energy


@inlined
def count_step(nodes: Nodes, account: Account, heat: float, impulse: float) -> None:
    """Count a step that is done, and keep its velocities for the next one.

    ``impulse`` is that of the tip load less that of contact, N s; ``heat`` is that of contact, J.
    """
    step, state, weight, totals, h = nodes.step, nodes.state, account.weight, account.totals, nodes.h
    energy = dissipated = steady = lost = 0.0
    place = middle = warmth = 0.0
    for i in range(1, nodes.tip + 1):
        stretch, place = state[node_row.X, i] - place, state[node_row.X, i]
        speed = state[node_row.V, i]
        before, middle = middle, 0.5 * (state[node_row.FORMER_V, i] + speed)
        state[node_row.FORMER_V, i] = speed
        warmed = state[node_row.WARMED, i] + heat * step[step_row.HEAT_ANSWER, i]
        cold, warmth = warmth, state[node_row.TAU, i] - 0.5 * warmed
        rate = middle - before
        energy += weight[WEIGHT_MASS, i] * (speed * speed) + weight[WEIGHT_SPRING, i] * (stretch * stretch)
        stretched = rate * (weight[WEIGHT_SPRING_DAMPING, i] * rate - weight[WEIGHT_EXPANSION, i] * (cold + warmth))
        dissipated += weight[WEIGHT_MASS_DAMPING, i] * (middle * middle) + stretched
        steady += nodes.loads[node_row.LOAD_STEADY, i] * middle
        lost += weight[WEIGHT_LOSS, i] * (warmth + (nodes.theta - 0.5) * warmed)
    energy, largest = 0.5 * energy, totals[total_row.LARGEST_ENERGY, 0]
    totals[total_row.LAST_ENERGY, 0] = energy
    totals[total_row.LARGEST_ENERGY, 0] = largest if energy <= largest else energy  # a NaN stays
    totals[total_row.DISSIPATED, 0] += h * dissipated - steady - impulse * middle
    totals[total_row.LOST, 0] += h * lost
    totals[total_row.TURNED_OVER, 0] += h * abs(lost)
    totals[total_row.FRICTION_HEAT, 0] += heat
