"""The linear system of a structure with a set of its contacts closed, in modes with all contacts open.

In free modes, y'' + c y' + ω² y + G τ = g - Σ λ_i (w_i - µ t_i), τ' + μ τ = q + α Σ λ_i s_i, with g = φᵀ(f̄ + F b).
With the contacts S closed:

- **with mass** they follow the casing, w_S y = d_S: y = P d_S + Z z with Z an orthonormal basis of the null space of
  w_S, P = w_Sᵀ(w_S w_Sᵀ)⁻¹, and

      λ = D⁻¹ (w_S (g - c y' - ω² y - G τ) - d_S''),   D = w_S (w_S - µ t_S)ᵀ,   z'' = Zᵀ (g - … + µ t_Sᵀ λ);

- **without mass**, or on an elastic casing c, their forces are linear in all modes, which stay,

      λ = Q (w_S y - r_S τ + ρ_S F - d_S),   Q = (R - µ R^t + c)_SS⁻¹.

Static answers with all contacts closed: α_c, growth rate, equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import singular
from workflow.kernels.lemke import complementarity
from workflow.models._cases import Cases, project
from workflow.models._contacts import Contacts
from workflow.models._modes import coupled_damping, mechanical_modes, modal_coupling, thermal_modes
from workflow.models._sparse_pair import SparsePair
from workflow.models._structure import Structure, stays_cold

_RIGID = 1e-13
"""Part of a row, over the whole, up to which it is 0: the rounding of some hundred terms."""


@dataclass(frozen=True, eq=False)
class ContactBasis:
    """A structure with all contacts open, in its modes."""

    contacts: Contacts
    shapes: Array
    """φ, ``(mechanical, mode)``."""
    heat_shapes: Array
    """χ, ``(thermal, thermal mode)``."""
    to_modes: Array
    """φᵀ M."""
    to_thermal: Array
    """χᵀ C2."""
    frequency: Array
    """ω, 1/s, ``(mode,)``."""
    damping: Array
    """c, ``(mode,)``, or ``(mode, mode)`` where damping couples modes."""
    coupling: Array
    """G, ``(mode, thermal mode)``."""
    rate: Array
    """μ, 1/s."""
    normal: Array
    """w, ``(contact, mode)``."""
    tangent: Array
    """t, ``(contact, mode)``."""
    heat: Array
    """s, ``(contact, thermal mode)``."""
    load: Array
    """φᵀ b, ``(mode,)``."""
    sensors: Array
    """Rows of sensors, ``(sensor, mode + thermal mode)``."""

    @property
    def residual_load(self) -> Array:
        """ρ, m/N, ``(contact,)``."""
        return self.contacts.residual_load_or_zero

    @property
    def residual_coupling(self) -> Array:
        """R per thermal mode, m, ``(contact, thermal mode)``."""
        own = self.contacts.residual_coupling
        return np.zeros(self.heat.shape) if own is None else own @ self.heat_shapes

    @property
    def size(self) -> int:
        """Number of states [y, y', τ]."""
        return 2 * self.frequency.size + self.rate.size

    @property
    def inputs(self) -> int:
        """Number of inputs [g, q, F, d, d', d''] of a set."""
        return self.frequency.size + self.rate.size + 1 + 3 * self.contacts.count

    @property
    def unheated(self) -> ContactBasis:
        """The same without thermal modes, where no heat acts."""
        none: dict[str, Any] = {name: getattr(self, name)[:0] for name in ("rate", "to_thermal")}
        for name in ("heat_shapes", "coupling", "heat"):
            none[name] = getattr(self, name)[:, :0]
        none["sensors"] = self.sensors[:, : self.frequency.size]
        return replace(self, **none)

    def flexibility(self, friction: float) -> Array:
        """Return w_iᵀ K1⁻¹ (w_j - µ t_j) + R_ij - µ R^t_ij + c δ_ij over elastic modes, m/N, ``(contact, contact)``."""
        elastic = self.frequency > 0
        sliding = (self.normal - friction * self.tangent)[:, elastic]
        answers = self.normal[:, elastic] / self.frequency[elastic] ** 2
        return np.asarray(answers @ sliding.T + self.contacts.compliance(friction))

    def delassus(self, friction: float) -> Array:
        """Return w_i (w_j - µ t_j)ᵀ, 1/kg, ``(contact, contact)``."""
        return np.asarray(self.normal @ (self.normal - friction * self.tangent).T)


def analyse_contacts(structure: Structure) -> ContactBasis:
    """Return the modes of a structure with contacts, and their rows in modes."""
    contacts = structure.contacts
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    return ContactBasis(
        contacts=contacts,
        shapes=mechanical.shapes,
        heat_shapes=thermal.shapes,
        to_modes=mechanical.shapes.T @ structure.mass,
        to_thermal=thermal.shapes.T @ structure.heat_capacity,
        frequency=mechanical.values,
        damping=coupled_damping(structure, mechanical),
        coupling=modal_coupling(structure, mechanical, thermal),
        rate=thermal.values,
        normal=contacts.normal @ mechanical.shapes,
        tangent=contacts.tangent @ mechanical.shapes,
        heat=contacts.heat @ thermal.shapes,
        load=mechanical.shapes.T @ structure.load_direction,
        sensors=structure.sensed(mechanical.shapes, thermal.shapes),
    )


class ContactSystem(NamedTuple):
    """X_S' = A X_S + B w, signals = rows X_S + inputs w, X_S = [z, z', τ] with y = Z z + Pᵀ d."""

    A: Array
    B: Array
    signals: Array
    inputs: Array
    null: Array
    """Z, ``(mode, constrained mode)``."""
    place: Array
    """P, ``(contact, mode)``; 0 for open contacts."""


def contact_system(
    basis: ContactBasis, closed: NDArray[np.bool_], alpha: float, friction: float
) -> ContactSystem | None:
    """Return the system with the contacts ``closed``, ``(contact,)``; ``None`` where their forces are not unique."""
    build = _compliant if basis.contacts.is_compliant else _with_mass
    return build(basis, np.flatnonzero(closed), alpha, friction)


def _turned(basis: ContactBasis, S: Any) -> tuple[Array, int]:
    """Return the modes, ``(mode, mode)``, and how many come first: rigid motions that do not move the contacts S.

    Rigid ones are turned, and have exact zeros in other modes, so that no force depends on the place of the first.
    """
    rigid, rows = basis.frequency == 0, basis.normal[S]
    if not rigid.any():
        return np.eye(rigid.size), 0
    seen, turn = singular(rows[:, rigid] / np.linalg.norm(rows, axis=1, keepdims=True))
    each = np.eye(rigid.size)
    return np.hstack([each[:, rigid] @ turn[:, ::-1], each[:, ~rigid]]), int(np.sum(seen <= _RIGID))


def _constrained(basis: ContactBasis, S: Any) -> tuple[Array, Array]:
    """Return Z, the modes of the structure with the contacts S held, and their ω²; rigid motions that stay come first.

    They are singular values of diag(ω) Z: eigenvalues of Zᵀ diag(ω²) Z would lose the digits of low modes.
    """
    if S.size == 0:
        return np.eye(basis.frequency.size), basis.frequency**2
    modes, still = _turned(basis, S)
    seen, shapes = singular(basis.normal[S] @ modes[:, still:], graded=False)
    null = modes[:, still:] @ shapes[:, seen <= _RIGID * seen.max(initial=0.0)]
    values, vectors = singular(basis.frequency[:, None] * null, graded=False)
    return np.hstack([modes[:, :still], null @ vectors[:, ::-1]]), np.append(np.zeros(still), values[::-1] ** 2)


def _without_rounding(matrix: Array) -> Array:
    """Return a matrix that is diagonal but for rounding as a diagonal one: Rayleigh's damping of constrained modes."""
    diagonal = np.diag(np.diag(matrix))
    is_rounding = np.abs(matrix - diagonal).max(initial=0.0) <= _RIGID * np.abs(diagonal).max(initial=0.0)
    return diagonal if is_rounding else matrix


def _with_mass(basis: ContactBasis, S: Any, alpha: float, friction: float) -> ContactSystem | None:
    W, T = basis.normal[S], basis.tangent[S]
    n, heats, m = basis.frequency.size, basis.rate.size, basis.contacts.count
    null, squares = _constrained(basis, S)
    modes = null.shape[1]
    try:
        inverse_delassus = np.linalg.inv(W @ (W - friction * T).T)
        lift = W.T @ np.linalg.inv(W @ W.T)  # P
    except np.linalg.LinAlgError:
        return None
    C = basis.damping if basis.damping.ndim == 2 else np.diag(basis.damping)
    K = basis.frequency**2
    z, u, tau = slice(0, modes), slice(modes, 2 * modes), slice(2 * modes, 2 * modes + heats)
    size = 2 * modes + heats
    moved = np.zeros((n, size))  # g-free acceleration per [z, z', τ]
    moved[:, z], moved[:, u], moved[:, tau] = -K[:, None] * null, -C @ null, -basis.coupling
    given = np.zeros((n, basis.inputs))  # … per input
    F = n + heats
    d, rate, bend = (F + 1 + k * m + S for k in range(3))
    given[:, :n], given[:, F] = np.eye(n), basis.load
    given[:, d], given[:, rate] = -K[:, None] * lift, -C @ lift
    force, force_inputs = inverse_delassus @ W @ moved, inverse_delassus @ W @ given
    force_inputs[:, bend] -= inverse_delassus
    A, B = np.zeros((size, size)), np.zeros((size, given.shape[1]))
    A[z, u] = np.eye(modes)
    slides = friction * (null.T @ T.T)
    A[u] = null.T @ moved
    A[u, z], A[u, u] = -np.diag(squares), _without_rounding(A[u, u])
    A[u] += slides @ force
    B[u] = null.T @ given + slides @ force_inputs
    A[tau, tau] = -np.diag(basis.rate)
    B[tau, n : n + heats] = np.eye(heats)
    A[tau] += alpha * basis.heat[S].T @ force
    B[tau] += alpha * basis.heat[S].T @ force_inputs
    signals, inputs = np.zeros((m, size)), np.zeros((m, given.shape[1]))
    signals[S], inputs[S] = force, force_inputs
    others = np.delete(np.arange(m), S)
    signals[others, z] = -basis.normal[others] @ null
    inputs[others, F + 1 + others] = 1.0
    inputs[others[:, None], d] = -basis.normal[others] @ lift
    place = np.zeros((m, n))
    place[S] = lift.T
    return ContactSystem(A, B, signals, inputs, null, place)


def _compliant(basis: ContactBasis, S: Any, alpha: float, friction: float) -> ContactSystem | None:
    n, heats, m = basis.frequency.size, basis.rate.size, basis.contacts.count
    flexibility = basis.contacts.flexibility(friction)
    try:
        stiffness = np.linalg.inv(basis.contacts.compliance(friction)[np.ix_(S, S)])  # Q
    except np.linalg.LinAlgError:
        return None
    size, F = basis.size, n + heats
    z, u, tau = slice(0, n), slice(n, 2 * n), slice(2 * n, size)
    modes, still = _turned(basis, S)
    normal = basis.normal @ modes
    normal[S, :still] = 0.0
    place, place_inputs = np.zeros((m, size)), np.zeros((m, basis.inputs))  # x_i without forces
    place[:, z], place[:, tau] = normal, -basis.residual_coupling
    place_inputs[:, F] = basis.residual_load
    depth_inputs = place_inputs.copy()
    depth_inputs[:, F + 1 : F + 1 + m] -= np.eye(m)
    force, force_inputs = stiffness @ place[S], stiffness @ depth_inputs[S]
    push = -modes.T @ (basis.normal[S] - friction * basis.tangent[S]).T
    A, B = np.zeros((size, size)), np.zeros((size, basis.inputs))
    A[z, u] = np.eye(n)
    A[u, z] = -np.diag((basis.frequency @ modes) ** 2)
    C = basis.damping if basis.damping.ndim == 2 else np.diag(basis.damping)
    A[u, u] = -_without_rounding(modes.T @ C @ modes)
    A[u, tau] = -modes.T @ basis.coupling
    A[tau, tau] = -np.diag(basis.rate)
    B[u, :n], B[u, F], B[tau, n : n + heats] = modes.T, modes.T @ basis.load, np.eye(heats)
    A[u] += push @ force
    B[u] += push @ force_inputs
    A[tau] += alpha * basis.heat[S].T @ force
    B[tau] += alpha * basis.heat[S].T @ force_inputs
    signals, inputs = -place, -depth_inputs
    signals += flexibility[:, S] @ force
    inputs += flexibility[:, S] @ force_inputs
    signals[S], inputs[S] = force, force_inputs
    return ContactSystem(A, B, signals, inputs, modes, np.zeros((m, n)))


_REAL = 1e-9
"""Imaginary part of an eigenvalue, over it, up to which it is the rounding of a real one."""


def stops_together(contacts: Contacts) -> list[NDArray[np.bool_]]:
    """Return the largest sets of contacts that can be closed at once: all, or one of each pair of opposite stops."""
    pairs, sets = [pair[:2] for pair in contacts.opposite], []
    for left in product(*pairs):
        closed = np.ones(contacts.count, dtype=np.bool_)
        closed[list(left)] = False
        sets.append(closed)
    return sets


def closed_sets(contacts: Contacts) -> dict[tuple[str, ...], NDArray[np.intp]]:
    """Return the sets of contacts that are judged, by their labels: each contact alone, all that can close together."""
    every = [np.flatnonzero(closed) for closed in stops_together(contacts)]
    sets = [*np.arange(contacts.count)[:, None], *(some for some in every if some.size > 1)]
    return {tuple(contacts.labels[k] for k in closed): closed for closed in sets}


def set_text(labels: tuple[str, ...]) -> str:
    """Return a set of closed contacts in words: `LE alone`, `LE, TE together`; empty for no contact."""
    return "" if not labels else f"{', '.join(labels)} {'alone' if len(labels) == 1 else 'together'}"


def critical_alphas_of_contacts(structure: Structure, friction: float = 0.0) -> dict[tuple[str, ...], float]:
    """Return the least α > 0 at which the static problem of each closed set is singular, W/N, by :func:`closed_sets`.

    det(S - α B) = 0 with S_ij = w_iᵀ K1⁻¹ (w_j - µ t_j) + R_ij - µ R^t_ij + c δ_ij and
    B_ij = -(w_iᵀ K1⁻¹ K12 + r_i) K2⁻¹ s_j, under forces that balance on rigid motions. ``inf`` for none; 0 where heat
    that cannot leave pushes a contact out, or friction alone makes the set unstable, det S < 0.
    """
    sets = closed_sets(structure.contacts)
    if isinstance(structure.mechanical, SparsePair):
        answers = _static_answers(structure, friction)
        return {labels: _critical_of_held(*(each[np.ix_(k, k)] for each in answers)) for labels, k in sets.items()}
    basis = analyse_contacts(structure)
    return {labels: _critical_alpha(basis, closed, friction) for labels, closed in sets.items()}


def _static_answers(structure: Structure, friction: float) -> tuple[Array, Array, Array]:
    """Return S and B of all contacts of a structure that is held, and B of heat that cannot leave it, its direction."""
    contacts, pair, rigid = structure.contacts, structure.mechanical, structure.thermal.rigid_motions(held=False)
    answers = pair.static_solutions(contacts.normal).T
    warmth = np.hstack([structure.thermal.static_solutions(contacts.heat).T, rigid])
    grown = pair.work(answers, pair.deformation_of(answers), structure.expansions(warmth))
    if contacts.residual_coupling is not None:
        grown -= contacts.residual_coupling @ warmth
    S = answers.T @ (contacts.normal - friction * contacts.tangent).T + contacts.compliance(friction)
    return S, grown[:, : contacts.count], grown[:, contacts.count :] @ (rigid.T @ contacts.heat.T)


def _critical_of_held(S: Array, B: Array, kept: Array) -> float:
    """Return the least root of det(S - α B), 0 where friction alone, or heat that cannot leave, pushes a contact."""
    return 0.0 if np.linalg.slogdet(S)[0] < 0 or np.isfinite(_least_root(S, kept)) else _least_root(S, B)


def _critical_alpha(basis: ContactBasis, closed: NDArray[np.intp], friction: float) -> float:
    elastic, warm = basis.frequency > 0, basis.rate > 0
    normal, sliding = basis.normal[closed], (basis.normal - friction * basis.tangent)[closed]
    flexible = normal[:, elastic] / basis.frequency[elastic] ** 2
    grows = -flexible @ basis.coupling[elastic] - basis.residual_coupling[closed]
    grows[np.abs(grows) <= _RIGID * np.abs(grows).max(initial=0.0)] = 0.0
    heat = basis.heat[closed].T
    kept = grows[:, ~warm] @ heat[~warm]  # growth rate of heat that cannot leave
    kept[np.abs(kept) <= _RIGID * (np.abs(grows) @ np.abs(heat))] = 0.0
    S = basis.flexibility(friction)[np.ix_(closed, closed)]
    B = (grows[:, warm] / basis.rate[warm]) @ heat[warm]
    held, sizes, moved = np.linalg.svd(normal[:, ~elastic])
    rigid = int(np.sum(sizes > _RIGID * np.abs(basis.normal).max(initial=0.0)))  # motions that the set stops
    pushed = sliding[:, ~elastic] @ moved[:rigid].T
    if np.linalg.slogdet(_at_rest(normal[:, ~elastic] @ moved[:rigid].T, pushed, S))[0] * (-1) ** len(S) < 0:
        return 0.0
    left, balanced = held[:, rigid:].T, np.linalg.svd(pushed.T)[2][rigid:].T
    S, B, kept = (left @ matrix @ balanced for matrix in (S, B, kept))
    return 0.0 if np.isfinite(_least_root(S, kept)) else _least_root(S, B)


def _at_rest(normal: Array, sliding: Array, flexibility: Array) -> Array:
    """Return the matrix of the static problem: rigid motions are unknowns before the forces."""
    rigid = normal.shape[1]
    return np.block([[np.zeros((rigid, rigid)), sliding.T], [normal, -flexibility]])


def _least_root(A: Array, B: Array) -> float:
    """Return the least z > 0 with det(A - z B) = 0; ``inf`` for none."""
    values = scipy.linalg.eigvals(B, A)  # 1/z
    values = values[np.isfinite(values)]
    real = values.real[np.abs(values.imag) <= _REAL * np.abs(values)]
    largest = float(real.max(initial=0.0))
    return 1 / largest if largest > _RIGID * np.abs(values).max(initial=0.0) else float("inf")


class CriticalFriction(NamedTuple):
    """Least friction coefficients at which contacts that are closed together are singular; ``inf`` for none."""

    contacts: tuple[str, ...]
    """Their labels."""
    impact: float
    """det w_i M⁻¹ (w_j - µ t_j)ᵀ = 0: no impact law; ``inf`` of contacts without mass, or on an elastic casing."""
    standstill: float
    """det S = 0: no stable rest."""


def critical_friction(structure: Structure) -> list[CriticalFriction]:
    """Return the critical friction coefficients of each contact alone, and of all that can be closed together."""
    contacts, basis = structure.contacts, analyse_contacts(structure)
    rigid, still, found = basis.frequency == 0, basis.flexibility(0.0), []
    aside = still - basis.flexibility(1.0)
    for labels, closed in closed_sets(contacts).items():
        w, t, pairs = basis.normal[closed], basis.tangent[closed], np.ix_(closed, closed)
        impact = np.inf if contacts.is_compliant else _least_root(w @ w.T, w @ t.T)
        pressed = _at_rest(w[:, rigid], w[:, rigid], still[pairs])
        rest = _least_root(pressed, _at_rest(0 * w[:, rigid], t[:, rigid], aside[pairs]))
        found.append(CriticalFriction(labels, impact, rest))
    return found


def poles_in_contact(
    basis: ContactBasis, closed: NDArray[np.intp], alpha: float, friction: float
) -> NDArray[np.complex128] | None:
    """Return all poles with some contacts ``closed`` for good, 1/s; ``None`` where their forces are not unique.

    A temperature that stands for none has none.
    """
    basis = basis.unheated if stays_cold(basis.heat) else basis
    is_closed = np.isin(np.arange(basis.contacts.count), closed)
    system = contact_system(basis if alpha > 0 else basis.unheated, is_closed, alpha, friction)
    if system is None:
        return None
    poles = np.linalg.eigvals(system.A).astype(np.complex128)
    return poles if alpha > 0 else np.append(poles, -basis.rate)


def contacts_at_rest(structure: Structure, cases: Cases) -> Cases | None:
    """Return cases that start in equilibrium under their constant loads and the gaps at t = 0.

    0 <= d - w x + (R - µ R^t + c) λ ⊥ λ >= 0; a contact that is pressed has the velocity of its casing. ``None`` where
    a case has none: loads move a structure that is not held, or heat cannot leave it.
    """
    basis, contacts = analyse_contacts(structure), structure.contacts
    if np.any(basis.frequency == 0):
        return None
    force = project(basis.shapes.T, cases.steady) + cases.mean[:, None] * basis.load
    heat = project(basis.heat_shapes.T, cases.heating)
    if np.any(heat[:, basis.rate == 0] != 0):
        return None
    tau = np.divide(heat, basis.rate, out=np.zeros_like(heat), where=basis.rate > 0)
    free = (force - project(basis.coupling, tau)) / basis.frequency**2
    place, speed = cases.casing_of_contacts(0.0)
    y, velocity = free.copy(), np.zeros_like(free)
    for i in range(cases.count):
        sliding = basis.normal - cases.friction[i] * basis.tangent
        depth = (
            basis.normal @ free[i] - basis.residual_coupling @ tau[i] + basis.residual_load * cases.mean[i] - place[i]
        )
        pressed = complementarity(basis.flexibility(float(cases.friction[i])), -depth)
        if pressed is None:
            return None
        y[i] -= (pressed @ sliding) / basis.frequency**2
        if not contacts.is_compliant:
            velocity[i] = np.linalg.pinv(basis.normal[pressed > 0]) @ speed[i, pressed > 0]
    return replace(
        cases,
        displacement=project(basis.shapes, y),
        velocity=project(basis.shapes, velocity),
        temperature=project(basis.heat_shapes, tau),
    )
