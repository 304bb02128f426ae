"""The tip at the end of a step: what a contact law is given, what it returns, and what its type decides.

A contact law is a named tuple of coefficients, each a number or an array ``(case,)`` that becomes ``(lane,)`` in a
block. Its type chooses, when a kernel is compiled, how the functions of this module are defined
(:func:`~workflow.kernels.compiled.defines`): for moreau's prox in :mod:`workflow.schemes.moreau`, for a force
linear in the tip's motion in :mod:`workflow.schemes._fixed.central`, for a spring at the step's end in
:mod:`workflow.schemes._fixed.spring`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from workflow.kernels import Array
from workflow.kernels.compiled import by_type, inlined
from workflow.kernels.packs import Lane, Mask, Pack, pack, some, spread, store, where

CASE_ALPHA, CASE_DRIFT, CASE_WARMTH, CASE_WARMING = range(4)
"""Rows of a block's cases ``(row, lane)``: α [W/N] and the known part of the tip's motion
(:class:`~workflow.schemes._fixed.decoupled.Motion`)."""

CASE_IMPULSE, CASE_HEAT, CASE_PRESSED = range(4, 7)
"""Impulse of load less contact [N s] and friction heat [J] of the last step, and a flag of each pack that is raised
where some lane was in contact: elsewhere there is no heat."""

CASE_LAST, CASE_APPROACH, CASE_APPROACHED, CASE_SEPARATED = range(7, 11)
"""The last force or impulse of contact, the velocity before the present contact, and sums over contacts that have
ended of its square and of its product with the velocity after, (m/s)²."""

CASE_AHEAD, CASE_HALF, CASE_FIRST = range(11, 14)
"""Of central differences: x_n at the next step's end, the last half-step velocity, the first one without contact."""

CASE_FRICTION, CASE_SLID = range(14, 16)
"""Of a contact that slides: µ, and µ times the impulse of contact in the last step [N s]."""

CASE_ROWS = CASE_SLID + 1

Law = Any
"""A contact law: a named tuple of numbers and arrays."""


class Drive(NamedTuple):
    """Harmonics of the load and a casing that moves (:mod:`workflow.schemes._fixed.drive`), of all cases or a block.

    Kernels are given ``None`` in its place where a scene has neither.
    """

    load: Array
    """Harmonics of the load, ``(harmonic, row, lane)``."""
    casing: Array
    """Harmonics of the casing, ``(harmonic, row, lane)``."""
    state: Array
    """What they do in a step, ``(row, lane)``."""


class TipStep(NamedTuple):
    """A step as the tip feels it."""

    h: float
    theta: float
    """Weight of the step's end, in the load and in the tip's velocity."""
    rest: float
    """1 - θ, the weight of the step's beginning."""
    inverse_mass: float
    """Tip velocity per unit impulse, e_nᵀ Ŵ⁻¹ e_n, 1/kg."""
    warming: float
    """Tip temperature per unit heat, K/J."""


class Free(NamedTuple):
    """What a contact law is given: the tip at the step's end without load and contact, and what acts there."""

    velocity: Pack
    """m/s."""
    temperature: Pack
    """K."""
    impulse: Pack
    """Impulse of the load in the step, N s."""
    gap: Pack
    """Place of the casing at the step's end, m; at its beginning for central differences."""
    drive: Drive | None
    """The casing's motion, where it has one."""


class End(NamedTuple):
    """What a contact law returns: the tip at the step's end."""

    engaged: bool
    """Whether some lane may be in contact or was so before: else no count of contact changes."""
    displacement: Pack
    velocity: Pack
    temperature: Pack
    impulse: Pack
    """Impulse of contact in the step, N s, >= 0."""


@by_type
def meet(law: Law, step: TipStep, free: Free, own: Array, tip: Array, lane: Lane) -> End:
    """Close a step: return the tip at its end and the impulse of contact.

    Leaves in ``own`` the impulse of load and contact (``CASE_IMPULSE``), the friction heat α p (``CASE_HEAT``) and
    whether the heat may be other than 0 (``CASE_PRESSED``), all of which the modes' next step begins with.
    """
    raise NotImplementedError


@by_type
def steps_from_tip(law: Law) -> bool:
    """Tell whether :func:`meet` reads displacement and velocity of the tip at the step's beginning."""
    return True


@by_type
def driven(law: Law, step: TipStep, end: End, own: Array, lane: Lane) -> Pack:
    """Return the velocity that the contact law gives the tip at the end of a step, with which impulses do work, m/s."""
    return end.velocity


@by_type
def applied(law: Law, end: End, own: Array, lane: Lane) -> Pack:
    """Return the impulse of contact that acts in the next step of the modes, N s."""
    return end.impulse


@by_type
def leaves(law: Law, end: End, own: Array, lane: Lane) -> tuple[Pack, Pack]:
    """Return place and velocity of the tip with which the next step begins, where that keeps all states, m and m/s."""
    return end.displacement, end.velocity


@by_type
def contact_gain(
    law: Law, step: TipStep, end: End, change: Pack, free: Free, own: Array, tip: Array, lane: Lane
) -> Pack:
    """Return what the balance of a step takes for created, J, beside the work of its impulse at the mean velocity.

    Of a contact spring that is what it holds more than its force has taken. ``change`` is that of the tip's relative
    velocity; ``tip`` still holds the tip at the step's beginning.
    """
    return spread(0.0, lane)


@inlined
def count_rebounds(begins: Mask, ended: Mask, before: Pack, after: Pack, own: Array, lane: Lane) -> None:
    """Add contacts that have ended to the sums of :func:`restitution`.

    ``before`` is the tip's velocity before contacts that begin, ``after`` that after contacts that have ended, m/s.
    """
    if not (some(begins) or some(ended)):
        return
    approach = where(begins, before, pack(own, (CASE_APPROACH, lane)))
    store(own, (CASE_APPROACH, lane), approach)
    store(own, (CASE_APPROACHED, lane), pack(own, (CASE_APPROACHED, lane)) + where(ended, approach * approach, 0.0))
    store(own, (CASE_SEPARATED, lane), pack(own, (CASE_SEPARATED, lane)) - where(ended, approach * after, 0.0))
