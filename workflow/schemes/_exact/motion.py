"""The motion of a case between events: what is left when the particular solution of its loads is subtracted.

Loads and casing are constants and waves of phase ψ = Ω t + φ, pairs of coefficients of cos ψ and sin ψ. Of a block

    η' = u + β,   u' = -c u - ω² η + γ,   β = β0 + Σ (βc cos ψ + βs sin ψ), γ likewise, that is
    η'' + c η' + ω² η = F = γ + c β + β'

the particular solution η of F and u = η' - β are subtracted: the rest is free motion and costs one exponential. Where
that would lose digits (slow blocks, resonance with a wave) the block is *explicit*: it keeps its force, see
:func:`~workflow.schemes._exact.propagation._advance_explicit`, and only -β is subtracted from u, which leaves η'.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array, elementary
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import inlined, part
from workflow.kernels.packs import view
from workflow.schemes._exact.rank_one import reciprocal
from workflow.schemes._exact.tables import block, first, seen, seen_wave, state, wave

ORDER = 18
"""Largest order of Taylor polynomials of motions."""

_SLOW_POLE = 0.3
"""Slowest pole times the duration, x, below which a block is explicit: F/ω² would lose digits like x⁻²."""

_RESONANT_POLE = 0.1
"""Distance of a pole to that of a wave, times the duration, below which a block is explicit."""

SIGNAL, TEMPERATURE, PLACE, OUTPUTS = 0, 1, 2, 3
"""Outputs of a contact: the signal whose fall through zero ends its present state (gap, m, or contact force, N), the
temperature, K, and the position of the casing, m; and how many they are."""


class Expansion(NamedTuple):
    """Memory of an expansion, with the rows of ``tables.expansion``.

    :func:`~workflow.schemes._exact.expansion.expand` fills the first and the last column of the sums,
    :func:`~workflow.schemes._exact.expansion.accumulate` those between.
    """

    sums: Array
    """``(9, block + 1)``."""
    terms: Array
    """``(9, column)``; scratch."""
    derivatives: Array
    """Derivatives of the signal, ``(ORDER + 1,)``; scratch."""
    explicit: Array
    """Derivatives of an explicit block, ``(ORDER + 2,)``; scratch."""


class Motion(NamedTuple):
    """The linear system of a set of contacts under the loads of one case, and states with rows of ``tables.state``."""

    blocks: int
    firsts: int
    explicits: int
    aperiodics: int
    """Numbers of blocks, of first-order states, of explicit blocks, and of other blocks that do not oscillate."""
    block: Array
    first: Array
    outputs: Array
    """Signal and temperature by constant loads alone, and d0 of the casing, of one contact after the other."""
    waves: Array
    """With the columns of ``tables.wave``."""
    differences: Complex
    """Divided differences of an explicit block, ``(9, 4)``; scratch."""
    expansion: Expansion
    now: Array
    """State at the beginning of the present step."""
    after: Array
    """State at its end."""
    between: Array
    """State at some time within it; scratch."""
    growth: float
    """Largest rate at which a block or first-order state grows, 1/s, not negative."""
    fastest: float
    """Bound of all poles and of the Ω of waves, 1/s."""
    heated: bool
    """Whether there are thermal modes."""
    cooling: bool
    """Whether the tip temperature is a constant plus decaying exponentials: no blocks, waves or growing states."""
    contact: int
    """Whose signal and temperature are looked at …"""
    rows: int
    """… and its first row in ``block``, …"""
    slow: int
    """… in ``first``, …"""
    columns: int
    """… and its first column in ``waves``."""


_CONTACT = Motion._fields.index("contact")
"""Fields of a motion before those of a contact."""


@inlined
def place_of(waves: int, c: int) -> tuple[int, int, int]:
    """Return the first rows of contact ``c`` in the tables of blocks and of first-order states, its first column."""
    rows, slow = block.ROWS + block.WAVE * waves, first.ROWS + first.WAVE * waves
    return rows + seen.ROWS * c, slow + first.SEEN * c, wave.COLUMNS + seen_wave.COLUMNS * c


@inlined
def seen_by(m: Motion, c: int) -> Motion:
    """Return the motion as contact ``c`` sees it: poles, states and propagators are the same for all."""
    fields: Any = (*m[:_CONTACT], c, *place_of(m.waves.shape[0], c))
    return Motion(*fields)


class LoadedTables(NamedTuple):
    """Tables of a motion that depend on loads, see :class:`Motion`."""

    block: Array
    first: Array
    outputs: Array
    waves: Array


def loaded_size(columns: int, wide: int, waves: int, contacts: int) -> int:
    """Return the count of numbers of :class:`LoadedTables`."""
    shared = block.ROWS * columns + first.ROWS * wide
    shared += waves * (block.WAVE * columns + first.WAVE * wide + wave.COLUMNS)
    return shared + contacts * (seen.ROWS * columns + first.SEEN * wide + waves * seen_wave.COLUMNS + OUTPUTS)


@part
def loaded_tables(numbers: Array, columns: int, wide: int, waves: int, contacts: int) -> tuple[LoadedTables, int]:
    """Return the tables at the beginning of a row of numbers, and the place behind them."""
    rows, slow, across = place_of(waves, contacts)  # those behind the last contact
    b, at = view(numbers, 0, (rows, columns)), rows * columns
    f, at = view(numbers, at, (slow, wide)), at + slow * wide
    w, end = view(numbers, at, (waves, across)), at + waves * across
    return LoadedTables(b, f, view(numbers, end, (OUTPUTS * contacts,)), w), end + OUTPUTS * contacts


@part
def _evaluate(waves: Array, i: int, t: float) -> None:
    """Store cosine and sine of the phase Ω t + φ of a wave in its table, and keep those of the last time."""
    cos, sin = waves[i, wave.COS_BEFORE], waves[i, wave.SIN_BEFORE]
    if waves[i, wave.TIME_BEFORE] != t:
        sin, cos = elementary.sine_cosine(waves[i, wave.OMEGA] * t + waves[i, wave.PHASE])
    waves[i, wave.TIME_BEFORE] = waves[i, wave.TIME]
    waves[i, wave.COS_BEFORE], waves[i, wave.SIN_BEFORE] = waves[i, wave.COS], waves[i, wave.SIN]
    waves[i, wave.TIME], waves[i, wave.COS], waves[i, wave.SIN] = t, cos, sin


@inlined
def wave_phase(waves: Array, i: int, t: float) -> tuple[float, float]:
    """Return cosine and sine of the phase of a wave; those of the last two times are cached."""
    if waves[i, wave.TIME] != t:
        _evaluate(waves, i, t)
    return waves[i, wave.COS], waves[i, wave.SIN]


@inlined
def fastest_of(poles: float, waves: Array) -> float:
    """Return the bound of all poles and of the Ω of waves."""
    for i in range(waves.shape[0]):
        poles = max(poles, waves[i, wave.OMEGA])
    return poles


@part
def copy_tables(blocks: Array, firsts: Array, waves: Array, loaded: LoadedTables) -> None:
    """Copy the tables of a system and the waves of a case."""
    for row in range(block.ROWS):
        for k in range(blocks.shape[1]):
            loaded.block[row, k] = blocks[row, k]
    for row in range(first.ROWS):
        for j in range(firsts.shape[1]):
            loaded.first[row, j] = firsts[row, j]
    for i in range(loaded.waves.shape[0]):
        for column in range(wave.GIVEN):
            loaded.waves[i, column] = waves[i, column]
        loaded.waves[i, wave.TIME] = loaded.waves[i, wave.TIME_BEFORE] = np.nan


@part
def subtract_loads(loaded: LoadedTables, blocks: int, firsts: int, duration: float) -> tuple[int, int]:
    """Fill what is subtracted; return the numbers of explicit blocks and of other blocks that do not oscillate."""
    b, explicits, aperiodics = loaded.block, 0, 0
    for k in range(blocks):
        if _is_explicit(b, k, loaded.waves, duration):
            b[block.EXPLICIT_COLUMNS, explicits] = k
            explicits += 1
        else:
            if b[block.STIFFNESS, k] <= 0.25 * b[block.DAMPING, k] * b[block.DAMPING, k]:
                b[block.APERIODIC_COLUMNS, aperiodics] = k
                aperiodics += 1
            _subtract_particular(b, k, loaded.waves)
    for j in range(firsts):
        _subtract_harmonics(loaded.first, j, loaded.waves)
    return explicits, aperiodics


@part
def add_load_outputs(loaded: LoadedTables, blocks: int, firsts: int, explicits: int, c: int) -> None:
    """Add what is subtracted to the outputs of the loads at a contact, and fill the integrals of its signal."""
    b, rows = loaded.block, place_of(loaded.waves.shape[0], c)[0]
    for k in range(blocks):
        b[rows + seen.SIGNAL_INTEGRAL, k] = b[rows + seen.SIGNAL_VALUE, k] / b[block.STIFFNESS, k]
        _add_particular_outputs(loaded, k, c)
    for i in range(explicits):
        b[rows + seen.SIGNAL_INTEGRAL, int(b[block.EXPLICIT_COLUMNS, i])] = 0.0
    for j in range(firsts):
        _add_harmonic_outputs(loaded, j, c)


@part
def fill_force(b: Array, k: int, beta: float, gamma: float) -> None:
    """Fill the constant force F on a block, and -β."""
    b[block.PARTICULAR_SLOPE, k], b[block.FORCE, k] = -beta, gamma + b[block.DAMPING, k] * beta


@part
def fill_wave_force(
    b: Array, k: int, i: int, omega: float, beta: tuple[float, float], gamma: tuple[float, float]
) -> None:
    """Fill the force F by wave ``i`` on a block, and -β, from coefficients of cos ψ and sin ψ."""
    row, c, (beta_cos, beta_sin), (gamma_cos, gamma_sin) = i * block.WAVE, b[block.DAMPING, k], beta, gamma
    b[block.PARTICULAR_SLOPE_COS + row, k], b[block.PARTICULAR_SLOPE_SIN + row, k] = -beta_cos, -beta_sin
    b[block.FORCE_COS + row, k] = omega * beta_sin + gamma_cos + c * beta_cos
    b[block.FORCE_SIN + row, k] = gamma_sin + c * beta_sin - omega * beta_cos


@part
def forced(b: Array, k: int, i: int) -> bool:
    """Whether wave ``i`` acts on a block."""
    row = i * block.WAVE
    return bool(b[block.FORCE_COS + row, k] != 0.0 or b[block.FORCE_SIN + row, k] != 0.0)


@part
def _is_explicit(b: Array, k: int, waves: Array, duration: float) -> bool:
    """Whether the response of a block to the loads cannot be subtracted without losing digits."""
    w2, half = b[block.STIFFNESS, k], abs(b[block.HALF_DAMPING, k])
    square = w2 - half * half
    slow = np.sqrt(w2) if square >= 0.0 else w2 / (half + np.sqrt(-square))
    if slow * duration < _SLOW_POLE:
        return True
    if square < 0.0:
        return False
    for i in range(waves.shape[0]):
        beside = waves[i, wave.OMEGA] - np.sqrt(square)
        distance = np.sqrt(half * half + beside * beside)
        if forced(b, k, i) and distance * duration < _RESONANT_POLE:
            return True
    return False


@part
def _subtract_particular(b: Array, k: int, waves: Array) -> None:
    """Fill the rows of the particular solution of a block: η, and η' beside -β."""
    c, w2 = b[block.DAMPING, k], b[block.STIFFNESS, k]
    b[block.PARTICULAR, k] = b[block.FORCE, k] / w2
    for i in range(waves.shape[0]):
        if forced(b, k, i):
            row, omega = i * block.WAVE, waves[i, wave.OMEGA]
            pair = complex(b[block.FORCE_COS + row, k], -b[block.FORCE_SIN + row, k])
            pair *= reciprocal(complex(w2 - omega * omega, c * omega))
            cos, sin = pair.real, -pair.imag
            b[block.PARTICULAR_COS + row, k], b[block.PARTICULAR_SIN + row, k] = cos, sin
            b[block.PARTICULAR_SLOPE_COS + row, k] += omega * sin
            b[block.PARTICULAR_SLOPE_SIN + row, k] -= omega * cos


@part
def _add_particular_outputs(loaded: LoadedTables, k: int, c: int) -> None:
    """Add the particular solution of a block to the outputs of the loads at a contact."""
    b, waves, (rows, _, columns) = loaded.block, loaded.waves, place_of(loaded.waves.shape[0], c)
    for o in range(2):
        value, slope = b[rows + seen.SIGNAL_VALUE + 2 * o, k], b[rows + seen.SIGNAL_SLOPE + 2 * o, k]
        loaded.outputs[OUTPUTS * c + o] += value * b[block.PARTICULAR, k] + slope * b[block.PARTICULAR_SLOPE, k]
        for i in range(waves.shape[0]):
            for part_of in range(2):  # cos, sin
                row = i * block.WAVE + part_of
                shown = value * b[block.PARTICULAR_COS + row, k] + slope * b[block.PARTICULAR_SLOPE_COS + row, k]
                waves[i, columns + seen_wave.SIGNAL_COS + 2 * o + part_of] += shown


@part
def _subtract_harmonics(f: Array, j: int, waves: Array) -> None:
    """Replace the sources of a first-order state in the rows of the harmonics by the response to them."""
    for i in range(waves.shape[0]):
        row = i * first.WAVE
        cos, sin = f[first.HARMONIC_COS + row, j], f[first.HARMONIC_SIN + row, j]
        if cos != 0.0 or sin != 0.0:
            pair = complex(cos, -sin) * reciprocal(complex(f[first.RATE, j], waves[i, wave.OMEGA]))
            f[first.HARMONIC_COS + row, j], f[first.HARMONIC_SIN + row, j] = pair.real, -pair.imag


@part
def _add_harmonic_outputs(loaded: LoadedTables, j: int, c: int) -> None:
    """Add the response of a first-order state to the outputs of the waves at a contact."""
    f, waves, (_, slow, columns) = loaded.first, loaded.waves, place_of(loaded.waves.shape[0], c)
    for i in range(waves.shape[0]):
        cos, sin = f[first.HARMONIC_COS + i * first.WAVE, j], f[first.HARMONIC_SIN + i * first.WAVE, j]
        for o in range(2):
            waves[i, columns + seen_wave.SIGNAL_COS + 2 * o] += f[slow + o, j] * cos
            waves[i, columns + seen_wave.SIGNAL_SIN + 2 * o] += f[slow + o, j] * sin


@part
def casing_at(m: Motion, t: float) -> tuple[float, float]:
    """Return the position of the casing d = d0 + Σ a sin ψ at the contact, m, and its velocity, m/s."""
    place, speed = m.outputs[OUTPUTS * m.contact + PLACE], 0.0
    for i in range(m.waves.shape[0]):
        cos, sin = wave_phase(m.waves, i, t)
        by_cos, by_sin = m.waves[i, m.columns + seen_wave.CASING_COS], m.waves[i, m.columns + seen_wave.CASING_SIN]
        place += by_sin * sin
        place += by_cos * cos
        speed += m.waves[i, wave.OMEGA] * (by_sin * cos)
        speed -= m.waves[i, wave.OMEGA] * (by_cos * sin)
    return place, speed


@part
def _add_particular(m: Motion, t: float, sign: float, value: Array, slope: Array) -> None:
    """Add the particular solution at t to η and u of blocks, or subtract it (``sign`` -1)."""
    b = m.block
    for k in range(m.blocks):
        value[k] += sign * b[block.PARTICULAR, k]
        slope[k] += sign * b[block.PARTICULAR_SLOPE, k]
    for i in range(m.waves.shape[0]):
        cos, sin = wave_phase(m.waves, i, t)
        row = i * block.WAVE
        for k in range(m.blocks):
            value[k] += sign * (b[block.PARTICULAR_COS + row, k] * cos + b[block.PARTICULAR_SIN + row, k] * sin)
            turn = b[block.PARTICULAR_SLOPE_COS + row, k] * cos + b[block.PARTICULAR_SLOPE_SIN + row, k] * sin
            slope[k] += sign * turn


@part
def from_coordinates(m: Motion, coordinates: Array, t: float, y: Array) -> None:
    """Fill the state ``y`` of time t from the coordinates [η, u, ξ], less the particular solution."""
    f = m.first
    for j in range(m.firsts):
        xi = coordinates[2 * m.blocks + j]
        for i in range(m.waves.shape[0]):
            cos, sin = wave_phase(m.waves, i, t)
            row = i * first.WAVE
            xi = xi - f[first.HARMONIC_COS + row, j] * cos - f[first.HARMONIC_SIN + row, j] * sin
        y[state.FIRST, j], y[state.FIRST_SLOPE, j] = xi, f[first.SOURCE, j] - f[first.RATE, j] * xi
    for k in range(m.blocks):
        y[state.VALUE, k], y[state.SLOPE, k] = coordinates[k], coordinates[m.blocks + k]
    _add_particular(m, t, -1.0, y[state.VALUE], y[state.SLOPE])


@part
def to_coordinates(m: Motion, y: Array, t: float, coordinates: Array) -> None:
    """Fill the coordinates [η, u, ξ] from the state ``y`` of time t: the inverse of :func:`from_coordinates`."""
    f = m.first
    for j in range(m.firsts):
        xi = y[state.FIRST, j]
        for i in range(m.waves.shape[0]):
            cos, sin = wave_phase(m.waves, i, t)
            row = i * first.WAVE
            xi = xi + f[first.HARMONIC_COS + row, j] * cos + f[first.HARMONIC_SIN + row, j] * sin
        coordinates[2 * m.blocks + j] = xi
    for k in range(m.blocks):
        coordinates[k], coordinates[m.blocks + k] = y[state.VALUE, k], y[state.SLOPE, k]
    value, slope = coordinates[: m.blocks], coordinates[m.blocks : 2 * m.blocks]
    _add_particular(m, t, 1.0, value, slope)
