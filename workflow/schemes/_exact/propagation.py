"""Propagation of a motion in closed form, its outputs, and its jump at an impact.

A block η'' + c η' + ω² η = 0 has

    η(dt) = C η + S η',   η'(dt) = -ω² S η + (C - c S) η',
    C = e^(-c dt/2) (cos ν dt + c/2 · sin(ν dt)/ν),   S = e^(-c dt/2) sin(ν dt)/ν,   ν² = ω² - c²/4,

entire functions of ν²: rigid, critical and overdamped blocks have the same form with cosh and sinh. All blocks and
first-order states of a regime are propagated at once, in packs.

The response of an explicit block to a force e^(a t), from rest, is t² exp[p t, q t, a t], the divided difference of exp
at its poles p, q and a = iΩ of a wave, 0 of a constant; one more node 0 integrates. Divided differences are the entries
of the exponential of the bidiagonal matrix of their nodes (G. Opitz, Z. Angew. Math. Mech. 44 (1964) T52–T54): it is
scaled, summed as a Taylor series and squared, its diagonal exact each time (A. McCurdy, K. C. Ng, B. N. Parlett, Math.
Comp. 43 (1984) 501–528), whether nodes are far apart, close or equal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array, elementary
from workflow.kernels.compiled import inlined, part
from workflow.kernels.elementary import HALF_PI_1, HALF_PI_2, LN2_HIGH, LN2_LOW, LOG2_E, TO_INTEGER, TWO_OVER_PI, phi2
from workflow.kernels.packs import narrow, pack, store
from workflow.schemes._exact.motion import OUTPUTS, SIGNAL, TEMPERATURE, Motion, casing_at, forced, wave_phase
from workflow.schemes._exact.tables import block, first, seen, seen_wave, state, wave

_EXPONENT = 4503599627370496.0 + 1023.0
"""2^52 + 1023: added to an integer q it leaves q + 1023 in the lowest bits of the double."""
_HALF_PI_REST = 2.0222662487959506e-21
"""π/2 less ``HALF_PI_1`` and ``HALF_PI_2``, rounded."""
_LARGEST_ANGLE = 1e6
"""Angles beyond this are reduced by :mod:`workflow.kernels.elementary`; below it the products with these are exact."""
_SERIES = 0.3
"""Largest |μ dt| at which φ2 is summed by its series in all columns."""

_NODES, _TERM = 4, 5
"""Rows of :attr:`Motion.differences` below the matrix: its diagonal, and terms of its series."""

_SPAN = 3.0
"""Largest |node| · time of the series: its terms exceed their sum by less than a digit or two."""

_NEGLIGIBLE = 1e-21
"""Size of terms of the series of e^|z| below which they are left out: a hundredth of the rounding of the corner entry,
1/24 at z = 0, and of its neighbours."""


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
def _block_propagators(b: Array, dt: float) -> None:
    """Fill the rows C and S of a table of blocks over a time ``dt`` [s], as if all of them oscillated.

    Errors are a few units in the last place of 1.
    """
    largest = 0.0
    for k in range(b.shape[1]):
        if b[block.NU, k] > largest:
            largest = b[block.NU, k]
    if largest * abs(dt) > _LARGEST_ANGLE:
        _large_propagators(b, dt)
        return
    _sines(b, dt)
    _exponentials(b, dt)
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        shrink = pack(b, (block.WORK, lane)) * pack(b, (block.POWER, lane))
        s = shrink * pack(b, (block.S, lane)) / pack(b, (block.NU, lane))
        store(b, (block.C, lane), shrink * pack(b, (block.C, lane)) + pack(b, (block.HALF_DAMPING, lane)) * s)
        store(b, (block.S, lane), s)


@part
def _large_propagators(b: Array, dt: float) -> None:
    """Fill the rows C and S where an angle ν dt is large."""
    for k in range(b.shape[1]):
        shrink = elementary.exp(-b[block.HALF_DAMPING, k] * dt)
        sin, cos = elementary.sine_cosine(b[block.NU, k] * dt)
        b[block.S, k] = shrink * sin / b[block.NU, k]
        b[block.C, k] = shrink * cos + b[block.HALF_DAMPING, k] * b[block.S, k]


@part
def _sines(b: Array, dt: float) -> None:
    """Fill the rows S with sin(ν dt) and C with cos(ν dt): reduction by multiples of π/2, then Taylor to r^16."""
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        a = pack(b, (block.NU, lane)) * dt
        q = (a * TWO_OVER_PI + TO_INTEGER) - TO_INTEGER
        r = ((a - q * HALF_PI_1) - q * HALF_PI_2) - q * _HALF_PI_REST
        z = r * r
        s = -7.647163731819816e-13 * z + 1.6059043836821613e-10
        s = s * z - 2.505210838544172e-08
        s = s * z + 2.7557319223985893e-06
        s = s * z - 0.0001984126984126984
        s = s * z + 0.008333333333333333
        s = s * z - 0.16666666666666666
        s = r + r * z * s
        c = 4.779477332387385e-14 * z - 1.1470745597729725e-11
        c = c * z + 2.08767569878681e-09
        c = c * z - 2.755731922398589e-07
        c = c * z + 2.48015873015873e-05
        c = c * z - 0.001388888888888889
        c = c * z + 0.041666666666666664
        c = 1.0 - (0.5 * z - z * z * c)
        odd = q - 2.0 * ((0.5 * q - 0.25 + TO_INTEGER) - TO_INTEGER)
        p, m = 0.5 * (q - odd), 0.5 * (q + odd)
        sign_s = 1.0 - 2.0 * (p - 2.0 * ((0.5 * p - 0.25 + TO_INTEGER) - TO_INTEGER))
        sign_c = 1.0 - 2.0 * (m - 2.0 * ((0.5 * m - 0.25 + TO_INTEGER) - TO_INTEGER))
        store(b, (block.S, lane), sign_s * (s * (1.0 - odd) + c * odd))
        store(b, (block.C, lane), sign_c * (c * (1.0 - odd) + s * odd))


@part
def _exponentials(b: Array, dt: float) -> None:
    """Fill the rows WORK and POWER with e^r and 2^q of e^(-c dt/2) = 2^q e^r, clamped at e^±700."""
    for k in range(b.shape[1]):
        y = min(max(-b[block.HALF_DAMPING, k] * dt, -700.0), 700.0)
        q = (y * LOG2_E + TO_INTEGER) - TO_INTEGER
        r = (y - q * LN2_HIGH) - q * LN2_LOW
        b[block.WORK, k] = r
        bits = np.float64(q + _EXPONENT).view(np.int64) << 52
        b[block.POWER, k] = np.int64(bits).view(np.float64)
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        remainder = pack(b, (block.WORK, lane))
        store(b, (block.WORK, lane), 1.0 + (remainder + remainder * remainder * phi2(remainder)))


@part
def _aperiodic_propagator(c: float, w2: float, dt: float) -> tuple[float, float]:
    """Return C and S of one block that does not oscillate, ω² <= c²/4, of either sign of c."""
    half = 0.5 * c
    square = max(0.0, half * half - w2)
    x = square * dt * dt
    if x < 0.05:  # to x⁵/11!: below rounding
        cosh = 1.0 + x / 2.0 * (1.0 + x / 12.0 * (1.0 + x / 30.0 * (1.0 + x / 56.0 * (1.0 + x / 90.0))))
        sinh = 1.0 + x / 6.0 * (1.0 + x / 20.0 * (1.0 + x / 42.0 * (1.0 + x / 72.0 * (1.0 + x / 110.0))))
        decay = elementary.exp(-half * dt)
        S = dt * decay * sinh
        return decay * cosh + half * S, S
    root = np.sqrt(square)
    if half >= 0.0:
        slow, fast = -w2 / (half + root), -(half + root)
    else:
        slow, fast = -half + root, w2 / (root - half)
    e_slow, e_fast = elementary.exp(slow * dt), elementary.exp(fast * dt)
    S = (e_slow - e_fast) / (2.0 * root)
    return 0.5 * (e_slow + e_fast) + half * S, S


@part
def _first_propagator(x: float) -> tuple[float, float, float]:
    """Return e^x, φ1 = (e^x - 1)/x and φ2 = (φ1 - 1)/x."""
    if abs(x) < _SERIES:
        second = phi2(x)
        phi1 = 1.0 + x * second
        return 1.0 + x * phi1, phi1, second
    e = elementary.exp(x)
    phi1 = (e - 1.0) / x
    return e, phi1, (phi1 - 1.0) / x


@part
def _first_propagators(f: Array, dt: float) -> None:
    """Fill the rows DECAY, PHI1 and PHI2 of a table of first-order states: e^x, φ1, φ2 of x = -rate dt."""
    largest = 0.0
    for j in range(f.shape[1]):
        if abs(f[first.RATE, j]) > largest:
            largest = abs(f[first.RATE, j])
    if largest * abs(dt) > _SERIES:
        for j in range(f.shape[1]):
            f[first.DECAY, j], f[first.PHI1, j], f[first.PHI2, j] = _first_propagator(-f[first.RATE, j] * dt)
        return
    for j in range(0, f.shape[1], 8):
        lane = narrow(j)
        x = -pack(f, (first.RATE, lane)) * dt
        second = phi2(x)
        phi1 = 1.0 + x * second
        store(f, (first.PHI2, lane), second)
        store(f, (first.PHI1, lane), phi1)
        store(f, (first.DECAY, lane), 1.0 + x * phi1)


@part
def _explicit_force(m: Motion, k: int, t: float) -> float:
    """Return the force on an explicit block at t."""
    force = m.block[block.FORCE, k]
    for i in range(m.waves.shape[0]):
        cos, sin = wave_phase(m.waves, i, t)
        row = i * block.WAVE
        force = force + m.block[block.FORCE_COS + row, k] * cos + m.block[block.FORCE_SIN + row, k] * sin
    return float(force)


@part
def explicit_derivatives(m: Motion, k: int, y: Array, t: float, order: int, out: Array) -> None:
    """Fill η of an explicit block in the state ``y`` of time t, and its derivatives up to ``order``."""
    b = m.block
    out[0], out[1] = y[state.VALUE, k], y[state.SLOPE, k]
    for n in range(2, order + 1):
        out[n] = b[block.FORCE, k] if n == 2 else 0.0
    for i in range(m.waves.shape[0]):
        omega, row, (cos, sin) = m.waves[i, wave.OMEGA], i * block.WAVE, wave_phase(m.waves, i, t)
        f_cos, f_sin = b[block.FORCE_COS + row, k], b[block.FORCE_SIN + row, k]
        for n in range(2, order + 1):
            out[n] += f_cos * cos + f_sin * sin
            f_cos, f_sin = omega * f_sin, -omega * f_cos
    for n in range(2, order + 1):
        out[n] -= b[block.DAMPING, k] * out[n - 1] + b[block.STIFFNESS, k] * out[n - 2]


@part
def _exponential(z: complex) -> complex:
    """Return e^z."""
    size, (sin, cos) = elementary.exp(z.real), elementary.sine_cosine(z.imag)
    return complex(size * cos, size * sin)


@part
def _differences(m: Motion, k: int, a: complex, dt: float, size: int) -> None:
    """Fill the rows of :attr:`Motion.differences` with exp(Z dt), ``size`` rows and columns.

    Z has the nodes p, q, a, 0 on its diagonal, |p| <= |q|, and 1 beside it: entry (i, j) is the divided difference
    at the nodes i to j, times dt^(j - i). Rows below the second are filled where that takes squaring.
    """
    e, c, w2 = m.differences, m.block[block.DAMPING, k], m.block[block.STIFFNESS, k]
    half = 0.5 * c
    square = half * half - w2
    if square < 0.0:
        e[_NODES, 0], e[_NODES, 1] = complex(-half, np.sqrt(-square)), complex(-half, -np.sqrt(-square))
    else:
        q = -(half + np.copysign(np.sqrt(square), half))
        e[_NODES, 0], e[_NODES, 1] = w2 / q if q != 0.0 else 0.0, q
    e[_NODES, 2] = a
    span, h, doublings = max(np.sqrt(w2), abs(c), abs(a.real) + abs(a.imag)) * abs(dt), dt, 0
    while span > _SPAN:
        span, h, doublings = 0.5 * span, 0.5 * h, doublings + 1
    rows, n, largest = size if doublings > 0 else 2, 0, 1.0
    for i in range(rows):
        for j in range(i, size):
            e[i, j] = e[_TERM + i, j] = 1.0 if j == i else 0.0
    while n < size or largest > _NEGLIGIBLE:
        n += 1
        step = h / n
        largest *= span / n
        for i in range(rows):
            for j in range(size - 1, i, -1):
                e[_TERM + i, j] = (e[_NODES, j] * e[_TERM + i, j] + e[_TERM + i, j - 1]) * step
                e[i, j] += e[_TERM + i, j]
            e[_TERM + i, i] *= e[_NODES, i] * step
    for _ in range(doublings):
        for i in range(size):
            e[i, i] = _exponential(e[_NODES, i] * h)
        for i in range(size):
            for j in range(size - 1, i, -1):
                total = (e[i, i] + e[j, j]) * e[i, j]
                for n in range(i + 1, j):
                    total += e[i, n] * e[n, j]
                e[i, j] = total
        h *= 2.0


@part
def _advance_explicit(m: Motion, k: int, y: Array, t: float, dt: float, size: int) -> tuple[float, float, float]:
    """Return η, η' and ∫η dt of an explicit block a time ``dt`` after the state ``y`` of time t.

    The initial state is applied as constant forces, so that no small change is lost beside 1. ``size`` is 3, or 4 for
    the integral, which is meaningless otherwise.
    """
    e, b, before, pace = m.differences, m.block, y[state.VALUE, k], y[state.SLOPE, k]
    c, w2 = b[block.DAMPING, k], b[block.STIFFNESS, k]
    constant, value, slope, area = b[block.FORCE, k], 0.0, 0.0, 0.0
    for i in range(m.waves.shape[0]):
        if forced(b, k, i):
            row, (cos, sin) = i * block.WAVE, wave_phase(m.waves, i, t)
            f = complex(b[block.FORCE_COS + row, k], -b[block.FORCE_SIN + row, k]) * complex(cos, sin)
            _differences(m, k, complex(0.0, m.waves[i, wave.OMEGA]), dt, size)
            value += (f * e[0, 2]).real
            slope += (f * (e[_NODES, 0] * e[0, 2] + e[1, 2])).real
            area += (f * e[0, 3]).real
    _differences(m, k, complex(0.0, 0.0), dt, size)
    once, twice = e[0, 1].real, e[0, 2].real
    area += before * once + (pace + c * before) * twice + constant * e[0, 3].real
    constant -= w2 * before
    value += pace * once + constant * twice
    slope += (constant - c * pace) * once - w2 * pace * twice
    return before + value, pace + slope, area


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
    _block_propagators(b, dt)
    for i in range(m.aperiodics):
        k = int(b[block.APERIODIC_COLUMNS, i])
        b[block.C, k], b[block.S, k] = _aperiodic_propagator(b[block.DAMPING, k], b[block.STIFFNESS, k], dt)
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        C, S = pack(b, (block.C, lane)), pack(b, (block.S, lane))
        value, slope = pack(y, (state.VALUE, lane)), pack(y, (state.SLOPE, lane))
        store(out, (state.VALUE, lane), C * value + S * slope)
        slope = (C - pack(b, (block.DAMPING, lane)) * S) * slope
        store(out, (state.SLOPE, lane), slope + -pack(b, (block.STIFFNESS, lane)) * S * value)
    for i in range(m.explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        out[state.VALUE, k], out[state.SLOPE, k], _ = _advance_explicit(m, k, y, t, dt, 3)
    if m.firsts > 0:
        _first_propagators(f, dt)
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
        area += b[m.rows + seen.SIGNAL_VALUE, k] * _advance_explicit(m, k, y, t, dt, 4)[2]
    for j in range(m.firsts):
        step = y[state.FIRST_SLOPE, j] * dt
        area += f[m.slow + SIGNAL, j] * dt * (y[state.FIRST, j] + step * f[first.PHI2, j])
    for k in range(m.blocks):
        change = out[state.VALUE, k] - y[state.VALUE, k]
        slowed = out[state.SLOPE, k] - y[state.SLOPE, k] + b[block.DAMPING, k] * change
        area += b[m.rows + seen.SIGNAL_SLOPE, k] * change - b[m.rows + seen.SIGNAL_INTEGRAL, k] * slowed
    area += m.outputs[OUTPUTS * m.contact + SIGNAL] * dt
    for i in range(m.waves.shape[0]):
        omega = m.waves[i, wave.OMEGA]
        cos, sin = wave_phase(m.waves, i, t)
        cos_after, sin_after = wave_phase(m.waves, i, t + dt)
        area += m.waves[i, m.columns + seen_wave.SIGNAL_COS] * (sin_after - sin) / omega
        area -= m.waves[i, m.columns + seen_wave.SIGNAL_SIN] * (cos_after - cos) / omega
    return float(area)


@part
def observe(m: Motion, y: Array, t: float) -> Observed:
    """Return the outputs of a state."""
    b, f = m.block, m.first
    signal, rate, temperature, warming, place, speed = _observe_waves(m, t)
    for j in range(m.firsts):
        xi, slope = y[state.FIRST, j], y[state.FIRST_SLOPE, j]
        signal += f[m.slow + SIGNAL, j] * xi
        rate += f[m.slow + SIGNAL, j] * slope
        temperature += f[m.slow + TEMPERATURE, j] * xi
        warming += f[m.slow + TEMPERATURE, j] * slope
    for k in range(m.blocks):
        b[block.WORK, k] = -b[block.DAMPING, k] * y[state.SLOPE, k] - b[block.STIFFNESS, k] * y[state.VALUE, k]
    for i in range(m.explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        b[block.WORK, k] += _explicit_force(m, k, t)
    for k in range(m.blocks):
        value, slope, bend = y[state.VALUE, k], y[state.SLOPE, k], b[block.WORK, k]
        signal += b[m.rows + seen.SIGNAL_VALUE, k] * value + b[m.rows + seen.SIGNAL_SLOPE, k] * slope
        rate += b[m.rows + seen.SIGNAL_VALUE, k] * slope + b[m.rows + seen.SIGNAL_SLOPE, k] * bend
        temperature += b[m.rows + seen.TEMPERATURE_VALUE, k] * value + b[m.rows + seen.TEMPERATURE_SLOPE, k] * slope
        warming += b[m.rows + seen.TEMPERATURE_VALUE, k] * slope + b[m.rows + seen.TEMPERATURE_SLOPE, k] * bend
    return Observed(signal, rate, temperature, warming, place, speed)


@inlined
def _observe_waves(m: Motion, t: float) -> Observed:
    """Return the outputs of the loads alone, and the casing."""
    waves, at, rate, warming = m.waves, OUTPUTS * m.contact, 0.0, 0.0
    signal, temperature = m.outputs[at + SIGNAL], m.outputs[at + TEMPERATURE]
    for i in range(waves.shape[0]):
        omega = waves[i, wave.OMEGA]
        cos, sin = wave_phase(waves, i, t)
        a, b = waves[i, m.columns + seen_wave.SIGNAL_COS], waves[i, m.columns + seen_wave.SIGNAL_SIN]
        signal = signal + a * cos + b * sin
        rate += omega * (b * cos - a * sin)
        a, b = waves[i, m.columns + seen_wave.TEMPERATURE_COS], waves[i, m.columns + seen_wave.TEMPERATURE_SIN]
        temperature = temperature + a * cos + b * sin
        warming += omega * (b * cos - a * sin)
    place, speed = casing_at(m, t)
    return Observed(signal, rate, temperature, warming, place, speed)
