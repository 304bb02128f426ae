"""Blocks of a structure whose modes damping couples: pairs of its poles, complex ones with their conjugates.

Poles s₁, s₂ with left eigenvectors l₁, l₂ and right ones x₁, x₂ have the coordinates η = ξ₁ + ξ₂ and
u = s₁ ξ₁ + s₂ ξ₂, ξ = l X, so that η' = u, u' = (s₁ + s₂) u - s₁ s₂ η and

    X = ((s₁ x₂ - s₂ x₁) η + (x₁ - x₂) u)/(s₁ - s₂).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import Complex
from workflow.models import Array
from workflow.schemes._exact.modal_system import ModalSystem
from workflow.schemes._exact.spectrum import condition_numbers, secular_spectrum
from workflow.schemes._interface import RefusedStructureError

INSEPARABLE = (
    "couples its modes and leaves poles that event_driven cannot separate: three coincide, one is a thermal "
    "rate, or a real one grows as damping is negative; change it by a trifle, or take a scheme with a fixed step"
)
"""Why such a structure is refused."""

_ROUNDING = 1e-12
"""Share of the fastest pole up to which a negative sum or product of poles is rounding: the general solver's is 1e-15
of it times the condition of the pole."""

_SIMPLE = 10.0
"""Σ |l_k x_k| of a pole up to which one step of Newton's method makes it better: another pole near it turns its
eigenvector, and takes the slope along which the step goes."""


class InseparablePolesError(RefusedStructureError):
    """Poles of a structure whose modes damping couples are too near each other or a thermal rate, or one feeds it."""

    def __init__(self) -> None:
        super().__init__(f"its damping matrix {INSEPARABLE}")


class PolePairs(NamedTuple):
    """Blocks η'' + c η' + ω² η and first-order states ξ, the thermal modes, in X = [z, z', τ]; N of them in all."""

    damping: Array
    """c, 1/s, ``(block,)``."""
    stiffness: Array
    """ω², 1/s², ascending, ``(block,)``."""
    inward: Array
    """[η, u, ξ] per X, ``(N, N)``."""
    outward: Array
    """X per [η, u, ξ], ``(N, N)``."""


def pole_pairs(system: ModalSystem, A: Array) -> PolePairs:
    """Return the blocks of a system without friction heat, X' = A X, whose modes damping couples.

    Complex poles are paired with their conjugates, real ones with each other, the slowest with the fastest. With the
    tip free each pole that has no other near it has its own relative accuracy, see :func:`sharpened`.

    A rigid motion y, on which nothing depends, has the pole 0. It is one block with the real pole s whose velocities v
    are the most rigid, X = y η + (v, [shapes that follow]) u, y the rigid part of v: no division by s, however small.

    Raises
    ------
    InseparablePolesError
        Poles coincide, one is a thermal rate, or a real one is positive.
    """
    size, modes, rigid = A.shape[0], system.frequency.size, np.flatnonzero(system.frequency == 0)
    kept = np.delete(np.arange(size), rigid)
    lists = {name: np.delete(getattr(system, name), rigid, axis=0) for name in ("frequency", "coupling", "reaction")}
    spectrum = secular_spectrum(replace(system, **lists), 0.0, A[np.ix_(kept, kept)])
    if spectrum is None:
        raise InseparablePolesError
    values, count = spectrum.values, spectrum.values.size - system.rate.size
    right, left = np.zeros((2, size, values.size), dtype=np.complex128)
    right[kept], left[kept] = spectrum.right, spectrum.left.T
    right[rigid] = right[modes + rigid] / np.where(values == 0, 1.0, values)
    poles, speeds = values[:count], right[modes : 2 * modes, :count]
    share = np.sum(np.abs(speeds[rigid]) ** 2, 0) / np.sum(np.abs(speeds) ** 2, 0)
    drifts = np.argsort(np.where(poles.imag == 0, -share, 1.0), kind="stable")[: rigid.size]
    others = np.setdiff1d(np.arange(count), drifts)
    if np.any(poles[drifts].imag > 0):
        raise InseparablePolesError
    drift, drag = speeds[np.ix_(rigid, drifts)].real, system.damping[rigid] @ speeds[:, drifts].real
    right[np.ix_(rigid, drifts)] = 0.0
    if system.is_free:
        simple = condition_numbers(spectrum.right[:, :count], spectrum.left[:count]) < _SIMPLE
        simple[drifts] = False
        poles = np.where(simple, sharpened(poles, right[:, :count], system), poles)
    (s, t), (l1, l2), (x1, x2) = _paired(poles, left.T, right.T, others)
    apart = (s - t)[:, None]
    into = [(l1 + l2).real, (s[:, None] * l1 + t[:, None] * l2).real, left.T[count:].real]
    between = ((s[:, None] * x2 - t[:, None] * x1) / apart).real
    back = [between, ((x1 - x2) / apart).real, right.T[count:].real]
    place = np.eye(size)[rigid] - np.concatenate(back)[:, rigid].T @ np.concatenate(into)
    into = [np.linalg.solve(drift, place), into[0], left.T[drifts].real, *into[1:]]
    back = [drift.T @ np.eye(size)[rigid], back[0], right.T[drifts].real, *back[1:]]
    fastest = np.abs(poles).max(initial=0.0)
    stiffness = _without_rounding((s * t).real, fastest * np.maximum(np.abs(s), np.abs(t)))
    if np.any(stiffness < 0):
        raise InseparablePolesError
    damping = np.append(np.sum(drift * drag, 0) / np.sum(drift * drift, 0), -(s + t).real)
    return PolePairs(
        _without_rounding(damping, np.full(damping.size, fastest)),
        np.append(np.zeros(rigid.size), stiffness),
        np.concatenate(into),
        np.concatenate(back).T,
    )


def _paired(poles: Complex, left: Complex, right: Complex, others: Any) -> tuple[tuple[Any, Any], ...]:
    """Return both poles of each block, their left eigenvectors and their right ones, ``(block, N)``.

    Vectors of two real poles do not point opposite ways: those of poles that nearly coincide nearly agree.
    """
    one, other = (others[k] for k in _partners(poles[others]))
    twin = (one == other)[:, None]
    x1, x2 = right[one], np.where(twin, right[other].conj(), right[other])
    sign = np.where(~twin & (np.sum(x1 * x2, 1, keepdims=True).real < 0), -1.0, 1.0)
    second = np.where(twin[:, 0], poles[other].conj(), poles[other])
    l2 = sign * np.where(twin, left[other].conj(), left[other])
    return (poles[one], second), (left[one], l2), (x1, sign * x2)


def sharpened(values: Complex, right: Complex, system: ModalSystem) -> Complex:
    """Return poles by one step of Newton's method, each to its own relative accuracy.

    The general solver leaves an error of rounding times the largest pole. A pole s with the displacements y of its
    eigenvector is a zero of yᵀ (s² + s D + ω²) y, D the matrix of damping. D is symmetric: an error of y counts by its
    square.

    Parameters
    ----------
    values, right
        Poles, ``(pole,)``, and their eigenvectors in [z, z', …], ``(N, pole)``.
    """
    y = right[: system.frequency.size]
    squares = y * y
    inertia = np.sum(squares, 0)
    dissipation = np.sum(y * (system.damping @ y), 0)
    strain = np.sum(system.frequency[:, None] ** 2 * squares, 0)
    off = values * (values * inertia + dissipation) + strain
    return np.asarray(values - off / ((2 * values) * inertia + dissipation))


def _partners(values: Any) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the two poles of each block, ascending by their product; twice the same for a complex pair."""
    pair, real = np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag == 0)
    real = real[np.argsort(np.abs(values[real]), kind="stable")]
    one, other = np.concatenate([pair, real[: real.size // 2]]), np.concatenate([pair, real[::-1][: real.size // 2]])
    order = np.argsort(np.abs(values[one]) * np.abs(values[other]), kind="stable")
    return one[order], other[order]


def _without_rounding(values: Array, size: Array) -> Array:
    """Return sums or products of poles, 0 where they are negative by rounding."""
    return np.where((values < 0) & (values >= -_ROUNDING * size), 0.0, values)
