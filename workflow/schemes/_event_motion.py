"""Closed-form motion of one regime for one case: propagation, and what is seen of a state."""

from __future__ import annotations

import numpy as np

from workflow.models import Array
from workflow.schemes._event_functions import (
    AREA,
    DAMPING,
    DECAY,
    EXPLICIT,
    EXPLICIT_AREA,
    FIRST,
    FORCE,
    FORCE_COS,
    FORCE_SIN,
    HEAT_FIRST,
    HEAT_PACE,
    HEAT_SLOPE,
    HEAT_SPEED,
    HEAT_VALUE,
    KICK_FIRST,
    KICK_PACE,
    KICK_SLOPE,
    KICK_VALUE,
    PACE,
    PHASE,
    PHI1,
    PHI2,
    PULL,
    RATE,
    SEEN_SLOPE,
    SLOPE,
    SPECIAL,
    STIFFNESS,
    VALUE,
    C,
    S,
    block_propagators,
    first_propagator,
    first_propagators,
    stiff_block,
)
from workflow.schemes._event_response import FIRSTS, ORDER, PACES, SLOPES, TAYLOR_SPAN, VALUES, Response
from workflow.schemes._kernel import part, rare


@part
def load_phase(r: Response, t: float) -> tuple[float, float]:
    """Return cosine and sine of the load's phase Ω t + φ; those of the last time asked for are kept."""
    b = r.block
    if b[PHASE, 0] != t:
        psi = r.load_omega * t + r.load_phase
        b[PHASE, 0], b[PHASE, 1], b[PHASE, 2] = t, np.cos(psi), np.sin(psi)
    return b[PHASE, 1], b[PHASE, 2]


@part
def explicit_force(r: Response, k: int, y: Array, cos: float, sin: float) -> float:
    """Return the force on an explicit block, state ``y``."""
    force = r.block[FORCE, k] + r.block[FORCE_COS, k] * cos + r.block[FORCE_SIN, k] * sin
    for j in range(r.firsts):
        force += r.coupling[0, k, j] * y[FIRSTS, j]
    return float(force)


STIFF_STEPS = 16
"""A block that would take more Taylor steps is split where it can be: that costs about as much."""


@part
def splits(c: float, w2: float) -> bool:
    """Whether the poles of a block are real and far apart, the fast one at least three times the slow one."""
    return bool(c > 0.0 and 0.0 <= w2 <= 0.1875 * c * c)


@rare
def _split_block(r: Response, k: int, t: float, motion: Array, dt: float) -> tuple[float, float, float]:
    """Advance an explicit block whose fast pole is stiff, as two states of first order.

    With the poles s and s' of η'' + c η' + ω² η = F, p = η' - s' η obeys p' = s p + F and q = η' - s η
    obeys q' = s' q + F. The fast p follows its load in closed form, p = P + e^(s t) (p - P)(0), where a
    force exp(a t) has the answer exp(a t)/(a - s); the slow q takes Taylor steps of its own size.
    """
    b, f = r.block, r.first
    half, wave = 0.5 * b[DAMPING, k], r.load_omega
    s = -(half + np.sqrt(half * half - b[STIFFNESS, k]))
    slow = b[STIFFNESS, k] / s
    y, v = motion[VALUES, k], motion[SLOPES, k]
    p, q = v - slow * y, v - s * y
    force, f_cos, f_sin = b[FORCE, k], b[FORCE_COS, k], b[FORCE_SIN, k]
    psi, after = wave * t + r.load_phase, wave * (t + dt) + r.load_phase
    share = 1.0 / (s * s + wave * wave)  # of (f_cos - i f_sin)/(iΩ - s) exp iψ
    a_cos, a_sin = -share * (s * f_cos + wave * f_sin), share * (wave * f_cos - s * f_sin)
    begin = a_cos * np.cos(psi) + a_sin * np.sin(psi) - force / s
    end = a_cos * np.cos(after) + a_sin * np.sin(after) - force / s
    push = force * dt  # ∫F dt
    if wave > 0.0:
        push += (f_cos * (np.sin(after) - np.sin(psi)) - f_sin * (np.cos(after) - np.cos(psi))) / wave
    fastest = max(abs(slow), wave if f_cos != 0.0 or f_sin != 0.0 else 0.0)
    for j in range(r.firsts):
        g, mu = r.coupling[0, k, j], f[RATE, j]
        if g != 0.0:
            value, pace = motion[FIRSTS, j], motion[PACES, j]
            e, phi1, phi2 = first_propagator(-mu * dt)
            begin -= g / s * (value + pace / (s + mu))
            end -= g / s * (value + pace * dt * phi1 + pace * e / (s + mu))
            push += g * dt * (value + pace * dt * phi2)
            fastest = max(fastest, abs(mu))
    p_new = end + np.exp(s * dt) * (p - begin)
    steps = max(1, int(np.ceil(fastest * abs(dt) / TAYLOR_SPAN)))
    h, q_area = dt / steps, 0.0
    for step in range(steps):
        angle = wave * (t + step * h) + r.load_phase
        cos, sin = np.cos(angle), np.sin(angle)
        g_cos, g_sin = f_cos, f_sin
        load = force + g_cos * cos + g_sin * sin
        for j in range(r.firsts):
            e, phi1, _ = first_propagator(-f[RATE, j] * step * h)
            load += r.coupling[0, k, j] * (motion[FIRSTS, j] + motion[PACES, j] * step * h * phi1)
            f[PHI2, j] = r.coupling[0, k, j] * motion[PACES, j] * e
        term, scale = q, h
        q_area += q * h
        for n in range(1, ORDER + 1):
            term = slow * term + load
            q += term * scale
            scale *= h / (n + 1)
            q_area += term * scale
            g_cos, g_sin = wave * g_sin, -wave * g_cos
            load = g_cos * cos + g_sin * sin
            for j in range(r.firsts):
                load += f[PHI2, j]
                f[PHI2, j] *= -f[RATE, j]
    y_new = (q - p_new) / (slow - s)
    return y_new, p_new + slow * y_new, (q_area - (p_new - p - push) / s) / (slow - s)


@rare
def forced_block(r: Response, k: int, t: float, motion: Array, dt: float) -> tuple[float, float, float]:
    """Advance an explicit block by Taylor steps; return η, η' and ∫η dt after ``dt``."""
    b, f = r.block, r.first
    c, w2, wave = b[DAMPING, k], b[STIFFNESS, k], r.load_omega
    fastest = max(abs(c), np.sqrt(w2))
    if b[FORCE_COS, k] != 0.0 or b[FORCE_SIN, k] != 0.0:
        fastest = max(fastest, wave)
    for j in range(r.firsts):
        if r.coupling[0, k, j] != 0.0:
            fastest = max(fastest, abs(f[RATE, j]))
    steps = max(1, int(np.ceil(fastest * abs(dt) / TAYLOR_SPAN)))
    if steps > STIFF_STEPS and splits(c, w2):
        return _split_block(r, k, t, motion, dt)
    h = dt / steps
    y, v, area = motion[VALUES, k], motion[SLOPES, k], 0.0
    for step in range(steps):
        psi = wave * (t + step * h) + r.load_phase
        cos, sin = np.cos(psi), np.sin(psi)
        f_cos, f_sin = b[FORCE_COS, k], b[FORCE_SIN, k]
        force = b[FORCE, k] + f_cos * cos + f_sin * sin
        for j in range(r.firsts):
            e, phi1, _ = first_propagator(-f[RATE, j] * step * h)
            force += r.coupling[0, k, j] * (motion[FIRSTS, j] + motion[PACES, j] * step * h * phi1)
            f[PHI2, j] = r.coupling[0, k, j] * motion[PACES, j] * e  # derivatives of the thermal force
        low, high = y, v
        area += h * (y + 0.5 * h * v)
        y += h * v
        scale = 1.0  # h^(n-2)/(n-2)!
        for n in range(2, ORDER + 2):
            low, high = high, force - c * high - w2 * low
            v += high * scale * h / (n - 1)
            y += high * scale * h * h / (n * (n - 1))
            area += high * scale * h * h * h / (n * (n - 1) * (n + 1))
            scale *= h / (n - 1)
            f_cos, f_sin = wave * f_sin, -wave * f_cos
            force = f_cos * cos + f_sin * sin
            for j in range(r.firsts):
                force += f[PHI2, j]
                f[PHI2, j] *= -f[RATE, j]
    return y, v, area


@part
def advance(r: Response, motion: Array, t: float, dt: float, out: Array) -> None:
    """Move a state from t to t + dt."""
    b, f, y, y_new = r.block, r.first, motion, out
    block_propagators(b, dt)
    for i in range(r.specials):
        k = int(b[SPECIAL, i])
        if b[EXPLICIT, k] == 0.0:
            b[C, k], b[S, k] = stiff_block(b[DAMPING, k], b[STIFFNESS, k], dt)
    for k in range(b.shape[1]):
        b[PULL, k] = -b[STIFFNESS, k] * b[S, k]
    for k in range(b.shape[1]):
        y_new[VALUES, k] = b[C, k] * y[VALUES, k] + b[S, k] * y[SLOPES, k]
    for k in range(b.shape[1]):
        y_new[SLOPES, k] = (b[C, k] - b[DAMPING, k] * b[S, k]) * y[SLOPES, k] + b[PULL, k] * y[VALUES, k]
    for i in range(r.specials):
        k = int(b[SPECIAL, i])
        if b[EXPLICIT, k] != 0.0:
            y_new[VALUES, k], y_new[SLOPES, k], b[EXPLICIT_AREA, k] = forced_block(r, k, t, motion, dt)
    if r.firsts > 0:
        first_propagators(f, dt)
        for j in range(f.shape[1]):
            y_new[FIRSTS, j] = y[FIRSTS, j] + dt * y[PACES, j] * f[PHI1, j]
        for j in range(f.shape[1]):
            y_new[PACES, j] = y[PACES, j] * f[DECAY, j]


@part
def integral(r: Response, y: Array, y_new: Array, t: float, dt: float) -> float:
    """Return the integral of the signal over the motion last advanced, from y at t to y_new at t + dt."""
    b, f, area = r.block, r.first, 0.0
    for i in range(r.specials):
        k = int(b[SPECIAL, i])
        if b[EXPLICIT, k] != 0.0:
            area += b[VALUE, k] * b[EXPLICIT_AREA, k] + b[SLOPE, k] * (y_new[VALUES, k] - y[VALUES, k])
    for j in range(r.firsts):
        step = y[PACES, j] * dt
        area += f[FIRST, j] * dt * (y[FIRSTS, j] + step * f[PHI2, j]) + f[PACE, j] * step * f[PHI1, j]
    for k in range(r.blocks):
        change = y_new[VALUES, k] - y[VALUES, k]
        area += b[SEEN_SLOPE, k] * change - b[AREA, k] * (y_new[SLOPES, k] - y[SLOPES, k] + b[DAMPING, k] * change)
    area += r.signal * dt
    if r.load_omega > 0.0:
        cos, sin = load_phase(r, t)
        cos_after, sin_after = load_phase(r, t + dt)
        area += r.signal_wave[0] * (sin_after - sin) / r.load_omega
        area -= r.signal_wave[1] * (cos_after - cos) / r.load_omega
    return area


@part
def observe(r: Response, motion: Array, t: float) -> tuple[float, float, float, float]:
    """Return signal, its rate, tip temperature and its rate."""
    b, f, y = r.block, r.first, motion
    wave = r.load_omega
    cos, sin = load_phase(r, t)
    signal = r.signal + r.signal_wave[0] * cos + r.signal_wave[1] * sin
    rate = wave * (r.signal_wave[1] * cos - r.signal_wave[0] * sin)
    heat = r.heat + r.heat_wave[0] * cos + r.heat_wave[1] * sin
    heat_rate = wave * (r.heat_wave[1] * cos - r.heat_wave[0] * sin)
    for j in range(r.firsts):
        mu = f[RATE, j]
        signal += f[FIRST, j] * y[FIRSTS, j] + f[PACE, j] * y[PACES, j]
        rate += (f[FIRST, j] - f[PACE, j] * mu) * y[PACES, j]
        heat += f[HEAT_FIRST, j] * y[FIRSTS, j] + f[HEAT_PACE, j] * y[PACES, j]
        heat_rate += f[HEAT_SPEED, j] * y[PACES, j]
    seen, seen_rate = 0.0, 0.0
    for k in range(r.blocks):
        seen += b[VALUE, k] * y[VALUES, k]
        seen_rate += b[VALUE, k] * y[SLOPES, k]
    signal, rate = signal + seen, rate + seen_rate
    if not r.two_way:
        return signal, rate, heat, heat_rate
    for k in range(b.shape[1]):
        b[PULL, k] = -b[DAMPING, k] * y[SLOPES, k] - b[STIFFNESS, k] * y[VALUES, k]
    for i in range(r.specials):
        k = int(b[SPECIAL, i])
        if b[EXPLICIT, k] != 0.0:
            b[PULL, k] += explicit_force(r, k, y, cos, sin)
    seen, seen_rate, warm, warm_rate = 0.0, 0.0, 0.0, 0.0
    for k in range(r.blocks):
        seen += b[SLOPE, k] * y[SLOPES, k]
        seen_rate += b[SLOPE, k] * b[PULL, k]
        warm += b[HEAT_VALUE, k] * y[VALUES, k] + b[HEAT_SLOPE, k] * y[SLOPES, k]
        warm_rate += b[HEAT_VALUE, k] * y[SLOPES, k] + b[HEAT_SLOPE, k] * b[PULL, k]
    signal, rate, heat, heat_rate = signal + seen, rate + seen_rate, heat + warm, heat_rate + warm_rate
    return signal, rate, heat, heat_rate


@part
def strike(r: Response, shape: Array, motion: Array, p: float, heat: float) -> None:
    """Apply an impulse p and a heat at the tip: velocities jump by -p M⁻¹ e_n, θ by heat C2⁻¹ e_n."""
    b, f, y = r.block, r.first, motion
    for j in range(r.firsts):
        y[FIRSTS, j] += heat * f[KICK_FIRST, j]
        y[PACES, j] += heat * f[KICK_PACE, j]
    for k in range(r.blocks):
        y[VALUES, k] += heat * b[KICK_VALUE, k]
        y[SLOPES, k] += heat * b[KICK_SLOPE, k] - p * shape[k]


@part
def heating_rate(r: Response, motion: Array) -> float:
    """Return the rate of the tip temperature in a regime where only first-order states show in it."""
    total = 0.0
    for j in range(r.firsts):
        total += r.first[HEAT_SPEED, j] * motion[PACES, j]
    return total
