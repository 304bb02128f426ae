"""Search by trial for the largest time step up to which a condition holds, and its text in messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import ROUND_FLOOR, Context, Decimal

_OCTAVES, _IN_OCTAVE = 40, 16
"""Steps are tried upwards from 2⁻⁴⁰ (1e-12) times the given one, sixteen to each doubling: 4 % apart."""

_RATIO = math.sqrt(math.sqrt(math.sqrt(math.sqrt(2.0))))

_HALVINGS = 40
"""Bisections of the last 4 %, after which the step is known to rounding."""


def largest_step(holds: Callable[[float], bool], h: float) -> float:
    """Return the largest step up to which ``holds`` is true, at most ``h``; 0 where it is false at the smallest one.

    Steps are products of ``h``, 2^(k/16) and powers of two, with the same bits on every processor.
    """
    good = 0.0
    for k in range(_IN_OCTAVE * _OCTAVES + 1):
        octave, within = divmod(k, _IN_OCTAVE)
        step = math.ldexp(h, octave - _OCTAVES)
        for _ in range(within):
            step *= _RATIO
        if not holds(step):
            return _between(holds, good, step) if good > 0 else 0.0
        good = step
    return good


def limit_text(limit: float, digits: int = 6) -> str:
    """Return a limit in some digits, rounded down, so that a step copied from a message is not above the limit."""
    if not math.isfinite(limit):
        return f"{limit:g}"
    return f"{float(Context(prec=digits, rounding=ROUND_FLOOR).plus(Decimal(limit))):.{digits}g}"


def _between(holds: Callable[[float], bool], good: float, bad: float) -> float:
    """Bisect two steps for the largest one at which ``holds`` is true."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good
