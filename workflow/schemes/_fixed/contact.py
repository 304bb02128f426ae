"""The tip at the end of a step: what a contact law is given, what it returns, and what its type decides.

A contact law is a named tuple of coefficients, each a number or an array ``(case,)`` that becomes ``(lane,)`` in a
block. Its type chooses, when a kernel is compiled, how the functions of this module are defined
(:func:`~workflow.kernels.compiled.defines`): for moreau's prox in :mod:`workflow.schemes.moreau`, for a force
linear in the tip's motion in :mod:`workflow.schemes._fixed.central`, for a spring at the step's end in
:mod:`workflow.schemes._fixed.spring`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import by_type, inlined
from workflow.kernels.packs import Lane, Mask, Pack, flag, pack, raised, some, spread, store, where
from workflow.models import Cases
from workflow.schemes._fixed import case_row

METRICS = {
    "effective_restitution": (
        "1",
        "speed of separation over speed of approach, least squares over all contacts that ended",
    )
}
"""What schemes without a restitution coefficient give beside the common metrics: unit and meaning."""

Law = Any
"""A contact law: a named tuple of numbers and arrays."""


class Kernels(NamedTuple):
    """Marches compiled for a contact law (:func:`workflow.schemes._fixed.marches.kernels_of`)."""

    modes: Callable[..., None]
    matrices: Callable[..., None]


@dataclass(frozen=True, eq=False)
class Contact:
    """How a scheme meets the casing, whatever a structure is stepped by.

    Attributes
    ----------
    kernels
        The scheme's own.
    law
        ``law(h, cases, w)``: the contact law of cases by the Delassus operator W of a step, 1/kg, ``(case,)`` or one
        for all.
    factor, name
        ``factor(h, w)``: what contact divides by, which has one solution where that is positive; how messages write it.
    rebounds
        Whether it gives the metric ``effective_restitution``.
    judges_heat
        Whether a free heat step that grows ends cases that carry no heat too (θ-method in modes, θ < 1/2).
    """

    kernels: Kernels
    law: Callable[[float, Cases, Any], Law]
    factor: Callable[[float, Any], Any]
    name: str
    rebounds: bool = False
    judges_heat: bool = True


def delassus_alone(h: float, w: Any) -> Any:
    """Return W, the factor of a contact that divides by nothing else."""
    return w


def inverse_or_nan(factor: Array) -> Array:
    """Return 1 over what contact divides by, NaN where that is not positive, so that contact ends the case."""
    return np.where(factor <= 0, np.nan, 1 / np.where(factor <= 0, 1.0, factor))


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

    Leaves in ``own`` the impulse of load and contact (``IMPULSE``), the friction heat α p (``HEAT``) and whether the
    heat may be other than 0 (``PRESSED``), all of which the modes' next step begins with.
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
def next_tip(law: Law, end: End, own: Array, lane: Lane) -> tuple[Pack, Pack]:
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
def press(pressed: bool, p: Pack, own: Array, lane: Lane) -> Pack:
    """Store the friction heat α p of an impulse, and whether the pack is in contact; return the heat, J."""
    heat = pack(own, (case_row.ALPHA, lane)) * p
    store(own, (case_row.HEAT, lane), heat)
    flag(own, (case_row.PRESSED, lane), pressed)
    return heat


@inlined
def was_pressed(own: Array, lane: Lane) -> bool:
    """Tell whether some lane of a pack was in contact in the last step."""
    return raised(own, (case_row.PRESSED, lane))


@inlined
def count_rebounds(begins: Mask, ended: Mask, before: Pack, after: Pack, own: Array, lane: Lane) -> None:
    """Add contacts that have ended to the sums of :func:`restitution`.

    ``before`` is the tip's velocity before contacts that begin, ``after`` that after contacts that have ended, m/s.
    """
    if not (some(begins) or some(ended)):
        return
    approach = where(begins, before, pack(own, (case_row.APPROACH, lane)))
    store(own, (case_row.APPROACH, lane), approach)
    store(
        own,
        (case_row.APPROACHED, lane),
        pack(own, (case_row.APPROACHED, lane)) + where(ended, approach * approach, 0.0),
    )
    store(own, (case_row.SEPARATED, lane), pack(own, (case_row.SEPARATED, lane)) - where(ended, approach * after, 0.0))
