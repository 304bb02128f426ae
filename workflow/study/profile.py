"""A casing's profile, its gap at angles around it, as the mean and the fewest harmonics that follow it."""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.models import Array, UnusableMatricesError
from workflow.models.modes import read_table
from workflow.study.mistakes import wrong
from workflow.study.settings import Casing, CasingHarmonic

COLUMNS = (("angle", "deg"), ("gap", "m"))
MOST_ANGLES = 100_000

LARGEST = 1e6
"""Of gaps, m, and of angles, deg: those of no casing."""

MOST_ORDERS = 32
REMAINDER = 1e-3
"""Largest deviation of the harmonics from the profile, over its range."""

_OFF = 1e-2
"""Accepted deviation of an angle from equal steps, in steps: angles as they are printed."""


def casing_of(given: dict[str, Any]) -> Casing:
    """Return the casing of a scene; a profile becomes its gap, and harmonics after those by a frequency."""
    profile, listed = given.get("profile"), given.get("harmonics", ())
    if profile is None:
        if "gap" not in given:
            raise wrong("is missing", "write it: tip clearance at rest, cold [m]; or `profile`", "gap")
        return Casing(**given)
    if "gap" in given or any(entry.order is not None for entry in listed):
        beside = "`gap`" if "gap" in given else "harmonics by `order`"
        raise wrong(f"stands beside {beside}, which it replaces", "keep one of the two", "profile")
    try:
        mean, harmonics = harmonics_of(*read_table(profile, COLUMNS, MOST_ANGLES).T)
    except UnusableMatricesError as error:
        raise wrong(error.problem, error.remedy, "profile") from None
    return Casing(**given | {"gap": mean, "harmonics": (*listed, *harmonics)})


def harmonics_of(angle: Array, gap: Array) -> tuple[float, tuple[CasingHarmonic, ...]]:
    """Return the mean of gaps at equally spaced angles [deg], and harmonics in the order of their orders.

    They are the largest of the discrete Fourier transform, as few as follow the gaps within :data:`REMAINDER`; numbers
    are rounded to 12 digits, as rounding differs between processors. Raises :class:`UnusableMatricesError` for too many
    of them, and for angles that are not equally spaced over a revolution.
    """
    if max(np.abs(gap).max(), np.abs(angle).max()) > LARGEST:
        raise UnusableMatricesError("it has a gap or an angle of more than 1e6", "write gaps in m, angles in deg")
    span = float(np.ptp(gap))
    if angle.size > 1 and abs(angle[-1] - angle[0] - 360) < _OFF * 360 / (angle.size - 1):
        if abs(gap[-1] - gap[0]) > REMAINDER * span:
            problem = f"the profile is {gap[0]:.6g} m at {angle[0]:g} deg and {gap[-1]:.6g} m at {angle[-1]:g} deg"
            raise UnusableMatricesError(problem, "write the same gap for both, which are one place")
        angle, gap = angle[:-1], gap[:-1]
    count = angle.size
    off = np.abs(angle - angle[0] - np.arange(count) * 360 / count) > _OFF * 360 / count
    if count < 3 or off.any():
        step = f"a multiple of {360 / count:g} deg from the first"
        at = f", and {angle[np.argmax(off)]:g} deg is not {step}" if off.any() else ""
        remedy = "interpolate it at 3 or more equally spaced angles from 0 to 360 deg"
        raise UnusableMatricesError(f"the profile has {count} angles{at}", remedy)
    orders = np.arange(1, (count + 1) // 2)  # that of count/2 has no phase
    shares = 2j / count * np.fft.rfft(gap)[orders] * np.exp(-1j * orders * np.radians(angle[0]))
    mean, radians, kept = float(f"{gap.mean():.12g}"), np.radians(angle), list[CasingHarmonic]()
    left, allowed = gap - mean, REMAINDER * span + 1e-11 * abs(mean)  # the mean has 12 digits
    for k in np.argsort(-np.abs(shares), kind="stable")[:MOST_ORDERS]:
        if np.abs(left).max() <= allowed:
            break
        amplitude, phase = float(f"{abs(shares[k]):.12g}"), round(float(np.angle(shares[k])), 12)
        kept.append(CasingHarmonic(amplitude, phase, order=float(orders[k])))
        left = left - amplitude * np.sin(orders[k] * radians + phase)
    if np.abs(left).max() > allowed:
        problem = f"{len(kept)} orders leave {np.abs(left).max() / span:.2g} of the range of the profile"
        raise UnusableMatricesError(problem, f"smooth it until {MOST_ORDERS} orders leave at most {REMAINDER:g}")
    return mean, tuple(sorted(kept, key=lambda one: one.order or 0.0))
