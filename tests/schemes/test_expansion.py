"""Bounds of an expansion: the signal of oscillating, decaying, driven and growing parts lies within them."""

from typing import NamedTuple

import numpy as np
import pytest
from bare_motion import add_decay, bare_motion

from workflow.kernels import Array
from workflow.kernels.compiled import kernel
from workflow.schemes._exact.expansion import accumulate, bounds, expand
from workflow.schemes._exact.motion import Motion
from workflow.schemes._exact.tables import block, seen, seen_wave, state, wave


@kernel
def _bound(m: Motion, k: int, h: float, found: Array) -> None:
    expand(m, m.now, 0.0)
    accumulate(m)
    s = bounds(m, k, h)
    found[0], found[1], found[2], found[3] = s.d0, s.d1, s.d2, s.d3
    found[4], found[5], found[6] = s.fourth, s.tail, s.tail_slope


class Parts(NamedTuple):
    """Σ (p η + q η') of blocks η'' + c η' + ω² η = 0, and a decay and a wave of unit size."""

    c: Array
    omega: Array
    p: Array
    q: Array
    eta: Array
    rate: Array
    mu: float
    turn: float

    def at(self, t: Array) -> Array:
        """Return the signal and its rate, ``(2, time)``."""
        s = -self.c / 2 + np.sqrt(self.c**2 / 4 - self.omega**2 + 0j)
        other = -self.c - s
        a = (self.rate - other * self.eta) / (s - other)
        b = self.eta - a
        e, f = a * np.exp(np.outer(t, s)), b * np.exp(np.outer(t, other))
        eta, rate, bend = e + f, e * s + f * other, e * s**2 + f * other**2
        slow = np.array([np.exp(-self.mu * t), -self.mu * np.exp(-self.mu * t)])
        wave = np.array([np.cos(self.turn * t), -self.turn * np.sin(self.turn * t)])
        fast = np.array([eta @ self.p + rate @ self.q, rate @ self.p + bend @ self.q])
        return np.asarray(slow + wave + fast.real)


def bounded(parts: Parts, k: int, h: float) -> Array:
    """Return the bounds over a step with ``k`` blocks expanded."""
    n, found = parts.c.size, np.zeros(7)
    m = bare_motion(n, firsts=1, waves=1, growth=max(0.0, -parts.c.min(), -parts.mu))
    b, y = m.block[:, :n], m.now[:, :n]
    b[block.DAMPING], b[block.OMEGA], b[block.STIFFNESS] = parts.c, parts.omega, parts.omega**2
    b[block.INVERSE_OMEGA] = 1 / parts.omega
    b[m.rows + seen.SIGNAL_VALUE], b[m.rows + seen.SIGNAL_SLOPE] = parts.p, parts.q
    y[state.VALUE], y[state.SLOPE] = parts.eta, parts.rate
    add_decay(m, 1.0, parts.mu)
    m.waves[0, : wave.TIME], m.waves[0, m.columns :] = 0.0, 0.0
    m.waves[0, wave.OMEGA], m.waves[0, m.columns + seen_wave.SIGNAL_COS] = parts.turn, 1.0
    _bound(m, k, h, found)
    return found


@pytest.mark.parametrize("damping", [0.0, 0.3, -0.3])
def test_the_signal_lies_within_its_bounds(damping: float) -> None:
    """And so does its rate, however many blocks are expanded; without damping bounds are larger by √2 at most."""
    rng, tau = np.random.default_rng(0), np.linspace(0.0, 1.0, 400)
    for _ in range(60):
        omega = np.sort(10 ** rng.uniform(-1, 2, 3))
        parts = Parts(damping * omega, omega, *rng.normal(size=(4, 3)), rng.normal(), rng.uniform(0, 3))
        amplitude = np.hypot(omega * parts.eta, parts.rate) * np.hypot(parts.p / omega, parts.q)
        for k in range(4):
            h = 10 ** rng.uniform(-2, 0.5)
            *d, fourth, tail, tail_slope = bounded(parts, k, h)
            signal, rate = parts.at(h * tau)
            beside = np.abs(signal - np.polynomial.polynomial.polyval(tau, d))
            assert np.all(beside <= (fourth * tau**4 + tail) * (1 + 1e-9) + 1e-12 * np.abs(signal).max())
            beside = np.abs(h * rate - np.polynomial.polynomial.polyval(tau, [d[1], 2 * d[2], 3 * d[3]]))
            assert np.all(beside <= (4 * fourth * tau**3 + tail_slope) * (1 + 1e-9) + 1e-9 * np.abs(h * rate).max())
            if damping == 0.0 and parts.mu > 0.0:
                most = np.sqrt(2) * (omega**4 * amplitude)[:k].sum() + parts.turn**4 + parts.mu**4
                assert fourth <= 1.001 * most * h**4 / 24
                assert tail <= 1.001 * amplitude[k:].sum()
                assert tail_slope <= 1.001 * h * (omega * amplitude)[k:].sum()
