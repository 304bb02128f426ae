"""Impact of the tip by Newton's law for the gap, g'⁺ = -e g'⁻, and the choice of flight or contact after it."""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.kernels.compiled import part
from workflow.schemes._exact.accumulation import Bounces, end_of_chattering
from workflow.schemes._exact.expansion import SUM_ROUNDING, expand
from workflow.schemes._exact.layout import Case
from workflow.schemes._exact.passage import Motions, enter_contact
from workflow.schemes._exact.propagation import apply_impulse, copy_state
from workflow.schemes._exact.tables import expansion

_LOOSE = 1e3
"""Factor of the threshold of height once half the budget of events is spent: chattering up to 1e-7 of the displacement
scale is summed then, and the message of the case says so."""


@part
def impact(motions: Motions, case: Case, tally: Any) -> tuple[bool, float]:
    """Apply an impact at the speed ``tally.speed``; return whether the tip then stays in contact, and since when."""
    free, speed = motions.free, tally.speed
    p = (1.0 + case.e) * speed / case.mobility
    tally.max_speed = max(tally.max_speed, speed)
    apply_impulse(free, p)
    expand(free, free.now, tally.time)
    stays, since = speed <= 0.0 or case.e == 0.0, tally.time
    if not stays:
        end = _end_of_chattering(motions, case, tally)
        if not np.isnan(end):  # p and all later impulses add up to m v⁻ and the impulse of the contact force
            stays, since, p = True, end, speed / case.mobility
    if speed > 0.0:
        tally.impacts += 1
        tally.impulse += p
    return stays, since


@part
def _end_of_chattering(motions: Motions, case: Case, tally: Any) -> float:
    """Return the time at which the chattering after an impact ends, and stop the tip; NaN where it is not summed.

    It is summed where its flights are low and its impacts weak (:class:`~workflow.schemes._exact.layout.Thresholds`),
    and where they are more than the budget of events has left; then the end is infinite if the contact force falls
    before. Flights no higher than the rounding of the tip's displacement are low whatever the largest impact was: only
    the rounding of a force near zero has lifted the tip.
    """
    free, speed, thresholds = motions.free, tally.speed, case.thresholds
    pressing = -free.expansion.sums[expansion.D2, free.blocks]
    rounding = SUM_ROUNDING * free.expansion.sums[expansion.SIZE, 0]
    if speed >= thresholds.speed * tally.max_speed:
        tally.unsettled_speed = np.inf
        if speed * speed > 2.0 * pressing * rounding:
            return np.nan
    if speed >= tally.unsettled_speed or pressing <= 0.0:
        return np.nan
    left = case.budget.events - tally.events
    height, most = speed * speed / (2.0 * pressing), max(thresholds.height * tally.length, rounding)
    if height >= most and not (left < tally.events and height < _LOOSE * most):
        return np.nan
    copy_state(free.now, free.between)
    apply_impulse(free, -case.e * speed / case.mobility)
    end, leaving, count = np.nan, 0.0, 0.0
    if enter_contact(motions, thresholds.force, tally.time) == 0:
        bounces = Bounces(case.e, case.mobility, case.drag, 4.0 * max(height, most), case.duration)
        end, leaving, count = end_of_chattering(motions.held, tally.time, case.e * speed, bounces)
    else:  # the force is rounding, which would press the tip back for ever
        end = tally.time
    if height < most and np.isfinite(end):
        return end
    if count > left:
        tally.summed_speed, tally.summed_height = max(tally.summed_speed, speed), max(tally.summed_height, height)
        if end == np.inf:
            tally.leaving_speed = max(tally.leaving_speed, leaving)
        return end
    copy_state(free.between, free.now)
    tally.unsettled_speed = 0.5 * speed
    return np.nan
