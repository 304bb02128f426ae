"""Contact events: an impact by Newton's law for the gap, g'⁺ = -e g'⁻, the beginning of a contact, and its end.

At the end of chattering (a Zeno sequence: infinitely many impacts in a finite time) the tip comes to rest. A tip that
is pressed on its casing bounces with flights so short that the rest of the structure moves as if the tip were held. One
flight then begins at gap 0 with speed u and obeys, for the gap g,

    g'' = -a(t) - γ g',   a = m̂ λ(t),   γ = e_nᵀM⁻¹C1 M⁻¹e_n / m̂,   m̂ = e_nᵀM⁻¹e_n,

with the contact force λ of the held tip. To second order in its duration T the flight gives

    T = 2u/a · (1 - r u),   u⁺ = e u (1 - q u),   r = (γ + 2a'/a)/(3a),   q = 2(γ - a'/a)/(3a).

This map is iterated. Near e = 1, where a flight changes u only little, u is integrated by the
differential equation whose solution passes through all u of the map, to the same order:

    u' = -a/2 · (ε + q u)(1 - ε/2 + r u),   ε = -ln e.

Where the remaining chattering is short compared with all changes of a, its duration is a geometric series with
first corrections. Neither damping nor the change of the force may be neglected: they act for as long as the
chattering lasts, which is of order u/(1 - e), not u.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels.compiled import part
from workflow.schemes._exact.expansion import expand, growth_bound
from workflow.schemes._exact.motion import Motion
from workflow.schemes._exact.propagation import advance
from workflow.schemes._exact.tables import expansion

_CUBIC = 1e-6
"""Largest error of the cubic for the contact force, relative to the force at its beginning: it enters the duration of
the remaining chattering, which is itself a small part of the contact."""

_SMALL_CHANGE = 1e-3
"""Relative change of force and speed until the end up to which the series is used: its error is the square."""

_CONTINUOUS = 5e-4
"""Below this 1 - e the differential equation is used, whose error is of the order of the square."""

_STRIDE = 0.03
"""Steps of the differential equation over the time in which u would vanish: the error of the classical
Runge-Kutta method is 0.03⁵/120 = 2e-10 per step."""

_SLOW_CHANGE = 0.1
"""Largest first corrections q u and r u at which the map is used: its error is their square. Where the force has just
risen from zero they are not small."""

_MOST = 1_000_000
"""Largest number of steps and bounces, without a result beyond: a million take a hundredth of a second."""


class Bounces(NamedTuple):
    """Parameters of a bouncing tip."""

    e: float
    mobility: float
    """m̂, 1/kg."""
    drag: float
    """γ, 1/s."""
    height: float
    """Bounces higher than this, m, are not small."""
    end: float
    """Time the case ends, s."""


class _Force(NamedTuple):
    """Contact force and its derivatives at the beginning of a window, and the time over which their cubic is valid."""

    value: float
    rate: float
    bend: float
    third: float
    window: float


@part
def _expanded(m: Motion) -> _Force:
    """Return the contact force as a cubic about the last expansion of the held motion, with its window."""
    sums, n = m.expansion.sums, m.blocks
    force, fourth = sums[expansion.D0, n], sums[expansion.FOURTH, n]
    h = np.sqrt(np.sqrt(24.0 * _CUBIC * force / fourth)) if fourth > 0.0 else np.inf
    for _ in range(60):
        bound = (fourth + sums[expansion.FOURTH_GROWTH, 0] * h) * growth_bound(m.growth * h)
        if bound * h**4 <= 48.0 * _CUBIC * force:
            break
        h *= 0.5
    return _Force(force, sums[expansion.D1, n], sums[expansion.D2, n], sums[expansion.D3, n], h)


@part
def _at(s: _Force, tau: float) -> tuple[float, float]:
    """Return the contact force and its rate by their cubic."""
    force = s.value + tau * (s.rate + tau * (s.bend / 2.0 + tau * s.third / 6.0))
    return force, s.rate + tau * (s.bend + tau * s.third / 2.0)


@part
def _coefficients(bounces: Bounces, force: float, rate: float) -> tuple[float, float, float]:
    """Return a, q and r."""
    a, change = bounces.mobility * force, rate / force
    return a, 2.0 * (bounces.drag - change) / (3.0 * a), (bounces.drag + 2.0 * change) / (3.0 * a)


@part
def _slope(bounces: Bounces, s: _Force, tau: float, u: float) -> float:
    """Return u' of the differential equation."""
    force, rate = _at(s, tau)
    a, q, r = _coefficients(bounces, force, rate)
    loss = 1.0 - bounces.e
    log_loss = loss * (1.0 + loss * (0.5 + loss / 3.0))
    return -0.5 * a * (log_loss + q * u) * (1.0 - 0.5 * log_loss + r * u)


@part
def _later_speed(bounces: Bounces, s: _Force, tau: float, h: float, u: float) -> float:
    """Return u after a step of the classical Runge-Kutta method."""
    k1 = _slope(bounces, s, tau, u)
    k2 = _slope(bounces, s, tau + 0.5 * h, u + 0.5 * h * k1)
    k3 = _slope(bounces, s, tau + 0.5 * h, u + 0.5 * h * k2)
    k4 = _slope(bounces, s, tau + h, u + h * k3)
    return u + h * (k1 + 2.0 * (k2 + k3) + k4) / 6.0


@part
def end_of_chattering(m: Motion, t: float, u: float, bounces: Bounces) -> tuple[float, float, float]:
    """Return the time at which the tip comes to rest, the speed of its last bounce, and the number of bounces.

    The time is infinite where, before that, the force falls so far that bounces are no longer small, or the case
    ends. ``m`` is the held motion at t, where a bounce begins with speed u; its expansion is overwritten.
    """
    e, count, tau, begun = bounces.e, 0.0, 0.0, t
    s = _Force(0.0, 0.0, 0.0, 0.0, 0.0)
    for step in range(_MOST):
        if step == 0 or tau >= s.window:
            begun, tau = begun + tau, 0.0
            advance(m, m.now, t, begun - t, m.between)
            expand(m, m.between, begun)
            s = _expanded(m)
            if s.value <= 0.0:
                break
        force, rate = _at(s, tau)
        a, q, r = _coefficients(bounces, force, rate)
        if force <= 0.0 or u * u > 2.0 * a * bounces.height or begun + tau >= bounces.end:
            break
        if max(abs(q), abs(r)) * u > _SLOW_CHANGE:
            break
        flight, change = 2.0 * u / a, rate / force
        left = flight / (1.0 - e) if e < 1.0 else np.inf
        if left * (bounces.drag + abs(change) + np.sqrt(abs(s.bend) / force)) <= _SMALL_CHANGE:
            share = e / (1.0 + e)
            correction = q * u / (1.0 - e) * share + r * u / (1.0 + e) + change * left * share
            return begun + tau + left * (1.0 - correction), u, count
        if 1.0 - e >= _CONTINUOUS:
            tau += flight * (1.0 - r * u)
            u *= e * (1.0 - q * u)
            count += 1.0
        else:
            h = min(_STRIDE * u / abs(_slope(bounces, s, tau, u)), s.window - tau)
            u, tau, count = _later_speed(bounces, s, tau, h, u), tau + h, count + h / flight
    return np.inf, u, count
