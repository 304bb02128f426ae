"""One step of a long chain: elimination along its nodes instead of modes.

A chain of n nodes has n modes whose shapes take n² numbers and n³ operations to find. Its matrices
Ŵ = M + hθC1 + h²θ²K1 and T̂ = C2 + hθK2 are tridiagonal, so a step is also two passes along it.
With increments δτ = τ' - τ, δv = v' - v

    T̂ δτ = h (q - K2 τ) + α p e_n
    Ŵ δv = h (f_θ - C1 v - K1 (x + hθ v) - K12 (τ + θ δτ)) - p e_n,   x' = x + h (v + θ δv),

:func:`swing` (root to tip) finds δτ, eliminates the motion and so arrives at the tip's free velocity;
contact; :func:`settle` (tip to root) finds δv and eliminates the next step's heat, as :func:`conduct`
does the first one's. The contact's heat comes later than the elimination that feels it: its known
answers, w = T̂⁻¹ e_n and g = hθ K12 w, are added in proportion.

Pivots are sums of positive numbers, as in :mod:`workflow.models._path`. All numbers lie row by row, node
beside node, so that a pass pulls no others through the cache than those it needs, and cases are stepped
one by one: the states of several would push each other out of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workflow.models import Array, Chain, frequency_range, rate_range, static_tip_growth
from workflow.schemes._kernel import inlined, kernel

X, V, TAU, WARMED, ELIMINATED, FORMER = range(6)
"""Rows of a chain's state ``(row, node)``, node 0 being the root: x, v and τ at the step's beginning,
then end; δτ without the contact's heat; what an elimination leaves at a node, of the heat on its way
to the root, then of the motion on its way to the tip; v at the step's beginning, where balances ask
for it. Heat and motion share a row as a pass waits longest for rows that it writes and has not read."""

STATE = FORMER + 1

PULL, SWELL, DRAG, YIELD, BACK, HEAT_KICK, FLOW, COOL, WARMING, OUTWARD, WARM = range(11)
"""Coefficients of a node and the spring below it ``(row, node)``: h k, h k a ℓ/2 and h a_M m; the inverse
pivot of the elimination to the tip, the share that it hands to the node beyond and that the node later
takes back from there, and the eliminated g over the pivot; hκ, hb; the inverse pivot of the elimination
to the root, the share handed to the node before and taken back; w."""

_COEFFICIENTS = WARM + 1

STEADY, HEATING = range(2)
"""Rows of a case's constant loads in a step ``(row, node)``: h f [N s], h q [J]."""

LOADS = HEATING + 1

_LINE = 8
"""Numbers of a cache line."""


def node_rows(rows: int, nodes: int) -> Array:
    """Return zeros ``(row, node)`` for the nodes 0 … ``nodes`` + 1 and some that nobody reads.

    A row is an odd number of cache lines: rows a power of two apart fall upon each other in the cache.
    """
    return np.zeros((rows, _LINE * (-(-(nodes + 2) // _LINE) | 1)))


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
        found[YIELD, i] = 1.0 / pivot
        found[BACK, i] = joint[i + 1] / pivot
        tied = joint[i + 1] * own / pivot
    tied = 0.0
    for i in range(last, 0, -1):
        own = capacity[i] + tied
        pivot = own + flow[i]
        found[WARMING, i] = 1.0 / pivot
        found[OUTWARD, i] = flow[i] / pivot
        tied = flow[i] * own / pivot
    gathered = 1.0
    for i in range(last, 0, -1):
        gathered *= 1.0 if i == last else found[OUTWARD, i + 1]
        found[WARM, i] = gathered * found[WARMING, i]
    for i in range(1, last + 1):
        found[WARM, i] += found[OUTWARD, i] * found[WARM, i - 1]
    kick, force = 0.0, -swell[1] * found[WARM, 1]
    for i in range(1, last + 1):
        beyond = -swell[i + 1] * (found[WARM, i] + found[WARM, i + 1]) if i < last else 0.0
        kick = (force - beyond) + found[BACK, i - 1] * kick
        found[HEAT_KICK, i] = kick * found[YIELD, i]
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
        """Return the coefficients of a step, ``(row, node)``; those of the root and beyond the tip are 0."""
        chain = self.chain

        def padded(values: Array) -> Array:
            return np.concatenate([[0.0], values, [0.0]])

        found = node_rows(_COEFFICIENTS, chain.mechanical_size)
        mass, spring, swell = padded(chain.masses), padded(chain.springs), padded(chain.springs * chain.free_expansion)
        conduction, convection = padded(chain.conduction), padded(chain.convection)
        every = slice(mass.size)
        found[PULL, every], found[SWELL, every], found[DRAG, every] = (
            h * spring,
            h * swell / 2,
            h * chain.damping.mass * mass,
        )
        found[FLOW, every], found[COOL, every] = h * conduction, h * convection
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
        found, tip = self.coefficients(h, theta), self.chain.mechanical_size
        return float(found[YIELD, tip]), float(found[HEAT_KICK, tip])


@inlined
def _conduct_at(
    i: int, step: Array, loads: Array, here: float, below: float, flow: float, gathered: float
) -> tuple[float, float]:
    """Eliminate the heat balance of a node; return the flow to the node below, and what is gathered now."""
    onward = step[FLOW, i] * (here - below)
    return onward, (flow - onward) - step[COOL, i] * here + loads[HEATING, i] + step[OUTWARD, i + 1] * gathered


@inlined
def conduct(tip: int, step: Array, state: Array, loads: Array) -> None:
    """Eliminate the first step's heat balance from the tip, node ``tip``, to the root."""
    flow = gathered = 0.0
    for i in range(tip, 0, -1):
        flow, gathered = _conduct_at(i, step, loads, state[TAU, i], state[TAU, i - 1], flow, gathered)
        state[ELIMINATED, i] = gathered


@inlined
def swing(
    tip: int, step: Array, state: Array, loads: Array, theta: float, lever: float, heated: bool
) -> tuple[float, float]:
    """Find δτ without contact, eliminate the motion from the root to the tip.

    ``lever`` is hθ + a_K. Returns velocity and temperature of the tip without contact and tip load.
    """
    place = speed = warmed = warm = force = moved = 0.0
    for i in range(1, tip + 1):
        new_place, new_speed = state[X, i], state[V, i]
        new_force = step[PULL, i] * ((new_place - place) + lever * (new_speed - speed))
        if heated:
            warmed = state[ELIMINATED, i] * step[WARMING, i] + step[OUTWARD, i] * warmed
            state[WARMED, i] = warmed
            new_warm = state[TAU, i] + theta * warmed
            new_force -= step[SWELL, i] * (warm + new_warm)
            warm = new_warm
        if i > 1:
            balance = (new_force - force) - step[DRAG, i - 1] * speed + loads[STEADY, i - 1]
            moved = balance + step[BACK, i - 2] * moved
            state[ELIMINATED, i - 1] = moved
        place, speed, force = new_place, new_speed, new_force
    moved = loads[STEADY, tip] - force - step[DRAG, tip] * speed + step[BACK, tip - 1] * moved
    return speed + moved * step[YIELD, tip], state[TAU, tip] + warmed


@inlined
def settle(
    tip: int,
    step: Array,
    state: Array,
    loads: Array,
    h: float,
    theta: float,
    place: float,
    speed: float,
    heat: float,
    heated: bool,
) -> None:
    """Find the new state from the tip's new place and speed, and the heat it took in, to the root.

    The next step's heat is eliminated on the way, a node behind.
    """
    moved = speed - state[V, tip]
    state[X, tip], state[V, tip] = place, speed
    flow = gathered = here = 0.0
    if heated:
        here = state[TAU, tip] + (state[WARMED, tip] + heat * step[WARM, tip])
        state[TAU, tip] = here
    for i in range(tip - 1, -1, -1):
        moved = step[BACK, i] * moved + (state[ELIMINATED, i] * step[YIELD, i] - heat * step[HEAT_KICK, i])
        before = state[V, i]
        state[X, i] += h * (before + theta * moved)
        state[V, i] = before + moved
        if heated:
            below = state[TAU, i] + (state[WARMED, i] + heat * step[WARM, i])
            state[TAU, i] = below
            flow, gathered = _conduct_at(i + 1, step, loads, here, below, flow, gathered)
            state[ELIMINATED, i + 1] = gathered
            here = below
