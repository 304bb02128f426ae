"""Outcome of a case, and its message."""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.schemes._exact.layout import Budget
from workflow.schemes._exact.regimes import INSEPARABLE
from workflow.schemes._interface import EXTRAPOLATED

COMPLETED = 0
OUT_OF_EVENTS = 1
OUT_OF_STEPS = 2
INSIDE_CASING = 3
NOT_FINITE = 4
RUNNING = 5
INVALID = 6  # a value of the case is not finite
NO_IMPACT_LAW = 7  # the tip meets its casing, and friction pushes it further in than the contact force pushes it out
INSEPARABLE_POLES = 8  # poles of the held tip cannot be separated, see :mod:`workflow.schemes._exact.regimes`

_NEARLY_ELASTIC = 0.99
"""Restitution above which the message on the budget of events states how many impacts it takes to come to rest."""


def failure(ended: int, tally: Any, budget: Budget, e: float) -> str:
    """Return the message of a case that did not complete; ``tally`` is an element of an array of ``record.TALLY``."""
    at = f"at t = {tally['time']:.6g} s" if np.isfinite(tally["time"]) else "in its first steps"
    speed = tally["speed"] if tally["impacts"] else 0.0
    return {
        INVALID: "a value of the case is not a finite number",
        OUT_OF_EVENTS: f"stopped {at} after {budget.events} contact events, its budget; "
        f"the last of {tally['impacts']} impacts had a speed of {speed:.3g} m/s; {_more_events(e)}",
        OUT_OF_STEPS: f"stopped {at} after {budget.steps} steps between contact events, its budget; "
        "raise the scheme's option `steps`",
        NO_IMPACT_LAW: f"contact has no unique solution {at} (W <= 0 as the step vanishes): friction pushes the tip "
        "into the casing more than the contact force pushes it out; lower the friction coefficient",
        INSEPARABLE_POLES: f"with the tip held, the damping of the structure {INSEPARABLE}",
        INSIDE_CASING: "the tip starts beyond the casing: x_n(0) > d",
        NOT_FINITE: f"the state left the finite numbers {at}",
    }[ended]


def extrapolation(tally: Any, budget: Budget) -> str:
    """Return the message of a case whose chattering was summed because it exceeds the budget of events."""
    leaves = (
        f"; while it does not rest it is in no contact, and it leaves with at most {tally['leaving_speed']:.3g} m/s"
    )
    return (
        f"{EXTRAPOLATED}impacts below {tally['summed_speed']:.3g} m/s, which lift the tip by at most "
        f"{tally['summed_height']:.3g} m, were summed up: till they end there are more than are left of the "
        f"{budget.events} of the option `events`" + (f"{leaves}, taken as 0" if tally["leaving_speed"] > 0 else "")
    )


def _more_events(e: float) -> str:
    """Return the advice for a case that has exhausted its budget of contact events."""
    if e == 1:
        return (
            "with e = 1 impacts of a pressed, damped tip follow each other ever faster without ever ending in contact: "
            "the scheme's option `events` does not help, lower e"
        )
    if e > _NEARLY_ELASTIC:
        return (
            f"with e = {e:.9g} the speed of a bouncing tip falls to 37 % in about {1 / (1 - e):.2g} impacts, and to "
            "rest it takes ten times as many and more: raise the scheme's option `events`, or lower e"
        )
    return "raise the scheme's option `events`"
