"""Eigenvalues and eigenvectors of the held tip in the states X = [z, z', τ] of its modes and thermal modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import eigenvalues, eigenvectors
from workflow.kernels.compiled import part, uncounted
from workflow.kernels.packs import Lane, complex_at, narrow, store_complex, times
from workflow.models import Array
from workflow.schemes._exact import secular
from workflow.schemes._exact import zeros as row
from workflow.schemes._exact.modal_system import ModalSystem
from workflow.schemes._exact.zeros import RankOne, Scratch, rank_one, scratch

Complex = NDArray[np.complex128]

_CRITICAL = 1e-4
"""Two poles of a block nearer than this, relatively, leave fewer than twelve digits in their own
eigenvectors: then the general solver does no worse."""

_TRUSTED = 1e6
"""Σ |l_k x_k| of a pole up to which its eigenvectors, l x = 1, keep ten digits: it grows without bound as another
pole comes near that has the same eigenvector."""

_NEAR_RATE = 1e-5
"""Share of |s| + μ beyond which a pole s is so far from a thermal rate, s = -μ, that the response to that mode keeps
eleven digits."""

_ROUNDING = 1e-13
"""Share of the fastest pole within which poles are the same: the general solver errs by 1e-15 of it and more."""

_NONE = np.zeros((2, 0))


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


class Uncoupled(NamedTuple):
    """The held tip in uncoupled modes at every α, in the coordinates z = ζ + ζ* + Q τ in which D is diagonal."""

    matrix: RankOne
    damping: Array
    """c of the modes, 1/s, ``(mode,)``."""
    split: Array
    """Inverse of the difference of the two poles of a mode, s, ``(2, mode)``."""
    response: Array
    """Q, ``(mode, thermal mode)``."""
    lag: Array
    """Q μ."""


def uncoupled(held: ModalSystem, alpha: float = 1.0) -> Uncoupled | None:
    """Return the system where damping couples no modes, no two poles are near each other and none is 0.

    With friction along a tangent it is that at ``alpha``.
    """
    if held.is_coupled:
        return None
    c, mu, omega2 = held.damping, held.rate, held.frequency**2
    split = 2 * np.sqrt((c / 2) ** 2 - omega2 + 0j)
    polynomial = mu**2 - mu * c[:, None] + omega2[:, None]
    size = mu**2 + mu * c[:, None] + omega2[:, None]
    if (
        np.any(held.frequency == 0)
        or np.any(np.abs(split) <= _CRITICAL * (held.frequency + c))
        or np.any(np.abs(polynomial) <= _CRITICAL * size)
    ):
        return None
    response = -held.coupling / polynomial
    matrix, inverse = _matrix(held, split, response, alpha), 1.0 / split
    return Uncoupled(matrix, c, np.array([inverse.real, inverse.imag]), response, response * mu)


def _matrix(held: ModalSystem, split: Complex, response: Array, alpha: float) -> RankOne:
    """Return the matrix; ``split`` is the difference of the two poles of each mode, ``response`` Q of z = η + Q τ."""
    modes, c, mu, aK = held.frequency.size, held.damping, held.rate, held.relaxation
    root, omega2 = split / 2, held.frequency**2
    upper, lower = -c / 2 + root, -c / 2 - root
    overdamped = (root.imag == 0) & (c > 0)
    upper[overdamped] = omega2[overdamped] / lower[overdamped]  # no cancellation
    heats = held.heat_tip if held.friction_force is None else alpha * held.heat_tip
    u0, u1 = -response @ heats, response @ (mu * heats)
    u1 = u1 if held.friction_force is None else u1 + held.friction_force
    d = np.concatenate([upper, lower, -mu + 0j])
    block_u = np.tile(u1, 2) + (d[: 2 * modes] + np.tile(c, 2)) * np.tile(u0, 2)
    u = np.concatenate([block_u / np.concatenate([split, -split]), heats])
    thermal_w = -held.thermal_reaction - (held.reaction @ response) * (1 - aK * mu)
    w = np.concatenate([-np.tile(held.reaction, 2) * (1 + aK * d[: 2 * modes]), thermal_w])
    return rank_one(d, u, w, mu.size)


@part
def _right_states(held: Uncoupled, right: Array, lane: Lane) -> None:
    """Turn right eigenvectors into those in X: z = η + Q τ, z' = ζ - Q μ τ."""
    (modes, heats), d = held.response.shape, held.matrix.d
    for m in range(modes):
        at, low = 2 * m, 2 * (modes + m)
        (a, a_im), (b, b_im) = complex_at(right, at, lane), complex_at(right, low, lane)
        (v, v_im), (w, w_im) = times(d[0, m], d[1, m], a, a_im), times(d[0, modes + m], d[1, modes + m], b, b_im)
        z, z_im, v, v_im = a + b, a_im + b_im, v + w, v_im + w_im
        for j in range(heats):
            tau, tau_im = complex_at(right, 2 * (2 * modes + j), lane)
            z, z_im = z + held.response[m, j] * tau, z_im + held.response[m, j] * tau_im
            v, v_im = v - held.lag[m, j] * tau, v_im - held.lag[m, j] * tau_im
        store_complex(right, at, lane, (z, z_im))
        store_complex(right, low, lane, (v, v_im))


@part
def _left_states(held: Uncoupled, left: Array, lane: Lane) -> None:
    """Turn left eigenvectors into those per X: the inverse of :func:`_right_states`, transposed."""
    (modes, heats), d, split = held.response.shape, held.matrix.d, held.split
    for m in range(modes):
        at, low, c = 2 * m, 2 * (modes + m), held.damping[m]
        (a, a_im), (b, b_im) = complex_at(left, at, lane), complex_at(left, low, lane)
        (a, a_im), (b, b_im) = times(split[0, m], split[1, m], a, a_im), times(split[0, m], split[1, m], b, b_im)
        store_complex(left, low, lane, (a - b, a_im - b_im))
        a, a_im = times(d[0, m] + c, d[1, m], a, a_im)
        b, b_im = times(d[0, modes + m] + c, d[1, modes + m], b, b_im)
        store_complex(left, at, lane, (a - b, a_im - b_im))
    for j in range(heats):
        own = 2 * (2 * modes + j)
        tau, tau_im = complex_at(left, own, lane)
        for m in range(modes):
            lag, static = held.lag[m, j], held.response[m, j]
            (z, z_im), (v, v_im) = complex_at(left, 2 * m, lane), complex_at(left, 2 * (modes + m), lane)
            tau, tau_im = tau + (lag * v - static * z), tau_im + (lag * v_im - static * z_im)
        store_complex(left, own, lane, (tau, tau_im))


@part
def solve_uncoupled(held: Uncoupled, alpha: float, guesses: Array, work: Scratch) -> tuple[int, int]:
    """Find zeros and eigenvectors in X, see :func:`~workflow.schemes._exact.secular.solve`."""
    pairs, count = secular.solve(held.matrix, alpha, guesses, work)
    for first in range(0, count, 8):
        _right_states(held, work.right, narrow(first))
        _left_states(held, work.left, narrow(first))
    return pairs, count


@uncounted
def _solve_matrix(matrix: RankOne, alpha: float, guesses: Array, work: Scratch) -> tuple[int, int]:
    return secular.solve(matrix, alpha, guesses, work)


@uncounted
def _solve_system(held: Uncoupled, alpha: float, guesses: Array, work: Scratch) -> tuple[int, int]:
    return solve_uncoupled(held, alpha, guesses, work)


def general_spectrum(A: Array, force: Array) -> Spectrum:
    """Return the spectrum by the general solver."""
    values, right, left = eigenvectors(A)
    keep = values.imag >= 0
    right = right[:, keep]
    return Spectrum(values[keep], right, left[keep], force @ right)


def condition_numbers(right: Complex, left: Complex) -> Array:
    """Return Σ |l_k x_k| of each pole, 1 where its eigenvector depends on no other, whatever the units."""
    return np.asarray(np.sum(np.abs(left) * np.abs(right.T), 1))


def is_trusted(right: Complex, left: Complex) -> bool:
    """Tell whether no eigenvector nearly depends on others."""
    return bool(np.all(condition_numbers(right, left) <= _TRUSTED))


def guesses_of(A: Array) -> Array:
    """Return eigenvalues with imaginary part >= 0 by the general solver, ``(2, eigenvalue)``."""
    values = eigenvalues(A)
    upper_half = values[values.imag >= 0]
    return np.array([upper_half.real, upper_half.imag])


def secular_spectrum(held: ModalSystem, alpha: float, A: Array) -> Spectrum | None:
    """Return the spectrum of D + α u wᵀ, with friction along a tangent of D + u wᵀ; ``None`` where it is poor."""
    if held.is_coupled:
        return coupled_spectrum(held, alpha, A)
    system = uncoupled(held, alpha)
    spectrum = None if system is None else _spectrum(_solve_system, system, _factor(held, alpha), A)
    return None if spectrum is None else _rounded(spectrum)


def _factor(held: ModalSystem, alpha: float) -> float:
    """Return α, 1 where friction along a tangent is in u too."""
    return alpha if held.friction_force is None else 1.0


def _spectrum(solver: Any, system: Any, alpha: float, A: Array) -> Spectrum | None:
    """Return what a solver finds, from the poles or from the eigenvalues of the general solver."""
    work = scratch(A.shape[0])
    _, count = solver(system, float(alpha), _NONE, work)
    if count == 0 and A.size:
        _, count = solver(system, float(alpha), guesses_of(A), work)
    if count == 0 and A.size:
        return None
    t = work.lanes[:, :count]
    values = t[row.D] + t[row.SHIFT] + 1j * (t[row.D_IM] + t[row.SHIFT_IM])
    right, left = (side[::2, :count] + 1j * side[1::2, :count] for side in (work.right, work.left))
    force = t[row.FORCE] + 1j * (t[row.FORCE_IM])
    return Spectrum(values, right, left.T, force)


def _rounded(spectrum: Spectrum) -> Spectrum:
    """Return a spectrum in X whose real eigenvalues have real vectors."""
    real = spectrum.values.imag == 0
    right, left, force = spectrum.right.copy(), spectrum.left.copy(), spectrum.force.copy()
    right.imag[:, real], left.imag[real], force.imag[real] = 0.0, 0.0, 0.0
    return Spectrum(spectrum.values, right, left, force)


def _thermal_response(system: ModalSystem, moved: Array, poles: Complex) -> Array | None:
    """Return the response [z, z'] to each thermal mode, ``(N, thermal mode)``; ``None`` where a pole is at its rate.

    That to a mode that loses no heat is static: where the pole of a motion that nothing holds is 0 too, heat does not
    drive that motion.
    """
    modes, size, fastest = system.frequency.size, moved.shape[0], np.abs(poles).max(initial=0.0)
    response = np.zeros((size, system.rate.size))
    for j, mu in enumerate(system.rate):
        drive = moved[:, size + j]
        if not np.any(drive):
            continue
        distance = np.abs(poles + mu)
        at = distance <= np.maximum(_NEAR_RATE * (np.abs(poles) + mu), _ROUNDING * fastest)
        if not np.any(at):
            response[:, j] = np.linalg.solve(moved[:, :size] + mu * np.eye(size), -drive)
        elif mu == 0 and system.friction_force is None:
            elastic = system.frequency > 0
            response[:modes][elastic, j] = -system.coupling[elastic, j] / system.frequency[elastic] ** 2
        else:
            return None
    return response


@dataclass(frozen=True, eq=False)
class _Separate:
    """A system without friction heat in coordinates in which its matrix D is diagonal."""

    poles: Complex
    """D: poles, then rates with their sign, ``(N,)``."""
    whole: Complex
    """[[V, R], [0, 1]], ``(N, N)``."""
    inverse: Complex
    force: Complex
    """Contact force per coordinate, ``(N,)``."""


_SEPARATED: WeakKeyDictionary[ModalSystem, _Separate | None] = WeakKeyDictionary()
"""What systems are without friction heat and friction along a tangent, the same at each α."""


def _separate(system: ModalSystem, moved: Array, row: Array) -> _Separate | None:
    """Return the coordinates that part a system whose modes damping couples, ``None`` where they cannot be trusted.

    ``moved`` are [z', z''] per X, ``(2 mode, N)``.
    """
    size, mu = moved.shape[0], system.rate
    try:
        values, right, left = eigenvectors(moved[:, :size])
        response = _thermal_response(system, moved, values) if is_trusted(right, left) else None
    except np.linalg.LinAlgError:
        return None
    if response is None:
        return None
    whole, inverse = (np.eye(size + mu.size, dtype=np.complex128) for _ in range(2))
    whole[:size, :size], whole[:size, size:] = right, response
    inverse[:size, :size], inverse[:size, size:] = left, -left @ response
    return _Separate(np.concatenate([values, -mu + 0j]), whole, inverse, row @ whole)


def coupled_spectrum(held: ModalSystem, alpha: float, A: Array) -> Spectrum | None:
    """Return the spectrum where damping couples the modes, ``None`` where it cannot be trusted.

    The eigenvectors V of the mechanical part alone are those of a general matrix. Its response to a thermal mode is R,
    (A_m + μ) R = -A_mτ, so that D holds the poles and the rates in the coordinates of [[V, R], [0, 1]]. Without
    friction heat that is the spectrum: poles first, then rates in their order. ``A`` and ``held`` may leave out
    displacements on which nothing depends.
    """
    size = A.shape[0] - held.rate.size
    row = np.concatenate([-held.reaction, -held.reaction_slope, -held.thermal_reaction])
    per_force = np.concatenate([np.zeros(size), held.heat_tip])
    if held.friction_force is not None:
        push = np.concatenate([np.zeros(size // 2), held.friction_force])
        per_force = np.concatenate([push, alpha * held.heat_tip])
        system = _separate(held, A[:size] - np.outer(push, row), row)
    else:
        if held not in _SEPARATED:
            _SEPARATED[held] = _separate(held, A[:size], row)
        system = _SEPARATED[held]
    if system is None:
        return None
    if alpha == 0 and held.friction_force is None:
        keep = system.poles.imag >= 0
        return Spectrum(system.poles[keep], system.whole[:, keep], system.inverse[keep], system.force[keep])
    matrix = rank_one(system.poles, system.inverse @ per_force, system.force, held.rate.size)
    spectrum = _spectrum(_solve_matrix, matrix, _factor(held, alpha), A)
    if spectrum is None:
        return None
    right, left = system.whole @ spectrum.right, spectrum.left @ system.inverse
    return Spectrum(spectrum.values, right, left, spectrum.force)
