"""The response of a regime to the loads of one case, and the motion that is left when it is subtracted.

Loads and casing are constants and waves of phase ψ = Ω t + φ, pairs of coefficients of cos ψ and sin ψ. Of a block

    η' = u + β,   u' = -c u - ω² η + γ + Σ g_j ξ_j,   β = β0 + Σ (βc cos ψ + βs sin ψ), γ likewise, that is
    η'' + c η' + ω² η = γ + c β + β' + Σ g_j ξ_j

the particular solution is subtracted, and its response η = a ξ + b ξ' to each first-order state: what is left moves
freely and costs one exponential. Where that would lose digits (slow blocks, resonance with a wave or with a
first-order state) the block is *explicit*: it keeps its force, see :mod:`workflow.schemes._exact.explicit_blocks`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import elementary
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import part
from workflow.models import Array
from workflow.schemes._exact.layout import Layout, Load, Memory
from workflow.schemes._exact.tables import block, first, state, wave
from workflow.schemes._exact.waves import wave_phase

_SLOW_POLE = 0.3
"""A block whose slowest pole times the duration, x, is below this is explicit: F/ω² would lose digits like x⁻²."""

_RESONANT_POLE = 0.1
"""Likewise a block with a pole whose distance to that of a wave, times the duration, is below this."""

SIGNAL, TEMPERATURE = 0, 1
"""Outputs of a regime: the signal that ends it at zero (gap, m, or contact force, N), and the tip temperature, K."""


class Response(NamedTuple):
    """A regime under the loads of one case; tables are those of :class:`~workflow.schemes._exact.layout.Memory`."""

    blocks: int
    heated: bool
    firsts: int
    """Whether heat acts in the case, and the number of first-order states, 0 without heat (and sometimes with it)."""
    explicits: int
    aperiodics: int
    """Numbers of explicit blocks, and of others that do not oscillate."""
    block: Array
    first: Array
    coupling: Array
    outputs: Array
    waves: Array
    differences: Complex
    gap: float
    growth: float
    """d0, m, and the largest rate at which a block or first-order state grows, 1/s, not negative."""
    fastest: float
    fastest_first: float
    """Bound of all poles and of the Ω of waves, and the largest |μ|, 1/s."""
    two_way: bool
    """Whether blocks show in the tip temperature or their η' in the signal."""
    cooling: bool
    """Whether the tip temperature is a constant plus decaying exponentials: no block, wave or growing state shows."""


@part
def respond(regime: Layout, load: Load, memory: Memory) -> Response:
    """Return the response of a regime to the loads of one case, and complete the tables of its memory."""
    b, f, coupling = memory.block, memory.first, regime.coupling
    blocks, firsts, heated = regime.blocks, regime.firsts if memory.heated else 0, memory.heated
    _clear(regime, load, memory)
    _fill_sources(regime, load, firsts, memory)
    explicits, aperiodics = 0, 0
    for k in range(blocks):
        _fill_force(regime, load, k, heated, memory)
        if (firsts > 0 and b[block.RESONANT, k] > 0.0) or _keeps_force(b, k, load):
            b[block.EXPLICIT, k], b[block.EXPLICIT_COLUMNS, explicits] = 1.0, k
            explicits += 1
            continue
        if b[block.STIFFNESS, k] <= 0.25 * b[block.DAMPING, k] * b[block.DAMPING, k]:
            b[block.APERIODIC_COLUMNS, aperiodics] = k
            aperiodics += 1
        _subtract_particular(b, k, memory.waves, memory.outputs)
        for j in range(firsts):
            _subtract_thermal_response(b, k, f, j, coupling)
    for j in range(firsts):
        _subtract_harmonics(f, j, memory.waves)
    growth, fastest, fastest_first = regime.growth, regime.fastest, 0.0
    if firsts > 0:
        growth, fastest = max(growth, regime.first_growth), max(fastest, regime.fastest_first)
        fastest_first = regime.fastest_first
    steady = True
    for i in range(memory.waves.shape[0]):
        fastest = max(fastest, memory.waves[i, wave.OMEGA])
        steady &= memory.waves[i, wave.TEMPERATURE_COS] == 0.0 and memory.waves[i, wave.TEMPERATURE_SIN] == 0.0
    return Response(
        blocks,
        heated,
        firsts,
        explicits,
        aperiodics,
        b,
        f,
        coupling,
        memory.outputs,
        memory.waves,
        memory.differences,
        load.gap,
        growth,
        fastest,
        fastest_first,
        regime.two_way,
        steady and growth <= 0.0 and not regime.warms,
    )


@part
def _clear(regime: Layout, load: Load, memory: Memory) -> None:
    """Begin with the tables of the regime, and with the waves as they are given."""
    for row in range(memory.block.shape[0]):
        for k in range(memory.block.shape[1]):
            memory.block[row, k] = regime.block[row, k] if row < block.ROWS else 0.0
    for row in range(memory.first.shape[0]):
        for j in range(memory.first.shape[1]):
            memory.first[row, j] = regime.first[row, j] if row < first.ROWS else 0.0
    memory.outputs[SIGNAL], memory.outputs[TEMPERATURE] = 0.0, 0.0
    for i in range(memory.waves.shape[0]):
        for column in range(wave.COLUMNS):
            memory.waves[i, column] = load.waves[i, column] if column < wave.GIVEN else 0.0
        memory.waves[i, wave.TIME] = memory.waves[i, wave.TIME_BEFORE] = np.nan


@part
def _source(regime: Layout, load: Load, row: int, heated: bool) -> float:
    """Return the constant source of a coordinate; in the last row that of the signal."""
    steady, heating = load.steady.size, load.heating.size
    at = steady + heating
    source = regime.source[at, row] * load.mean + regime.source[at + 1, row] * load.gap
    for i in range(steady):
        source += regime.source[i, row] * load.steady[i]
    if heated:
        for i in range(heating):
            source += regime.source[steady + i, row] * load.heating[i]
    return float(source)


@part
def _wave_source(regime: Layout, load: Load, row: int, i: int) -> tuple[float, float]:
    """Return the coefficients of cos ψ and sin ψ of wave ``i`` in a source, by its load, d, d' and d''."""
    at, omega = load.steady.size + load.heating.size, load.waves[i, wave.OMEGA]
    push, place = regime.source[at, row], regime.source[at + 1, row]
    speed, acceleration = regime.source[at + 2, row], regime.source[at + 3, row]
    amplitude = load.waves[i, wave.CASING]
    sin = push * load.waves[i, wave.LOAD] + (place - acceleration * omega * omega) * amplitude
    return speed * omega * amplitude, sin


@part
def _fill_sources(regime: Layout, load: Load, firsts: int, memory: Memory) -> None:
    """Fill the sources of the signal and of first-order states."""
    f, outputs, waves, signal = memory.first, memory.outputs, memory.waves, 2 * regime.blocks + regime.firsts
    outputs[SIGNAL] = _source(regime, load, signal, memory.heated)
    for i in range(waves.shape[0]):
        waves[i, wave.SIGNAL_COS], waves[i, wave.SIGNAL_SIN] = _wave_source(regime, load, signal, i)
    for j in range(firsts):
        own = 2 * regime.blocks + j
        f[first.SOURCE, j] = _source(regime, load, own, True)
        for i in range(waves.shape[0]):
            row = i * first.WAVE
            f[first.HARMONIC_COS + row, j], f[first.HARMONIC_SIN + row, j] = _wave_source(regime, load, own, i)


@part
def _fill_force(regime: Layout, load: Load, k: int, heated: bool, memory: Memory) -> None:
    """Fill the force on a block, see the head of this module.

    Outputs are stored per η and η' but given per η and u = η' - β.
    """
    b, outputs, waves = memory.block, memory.outputs, memory.waves
    beta, gamma = _source(regime, load, k, heated), _source(regime, load, regime.blocks + k, heated)
    c = b[block.DAMPING, k]
    b[block.SOURCE, k] = beta
    b[block.FORCE, k] = gamma + c * beta
    for o in range(2):
        outputs[o] -= b[block.SIGNAL_SLOPE + 2 * o, k] * beta
    for i in range(waves.shape[0]):
        row, omega = i * block.WAVE, waves[i, wave.OMEGA]
        beta_cos, beta_sin = _wave_source(regime, load, k, i)
        gamma_cos, gamma_sin = _wave_source(regime, load, regime.blocks + k, i)
        b[block.SOURCE_COS + row, k], b[block.SOURCE_SIN + row, k] = beta_cos, beta_sin
        b[block.FORCE_COS + row, k] = omega * beta_sin + gamma_cos + c * beta_cos
        b[block.FORCE_SIN + row, k] = gamma_sin + c * beta_sin - omega * beta_cos
        for o in range(2):
            waves[i, wave.SIGNAL_COS + 2 * o] -= b[block.SIGNAL_SLOPE + 2 * o, k] * beta_cos
            waves[i, wave.SIGNAL_SIN + 2 * o] -= b[block.SIGNAL_SLOPE + 2 * o, k] * beta_sin


@part
def forced(b: Array, k: int, i: int) -> bool:
    """Whether wave ``i`` acts on a block."""
    row = i * block.WAVE
    return bool(b[block.FORCE_COS + row, k] != 0.0 or b[block.FORCE_SIN + row, k] != 0.0)


@part
def _keeps_force(b: Array, k: int, load: Load) -> bool:
    """Whether the response of a block to the loads cannot be subtracted without losing digits."""
    w2, half = b[block.STIFFNESS, k], abs(b[block.HALF_DAMPING, k])
    square = w2 - half * half
    slow = np.sqrt(w2) if square >= 0.0 else w2 / (half + np.sqrt(-square))
    if slow * load.duration < _SLOW_POLE:
        return True
    if square < 0.0:
        return False
    for i in range(load.waves.shape[0]):
        beside = load.waves[i, wave.OMEGA] - np.sqrt(square)
        distance = np.sqrt(half * half + beside * beside)
        if forced(b, k, i) and distance * load.duration < _RESONANT_POLE:
            return True
    return False


@part
def _subtract_particular(b: Array, k: int, waves: Array, outputs: Array) -> None:
    """Subtract the particular solution of a block, and add what it shows to the outputs."""
    c, w2, force = b[block.DAMPING, k], b[block.STIFFNESS, k], b[block.FORCE, k]
    b[block.SIGNAL_INTEGRAL, k] = b[block.SIGNAL_VALUE, k] / w2
    b[block.PARTICULAR, k] = force / w2
    for o in range(2):
        value, slope = b[block.SIGNAL_VALUE + 2 * o, k], b[block.SIGNAL_SLOPE + 2 * o, k]
        b[block.UNFORCED_VALUE + 2 * o, k], b[block.UNFORCED_SLOPE + 2 * o, k] = value, slope
        outputs[o] += value * force / w2
    for i in range(waves.shape[0]):
        if not forced(b, k, i):
            continue
        row, omega = i * block.WAVE, waves[i, wave.OMEGA]
        pair = complex(b[block.FORCE_COS + row, k], -b[block.FORCE_SIN + row, k])
        pair = elementary.quotient(pair, complex(w2 - omega * omega, c * omega))
        cos, sin = pair.real, -pair.imag
        b[block.PARTICULAR_COS + row, k], b[block.PARTICULAR_SIN + row, k] = cos, sin
        for o in range(2):
            value, slope = b[block.SIGNAL_VALUE + 2 * o, k], b[block.SIGNAL_SLOPE + 2 * o, k]
            waves[i, wave.SIGNAL_COS + 2 * o] += value * cos + slope * omega * sin
            waves[i, wave.SIGNAL_SIN + 2 * o] += value * sin - slope * omega * cos


@part
def _subtract_thermal_response(b: Array, k: int, f: Array, j: int, coupling: Array) -> None:
    """Subtract the response η = a ξ + b ξ' of a block to a first-order state: outputs then see it in ξ and ξ'."""
    at, lag = coupling[1, j, k], coupling[2, j, k]
    speed = at - lag * f[first.RATE, j]
    for o in range(2):
        value, slope = b[block.SIGNAL_VALUE + 2 * o, k], b[block.SIGNAL_SLOPE + 2 * o, k]
        f[first.SIGNAL_VALUE + 2 * o, j] += value * at
        f[first.SIGNAL_SLOPE + 2 * o, j] += value * lag + slope * speed
    b[block.HEAT_JUMP_VALUE, k] -= at * f[first.HEAT_JUMP_VALUE, j] + lag * f[first.HEAT_JUMP_SLOPE, j]
    b[block.HEAT_JUMP_SLOPE, k] -= speed * f[first.HEAT_JUMP_SLOPE, j]


@part
def _subtract_harmonics(f: Array, j: int, waves: Array) -> None:
    """Subtract the response of a first-order state to its waves, which lie in the rows of the harmonics."""
    f[first.WARMING, j] = f[first.TEMPERATURE_VALUE, j] - f[first.TEMPERATURE_SLOPE, j] * f[first.RATE, j]
    for i in range(waves.shape[0]):
        row = i * first.WAVE
        cos, sin = f[first.HARMONIC_COS + row, j], f[first.HARMONIC_SIN + row, j]
        if cos != 0.0 or sin != 0.0:
            pair = elementary.quotient(complex(cos, -sin), complex(f[first.RATE, j], waves[i, wave.OMEGA]))
            f[first.HARMONIC_COS + row, j], f[first.HARMONIC_SIN + row, j] = pair.real, -pair.imag
            for o in range(2):
                waves[i, wave.SIGNAL_COS + 2 * o] += f[first.SIGNAL_VALUE + 2 * o, j] * pair.real
                waves[i, wave.SIGNAL_SIN + 2 * o] += f[first.SIGNAL_VALUE + 2 * o, j] * -pair.imag


@part
def casing_at(r: Response, t: float) -> tuple[float, float]:
    """Return the place of the casing d = d0 + Σ a sin ψ, m, and its velocity, m/s."""
    place, speed = r.gap, 0.0
    for i in range(r.waves.shape[0]):
        cos, sin = wave_phase(r.waves, i, t)
        place += r.waves[i, wave.CASING] * sin
        speed += r.waves[i, wave.OMEGA] * (r.waves[i, wave.CASING] * cos)
    return place, speed


@part
def _add_response(r: Response, y: Array, t: float, sign: float, value: Array, slope: Array) -> None:
    """Add their response to the loads and to first-order states to η and η' of blocks, or subtract it (``sign`` -1)."""
    b = r.block
    for k in range(r.blocks):
        value[k] += sign * b[block.PARTICULAR, k]
    for i in range(r.waves.shape[0]):
        row, omega = i * block.WAVE, r.waves[i, wave.OMEGA]
        cos, sin = wave_phase(r.waves, i, t)
        for k in range(r.blocks):
            a_cos, a_sin = b[block.PARTICULAR_COS + row, k], b[block.PARTICULAR_SIN + row, k]
            value[k] += sign * (a_cos * cos + a_sin * sin)
            slope[k] += sign * (omega * (a_sin * cos - a_cos * sin))
    for j in range(r.firsts):
        xi, speed, mu = y[state.FIRST, j], y[state.FIRST_SLOPE, j], r.first[first.RATE, j]
        for k in range(r.blocks):
            at, lag = r.coupling[1, j, k], r.coupling[2, j, k]
            if b[block.EXPLICIT, k] == 0.0:
                value[k] += sign * (at * xi + lag * speed)
                slope[k] += sign * ((at - lag * mu) * speed)


@part
def from_coordinates(r: Response, coordinates: Array, t: float, y: Array) -> None:
    """Fill the state ``y`` of time t from the coordinates [η, u, ξ]: the response to the loads is subtracted."""
    f = r.first
    for j in range(r.firsts):
        xi = coordinates[2 * r.blocks + j]
        for i in range(r.waves.shape[0]):
            cos, sin = wave_phase(r.waves, i, t)
            row = i * first.WAVE
            xi = xi - f[first.HARMONIC_COS + row, j] * cos - f[first.HARMONIC_SIN + row, j] * sin
        y[state.FIRST, j], y[state.FIRST_SLOPE, j] = xi, f[first.SOURCE, j] - f[first.RATE, j] * xi
    for k in range(r.blocks):
        y[state.VALUE, k], y[state.SLOPE, k] = coordinates[k], coordinates[r.blocks + k]
    _add_sources(r, t, 1.0, y[state.SLOPE])
    _add_response(r, y, t, -1.0, y[state.VALUE], y[state.SLOPE])


@part
def _add_sources(r: Response, t: float, sign: float, slope: Array) -> None:
    """Add the sources β = η' - u of blocks to their slopes, or subtract them (``sign`` -1)."""
    for k in range(r.blocks):
        slope[k] += sign * r.block[block.SOURCE, k]
    for i in range(r.waves.shape[0]):
        cos, sin = wave_phase(r.waves, i, t)
        row = i * block.WAVE
        for k in range(r.blocks):
            slope[k] += sign * (r.block[block.SOURCE_COS + row, k] * cos + r.block[block.SOURCE_SIN + row, k] * sin)


@part
def to_coordinates(r: Response, y: Array, t: float, coordinates: Array) -> None:
    """Fill the coordinates [η, u, ξ] from the state ``y`` of time t: the inverse of :func:`from_coordinates`."""
    f = r.first
    for j in range(r.firsts):
        xi = y[state.FIRST, j]
        for i in range(r.waves.shape[0]):
            cos, sin = wave_phase(r.waves, i, t)
            row = i * first.WAVE
            xi = xi + f[first.HARMONIC_COS + row, j] * cos + f[first.HARMONIC_SIN + row, j] * sin
        coordinates[2 * r.blocks + j] = xi
    for k in range(r.blocks):
        coordinates[k], coordinates[r.blocks + k] = y[state.VALUE, k], y[state.SLOPE, k]
    value, slope = coordinates[: r.blocks], coordinates[r.blocks : 2 * r.blocks]
    _add_response(r, y, t, 1.0, value, slope)
    _add_sources(r, t, -1.0, slope)
