"""The response of a regime to the loads of one case, and the motion that is left when it is subtracted.

The tip load is F0 + F1 sin ψ with ψ = Ω t + φ; a harmonic is a pair of coefficients of cos ψ and sin ψ. Of a block

    η' = u + β0 + β1 sin ψ,   u' = -c u - ω² η + γ0 + γ1 sin ψ + Σ g_j ξ_j,   that is
    η'' + c η' + ω² η = γ0 + c β0 + Ω β1 cos ψ + (γ1 + c β1) sin ψ + Σ g_j ξ_j

the particular solution is subtracted, and its response η = a ξ + b ξ' to each first-order state: what is left moves
freely and costs one exponential. Where that would lose digits (slow blocks, resonance with the load or with a
first-order state) the block is *explicit*: it keeps its force and is advanced by Taylor series, which hold for every
ω² and c.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import elementary
from workflow.kernels.compiled import part, rare
from workflow.models import Array
from workflow.schemes._exact import block_table as block
from workflow.schemes._exact import first_table as first
from workflow.schemes._exact import state_table as state
from workflow.schemes._exact.layout import Layout, Load, Memory

SLOW_POLE = 0.3
"""A block whose slowest pole times the duration is below this is explicit: subtracting F/ω² would lose digits
like (slow pole · duration)⁻²."""

_RESONANT_POLE = 0.1
"""Likewise a block with a pole whose distance to that of the load, times the duration, is below this."""

SIGNAL, TEMPERATURE = 0, 1
"""Outputs of a regime: the signal whose fall through zero ends it (free tip: gap, m; held tip: contact force, N), and
the temperature of the tip, K."""

CONSTANT, COS, SIN = range(3)
"""Columns of :attr:`Response.outputs`."""


class Response(NamedTuple):
    """A regime under the loads of one case; tables are those of :class:`~workflow.schemes._exact.layout.Memory`."""

    blocks: int
    firsts: int
    """Number of first-order states, 0 without heat."""
    specials: int
    """Number of blocks that are explicit or do not oscillate."""
    block: Array
    first: Array
    coupling: Array
    outputs: Array
    phase: Array
    omega: float
    """Ω, rad/s."""
    load_phase: float
    """φ, rad."""
    growth: float
    """Largest rate at which a block or first-order state grows, 1/s, not negative."""
    fastest: float
    """Bound of all poles and of Ω, 1/s."""
    fastest_first: float
    """Largest |μ|, 1/s."""
    two_way: bool
    """Whether blocks show in the tip temperature or their η' in the signal."""
    cooling: bool
    """Whether the tip temperature is a constant plus decaying exponentials: no block, load or growing state shows."""


@rare
def respond(regime: Layout, load: Load, memory: Memory) -> Response:
    """Return the response of a regime to the loads of one case, and complete the tables of its memory."""
    b, f, outputs, coupling = memory.block, memory.first, memory.outputs, regime.coupling
    blocks, firsts = regime.blocks, regime.firsts if memory.first.shape[1] > 0 else 0
    _clear(regime, memory)
    outputs[SIGNAL, CONSTANT], outputs[SIGNAL, SIN] = _sources(regime, load, 2 * blocks + regime.firsts, firsts > 0)
    for j in range(firsts):
        f[first.SOURCE, j], f[first.HARMONIC_SIN, j] = _sources(regime, load, 2 * blocks + j, True)
    specials = 0
    for k in range(blocks):
        forced = _force(regime, load, k, firsts > 0, b, outputs)
        explicit = (firsts > 0 and b[block.RESONANT, k] > 0.0) or _keeps_force(b, k, forced, load)
        if explicit or b[block.STIFFNESS, k] <= 0.25 * b[block.DAMPING, k] * b[block.DAMPING, k]:
            b[block.SPECIAL, specials] = k
            specials += 1
        if explicit:
            b[block.EXPLICIT, k] = 1.0
        else:
            _subtract_particular(b, k, forced, load.omega, outputs)
            for j in range(firsts):
                _subtract_dragged(b, k, f, j, coupling)
    for j in range(firsts):
        _subtract_harmonic(f, j, load.omega, outputs)
    growth, fastest, fastest_first = regime.growth, max(load.omega, regime.fastest), 0.0
    if firsts > 0:
        growth, fastest_first = max(growth, regime.first_growth), regime.fastest_first
        fastest = max(fastest, fastest_first)
    steady = outputs[TEMPERATURE, COS] == 0.0 and outputs[TEMPERATURE, SIN] == 0.0
    return Response(
        blocks,
        firsts,
        specials,
        b,
        f,
        coupling,
        outputs,
        memory.phase,
        load.omega,
        load.phase,
        growth,
        fastest,
        fastest_first,
        regime.two_way,
        steady and growth <= 0.0 and not regime.warms,
    )


@rare
def _clear(regime: Layout, memory: Memory) -> None:
    """Begin with the tables of the regime and without loads."""
    for row in range(memory.block.shape[0]):
        for k in range(memory.block.shape[1]):
            memory.block[row, k] = regime.block[row, k]
    for row in range(memory.first.shape[0]):
        for j in range(memory.first.shape[1]):
            memory.first[row, j] = regime.first[row, j]
    for i in range(3):
        memory.outputs[0, i], memory.outputs[1, i], memory.phase[i] = 0.0, 0.0, np.nan


@rare
def _sources(regime: Layout, load: Load, row: int, heated: bool) -> tuple[float, float]:
    """Return the constant source of a coordinate and its coefficient of sin ψ; in the last row those of the signal."""
    steady, heating = load.steady.size, load.heating.size
    tip, gap = regime.source[row, steady + heating], regime.source[row, steady + heating + 1]
    source = tip * load.mean + gap * load.gap
    for i in range(steady):
        source += regime.source[row, i] * load.steady[i]
    if heated:
        for i in range(heating):
            source += regime.source[row, steady + i] * load.heating[i]
    return source, tip * load.amplitude


@part
def _force(regime: Layout, load: Load, k: int, heated: bool, b: Array, outputs: Array) -> bool:
    """Fill the force on a block, see the head of this module; return whether it has a harmonic part.

    Outputs are stored per η and η' but given per η and u, u = η' - β0 - β1 sin ψ.
    """
    beta, beta_sin = _sources(regime, load, k, heated)
    gamma, gamma_sin = _sources(regime, load, regime.blocks + k, heated)
    b[block.SOURCE, k], b[block.SOURCE_SIN, k] = beta, beta_sin
    b[block.FORCE, k] = gamma + b[block.DAMPING, k] * beta
    b[block.FORCE_COS, k] = load.omega * beta_sin
    b[block.FORCE_SIN, k] = gamma_sin + b[block.DAMPING, k] * beta_sin
    for o in range(2):
        outputs[o, CONSTANT] -= b[block.SIGNAL_SLOPE + 2 * o, k] * beta
        outputs[o, SIN] -= b[block.SIGNAL_SLOPE + 2 * o, k] * beta_sin
    return bool(b[block.FORCE_COS, k] != 0.0 or b[block.FORCE_SIN, k] != 0.0)


@part
def _keeps_force(b: Array, k: int, forced: bool, load: Load) -> bool:
    """Whether the response of a block to the loads cannot be subtracted without losing digits."""
    w2, half = b[block.STIFFNESS, k], abs(b[block.HALF_DAMPING, k])
    square = w2 - half * half
    slow = np.sqrt(w2) if square >= 0.0 else w2 / (half + np.sqrt(-square))
    if slow * load.duration < SLOW_POLE:
        return True
    if not forced or square < 0.0:
        return False
    return bool(elementary.hypot(half, load.omega - np.sqrt(square)) * load.duration < _RESONANT_POLE)


@part
def _subtract_particular(b: Array, k: int, forced: bool, omega: float, outputs: Array) -> None:
    """Subtract the particular solution of a block, and add what it shows to the outputs."""
    c, w2, force = b[block.DAMPING, k], b[block.STIFFNESS, k], b[block.FORCE, k]
    b[block.SIGNAL_INTEGRAL, k] = b[block.SIGNAL_VALUE, k] / w2
    b[block.PARTICULAR, k] = force / w2
    cos, sin = 0.0, 0.0
    if forced:
        pair = complex(b[block.FORCE_COS, k], -b[block.FORCE_SIN, k])
        pair = elementary.quotient(pair, complex(w2 - omega * omega, c * omega))
        cos, sin = pair.real, -pair.imag
        b[block.PARTICULAR_COS, k], b[block.PARTICULAR_SIN, k] = cos, sin
    for o in range(2):
        value, slope = b[block.SIGNAL_VALUE + 2 * o, k], b[block.SIGNAL_SLOPE + 2 * o, k]
        b[block.UNFORCED_VALUE + 2 * o, k], b[block.UNFORCED_SLOPE + 2 * o, k] = value, slope
        outputs[o, CONSTANT] += value * force / w2
        if forced:
            outputs[o, COS] += value * cos + slope * omega * sin
            outputs[o, SIN] += value * sin - slope * omega * cos


@part
def _subtract_dragged(b: Array, k: int, f: Array, j: int, coupling: Array) -> None:
    """Subtract the response η = a ξ + b ξ' of a block to a first-order state: outputs then see it in ξ and ξ'."""
    at, lag = coupling[1, k, j], coupling[2, k, j]
    speed = at - lag * f[first.RATE, j]
    for o in range(2):
        value, slope = b[block.SIGNAL_VALUE + 2 * o, k], b[block.SIGNAL_SLOPE + 2 * o, k]
        f[first.SIGNAL_VALUE + 2 * o, j] += value * at
        f[first.SIGNAL_SLOPE + 2 * o, j] += value * lag + slope * speed
    b[block.HEAT_JUMP_VALUE, k] -= at * f[first.HEAT_JUMP_VALUE, j] + lag * f[first.HEAT_JUMP_SLOPE, j]
    b[block.HEAT_JUMP_SLOPE, k] -= speed * f[first.HEAT_JUMP_SLOPE, j]


@part
def _subtract_harmonic(f: Array, j: int, omega: float, outputs: Array) -> None:
    """Subtract the response of a first-order state to its source χ1 sin ψ; χ1 lies in the row HARMONIC_SIN."""
    sine = f[first.HARMONIC_SIN, j]
    f[first.WARMING, j] = f[first.TEMPERATURE_VALUE, j] - f[first.TEMPERATURE_SLOPE, j] * f[first.RATE, j]
    if sine != 0.0:
        pair = elementary.quotient(complex(0.0, -sine), complex(f[first.RATE, j], omega))
        f[first.HARMONIC_COS, j], f[first.HARMONIC_SIN, j] = pair.real, -pair.imag
        for o in range(2):
            outputs[o, COS] += f[first.SIGNAL_VALUE + 2 * o, j] * f[first.HARMONIC_COS, j]
            outputs[o, SIN] += f[first.SIGNAL_VALUE + 2 * o, j] * f[first.HARMONIC_SIN, j]


@part
def load_phase(r: Response, t: float) -> tuple[float, float]:
    """Return cosine and sine of the phase Ω t + φ; those of the last time asked for are kept."""
    if r.phase[0] != t:
        r.phase[0] = t
        r.phase[2], r.phase[1] = elementary.sine_cosine(r.omega * t + r.load_phase)
    return r.phase[1], r.phase[2]


@part
def _forced(r: Response, k: int, y: Array, cos: float, sin: float, value: float, slope: float, sign: float) -> Any:
    """Return η and η' of a block with its response to the loads added (``sign`` 1) or subtracted (-1)."""
    b = r.block
    if b[block.EXPLICIT, k] == 0.0:
        a_cos, a_sin = b[block.PARTICULAR_COS, k], b[block.PARTICULAR_SIN, k]
        value += sign * (b[block.PARTICULAR, k] + a_cos * cos + a_sin * sin)
        slope += sign * (r.omega * (a_sin * cos - a_cos * sin))
        for j in range(r.firsts):
            at, lag = r.coupling[1, k, j], r.coupling[2, k, j]
            value += sign * (at * y[state.FIRST, j] + lag * y[state.FIRST_SLOPE, j])
            slope += sign * ((at - lag * r.first[first.RATE, j]) * y[state.FIRST_SLOPE, j])
    return value, slope


@part
def from_coordinates(r: Response, coordinates: Array, t: float, y: Array) -> None:
    """Fill the state ``y`` of time t from the coordinates [η, u, ξ]: the response to the loads is subtracted."""
    b, f = r.block, r.first
    sin, cos = elementary.sine_cosine(r.omega * t + r.load_phase)
    for j in range(r.firsts):
        xi = coordinates[2 * r.blocks + j] - f[first.HARMONIC_COS, j] * cos - f[first.HARMONIC_SIN, j] * sin
        y[state.FIRST, j], y[state.FIRST_SLOPE, j] = xi, f[first.SOURCE, j] - f[first.RATE, j] * xi
    for k in range(r.blocks):
        slope = coordinates[r.blocks + k] + b[block.SOURCE, k] + b[block.SOURCE_SIN, k] * sin
        y[state.VALUE, k], y[state.SLOPE, k] = _forced(r, k, y, cos, sin, coordinates[k], slope, -1.0)


@part
def to_coordinates(r: Response, y: Array, t: float, coordinates: Array) -> None:
    """Fill the coordinates [η, u, ξ] from the state ``y`` of time t: the inverse of :func:`from_coordinates`."""
    b, f = r.block, r.first
    sin, cos = elementary.sine_cosine(r.omega * t + r.load_phase)
    for j in range(r.firsts):
        xi = y[state.FIRST, j] + f[first.HARMONIC_COS, j] * cos + f[first.HARMONIC_SIN, j] * sin
        coordinates[2 * r.blocks + j] = xi
    for k in range(r.blocks):
        value, slope = _forced(r, k, y, cos, sin, y[state.VALUE, k], y[state.SLOPE, k], 1.0)
        coordinates[k] = value
        coordinates[r.blocks + k] = slope - b[block.SOURCE, k] - b[block.SOURCE_SIN, k] * sin
