"""Poles of a set with one closed contact that heats: a matrix D + α u wᵀ.

In the modes of the set less their response to thermal ones, z - R τ, each mode split by its two poles, D = diag(d): d
are the poles without the heat of contact and the thermal rates, u the response to heat at the contact, wᵀ the row of
the contact force. The eigenvalues are the zeros of

    f(s) = 1 - α Σ u_k w_k/(s - d_k).

Newton's method finds the shift δ of each from a pole, so that every difference s - d_k keeps its digits (Golub, SIAM
Review 15 (1973) 318–334). Of a complex pair the one above the real axis is found. :mod:`workflow.poles` separates other
couplings: a damping matrix, friction along a tangent, a mode near a thermal rate, a matrix that is nearly defective.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import inlined, kernel, part
from workflow.schemes._exact.tables import block, first

NEAR_RATE = 1e-3
"""Size of μ² - μ c + ω², over the sum of its terms, below which R has fewer than thirteen digits."""

CRITICAL = 1e-2
"""Relative distance of the two poles of a mode, or of a pole and a thermal rate, below which the general solver is
used, as digits are lost by its square."""


_NEWTON_STEPS, _CONVERGED = 20, 1e-10
"""Relative change of a shift at which Newton's method ends: the next change would be about its square."""

_DISTINCT = 1e-6
"""Distance of two zeros, over their shifts, below which they keep fewer than ten digits: the general solver is used."""

_INDEPENDENT = 3e-2
"""Product left · right, over the sum of its terms, below which eigenvectors lose digits by its square and more: the
matrix is nearly defective."""


class Modes(NamedTuple):
    """Modes that only thermal ones link."""

    frequency: Array
    damping: Array
    coupling: Array
    rate: Array


def thermal_response(system: Modes, near: float) -> Array | None:
    """Return R, ``(mode, thermal mode)``; ``None`` where a thermal rate is near the pole of a mode that heat loads."""
    mu, c, omega2, driven = system.rate, system.damping[:, None], system.frequency[:, None] ** 2, system.coupling != 0
    polynomial, size = mu**2 - mu * c + omega2, mu**2 + mu * c + omega2
    if np.any(driven & (np.abs(polynomial) <= near * size)):
        return None
    return -np.divide(system.coupling, polynomial, out=np.zeros_like(polynomial), where=driven)


@kernel
def complete(b: Array, f: Array, blocks: int, firsts: int) -> tuple[float, float]:
    """Fill what follows in tables from c and ω², others pad them at rest; return growth and fastest of a regime."""
    growth, fastest = 0.0, 0.0
    filled = max(1.0, b[block.STIFFNESS, blocks - 1]) if blocks > 0 else 1.0
    for k in range(b.shape[1]):
        if k >= blocks:
            b[block.STIFFNESS, k] = filled
        b[block.OMEGA, k], b[block.NU, k] = np.sqrt(b[block.STIFFNESS, k]), 1.0
        if b[block.OMEGA, k] > 0.0:
            b[block.INVERSE_OMEGA, k] = 1.0 / b[block.OMEGA, k]
    for k in range(blocks):
        c = b[block.DAMPING, k]
        b[block.HALF_DAMPING, k] = 0.5 * c
        if b[block.STIFFNESS, k] > 0.25 * c * c:
            b[block.NU, k] = np.sqrt(b[block.STIFFNESS, k] - 0.25 * c * c)
        growth, fastest = max(growth, -c), max(fastest, b[block.OMEGA, k], abs(c))
    for j in range(firsts):
        growth, fastest = max(growth, -f[first.RATE, j]), max(fastest, abs(f[first.RATE, j]))
    return growth, fastest


class RankOne(NamedTuple):
    """The matrix D + α u wᵀ of the held tip, ``(N,)`` each; thermal rates come last."""

    thermal: int
    """Number of poles that are thermal rates."""
    d: Complex
    u: Complex
    w: Complex


class Zeros(NamedTuple):
    """Memory for eigenvalues d + δ above the real axis or on it, ``(eigenvalue,)``."""

    pole: NDArray[np.int64]
    """Index of the pole d."""
    shift: Complex
    """δ, 1/s."""
    residue: Complex
    """α u w of each pole, 1/s, ``(N,)``."""
    right: Complex
    left: Complex
    """Eigenvectors of one eigenvalue, ``(N,)``; scratch."""


def rank_one(modes: Modes, response: Array, force: Array, heat: Array) -> RankOne | None:
    """Return D, u and w of a contact that sees the heat ``heat`` and loses ``force`` per [z, z', τ].

    ``None`` where poles of a mode are near each other, or one is 0.
    """
    c, mu, omega2 = modes.damping, modes.rate, modes.frequency**2
    r, lag, thermal = np.split(force, [c.size, 2 * c.size])
    split = 2 * np.sqrt((c / 2) ** 2 - omega2 + 0j)
    if np.any(np.abs(split) <= CRITICAL * (modes.frequency + c)) or np.any(modes.frequency == 0):
        return None
    upper, lower = -c / 2 + split / 2, -c / 2 - split / 2
    overdamped = (split.imag == 0) & (c > 0)
    upper[overdamped] = omega2[overdamped] / lower[overdamped]  # no cancellation
    place, speed = -response @ heat, response @ (mu * heat)  # of z - R τ per heat
    u = [(speed - lower * place) / split, (upper * place - speed) / split, heat]
    w = [-r - lag * upper, -r - lag * lower, -thermal - r @ response + lag @ (response * mu)]
    return RankOne(mu.size, *(np.concatenate(each).astype(np.complex128) for each in ([upper, lower, -mu], u, w)))


@part
def fill_blocks(
    matrix: RankOne,
    response: Array,
    alpha: float,
    count: int,
    zeros: Zeros,
    tables: tuple[Array, Array, Array, Array],
    signals: tuple[Array, Array],
) -> bool:
    """Fill blocks, which are pairs of eigenvalues, and first-order states; return whether the spectrum is accurate.

    A pair s = σ ± iν with right and left eigenvectors x and ξ = l X has the real coordinates η = Re ξ
    and u = Re(s ξ), so that η' = u, u' = 2σ u - |s|² η and X = 2 Re(x ξ). ``signals`` are the contact force per η and
    η', two rows, and per ξ.
    """
    (b, f, inward, outward), (signal, slow), size = tables, signals, matrix.d.size
    pairs, p, j, sound = size - count, 0, 0, True
    while p + j < count:
        i = _next(matrix.d, zeros, count)
        s = matrix.d[zeros.pole[i]] + zeros.shift[i]
        force, good = _fill_vectors(matrix, alpha, zeros, i)
        _to_modes(response, matrix.d, s, zeros.right, zeros.left)
        zeros.pole[i] = -1
        sound = sound and good
        if s.imag > 0.0:
            ratio, u = s.real / s.imag, pairs + p
            b[block.DAMPING, p], b[block.STIFFNESS, p] = -2.0 * s.real, square(s)
            signal[0, p] = 2.0 * (force.real - force.imag * ratio)
            signal[1, p] = 2.0 * force.imag / s.imag
            for n in range(size):
                right, left = zeros.right[n], zeros.left[n]
                inward[n, p], inward[n, u] = left.real, (s * left).real
                outward[p, n], outward[u, n] = 2.0 * (right.real - right.imag * ratio), 2.0 * right.imag / s.imag
            p += 1
        else:
            own = 2 * pairs + j
            f[first.RATE, j], slow[j] = -s.real, force.real
            for n in range(size):
                inward[n, own], outward[own, n] = zeros.left[n].real, zeros.right[n].real
            j += 1
    return sound


@part
def _next(d: Complex, zeros: Zeros, count: int) -> int:
    """Return the next eigenvalue, complex ones first, each kind in the order of its size; those done have pole -1."""
    best, kind, least = -1, False, np.inf
    for i in range(count):
        if zeros.pole[i] >= 0:
            s = d[zeros.pole[i]] + zeros.shift[i]
            above, size = s.imag > 0.0, square(s)
            if best < 0 or (above and not kind) or (above == kind and size < least):
                best, kind, least = i, above, size
    return best


@part
def _to_modes(response: Array, d: Complex, s: complex, right: Complex, left: Complex) -> None:
    """Transform eigenvectors at s from the poles of modes, with R τ subtracted, to X = [z, z', τ]."""
    modes, heats = response.shape
    for m in range(modes):
        n, upper, lower = modes + m, d[m], d[modes + m]
        per = reciprocal(upper - lower)
        right[m] += right[n]
        left[m], left[n] = (upper * left[n] - lower * left[m]) * per, (left[m] - left[n]) * per
        for j in range(heats):
            k, along = 2 * modes + j, response[m, j]
            right[m] += along * right[k]
            left[k] -= along * (left[m] + d[k].real * left[n])
        right[n] = s * right[m]


@inlined
def square(x: complex) -> float:
    """Return |x|²."""
    return x.real * x.real + x.imag * x.imag


@inlined
def reciprocal(x: complex) -> complex:
    """Return 1/x, without a guard against overflow."""
    return x.conjugate() * (1.0 / square(x))


@part
def find_zeros(matrix: RankOne, alpha: float, zeros: Zeros) -> int:
    """Find the zeros from their first order in α; return their number, 0 where they are not distinct."""
    for k in range(matrix.d.size):
        zeros.residue[k] = alpha * matrix.u[k] * matrix.w[k]
    count, above = _first_order(matrix, zeros), 0
    for i in range(count):
        k, shift = zeros.pole[i], zeros.shift[i]
        real = matrix.d[k].imag + shift.imag == 0.0
        shift = _newton(matrix.d, zeros.residue, k, shift, real)
        height = 0.0 if real else matrix.d[k].imag + shift.imag
        size = square(shift)
        if not (real or height * height > _DISTINCT * _DISTINCT * size) or not size < np.inf:
            return 0
        zeros.shift[i] = shift
        above += int(height > 0.0)
        for n in range(i):
            away = (matrix.d[k] - matrix.d[zeros.pole[n]]) + (shift - zeros.shift[n])
            if not square(away) > _DISTINCT * _DISTINCT * (size + square(zeros.shift[n])):
                return 0
    return count if above + count == matrix.d.size else 0


@part
def _first_order(matrix: RankOne, zeros: Zeros) -> int:
    """Fill the zeros near poles to first order in α; at thermal rates the structure responds quasi-statically."""
    d, thermal, yielding, count = matrix.d, matrix.thermal, 1.0, 0
    fast = d.size - thermal
    for k in range(fast):
        yielding += (zeros.residue[k] * reciprocal(d[k])).real
        if d[k].imag >= 0.0:
            zeros.pole[count], zeros.shift[count] = k, zeros.residue[k]
            count += 1
    for k in range(fast, d.size):
        shift = zeros.residue[k].real / yielding
        for other in range(fast, d.size):  # at most a third of the distance to another rate
            if other != k:
                most = abs(d[k].real - d[other].real) / 3.0
                shift = min(max(shift, -most), most)
        zeros.pole[count], zeros.shift[count] = k, shift
        count += 1
    return count


@part
def _newton(d: Complex, residue: Complex, own: int, shift: complex, real: bool) -> complex:
    """Return the zero of δ f(d + δ) by Newton's method, NaN where it does not converge."""
    if residue[own] == 0.0:
        return 0.0j
    for _ in range(_NEWTON_STEPS):
        f, slope = 1.0 + 0.0j, 0.0j
        for k in range(d.size):
            if k != own:
                inverse = reciprocal((d[own] - d[k]) + shift)
                term = residue[k] * inverse
                f -= term
                slope += term * inverse
        step = (shift * f - residue[own]) * reciprocal(f + shift * slope)
        shift -= complex(step.real, 0.0) if real else step
        if square(step) <= _CONVERGED * _CONVERGED * square(shift):
            return shift
    return complex(np.nan, 0.0)


@part
def _fill_vectors(matrix: RankOne, alpha: float, zeros: Zeros, i: int) -> tuple[complex, bool]:
    """Fill the eigenvectors of zero ``i``, left · right = 1; return wᵀ right, and whether they keep their digits.

    Near a pole its factor 1/(s - d) is the largest: its component of the right vector is set to 1.
    """
    _, d, u, w = matrix
    own, shift, right, left = zeros.pole[i], zeros.shift[i], zeros.right, zeros.left
    f, length, terms = 1.0 + 0.0j, 1.0 + 0.0j, 1.0
    for k in range(d.size):
        if k != own:
            inverse = reciprocal((d[own] - d[k]) + shift)
            right[k], left[k] = alpha * u[k] * inverse, w[k] * inverse
            f -= w[k] * right[k]
    force, heat = w[own] * reciprocal(f), alpha * u[own] * reciprocal(f)
    for k in range(d.size):
        if k != own:
            right[k], left[k] = force * right[k], heat * left[k]
            term = left[k] * right[k]
            length += term
            terms += abs(term.real) + abs(term.imag)
    right[own], left[own] = 1.0 + 0.0j, 1.0 + 0.0j
    for k in range(d.size):
        left[k] *= reciprocal(length)
    return force, square(length) > _INDEPENDENT * _INDEPENDENT * terms * terms
