"""Growth rate of a tip in permanent contact: the rightmost eigenvalue of the contact-closed system.

Of up to 600 states all eigenvalues are computed. Of more, those of the 100 + 100 modes that contact heat moves most
are, and the other modes start where the first order in α puts them. What lies furthest right is improved on the whole
system: with the tip held and its contact force λ heating it, equation (1) closes through one number, and an eigenvalue
s fulfils G(s) = 1/α, where G(s) is the contact force that a unit heat load at the tip causes, both as exp(s t).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import Complex, eigenvalues
from workflow.models._contact_closed import ContactClosed, Indices, contact_closed
from workflow.models._structure import Structure

_ALL_STATES = 600
"""States up to which all eigenvalues are computed."""

_STRONGEST = 100
"""Modes of each kind of a larger structure whose eigenvalues are computed together."""

_IMPROVED = 24
"""Eigenvalues of largest real part that are improved."""

_STEPS = 30
"""Of Newton's iteration; from eigenvalues of a part it takes three to ten."""

_UNCERTAIN = 1e-12
"""Uncertainty of an eigenvalue as a share of the largest."""

_CONVERGED = 1e-7
"""Share of an eigenvalue by which the last step of its improvement may change it."""

_ZERO = 1e-13
"""Share of a pole that is rounding: contact heat that moves it no further leaves it where it is, and an eigenvalue
below that share of the slowest pole is 0."""

_FIRST_ORDER = 0.1
"""Share of a pole by which the first order in α may move an eigenvalue to begin with."""


class Growth(NamedTuple):
    """Largest real part of the eigenvalues with the tip in permanent contact, and its uncertainty, 1/s."""

    rate: float
    uncertainty: float

    @property
    def is_positive(self) -> bool:
        """Whether it is positive by more than its uncertainty."""
        return self.rate > self.uncertainty


@dataclass(frozen=True, eq=False)
class InContact:
    """What the growth rate of a structure is computed from, the same for every α.

    Attributes
    ----------
    system
        The contact-closed system.
    part
        That of the modes whose eigenvalues are computed: the system itself where it is small, or coupled by damping.
    others
        Which poles are those of the other modes.
    orders
        ds/dα of the eigenvalue at each pole, 1/s per W/N; empty where damping couples the modes.
    sliding
        The system with what friction drives beside, where there is a direction of it.
    """

    system: ContactClosed
    part: ContactClosed
    others: Indices
    orders: Complex
    sliding: ContactClosed | None = None


def in_contact(structure: Structure) -> InContact:
    """Prepare the growth rates of a structure; of one without matrices those of its lowest modes."""
    few = None if structure.has_matrices else _STRONGEST
    system = contact_closed(structure, few)
    sliding = None if structure.tangent is None else contact_closed(structure, slides=True)
    orders = np.zeros(0, dtype=np.complex128) if system.is_coupled else system.first_orders()
    if orders.size <= _ALL_STATES:
        return InContact(system, system, np.zeros(0, dtype=np.intp), orders, sliding)
    poles, modes = system.poles(), system.modes.shape[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(np.abs(orders) / np.abs(poles), posinf=np.inf)
    chosen = np.sort(np.argsort(-share[: 2 * modes].reshape(modes, 2).max(axis=1), kind="stable")[:_STRONGEST])
    heats = np.sort(np.argsort(-share[2 * modes :], kind="stable")[:_STRONGEST])
    others = np.delete(np.arange(poles.size), np.concatenate([2 * chosen, 2 * chosen + 1, 2 * modes + heats]))
    return InContact(system, system.part(chosen, heats), others, orders, sliding)


def growth(prepared: InContact, alpha: float, friction: float = 0.0) -> Growth:
    """Return the largest real part of the eigenvalues of the contact-closed system, 1/s; negative: all decays.

    Where damping or friction couples the modes all eigenvalues are computed, and none is improved. NaN where none of
    a larger structure could be improved; flutter of modes that contact heat moves little may be missed there.
    """
    sliding = prepared.sliding if friction != 0 else None
    system = sliding or prepared.system
    if sliding or system.is_coupled:
        values = eigenvalues(system.matrix(alpha, friction if sliding else 0.0))
        rates = values.real
    else:
        values, rates = _rates(prepared, alpha)
    rate = float(rates.max(initial=0.0 if system.has_rigid else -np.inf)) + 0.0
    return Growth(rate if np.isfinite(rate) else np.nan, _UNCERTAIN * float(np.abs(values).max(initial=0.0)))


def _rates(prepared: InContact, alpha: float) -> tuple[Complex, Array]:
    """Return approximate eigenvalues and poles, and real parts of eigenvalues that are improved or stay where they are.

    On a pole that takes no part in the contact 1/G says nothing.
    """
    system, part, others, poles = prepared.system, prepared.part, prepared.others, prepared.system.poles()
    moved, slowest = alpha * np.abs(prepared.orders), np.abs(poles[poles != 0]).min(initial=np.inf)
    still = poles[moved <= _ZERO * np.maximum(np.abs(poles), slowest)]
    step, most = alpha * prepared.orders[others], _FIRST_ORDER * np.abs(poles[others])
    step *= np.divide(most, moved[others], out=np.ones_like(most), where=moved[others] > most)
    spectrum = np.concatenate([eigenvalues(part.matrix(alpha)), poles[others] + step])
    above = spectrum[spectrum.imag >= 0]
    starts = above[np.argsort(-above.real, kind="stable")[:_IMPROVED]]
    roots, left = _improved(system, alpha, starts)
    converged = left <= np.maximum(_CONVERGED * np.abs(roots), _UNCERTAIN * np.abs(spectrum).max())
    rates = np.where(converged, roots, starts).real[converged | (part is system)]
    rates[np.abs(rates) <= _ZERO * slowest] = 0.0
    return np.append(spectrum, poles), np.append(rates, still.real)


def _improved(system: ContactClosed, alpha: float, starts: Complex) -> tuple[Complex, Array]:
    """Return eigenvalues improved by Newton's method on 1/G(s) = α, and the last step of each, 1/s."""
    roots, left = starts.copy(), np.full(starts.size, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            force, slope = system.contact_force(roots)
            step = force * (alpha * force - 1) / slope
            step[~np.isfinite(step)] = 0.0
            roots, left = roots - step, np.abs(step)
            if np.all(left <= _ZERO * np.abs(roots)):
                break
    return roots, left


def growth_rate(structure: Structure, alpha: float, friction: float = 0.0) -> float:
    """Return the growth rate of a structure at ``alpha``, 1/s, see :func:`growth`."""
    return growth(in_contact(structure), alpha, friction).rate
