"""Blocks in one step, a pack of lanes at a time, and the energy of what they move, in the modes of the free tip.

The blocks, u and η, are those of :mod:`workflow.schemes._fixed.blocks`. Their energy is that of the whole motion: with
the velocities v and places x of the modes at the ends of a step, v_m = (v + v')/2 and θ_m likewise, the residual is ΔE,
E = ½ (v² + ω² x²), and the sum over the steps of

    v_mᵀ C v_m h + v_mᵀ G θ_m h - v_mᵀ f̄ h - v_mᵀ b F_θ h - µp tᵀ v_m + p v_n,

the last with the tip's velocities of the contact law. Central differences conserve E = ½ (w² + ω² x_k x_k+1),
w = w_k+½; their step from w_k-½ to w_k+½ has v_k for v_m and θ_k for θ_m.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part
from workflow.kernels.packs import Lane, Pack, pack, shared, store
from workflow.schemes._fixed import case_row, total_row

SPEED, PLACE = range(2)
"""Rows of a block's motion ``(block, row, lane)``: u and η; of what acts on it, per impulse of contact."""

STEADY_SPEED, STEADY_PLACE = range(2, 4)
"""Rows of what acts on a block beside: what is added in every step."""

DRIVES = STEADY_PLACE + 1

DECAY, SPRING, LOAD_SPEED, LOAD_PLACE, TIP_SPEED, TIP_PLACE = range(6)
"""Coefficients of a block: u' per u and per η, u and η per impulse of the load, the tip's velocity per u and per η."""


class BlockStep(NamedTuple):
    """One free step of blocks."""

    blocks: Array
    """``(block, coefficient)``."""
    load: float
    """Velocity of the tip per impulse of the load, 1/kg."""


@inlined
def step_blocks(
    step: BlockStep, h: float, motion: Array, drives: Array, own: Array, velocity: Pack, lane: Lane
) -> Pack:
    """Step the blocks, and return the tip's velocity with theirs; impulses of the last step are not in them yet."""
    blocks, impulse, load = step.blocks, pack(own, (case_row.IMPULSE, lane)), pack(own, (case_row.LOAD, lane))
    for j in range(motion.shape[0]):
        before = pack(motion, (j, SPEED, lane)) + pack(drives, (j, SPEED, lane)) * impulse
        before += shared(blocks, (j, LOAD_SPEED), lane) * load
        place = pack(motion, (j, PLACE, lane)) + pack(drives, (j, PLACE, lane)) * impulse
        place += shared(blocks, (j, LOAD_PLACE), lane) * load
        u = shared(blocks, (j, DECAY), lane) * before + shared(blocks, (j, SPRING), lane) * place
        u += pack(drives, (j, STEADY_SPEED, lane))
        eta = place + h * before + pack(drives, (j, STEADY_PLACE, lane))
        store(motion, (j, SPEED, lane), u)
        store(motion, (j, PLACE, lane), eta)
        velocity += shared(blocks, (j, TIP_SPEED), lane) * u + shared(blocks, (j, TIP_PLACE), lane) * eta
    return velocity


class BlockAccount(NamedTuple):
    """What the energy of a block of cases takes; modes are those of the free tip."""

    outward: Array
    """v per u, η and τ, ``(mode, state)``."""
    mass: Array
    stiffness: Array
    """1 and ω², ``(mode,)``."""
    damping: Array
    """``(mode, mode)``."""
    coupling: Array
    """G per τ as kernels scale it, ``(mode, thermal mode)``."""
    load: Array
    along: Array
    """b and t, ``(mode,)``."""
    levers: tuple[float, float]
    """Of the two places in E, from ξ, s."""
    staggered: bool
    """Whether θ_k stands for θ_m, before the heat of the contact about t_k: central differences."""
    lagged: bool
    load_share: float
    """Share of the load that acts on the tip itself."""
    steady: Array
    """Constant loads, ``(mode, lane)``."""
    warming: Array
    """Rise of τ that constant heating gives in a second, ``(thermal mode, lane)``."""
    states: Array
    """u, η and τ at the last step's end, ``(state, lane)``."""
    mean: Array
    """θ_m, ``(thermal mode, lane)``."""
    place: Array
    speed: Array
    """ξ and v at the last step's end, ``(mode, lane)``."""
    former: Array
    """v at its beginning, ``(mode, lane)``."""
    force: Array
    """Room for forces, ``(mode, lane)``."""


@part
def _add_product(matrix: Array, states: Array, sums: Array, lanes: int) -> None:
    """Add matrix · states to ``sums``, ``(row, lane)``."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            factor = matrix[i, j]
            for lane in range(lanes):
                sums[i, lane] += factor * states[j, lane]


@part
def move(b: BlockAccount, blocks: Array, inputs: Array, state: Any, h: float, t: float, lanes: int) -> None:
    """Take what the blocks make of the last step's end, t; ``inputs`` are τ per heat of the contact in it."""
    motion, drives, own, tau = state.motion, state.drives, state.own, state.tau
    count = motion.shape[0]
    for j in range(count):
        for lane in range(lanes):
            p, load = own[case_row.IMPULSE, lane], own[case_row.LOAD, lane]
            u = motion[j, SPEED, lane] + drives[j, SPEED, lane] * p + blocks[j, LOAD_SPEED] * load
            eta = motion[j, PLACE, lane] + drives[j, PLACE, lane] * p + blocks[j, LOAD_PLACE] * load
            b.states[j, lane], b.states[count + j, lane] = u, eta
    for k in range(tau.shape[0]):
        for lane in range(lanes):
            cold, before = tau[k, lane] + b.warming[k, lane] * t, b.states[2 * count + k, lane]
            now = cold + inputs[k] * own[case_row.HEAT, lane]
            b.mean[k, lane], b.states[2 * count + k, lane] = cold if b.staggered else 0.5 * (before + now), now
    for i in range(b.mass.size):
        for lane in range(lanes):
            b.former[i, lane] = b.speed[i, lane]
            b.place[i, lane] += h * b.speed[i, lane]
            b.speed[i, lane] = 0.0
    _add_product(b.outward, b.states, b.speed, lanes)


@part
def count(b: BlockAccount, h: float, own: Array, sums: Array, lanes: int) -> None:
    """Add the energy that a step dissipates less the work of the loads, and keep that at its end."""
    modes, v, force = b.mass.size, b.speed, b.force
    for i in range(modes):
        for lane in range(lanes):
            force[i, lane] = -b.steady[i, lane]
    _add_product(b.coupling, b.mean, force, lanes)
    for i in range(modes):
        for j in range(modes):
            factor = b.damping[i, j]
            for lane in range(lanes):
                damps = b.former[j, lane] if b.lagged else 0.5 * (b.former[j, lane] + v[j, lane])
                force[i, lane] += factor * damps
    for lane in range(lanes):
        work = energy = 0.0
        slid = own[case_row.FRICTION, lane] * own[case_row.IMPULSE, lane]
        for i in range(modes):
            mean, x = 0.5 * (b.former[i, lane] + v[i, lane]), b.place[i, lane]
            work += mean * (h * force[i, lane] - b.load[i] * own[case_row.LOAD, lane] + b.along[i] * slid)
            begin, end = x + b.levers[0] * v[i, lane], x + b.levers[1] * v[i, lane]
            energy += b.mass[i] * v[i, lane] * v[i, lane] + b.stiffness[i] * begin * end
        sums[total_row.DISSIPATED, lane] += work
        largest = sums[total_row.LARGEST_ENERGY, lane]
        sums[total_row.LAST_ENERGY, lane] = 0.5 * energy
        sums[total_row.LARGEST_ENERGY, lane] = largest if 0.5 * energy <= largest else 0.5 * energy
