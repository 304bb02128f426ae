"""Energy and heat of a chain that is stepped in sweeps: the sums of ``_balance``, node by node.

The states are the nodes' own, so that nothing has to be stepped beside them. The initial content, by
which the heat residual is scaled, is taken node by node too (``_balance`` has modes only).
"""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Chain
from workflow.schemes._kernel import inlined, kernel
from workflow.schemes._sweeps import FORMER, STEADY, TAU, WARM, WARMED, V, X, node_rows

MASS, SPRING, MASS_DAMPING, SPRING_DAMPING, EXPANDING, LOSING = range(6)
"""Rows of what a node and the spring below it weigh: m, k, a_M m, a_K k, k a ℓ/2, and the heat it
loses to root and surroundings [W/K]."""

FIRST_ENERGY, ENERGY, LARGEST_ENERGY, SPENT, LOST, TURNED, TAKEN = range(7)
"""Sums of a case: energy at t = 0, at the end and the largest; energy spent by loads, damping, heat
and contact; heat lost, turned over by loss, and taken in by friction."""

SUMS = TAKEN + 1


def weights(chain: Chain) -> Array:
    """Return what the nodes 0 … n and the springs below them weigh, ``(row, node)``."""
    found = node_rows(LOSING + 1, chain.mechanical_size)
    damping, inside = chain.damping, slice(1, chain.mechanical_size + 1)
    found[MASS, inside], found[SPRING, inside] = chain.masses, chain.springs
    found[MASS_DAMPING, inside], found[SPRING_DAMPING, inside] = (
        damping.mass * chain.masses,
        damping.stiffness * chain.springs,
    )
    found[EXPANDING, inside] = chain.springs * chain.free_expansion / 2
    found[LOSING, inside] = chain.convection
    found[LOSING, 1] += chain.conduction[0]
    return found


@kernel
def open_account(tip: int, weight: Array, state: Array, sums: Array) -> None:
    """Set the sums to the energy at t = 0 and keep the speeds for the first step."""
    sums[:] = 0.0
    energy = place = 0.0
    for i in range(1, tip + 1):
        stretch, place, speed = state[X, i] - place, state[X, i], state[V, i]
        energy += weight[MASS, i] * (speed * speed) + weight[SPRING, i] * (stretch * stretch)
        state[FORMER, i] = speed
    sums[FIRST_ENERGY] = sums[LARGEST_ENERGY] = 0.5 * energy


@inlined
def tally(
    tip: int, step: Array, weight: Array, state: Array, loads: Array, h: float, heat: float, pushed: float, sums: Array
) -> None:
    """Count a step that is done, and keep its speeds for the next one.

    ``pushed`` is the tip load's impulse at midpoint less the contact's.
    """
    energy = spent = steady = lost = 0.0
    place = middle = warmth = 0.0
    for i in range(1, tip + 1):
        stretch, place = state[X, i] - place, state[X, i]
        speed = state[V, i]
        before, middle = middle, 0.5 * (state[FORMER, i] + speed)
        state[FORMER, i] = speed
        cold, warmth = warmth, state[TAU, i] - 0.5 * (state[WARMED, i] + heat * step[WARM, i])
        rate = middle - before
        energy += weight[MASS, i] * (speed * speed) + weight[SPRING, i] * (stretch * stretch)
        stretched = rate * (weight[SPRING_DAMPING, i] * rate - weight[EXPANDING, i] * (cold + warmth))
        spent += weight[MASS_DAMPING, i] * (middle * middle) + stretched
        steady += loads[STEADY, i] * middle
        lost += weight[LOSING, i] * warmth
    sums[ENERGY] = 0.5 * energy
    sums[LARGEST_ENERGY] = sums[LARGEST_ENERGY] if sums[ENERGY] <= sums[LARGEST_ENERGY] else sums[ENERGY]  # a NaN stays
    sums[SPENT] += h * spent - steady - pushed * middle
    sums[LOST] += h * lost
    sums[TURNED] += h * abs(lost)
    sums[TAKEN] += heat


def residuals(sums: Array, chain: Chain, before: Array, after: Array, heating: float) -> tuple[float, float]:
    """Return energy and heat residual of a case.

    ``before`` and ``after`` are its temperatures, K, ``(node,)``; ``heating`` is ∫Σq, J.
    """
    change = sums[ENERGY] - sums[FIRST_ENERGY] + sums[SPENT]
    content = chain.heat_capacities * before
    gained = float(np.sum(chain.heat_capacities * after - content)) - sums[TAKEN] - heating + sums[LOST]
    turned = sums[TAKEN] + abs(heating) + sums[TURNED] + float(np.abs(content).sum())
    largest = sums[LARGEST_ENERGY]
    return (change / largest if largest != 0 else 0.0), (gained / turned if turned != 0 else 0.0)
