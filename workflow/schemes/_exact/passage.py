"""The two motions of a case, with the tip free and held, and the transition of the state between them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import part
from workflow.schemes._exact.expansion import SUM_ROUNDING, expand
from workflow.schemes._exact.layout import Case, Regime, Scratch, memory_of
from workflow.schemes._exact.motion import (
    Motion,
    casing_at,
    from_coordinates,
    jump_from_coordinates,
    prepare,
    to_coordinates,
)
from workflow.schemes._exact.tables import expansion


class Motions(NamedTuple):
    """Both motions of a case, and the transforms between their modes."""

    free: Motion
    held: Motion
    entry: Array
    exit: Array
    """Those of the held :class:`~workflow.schemes._exact.layout.Regime`."""


@part
def motions_of(free: Regime, held: Regime, case: Case, scratch: Scratch) -> Any:
    """Return both motions of a case, before their states are set."""
    memory = memory_of(free, case.acting, scratch.numbers[0], scratch.differences)
    other = memory_of(held, case.acting, scratch.numbers[1], scratch.differences)
    motions = Motions(prepare(free, case, memory), prepare(held, case, other), held.entry, held.exit)
    if free.is_modal:
        jump_from_coordinates(motions.free, case.jump, motions.free.jump)
    else:
        multiply(free.inward, case.jump[: memory.modal.size], memory.coordinates)
        jump_from_coordinates(motions.free, memory.coordinates, motions.free.jump)
    return motions


@part
def multiply(matrix: Array, source: Array, target: Array) -> None:
    """Fill target = source · matrix; rows and columns beyond the sizes of both are not read."""
    for i in range(target.size):
        target[i] = 0.0
    for j in range(source.size):
        for i in range(target.size):
            target[i] += source[j] * matrix[j, i]


@part
def _change_modes(matrix: Array, casing: tuple[float, float], source: Array, target: Array) -> None:
    """Fill displacements and velocities of modes from those of the other regime and the casing; copy thermal modes."""
    (place, speed), (source_modes, target_modes) = casing, (matrix.shape[0] - 1, matrix.shape[1])
    for i in range(target_modes):
        target[i], target[target_modes + i] = matrix[source_modes, i] * place, matrix[source_modes, i] * speed
    for j in range(source_modes):
        for i in range(target_modes):
            target[i] += source[j] * matrix[j, i]
            target[target_modes + i] += source[source_modes + j] * matrix[j, i]
    for i in range(2 * target_modes, target.size):
        target[i] = source[2 * source_modes - 2 * target_modes + i]


@part
def fill_modal(motions: Motions, held: bool, t: float) -> None:
    """Fill [y, y', τ] of the free tip from the current state of the held or the free motion."""
    if held:
        _fill(motions.held, t)
        _change_modes(motions.exit, casing_at(motions.held, t), motions.held.modal, motions.free.modal)
    else:
        _fill(motions.free, t)


@part
def _fill(m: Motion, t: float) -> None:
    """Fill [z, z', τ] of a motion from its current state."""
    to_coordinates(m, m.now, t, m.coordinates)
    if not m.is_modal:
        multiply(m.outward, m.coordinates, m.modal)


@part
def set_free(motions: Motions, t: float) -> None:
    """Set the free motion from [y, y', τ]."""
    _set(motions.free, t)


@part
def set_held(motions: Motions, t: float) -> None:
    """Set the held motion from [y, y', τ]."""
    held = motions.held
    _change_modes(motions.entry, casing_at(held, t), motions.free.modal, held.modal)
    _set(held, t)


@part
def _set(m: Motion, t: float) -> None:
    """Set a motion from its [z, z', τ]."""
    if not m.is_modal:
        multiply(m.inward, m.modal, m.coordinates)
    from_coordinates(m, m.coordinates, t, m.now)


@part
def enter_contact(motions: Motions, threshold: float, t: float) -> int:
    """Set the held motion from the free one; return the order of the zero of its contact force at t.

    Without a pressing force it is minus the order of the zero of the gap: -2, or -3 where the force falls from zero. A
    force below ``threshold`` times the rounding of its terms is zero.
    """
    held = motions.held
    fill_modal(motions, False, t)
    set_held(motions, t)
    expand(held, held.now, t)
    force, rate = held.expansion.sums[expansion.D0, held.blocks], held.expansion.sums[expansion.D1, held.blocks]
    rounding = threshold * SUM_ROUNDING * held.expansion.sums[expansion.SIZE, 0]
    if abs(force) > rounding:
        return 0 if force > 0.0 else -2
    return 1 if rate > 0.0 else -3


@part
def release(motions: Motions, tally: Any) -> None:
    """End a contact: set the free motion from the held one."""
    fill_modal(motions, True, tally.time)
    set_free(motions, tally.time)
    tally.contact_time += max(0.0, tally.time - tally.contact_begin)
    tally.contact_begin, tally.held = np.inf, 0
    tally.releases += 1
