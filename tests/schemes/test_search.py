"""Bounds of expansions, and searches in them: what they say is true of every signal within bounds, and due.

Each bound is a polynomial on (0, 1] one of whose Bernstein coefficients is all but zero, or negative.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest
from bare_motion import add_decay, bare_motion
from numpy.polynomial.polynomial import polyval
from scipy.interpolate import BPoly, PPoly

from workflow.kernels import Array
from workflow.kernels.compiled import kernel
from workflow.schemes._exact.expansion import accumulate, bounds, expand
from workflow.schemes._exact.motion import Motion
from workflow.schemes._exact.record import _bend, _peaks_at_an_end
from workflow.schemes._exact.step import _falls_through, longest_without_zero, zero_crossing
from workflow.schemes._exact.tables import block, expansion, seen, seen_wave, state, wave

TIMES = np.linspace(0.0, 1.0, 501)
EDGE = 1e-9
FAST = 1e4
"""ω of modes that are bounded as a group, 1/s."""
LOW = -1e3
"""A temperature below all others."""


class Found(NamedTuple):
    """Answers on (0, 1]."""

    without_zero: float
    falls: float
    zero: float
    end: float
    peaks_at_an_end: float
    bend: float


@kernel
def _search(m: Motion, zeros: int, level: float, found: Array) -> None:
    found[0], found[1] = longest_without_zero(m, zeros, 1.0, 1.0), zeros < 2 and _falls_through(m, zeros, 1.0)
    found[2], found[3] = zero_crossing(m, zeros, 1.0)
    found[4], found[5] = _peaks_at_an_end(m, 1.0, level), _bend(m, 1.0)


def searched(a: Array, zeros: int = 0, tail: float = 0.0, level: float = LOW, growth: float = 0.0) -> Found:
    """Search Σ a_n τ^n, n < 4, with a remainder up to |a_4| τ⁴ and fast modes whose magnitudes sum up to ``tail``.

    With ``growth`` half of the remainder's bound grows with τ, and all bounds e^growth-fold until τ = 1.
    """
    m, found, begun = bare_motion(int(tail > 0), growth=growth, cooling=tail == 0), np.zeros(6), np.exp(-growth)
    m.block[block.OMEGA], sums = FAST, m.expansion.sums
    fourth = (12.0 if growth > 0.0 else 24.0) * abs(a[4]) * begun
    sums[[expansion.D0, expansion.D1, expansion.D2, expansion.D3]] = (a[:4] * [1.0, 1.0, 2.0, 6.0])[:, None]
    sums[expansion.FOURTH], sums[expansion.FOURTH, -1] = fourth, fourth + FAST**4 * tail
    sums[expansion.FOURTH_GROWTH, 0] = fourth if growth > 0.0 else 0.0
    sums[expansion.TAIL, 0], sums[expansion.TAIL_SLOPE, 0] = tail * begun, FAST * tail * begun
    _search(m, zeros, level, found)
    return Found(*found)


def members(a: Array, tail: float) -> Array:
    """Return signals within the bounds, ``(signal, time)``, the lowest and the highest among them."""
    smooth = polyval(TIMES, [*a[:4], 0.0]) + np.linspace(-1.0, 1.0, 3)[:, None] * a[4] * TIMES**4
    fast = tail * np.sin(FAST * TIMES + np.arange(4)[:, None] * np.pi / 2)
    return np.asarray((smooth[:, None] + fast).reshape(-1, TIMES.size))


def lowest(size: int) -> Iterator[tuple[Array, Array]]:
    """Yield Bernstein coefficients and powers of lower bounds, whose last power is not positive."""
    rng, made = np.random.default_rng(size), 0
    while made < 200:
        b = rng.choice([EDGE, 1.0], size) * rng.uniform(1, 2, size)
        b[rng.integers(size)] = rng.choice([EDGE, -rng.uniform(0, 2)])
        powers = np.asarray(PPoly.from_bernstein_basis(BPoly(b[:, None], [0.0, 1.0])).c[::-1, 0])
        if powers[-1] <= 0.0:
            made += 1
            yield b, powers


def integrated(powers: Array) -> Array:
    """Return the integral of a polynomial, 1 at 0."""
    return np.append(1.0, powers / np.arange(1, powers.size + 1))


@pytest.mark.parametrize(("zeros", "tail"), [(0, 0.0), (0, 0.3), (1, 0.0), (2, 0.0), (3, 0.0)])
def test_a_step_without_a_zero(zeros: int, tail: float) -> None:
    """Of the lowest signal, its zero at 0 divided out."""
    for b, powers in lowest(5 - zeros):
        if b[0] > tail:
            a = np.append(np.zeros(zeros), powers)
            a[0] += tail
            h = searched(a, zeros, tail).without_zero
            assert polyval(h * TIMES, powers).min() > -1e-12
            assert h == 1.0 or b.min() < 0.0, b


@pytest.mark.parametrize("ends", [-1.0, -EDGE, EDGE])
@pytest.mark.parametrize(("zeros", "tail"), [(0, 0.0), (0, 1e-5), (1, 0.0)])
def test_a_step_with_one_zero(zeros: int, tail: float, ends: float) -> None:
    """Where the highest signal, its zero at 0 divided out, falls and ends below zero."""
    for b, rate in lowest(4 - zeros):
        q = -integrated(rate)
        q[1] -= FAST * tail
        q[0] += ends - q.sum()
        a = np.append(np.zeros(zeros), q)
        a[0] -= tail
        found = searched(a, zeros, tail)
        assert not found.falls or (ends < 0.0 and polyval(TIMES, rate).min() > -1e-12)
        assert found.falls or ends > 0.0 or b.min() < 0.0, b
        if found.end > 0.0:
            assert polyval(found.zero, a[zeros:4]) == pytest.approx(0.0, abs=1e-8)
            assert polyval(found.end * TIMES, rate).min() > -1e-12
            assert q[0] > 0.0 > polyval(found.end, q)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("tail", [0.0, 1e-5])
def test_a_peak_at_an_end(tail: float, sign: float) -> None:
    """Where the rate has one sign."""
    for b, rate in lowest(4):
        rate[0] += FAST * tail
        a = sign * integrated(rate)
        found, tops = searched(a, tail=tail, growth=1.0).peaks_at_an_end, members(a, tail)
        assert not found or np.all(tops.max(axis=1) <= np.maximum(tops[:, 0], tops[:, -1]) + 1e-8)
        assert found or b.min() < 0.0, b


@pytest.mark.parametrize("above", [EDGE, -0.1])
@pytest.mark.parametrize("tail", [0.0, 0.3])
def test_a_temperature_that_stays_below_a_level(tail: float, above: float) -> None:
    """Where the highest one does, which is above the level less the lower bounds."""
    for b, powers in lowest(5):
        level = above + tail - b.min()
        found, tops = searched(-powers, tail=tail, level=level, growth=1.0).peaks_at_an_end, members(-powers, tail)
        most = np.maximum(np.maximum(tops[:, 0], tops[:, -1]), level)
        assert not found or np.all(tops.max(axis=1) <= most + 1e-8)
        assert found or above < 0.0, b


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_bend_of_one_sign(sign: float) -> None:
    """Where the second derivative has one."""
    for b, second in lowest(3):
        bend = searched(sign * integrated(integrated(second)), growth=1.0).bend
        assert bend in (0, sign)
        assert bend == 0 or polyval(TIMES, second).min() > -1e-12
        assert bend == sign or b.min() < 0.0, b


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
