"""The end of a step of ``moreau``: contact at the tip by the prox at velocity level."""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Cases
from workflow.schemes._kernel import inlined
from workflow.schemes._marks import DISPLACEMENT, VELOCITY
from workflow.schemes._modal_lanes import ALPHA, COMPLIANCE, HEAT, OWN_ROWS, PRESSED, PUSHED, RESTITUTION
from workflow.schemes._packs import Lane, Pack, flag, pack, raised, some, some_nonzero, spread, store, weighed, where


@inlined
def meet(
    theta: float,
    rest: float | None,
    inverse_mass: float,
    warming: float,
    h: float,
    pushed: Pack,
    free: Pack,
    temperature: Pack,
    gap: Pack,
    own: Array,
    tip: Array,
    lane: Lane,
) -> tuple[bool, Pack, Pack, Pack, Pack]:
    """Close the step: return displacement, velocity and temperature of the tip at its end, and the impulse p in it.

    ``pushed`` is the load's impulse; ``free`` and ``temperature`` are of the tip without load and contact, ``gap``
    is the casing's place, ``rest`` 1 - θ, or ``None`` for θ = 1.
    What is returned first tells whether some lane may be in contact or was so before: else there is nothing
    to count. After an impulse the velocity is -e v_n,k to the bit, not to the rounding of v_free - W p: a tip
    at rest on its casing keeps its place and stays active for any number of steps.
    """
    x, v, p = pack(tip, (DISPLACEMENT, lane)), pack(tip, (VELOCITY, lane)), spread(0.0, lane)
    after = free + inverse_mass * pushed
    active = x + 0.5 * h * v >= gap
    engaged = some(active) or raised(own, (PRESSED, lane))
    if engaged:
        kept = pack(own, (RESTITUTION, lane)) * v
        closing = (after + kept) * pack(own, (COMPLIANCE, lane))
        meets = active & ~(closing <= 0.0)  # a NaN meets
        p = where(meets, closing, 0.0)
        after = where(meets, -kept, after)
        heat = pack(own, (ALPHA, lane)) * p
        store(own, (HEAT, lane), heat)
        flag(own, (PRESSED, lane), some_nonzero(p))
        temperature += warming * heat
    store(own, (PUSHED, lane), pushed - p)
    return engaged, x + h * weighed(theta, after, rest, v), after, temperature, p


def contact_rows(cases: Cases, w: Array) -> Array:
    """Return what :func:`meet` reads of each case, ``(row, case)``; ``w`` is the Delassus operator, 1/kg."""
    rows = np.zeros((OWN_ROWS, cases.count))
    well_posed = ~(w <= 0)
    for row, values in (
        (RESTITUTION, cases.e),
        (ALPHA, cases.alpha),
        (COMPLIANCE, np.where(well_posed, 1 / np.where(well_posed, w, 1.0), np.nan)),
    ):
        rows[row] = values
    return rows
