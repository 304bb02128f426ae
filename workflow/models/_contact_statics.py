"""Static answers of a structure with several contacts, or contacts without mass: α_c, growth rate, equilibrium."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.lemke import complementarity
from workflow.models._cases import Cases, distinct_rows, project
from workflow.models._contact_system import ContactBasis, analyse_contacts, contact_system
from workflow.models._structure import Structure

_OPPOSITE = 1e-10
"""Sine of the angle between the rows of two stops below which they are opposite."""

_REAL = 1e-9
"""Imaginary part of an eigenvalue, over it, up to which it is the rounding of a real one."""


def stops_together(basis: ContactBasis) -> list[NDArray[np.bool_]]:
    """Return the largest sets of contacts that can be closed at once: all, or one of each pair of opposite stops."""
    unit = basis.normal / np.linalg.norm(basis.normal, axis=1)[:, None]
    pairs = np.argwhere(np.triu(unit @ unit.T < _OPPOSITE - 1))
    sets = []
    for left in product(*pairs.tolist()) if not basis.contacts.is_massless else [()]:
        closed = np.ones(basis.contacts.count, dtype=np.bool_)
        closed[list(left)] = False
        sets.append(closed)
    return sets


def critical_alpha_of_contacts(structure: Structure, friction: float = 0.0) -> float:
    """Return the least α > 0 at which the static problem with all contacts closed is singular, W/N.

    det(S - α B) = 0 with S_ij = w_iᵀ K1⁻¹ (w_j - µ t_j) + R_ij - µ R^t_ij and B_ij = -(w_iᵀ K1⁻¹ K12 + r_i) K2⁻¹ s_j.
    Rigid motions are unknowns beside the forces. ``inf`` for none, 0 where heat that cannot leave pushes a contact out.
    """
    basis = analyse_contacts(structure)
    return min(_critical_alpha(basis, closed, friction) for closed in stops_together(basis))


def _critical_alpha(basis: ContactBasis, closed: NDArray[np.bool_], friction: float) -> float:
    elastic, warm = basis.frequency > 0, basis.rate > 0
    normal, sliding = basis.normal[closed], (basis.normal - friction * basis.tangent)[closed]
    flexible = normal[:, elastic] / basis.frequency[elastic] ** 2
    grows = -flexible @ basis.coupling[elastic] - basis.residual_coupling[closed]
    if np.any(np.abs(grows[:, ~warm] @ basis.heat[closed][:, ~warm].T) > 0):
        return 0.0
    S = flexible @ sliding[:, elastic].T
    if basis.contacts.is_massless:
        S = S + basis.contacts.flexibility(friction)[np.ix_(closed, closed)]
    B = (grows[:, warm] / basis.rate[warm]) @ basis.heat[closed][:, warm].T
    rigid = int((~elastic).sum())
    still, heated = np.zeros((2, rigid + len(S), rigid + len(S)))
    still[:rigid, rigid:], still[rigid:, :rigid] = sliding[:, ~elastic].T, normal[:, ~elastic]
    still[rigid:, rigid:], heated[rigid:, rigid:] = -S, -B
    values = scipy.linalg.eigvals(still, heated)
    values = values[np.isfinite(values)]
    real = values.real[np.abs(values.imag) <= _REAL * np.abs(values)]
    return float(real[real > 0].min(initial=np.inf))


def rates_in_contact(basis: ContactBasis, alpha: Array, friction: Array) -> tuple[Array, Array]:
    """Return the largest real part of the eigenvalues with all contacts closed, and the largest modulus, ``(case,)``.

    1/s; of opposite stops the worst of each alone. NaN where forces are not unique.
    """
    first, which = distinct_rows(alpha[:, None], friction[:, None])
    found = np.full((2, first.size), np.nan)
    for k, i in enumerate(first.tolist()):
        for closed in stops_together(basis):
            system = contact_system(basis, closed, float(alpha[i]), float(friction[i]))
            if system is not None:
                values = np.linalg.eigvals(system.A)
                found[:, k] = np.fmax(found[:, k], [values.real.max(initial=-np.inf), np.abs(values).max(initial=0.0)])
    return found[0, which], found[1, which]


def contacts_at_rest(structure: Structure, cases: Cases) -> Cases | None:
    """Return cases that start in equilibrium under their constant loads and the gaps at t = 0.

    0 <= d - w x + (R - µ R^t) λ ⊥ λ >= 0; a contact that is pressed has the velocity of its casing. ``None`` where a
    case has none: loads move a structure that is not held, or heat cannot leave it.
    """
    basis, contacts = analyse_contacts(structure), structure.contacts
    assert contacts is not None
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
        S = (basis.normal / basis.frequency**2) @ sliding.T
        depth = (
            basis.normal @ free[i] - basis.residual_coupling @ tau[i] + basis.residual_load * cases.mean[i] - place[i]
        )
        if contacts.is_massless:
            S = S + contacts.flexibility(float(cases.friction[i]))
        pressed = complementarity(S, -depth)
        if pressed is None:
            return None
        y[i] -= (pressed @ sliding) / basis.frequency**2
        if not contacts.is_massless:
            velocity[i] = np.linalg.pinv(basis.normal[pressed > 0]) @ speed[i, pressed > 0]
    return replace(
        cases,
        displacement=project(basis.shapes, y),
        velocity=project(basis.shapes, velocity),
        temperature=project(basis.heat_shapes, tau),
    )
