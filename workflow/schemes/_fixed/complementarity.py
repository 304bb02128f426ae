"""Contact of a tip without mass in a step of the θ-method: complementarity of place and impulse at the step's end.

Nothing is thrown back that has no mass: there is no impact, and the restitution coefficient is not read. The impulse is
the least that keeps the tip from passing the casing,

    0 <= d - x_n,k+1  ⊥  p >= 0:   p = max(0, (x_free - d)/(hθW)),   x_free = x_n,k + h (θ v_free + (1-θ) v_n,k),

and a tip in contact is on the casing to the bit. Its contact takes energy, never gives any: the work -(p/h) (x_n,k+1 -
x_n,k) is not positive from a start outside the casing, so that the energy of unloaded cold motion does not grow for
θ >= 1/2. Newton's law at velocity level does not have this property without a mass at the tip.

Source: Monjaraz Tec, Gross, Krack, Computers & Structures 2022 (arXiv 2111.07693), whose step is explicit.
"""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels.compiled import defines
from workflow.kernels.packs import Lane, Pack, of_lane, pack, some, some_nonzero, spread, store, weighed, where
from workflow.models import Array, Cases
from workflow.schemes._fixed import case_row, contact, tip_row
from workflow.schemes._fixed.contact import Contact, End, Free, TipStep, press, was_pressed
from workflow.schemes._fixed.marches import kernels_of

KERNELS = kernels_of(__name__)


class Complementarity(NamedTuple):
    """What a tip is answered by that would end a step beyond the casing, per depth."""

    impulse: Array | float
    """1/(hθW), N s/m, ``(case,)`` or one for all; NaN where W <= 0, so that contact ends the case."""
    velocity: float
    """1/(hθ), 1/s."""


def by_place(theta: float) -> Contact:
    """Return the contact of a tip without mass in steps with θ > 0."""

    def law(h: float, cases: Cases, w: Array) -> Complementarity:
        return Complementarity(contact.inverse_or_nan(h * theta * w), 1 / (h * theta))

    return Contact(KERNELS, law, contact.delassus_alone, "W")


@defines(contact.meet, Complementarity)
def meet_by_place(law: Complementarity, step: TipStep, free: Free, own: Array, tip: Array, lane: Lane) -> End:
    """Return the tip at the step's end."""
    x, v, p = pack(tip, (tip_row.DISPLACEMENT, lane)), pack(tip, (tip_row.VELOCITY, lane)), spread(0.0, lane)
    after, temperature = free.velocity + step.inverse_mass * free.impulse, free.temperature
    moved = step.h * weighed(step.theta, after, step.rest, v)
    place, depth = x + moved, x - free.gap + moved
    place = where(place > free.gap, free.gap, place)
    engaged = some(depth > 0.0) or was_pressed(own, lane)
    if engaged:
        meets = depth > 0.0
        p = where(meets, depth * of_lane(law.impulse, lane), 0.0)
        after = where(meets, after - law.velocity * depth, after)
        temperature += step.warming * press(some_nonzero(p), p, own, lane)
    store(own, (case_row.IMPULSE, lane), free.impulse - p)
    return End(engaged, place, after, temperature, p)


@defines(contact.contact_gain, Complementarity)
def _static_gain(
    law: Complementarity, step: TipStep, end: End, change: Pack, free: Free, own: Array, tip: Array, lane: Lane
) -> Pack:
    """Return -(θ - 1/2) S Δv: without mass no impact changes the velocity, impulses work at v_θ as they act."""
    return (0.5 - step.theta) * (pack(own, (case_row.IMPULSE, lane)) * change)
