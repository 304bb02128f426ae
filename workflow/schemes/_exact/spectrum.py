"""Eigenvalues and eigenvectors of the held tip in the states X = [z, z', τ] of its modes and thermal modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from workflow.kernels.algebra import Complex, eigenvalues, eigenvectors
from workflow.models import Array
from workflow.schemes._exact.modal_system import ModalSystem
from workflow.schemes._exact.rank_one import INDEPENDENT, RankOne, Zeros, zeros_of

_CRITICAL = 1e-2
"""Two poles of a block nearer than this, relatively, and a pole so near a thermal rate, lose digits by its square:
:func:`~workflow.schemes._exact.real_blocks.real_blocks` does better."""

_TRUSTED = 1e6
"""Σ |l_k x_k| of a pole up to which its eigenvectors, l x = 1, keep ten digits: it grows without bound as another
pole comes near that has the same eigenvector."""

_NEAR_RATE = 1e-5
"""Share of |s| + μ beyond which a pole s is so far from a thermal rate, s = -μ, that the response to that mode keeps
eleven digits."""

_ROUNDING = 1e-13
"""Share of the fastest pole within which poles are the same: the general solver errs by 1e-15 of it and more."""


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


@dataclass(frozen=True, eq=False)
class Separate:
    """A system without friction heat and friction along a tangent in coordinates in which its matrix D is diagonal."""

    poles: Complex
    """D: poles, of modes first those above the real axis, then rates with their sign, ``(N,)``."""
    whole: Complex
    """X per coordinate, [[V, R], [0, 1]], ``(N, N)``."""
    inverse: Complex
    force: Complex
    """Contact force per coordinate, ``(N,)``."""


_SEPARATED: WeakKeyDictionary[ModalSystem, Separate | None] = WeakKeyDictionary()
"""What systems are at each α and µ."""


def separated(held: ModalSystem, A: Array) -> Separate | None:
    """Return a system in its own coordinates, ``None`` where they cannot be trusted.

    V are the eigenvectors of the mechanical part alone, R its response to a thermal mode, (A_m + μ) R = -A_mτ. ``A``
    and lists of ``held`` may leave out displacements on which nothing depends.
    """
    if held not in _SEPARATED:
        size = A.shape[0] - held.rate.size
        row = np.concatenate([-held.reaction, -held.reaction_slope, -held.thermal_reaction])
        try:
            parts = _by_eigenvectors(held, A[:size], row) if held.is_coupled else _by_modes(held)
        except np.linalg.LinAlgError:
            parts = None
        _SEPARATED[held] = None if parts is None else _whole(*parts, held.rate, row)
    return _SEPARATED[held]


def _whole(poles: Complex, right: Complex, left: Complex, response: Array, mu: Array, row: Array) -> Separate:
    """Return the coordinates by poles, V, V⁻¹ and R."""
    size = poles.size
    whole, inverse = (np.eye(size + mu.size, dtype=np.complex128) for _ in range(2))
    whole[:size, :size], whole[:size, size:] = right, response
    inverse[:size, :size], inverse[:size, size:] = left, -left @ response
    return Separate(np.concatenate([poles, -mu + 0j]), whole, inverse, row @ whole)


def _by_modes(held: ModalSystem) -> tuple[Complex, Complex, Complex, Array] | None:
    """Return poles, V, V⁻¹ and R in closed form; ``None`` where poles or rates are near each other, or a pole is 0."""
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
    upper, lower = -c / 2 + split / 2, -c / 2 - split / 2
    overdamped = (split.imag == 0) & (c > 0)
    upper[overdamped] = omega2[overdamped] / lower[overdamped]  # no cancellation
    one, response = np.eye(c.size), -held.coupling / polynomial
    right = np.block([[one, one], [np.diag(upper), np.diag(lower)]])
    left = np.block([[np.diag(-lower / split), np.diag(1 / split)], [np.diag(upper / split), np.diag(-1 / split)]])
    return np.concatenate([upper, lower]), right, left, np.vstack([response, -response * mu])


def _by_eigenvectors(held: ModalSystem, moved: Array, row: Array) -> tuple[Complex, Complex, Complex, Array] | None:
    """Return them by the general solver; ``moved`` are [z', z''] per X, ``(2 mode, N)``."""
    size = moved.shape[0]
    if held.friction_force is not None:
        moved = moved - np.outer(np.append(np.zeros(size // 2), held.friction_force), row)
    values, right, left = eigenvectors(moved[:, :size])
    response = _thermal_response(held, moved, values) if is_trusted(right, left) else None
    return None if response is None else (values, right, left, response)


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


def condition_numbers(right: Any, left: Any) -> Array:
    """Return Σ |l_k x_k| of each pole, 1 where its eigenvector depends on no other, whatever the units."""
    return np.asarray(np.sum(np.abs(left) * np.abs(right.T), 1))


def is_trusted(right: Any, left: Any) -> bool:
    """Tell whether no eigenvector nearly depends on others."""
    return bool(np.all(condition_numbers(right, left) <= _TRUSTED))


def rank_one(held: ModalSystem, system: Separate, alpha: float = 1.0) -> RankOne:
    """Return the matrix of heat at the tip, with friction along a tangent that of both at α."""
    size = system.poles.size - held.rate.size
    per_force = np.concatenate([np.zeros(size), alpha * held.heat_tip])
    if held.friction_force is not None:
        per_force[size // 2 : size] = held.friction_force
    return RankOne(held.rate.size, system.poles, system.inverse @ per_force, system.force)


def secular_spectrum(held: ModalSystem, alpha: float, A: Array) -> Spectrum | None:
    """Return the spectrum with friction heat and friction along a tangent; ``None`` where it cannot be trusted.

    Without either it is that of :func:`separated`: poles first, then rates in their order.
    """
    system = separated(held, A)
    if system is None:
        return None
    if alpha == 0 and held.friction_force is None:
        keep = system.poles.imag >= 0
        return Spectrum(system.poles[keep], system.whole[:, keep], system.inverse[keep], system.force[keep])
    if condition_numbers(system.whole, system.inverse).max(initial=0.0) > 1 / _CRITICAL:
        return None
    matrix = rank_one(held, system, alpha)
    zeros = zeros_of(matrix, 1.0, eigenvalues(A))
    return None if zeros is None else _spectrum(matrix, zeros, system)


def _spectrum(matrix: RankOne, zeros: Zeros, system: Separate) -> Spectrum | None:
    """Return eigenvectors that are 1 at their own poles, so that an eigenvalue that does not move keeps its own."""
    (_, d, u, w), (pole, shift, _) = matrix, zeros
    own = np.arange(d.size) == pole[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):  # a pole that stays where another is: no vectors
        inverse = np.where(own, 0.0, 1 / np.where(own, 1.0, (d[pole][:, None] - d) + shift[:, None]))
        f = 1 - np.sum(u * w * inverse, axis=1)
        force = w[pole] / f
        right, left = own + force[:, None] * u * inverse, own + (u[pole] / f)[:, None] * w * inverse
        terms = left * right
        length = np.sum(terms, axis=1)
    if not np.all(np.abs(length) > INDEPENDENT * np.sum(np.abs(terms), axis=1)):
        return None
    right, left = system.whole @ right.T, (left / length[:, None]) @ system.inverse
    real = d[pole].imag + shift.imag == 0
    right.imag[:, real], left.imag[real], force.imag[real] = 0.0, 0.0, 0.0
    return Spectrum(d[pole] + shift, right, left, force)
