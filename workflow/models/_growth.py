"""Growth in permanent contact: poles of the structure with a set of contacts closed for good and their heat.

They are the eigenvalues s of the matrix A of :func:`contact_system`, which differ by many decades: those of heat are
slow beside those of motion. LAPACK leaves an error of rounding times the fastest in all of them. With the left and
right eigenvectors y and x that it finds, the error of yᵀA x/yᵀx is of second order, and its rounding that of the terms
of the sums.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.models._cases import distinct_rows
from workflow.models._contact_basis import ContactBasis, analyse_contacts
from workflow.models._contact_system import ContactSystem, contact_system
from workflow.models._contacts import closed_sets
from workflow.models._structure import Structure, stays_cold

_UNCERTAIN = 1e-12
"""Error of an eigenvalue over the largest one, and of yᵀA x/yᵀx over the sum of its terms' magnitudes."""


class Growth(NamedTuple):
    """Poles with contacts closed for good, or of each case that of largest real part, and their uncertainty.

    1/s, ``(pole,)`` or ``(case,)`` each; -∞ where the structure cannot move then, NaN where forces are not unique.
    """

    pole: Complex
    uncertainty: Array

    @property
    def rate(self) -> Array:
        """Growth rate, 1/s."""
        return self.pole.real

    @property
    def frequency(self) -> Array:
        """Frequency of what grows, Hz; 0 where it does not oscillate."""
        return np.where(self.pole.imag > self.uncertainty, self.pole.imag, 0.0) / (2 * np.pi)

    @property
    def is_positive(self) -> NDArray[np.bool_]:
        """Whether the rate is positive by more than its uncertainty."""
        return self.rate > self.uncertainty


def poles_in_contact(basis: ContactBasis, closed: NDArray[np.intp], alpha: float, friction: float) -> Growth:
    """Return all poles with some contacts ``closed`` for good, not below the real axis.

    A real part within its uncertainty is 0. A temperature that stands for none has no pole.
    """
    basis = basis.unheated if stays_cold(basis.heat) else basis
    system = _without_heat(basis, tuple(closed.tolist()), friction)
    if system is None:
        return Growth(np.array([np.nan + 0j]), np.zeros(1))
    heated = np.zeros_like(system.A)
    heated[len(heated) - basis.rate.size :] = alpha * basis.heat[closed].T @ system.signals[closed]
    poles, uncertainty = _eigenvalues(system.A + heated, np.abs(system.A) + np.abs(heated))
    rates, above = np.where(np.abs(poles.real) > uncertainty, poles.real, 0.0), poles.imag >= 0
    return Growth((rates + 1j * poles.imag)[above], uncertainty[above])


@lru_cache(maxsize=1)
def _without_heat(basis: ContactBasis, closed: tuple[int, ...], friction: float) -> ContactSystem | None:
    """Return the system with contacts closed that exert no heat, kept for several couplings."""
    return contact_system(basis, np.isin(np.arange(basis.contacts.count), closed), 0.0, friction)


def _eigenvalues(A: Array, terms: Array) -> tuple[Complex, Array]:
    """Return the eigenvalues of A and their uncertainties, 1/s, ``(state,)`` each; ``terms`` are those of its sums."""
    if not A.size:
        return np.zeros(0, np.complex128), np.zeros(0)
    values, left, right = scipy.linalg.eig(A, left=True, right=True)
    left = left.conj()
    with np.errstate(all="ignore"):  # where eigenvectors depend on each other their product is 0
        product = np.sum(left * right, axis=0)
        better = np.sum(left * (A @ right), axis=0) / product
        rounded = np.sum(np.abs(left) * (terms @ np.abs(right)), axis=0) / np.abs(product)
    largest = np.abs(values).max()
    known = np.abs(better - values) <= _UNCERTAIN * largest
    return np.where(known, better, values), _UNCERTAIN * np.where(known, rounded, largest)


def growth_of_sets(basis: ContactBasis, alpha: Array, friction: Array) -> dict[tuple[str, ...], Growth]:
    """Return the growth in permanent contact for each of :func:`closed_sets`, by its labels.

    ``basis`` is that of :func:`analyse_contacts` of a structure, full or reduced. ``alpha`` [W/N] and ``friction`` are
    ``(case,)``; the bits of a case do not depend on the others.
    """
    first, which = distinct_rows(alpha[:, None], friction[:, None])
    pairs, found = list(zip(alpha[first].tolist(), friction[first].tolist(), strict=True)), {}
    for labels, closed in closed_sets(basis.contacts).items():
        each = [_fastest(poles_in_contact(basis, closed, *pair)) for pair in pairs]
        found[labels] = Growth(*(np.array(column)[which] for column in zip(*each, strict=True)))
    return found


def _fastest(poles: Growth) -> tuple[complex, float]:
    """Return the pole of largest real part and its uncertainty; -∞ of none."""
    if not poles.rate.size:
        return complex(-np.inf), 0.0
    k = poles.rate.argmax()
    return complex(poles.pole[k]), float(poles.uncertainty[k])


def worst(of_sets: dict[tuple[str, ...], Growth]) -> tuple[NDArray[np.intp], Growth]:
    """Return which set grows fastest for certain in each case, of equals the first, and its growth: 0 of no motion."""
    poles, uncertainties = (np.array([getattr(each, name) for each in of_sets.values()]) for name in Growth._fields)
    certain = np.nan_to_num(poles.real - uncertainties, nan=-np.inf)
    at = (certain >= certain.max(axis=0) - uncertainties).argmax(axis=0)
    pole, uncertainty = (np.take_along_axis(each, at[None], axis=0)[0] for each in (poles, uncertainties))
    return at, Growth(np.where(pole.real == -np.inf, 0.0, pole), uncertainty)


def growth_rate(structure: Structure, alpha: float, friction: float = 0.0) -> float:
    """Return the growth rate of the worst closed set at ``alpha``, 1/s; negative where contact is stable."""
    sets = growth_of_sets(analyse_contacts(structure), np.array([alpha]), np.array([friction]))
    return float(worst(sets)[1].rate[0])
