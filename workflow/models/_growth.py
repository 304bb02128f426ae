"""Growth rate in permanent contact: the rightmost eigenvalue of the structure held at the gap, with its heat.

Of several contacts it is the worst of :func:`closed_sets`, whose systems are those of ``_contact_system``. Of one,
with x = φ η + ψ x_n (fixed-interface modes and constraint mode), θ = χ τ (thermal modes of the whole structure), x_n
constant and no loads, equation (1) becomes

    η'' + c η' + ω² η + κ τ = 0               κ = φᵀ K12 χ,   c = φᵀ C1 φ
    τ' + μ τ = t α λ                          t = χ_n
    λ = g τ - L η'' - b η'                    g = -ψᵀ K12 χ,  L = φᵀ M ψ,  b = φᵀ C1 ψ

the last line being ψᵀ (1a). With a free root ψ strains no spring, so g is exactly zero. Friction µ along t
adds µ φᵀt λ to the first line and divides λ by 1 - µ (ψᵀt - L φᵀt).

Of up to 600 states all eigenvalues are computed, of more those of the 100 + 100 modes that contact heat shifts most;
the other poles are taken to be those without heat. Where c couples no modes the rightmost are refined on the whole
system, 1 = α G(s), with G(s) the transfer function from a heat load at the tip to the contact force.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.models._cases import distinct_rows
from workflow.models._contact_basis import ContactBasis, analyse_contacts
from workflow.models._contact_coordinates import contacts_last
from workflow.models._contact_system import poles_in_contact
from workflow.models._contacts import closed_sets
from workflow.models._modes import held_damping, is_rayleigh, poles
from workflow.models._pair import Modes
from workflow.models._structure import Structure, stays_cold

_ALL_STATES = 600
"""States up to which all eigenvalues are computed."""

_TOGETHER = 2**17
"""Entries of the matrices whose eigenvalues are computed at a time: 1 MiB."""

_STRONGEST = 100
"""Modes of each kind of a larger structure whose eigenvalues are computed."""

_REFINED = 24
"""Number of eigenvalues of largest real part that are refined."""

_STEPS = 30
"""Largest number of Newton steps; from eigenvalues of a part it takes three to ten."""

_UNCERTAIN = 1e-12
"""Uncertainty of an eigenvalue over the largest one."""

_CONVERGED = 1e-7
"""Largest relative change of an eigenvalue in the last Newton step."""

_ROUNDING = 1e-13
"""Relative shift of a pole up to which it is rounding."""


class Growth(NamedTuple):
    """The pole of largest real part with contacts closed for good, not below the real axis, and its uncertainty.

    1/s, ``(case,)`` each; -∞ where the structure cannot move then, NaN where it was not found.
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


def _rightmost(poles: Complex) -> Complex:
    """Return of each row the pole of largest real part, or its conjugate, not below the real axis; -∞ of none."""
    poles = np.concatenate([poles, np.full((*poles.shape[:-1], 1), -np.inf)], axis=-1)
    found = np.take_along_axis(poles, poles.real.argmax(axis=-1)[..., None], axis=-1)[..., 0]
    return np.where(found.imag < 0, found.conj(), found)


@dataclass(frozen=True, eq=False)
class InContact:
    """The system in modes, the same for every α."""

    modes: Array
    """ω [1/s], c [1/s], L [√kg] and b [√kg/s] of the modes with the tip held, ``(4, mechanical mode)``."""
    heat: Array
    """μ [1/s], t [1/√(J/K)] and g [N/√(J K)] of the thermal modes, ``(3, thermal mode)``."""
    coupling: Array
    """κ, ``(mechanical mode, thermal mode)``."""
    has_rigid: bool
    """Whether rigid modes, which no heat excites, are left out: they have the eigenvalues 0 and -a_M."""
    damping: Array | None
    """φᵀ C1 φ [1/s], ``(mechanical mode, mechanical mode)``, where damping is not Rayleigh's and may couple modes."""
    slid: Array | None
    """φᵀt, then ψᵀt, of the sliding direction t; ``None`` where there is none."""
    labels: tuple[str, ...]
    """That of the contact."""

    @cached_property
    def poles(self) -> Complex:
        """Eigenvalues without contact heat, 1/s: two of each mode, then -μ."""
        return np.append(poles(self.modes[0], self.modes[1]), -self.heat[0])

    @cached_property
    def relative_shifts(self) -> tuple[Array, Array]:
        """Relative shift by contact heat per α to first order, residues of G over poles.

        Of each pole; then the largest that each thermal mode gives a mechanical pole: it may do so and keep its own.
        """
        omega, damping, participation, drag = self.modes[:, :, None]
        decay, tip, static = self.heat
        s, size = self.poles[: 2 * omega.size].reshape(-1, 2), np.abs(self.poles)
        size = np.maximum(size, size[size > 0].min() if size.any() else 1.0)
        given = (s * (participation * s + drag))[:, :, None] * (self.coupling * tip)[:, None]
        with np.errstate(all="ignore"):  # of a pole at a thermal rate, of critical damping
            given = np.nan_to_num(given / ((2 * s + damping)[:, :, None] * (s[:, :, None] + decay)))
            rest = decay * (decay - damping) + omega**2
            follows = np.divide(decay * (participation * decay - drag), rest, out=np.zeros_like(rest), where=rest != 0)
            moved = np.append(given.sum(axis=2), tip * (static + (follows * self.coupling).sum(axis=0)))
            each = np.abs(given) / size[: s.size].reshape(-1, 2, 1)
            return np.abs(moved) / size, each.max(axis=(0, 1), initial=0.0)

    def shifted_modes(self, alpha: Array) -> Iterator[tuple[InContact, Complex, NDArray[np.intp]]]:
        """Yield systems of modes that contact heat shifts or acts by, at most the strongest, other poles, and which α.

        A larger α shifts the same modes and weaker ones: so many of each kind say which they are.
        """
        count, (each, given) = self.modes.shape[1], self.relative_shifts
        most = _STRONGEST if self.poles.size > _ALL_STATES else self.poles.size
        kinds = each[: 2 * count].reshape(count, 2).max(axis=1), np.maximum(each[2 * count :], given)
        orders = [np.argsort(-kind, kind="stable")[:most] for kind in kinds]
        shifted = [alpha[:, None] * kind[o] > _ROUNDING for kind, o in zip(kinds, orders, strict=True)]
        numbers, group = np.unique([each.sum(axis=1) for each in shifted], axis=1, return_inverse=True)
        for k, some in enumerate(numbers.T):
            modes, heats = (np.sort(order[:number]) for order, number in zip(orders, some, strict=True))
            part = self._part(modes, heats)
            others = np.delete(self.poles, np.concatenate([2 * modes, 2 * modes + 1, 2 * count + heats]))
            yield part, others, np.flatnonzero(group == k)

    def _part(self, modes: NDArray[np.intp], heats: NDArray[np.intp]) -> InContact:
        """Return the system of some modes, without friction."""
        if self.slid is None and (modes.size, heats.size) == self.coupling.shape:
            return self
        coupling = self.coupling[np.ix_(modes, heats)]
        return replace(self, modes=self.modes[:, modes], heat=self.heat[:, heats], coupling=coupling, slid=None)

    def contact_force(self, s: Complex) -> tuple[Complex, Complex]:
        """Return the transfer function G(s) from a heat load at the tip to the contact force, and dG/ds; ``(s,)`` each.

        G = Σ_k [g_k + Σ_j h_j(s) κ_jk] t_k/(s + μ_k), h_j = (L_j s² + b_j s)/(s² + c_j s + ω_j²).
        """
        omega, damping, participation, drag = self.modes
        decay, tip, static = self.heat
        s = s[:, None]
        cooling = 1 / (s + decay)
        warmth = tip * cooling
        rest = 1 / (s * (s + damping) + omega**2)
        share = s * (participation * s + drag) * rest
        slope = (2 * participation * s + drag - share * (2 * s + damping)) * rest
        driven, turned = (np.matmul(each[:, None], self.coupling + 0j)[:, 0] for each in (share, slope))
        driven += static
        turned -= driven * cooling
        return (driven * warmth).sum(axis=1), (turned * warmth).sum(axis=1)

    def matrices(self, alpha: Array, friction: Array) -> Array:
        """Return A of X' = A X, X = [ω η, η', τ], 1/s, ``(α, state, state)``."""
        omega, own, participation, drag = self.modes
        decay, tip, static = self.heat
        count = omega.size
        damping = np.diag(own) if self.damping is None else self.damping
        speeds = np.hstack([-np.diag(omega), -damping, -self.coupling])  # η''
        force = np.concatenate([np.zeros(count), -drag, static]) - participation @ speeds
        every = np.zeros((alpha.size, force.size, force.size))
        every[:, :count, count : 2 * count] = np.diag(omega)
        every[:, count : 2 * count] = speeds
        forces = np.broadcast_to(force, (alpha.size, 1, force.size))
        if self.slid is not None:
            slid, along = self.slid[:-1], self.slid[-1]
            forces = forces / (1 - friction * (along - participation @ slid))[:, None, None]
            every[:, count : 2 * count] += (friction[:, None] * slid)[:, :, None] * forces
        every[:, 2 * count :] = (alpha[:, None] * tip)[:, :, None] * forces
        every[:, 2 * count :, 2 * count :] -= np.diag(decay)
        return every


def in_contact(structure: Structure) -> InContact | ContactBasis:
    """Return the system of a structure in contact; of one without matrices that of its lowest modes of both kinds.

    Friction excites rigid modes of the interior too: they are kept where there is a sliding direction. Of several
    contacts, or contacts without mass, it is the structure with all of them open.
    """
    contacts = structure.contacts
    if not contacts.is_one_with_mass or contacts_last(structure) is not None:
        return analyse_contacts(structure)
    pair, few = structure.mechanical, None if structure.has_matrices else _STRONGEST
    held, thermal = pair.modes(few, held=True), structure.thermal.modes(few)
    if stays_cold(thermal.tip):  # the one temperature stands for none
        thermal = Modes(thermal.values[:0], thermal.shapes[:, :0])
    kept = (held.values > 0) | contacts.slides
    omega, shapes = np.sqrt(held.values[kept]), np.ascontiguousarray(held.shapes[:, kept])
    constraint, expansions = pair.constraint, structure.expansions(thermal.shapes)
    participation, coupled = shapes.T @ pair.inertia_of(constraint), None
    damping, drag = structure.damping.of_modes(omega), structure.damping.mass * participation
    if not is_rayleigh(structure):
        coupled = held_damping(structure, Modes(omega, shapes))
        damping, drag = np.diag(coupled), shapes.T @ (structure.damping_matrix @ constraint)
    return InContact(
        modes=np.stack([omega, np.broadcast_to(damping, omega.shape), participation, drag]),
        heat=np.stack([thermal.values, thermal.tip, pair.work(constraint, pair.deformed, expansions)]),
        coupling=-pair.work(shapes, pair.deformation_of(shapes), expansions),
        has_rigid=not np.all(kept),
        damping=coupled,
        slid=np.column_stack([shapes, constraint]).T @ contacts.tangent[0] if contacts.slides else None,
        labels=contacts.labels,
    )


def growth_of_sets(contact: InContact | ContactBasis, alpha: Array, friction: Array) -> dict[tuple[str, ...], Growth]:
    """Return the growth of a structure in permanent contact for each of :func:`closed_sets`, by its labels.

    ``contact`` is what :func:`in_contact` returns of a structure, full or reduced. ``alpha`` [W/N] and ``friction`` are
    ``(case,)``; the bits of a case do not depend on the others. Where damping or friction couples the modes no
    eigenvalue is refined. NaN where forces are not unique, or none of a larger structure could be refined; flutter of
    modes that contact heat shifts little may be missed there. :func:`poles_in_contact` gives all poles of a set.
    """
    if isinstance(contact, ContactBasis):
        return _of_contacts(contact, alpha, friction)
    most = max(1, _TOGETHER // max(1, contact.poles.size) ** 2)
    slices = (slice(first, first + most) for first in range(0, alpha.size, most))
    each = [_growth(contact, alpha[some], friction[some]) for some in slices]
    return {contact.labels: Growth(*map(np.concatenate, zip(*each, strict=True)))}


def _of_contacts(basis: ContactBasis, alpha: Array, friction: Array) -> dict[tuple[str, ...], Growth]:
    """Return the growth for each closed set of several contacts, or of contacts without mass."""
    first, which = distinct_rows(alpha[:, None], friction[:, None])
    found = {}
    for labels, closed in closed_sets(basis.contacts).items():
        pole, largest = np.full(first.size, np.nan, np.complex128), np.zeros(first.size)
        for k, i in enumerate(first.tolist()):
            poles = poles_in_contact(basis, closed, float(alpha[i]), float(friction[i]))
            if poles is not None:
                pole[k], largest[k] = _rightmost(poles), np.abs(poles).max(initial=0.0)
        found[labels] = Growth(pole[which], _UNCERTAIN * largest[which])
    return found


def worst(of_sets: dict[tuple[str, ...], Growth]) -> tuple[NDArray[np.intp], Growth]:
    """Return which set grows fastest for certain in each case, of equals the first, and its growth: 0 of no motion."""
    poles, uncertainties = (np.array([getattr(each, name) for each in of_sets.values()]) for name in Growth._fields)
    certain = np.nan_to_num(poles.real - uncertainties, nan=-np.inf)
    at = (certain >= certain.max(axis=0) - uncertainties).argmax(axis=0)
    pole, uncertainty = (np.take_along_axis(each, at[None], axis=0)[0] for each in (poles, uncertainties))
    return at, Growth(np.where(pole.real == -np.inf, 0.0, pole), uncertainty)


def _growth(contact: InContact, alpha: Array, friction: Array) -> Growth:
    """Return the growth of cases whose matrices are made at a time."""
    pole, largest = np.empty(alpha.size, np.complex128), np.empty(alpha.size)
    couples = (contact.damping is not None) | ((contact.slid is not None) & (friction != 0))
    if couples.any():
        values = np.linalg.eigvals(contact.matrices(alpha[couples], friction[couples])).astype(np.complex128)
        pole[couples], largest[couples] = _rightmost(values), np.abs(values).max(axis=1, initial=0.0)
    uncoupled = np.flatnonzero(~couples)
    for part, others, group in contact.shifted_modes(alpha[uncoupled]):
        some = uncoupled[group]
        values = np.linalg.eigvals(part.matrices(alpha[some], friction[some])).astype(np.complex128)
        refined, other = _refined(contact, part, alpha[some], values), _rightmost(others)
        pole[some] = np.where(refined.real < other.real, other, refined)
        largest[some] = np.abs(values).max(axis=1, initial=np.abs(contact.poles).max(initial=0.0))
    pole[contact.has_rigid & (pole.real < 0)] = 0.0
    pole[~(pole.real < np.inf)] = np.nan
    return Growth(pole + 0.0, _UNCERTAIN * largest)


def _refined(contact: InContact, part: InContact, alpha: Array, spectrum: Complex) -> Complex:
    """Return the rightmost pole of each spectrum of a part, refined by Newton's method on 1/G(s) = α, ``(case,)``.

    An eigenvalue from which it comes to a root nearer to another one is kept: contact heat cannot shift it, so it is no
    root. Where it does not converge they are kept if the spectrum is that of all modes, else left out; NaN if none is
    left. Poles of the part that contact heat does not shift are exact.
    """
    order = np.argsort(np.where(spectrum.imag >= 0, -spectrum.real, np.inf), axis=1, kind="stable")[:, :_REFINED]
    starts = np.take_along_axis(spectrum, order, axis=1)
    above = starts.imag >= 0
    roots, left, moving = starts.copy(), np.full(starts.shape, np.inf), above.copy()
    coupling = np.broadcast_to(alpha[:, None], starts.shape)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            force, slope = contact.contact_force(roots[moving])
            step = force * (coupling[moving] * force - 1) / slope
            step[~np.isfinite(step)] = 0.0
            roots[moving] -= step
            left[moving] = np.abs(step)
            moving &= left > _ROUNDING * np.abs(roots)
            if not moving.any():
                break
    rounding = _UNCERTAIN * np.abs(spectrum).max(axis=1, initial=0.0)[:, None]
    found = left <= np.maximum(_CONVERGED * np.abs(roots), rounding)
    nearest = np.abs(roots[:, :, None] - spectrum[:, None]).min(axis=2, initial=np.inf)
    refined = found & (np.abs(roots - starts) <= nearest + rounding)
    distance = np.abs(starts[:, :, None] - part.poles)
    unshifted = (alpha[:, None] * part.relative_shifts[0] <= _ROUNDING)[:, None] & (distance <= rounding[:, :, None])
    unshifted &= distance == distance.min(axis=1, keepdims=True, initial=np.inf)
    exact = np.where(unshifted, part.poles.real, -np.inf).max(axis=2, initial=-np.inf)
    known = above & (found | (contact.poles.size <= _ALL_STATES))
    kept = np.where(known, np.where(refined, roots, starts), -np.inf)
    kept = _rightmost(np.where(exact > -np.inf, exact + 1j * starts.imag, kept))
    return np.where(known.any(axis=1) | ~above.any(axis=1), kept, np.nan)


def growth_rate(structure: Structure, alpha: float, friction: float = 0.0) -> float:
    """Return the growth rate of the worst closed set at ``alpha``, 1/s; negative where contact is stable."""
    return float(worst(growth_of_sets(in_contact(structure), np.array([alpha]), np.array([friction])))[1].rate[0])
