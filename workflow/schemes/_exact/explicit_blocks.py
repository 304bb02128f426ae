"""Blocks that keep their force, advanced by Taylor series: no division, so they hold for every ω² and c.

A block η'' + c η' + ω² η = F(t) takes steps of at most ``TAYLOR_SPAN`` over its fastest pole, that of the load and of
the first-order states that act on it. Where these are many because the block is overdamped, its fast pole s is
separated from the slow one s': p = η' - s' η obeys p' = s p + F and q = η' - s η obeys q' = s' q + F. The fast p
follows its load in closed form, p = P + e^(s t) (p - P)(0), where a force exp(a t) has the response exp(a t)/(a - s);
the slow q takes Taylor steps of its own size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import elementary
from workflow.kernels.compiled import part, rare
from workflow.models import Array
from workflow.schemes._exact import block_table as block
from workflow.schemes._exact import first_table as first
from workflow.schemes._exact import state_table as state
from workflow.schemes._exact.layout import ORDER, TAYLOR_SPAN
from workflow.schemes._exact.propagators import first_propagator
from workflow.schemes._exact.response import Response

_MANY_STEPS = 16
"""Taylor steps from which on the poles of a block are separated where they can be: that costs about as much."""

_SEPARABLE = 0.1875
"""Poles are separated where ω² is at most this share of c²: the fast one is then at least three times the slow one."""


@part
def explicit_force(r: Response, k: int, y: Array, cos: float, sin: float) -> float:
    """Return the force on an explicit block in the state ``y``; ``cos`` and ``sin`` are those of ψ."""
    force = r.block[block.FORCE, k] + r.block[block.FORCE_COS, k] * cos + r.block[block.FORCE_SIN, k] * sin
    for j in range(r.firsts):
        force += r.coupling[0, k, j] * y[state.FIRST, j]
    return float(force)


class _Force(NamedTuple):
    """A derivative of the force on a block at one time; that by the first-order states lies in the row PHI2."""

    value: float
    cos: float
    """Coefficients of cos ψ and sin ψ, and these."""
    sin: float
    cos_psi: float
    sin_psi: float


@part
def _force_at(r: Response, k: int, y: Array, t: float, step: int, h: float) -> _Force:
    """Return the force on a block a number of steps ``h`` after the state ``y`` of time ``t``."""
    f_cos, f_sin = r.block[block.FORCE_COS, k], r.block[block.FORCE_SIN, k]
    sin, cos = elementary.sine_cosine(r.omega * (t + step * h) + r.load_phase)
    force = r.block[block.FORCE, k] + f_cos * cos + f_sin * sin
    for j in range(r.firsts):
        decay, phi1, _ = first_propagator(-r.first[first.RATE, j] * step * h)
        force += r.coupling[0, k, j] * (y[state.FIRST, j] + y[state.FIRST_SLOPE, j] * step * h * phi1)
        r.first[first.PHI2, j] = r.coupling[0, k, j] * y[state.FIRST_SLOPE, j] * decay
    return _Force(force, f_cos, f_sin, cos, sin)


@part
def _derivative(r: Response, force: _Force) -> _Force:
    """Return the next derivative of a force."""
    f_cos, f_sin = r.omega * force.sin, -r.omega * force.cos
    value = f_cos * force.cos_psi + f_sin * force.sin_psi
    for j in range(r.firsts):
        value += r.first[first.PHI2, j]
        r.first[first.PHI2, j] *= -r.first[first.RATE, j]
    return _Force(value, f_cos, f_sin, force.cos_psi, force.sin_psi)


@part
def _steps(r: Response, k: int, fastest: float, dt: float) -> int:
    """Return the number of Taylor steps over ``dt`` for a bound of the block's own poles."""
    if r.block[block.FORCE_COS, k] != 0.0 or r.block[block.FORCE_SIN, k] != 0.0:
        fastest = max(fastest, r.omega)
    for j in range(r.firsts):
        if r.coupling[0, k, j] != 0.0:
            fastest = max(fastest, abs(r.first[first.RATE, j]))
    return max(1, int(np.ceil(fastest * abs(dt) / TAYLOR_SPAN)))


@rare
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
            low, high = high, force.value - c * high - w2 * low
            slope += high * scale * h / (n - 1)
            value += high * scale * h * h / (n * (n - 1))
            area += high * scale * h * h * h / (n * (n - 1) * (n + 1))
            scale *= h / (n - 1)
            force = _derivative(r, force)
    return value, slope, area


@rare
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
            term = slow * term + force.value
            q += term * scale
            scale *= h / (n + 1)
            q_area += term * scale
            force = _derivative(r, force)
    value_new = (q - p_new) / (slow - s)
    return value_new, p_new + slow * value_new, (q_area - (p_new - p - impulse) / s) / (slow - s)


@rare
def _fast_response(r: Response, k: int, s: float, y: Array, t: float, dt: float) -> tuple[float, float, float]:
    """Return P at the beginning and at the end, and ∫F dt."""
    wave = r.omega
    force, f_cos, f_sin = r.block[block.FORCE, k], r.block[block.FORCE_COS, k], r.block[block.FORCE_SIN, k]
    share = 1.0 / (s * s + wave * wave)  # of (f_cos - i f_sin)/(iΩ - s) exp iψ
    a_cos, a_sin = -share * (s * f_cos + wave * f_sin), share * (wave * f_cos - s * f_sin)
    sin, cos = elementary.sine_cosine(wave * t + r.load_phase)
    sin_after, cos_after = elementary.sine_cosine(wave * (t + dt) + r.load_phase)
    before = a_cos * cos + a_sin * sin - force / s
    after = a_cos * cos_after + a_sin * sin_after - force / s
    impulse = force * dt
    if wave > 0.0:
        impulse += (f_cos * (sin_after - sin) - f_sin * (cos_after - cos)) / wave
    for j in range(r.firsts):
        g, mu = r.coupling[0, k, j], r.first[first.RATE, j]
        if g != 0.0:
            value, pace = y[state.FIRST, j], y[state.FIRST_SLOPE, j]
            decay, phi1, phi2 = first_propagator(-mu * dt)
            before -= g / s * (value + pace / (s + mu))
            after -= g / s * (value + pace * dt * phi1 + pace * decay / (s + mu))
            impulse += g * dt * (value + pace * dt * phi2)
    return before, after, impulse
