"""Contact by a spring and a damper in a step of the θ-method, with an implicit force at the step's end.

The impulse of a step is p = h (θ λ' + (1-θ) λ), both forces by the law λ = max(0, κ (x_n - d) + c v_n) where
x_n > d. With the tip at (x_a, v_a) for λ' = 0 there are two branches:

    apart      λ' = 0,                                            consistent where x_a <= d or λ' below is not > 0
    in contact λ' = (κ (x_a - d) + c v_a) / (1 + hθW (hθκ + c)),  consistent where then x_n' > d

The force jumps by c v_n at the casing: where neither is consistent (the damper alone would push the
tip out again) λ' is what puts the tip on the casing, between the two.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels.compiled import defines
from workflow.kernels.packs import Lane, Pack, of_lane, pack, some, some_nonzero, spread, store, weighed, where
from workflow.models import Array, Cases, Structure, mechanical_modes
from workflow.schemes._fixed import case_row, contact, tip_row
from workflow.schemes._fixed.contact import Contact, End, Free, TipStep
from workflow.schemes._fixed.drive import casing_place, gap_before, relative, relative_before, tip_after, tip_before
from workflow.schemes._fixed.marches import kernels_of

KERNELS = kernels_of(__name__)

_TIMES_STATIC = 10.0
"""The default κ in static stiffnesses of the tip: it yields a tenth of what the structure does."""


class Spring(NamedTuple):
    """A contact spring κ [N/m] and damper c [N s/m] in a step; each number may be one of each case, ``(case,)``."""

    stiffness: Array | float
    damping: Array | float
    delassus: Array | float
    """W, 1/kg."""
    share: Array | float
    """1 / (1 + hθW (hθκ + c)), NaN where that is not > 0."""
    to_casing: Array | float
    """Force per depth that puts the tip on the casing, 1/(h²θ²W), N/m, infinite where no force does."""


@defines(contact.meet, Spring)
def meet_spring(law: Spring, step: TipStep, free: Free, own: Array, tip: Array, lane: Lane) -> End:
    """Return the tip at the step's end."""
    h, theta = step.h, step.theta
    x, v = tip_before(free.drive, tip, lane)
    w, held = of_lane(law.delassus, lane), pack(own, (case_row.LAST, lane))
    begun = h * (1.0 - theta) * held
    apart = relative(free.drive, free.velocity + step.inverse_mass * free.impulse - w * begun, lane)
    depth = x + h * weighed(theta, apart, step.rest, v) - casing_place(free.drive, free.gap, lane)
    force = (of_lane(law.stiffness, lane) * depth + of_lane(law.damping, lane) * apart) * of_lane(law.share, lane)
    most = depth * of_lane(law.to_casing, lane)
    force = where(force > most, most, force)
    force = where(depth > 0.0, force, 0.0)
    force = where(force <= 0.0, 0.0, force)  # a NaN passes
    p = begun + h * theta * force
    after = apart - w * (h * theta * force)
    store(own, (case_row.IMPULSE, lane), free.impulse - p)
    pressed = some_nonzero(p) or some_nonzero(force)  # with θ = 0 a force acts from the next step on
    engaged = pressed or contact.was_pressed(own, lane)
    if engaged:
        touches, touched = force > 0.0, held > 0.0
        store(own, (case_row.LAST, lane), force)
        contact.press(pressed, p, own, lane)
        contact.count_rebounds(touches & ~touched, touched & ~touches, v, after, own, lane)
    temperature = free.temperature + step.warming * pack(own, (case_row.HEAT, lane))
    x, v = tip_after(free.drive, x + h * weighed(theta, after, step.rest, v), after, free.gap, lane)
    return End(engaged, x, v, temperature, p)


@defines(contact.contact_gain, Spring)
def _spring_gain(
    law: Spring, step: TipStep, end: End, change: Pack, free: Free, own: Array, tip: Array, lane: Lane
) -> Pack:
    """Return Δ(κ δ²/2) - h κ δ_θ (v + v')/2 with the depths δ, 0 where the tip is not beyond the casing.

    Velocities are relative to the casing where that moves.
    """
    drive = free.drive
    begins = pack(tip, (tip_row.DISPLACEMENT, lane)) - gap_before(drive, free.gap, lane)
    ended = end.displacement - free.gap
    if not (some(begins > 0.0) or some(ended > 0.0)):
        return spread(0.0, lane)
    before, after = where(begins > 0.0, begins, 0.0), where(ended > 0.0, ended, 0.0)
    speeds = relative_before(drive, pack(tip, (tip_row.VELOCITY, lane)), lane) + relative(drive, end.velocity, lane)
    worked = (step.theta * after + (1.0 - step.theta) * before) * (0.5 * step.h * speeds)
    return of_lane(law.stiffness, lane) * (0.5 * (after * after - before * before) - worked)


def default_stiffness(structure: Structure) -> float:
    """Return ten times the static stiffness of the tip against its rigid motion, N/m.

    Raises
    ------
    ValueError
        The structure is a free mass.
    """
    modes = mechanical_modes(structure)
    elastic = modes.values > 0
    flexibility = np.sum((modes.tip[elastic] / modes.values[elastic]) ** 2)
    if flexibility == 0:
        raise ValueError("a free mass has no stiffness to take ten times of; give the scheme's `stiffness` in N/m")
    return _TIMES_STATIC / flexibility


def by_spring(theta: float, stiffness: float, damping: float) -> Contact:
    """Return the contact by a spring κ [N/m] and a damper c [N s/m] in steps of the θ-method."""

    def factor(h: float, w: Any) -> Any:
        return 1 + h * theta * w * (h * theta * stiffness + damping)

    def law(h: float, cases: Cases, w: Array) -> Spring:
        reach = h * h * theta * theta * w
        reach = np.where(reach > 0, 1 / np.where(reach > 0, reach, 1.0), np.inf)
        return Spring(stiffness, damping, w, contact.inverse_or_nan(factor(h, w)), reach)

    return Contact(KERNELS, law, factor, "1 + hθW (hθκ + c)", rebounds=True, judges_heat=False)
