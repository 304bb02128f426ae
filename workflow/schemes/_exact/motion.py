"""Closed-form motion of one case in one regime: propagation, its outputs, and jumps at an impact."""

from __future__ import annotations

from typing import Any, NamedTuple

from workflow.kernels.compiled import inlined, part
from workflow.kernels.packs import narrow, pack, store
from workflow.models import Array
from workflow.schemes._exact.explicit_blocks import advance_explicit, explicit_force
from workflow.schemes._exact.layout import Expansion, Layout, Load, Memory
from workflow.schemes._exact.propagators import aperiodic_propagator, block_propagators, first_propagators
from workflow.schemes._exact.response import SIGNAL, TEMPERATURE, Response, casing_at, respond
from workflow.schemes._exact.tables import block, first, state, wave
from workflow.schemes._exact.waves import wave_phase


class Motion(NamedTuple):
    """The motion of one case in one regime; states as in :mod:`~workflow.schemes._exact.tables.state`."""

    r: Response
    expansion: Expansion
    now: Array
    """State at the beginning of the present step."""
    after: Array
    """State at its end."""
    between: Array
    """State at some time within it; scratch."""
    jump: Array
    """Change of the state of a free tip by an impulse of 1 N s with its friction heat."""
    coordinates: Array
    """[η, u, ξ]; scratch."""
    modal: Array
    """[z, z', τ], where the coordinates are modal in the same array."""
    is_modal: bool
    inward: Array
    outward: Array
    """All see :class:`~workflow.schemes._exact.layout.Layout`."""


class Observed(NamedTuple):
    """Outputs of a state."""

    signal: float
    """Gap d - x_n of the free tip, m; contact force of the held tip, N."""
    signal_rate: float
    temperature: float
    """Of the tip, K."""
    warming: float
    """Its rate, K/s."""
    place: float
    """d of the casing, m."""
    speed: float
    """d' of the casing, m/s."""


@part
def prepare(regime: Layout, load: Load, memory: Memory) -> Any:
    """Return the motion of a case in a regime, its state not yet set."""
    r, states = respond(regime, load, memory), memory.states
    own = memory.coordinates, memory.modal, regime.is_modal, regime.inward, regime.outward
    return Motion(r, memory.expansion, states[0], states[1], states[2], states[3], *own)


@part
def copy_state(source: Array, target: Array) -> None:
    """Copy a state."""
    for row in range(state.ROWS):
        for k in range(source.shape[1]):
            target[row, k] = source[row, k]


@part
def advance(r: Response, y: Array, t: float, dt: float, out: Array) -> None:
    """Fill ``out`` with the state at t + dt that follows from ``y`` at t."""
    b, f = r.block, r.first
    block_propagators(b, dt)
    for i in range(r.aperiodics):
        k = int(b[block.APERIODIC_COLUMNS, i])
        b[block.C, k], b[block.S, k] = aperiodic_propagator(b[block.DAMPING, k], b[block.STIFFNESS, k], dt)
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        C, S = pack(b, (block.C, lane)), pack(b, (block.S, lane))
        value, slope = pack(y, (state.VALUE, lane)), pack(y, (state.SLOPE, lane))
        store(out, (state.VALUE, lane), C * value + S * slope)
        slope = (C - pack(b, (block.DAMPING, lane)) * S) * slope
        store(out, (state.SLOPE, lane), slope + -pack(b, (block.STIFFNESS, lane)) * S * value)
    for i in range(r.explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        out[state.VALUE, k], out[state.SLOPE, k], _ = advance_explicit(r, k, y, t, dt, 3)
    if r.firsts > 0:
        first_propagators(f, dt)
        for j in range(0, f.shape[1], 8):
            lane = narrow(j)
            slope = pack(y, (state.FIRST_SLOPE, lane))
            store(out, (state.FIRST, lane), pack(y, (state.FIRST, lane)) + dt * slope * pack(f, (first.PHI1, lane)))
            store(out, (state.FIRST_SLOPE, lane), slope * pack(f, (first.DECAY, lane)))


@part
def integral(r: Response, y: Array, out: Array, t: float, dt: float) -> float:
    """Return the integral of the signal from ``y`` at t to ``out`` at t + dt, the motion that was advanced last."""
    b, f, area = r.block, r.first, 0.0
    for i in range(r.explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        change = out[state.VALUE, k] - y[state.VALUE, k]
        area += b[block.SIGNAL_VALUE, k] * advance_explicit(r, k, y, t, dt, 4)[2] + b[block.SIGNAL_SLOPE, k] * change
    for j in range(r.firsts):
        step = y[state.FIRST_SLOPE, j] * dt
        area += f[first.SIGNAL, j] * dt * (y[state.FIRST, j] + step * f[first.PHI2, j])
    for k in range(r.blocks):
        change = out[state.VALUE, k] - y[state.VALUE, k]
        slowed = out[state.SLOPE, k] - y[state.SLOPE, k] + b[block.DAMPING, k] * change
        area += b[block.UNFORCED_SLOPE, k] * change - b[block.SIGNAL_INTEGRAL, k] * slowed
    area += r.outputs[SIGNAL] * dt
    for i in range(r.waves.shape[0]):
        omega = r.waves[i, wave.OMEGA]
        cos, sin = wave_phase(r.waves, i, t)
        cos_after, sin_after = wave_phase(r.waves, i, t + dt)
        area += r.waves[i, wave.SIGNAL_COS] * (sin_after - sin) / omega
        area -= r.waves[i, wave.SIGNAL_SIN] * (cos_after - cos) / omega
    return float(area)


@part
def observe(r: Response, y: Array, t: float) -> Observed:
    """Return the outputs of a state."""
    b, f = r.block, r.first
    signal, rate, temperature, warming, place, speed = _observe_waves(r, t)
    for j in range(r.firsts):
        xi, slope = y[state.FIRST, j], y[state.FIRST_SLOPE, j]
        signal += f[first.SIGNAL, j] * xi
        rate += f[first.SIGNAL, j] * slope
        temperature += f[first.TEMPERATURE, j] * xi
        warming += f[first.TEMPERATURE, j] * slope
    block_signal, block_rate = 0.0, 0.0
    for k in range(r.blocks):
        block_signal += b[block.SIGNAL_VALUE, k] * y[state.VALUE, k]
        block_rate += b[block.SIGNAL_VALUE, k] * y[state.SLOPE, k]
    signal, rate = signal + block_signal, rate + block_rate
    if r.two_way:
        more = _observe_two_way(r, y, t)
        signal, rate, temperature, warming = signal + more[0], rate + more[1], temperature + more[2], warming + more[3]
    return Observed(signal, rate, temperature, warming, place, speed)


@inlined
def _observe_waves(r: Response, t: float) -> Observed:
    """Return the casing, and what loads alone give of the outputs."""
    waves, signal, temperature, rate, warming = r.waves, r.outputs[SIGNAL], r.outputs[TEMPERATURE], 0.0, 0.0
    for i in range(waves.shape[0]):
        omega = waves[i, wave.OMEGA]
        cos, sin = wave_phase(waves, i, t)
        signal = signal + waves[i, wave.SIGNAL_COS] * cos + waves[i, wave.SIGNAL_SIN] * sin
        rate += omega * (waves[i, wave.SIGNAL_SIN] * cos - waves[i, wave.SIGNAL_COS] * sin)
        temperature = temperature + waves[i, wave.TEMPERATURE_COS] * cos + waves[i, wave.TEMPERATURE_SIN] * sin
        warming += omega * (waves[i, wave.TEMPERATURE_SIN] * cos - waves[i, wave.TEMPERATURE_COS] * sin)
    place, speed = casing_at(r, t)
    return Observed(signal, rate, temperature, warming, place, speed)


@part
def _observe_two_way(r: Response, y: Array, t: float) -> tuple[float, float, float, float]:
    """Return what η' of blocks shows in the signal and its rate, and blocks in the tip temperature and its rate."""
    b = r.block
    for k in range(b.shape[1]):
        b[block.WORK, k] = -b[block.DAMPING, k] * y[state.SLOPE, k] - b[block.STIFFNESS, k] * y[state.VALUE, k]
    for i in range(r.explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        b[block.WORK, k] += explicit_force(r, k, t)
    signal, rate, temperature, warming = 0.0, 0.0, 0.0, 0.0
    for k in range(r.blocks):
        value, slope, bend = y[state.VALUE, k], y[state.SLOPE, k], b[block.WORK, k]
        signal += b[block.SIGNAL_SLOPE, k] * slope
        rate += b[block.SIGNAL_SLOPE, k] * bend
        temperature += b[block.TEMPERATURE_VALUE, k] * value + b[block.TEMPERATURE_SLOPE, k] * slope
        warming += b[block.TEMPERATURE_VALUE, k] * slope + b[block.TEMPERATURE_SLOPE, k] * bend
    return signal, rate, temperature, warming


@part
def strike(m: Motion, p: float) -> None:
    """Apply an impulse p [N s] with its friction heat at the free tip: v jumps by -p M⁻¹ e_n, θ by α p C2⁻¹ e_n."""
    for row in range(state.ROWS):
        for k in range(m.now.shape[1]):
            m.now[row, k] += p * m.jump[row, k]
