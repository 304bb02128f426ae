"""The end of a step of ``moreau``: contact at the tip by the prox at velocity level."""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Cases
from workflow.schemes._kernel import inlined
from workflow.schemes._lanes import ROW
from workflow.schemes._modal_lanes import ALPHA, COMPLIANCE, HEAT, OWN_ROWS, PUSHED, RESTITUTION
from workflow.schemes._stepping import (
    DISPLACEMENT,
    GAP,
    NEW_DISPLACEMENT,
    NEW_TEMPERATURE,
    NEW_VELOCITY,
    STEP_IMPULSE,
    VELOCITY,
    note,
    tip_load,
)


@inlined
def _meet(
    theta: float,
    inverse_mass: float,
    warming: float,
    h: float,
    pushed: float,
    own: Array,
    tip: Array,
    lane: int,
) -> tuple[float, float, float, float]:
    """Return displacement, velocity and temperature of the tip after a step, and the impulse p in it.

    After an impulse the velocity is -e v_n,k to the bit, not to the rounding of v_free - W p: a tip
    at rest on its casing keeps its place and stays active for any number of steps.
    """
    x, v = tip[DISPLACEMENT, lane], tip[VELOCITY, lane]
    free = tip[NEW_VELOCITY, lane] + inverse_mass * pushed
    closing = (free + own[RESTITUTION, lane] * v) * own[COMPLIANCE, lane]
    meets = x + 0.5 * h * v >= tip[GAP, lane] and not closing <= 0.0  # a NaN meets
    p = closing if meets else 0.0
    after = -own[RESTITUTION, lane] * v if meets else free
    own[PUSHED, lane] = pushed - p
    own[HEAT, lane] = own[ALPHA, lane] * p
    temperature = tip[NEW_TEMPERATURE, lane] + warming * own[HEAT, lane]
    return x + h * (theta * after + (1.0 - theta) * v), after, temperature, p


@inlined
def touch(
    theta: float,
    inverse_mass: float,
    warming: float,
    h: float,
    sine: float,
    own: Array,
    load: Array,
    tip: Array,
    lanes: int,
) -> None:
    """Close the step: load and contact impulse at the tip, from its free velocity to its new state."""
    assert own.shape[1] == ROW
    assert load.shape[1] == ROW
    assert tip.shape[1] == ROW
    for lane in range(lanes):
        pushed = h * tip_load(sine, load, lane)
        x, v, temperature, p = _meet(theta, inverse_mass, warming, h, pushed, own, tip, lane)
        tip[STEP_IMPULSE, lane] = p
        tip[NEW_VELOCITY, lane] = v
        tip[NEW_TEMPERATURE, lane] = temperature
        tip[NEW_DISPLACEMENT, lane] = x


@inlined
def touch_and_note(
    theta: float,
    inverse_mass: float,
    warming: float,
    h: float,
    sine: float,
    own: Array,
    load: Array,
    tip: Array,
    lanes: int,
) -> None:
    """Close a step in which nothing falls due: :func:`touch`, then ``observe``, in one pass."""
    assert own.shape[1] == ROW
    assert load.shape[1] == ROW
    assert tip.shape[1] == ROW
    for lane in range(lanes):
        pushed = h * tip_load(sine, load, lane)
        x, v, temperature, p = _meet(theta, inverse_mass, warming, h, pushed, own, tip, lane)
        note(h, x, v, temperature, p, tip, lane)


def contact_rows(cases: Cases, w: Array) -> Array:
    """Return what :func:`touch` reads of each case, ``(row, case)``; ``w`` is the Delassus operator, 1/kg."""
    rows = np.zeros((OWN_ROWS, cases.count))
    well_posed = ~(w <= 0)
    for row, values in (
        (RESTITUTION, cases.e),
        (ALPHA, cases.alpha),
        (COMPLIANCE, np.where(well_posed, 1 / np.where(well_posed, w, 1.0), np.nan)),
    ):
        rows[row] = values
    return rows
