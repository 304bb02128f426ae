"""One step of a long chain: elimination along its nodes instead of modes.

A chain of n nodes has n modes whose shapes take n² numbers and n³ operations to find. Its matrices
Ŵ = M + hθC1 + h²θ²K1 and T̂ = C2 + hθK2 are tridiagonal, so a step is also two passes along it.
With increments δτ = τ' - τ, δv = v' - v

    T̂ δτ = h (q - K2 τ) + α p e_n
    Ŵ δv = h (f_θ - C1 v - K1 (x + hθ v) - K12 (τ + θ δτ)) - p e_n,   x' = x + h (v + θ δv),

:func:`step_to_tip` finds δτ and eliminates the motion from the root to the tip, which gives the tip's free velocity;
after contact :func:`step_to_root` finds δv and eliminates the next step's heat, as :func:`eliminate_heat`
does the first one's. The contact's heat comes later than the elimination that feels it: its known
answers, w = T̂⁻¹ e_n and g = hθ K12 w, are added in proportion.

Pivots are sums of positive numbers, as in :mod:`workflow.models._path`. All numbers lie row by row, node
beside node, so that a pass pulls no others through the cache than those it needs, and cases are stepped
one by one: the states of several would push each other out of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeGuard

import numpy as np

from workflow.kernels.compiled import inlined, uncounted
from workflow.models import (
    Array,
    Chain,
    Structure,
    frequency_range,
    is_rayleigh,
    rate_range,
    static_tip_growth,
)
from workflow.schemes._sweep import node_row, step_row

_LINE = 8
"""Numbers of a cache line."""

_FINDING_MODES, _SWEEP, _MODE = 5e-9, 4.6e-9, 0.6e-9
"""Seconds to find the modes of a chain of n nodes, over n³, and of a step of one case per node in
sweeps and per pair of modes in a batch, when sweeps were new. The choice shows in the last digits of
results: it stays within a version of the solver, whatever has become faster since."""

_TYPICAL_STEPS = 1e6
"""Steps of all cases of a batch together for which an operator is chosen: ten cases of 1e5 steps."""


def is_swept(structure: Structure) -> TypeGuard[Chain]:
    """Tell whether a structure is stepped node by node: where its modes cost more than they save."""
    if not isinstance(structure, Chain) or not is_rayleigh(structure):
        return False
    n = structure.mechanical_size
    return not structure.has_matrices or _FINDING_MODES * n**3 > (_SWEEP - _MODE) * n * _TYPICAL_STEPS


def node_rows(rows: int, nodes: int) -> Array:
    """Return zeros ``(row, node)`` for the nodes 0 … ``nodes`` + 1 and some that nobody reads.

    A row is an odd number of cache lines: rows a power of two apart fall upon each other in the cache.
    """
    return np.zeros((rows, _LINE * (-(-(nodes + 2) // _LINE) | 1)))


@uncounted
def _factor(inertia: Array, joint: Array, capacity: Array, flow: Array, swell: Array, step: Array) -> None:
    """Eliminate Ŵ from the root to the tip, T̂ from the tip to the root, and with them w and g.

    ``inertia`` and ``capacity`` are what stands on the diagonals beside the joints ``joint`` and
    ``flow``, of the nodes 0 … n + 1; ``swell`` is hθ k a ℓ/2.
    """
    last = inertia.size - 2
    tied = joint[1]
    for i in range(1, last + 1):
        own = inertia[i] + tied
        pivot = own + joint[i + 1]
        step[step_row.INVERSE_PIVOT, i] = 1.0 / pivot
        step[step_row.SHARE, i] = joint[i + 1] / pivot
        tied = joint[i + 1] * own / pivot
    tied = 0.0
    for i in range(last, 0, -1):
        own = capacity[i] + tied
        pivot = own + flow[i]
        step[step_row.HEAT_INVERSE_PIVOT, i] = 1.0 / pivot
        step[step_row.HEAT_SHARE, i] = flow[i] / pivot
        tied = flow[i] * own / pivot
    gathered = 1.0
    for i in range(last, 0, -1):
        gathered *= 1.0 if i == last else step[step_row.HEAT_SHARE, i + 1]
        step[step_row.HEAT_ANSWER, i] = gathered * step[step_row.HEAT_INVERSE_PIVOT, i]
    for i in range(1, last + 1):
        step[step_row.HEAT_ANSWER, i] += step[step_row.HEAT_SHARE, i] * step[step_row.HEAT_ANSWER, i - 1]
    kick, force = 0.0, -swell[1] * step[step_row.HEAT_ANSWER, 1]
    for i in range(1, last + 1):
        beyond = (
            -swell[i + 1] * (step[step_row.HEAT_ANSWER, i] + step[step_row.HEAT_ANSWER, i + 1]) if i < last else 0.0
        )
        kick = (force - beyond) + step[step_row.SHARE, i - 1] * kick
        step[step_row.HEAT_MOTION, i] = kick * step[step_row.INVERSE_PIVOT, i]
        force = beyond


@dataclass(frozen=True, eq=False)
class Swept:
    """A chain as the sweeps see it: what :class:`~workflow.schemes._fixed.decoupled.Decoupled` is to modes."""

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

        step = node_rows(step_row.ROWS, chain.mechanical_size)
        mass, spring, swell = padded(chain.masses), padded(chain.springs), padded(chain.springs * chain.free_expansion)
        conduction, convection = padded(chain.conduction), padded(chain.convection)
        every = slice(mass.size)
        step[step_row.SPRING, every], step[step_row.EXPANSION, every], step[step_row.DAMPING, every] = (
            h * spring,
            h * swell / 2,
            h * chain.damping.mass * mass,
        )
        step[step_row.CONDUCTION, every], step[step_row.CONVECTION, every] = h * conduction, h * convection
        _factor(
            mass * (1 + h * theta * chain.damping.mass),
            h * theta * (chain.damping.stiffness + h * theta) * spring,
            padded(chain.heat_capacities) + h * theta * convection,
            h * theta * conduction,
            h * theta * swell / 2,
            step,
        )
        return step

    def delassus(self, h: float, theta: float) -> tuple[float, float]:
        """Return e_nᵀ Ŵ⁻¹ e_n and e_nᵀ Ŵ⁻¹ hθ K12 T̂⁻¹ e_n, the parts of the Delassus operator W, 1/kg."""
        step, tip = self.coefficients(h, theta), self.chain.mechanical_size
        return float(step[step_row.INVERSE_PIVOT, tip]), float(step[step_row.HEAT_MOTION, tip])


class Nodes(NamedTuple):
    """A chain and its step; the kernel's view of them."""

    tip: int
    """The last node; the root is node 0."""
    h: float
    theta: float
    lever: float
    """hθ + a_K, s."""
    heated: bool
    """Whether it carries temperatures."""
    step: Array
    """Coefficients, ``(row, node)``, rows of ``step_row``."""
    state: Array
    """``(row, node)``, rows of ``node_row``."""
    loads: Array
    """``(row, node)``, rows ``LOAD_…`` of ``node_row``."""


@inlined
def _eliminate_heat_at(
    i: int, nodes: Nodes, here: float, below: float, flow: float, gathered: float
) -> tuple[float, float]:
    """Eliminate the heat balance of a node; return the flow to the node below, and the sum handed to it."""
    step, heating = nodes.step, nodes.loads[node_row.LOAD_HEATING, i]
    onward = step[step_row.CONDUCTION, i] * (here - below)
    loss = step[step_row.CONVECTION, i] * here
    return onward, (flow - onward) - loss + heating + step[step_row.HEAT_SHARE, i + 1] * gathered


@inlined
def eliminate_heat(nodes: Nodes) -> None:
    """Eliminate the first step's heat balance from the tip to the root."""
    state, flow, gathered = nodes.state, 0.0, 0.0
    for i in range(nodes.tip, 0, -1):
        flow, gathered = _eliminate_heat_at(
            i, nodes, state[node_row.TAU, i], state[node_row.TAU, i - 1], flow, gathered
        )
        state[node_row.ELIMINATED, i] = gathered


@inlined
def step_to_tip(nodes: Nodes) -> tuple[float, float]:
    """Find δτ without contact, eliminate the motion from the root to the tip.

    Returns velocity and temperature of the tip without contact and tip load.
    """
    step, state, loads, tip, lever = nodes.step, nodes.state, nodes.loads, nodes.tip, nodes.lever
    place = speed = warmed = warm = force = moved = 0.0
    for i in range(1, tip + 1):
        new_place, new_speed = state[node_row.X, i], state[node_row.V, i]
        new_force = step[step_row.SPRING, i] * ((new_place - place) + lever * (new_speed - speed))
        if nodes.heated:
            warmed = (
                state[node_row.ELIMINATED, i] * step[step_row.HEAT_INVERSE_PIVOT, i]
                + step[step_row.HEAT_SHARE, i] * warmed
            )
            state[node_row.WARMED, i] = warmed
            new_warm = state[node_row.TAU, i] + nodes.theta * warmed
            new_force -= step[step_row.EXPANSION, i] * (warm + new_warm)
            warm = new_warm
        if i > 1:
            balance = (new_force - force) - step[step_row.DAMPING, i - 1] * speed + loads[node_row.LOAD_STEADY, i - 1]
            moved = balance + step[step_row.SHARE, i - 2] * moved
            state[node_row.ELIMINATED, i - 1] = moved
        place, speed, force = new_place, new_speed, new_force
    moved = (
        loads[node_row.LOAD_STEADY, tip]
        - force
        - step[step_row.DAMPING, tip] * speed
        + step[step_row.SHARE, tip - 1] * moved
    )
    return speed + moved * step[step_row.INVERSE_PIVOT, tip], state[node_row.TAU, tip] + warmed


@inlined
def step_to_root(nodes: Nodes, place: float, speed: float, heat: float) -> None:
    """Find the new state from the tip's new place and speed, and the heat it took in, to the root.

    The next step's heat is eliminated on the way, a node behind.
    """
    step, state, tip = nodes.step, nodes.state, nodes.tip
    moved = speed - state[node_row.V, tip]
    state[node_row.X, tip], state[node_row.V, tip] = place, speed
    flow = gathered = here = 0.0
    if nodes.heated:
        here = state[node_row.TAU, tip] + (state[node_row.WARMED, tip] + heat * step[step_row.HEAT_ANSWER, tip])
        state[node_row.TAU, tip] = here
    for i in range(tip - 1, -1, -1):
        free = state[node_row.ELIMINATED, i] * step[step_row.INVERSE_PIVOT, i]
        moved = step[step_row.SHARE, i] * moved + (free - heat * step[step_row.HEAT_MOTION, i])
        before = state[node_row.V, i]
        state[node_row.X, i] += nodes.h * (before + nodes.theta * moved)
        state[node_row.V, i] = before + moved
        if nodes.heated:
            below = state[node_row.TAU, i] + (state[node_row.WARMED, i] + heat * step[step_row.HEAT_ANSWER, i])
            state[node_row.TAU, i] = below
            flow, gathered = _eliminate_heat_at(i + 1, nodes, here, below, flow, gathered)
            state[node_row.ELIMINATED, i + 1] = gathered
            here = below
