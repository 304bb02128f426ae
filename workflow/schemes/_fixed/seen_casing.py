"""A moving casing as a step sees it: cases whose step makes a harmonic far faster than it is have diverged.

With the discrete velocity V of :mod:`workflow.schemes._fixed.drive` a harmonic of the casing moves |g|/ω times as fast
as it does, with y = ωh/2

    |g|/ω = |sin y| / (y √(cos² y + (2θ-1)² sin² y)),

1.27 at four steps to its period with θ = 1/2 and without bound at two: V then goes to and fro by any amount, the tip
falls through the casing while V says that it parts, or is hit at that velocity. With θ = 1, and central differences,
it is never above 1. No balance shows it: the casing does the work. A contact spring without a damper takes no velocity,
and with one little of it.
"""

from __future__ import annotations

import numpy as np

from workflow.schemes._fixed import tip_row
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.drive import WAVE_AMPLITUDE, WAVE_FREQUENCY, WAVE_SPEED_COSINE, WAVE_SPEED_SINE
from workflow.schemes._fixed.outcome import Outcome
from workflow.schemes._fixed.stable_steps import limit_text
from workflow.schemes._fixed.stepping import Watch
from workflow.schemes._interface import HISTORIES, Status

MOST = 5.0
"""|g|/ω above which a case has diverged: 2.2 steps to a period at θ = 1/2.

``python tests/grid/test_seen_casing.py`` steps 36 bars of 1 to 5 nodes on a casing that vibrates. Half of them go more
than 0.8 times as far as exactly where it is 3, than 1.5 times where it is 4.5, 2.7 where it is 6, 5.2 at 10."""

_NEGLIGIBLE_SPEED = 0.1
"""Share of the tip's largest speed up to which the velocity that a step adds to the casing counts for nothing."""

_STEPS = 4.0
"""Steps to a period that messages ask for."""


def with_casing_seen(watched: Watch, contact: Contact, outcome: Outcome) -> Outcome:
    """Return how cases ended, ``diverged`` where they touched a casing that their step makes too fast."""
    drive, h, tip = watched.drive, watched.h, watched.tip
    if not contact.takes_velocities or drive is None or drive.casing.shape[0] == 0:
        return outcome
    touched = (tip[tip_row.IMPACTS] > 0) | (tip[tip_row.PENETRATION] > 0)
    velocity = watched.record.histories[:, HISTORIES.index("velocity")]
    frequency = drive.casing[:, WAVE_FREQUENCY]
    true = 2 * np.pi * np.abs(drive.casing[:, WAVE_AMPLITUDE] * frequency)
    seen = np.sqrt(drive.casing[:, WAVE_SPEED_SINE] ** 2 + drive.casing[:, WAVE_SPEED_COSINE] ** 2)
    gain = np.where(true > 0, seen / np.where(true > 0, true, 1.0), 0.0)
    added = np.fmax(seen - true, 0.0).sum(axis=0)
    counts = added > _NEGLIGIBLE_SPEED * np.fmax.reduce(np.abs(velocity), axis=1)
    status, messages = outcome[0].copy(), dict(outcome[1])
    for case in np.flatnonzero((status == Status.OK) & touched & counts & (gain.max(axis=0) > MOST)).tolist():
        worst = int(np.argmax(gain[:, case]))
        times, hertz = float(gain[worst, case]), float(frequency[worst, case])
        status[case] = Status.DIVERGED
        messages[case] = (
            f"the step h = {h:.6g} s sees the casing's harmonic of {hertz:.6g} Hz move {times:.3g} times as fast as it "
            f"does, about two steps to its period; four take h = {limit_text(1 / (_STEPS * hertz))} s"
        )
    return status, messages
