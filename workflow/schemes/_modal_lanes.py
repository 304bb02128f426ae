"""Free motion of all modes of a block of lanes in one step: what a θ-method does between contacts.

The kernel runs over time, in a step over groups of modes, in a group over lanes, and innermost
over the few modes of a group, whose number is a constant: the compiler writes that loop out and
steps eight lanes of all modes of the group at once, the sums over modes staying in registers.
For that to work, and for calls within a step to cost nothing,

- the number of lanes in a row of memory is asserted, see :mod:`workflow.schemes._lanes`, and so
  are the rows of a group: coefficients of unknown shape cost a comparison of addresses each;
- functions called in every step are inlined and count no references to arrays.

Sums over modes go on from group to group, in the same order for every lane.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.schemes._kernel import inlined, kernel
from workflow.schemes._lanes import ROW
from workflow.schemes._stepping import NEW_TEMPERATURE, NEW_VELOCITY

MODES, HEAT_MODES = 4, 7
"""Mechanical and thermal modes of a group, stepped in one loop over the lanes: as many as the
registers of a processor hold coefficients of. Modes are padded with zeros to whole groups."""

KEEP, PULL, PUSH, HEAT_PUSH, HEAT_SHIFT = range(5)
"""Coefficients of a mechanical mode: ζ' per ζ and per ξ (a and b of ``_modal_march``), ζ per unit
impulse and per unit heat at the tip, ξ per unit heat."""

DECAY, WARM, DRAG = range(3)
"""Coefficients of a thermal mode, scaled to add its τ to the tip's temperature: τ' per τ, τ per unit
heat at the tip, and what the mode adds to the tip's velocity."""

RESTITUTION, ALPHA, DELASSUS, COMPLIANCE, DRIFT, WARMTH, WARMING, PUSHED, HEAT = range(9)
"""Rows of the lanes' own values: e, α, W, 1/W (NaN where W <= 0, so that contact ends the case), the
known part of the motion (:class:`~workflow.schemes._decoupled.Motion`), and what the tip took in
the last step: the impulse of load and contact, and the heat."""

OWN_ROWS = HEAT + 1


class Coefficients(NamedTuple):
    """One free step and one unit impulse in modal coordinates; the kernel's view of an operator."""

    modes: Array
    """``(group, coefficient, mode of the group)``."""
    heat_modes: Array
    """``(group, coefficient, thermal mode of the group)``."""
    pair_mode: NDArray[np.int64]
    pair_heat: NDArray[np.int64]
    pair_pull: Array
    """ζ' of a mode per τ of a thermal mode near resonance with it, ``(pair,)``."""
    inverse_mass: float
    """Tip velocity per unit impulse, e_nᵀ Ŵ⁻¹ e_n."""
    warming: float
    """Tip temperature per unit heat."""
    theta: float


def grouped(size: int, *rows: Array) -> Array:
    """Return ``(mode, …)`` arrays as ``(group, row, mode of the group, …)``, zero where no mode is."""
    count = rows[0].shape[0]
    padded = np.zeros((len(rows), -(-count // size) * size, *rows[0].shape[1:]))
    for k, row in enumerate(rows):
        padded[k, :count] = row
    return np.ascontiguousarray(padded.reshape(len(rows), -1, size, *rows[0].shape[1:]).swapaxes(0, 1))


@inlined
def swing(modes: Array, h: float, motion: Array, own: Array, tip: Array, lanes: int) -> None:
    """Step the mechanical modes where there is no heat, and set the tip's new velocity.

    ``motion`` is ``(group, row, lane)``: rows ζ of the group's modes, then rows ξ.
    """
    assert modes.shape[1] == HEAT_SHIFT + 1
    assert modes.shape[2] == MODES
    assert motion.shape[1] == 2 * MODES
    assert motion.shape[2] == ROW
    assert own.shape[1] == ROW
    assert tip.shape[1] == ROW
    for g in range(motion.shape[0]):
        for lane in range(lanes):
            pushed = own[PUSHED, lane]
            velocity = tip[NEW_VELOCITY, lane] if g > 0 else 0.0
            for j in range(MODES):
                before = motion[g, j, lane] + modes[g, PUSH, j] * pushed
                place = motion[g, MODES + j, lane]
                after = modes[g, KEEP, j] * before + modes[g, PULL, j] * place
                motion[g, j, lane] = after
                motion[g, MODES + j, lane] = place + h * before
                velocity += after
            tip[NEW_VELOCITY, lane] = velocity


@inlined
def swing_heated(modes: Array, h: float, motion: Array, own: Array, tip: Array, lanes: int) -> None:
    """Step the mechanical modes where heat acts on them, and add to the tip's new velocity."""
    assert modes.shape[1] == HEAT_SHIFT + 1
    assert modes.shape[2] == MODES
    assert motion.shape[1] == 2 * MODES
    assert motion.shape[2] == ROW
    assert own.shape[1] == ROW
    assert tip.shape[1] == ROW
    for g in range(motion.shape[0]):
        for lane in range(lanes):
            pushed, heat = own[PUSHED, lane], own[HEAT, lane]
            velocity = tip[NEW_VELOCITY, lane]
            for j in range(MODES):
                before = motion[g, j, lane] + modes[g, PUSH, j] * pushed + modes[g, HEAT_PUSH, j] * heat
                place = motion[g, MODES + j, lane] + modes[g, HEAT_SHIFT, j] * heat
                after = modes[g, KEEP, j] * before + modes[g, PULL, j] * place
                motion[g, j, lane] = after
                motion[g, MODES + j, lane] = place + h * before
                velocity += after
            tip[NEW_VELOCITY, lane] = velocity


@inlined
def conduct(t: float, heat_modes: Array, tau: Array, own: Array, tip: Array, lanes: int) -> None:
    """Step the thermal modes, and set the tip's new velocity and temperature to theirs and the known part at t.

    ``tau`` is ``(group, mode of the group, lane)``.
    """
    assert heat_modes.shape[1] == DRAG + 1
    assert heat_modes.shape[2] == HEAT_MODES
    assert tau.shape[1] == HEAT_MODES
    assert tau.shape[2] == ROW
    assert own.shape[1] == ROW
    assert tip.shape[1] == ROW
    for g in range(tau.shape[0]):
        for lane in range(lanes):
            heat = own[HEAT, lane]
            velocity = tip[NEW_VELOCITY, lane] if g > 0 else own[DRIFT, lane]
            temperature = tip[NEW_TEMPERATURE, lane] if g > 0 else own[WARMTH, lane] + own[WARMING, lane] * t
            for k in range(HEAT_MODES):
                after = heat_modes[g, DECAY, k] * (tau[g, k, lane] + heat_modes[g, WARM, k] * heat)
                tau[g, k, lane] = after
                velocity += heat_modes[g, DRAG, k] * after
                temperature += after
            tip[NEW_VELOCITY, lane] = velocity
            tip[NEW_TEMPERATURE, lane] = temperature


@kernel
def take_heat(heat_modes: Array, tau: Array, own: Array, warmed: Array, lanes: int) -> None:
    """Give τ with the heat of the last step, which :func:`conduct` leaves to the next one."""
    for g in range(tau.shape[0]):
        for k in range(HEAT_MODES):
            for lane in range(lanes):
                warmed[g, k, lane] = tau[g, k, lane] + heat_modes[g, WARM, k] * own[HEAT, lane]


@kernel
def pull_pairs(operator: Coefficients, tau: Array, motion: Array, tip: Array, lanes: int) -> None:
    """Add what thermal modes do to mechanical modes near resonance with them."""
    for pair in range(operator.pair_mode.size):
        g, j = divmod(operator.pair_mode[pair], MODES)
        heat_g, k = divmod(operator.pair_heat[pair], HEAT_MODES)
        for lane in range(lanes):
            pull = operator.pair_pull[pair] * tau[heat_g, k, lane]
            motion[g, j, lane] += pull
            tip[NEW_VELOCITY, lane] += pull
