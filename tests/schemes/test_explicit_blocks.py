"""Blocks that keep their force, against mpmath at the doubles given."""

from __future__ import annotations

from itertools import product

import mpmath as mp
import numpy as np
import pytest

from workflow.kernels.compiled import uncounted
from workflow.schemes._exact.explicit_blocks import advance_explicit
from workflow.schemes._exact.layout import Expansion
from workflow.schemes._exact.motion import Motion
from workflow.schemes._exact.tables import block, first, state, wave

SPAN = 0.01
"""Time over which blocks are advanced, s."""

RATES = [0.0, 1e-300, 1e-3, 1.0, 1e3, 1e6]
"""c, ω and Ω or μ, times that."""

SO_FAR = [1e-6, 1e-5, 1e-3, 1e-2, 0.1, 0.5, 0.8, 1.0]
"""Shares of the time at which the size of the motion so far is taken."""

NAMES = "value", "slope", "integral"


@uncounted
def advanced(m: Motion, y: np.ndarray, dt: float) -> tuple[float, float, float]:
    return advance_explicit(m, 0, y, 0.0, dt, 4)


def computed(c: float, w2: float, rate: float, motion: str) -> np.ndarray:
    """Return η, η' and ∫η dt of a block with loads or an initial value of 1, and all others 0."""
    b, y = np.zeros((block.ROWS + block.WAVE, 8)), np.zeros((state.ROWS, 8))
    f, waves = np.zeros((first.ROWS + first.WAVE, 8)), np.zeros((1, wave.COLUMNS))
    b[block.DAMPING, 0], b[block.STIFFNESS, 0] = c, w2
    waves[0, [wave.OMEGA, wave.TIME, wave.TIME_BEFORE]] = rate, np.nan, np.nan
    rows = {"force": [block.FORCE], "wave": [block.FORCE_COS, block.FORCE_SIN]}
    states = {"value": [state.VALUE], "slope": [state.SLOPE]}
    (b if motion in rows else y)[(rows | states)[motion], 0] = 1.0
    one, two = np.zeros(1), np.zeros((1, 1))
    tables = b, f, one, waves, np.zeros((9, 4), dtype=complex), Expansion(two, two, one, one)
    numbers = {"gap": 0.0, "growth": 0.0, "fastest": 0.0, "is_modal": False, "heated": False, "cooling": False}
    m = Motion(1, 0, 1, 0, *tables, y, y, y, y, one, one, inward=two, outward=two, **numbers)
    return np.array(advanced(m, y, SPAN))


def exact(c: float, w2: float, rate: float, motion: str) -> list[list[mp.mpf]]:
    """Return η, η' and ∫η dt at the shares of the time, by partial fractions whose poles are apart by a trifle."""
    scale = max(1.0, c, rate, w2**0.5)
    nothing, next_to, third = (scale * mp.mpf(10) ** -k for k in (400, 150, 160))
    root = mp.sqrt(mp.mpf(c) ** 2 / 4 - mp.mpf(w2) + third)
    p, q, a = -mp.mpf(c) / 2 + root, -mp.mpf(c) / 2 - root, rate * 1j + next_to
    value, slope = (mp.mpf(motion == name) for name in ("value", "slope"))
    forces = {
        "force": [(1, nothing)],
        "wave": [(1 - 1j, a)],  # the real part counts
    }.get(motion, [])
    terms = [(f / ((s - p) * (s - q)), s) for f, s in forces]
    value, slope = value - sum(f for f, _ in terms), slope - sum(f * s for f, s in terms)
    terms += [((slope - q * value) / (p - q), p), ((p * value - slope) / (p - q), q)]
    times = [share * mp.mpf(SPAN) for share in SO_FAR]
    waves = [[(f * mp.exp(s * t), f, s) for f, s in terms] for t in times]
    outputs = (lambda now, _, __: now), (lambda now, _, s: now * s), (lambda now, f, s: (now - f) / s)
    return [[sum(output(*term) for term in wave) for wave in waves] for output in outputs]


@pytest.mark.parametrize("motion", ["value", "slope", "force", "wave"])
def test_every_block_follows_every_force(motion: str) -> None:
    worst = {}
    with mp.workdps(1000):
        for c, w, rate in product(RATES, RATES, RATES if motion == "wave" else [0.0]):
            given = c / SPAN, (w / SPAN) ** 2, rate / SPAN
            allowed = 1e-12 + 4 * np.finfo(float).eps * max(w, rate if motion == "wave" else 0.0)
            for name, ours, truth in zip(NAMES, computed(*given, motion), exact(*given, motion), strict=True):
                size = max(1e-100, *(abs(value) for value in truth))  # the trifle leaves a rest of what is 0
                worst[c, w, rate, name] = float(abs(ours - mp.re(truth[-1])) / size) / allowed
    assert {rates: error for rates, error in worst.items() if not error <= 1.0} == {}
