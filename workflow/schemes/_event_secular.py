"""Eigenvalues and eigenvectors of the held tip with friction heat, each to its own relative accuracy.

In the modes that are uncoupled without friction heat the matrix is D + α u wᵀ, D = diag(d): poles of
the held structure and its thermal rates, u what heat at the tip moves, w what presses on the casing.
Its eigenvalues are the zeros of the secular function

    f(s) = 1 - α Σ u_k w_k/(s - d_k).

A general eigenvalue solver errs by rounding times the *largest* eigenvalue, some 1e-11 1/s here,
which spoils the slow thermal ones. It serves as a first guess; Newton's method then finds the shift
δ of each eigenvalue from its nearest pole, so that every difference s - d_k keeps its digits
(Golub, SIAM Review 15 (1973) 318–334; the shift from the nearest pole as in LAPACK's dlaed4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.schemes._event_regimes import Held
from workflow.schemes._kernel import kernel

Complex = NDArray[np.complex128]

_CRITICAL = 1e-4
"""Two poles of a block nearer than this, relatively, leave fewer than twelve digits in their own
eigenvectors: then the general solver does no worse."""
_ORTHOGONAL = 1e-9
"""Left and right eigenvectors of different eigenvalues must be orthogonal to this share of their
products, else an eigenvalue was missed or found twice, or two of them nearly coincide."""
_NEWTON_STEPS = 12
_CONVERGED, _STALLED = 1e-15, 1e-11
"""Newton ends where a shift changes by less than the first, a few roundings, relatively; if steps run
out, the second still counts as found: quadratic convergence makes its next change less than rounding."""
_TINY = 1e-300
"""A shift of zero has converged."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues with imaginary part >= 0, their right and left vectors in X = [z, z', τ], and λ per vector."""

    values: Complex
    right: Complex
    left: Complex
    force: Complex


def general_spectrum(A: Array, force: Array) -> Spectrum:
    """Return the spectrum by the general solver."""
    values, right = np.linalg.eig(A)
    left = np.linalg.inv(right)
    keep = values.imag >= 0
    right = right[:, keep].astype(np.complex128)
    return Spectrum(values[keep].astype(np.complex128), right, left[keep].astype(np.complex128), force @ right)


def secular_spectrum(held: Held, alpha: float, A: Array) -> Spectrum | None:
    """Return the spectrum of D + α u wᵀ, ``None`` where it cannot be trusted."""
    modes = held.frequency.size
    omega2, c, mu, aK = held.frequency**2, held.damping, held.rate, held.relaxation
    root = np.sqrt((c / 2) ** 2 - omega2 + 0j)
    upper = -c / 2 + root
    split = 2 * root
    polynomial = mu**2 - mu * c[:, None] + omega2[:, None]
    size = mu**2 + mu * c[:, None] + omega2[:, None]
    if (
        np.any(held.frequency == 0)
        or np.any(np.abs(split) <= _CRITICAL * (held.frequency + c))
        or np.any(np.abs(polynomial) <= _CRITICAL * size)
    ):
        return None
    lower = -c / 2 - root
    overdamped = (root.imag == 0) & (c > 0)
    upper[overdamped] = omega2[overdamped] / lower[overdamped]  # no cancellation
    response = -held.coupling / polynomial  # z = η + Q τ
    warming = held.heat_tip
    u0, u1 = -response @ warming, response @ (mu * warming)
    d = np.concatenate([upper, lower, -mu + 0j])
    gap = np.concatenate([split, -split])
    block_u = (np.tile(u1, 2) + (d[: 2 * modes] + np.tile(c, 2)) * np.tile(u0, 2)) / gap
    u = np.concatenate([block_u, warming])
    thermal_w = -held.thermal_reaction - (held.reaction @ response) * (1 - aK * mu)
    w = np.concatenate([-np.tile(held.reaction, 2) * (1 + aK * d[: 2 * modes]), thermal_w])
    residue = alpha * u * w
    for guesses in (_slow_and_fast, None):
        found = _zeros(residue, d, guesses(residue, d, modes) if guesses else np.linalg.eigvals(A))
        if found is not None:
            with np.errstate(all="ignore"):  # what is not finite is not orthogonal
                spectrum = _vectors(held, alpha, d, u, w, response, *found)
            if spectrum is not None:
                return spectrum
    return None


def _slow_and_fast(residue: Complex, d: Complex, modes: int) -> Complex:
    """Guess the eigenvalues: poles of blocks hardly move, thermal rates see a quasi-static structure."""
    poles, rates = d[: 2 * modes], d[2 * modes :].real
    yielding = 1 + (residue[: 2 * modes] / poles).sum().real
    slow = np.diag(rates) + residue[2 * modes :].real / yielding
    return np.concatenate([poles, np.linalg.eigvals(slow)])


def _vectors(
    held: Held,
    alpha: float,
    d: Complex,
    u: Complex,
    w: Complex,
    response: Array,
    origin: NDArray[np.intp],
    delta: Complex,
) -> Spectrum | None:
    """Return the eigenvectors (s - D)⁻¹ u and wᵀ (s - D)⁻¹ in X, ``None`` where they are not orthogonal.

    They are scaled to 1 at the nearest pole, so that an eigenvalue that does not move keeps its own.
    """
    modes, c, mu = held.frequency.size, held.damping, held.rate
    index = np.arange(origin.size)
    values = d[origin] + delta
    real = values.imag == 0
    distance = (d[origin][:, None] - d) + delta[:, None]  # s - d_k
    distance[index, origin] = 1.0
    rest = 1 - ((alpha * u * w) / distance).sum(axis=1) + alpha * (u * w)[origin]
    force = w[origin] / rest
    right = (alpha * force)[:, None] * u / distance
    left = (alpha * u[origin] / rest)[:, None] * w / distance
    right[index, origin] = left[index, origin] = 1.0
    left /= (left * right).sum(axis=1)[:, None]
    products, sizes = left @ right.T, np.abs(left) @ np.abs(right).T
    products[index, index] = 0.0
    if not np.all(np.abs(products) <= _ORTHOGONAL * sizes):
        return None
    # back to X = [z, z', τ]
    high, low, tau = slice(0, modes), slice(modes, 2 * modes), slice(2 * modes, None)
    eta = right[:, high] + right[:, low]
    zeta = d[high] * right[:, high] + d[low] * right[:, low]
    heat = right[:, tau]
    whole_right = np.concatenate([eta + heat @ response.T, zeta - (mu * heat) @ response.T, heat], axis=1)
    split = d[high] - d[low]
    per_eta = left[:, high] * (d[high] + c) / split - left[:, low] * (d[low] + c) / split
    per_zeta = (left[:, high] - left[:, low]) / split
    per_heat = left[:, tau] - per_eta @ response + (per_zeta @ response) * mu
    whole_left = np.concatenate([per_eta, per_zeta, per_heat], axis=1)
    for vectors in (whole_right, whole_left):
        vectors[real] = vectors[real].real
    force[real] = force[real].real
    return Spectrum(values, np.ascontiguousarray(whole_right.T), whole_left, force)


def _zeros(residue: Complex, d: Complex, guesses: Any) -> tuple[NDArray[np.intp], Complex] | None:
    """Return nearest pole and shift from it of every zero of f with imaginary part >= 0.

    Poles without a residue are eigenvalues themselves.
    """
    still = residue == 0
    guesses = guesses.astype(np.complex128)
    for pole in d[still]:
        guesses = np.delete(guesses, np.argmin(np.abs(guesses - pole)))
    guesses = guesses[guesses.imag >= 0]
    moving = np.flatnonzero(~still)
    kept = np.flatnonzero(still & (d.imag >= 0))
    if moving.size == 0:
        return kept, np.zeros(kept.size, dtype=np.complex128)
    origin = moving[np.argmin(np.abs(guesses[:, None] - d[moving]), axis=1)]
    delta = guesses - d[origin]
    whole = int((guesses.imag == 0).sum() + 2 * (guesses.imag > 0).sum())
    if whole != moving.size or not _newton(residue, d, origin, delta):
        return None
    return np.concatenate([origin, kept]), np.concatenate([delta, np.zeros(kept.size)])


@kernel
def _newton(residue: Complex, d: Complex, origin: NDArray[np.intp], delta: Complex) -> bool:
    """Move the shifts to zeros of δ f(d_o + δ), which has no pole at δ = 0; tell whether all converged."""
    for i in range(origin.size):
        o = origin[i]
        shift = delta[i]
        real = shift.imag == 0.0 and d[o].imag == 0.0
        converged = False
        for _ in range(_NEWTON_STEPS):
            rest, slope = 1.0 + 0.0j, 0.0 + 0.0j
            for k in range(d.size):
                if k != o:
                    inverse = 1.0 / ((d[o] - d[k]) + shift)
                    term = residue[k] * inverse
                    rest -= term
                    slope += term * inverse
            step = (shift * rest - residue[o]) / (rest + shift * slope)
            shift -= step
            if real:
                shift = complex(shift.real, 0.0)
            if abs(step) <= _CONVERGED * abs(shift) + _TINY:
                converged = True
                break
            converged = abs(step) <= _STALLED * abs(shift)
        if not converged:
            return False
        delta[i] = shift
    return True
