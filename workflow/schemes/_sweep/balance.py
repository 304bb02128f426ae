"""Energy and heat of a chain that is stepped node by node, whose modes are not known.

With midpoint values x_m = (x + x')/2 of a step and F_θ the tip load as the step takes it, the sum over the steps of

    - F_θ v_n,m h - f̄ᵀ v_m h + v_mᵀ C1 v_m h + v_mᵀ K12 θ_m h + p (v_n + v_n')/2

and ΔE, with E = ½ vᵀM v + ½ xᵀK1 x of the whole motion, over the largest E at a step end, is the energy residual. Heat
is counted as in :mod:`workflow.schemes._fixed.balance`, the initial content by nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels.compiled import inlined
from workflow.kernels.sums import total
from workflow.models import Array, Chain
from workflow.schemes._sweep.sweeps import (
    NODE_FORMER_V,
    NODE_LOAD_STEADY,
    NODE_TAU,
    NODE_V,
    NODE_WARMED,
    NODE_X,
    STEP_HEAT_ANSWER,
    Nodes,
    node_rows,
)

WEIGHT_MASS, WEIGHT_SPRING, WEIGHT_MASS_DAMPING, WEIGHT_SPRING_DAMPING, WEIGHT_EXPANSION, WEIGHT_LOSS = range(6)
"""Coefficients of a node and the spring below it ``(row, node)``: m, k, a_M m, a_K k, k a ℓ/2, and the heat the node
loses to root and surroundings [W/K]."""

ACCOUNT_FIRST_ENERGY, ACCOUNT_ENERGY, ACCOUNT_LARGEST_ENERGY, ACCOUNT_DISSIPATED = range(4)
"""Sums of a case: energy at t = 0, at the end and the largest; dissipated less work of loads and contact [J]."""

ACCOUNT_LOST, ACCOUNT_TURNED_OVER, ACCOUNT_FRICTION_HEAT = range(4, 7)
"""Heat lost, turned over by loss, and taken in by friction [J]."""

ACCOUNT_ROWS = ACCOUNT_FRICTION_HEAT + 1


class Account(NamedTuple):
    """The balances of a case."""

    weight: Array
    """``(row, node)``, rows ``WEIGHT_…``; no rows where no balances are asked for."""
    sums: Array
    """``(row,)``, rows ``ACCOUNT_…``."""


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
def open_account(nodes: Nodes, account: Account) -> None:
    """Set the sums to the energy at t = 0 and keep the velocities for the first step."""
    state, weight, sums = nodes.state, account.weight, account.sums
    sums[:] = 0.0
    energy = place = 0.0
    for i in range(1, nodes.tip + 1):
        stretch, place, speed = state[NODE_X, i] - place, state[NODE_X, i], state[NODE_V, i]
        energy += weight[WEIGHT_MASS, i] * (speed * speed) + weight[WEIGHT_SPRING, i] * (stretch * stretch)
        state[NODE_FORMER_V, i] = speed
    sums[ACCOUNT_FIRST_ENERGY] = sums[ACCOUNT_LARGEST_ENERGY] = 0.5 * energy


@inlined
def account_step(nodes: Nodes, account: Account, heat: float, impulse: float) -> None:
    """Count a step that is done, and keep its velocities for the next one.

    ``impulse`` is that of the tip load less that of contact, N s; ``heat`` is that of contact, J.
    """
    step, state, weight, sums, h = nodes.step, nodes.state, account.weight, account.sums, nodes.h
    energy = dissipated = steady = lost = 0.0
    place = middle = warmth = 0.0
    for i in range(1, nodes.tip + 1):
        stretch, place = state[NODE_X, i] - place, state[NODE_X, i]
        speed = state[NODE_V, i]
        before, middle = middle, 0.5 * (state[NODE_FORMER_V, i] + speed)
        state[NODE_FORMER_V, i] = speed
        cold, warmth = warmth, state[NODE_TAU, i] - 0.5 * (state[NODE_WARMED, i] + heat * step[STEP_HEAT_ANSWER, i])
        rate = middle - before
        energy += weight[WEIGHT_MASS, i] * (speed * speed) + weight[WEIGHT_SPRING, i] * (stretch * stretch)
        stretched = rate * (weight[WEIGHT_SPRING_DAMPING, i] * rate - weight[WEIGHT_EXPANSION, i] * (cold + warmth))
        dissipated += weight[WEIGHT_MASS_DAMPING, i] * (middle * middle) + stretched
        steady += nodes.loads[NODE_LOAD_STEADY, i] * middle
        lost += weight[WEIGHT_LOSS, i] * warmth
    largest, sums[ACCOUNT_ENERGY] = sums[ACCOUNT_LARGEST_ENERGY], 0.5 * energy
    sums[ACCOUNT_LARGEST_ENERGY] = largest if sums[ACCOUNT_ENERGY] <= largest else sums[ACCOUNT_ENERGY]  # a NaN stays
    sums[ACCOUNT_DISSIPATED] += h * dissipated - steady - impulse * middle
    sums[ACCOUNT_LOST] += h * lost
    sums[ACCOUNT_TURNED_OVER] += h * abs(lost)
    sums[ACCOUNT_FRICTION_HEAT] += heat


def residuals(sums: Array, chain: Chain, before: Array, after: Array, heating: float) -> tuple[float, float]:
    """Return energy and heat residual of a case.

    ``before`` and ``after`` are its temperatures, K, ``(node,)``; ``heating`` is ∫Σq, J.
    """
    change = sums[ACCOUNT_ENERGY] - sums[ACCOUNT_FIRST_ENERGY] + sums[ACCOUNT_DISSIPATED]
    content = chain.heat_capacities * before
    gained = total(chain.heat_capacities * after - content) - sums[ACCOUNT_FRICTION_HEAT] - heating + sums[ACCOUNT_LOST]
    turned = sums[ACCOUNT_FRICTION_HEAT] + abs(heating) + sums[ACCOUNT_TURNED_OVER] + total(np.abs(content))
    largest = sums[ACCOUNT_LARGEST_ENERGY]
    return (change / largest if largest != 0 else 0.0), (gained / turned if turned != 0 else 0.0)
