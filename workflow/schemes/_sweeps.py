"""One step of a long chain: elimination along its nodes instead of modes.

A chain of n nodes has n modes whose shapes take n² numbers and n³ operations to find. Its matrices
Ŵ = M + hθC1 + h²θ²K1 and T̂ = C2 + hθK2 are tridiagonal, so a step is also three passes along it,
about as dear as a step of the modes for a single case. With increments δτ = τ' - τ, δv = v' - v

    T̂ δτ = h (q - K2 τ) + α p e_n
    Ŵ δv = h (f_θ - C1 v - K1 (x + hθ v) - K12 (τ + θ δτ)) - p e_n,   x' = x + h (v + θ δv),

:func:`conduct` (tip to root) eliminates heat; :func:`swing` (root to tip) finds δτ, eliminates the
motion and so arrives at the tip's free velocity; contact; :func:`settle` (tip to root) finds δv. The
contact's heat comes later than the elimination that feels it: its known answers, w = T̂⁻¹ e_n and
g = hθ K12 w, are added in proportion.

Pivots are sums of positive numbers, as in :mod:`workflow.models._path`. Cases are stepped one by one:
eight at once, in the lanes of a register, take two thirds of the time per case where their states fit
in the second-level cache, and twice the time at 100 000 nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workflow.models import Array, Chain, frequency_range, rate_range, static_tip_growth
from workflow.schemes._kernel import inlined, kernel

X, V, TAU, WARMED, MOVED, GATHERED = range(6)
"""Columns of a chain's state ``(node, column)``, node 0 being the root: x, v and τ at the step's
beginning, then end; δτ without the contact's heat; the eliminated motion, then δv; the eliminated heat."""

STATE = GATHERED + 1

PULL, SWELL, DRAG, ONWARD, YIELD, BACK, HEAT_KICK, FLOW, COOL, INWARD, WARMING, OUTWARD, WARM = range(13)
"""Coefficients of a node and the spring below it: h k, h k a ℓ/2 and h a_M m; what the elimination to
the tip takes from the node before, the inverse pivot, what the node takes from the one beyond, and
the eliminated g over the pivot; hκ, hb; what the elimination to the root takes from the node beyond,
its inverse pivot, what the node takes from the one before; w."""

_COEFFICIENTS = WARM + 1

STEADY, HEATING = range(2)
"""Columns of a case's constant loads in a step: h f [N s], h q [J]."""


@kernel
def _factor(inertia: Array, joint: Array, capacity: Array, flow: Array, swell: Array, found: Array) -> None:
    """Eliminate Ŵ from the root to the tip, T̂ from the tip to the root, and with them w and g.

    ``inertia`` and ``capacity`` are what stands on the diagonals beside the joints ``joint`` and
    ``flow``, of the nodes 0 … n + 1; ``swell`` is hθ k a ℓ/2.
    """
    last = inertia.size - 2
    tied = joint[1]
    for i in range(1, last + 1):
        own = inertia[i] + tied
        pivot = own + joint[i + 1]
        found[i, YIELD] = 1.0 / pivot
        found[i, BACK] = joint[i + 1] / pivot
        found[i + 1, ONWARD] = found[i, BACK]
        tied = joint[i + 1] * own / pivot
    tied = 0.0
    for i in range(last, 0, -1):
        own = capacity[i] + tied
        pivot = own + flow[i]
        found[i, WARMING] = 1.0 / pivot
        found[i, OUTWARD] = flow[i] / pivot
        found[i - 1, INWARD] = found[i, OUTWARD]
        tied = flow[i] * own / pivot
    gathered = 1.0
    for i in range(last, 0, -1):
        gathered *= 1.0 if i == last else found[i, INWARD]
        found[i, WARM] = gathered * found[i, WARMING]
    for i in range(1, last + 1):
        found[i, WARM] += found[i, OUTWARD] * found[i - 1, WARM]
    kick, force = 0.0, -swell[1] * found[1, WARM]
    for i in range(1, last + 1):
        beyond = -swell[i + 1] * (found[i, WARM] + found[i + 1, WARM]) if i < last else 0.0
        kick = (force - beyond) + found[i, ONWARD] * kick
        found[i, HEAT_KICK] = kick * found[i, YIELD]
        force = beyond


@dataclass(frozen=True, eq=False)
class Swept:
    """A chain as the sweeps see it: what :class:`~workflow.schemes._decoupled.Decoupled` is to modes."""

    chain: Chain

    @cached_property
    def frequency(self) -> Array:
        """Lowest and highest ω, rad/s: the free step of no mode between them grows if neither's does."""
        return frequency_range(self.chain)

    @property
    def damping(self) -> Array:
        """Damping c of the same modes, 1/s."""
        return self.chain.damping.mass + self.chain.damping.stiffness * self.frequency**2

    @cached_property
    def rate(self) -> Array:
        """Lowest and highest μ, 1/s."""
        return rate_range(self.chain)

    @cached_property
    def static_growth(self) -> Array:
        """Quasi-static tip displacement per nodal temperature, m/K."""
        return static_tip_growth(self.chain)

    def coefficients(self, h: float, theta: float) -> Array:
        """Return the coefficients of a step, ``(node 0 … n + 1, coefficient)``."""
        chain = self.chain

        def padded(values: Array) -> Array:
            return np.concatenate([[0.0], values, [0.0]])

        found = np.zeros((chain.mechanical_size + 2, _COEFFICIENTS))
        mass, spring, swell = padded(chain.masses), padded(chain.springs), padded(chain.springs * chain.free_expansion)
        conduction, convection = padded(chain.conduction), padded(chain.convection)
        found[:, PULL], found[:, SWELL], found[:, DRAG] = h * spring, h * swell / 2, h * chain.damping.mass * mass
        found[:, FLOW], found[:, COOL] = h * conduction, h * convection
        _factor(
            mass * (1 + h * theta * chain.damping.mass),
            h * theta * (chain.damping.stiffness + h * theta) * spring,
            padded(chain.heat_capacities) + h * theta * convection,
            h * theta * conduction,
            h * theta * swell / 2,
            found,
        )
        return found

    def compliance(self, h: float, theta: float) -> tuple[float, float]:
        """Return e_nᵀ Ŵ⁻¹ e_n and e_nᵀ Ŵ⁻¹ hθ K12 T̂⁻¹ e_n, the parts of the Delassus operator, 1/kg."""
        found = self.coefficients(h, theta)
        return float(found[-2, YIELD]), float(found[-2, HEAT_KICK])


@inlined
def conduct(step: Array, state: Array, loads: Array) -> None:
    """Eliminate the heat balance from the tip to the root."""
    beyond = gathered = 0.0
    here = state[state.shape[0] - 1, TAU]
    for i in range(state.shape[0] - 1, 0, -1):
        below = state[i - 1, TAU]
        inward = step[i, FLOW] * (here - below)
        gathered = (beyond - inward) - step[i, COOL] * here + loads[i, HEATING] + step[i, INWARD] * gathered
        state[i, GATHERED] = gathered
        beyond, here = inward, below


@inlined
def swing(step: Array, state: Array, loads: Array, theta: float, lever: float, heated: bool) -> tuple[float, float]:
    """Find δτ without contact, eliminate the motion from the root to the tip.

    ``lever`` is hθ + a_K. Returns velocity and temperature of the tip without contact and tip load.
    """
    tip = state.shape[0] - 1
    place = speed = warmed = warm = force = moved = 0.0
    for i in range(1, tip + 1):
        new_place, new_speed = state[i, X], state[i, V]
        new_force = step[i, PULL] * ((new_place - place) + lever * (new_speed - speed))
        if heated:
            warmed = state[i, GATHERED] * step[i, WARMING] + step[i, OUTWARD] * warmed
            state[i, WARMED] = warmed
            new_warm = state[i, TAU] + theta * warmed
            new_force -= step[i, SWELL] * (warm + new_warm)
            warm = new_warm
        if i > 1:
            balance = (new_force - force) - step[i - 1, DRAG] * speed + loads[i - 1, STEADY]
            moved = balance + step[i - 1, ONWARD] * moved
            state[i - 1, MOVED] = moved
        place, speed, force = new_place, new_speed, new_force
    moved = loads[tip, STEADY] - force - step[tip, DRAG] * speed + step[tip, ONWARD] * moved
    return speed + moved * step[tip, YIELD], state[tip, TAU] + warmed


@inlined
def settle(
    step: Array, state: Array, h: float, theta: float, place: float, speed: float, heat: float, heated: bool
) -> None:
    """Find the new state from the tip's new place and speed, and the heat it took in, to the root."""
    tip = state.shape[0] - 1
    moved = speed - state[tip, V]
    state[tip, X], state[tip, V], state[tip, MOVED] = place, speed, moved
    if heated:
        state[tip, TAU] += state[tip, WARMED] + heat * step[tip, WARM]
    for i in range(tip - 1, 0, -1):
        moved = step[i, BACK] * moved + (state[i, MOVED] * step[i, YIELD] - heat * step[i, HEAT_KICK])
        state[i, MOVED] = moved
        before = state[i, V]
        state[i, X] += h * (before + theta * moved)
        state[i, V] = before + moved
        if heated:
            state[i, TAU] += state[i, WARMED] + heat * step[i, WARM]
