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
from workflow.schemes._kernel import part

@part
def explicit_force(r: Response, k: int, y: Array, cos: float, sin: float) -> float:
    """Return the force on an explicit block, state ``y``."""
    force = r.block[FORCE, k] + r.block[FORCE_COS, k] * cos + r.block[FORCE_SIN, k] * sin
    for j in range(r.firsts):
        force += r.coupling[0, k, j] * y[FIRSTS, j]
    return float(force)


@part
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
        psi, after = r.load_omega * t + r.load_phase, r.load_omega * (t + dt) + r.load_phase
        area += r.signal_wave[0] * (np.sin(after) - np.sin(psi)) / r.load_omega
        area -= r.signal_wave[1] * (np.cos(after) - np.cos(psi)) / r.load_omega
    return area


@part
def observe(r: Response, motion: Array, t: float) -> tuple[float, float, float, float]:
    """Return signal, its rate, tip temperature and its rate."""
    b, f, y = r.block, r.first, motion
    psi, wave = r.load_omega * t + r.load_phase, r.load_omega
    cos, sin = np.cos(psi), np.sin(psi)
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
    if not r.two_way:
        for k in range(r.blocks):
            signal += b[VALUE, k] * y[VALUES, k]
            rate += b[VALUE, k] * y[SLOPES, k]
        return signal, rate, heat, heat_rate
    for k in range(b.shape[1]):
        b[PULL, k] = -b[DAMPING, k] * y[SLOPES, k] - b[STIFFNESS, k] * y[VALUES, k]
    for i in range(r.specials):
        k = int(b[SPECIAL, i])
        if b[EXPLICIT, k] != 0.0:
            b[PULL, k] += explicit_force(r, k, y, cos, sin)
    for k in range(r.blocks):
        signal += b[VALUE, k] * y[VALUES, k] + b[SLOPE, k] * y[SLOPES, k]
        rate += b[VALUE, k] * y[SLOPES, k] + b[SLOPE, k] * b[PULL, k]
        heat += b[HEAT_VALUE, k] * y[VALUES, k] + b[HEAT_SLOPE, k] * y[SLOPES, k]
        heat_rate += b[HEAT_VALUE, k] * y[SLOPES, k] + b[HEAT_SLOPE, k] * b[PULL, k]
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
