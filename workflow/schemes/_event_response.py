"""How a regime responds to the loads of one case, and the state that is left to move freely.

The tip load is F0 + F1 sin ψ with ψ = Ω t + φ; a harmonic is a pair of coefficients of cos ψ and
sin ψ. What responds well to the loads is split off as a particular solution, so that the rest is
free motion and costs one exponential per block. A block that does not respond well (rigid or slow,
at resonance with the load or with a thermal state) is *explicit*: it keeps its forces and is
advanced by its Taylor series, which needs no division and is exact for every ω² and c.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.models import Array
from workflow.schemes._event_functions import (
    AREA,
    BLOCK_ROWS,
    DAMPING,
    EXPLICIT,
    FIRST,
    FIRST_ROWS,
    FORCE,
    FORCE_COS,
    FORCE_SIN,
    HALF,
    HEAT_FIRST,
    HEAT_PACE,
    HEAT_SLOPE,
    HEAT_SPEED,
    HEAT_VALUE,
    KICK_FIRST,
    KICK_PACE,
    KICK_SLOPE,
    KICK_VALUE,
    OFFSET,
    OFFSET_SIN,
    OMEGA,
    PACE,
    PERIOD,
    PHASE,
    RATE,
    SEEN,
    SEEN_SLOPE,
    SHIFT,
    SHIFT_COS,
    SHIFT_SIN,
    SLOPE,
    SOURCE,
    SPECIAL,
    STIFFNESS,
    TURN,
    VALUE,
    WAVE_COS,
    WAVE_SIN,
    padded,
)
from workflow.schemes._event_regimes import Regime
from workflow.schemes._kernel import part, rare

SLOW = 0.3
"""A block whose slowest pole turns by less than this over the duration keeps its forces explicit:
splitting off F/ω² would cancel digits like (slow pole · duration)⁻²."""


RESONANT = 0.1
"""Likewise for a block whose pole stays this near (times the duration) to that of the load."""


ORDER, TAYLOR_SPAN = 18, 0.6
"""Order of Taylor polynomials, and largest (pole · time) they are used for: 0.6^18/18! < 2e-20."""


class Load(NamedTuple):
    """Loads of one case: F0 + F1 sin(Ω t + φ) at the tip, constants, gap and duration."""

    mean: float
    amplitude: float
    omega: float
    phase: float
    gap: float
    duration: float
    steady: Array
    heating: Array


class Response(NamedTuple):
    """A regime seen by one case: signal and tip temperature of its motion and its loads.

    Tables have a row per quantity and a column per block or first-order state, filled up with still
    ones to a multiple of 8. Every ``*_wave`` is a pair (cos ψ, sin ψ).
    """

    blocks: int
    firsts: int
    block: Array
    """Rows: c, ω², ω, 1/ω (0 where ω = 0), c/2, ν (1 where it does not oscillate), explicit or not;
    signal per η and η' of blocks that are not explicit, and its integral per decrease of η' + c η; signal and tip
    temperature per η and η'; forces of explicit blocks; β; particular solution of the others; jump
    of η and η' per unit heat at the tip; scratch."""
    first: Array
    """Rows: μ; signal and tip temperature per ξ and ξ'; constant source, harmonic response; jump of ξ
    and ξ' per unit heat at the tip; scratch."""
    specials: int
    """How many blocks are explicit or do not oscillate; the row SPECIAL lists them."""
    coupling: Array
    """See :class:`Regime`."""
    signal: float
    signal_wave: tuple[float, float]
    heat: float
    heat_wave: tuple[float, float]
    load_omega: float
    load_phase: float
    growth: float
    """Largest rate at which a free block or state grows, 1/s."""
    fastest: float
    """Bound of all poles, 1/s."""
    fastest_first: float
    """Largest rate of a first-order state, 1/s."""
    two_way: bool
    """Whether blocks show in the tip temperature or their slopes in the signal."""


class Tables(NamedTuple):
    """Memory for one regime of one case, all zeros to begin with."""

    block: Array
    first: Array
    coordinates: Array
    """Coordinates; constant sources of them, and those of sin ψ, ``(3, N)``."""
    motion: Array
    """States: now, after the step, spare, ``(3, 4, column)``."""
    sums: Array
    terms: Array
    derivatives: Array
    """See :class:`~workflow.schemes._event_search.Expansion`."""


def tables(blocks: int, firsts: int) -> Tables:
    """Return empty tables."""
    columns, wide = padded(blocks), padded(firsts)
    return Tables(
        np.zeros((BLOCK_ROWS, columns)),
        np.zeros((FIRST_ROWS, wide)),
        np.zeros((3, 2 * blocks + firsts)),
        np.zeros((3, 4, max(columns, wide))),
        np.zeros((9, blocks + 1)),
        np.zeros((8, columns)),
        np.zeros(ORDER + 1),
    )


class Layout(NamedTuple):
    """A regime as the march takes it: few arrays, since each costs compilation in every kernel."""

    block: Array
    """Rows: damping, stiffness, near, signal and tip temperature per value and slope, ``(7, block)``."""
    first: Array
    """Rows: rate, signal and tip temperature per first-order state, ``(3, first)``."""
    coupling: Array
    source: Array
    """Sources [β, γ, χ] and, last, the signal, per steady load, heating, tip load and gap,
    ``(N + 1, mechanical + thermal + 2)``."""
    enter: Array
    leave: Array
    """Coordinates from raw ones and the gap, and back, ``(raw + 1, N)`` and ``(N + 1, raw)``."""


def layout(g: Regime) -> Layout:
    """Lay a regime out."""
    heating = np.zeros(g.source_heating.shape[1])
    source = np.column_stack([g.source_steady, g.source_heating, g.source_tip, g.source_gap])
    signal = np.concatenate([g.signal_steady, heating, [g.signal_tip, g.signal_gap]])
    return Layout(
        np.stack([g.damping, g.stiffness, g.near, g.signal_value, g.signal_slope, g.heat_value, g.heat_slope]),
        np.stack([g.rate, g.signal_first, g.heat_first]),
        g.coupling,
        np.concatenate([source, signal[None]]),
        np.concatenate([g.enter, g.enter_gap[None]]),
        np.concatenate([g.leave, g.leave_gap[None]]),
    )


VALUES, SLOPES, FIRSTS, PACES = range(4)
"""Rows of a state, loads split off where they are: η, η' per block, ξ, ξ' per first-order state."""


@part
def copy_motion(source: Array, target: Array) -> None:
    """Copy a state."""
    for row in range(4):
        for k in range(source.shape[1]):
            target[row, k] = source[row, k]


@part
def _keeps_forces(c: float, w2: float, forced: bool, load_omega: float, duration: float) -> bool:
    """Whether a block's response to the loads cannot be split off without losing digits."""
    half = 0.5 * abs(c)
    turn = w2 - half * half
    slow = np.sqrt(w2) if turn >= 0.0 else w2 / (half + np.sqrt(-turn))
    if slow * duration < SLOW:
        return True
    if not forced or turn < 0.0:
        return False
    return bool(np.hypot(half, load_omega - np.sqrt(turn)) * duration < RESONANT)


@rare
def _sources(regime: Layout, load: Load, heated: bool, constant: Array, harmonic: Array) -> None:
    """Fill the sources [β, γ, χ] of all coordinates: constant ones, and those of sin ψ."""
    steady, heating = load.steady.size, load.heating.size
    for k in range(constant.size):
        source = regime.source[k, steady + heating] * load.mean + regime.source[k, steady + heating + 1] * load.gap
        for i in range(steady):
            source += regime.source[k, i] * load.steady[i]
        if heated:
            for i in range(heating):
                source += regime.source[k, steady + i] * load.heating[i]
        constant[k] = source
        harmonic[k] = regime.source[k, steady + heating] * load.amplitude


@part
def _quotient(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """Return (a + ib)/(c + id) by Smith's division, as numba has it but nothing to raise."""
    if abs(c) >= abs(d):
        ratio = d / c
        whole = c + d * ratio
        return (a + b * ratio) / whole, (b - a * ratio) / whole
    ratio = c / d
    whole = c * ratio + d
    return (a * ratio + b) / whole, (b * ratio - a) / whole


@rare
def respond(regime: Layout, load: Load, heat_shape: Array, firsts: int, tables: Tables) -> Any:
    """Return the response of a regime to the loads of one case; ``firsts`` is 0 without heat.

    ``heat_shape`` is χ_n where first-order states are the thermal modes and blocks the free ones.
    """
    blocks = regime.block.shape[1]
    wave, steady, heating = load.omega, load.steady.size, load.heating.size
    b, f, constant, harmonic = tables.block, tables.first, tables.coordinates[1], tables.coordinates[2]
    _sources(regime, load, firsts > 0, constant, harmonic)
    for k in range(b.shape[1]):
        b[TURN, k] = b[STIFFNESS, k] = 1.0
    specials = 0
    last = regime.source.shape[0] - 1
    signal = regime.source[last, steady + heating] * load.mean + regime.source[last, steady + heating + 1] * load.gap
    for i in range(steady):
        signal += regime.source[last, i] * load.steady[i]
    signal_cos, signal_sin = 0.0, regime.source[last, steady + heating] * load.amplitude
    heat, heat_cos, heat_sin = 0.0, 0.0, 0.0
    growth, fastest, fastest_first, two_way = 0.0, wave, 0.0, False
    b[PHASE, 0] = np.nan
    for j in range(firsts):
        f[RATE, j], f[FIRST, j], f[HEAT_FIRST, j] = regime.first[0, j], regime.first[1, j], regime.first[2, j]
        f[SOURCE, j] = constant[2 * blocks + j]
        growth, fastest_first = max(growth, -f[RATE, j]), max(fastest_first, abs(f[RATE, j]))
    fastest = max(fastest, fastest_first)
    for j in range(min(firsts, heat_shape.size)):
        f[KICK_FIRST, j], f[KICK_PACE, j] = heat_shape[j], -f[RATE, j] * heat_shape[j]
    for k in range(blocks):
        c, w2, value, slope = regime.block[0, k], regime.block[1, k], regime.block[3, k], regime.block[4, k]
        heat_value, heat_slope = regime.block[5, k], regime.block[6, k]
        two_way = two_way or slope != 0.0 or heat_value != 0.0 or heat_slope != 0.0
        growth, fastest = max(growth, -c), max(fastest, max(np.sqrt(w2), abs(c)))
        b[DAMPING, k], b[STIFFNESS, k], b[HALF, k] = c, w2, 0.5 * c
        b[VALUE, k], b[SLOPE, k], b[HEAT_VALUE, k], b[HEAT_SLOPE, k] = value, slope, heat_value, heat_slope
        oscillates = w2 > 0.25 * c * c
        if oscillates:
            b[TURN, k] = np.sqrt(w2 - 0.25 * c * c)
        beta, beta_sin = constant[k], harmonic[k]
        # η'' + c η' + ω² η = γ + c β + β'
        force = constant[blocks + k] + c * beta
        force_cos = wave * beta_sin
        force_sin = harmonic[blocks + k] + c * beta_sin
        b[OFFSET, k], b[OFFSET_SIN, k] = beta, beta_sin
        b[FORCE, k], b[FORCE_COS, k], b[FORCE_SIN, k] = force, force_cos, force_sin
        signal -= slope * beta
        signal_sin -= slope * beta_sin
        heat -= heat_slope * beta
        heat_sin -= heat_slope * beta_sin
        forced = force_cos != 0.0 or force_sin != 0.0
        near = firsts > 0 and regime.block[2, k] > 0.0
        explicit = near or _keeps_forces(c, w2, forced, wave, load.duration)
        if explicit or not oscillates:
            b[SPECIAL, specials] = k
            specials += 1
        if explicit:
            b[EXPLICIT, k] = 1.0
            continue
        b[SEEN, k], b[SEEN_SLOPE, k], b[AREA, k] = value, slope, value / w2
        b[SHIFT, k] = force / w2
        signal += value * force / w2
        heat += heat_value * force / w2
        if forced:
            h_cos, opposite = _quotient(force_cos, -force_sin, w2 - wave * wave, c * wave)
            h_sin = -opposite
            b[SHIFT_COS, k], b[SHIFT_SIN, k] = h_cos, h_sin
            signal_cos += value * h_cos + slope * wave * h_sin
            signal_sin += value * h_sin - slope * wave * h_cos
            heat_cos += heat_value * h_cos + heat_slope * wave * h_sin
            heat_sin += heat_value * h_sin - heat_slope * wave * h_cos
        for j in range(firsts):
            a, rest = regime.coupling[1, k, j], regime.coupling[2, k, j]
            speed = a - rest * f[RATE, j]
            f[FIRST, j] += value * a
            f[PACE, j] += value * rest + slope * speed
            f[HEAT_FIRST, j] += heat_value * a
            f[HEAT_PACE, j] += heat_value * rest + heat_slope * speed
            b[KICK_VALUE, k] -= a * f[KICK_FIRST, j] + rest * f[KICK_PACE, j]
            b[KICK_SLOPE, k] -= speed * f[KICK_PACE, j]
    for k in range(blocks, b.shape[1]):
        b[STIFFNESS, k] = max(1.0, b[STIFFNESS, max(blocks - 1, 0)])
    for k in range(b.shape[1]):
        b[OMEGA, k] = np.sqrt(b[STIFFNESS, k])
        b[PERIOD, k] = 1.0 / b[OMEGA, k] if b[OMEGA, k] > 0.0 else 0.0
    for j in range(firsts):
        f[HEAT_SPEED, j] = f[HEAT_FIRST, j] - f[HEAT_PACE, j] * f[RATE, j]
        sine = harmonic[2 * blocks + j]
        if sine != 0.0:
            f[WAVE_COS, j], opposite = _quotient(0.0, -sine, f[RATE, j], wave)
            f[WAVE_SIN, j] = -opposite
            signal_cos += f[FIRST, j] * f[WAVE_COS, j]
            signal_sin += f[FIRST, j] * f[WAVE_SIN, j]
            heat_cos += f[HEAT_FIRST, j] * f[WAVE_COS, j]
            heat_sin += f[HEAT_FIRST, j] * f[WAVE_SIN, j]
    return Response(
        blocks,
        firsts,
        b,
        f,
        specials,
        regime.coupling,
        signal,
        (signal_cos, signal_sin),
        heat,
        (heat_cos, heat_sin),
        wave,
        load.phase,
        growth,
        fastest,
        fastest_first,
        two_way,
    )


@part
def load_motion(r: Response, coordinates: Array, t: float, motion: Array) -> None:
    """Split the loads' response off the coordinates [η, u, ξ] of time t."""
    b, f, y = r.block, r.first, motion
    cos, sin = np.cos(r.load_omega * t + r.load_phase), np.sin(r.load_omega * t + r.load_phase)
    for j in range(r.firsts):
        y[FIRSTS, j] = coordinates[2 * r.blocks + j] - f[WAVE_COS, j] * cos - f[WAVE_SIN, j] * sin
        y[PACES, j] = f[SOURCE, j] - f[RATE, j] * y[FIRSTS, j]
    for k in range(r.blocks):
        value = coordinates[k]
        slope = coordinates[r.blocks + k] + b[OFFSET, k] + b[OFFSET_SIN, k] * sin
        if b[EXPLICIT, k] == 0.0:
            value -= b[SHIFT, k] + b[SHIFT_COS, k] * cos + b[SHIFT_SIN, k] * sin
            slope -= r.load_omega * (b[SHIFT_SIN, k] * cos - b[SHIFT_COS, k] * sin)
            for j in range(r.firsts):
                a, rest = r.coupling[1, k, j], r.coupling[2, k, j]
                value -= a * y[FIRSTS, j] + rest * y[PACES, j]
                slope -= (a - rest * f[RATE, j]) * y[PACES, j]
        y[VALUES, k], y[SLOPES, k] = value, slope


@part
def store_motion(r: Response, motion: Array, t: float, coordinates: Array) -> None:
    """Return to the coordinates [η, u, ξ]: the inverse of :func:`load_motion`."""
    b, f, y = r.block, r.first, motion
    cos, sin = np.cos(r.load_omega * t + r.load_phase), np.sin(r.load_omega * t + r.load_phase)
    for j in range(r.firsts):
        coordinates[2 * r.blocks + j] = y[FIRSTS, j] + f[WAVE_COS, j] * cos + f[WAVE_SIN, j] * sin
    for k in range(r.blocks):
        value, slope = y[VALUES, k], y[SLOPES, k]
        if b[EXPLICIT, k] == 0.0:
            value += b[SHIFT, k] + b[SHIFT_COS, k] * cos + b[SHIFT_SIN, k] * sin
            slope += r.load_omega * (b[SHIFT_SIN, k] * cos - b[SHIFT_COS, k] * sin)
            for j in range(r.firsts):
                a, rest = r.coupling[1, k, j], r.coupling[2, k, j]
                value += a * y[FIRSTS, j] + rest * y[PACES, j]
                slope += (a - rest * f[RATE, j]) * y[PACES, j]
        coordinates[k] = value
        coordinates[r.blocks + k] = slope - b[OFFSET, k] - b[OFFSET_SIN, k] * sin
