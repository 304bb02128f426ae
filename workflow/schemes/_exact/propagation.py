"""Propagation of a motion in closed form, its outputs, and its jump at an impact."""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part
from workflow.kernels.packs import narrow, pack, store
from workflow.schemes._exact.explicit_blocks import advance_explicit, explicit_force
from workflow.schemes._exact.motion import SIGNAL, TEMPERATURE, Motion, casing_at
from workflow.schemes._exact.propagators import aperiodic_propagator, block_propagators, first_propagators
from workflow.schemes._exact.tables import block, first, state, wave
from workflow.schemes._exact.waves import wave_phase


class Observed(NamedTuple):
    """Outputs of a state."""

    signal: float
    """Gap d - x_n of the free tip, m; contact force of the held tip, N."""
    signal_rate: float
    temperature: float
    """Tip temperature, K."""
    warming: float
    """Its rate, K/s."""
    place: float
    """d of the casing, m."""
    speed: float
    """d' of the casing, m/s."""


@part
def copy_state(source: Array, target: Array) -> None:
    """Copy a state."""
    for row in range(state.ROWS):
        for k in range(source.shape[1]):
            target[row, k] = source[row, k]


@part
def advance(m: Motion, y: Array, t: float, dt: float, out: Array) -> None:
    """Fill ``out`` with the state at t + dt that follows from ``y`` at t."""
    b, f = m.block, m.first
    block_propagators(b, dt)
    for i in range(m.aperiodics):
        k = int(b[block.APERIODIC_COLUMNS, i])
        b[block.C, k], b[block.S, k] = aperiodic_propagator(b[block.DAMPING, k], b[block.STIFFNESS, k], dt)
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        C, S = pack(b, (block.C, lane)), pack(b, (block.S, lane))
        value, slope = pack(y, (state.VALUE, lane)), pack(y, (state.SLOPE, lane))
        store(out, (state.VALUE, lane), C * value + S * slope)
        slope = (C - pack(b, (block.DAMPING, lane)) * S) * slope
        store(out, (state.SLOPE, lane), slope + -pack(b, (block.STIFFNESS, lane)) * S * value)
    for i in range(m.explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        out[state.VALUE, k], out[state.SLOPE, k], _ = advance_explicit(m, k, y, t, dt, 3)
    if m.firsts > 0:
        first_propagators(f, dt)
        for j in range(0, f.shape[1], 8):
            lane = narrow(j)
            slope = pack(y, (state.FIRST_SLOPE, lane))
            store(out, (state.FIRST, lane), pack(y, (state.FIRST, lane)) + dt * slope * pack(f, (first.PHI1, lane)))
            store(out, (state.FIRST_SLOPE, lane), slope * pack(f, (first.DECAY, lane)))


@part
def integral(m: Motion, y: Array, out: Array, t: float, dt: float) -> float:
    """Return the integral of the signal from ``y`` at t to ``out`` at t + dt, after the motion was advanced over dt."""
    b, f, area = m.block, m.first, 0.0
    for i in range(m.explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        change = out[state.VALUE, k] - y[state.VALUE, k]
        area += b[block.SIGNAL_VALUE, k] * advance_explicit(m, k, y, t, dt, 4)[2] + b[block.SIGNAL_SLOPE, k] * change
    for j in range(m.firsts):
        step = y[state.FIRST_SLOPE, j] * dt
        area += f[first.SIGNAL, j] * dt * (y[state.FIRST, j] + step * f[first.PHI2, j])
    for k in range(m.blocks):
        change = out[state.VALUE, k] - y[state.VALUE, k]
        slowed = out[state.SLOPE, k] - y[state.SLOPE, k] + b[block.DAMPING, k] * change
        area += b[block.UNFORCED_SLOPE, k] * change - b[block.SIGNAL_INTEGRAL, k] * slowed
    area += m.outputs[SIGNAL] * dt
    for i in range(m.waves.shape[0]):
        omega = m.waves[i, wave.OMEGA]
        cos, sin = wave_phase(m.waves, i, t)
        cos_after, sin_after = wave_phase(m.waves, i, t + dt)
        area += m.waves[i, wave.SIGNAL_COS] * (sin_after - sin) / omega
        area -= m.waves[i, wave.SIGNAL_SIN] * (cos_after - cos) / omega
    return float(area)


@part
def observe(m: Motion, y: Array, t: float) -> Observed:
    """Return the outputs of a state."""
    b, f = m.block, m.first
    signal, rate, temperature, warming, place, speed = _observe_waves(m, t)
    for j in range(m.firsts):
        xi, slope = y[state.FIRST, j], y[state.FIRST_SLOPE, j]
        signal += f[first.SIGNAL, j] * xi
        rate += f[first.SIGNAL, j] * slope
        temperature += f[first.TEMPERATURE, j] * xi
        warming += f[first.TEMPERATURE, j] * slope
    for k in range(m.blocks):
        b[block.WORK, k] = -b[block.DAMPING, k] * y[state.SLOPE, k] - b[block.STIFFNESS, k] * y[state.VALUE, k]
    for i in range(m.explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        b[block.WORK, k] += explicit_force(m, k, t)
    for k in range(m.blocks):
        value, slope, bend = y[state.VALUE, k], y[state.SLOPE, k], b[block.WORK, k]
        signal += b[block.SIGNAL_VALUE, k] * value + b[block.SIGNAL_SLOPE, k] * slope
        rate += b[block.SIGNAL_VALUE, k] * slope + b[block.SIGNAL_SLOPE, k] * bend
        temperature += b[block.TEMPERATURE_VALUE, k] * value + b[block.TEMPERATURE_SLOPE, k] * slope
        warming += b[block.TEMPERATURE_VALUE, k] * slope + b[block.TEMPERATURE_SLOPE, k] * bend
    return Observed(signal, rate, temperature, warming, place, speed)


@inlined
def _observe_waves(m: Motion, t: float) -> Observed:
    """Return the outputs of the loads alone, and the casing."""
    waves, signal, temperature, rate, warming = m.waves, m.outputs[SIGNAL], m.outputs[TEMPERATURE], 0.0, 0.0
    for i in range(waves.shape[0]):
        omega = waves[i, wave.OMEGA]
        cos, sin = wave_phase(waves, i, t)
        signal = signal + waves[i, wave.SIGNAL_COS] * cos + waves[i, wave.SIGNAL_SIN] * sin
        rate += omega * (waves[i, wave.SIGNAL_SIN] * cos - waves[i, wave.SIGNAL_COS] * sin)
        temperature = temperature + waves[i, wave.TEMPERATURE_COS] * cos + waves[i, wave.TEMPERATURE_SIN] * sin
        warming += omega * (waves[i, wave.TEMPERATURE_SIN] * cos - waves[i, wave.TEMPERATURE_COS] * sin)
    place, speed = casing_at(m, t)
    return Observed(signal, rate, temperature, warming, place, speed)


@part
def apply_impulse(m: Motion, p: float) -> None:
    """Apply an impulse p [N s] at the free tip: v jumps by -p M⁻¹ (e_n - µ t), θ by α p C2⁻¹ e_n."""
    for row in range(state.ROWS):
        for k in range(m.now.shape[1]):
            m.now[row, k] += p * m.jump[row, k]
