"""Free motion of all modes in one step, a pack of lanes at a time: what a fixed step does between contacts.

A kernel runs over time, in a step over packs of lanes, and in a pack over its modes, whose sum stays
in a register from mode to mode, in the same order for every lane. So nothing of a step is stored
but the states. For calls within a step to cost nothing,

- the number of lanes in a row of memory is asserted, see :mod:`workflow.kernels.lanes`, and so
  are the numbers of a mode: the distance between rows is then a constant;
- functions called in every step are inlined and count no references to arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import PACK, ROW
from workflow.kernels.packs import Lane, Pack, narrow, pack, plus, shared, spread, store
from workflow.models import Array
from workflow.schemes._fixed import balance, case_row
from workflow.schemes._fixed.balance import Account, of_modes
from workflow.schemes._fixed.block_lanes import DRIVES, BlockStep, step_blocks
from workflow.schemes._fixed.contact import TipStep, was_pressed

MOTION_SPEED, MOTION_PLACE = range(2)
"""Rows of a mode's motion: ζ and ξ."""

ENERGY_INTERVAL, FEWEST_ENERGIES = 32, 128
"""The largest energy is looked for in every so many steps, in short runs at least so many times or in every step."""

MODE_DECAY, MODE_SPRING, MODE_IMPULSE, MODE_HEAT_SPEED, MODE_HEAT_PLACE = range(5)
"""Coefficients of a mechanical mode: a and b of ζ' = a ζ + b ξ, ζ per unit impulse and per unit heat at the tip, ξ
per unit heat."""

HEAT_DECAY, HEAT_INPUT, HEAT_SPEED = range(3)
"""Coefficients of a thermal mode, scaled to add its τ to the tip's temperature: τ' per τ, τ per unit
heat at the tip, and what the mode adds to the tip's velocity."""


class Sliding(NamedTuple):
    """What friction along the tangent does, per µ times the impulse of contact; ``None`` without friction."""

    speeds: Array
    """ζ of each mode, ``(mode,)``."""
    works: Array
    """Half the work per ζ of each mode, 0 of those without a share in the tip, ``(mode,)``."""


class Slid(NamedTuple):
    """The same in a pack of lanes."""

    speeds: Array
    works: Array
    impulse: Pack
    """µ times the impulse of contact in the last step, N s."""


class Coefficients(NamedTuple):
    """One free step and one unit impulse in modal coordinates; the kernel's view of an operator."""

    modes: Array
    """``(mode, coefficient)``."""
    heat_modes: Array
    """``(thermal mode, coefficient)``."""
    pair_mode: NDArray[np.int64]
    pair_heat: NDArray[np.int64]
    pair_pull: Array
    """ζ' and ξ' of a mode, and the tip's velocity, per τ of a thermal mode near resonance with it, ``(pair, 3)``."""
    tip: TipStep
    heat_counts: bool
    """Whether τ at a step's end holds the heat of the contact in it; central differences add it with the next step."""
    sliding: Sliding | None = None
    blocks: BlockStep | None = None
    """In the place of ``modes``, where these are coupled or the load acts elsewhere than on the tip."""


class State(NamedTuple):
    """Modal states of a block and what its cases have of their own."""

    own: Array
    """``(row, lane)``, rows of ``case_row``."""
    motion: Array
    """``(mode, row, lane)``, rows ``MOTION_…``."""
    tau: Array
    """``(thermal mode, lane)``, without the heat of the last contact, which the next step adds."""
    tau_before: Array
    """τ at the beginning of the last step."""
    tau_paired: Array
    """Either of the two: the τ that pulls at modes near resonance."""
    drives: Array
    """What acts on blocks, ``(block, row, lane)``, see :mod:`~workflow.schemes._fixed.block_lanes`."""


def by_mode(*rows: Array) -> Array:
    """Return arrays ``(mode, …)`` as one, ``(mode, row, …)``."""
    return np.ascontiguousarray(np.stack(rows, axis=1))


def pulls_on_speed(pull: Array) -> Array:
    """Return :attr:`Coefficients.pair_pull` of modes scaled by the tip, on whose ζ alone heat pulls."""
    return np.stack([pull, np.zeros_like(pull), pull], axis=1)


@inlined
def lay_out(operator: Coefficients, state: State, load: Array, tip: Array) -> None:
    """Assert how far apart rows lie, once before the first step, for all that is inlined after it.

    The compiler knows distances then, instead of reading them for each pack of lanes.
    """
    assert operator.modes.shape[1] == MODE_HEAT_PLACE + 1
    assert operator.heat_modes.shape[1] == HEAT_SPEED + 1
    assert state.motion.shape[1] == MOTION_PLACE + 1
    assert state.motion.shape[2] == ROW
    assert state.tau.shape[1] == ROW
    assert state.own.shape[1] == ROW
    assert state.drives.shape[1] == DRIVES
    assert state.drives.shape[2] == ROW
    assert load.shape[1] == ROW
    assert tip.shape[1] == ROW


@inlined
def store_slid(sliding: Sliding | None, impulse: Pack, own: Array, lane: Lane) -> None:
    """Store µ times the impulse of contact in a step that contact has closed."""
    if sliding is not None:
        store(own, (case_row.SLID, lane), pack(own, (case_row.FRICTION, lane)) * impulse)


@inlined
def _slid_by(sliding: Sliding | None, own: Array, lane: Lane) -> Slid | None:
    """Return what friction did in the last step."""
    return None if sliding is None else Slid(sliding.speeds, sliding.works, pack(own, (case_row.SLID, lane)))


@inlined
def _ended(
    modes: Array, motion: Array, j: int, impulse: Pack, heat: Pack | None, slid: Slid | None, lane: Lane
) -> tuple[Pack, Pack]:
    """Return ζ and ξ of mode j at the end of the last step, whose ``impulse`` and ``heat`` are not in its state yet."""
    speed = pack(motion, (j, MOTION_SPEED, lane)) + shared(modes, (j, MODE_IMPULSE), lane) * impulse
    speed = speed if slid is None else speed + shared(slid.speeds, (j,), lane) * slid.impulse
    place = plus(pack(motion, (j, MOTION_PLACE, lane)), shared(modes, (j, MODE_HEAT_PLACE), lane), heat)
    return plus(speed, shared(modes, (j, MODE_HEAT_SPEED), lane), heat), place


@inlined
def _step_modes(
    operator: Coefficients, state: State, velocity: Pack, heat: Pack | None, account: Account | None, lane: Lane
) -> Pack:
    """Step the mechanical modes, and return the tip's velocity with theirs; ``heat`` is that of the last contact."""
    modes, h, slid = operator.modes, operator.tip.h, _slid_by(operator.sliding, state.own, lane)
    motion, impulse = state.motion, pack(state.own, (case_row.IMPULSE, lane))
    dissipated, on_heat = spread(0.0, lane), spread(0.0, lane)
    for j in range(motion.shape[0]):
        on_heat = balance.add_heat_work(account, j, pack(motion, (j, MOTION_PLACE, lane)), on_heat, lane)
        before, place = _ended(modes, motion, j, impulse, heat, slid, lane)
        after = shared(modes, (j, MODE_DECAY), lane) * before + shared(modes, (j, MODE_SPRING), lane) * place
        store(motion, (j, MOTION_SPEED, lane), after)
        store(motion, (j, MOTION_PLACE, lane), place + h * before)
        velocity += after
        dissipated = balance.add_dissipation(account, j, before, slid, dissipated, lane)
    balance.store_dissipation(account, dissipated, on_heat, impulse, heat, slid, lane)
    return velocity


@inlined
def _step_motion(
    blocks: BlockStep | None,
    operator: Coefficients,
    state: State,
    velocity: Pack,
    heat: Pack | None,
    account: Account | None,
    lane: Lane,
) -> Pack:
    """Step what moves, and return the tip's velocity with it."""
    if blocks is None:
        return _step_modes(operator, state, velocity, heat, account, lane)
    return step_blocks(blocks, operator.tip.h, state.motion, state.drives, state.own, velocity, lane)


@inlined
def _step_heat(
    heat_modes: Array,
    tau: Array,
    velocity: Pack,
    temperature: Pack,
    heat: Pack | None,
    account: Account | None,
    lane: Lane,
) -> tuple[Pack, Pack]:
    """Step the thermal modes, and return velocity and temperature of the tip with theirs."""
    for k in range(tau.shape[0]):
        before = plus(pack(tau, (k, lane)), shared(heat_modes, (k, HEAT_INPUT), lane), heat)
        after = shared(heat_modes, (k, HEAT_DECAY), lane) * before
        store(tau, (k, lane), after)
        velocity += shared(heat_modes, (k, HEAT_SPEED), lane) * after
        temperature += after
    balance.store_dragged_velocity(account, velocity, lane)
    return velocity, temperature


@part
def is_warmed(own: Array, lanes: int) -> bool:
    """Tell whether heating or the temperature of the surroundings moves the tip of some lane."""
    warmed = False
    for lane in range(lanes):
        warmed |= (
            own[case_row.DRIFT, lane] != 0.0 or own[case_row.WARMTH, lane] != 0.0 or own[case_row.WARMING, lane] != 0.0
        )
    return warmed


@inlined
def _add_pair_work(operator: Coefficients, state: State, account: Account | None, lane: Lane) -> None:
    """Count what thermal modes near resonance with mechanical ones did in the last step."""
    if account is None:
        return
    impulse, heat = pack(state.own, (case_row.IMPULSE, lane)), pack(state.own, (case_row.HEAT, lane))
    slid = _slid_by(operator.sliding, state.own, lane)
    for pair in range(operator.pair_mode.size):
        j = operator.pair_mode[pair]
        speed, _ = _ended(operator.modes, state.motion, j, impulse, heat, slid, lane)
        balance.add_pair_work(account, pair, j, speed, heat, lane)


@inlined
def _add_pairs(operator: Coefficients, state: State, velocity: Pack, account: Account | None, lane: Lane) -> Pack:
    """Add what thermal modes do to mechanical modes near resonance with them; return the tip's velocity with it."""
    motion = state.motion
    for pair in range(operator.pair_mode.size):
        j, k = operator.pair_mode[pair], operator.pair_heat[pair]
        tau = pack(state.tau_paired, (k, lane))
        pull = shared(operator.pair_pull, (pair, 0), lane) * tau
        balance.store_pull(account, pair, pull, lane)
        store(motion, (j, MOTION_SPEED, lane), pack(motion, (j, MOTION_SPEED, lane)) + pull)
        place = shared(operator.pair_pull, (pair, 1), lane) * tau
        store(motion, (j, MOTION_PLACE, lane), pack(motion, (j, MOTION_PLACE, lane)) + place)
        velocity += shared(operator.pair_pull, (pair, 2), lane) * tau
    return velocity


@inlined
def step_freely(
    operator: Coefficients, warmed: bool, t: float, state: State, account: Account | None, lane: Lane
) -> tuple[Pack, Pack]:
    """Step all modes to t; return velocity and temperature of the tip there without load and contact.

    They begin with impulse and heat of the step before; in most steps there is no heat in any lane.
    ``warmed`` is what :func:`is_warmed` returned.
    """
    own, tau, heat_modes = state.own, state.tau, operator.heat_modes
    velocity, temperature, paired = spread(0.0, lane), spread(0.0, lane), operator.pair_mode.size > 0
    if tau.shape[0] == 0:
        return _step_motion(operator.blocks, operator, state, velocity, None, account, lane), temperature
    if warmed:
        velocity += pack(own, (case_row.DRIFT, lane))
        temperature = pack(own, (case_row.WARMTH, lane)) + pack(own, (case_row.WARMING, lane)) * t
    if paired:
        _add_pair_work(operator, state, account, lane)
    if was_pressed(own, lane):
        heat = pack(own, (case_row.HEAT, lane))
        velocity, temperature = _step_heat(heat_modes, tau, velocity, temperature, heat, account, lane)
        velocity = _step_motion(operator.blocks, operator, state, velocity, heat, account, lane)
    else:
        velocity, temperature = _step_heat(heat_modes, tau, velocity, temperature, None, account, lane)
        velocity = _step_motion(operator.blocks, operator, state, velocity, None, account, lane)
    if paired:
        velocity = _add_pairs(operator, state, velocity, account, lane)
    return velocity, temperature


@inlined
def count_at_intervals(
    account: Account | None, step: int, steps: int, operator: Coefficients, state: State, lanes: int
) -> None:
    """Keep the energy at the end of some steps, and count the heat lost in the steps after some."""
    if account is None:
        return
    if step % min(ENERGY_INTERVAL, steps // FEWEST_ENERGIES + 1) == 0:
        _store_energies(of_modes(operator.blocks, account), operator, state, lanes)
    if step % balance.SPAN == 0 or step == steps:
        _count_lost_heat(account, step, steps, operator.tip.h, state.tau, lanes)


@part
def _count_lost_heat(account: Account, step: int, steps: int, h: float, tau: Array, lanes: int) -> None:
    for first in range(0, lanes, PACK):
        balance.count_lost_heat(account, step, steps, h, tau, narrow(first))


@part
def _store_energies(account: Account | None, operator: Coefficients, state: State, lanes: int) -> None:
    if account is None:
        return
    for first in range(0, lanes, PACK):
        _store_energy(account, operator, state, narrow(first))


@inlined
def _store_energy(account: Account, operator: Coefficients, state: State, lane: Lane) -> None:
    """Keep the energy at the end of the last step."""
    impulse, heat = pack(state.own, (case_row.IMPULSE, lane)), pack(state.own, (case_row.HEAT, lane))
    energy, slid = spread(0.0, lane), _slid_by(operator.sliding, state.own, lane)
    for j in range(state.motion.shape[0]):
        speed, place = _ended(operator.modes, state.motion, j, impulse, heat, slid, lane)
        energy = balance.with_energy(account, j, speed, place, energy, lane)
    balance.store_energy(account, energy, lane)


@inlined
def close_balance(account: Account | None, operator: Coefficients, state: State, lanes: int) -> None:
    """Add what the modes dissipated in the last step to the sums, and the energy at its end."""
    if account is None:
        return
    _store_energies(account, operator, state, lanes)
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        impulse, heat = pack(state.own, (case_row.IMPULSE, lane)), pack(state.own, (case_row.HEAT, lane))
        _add_pair_work(operator, state, account, lane)
        dissipated, on_heat = spread(0.0, lane), spread(0.0, lane)
        slid = _slid_by(operator.sliding, state.own, lane)
        for j in range(state.motion.shape[0]):
            on_heat = balance.add_heat_work(account, j, pack(state.motion, (j, MOTION_PLACE, lane)), on_heat, lane)
            speed, _ = _ended(operator.modes, state.motion, j, impulse, heat, slid, lane)
            dissipated = balance.add_dissipation(account, j, speed, slid, dissipated, lane)
        balance.store_dissipation(account, dissipated, on_heat, impulse, heat, slid, lane)


@part
def store_heat(operator: Coefficients, state: State, into: Array, lanes: int) -> None:
    """Store τ as it is at the end of the last step, with the heat of the contact in it where that counts there."""
    for k in range(into.shape[0]):
        for lane in range(lanes):
            heat = operator.heat_modes[k, HEAT_INPUT] * state.own[case_row.HEAT, lane]
            into[k, lane] = state.tau[k, lane] + heat if operator.heat_counts else state.tau[k, lane]
