"""Energy and heat of a chain that is stepped in sweeps: the sums of ``_balance``, node by node.

The states are the nodes' own, so that nothing has to be stepped beside them. The initial content, by
which the heat residual is scaled, is taken node by node too (``_balance`` has modes only).
"""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Chain
from workflow.schemes._kernel import inlined, kernel
from workflow.schemes._sweeps import MOVED, STEADY, TAU, WARM, WARMED, V, X

MASS, SPRING, MASS_DAMPING, SPRING_DAMPING, EXPANDING, LOSING = range(6)
"""Columns of what a node and the spring below it weigh: m, k, a_M m, a_K k, k a ℓ/2, and the heat it
loses to root and surroundings [W/K]."""

FIRST_ENERGY, ENERGY, LARGEST_ENERGY, SPENT, LOST, TURNED, TAKEN = range(7)
"""Sums of a case: energy at t = 0, at the end and the largest; energy spent by loads, damping, heat
and contact; heat lost, turned over by loss, and taken in by friction."""

SUMS = TAKEN + 1


def weights(chain: Chain) -> Array:
    """Return what the nodes 0 … n and the springs below them weigh, ``(node, column)``."""
    found = np.zeros((chain.mechanical_size + 1, LOSING + 1))
    damping = chain.damping
    found[1:, MASS], found[1:, SPRING] = chain.masses, chain.springs
    found[1:, MASS_DAMPING], found[1:, SPRING_DAMPING] = damping.mass * chain.masses, damping.stiffness * chain.springs
    found[1:, EXPANDING] = chain.springs * chain.free_expansion / 2
    found[1:, LOSING] = chain.convection
    found[1, LOSING] += chain.conduction[0]
    return found


@kernel
def open_account(weight: Array, state: Array, sums: Array) -> None:
    """Set the sums to the energy at t = 0."""
    sums[:] = 0.0
    energy = place = 0.0
    for i in range(1, state.shape[0]):
        stretch, place, speed = state[i, X] - place, state[i, X], state[i, V]
        energy += weight[i, MASS] * (speed * speed) + weight[i, SPRING] * (stretch * stretch)
    sums[FIRST_ENERGY] = sums[LARGEST_ENERGY] = 0.5 * energy


@inlined
def tally(
    step: Array, weight: Array, state: Array, loads: Array, h: float, heat: float, pushed: float, sums: Array
) -> None:
    """Count a step that is done; ``pushed`` is the tip load's impulse at midpoint less the contact's."""
    energy = spent = steady = lost = 0.0
    place = middle = warmth = 0.0
    for i in range(1, state.shape[0]):
        stretch, place = state[i, X] - place, state[i, X]
        speed = state[i, V]
        before, middle = middle, speed - 0.5 * state[i, MOVED]
        cold, warmth = warmth, state[i, TAU] - 0.5 * (state[i, WARMED] + heat * step[i, WARM])
        rate = middle - before
        energy += weight[i, MASS] * (speed * speed) + weight[i, SPRING] * (stretch * stretch)
        spent += weight[i, MASS_DAMPING] * (middle * middle)
        spent += rate * (weight[i, SPRING_DAMPING] * rate - weight[i, EXPANDING] * (cold + warmth))
        steady += loads[i, STEADY] * middle
        lost += weight[i, LOSING] * warmth
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
