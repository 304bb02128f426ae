"""Blocks that keep their force, advanced by Taylor series: no division, so they hold for every ω² and c.

A block η'' + c η' + ω² η = F(t) takes steps of at most ``TAYLOR_SPAN`` over its fastest pole, those of the waves and of
the first-order states that act on it. Where these are many because the block is overdamped, its fast pole s is
separated from the slow one s': p = η' - s' η obeys p' = s p + F and q = η' - s η obeys q' = s' q + F. The fast p
follows its load in closed form, p = P + e^(s t) (p - P)(0), where a force exp(a t) has the response exp(a t)/(a - s);
the slow q takes Taylor steps of its own size.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import elementary
from workflow.kernels.compiled import part
from workflow.models import Array
from workflow.schemes._exact.layout import ORDER, TAYLOR_SPAN
from workflow.schemes._exact.propagators import first_propagator
from workflow.schemes._exact.response import Response, forced
from workflow.schemes._exact.tables import block, first, state, wave
from workflow.schemes._exact.waves import wave_phase

_MANY_STEPS = 16
"""Taylor steps from which on the poles of a block are separated where they can be: that costs about as much."""

_SEPARABLE = 0.1875
"""Poles are separated where ω² is at most this share of c²: the fast one is then at least three times the slow one."""


@part
def explicit_force(r: Response, k: int, y: Array, t: float) -> float:
    """Return the force on an explicit block in the state ``y`` of time t."""
    force = r.block[block.FORCE, k]
    for i in range(r.waves.shape[0]):
        cos, sin = wave_phase(r.waves, i, t)
        row = i * block.WAVE
        force = force + r.block[block.FORCE_COS + row, k] * cos + r.block[block.FORCE_SIN + row, k] * sin
    for j in range(r.firsts):
        force += r.coupling[0, j, k] * y[state.FIRST, j]
    return float(force)


@part
def begin_derivatives(r: Response, k: int, t: float) -> None:
    """Keep the waves of the force on a block at a time, for :func:`next_derivative`."""
    w = r.waves
    for i in range(w.shape[0]):
        sin, cos = elementary.sine_cosine(w[i, wave.OMEGA] * t + w[i, wave.PHASE])
        w[i, wave.COS_BEGUN], w[i, wave.SIN_BEGUN] = cos, sin
        w[i, wave.FORCE_COS] = r.block[block.FORCE_COS + i * block.WAVE, k]
        w[i, wave.FORCE_SIN] = r.block[block.FORCE_SIN + i * block.WAVE, k]


@part
def next_derivative(w: Array) -> float:
    """Return the next derivative of the waves of a force."""
    value = 0.0
    for i in range(w.shape[0]):
        f_cos, f_sin = w[i, wave.OMEGA] * w[i, wave.FORCE_SIN], -w[i, wave.OMEGA] * w[i, wave.FORCE_COS]
        value += f_cos * w[i, wave.COS_BEGUN] + f_sin * w[i, wave.SIN_BEGUN]
        w[i, wave.FORCE_COS], w[i, wave.FORCE_SIN] = f_cos, f_sin
    return value


@part
def _force_at(r: Response, k: int, y: Array, t: float, step: int, h: float) -> float:
    """Return the force on a block a number of steps ``h`` after the state ``y`` of time ``t``.

    Its derivatives by the first-order states begin in the row PHI2.
    """
    force, w = r.block[block.FORCE, k], r.waves
    begin_derivatives(r, k, t + step * h)
    for i in range(w.shape[0]):
        cos, sin = w[i, wave.COS_BEGUN], w[i, wave.SIN_BEGUN]
        force = force + w[i, wave.FORCE_COS] * cos + w[i, wave.FORCE_SIN] * sin
    for j in range(r.firsts):
        decay, phi1, _ = first_propagator(-r.first[first.RATE, j] * step * h)
        force += r.coupling[0, j, k] * (y[state.FIRST, j] + y[state.FIRST_SLOPE, j] * step * h * phi1)
        r.first[first.PHI2, j] = r.coupling[0, j, k] * y[state.FIRST_SLOPE, j] * decay
    return float(force)


@part
def _derivative(r: Response) -> float:
    """Return the next derivative of a force."""
    value = next_derivative(r.waves)
    for j in range(r.firsts):
        value += r.first[first.PHI2, j]
        r.first[first.PHI2, j] *= -r.first[first.RATE, j]
    return value


@part
def _steps(r: Response, k: int, fastest: float, dt: float) -> int:
    """Return the number of Taylor steps over ``dt`` for a bound of the block's own poles."""
    for i in range(r.waves.shape[0]):
        if forced(r.block, k, i):
            fastest = max(fastest, r.waves[i, wave.OMEGA])
    for j in range(r.firsts):
        if r.coupling[0, j, k] != 0.0:
            fastest = max(fastest, abs(r.first[first.RATE, j]))
    return max(1, int(np.ceil(fastest * abs(dt) / TAYLOR_SPAN)))


@part
def advance_explicit(r: Response, k: int, y: Array, t: float, dt: float) -> tuple[float, float, float]:
    """Return η, η' and ∫η dt of an explicit block a time ``dt`` after the state ``y`` of time ``t``."""
    c, w2 = r.block[block.DAMPING, k], r.block[block.STIFFNESS, k]
    steps = _steps(r, k, max(abs(c), np.sqrt(w2)), dt)
    if steps > _MANY_STEPS and c > 0.0 and 0.0 <= w2 <= _SEPARABLE * c * c:
        return _advance_separated(r, k, y, t, dt)
    h = dt / steps
    value, slope, area = y[state.VALUE, k], y[state.SLOPE, k], 0.0
    for step in range(steps):
        force = _force_at(r, k, y, t, step, h)
        low, high = value, slope
        area += h * (value + 0.5 * h * slope)
        value += h * slope
        scale = 1.0  # h^(n-2)/(n-2)!
        for n in range(2, ORDER + 2):
            low, high = high, force - c * high - w2 * low
            slope += high * scale * h / (n - 1)
            value += high * scale * h * h / (n * (n - 1))
            area += high * scale * h * h * h / (n * (n - 1) * (n + 1))
            scale *= h / (n - 1)
            force = _derivative(r)
    return value, slope, area


@part
def _advance_separated(r: Response, k: int, y: Array, t: float, dt: float) -> tuple[float, float, float]:
    """Do the same for a block whose fast pole is stiff, see the head of this module."""
    half = 0.5 * r.block[block.DAMPING, k]
    s = -(half + np.sqrt(half * half - r.block[block.STIFFNESS, k]))
    slow = r.block[block.STIFFNESS, k] / s
    value, slope = y[state.VALUE, k], y[state.SLOPE, k]
    p, q = slope - slow * value, slope - s * value
    before, after, impulse = _fast_response(r, k, s, y, t, dt)
    p_new = after + elementary.exp(s * dt) * (p - before)
    steps = _steps(r, k, abs(slow), dt)
    h, q_area = dt / steps, 0.0
    for step in range(steps):
        force = _force_at(r, k, y, t, step, h)
        term, scale = q, h
        q_area += q * h
        for n in range(1, ORDER + 1):
            term = slow * term + force
            q += term * scale
            scale *= h / (n + 1)
            q_area += term * scale
            force = _derivative(r)
    value_new = (q - p_new) / (slow - s)
    return value_new, p_new + slow * value_new, (q_area - (p_new - p - impulse) / s) / (slow - s)


@part
def _fast_response(r: Response, k: int, s: float, y: Array, t: float, dt: float) -> tuple[float, float, float]:
    """Return P at the beginning and at the end, and ∫F dt."""
    b, before = r.block, -r.block[block.FORCE, k] / s
    after, impulse = before, r.block[block.FORCE, k] * dt
    for i in range(r.waves.shape[0]):
        w, f_cos = r.waves[i, wave.OMEGA], b[block.FORCE_COS + i * block.WAVE, k]
        f_sin = b[block.FORCE_SIN + i * block.WAVE, k]
        share = 1.0 / (s * s + w * w)  # of (f_cos - i f_sin)/(iΩ - s) exp iψ
        a_cos, a_sin = -share * (s * f_cos + w * f_sin), share * (w * f_cos - s * f_sin)
        cos, sin = wave_phase(r.waves, i, t)
        cos_after, sin_after = wave_phase(r.waves, i, t + dt)
        before += a_cos * cos + a_sin * sin
        after += a_cos * cos_after + a_sin * sin_after
        impulse += (f_cos * (sin_after - sin) - f_sin * (cos_after - cos)) / w
    for j in range(r.firsts):
        g, mu = r.coupling[0, j, k], r.first[first.RATE, j]
        if g != 0.0:
            value, pace = y[state.FIRST, j], y[state.FIRST_SLOPE, j]
            decay, phi1, phi2 = first_propagator(-mu * dt)
            before -= g / s * (value + pace / (s + mu))
            after -= g / s * (value + pace * dt * phi1 + pace * decay / (s + mu))
            impulse += g * dt * (value + pace * dt * phi2)
    return before, after, impulse
