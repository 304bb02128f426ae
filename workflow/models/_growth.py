"""Growth rate of a tip in permanent contact: the rightmost eigenvalue of the structure held at the gap, with its heat.

With x = φ η + ψ x_n (fixed-interface modes and constraint mode), θ = χ τ (thermal modes of the whole structure), x_n
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

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import Complex, eigenvalues
from workflow.models._modes import held_damping, is_rayleigh, poles
from workflow.models._pair import Modes
from workflow.models._structure import Structure

_ALL_STATES = 600
"""States up to which all eigenvalues are computed."""

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
    """Largest real part of the eigenvalues with the tip in permanent contact, and its uncertainty, 1/s."""

    rate: float
    uncertainty: float

    @property
    def is_positive(self) -> bool:
        """Whether it is positive by more than its uncertainty."""
        return self.rate > self.uncertainty


@dataclass(frozen=True, eq=False)
class InContact:
    """The system in modes, the same for every α.

    Attributes
    ----------
    modes
        ω [1/s], c [1/s], L [√kg] and b [√kg/s] of the modes with the tip held, ``(4, mechanical mode)``.
    heat
        μ [1/s], t [1/√(J/K)] and g [N/√(J K)] of the thermal modes, ``(3, thermal mode)``.
    coupling
        κ, ``(mechanical mode, thermal mode)``.
    has_rigid
        Whether rigid modes, which no heat excites, are left out: they have the eigenvalues 0 and -a_M.
    damping
        φᵀ C1 φ [1/s], ``(mechanical mode, mechanical mode)``, where damping is not Rayleigh's and may couple modes.
    slid
        φᵀt, then ψᵀt, of the sliding direction t; ``None`` where there is none.
    """

    modes: Array
    heat: Array
    coupling: Array
    has_rigid: bool
    damping: Array | None
    slid: Array | None

    @cached_property
    def poles(self) -> Complex:
        """Eigenvalues without contact heat, 1/s: two of each mode, then -μ."""
        return np.append(poles(self.modes[0], self.modes[1]), -self.heat[0])

    @cached_property
    def relative_shifts(self) -> Array:
        """Relative shift of each pole by contact heat per α, to first order: residues of G over poles."""
        omega, damping, participation, drag = self.modes[:, :, None]
        decay, tip, static = self.heat
        s = self.poles[: 2 * omega.size].reshape(-1, 2)
        with np.errstate(divide="ignore", invalid="ignore"):  # of a pole at a thermal rate, of critical damping
            driven = ((self.coupling * tip)[:, None] / (s[:, :, None] + decay)).sum(axis=2)
            moved = np.nan_to_num(s * (participation * s + drag) * driven / (2 * s + damping))
        rest = decay * (decay - damping) + omega**2
        follows = np.divide(decay * (participation * decay - drag), rest, out=np.zeros_like(rest), where=rest != 0)
        moved, size = np.append(moved, tip * (static + (follows * self.coupling).sum(axis=0))), np.abs(self.poles)
        return np.asarray(np.abs(moved) / np.maximum(size, size[size > 0].min(initial=np.inf)))

    def shifted_modes(self, alpha: float) -> tuple[InContact, Complex]:
        """Return the system of modes with poles that contact heat shifts, at most the strongest, and the others."""
        count, each = self.modes.shape[1], self.relative_shifts
        most = _STRONGEST if self.poles.size > _ALL_STATES else self.poles.size
        kinds = each[: 2 * count].reshape(count, 2).max(axis=1), each[2 * count :]
        order = (np.argsort(-kind, kind="stable")[:most] for kind in kinds)
        modes, heats = (np.sort(o[alpha * kind[o] > _ROUNDING]) for o, kind in zip(order, kinds, strict=True))
        coupling = self.coupling[np.ix_(modes, heats)]
        part = replace(self, modes=self.modes[:, modes], heat=self.heat[:, heats], coupling=coupling)
        return part, np.delete(self.poles, np.concatenate([2 * modes, 2 * modes + 1, 2 * count + heats]))

    def contact_force(self, s: Complex) -> tuple[Complex, Complex]:
        """Return the transfer function G(s) from a heat load at the tip to the contact force, and dG/ds; ``(s,)`` each.

        G = Σ_k [g_k + Σ_j h_j(s) κ_jk] t_k/(s + μ_k), h_j = (L_j s² + b_j s)/(s² + c_j s + ω_j²).
        """
        omega, damping, participation, drag = self.modes
        decay, tip, static = self.heat
        s = s[:, None]
        warmth = tip / (s + decay)
        rest = s * (s + damping) + omega**2
        share = s * (participation * s + drag) / rest
        slope = (2 * participation * s + drag - share * (2 * s + damping)) / rest
        driven = static + share @ self.coupling
        turned = slope @ self.coupling - driven / (s + decay)
        return (driven * warmth).sum(axis=1), (turned * warmth).sum(axis=1)

    def matrix(self, alpha: float, friction: float = 0.0) -> Array:
        """Return A of X' = A X, X = [ω η, η', τ], 1/s."""
        omega, own, participation, drag = self.modes
        decay, tip, static = self.heat
        damping = np.diag(own) if self.damping is None else self.damping
        zero, row = np.zeros((omega.size, omega.size)), np.zeros((omega.size, decay.size))
        speeds = np.block([[-np.diag(omega), -damping, -self.coupling]])  # η''
        force = -participation @ speeds
        force += np.concatenate([np.zeros(omega.size), -drag, static])
        if friction != 0 and self.slid is not None:
            slid, along = self.slid[:-1], self.slid[-1]
            force /= 1 - friction * (along - participation @ slid)
            speeds += friction * slid[:, None] * force
        warming = alpha * tip[:, None] * force
        warming[:, 2 * omega.size :] -= np.diag(decay)
        return np.vstack([np.hstack([zero, np.diag(omega), row]), speeds, warming])


def in_contact(structure: Structure) -> InContact:
    """Return the system of a structure in contact; of one without matrices that of its lowest modes of both kinds.

    Friction excites rigid modes of the interior too: they are kept where there is a sliding direction.
    """
    pair, few = structure.mechanical, None if structure.has_matrices else _STRONGEST
    held, thermal = pair.modes(few, held=True), structure.thermal.modes(few)
    kept = (held.values > 0) | (structure.tangent is not None)
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
        slid=None if structure.tangent is None else np.column_stack([shapes, constraint]).T @ structure.tangent,
    )


def growth(contact: InContact, alpha: float, friction: float = 0.0) -> Growth:
    """Return the largest real part of the eigenvalues of a structure in permanent contact, 1/s; stable where negative.

    Where damping or friction couples the modes no eigenvalue is refined. NaN where none of a larger structure could be
    refined; flutter of modes that contact heat shifts little may be missed there.
    """
    if contact.damping is not None or (contact.slid is not None and friction != 0):
        values = eigenvalues(contact.matrix(alpha, friction))
        rates = values.real
    else:
        part, others = contact.shifted_modes(alpha)
        values = np.append(eigenvalues(part.matrix(alpha)), contact.poles)
        rates = np.append(_refined(contact, alpha, values[: -contact.poles.size]), others.real)
    rate = float(rates.max(initial=0.0 if contact.has_rigid else -np.inf)) + 0.0
    return Growth(rate if np.isfinite(rate) else np.nan, _UNCERTAIN * float(np.abs(values).max(initial=0.0)))


def _refined(contact: InContact, alpha: float, spectrum: Complex) -> Array:
    """Return the real parts of the rightmost eigenvalues, refined by Newton's method on 1/G(s) = α.

    An eigenvalue from which it comes to a root nearer to another one is kept: contact heat cannot shift it, so it is no
    root. Where it does not converge they are kept if the spectrum is that of all modes, else left out; NaN if none is
    left.
    """
    above = spectrum[spectrum.imag >= 0]
    starts = above[np.argsort(-above.real, kind="stable")[:_REFINED]]
    roots, left = starts.copy(), np.full(starts.size, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            force, slope = contact.contact_force(roots)
            step = force * (alpha * force - 1) / slope
            step[~np.isfinite(step)] = 0.0
            roots, left = roots - step, np.abs(step)
            if np.all(left <= _ROUNDING * np.abs(roots)):
                break
    rounding = _UNCERTAIN * np.abs(spectrum).max(initial=0.0)
    found = left <= np.maximum(_CONVERGED * np.abs(roots), rounding)
    nearest = np.abs(roots[:, None] - spectrum).min(axis=1, initial=np.inf)
    refined = found & (np.abs(roots - starts) <= nearest + rounding)
    known = found | (contact.poles.size <= _ALL_STATES)
    return np.where(refined, roots, starts).real[known] if known.any() or not known.size else np.full(1, np.nan)


def growth_rate(structure: Structure, alpha: float, friction: float = 0.0) -> float:
    """Return the growth rate of a structure at ``alpha``, 1/s, see :func:`growth`."""
    return growth(in_contact(structure), alpha, friction).rate
