"""Free motion of all modes in one step, eight lanes at a time: what a θ-method does between contacts.

The kernel runs over time, in a step over packs of lanes, and in a pack over its modes, whose sum goes
on in a register from mode to mode, in the same order for every lane. So nothing of a step has to be
kept but the states. For calls within a step to cost nothing,

- the number of lanes in a row of memory is asserted, see :mod:`workflow.schemes._lanes`, and so
  are the numbers of a mode: the distance between rows is then a constant;
- functions called in every step are inlined and count no references to arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.schemes._kernel import inlined, part
from workflow.schemes._lanes import ROW
from workflow.schemes._packs import Lane, Pack, pack, raised, shared, spread, store

SPEED, PLACE = range(2)
"""Rows of a mode's motion: ζ and ξ of ``_modal_march``."""

KEEP, PULL, PUSH, HEAT_PUSH, HEAT_SHIFT = range(5)
"""Coefficients of a mechanical mode: ζ' per ζ and per ξ (a and b of ``_modal_march``), ζ per unit
impulse and per unit heat at the tip, ξ per unit heat."""

DECAY, WARM, DRAG = range(3)
"""Coefficients of a thermal mode, scaled to add its τ to the tip's temperature: τ' per τ, τ per unit
heat at the tip, and what the mode adds to the tip's velocity."""

RESTITUTION, ALPHA, DELASSUS, COMPLIANCE, DRIFT, WARMTH, WARMING, PUSHED, HEAT, PRESSED = range(10)
"""Rows of the lanes' own values: e, α, W, 1/W (NaN where W <= 0, so that contact ends the case), the
known part of the motion (:class:`~workflow.schemes._decoupled.Motion`), and what the tip took in
the last step: the impulse of load and contact, the heat, and as a pack's flag whether it was in contact,
without which there is no heat (α is finite)."""

OWN_ROWS = PRESSED + 1


class Coefficients(NamedTuple):
    """One free step and one unit impulse in modal coordinates; the kernel's view of an operator."""

    modes: Array
    """``(mode, coefficient)``."""
    heat_modes: Array
    """``(thermal mode, coefficient)``."""
    pair_mode: NDArray[np.int64]
    pair_heat: NDArray[np.int64]
    pair_pull: Array
    """ζ' of a mode per τ of a thermal mode near resonance with it, ``(pair,)``."""
    inverse_mass: float
    """Tip velocity per unit impulse, e_nᵀ Ŵ⁻¹ e_n."""
    warming: float
    """Tip temperature per unit heat."""
    theta: float
    rest: float | None
    """1 - θ, the weight of a step's beginning; ``None`` for θ = 1, whose kernels leave that out."""


def by_mode(*rows: Array) -> Array:
    """Return arrays ``(mode, …)`` as one, ``(mode, row, …)``."""
    return np.ascontiguousarray(np.stack(rows, axis=1))


@inlined
def lay_out(operator: Coefficients, own: Array, motion: Array, tau: Array, load: Array, tip: Array) -> None:
    """Say how far apart rows lie, once before the first step, where it holds for all that is inlined into it.

    The compiler knows distances then, instead of reading them for each pack of lanes.
    """
    assert operator.modes.shape[1] == HEAT_SHIFT + 1
    assert operator.heat_modes.shape[1] == DRAG + 1
    assert motion.shape[1] == PLACE + 1
    assert motion.shape[2] == ROW
    assert tau.shape[1] == ROW
    assert own.shape[1] == ROW
    assert load.shape[1] == ROW
    assert tip.shape[1] == ROW


@inlined
def swing(modes: Array, h: float, motion: Array, own: Array, velocity: Pack, lane: Lane) -> Pack:
    """Step the mechanical modes where no heat acts on them, and return the tip's velocity with theirs.

    ``motion`` is ``(mode, row, lane)``.
    """
    pushed = pack(own, (PUSHED, lane))
    for j in range(motion.shape[0]):
        before = pack(motion, (j, SPEED, lane)) + shared(modes, (j, PUSH), lane) * pushed
        place = pack(motion, (j, PLACE, lane))
        after = shared(modes, (j, KEEP), lane) * before + shared(modes, (j, PULL), lane) * place
        store(motion, (j, SPEED, lane), after)
        store(motion, (j, PLACE, lane), place + h * before)
        velocity += after
    return velocity


@inlined
def swing_heated(modes: Array, h: float, motion: Array, own: Array, velocity: Pack, lane: Lane) -> Pack:
    """Step the mechanical modes where heat was taken in, and return the tip's velocity with theirs."""
    pushed, heat = pack(own, (PUSHED, lane)), pack(own, (HEAT, lane))
    for j in range(motion.shape[0]):
        before = pack(motion, (j, SPEED, lane)) + shared(modes, (j, PUSH), lane) * pushed
        before += shared(modes, (j, HEAT_PUSH), lane) * heat
        place = pack(motion, (j, PLACE, lane)) + shared(modes, (j, HEAT_SHIFT), lane) * heat
        after = shared(modes, (j, KEEP), lane) * before + shared(modes, (j, PULL), lane) * place
        store(motion, (j, SPEED, lane), after)
        store(motion, (j, PLACE, lane), place + h * before)
        velocity += after
    return velocity


@inlined
def conduct(heat_modes: Array, tau: Array, velocity: Pack, temperature: Pack, lane: Lane) -> tuple[Pack, Pack]:
    """Step the thermal modes, and return velocity and temperature of the tip with theirs.

    ``tau`` is ``(thermal mode, lane)``.
    """
    for k in range(tau.shape[0]):
        after = shared(heat_modes, (k, DECAY), lane) * pack(tau, (k, lane))
        store(tau, (k, lane), after)
        velocity += shared(heat_modes, (k, DRAG), lane) * after
        temperature += after
    return velocity, temperature


@inlined
def conduct_heated(
    heat_modes: Array, tau: Array, own: Array, velocity: Pack, temperature: Pack, lane: Lane
) -> tuple[Pack, Pack]:
    """Step the thermal modes where heat was taken in, and return velocity and temperature of the tip with theirs."""
    heat = pack(own, (HEAT, lane))
    for k in range(tau.shape[0]):
        before = pack(tau, (k, lane)) + shared(heat_modes, (k, WARM), lane) * heat
        after = shared(heat_modes, (k, DECAY), lane) * before
        store(tau, (k, lane), after)
        velocity += shared(heat_modes, (k, DRAG), lane) * after
        temperature += after
    return velocity, temperature


@part
def moves_by_itself(own: Array, lanes: int) -> bool:
    """Tell whether some lane has a known part of its motion, by heating or by what surrounds it."""
    known = False
    for lane in range(lanes):
        known |= own[DRIFT, lane] != 0.0 or own[WARMTH, lane] != 0.0 or own[WARMING, lane] != 0.0
    return known


@inlined
def _pull_pairs(operator: Coefficients, tau: Array, motion: Array, velocity: Pack, lane: Lane) -> Pack:
    """Add what thermal modes do to mechanical modes near resonance with them; return the tip's velocity with it."""
    for pair in range(operator.pair_mode.size):
        j, k = operator.pair_mode[pair], operator.pair_heat[pair]
        pull = shared(operator.pair_pull, (pair,), lane) * pack(tau, (k, lane))
        store(motion, (j, SPEED, lane), pack(motion, (j, SPEED, lane)) + pull)
        velocity += pull
    return velocity


@inlined
def step_freely(
    operator: Coefficients,
    known: bool,
    t: float,
    h: float,
    own: Array,
    motion: Array,
    tau: Array,
    tau_paired: Array,
    lane: Lane,
) -> tuple[Pack, Pack]:
    """Step all modes to t; return velocity and temperature of the tip there without load and contact.

    They take in the impulse and heat of the step before; in most steps there is no heat in any lane.
    ``known`` is what :func:`moves_by_itself` told, ``tau_paired`` the τ that pulls at modes near resonance.
    """
    velocity, temperature = spread(0.0, lane), spread(0.0, lane)
    if tau.shape[0] == 0:
        return swing(operator.modes, h, motion, own, velocity, lane), temperature
    if known:
        velocity += pack(own, (DRIFT, lane))
        temperature = pack(own, (WARMTH, lane)) + pack(own, (WARMING, lane)) * t
    if raised(own, (PRESSED, lane)):
        velocity, temperature = conduct_heated(operator.heat_modes, tau, own, velocity, temperature, lane)
        velocity = swing_heated(operator.modes, h, motion, own, velocity, lane)
    else:
        velocity, temperature = conduct(operator.heat_modes, tau, velocity, temperature, lane)
        velocity = swing(operator.modes, h, motion, own, velocity, lane)
    if operator.pair_mode.size > 0:
        velocity = _pull_pairs(operator, tau_paired, motion, velocity, lane)
    return velocity, temperature


@part
def take_heat(heat_modes: Array, tau: Array, own: Array, warmed: Array, lanes: int) -> None:
    """Give τ with the heat of the last step, which :func:`conduct` leaves to the next one."""
    for k in range(tau.shape[0]):
        for lane in range(lanes):
            warmed[k, lane] = tau[k, lane] + heat_modes[k, WARM] * own[HEAT, lane]
