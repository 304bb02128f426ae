"""Eigenvalues and eigenvectors of the held tip with friction heat, each to its own relative accuracy.

In the modes that are uncoupled without friction heat the matrix is D + α u wᵀ, D = diag(d): d are the poles of
the held structure and its thermal rates, u the response to heat at the tip, wᵀ the row of the contact force.
Its eigenvalues are the zeros of the secular function

    f(s) = 1 - α Σ u_k w_k/(s - d_k).

A general eigenvalue solver errs by rounding times the *largest* eigenvalue, some 1e-11 1/s here,
which spoils the slow thermal ones. It serves as a first guess; Newton's method then finds the shift
δ of each eigenvalue from its nearest pole, so that every difference s - d_k keeps its digits
(Golub, SIAM Review 15 (1973) 318–334; the shift from the nearest pole as in LAPACK's dlaed4).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import kernel
from workflow.kernels.complex_numbers import complex_product, magnitude, over, square_root, times
from workflow.kernels.eigen import eigenvalues, eigenvectors
from workflow.kernels.elementary import hypot, quotient
from workflow.kernels.solving import solve
from workflow.kernels.sums import product, total
from workflow.models import Array
from workflow.schemes._exact.modal_system import ModalSystem

Complex = NDArray[np.complex128]

_CRITICAL = 1e-4
"""Two poles of a block nearer than this, relatively, leave fewer than twelve digits in their own
eigenvectors: then the general solver does no worse."""
_ORTHOGONAL = 1e-9
"""Left and right eigenvectors of different eigenvalues must be orthogonal to this share of their
products, else an eigenvalue was missed or counted twice, or two of them nearly coincide."""
_NEWTON_STEPS = 12
_CONVERGED, _STALLED = 1e-15, 1e-11
"""Newton ends where a shift changes by less than the first, a few roundings, relatively; if steps run
out, the second still counts as converged: quadratic convergence makes its next change less than rounding."""
_TINY = 1e-300
"""A shift of zero has converged."""


class _RankOne(NamedTuple):
    """The matrix D + α u wᵀ, D = diag(d), each array ``(N,)``: upper and lower poles of modes, then thermal rates."""

    alpha: float
    d: Complex
    u: Complex
    w: Complex


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues with imaginary part >= 0 of the held tip, X' = A X + …, X = [z, z', τ]."""

    values: Complex
    """1/s, ``(eigenvalue,)``."""
    right: Complex
    """Right eigenvectors, ``(N, eigenvalue)``."""
    left: Complex
    """Left eigenvectors, ``(eigenvalue, N)``, left · right = 1."""
    force: Complex
    """Contact force per right eigenvector, ``(eigenvalue,)``."""


def general_spectrum(A: Array, force: Array) -> Spectrum:
    """Return the spectrum by the general solver."""
    values, right, left = eigenvectors(A)
    keep = values.imag >= 0
    right = right[:, keep]
    return Spectrum(values[keep], right, left[keep], complex_product(force, right))


def secular_spectrum(held: ModalSystem, alpha: float, A: Array) -> Spectrum | None:
    """Return the spectrum of D + α u wᵀ, ``None`` where it cannot be trusted."""
    modes, mu = held.frequency.size, held.rate
    if held.is_coupled:
        return coupled_spectrum(held, alpha, A)
    omega2, c = held.frequency**2, held.damping
    split = 2 * square_root((c / 2) ** 2 - omega2 + 0j)
    polynomial = mu**2 - mu * c[:, None] + omega2[:, None]
    size = mu**2 + mu * c[:, None] + omega2[:, None]
    if (
        np.any(held.frequency == 0)
        or np.any(magnitude(split) <= _CRITICAL * (held.frequency + c))
        or np.any(np.abs(polynomial) <= _CRITICAL * size)
    ):
        return None
    response = -held.coupling / polynomial  # z = η + Q τ
    matrix = _rank_one(held, alpha, split, response)

    def states(right: Complex, left: Complex) -> tuple[Complex, Complex]:
        return (
            _right_states(matrix.d, mu, response, right),
            _left_states(matrix.d, c, mu, response, left),
        )

    return _spectrum(matrix, modes, A, states)


_States = Callable[[Complex, Complex], tuple[Complex, Complex]]
"""From right and left eigenvectors in the coordinates in which D is diagonal, in rows, to those in X."""


def _spectrum(matrix: _RankOne, modes: int, A: Array, states: _States) -> Spectrum | None:
    """Return the spectrum of D + α u wᵀ, ``None`` where it cannot be trusted."""
    residue = times(matrix.alpha * matrix.u, matrix.w)
    for guesses in (_slow_and_fast, None):
        zeros = _zeros(residue, matrix.d, guesses(residue, matrix.d, modes) if guesses else eigenvalues(A))
        if zeros is not None:
            with np.errstate(all="ignore"):  # what is not finite is not orthogonal
                spectrum = _vectors(matrix, states, *zeros)
            if spectrum is not None:
                return spectrum
    return None


def coupled_spectrum(held: ModalSystem, alpha: float, A: Array) -> Spectrum | None:
    """Return the spectrum where damping couples the modes, ``None`` where it cannot be trusted.

    The eigenvectors V of the mechanical part alone are those of a general matrix. A thermal mode drags the response R
    along, (A_m + μ) R = -A_mτ, so that D holds the poles and the rates in the coordinates of [[V, R], [0, 1]]. Without
    friction heat that is the spectrum: poles first, then rates in their order.
    """
    size, mu = 2 * held.frequency.size, held.rate
    inner = A[:size, :size]
    response = np.zeros((size, mu.size))
    try:
        values, right, left = eigenvectors(inner)
        for j in range(mu.size):
            response[:, j] = solve(inner + mu[j] * np.eye(size), -A[:size, size + j])
    except np.linalg.LinAlgError:
        return None
    whole, inverse = (np.eye(size + mu.size, dtype=np.complex128) for _ in range(2))
    whole[:size, :size], whole[:size, size:] = right, response
    inverse[:size, :size], inverse[:size, size:] = left, -complex_product(left, response)
    row = np.concatenate([-held.reaction, -held.reaction_slope, -held.thermal_reaction])
    force = complex_product(row, whole)
    d = np.concatenate([values, -mu + 0j])
    if alpha == 0:
        keep = d.imag >= 0
        return Spectrum(d[keep], whole[:, keep], inverse[keep], force[keep])
    warming = np.concatenate([np.zeros(size), held.heat_tip])
    matrix = _RankOne(alpha, d, complex_product(inverse, warming), force)

    def states(right: Complex, left: Complex) -> tuple[Complex, Complex]:
        return complex_product(right, whole.T), complex_product(left, inverse)

    return _spectrum(matrix, size // 2, A, states)


def _rank_one(held: ModalSystem, alpha: float, split: Complex, response: Array) -> _RankOne:
    """Return the matrix; ``split`` is the difference of the two poles of each mode, ``response`` Q of z = η + Q τ."""
    modes, c, mu, aK = held.frequency.size, held.damping, held.rate, held.relaxation
    root, omega2 = split / 2, held.frequency**2
    upper, lower = -c / 2 + root, -c / 2 - root
    overdamped = (root.imag == 0) & (c > 0)
    upper[overdamped] = omega2[overdamped] / lower[overdamped]  # no cancellation
    warming = held.heat_tip
    u0, u1 = -product(response, warming), product(response, mu * warming)
    d = np.concatenate([upper, lower, -mu + 0j])
    block_u = np.tile(u1, 2) + (d[: 2 * modes] + np.tile(c, 2)) * np.tile(u0, 2)
    u = np.concatenate([over(block_u, np.concatenate([split, -split])), warming])
    thermal_w = -held.thermal_reaction - product(held.reaction, response) * (1 - aK * mu)
    w = np.concatenate([-np.tile(held.reaction, 2) * (1 + aK * d[: 2 * modes]), thermal_w])
    return _RankOne(alpha, d, u, w)


def _slow_and_fast(residue: Complex, d: Complex, modes: int) -> Complex:
    """Guess the eigenvalues: poles of blocks hardly move, thermal rates see a quasi-static structure."""
    poles, rates = d[: 2 * modes], d[2 * modes :].real
    yielding = 1 + total(over(residue[: 2 * modes], poles).real)
    slow = np.diag(rates) + residue[2 * modes :].real / yielding
    return np.concatenate([poles, eigenvalues(slow)])


def _vectors(matrix: _RankOne, states: _States, origin: NDArray[np.intp], delta: Complex) -> Spectrum | None:
    """Return the eigenvectors (s - D)⁻¹ u and wᵀ (s - D)⁻¹ in X, ``None`` where they are not orthogonal.

    They are scaled to 1 at the nearest pole, so that an eigenvalue that does not move keeps its own.
    """
    values = matrix.d[origin] + delta
    right, left, force = _in_poles(matrix, origin, delta)
    products, sizes = complex_product(left, right.T), product(magnitude(left), magnitude(right).T)
    np.fill_diagonal(products, 0.0)
    if not np.all(magnitude(products) <= _ORTHOGONAL * sizes):
        return None
    right, left = states(right, left)
    real = values.imag == 0
    for vectors in (right, left, force):
        vectors[real] = vectors[real].real
    return Spectrum(values, np.ascontiguousarray(right.T), left, force)


@kernel
def _in_poles(matrix: _RankOne, origin: NDArray[np.intp], delta: Complex) -> tuple[Complex, Complex, Complex]:
    """Return right and left eigenvectors in the coordinates in which D is diagonal, and λ per right one.

    Vectors are ``(eigenvalue, pole)``; eigenvalue i is d[origin[i]] + delta[i].
    """
    alpha, d, u, w = matrix
    right = np.empty((origin.size, d.size), dtype=np.complex128)
    left, force = np.empty_like(right), np.empty(origin.size, dtype=np.complex128)
    for i in range(origin.size):
        o = origin[i]
        others = 1.0 + 0.0j
        for k in range(d.size):
            if k != o:
                inverse = quotient(1.0 + 0.0j, (d[o] - d[k]) + delta[i])  # 1/(s - d_k)
                right[i, k], left[i, k] = u[k] * inverse, w[k] * inverse
                others -= alpha * (u[k] * left[i, k])
        force[i] = quotient(w[o], others)
        lead, follow = alpha * force[i], alpha * quotient(u[o], others)
        right[i, o] = left[i, o] = 1.0
        length = 1.0 + 0.0j
        for k in range(d.size):
            if k != o:
                right[i, k] *= lead
                left[i, k] *= follow
                length += left[i, k] * right[i, k]
        inverse = quotient(1.0 + 0.0j, length)
        for k in range(d.size):
            left[i, k] *= inverse
    return right, left, force


@kernel
def _right_states(d: Complex, rate: Array, response: Array, right: Complex) -> Complex:
    """Return right eigenvectors in X = [z, z', τ]: z = η + Q τ, z' = ζ - Q μ τ."""
    modes, heats = response.shape
    states = np.empty_like(right)
    for i in range(right.shape[0]):
        for m in range(modes):
            one, other = right[i, m], right[i, modes + m]
            z, slope = one + other, d[m] * one + d[modes + m] * other
            for j in range(heats):
                dragged = response[m, j] * right[i, 2 * modes + j]
                z += dragged
                slope -= rate[j] * dragged
            states[i, m], states[i, modes + m] = z, slope
        for j in range(2 * modes, 2 * modes + heats):
            states[i, j] = right[i, j]
    return states


@kernel
def _left_states(d: Complex, damping: Array, rate: Array, response: Array, left: Complex) -> Complex:
    """Return left eigenvectors per X: the inverse of :func:`_right_states`, transposed."""
    modes, heats = response.shape
    states = np.empty_like(left)
    for i in range(left.shape[0]):
        for j in range(2 * modes, 2 * modes + heats):
            states[i, j] = left[i, j]
        for m in range(modes):
            split = quotient(1.0 + 0.0j, d[m] - d[modes + m])
            one, other = left[i, m] * split, left[i, modes + m] * split
            place = one * (d[m] + damping[m]) - other * (d[modes + m] + damping[m])
            slope = one - other
            states[i, m], states[i, modes + m] = place, slope
            for j in range(heats):
                states[i, 2 * modes + j] += response[m, j] * (rate[j] * slope - place)
    return states


def _zeros(residue: Complex, d: Complex, guesses: Any) -> tuple[NDArray[np.intp], Complex] | None:
    """Return nearest pole and shift from it of every zero of f with imaginary part >= 0.

    Poles without a residue are eigenvalues themselves.
    """
    still = residue == 0
    guesses = guesses.astype(np.complex128)
    for pole in d[still]:
        guesses = np.delete(guesses, np.argmin(magnitude(guesses - pole)))
    guesses = guesses[guesses.imag >= 0]
    moving = np.flatnonzero(~still)
    kept = np.flatnonzero(still & (d.imag >= 0))
    if moving.size == 0:
        return kept, np.zeros(kept.size, dtype=np.complex128)
    origin = moving[np.argmin(magnitude(guesses[:, None] - d[moving]), axis=1)]
    delta = guesses - d[origin]
    whole = int((guesses.imag == 0).sum() + 2 * (guesses.imag > 0).sum())
    if whole != moving.size or not _newton(residue, d, origin, delta):
        return None
    return np.concatenate([origin, kept]), np.concatenate([delta, np.zeros(kept.size)])


@kernel
def _newton(residue: Complex, d: Complex, origin: NDArray[np.intp], delta: Complex) -> bool:
    """Move the shifts to zeros of δ f(d_o + δ), which has no pole at δ = 0; return whether all converged."""
    for i in range(origin.size):
        o = origin[i]
        shift = delta[i]
        real = shift.imag == 0.0 and d[o].imag == 0.0
        converged = False
        for _ in range(_NEWTON_STEPS):
            others, slope = 1.0 + 0.0j, 0.0 + 0.0j
            for k in range(d.size):
                if k != o:
                    inverse = quotient(1.0 + 0.0j, (d[o] - d[k]) + shift)
                    term = residue[k] * inverse
                    others -= term
                    slope += term * inverse
            step = quotient(shift * others - residue[o], others + shift * slope)
            shift -= step
            if real:
                shift = complex(shift.real, 0.0)
            change, size = hypot(step.real, step.imag), hypot(shift.real, shift.imag)
            if change <= _CONVERGED * size + _TINY:
                converged = True
                break
            converged = change <= _STALLED * size
        if not converged:
            return False
        delta[i] = shift
    return True
