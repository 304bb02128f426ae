"""The two motions of a case, tip free and tip held, and the passage of the state from one to the other."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels.compiled import part
from workflow.models import Array
from workflow.schemes._exact.expansion import SUM_ROUNDING, expand
from workflow.schemes._exact.layout import Layout, Load, Memory
from workflow.schemes._exact.motion import Motion, prepare
from workflow.schemes._exact.response import casing_at, from_coordinates, to_coordinates
from workflow.schemes._exact.tables import expansion


class Passage(NamedTuple):
    """From the modes of the free tip to the coordinates of the held regime, and back, by the modes of the held tip."""

    inward: Array
    outward: Array
    entry: Array
    exit: Array
    """All see :class:`~workflow.schemes._exact.layout.Layout`, of the held regime."""
    modal: Array
    """[z, z', τ] of the held tip; scratch."""


class Motions(NamedTuple):
    """Both motions of a case."""

    free: Motion
    held: Motion
    passage: Passage
    modal: Array
    """[y, y', τ] of the free tip: where its blocks are its modes, the coordinates of its motion themselves."""
    mixes: bool
    """Whether its blocks mix its modes."""
    inward: Array
    outward: Array
    """From [y, y', τ] to the coordinates of the free motion and back, where they do."""


@part
def motions_of(free: Layout, held: Layout, load: Load, memories: tuple[Memory, Memory]) -> Any:
    """Return both motions of a case, their states not yet set."""
    own, other = memories
    return Motions(
        prepare(free, load, own),
        prepare(held, load, other),
        Passage(held.inward, held.outward, held.entry, held.exit, other.modal),
        own.mixed if free.mixes else own.coordinates,
        free.mixes,
        free.inward,
        free.outward,
    )


@part
def multiply(matrix: Array, source: Array, target: Array) -> None:
    """Fill target = source · matrix; rows and columns of states that do not act are not read."""
    for i in range(target.size):
        target[i] = 0.0
    for j in range(source.size):
        for i in range(target.size):
            target[i] += source[j] * matrix[j, i]


@part
def _change_modes(matrix: Array, casing: tuple[float, float], source: Array, target: Array) -> None:
    """Fill places and velocities of modes from those of the other tip and of the casing; thermal modes are the same."""
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
    """Fill [y, y', τ] with the present state of the motion with the tip held, or free."""
    free, bound, passage = motions.free, motions.held, motions.passage
    if held:
        to_coordinates(bound.r, bound.now, t, bound.coordinates)
        multiply(passage.outward, bound.coordinates, passage.modal)
        _change_modes(passage.exit, casing_at(bound.r, t), passage.modal, motions.modal)
    else:
        to_coordinates(free.r, free.now, t, free.coordinates)
        if motions.mixes:
            multiply(motions.outward, free.coordinates, motions.modal)


@part
def set_free(motions: Motions, t: float) -> None:
    """Set the free motion from [y, y', τ]."""
    free = motions.free
    if motions.mixes:
        multiply(motions.inward, motions.modal, free.coordinates)
    from_coordinates(free.r, free.coordinates, t, free.now)


@part
def set_held(motions: Motions, t: float) -> None:
    """Set the held motion from [y, y', τ]."""
    held, passage = motions.held, motions.passage
    _change_modes(passage.entry, casing_at(held.r, t), motions.modal, passage.modal)
    multiply(passage.inward, passage.modal, held.coordinates)
    from_coordinates(held.r, held.coordinates, t, held.now)


@part
def enter_contact(motions: Motions, threshold: float, t: float) -> int:
    """Set the held motion from the free one; return the order of the zero of its force at t, -1 where nothing presses.

    A force below ``threshold`` times the rounding of its terms is zero.
    """
    held = motions.held
    fill_modal(motions, False, t)
    set_held(motions, t)
    expand(held.r, held.now, t, held.expansion)
    force, rate = held.expansion.sums[expansion.D0, held.r.blocks], held.expansion.sums[expansion.D1, held.r.blocks]
    rounding = threshold * SUM_ROUNDING * held.expansion.sums[expansion.SIZE, 0]
    if force > rounding:
        return 0
    return 1 if force >= -rounding and rate > 0.0 else -1


@part
def release(motions: Motions, tally: Any) -> None:
    """End a contact: set the free motion from the held one."""
    fill_modal(motions, True, tally.time)
    set_free(motions, tally.time)
    tally.contact_time += max(0.0, tally.time - tally.contact_begin)
    tally.contact_begin, tally.held = np.inf, 0
    tally.releases += 1
