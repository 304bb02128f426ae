"""Energy that contact gave the tip, which no casing gives.

Newton's law at velocity level stops a tip that moves into its casing or throws it back, v⁺ = -e v⁻, and takes energy
from it. A tip that leaves and is still inside half a step on meets the law too where forces would bring it back: its
impulse p then does the work p |v⁻| (1 - e)/2 > 0. In steps that follow all modes this is little, and the next contact
takes it; steps of several periods of the fastest mode throw a light tip far off. The energy balance counts it as the
work of contact and leaves rounding.

``contact_work`` is the most that the work of contact has ever been, what contacts took subtracted, over the largest
energy, at velocities relative to the casing, whose own work does not count. What the scheme itself took, a residual
below 0, is subtracted too: at θ = 1 it takes at once what contact gives. One step must have given much of it: little
that damping takes again adds up to any amount in a long run, which errs by no more than a short one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.schemes import Results

MOST = 0.75
"""What contact gave and the scheme left, over the largest energy, above which a case has diverged: four times the
energy that it should have.

``python tests/grid/test_energy_by_contact.py 200`` measures 200 random scenes in steps of 0.1 to 100 periods of the
fastest mode. Of cases with e < 1, in steps up to a tenth of their slow motion, that are off by more than ten times 14
stay ok (87 without this rule). Of 2762 that err by less than 0.3 none is taken. With
e = 1, where contact gives nothing, and in longer steps 1061 of 1135 stay ok."""

MOST_OF_A_STEP = 0.2
"""Work of contact in one step over the largest energy, up to which a case has not diverged: a damped motion over many
periods gets more than its largest energy from contact in all, little in each step, and hardly errs."""


def _contact_energy(results: Results) -> Array:
    """Return what contact gave and the scheme did not take, over the largest energy, 1, ``(case,)``."""
    assert results.contact_work is not None
    return np.asarray(results.contact_work[:, 0] + np.fmin(results.metrics["energy_residual"], 0.0))


def contact_gave_too_much(results: Results) -> NDArray[np.bool_]:
    """Return which cases have diverged as contact gave them their energy, ``(case,)``; none without balances."""
    if results.contact_work is None:
        return np.zeros(results.status.size, dtype=bool)
    return np.asarray((_contact_energy(results) > MOST) & (results.contact_work[:, 1] > MOST_OF_A_STEP))


def contact_work_text(results: Results, case: int, h: float) -> str:
    """Return what happened to a case that was stepped with h, s."""
    gave = _contact_energy(results)[case]
    return (
        f"energy was created: contact gave {gave:.3g} times the largest energy, above {MOST:g}, where "
        f"a casing gives none: in a step of h = {h:.6g} s a tip that leaves is still inside; take a smaller h"
    )
