"""MacNeal: modes with the contacts free and the residual flexibility of the contacts, whose inertia is neglected.

Mechanical: x = Σ φ_j η_j - Σ ΔF (w_i - µ t_i) λ_i + … with the lowest modes of the whole structure, K1 φ = ω² M φ, and
the residual flexibility ΔF = K1⁻¹ - Σ φ_j φ_jᵀ/ω_j² over the modes kept. The contacts have no mass then, and no impacts
(:class:`~workflow.models.Contacts`); modes alone have inertia and damping. A rigid motion of the structure is among the
modes, and its forces are balanced by inertia. Where the modes kept contain all of a contact's flexibility (a free mass
as tip, for instance), or lack a rigid motion, there is no residual, and the basis is :mod:`~workflow.reduction.rubin`,
of several contacts craig_bampton. Contacts without mass of a file keep their residual flexibility and are given that of
the modes left out. Thermal: as craig_bampton. α_c is exact.

Source: MacNeal, Computers & Structures 1 (1971) 581-601; Craig and Kurdila, Fundamentals of structural dynamics
(2006), 17.6.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Structure
from workflow.reduction import craig_bampton, rubin
from workflow.reduction._reduction import DEPENDENT, Orthonormal, Vectors
from workflow.reduction.craig_bampton import thermal

__all__ = ["CONTACTS", "mechanical", "thermal"]

CONTACTS = frozenset({"massless", "several"})


def mechanical(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the lowest ``count`` free modes, and ΔF w_i of the contacts."""
    pair, contacts = structure.mechanical, structure.contacts
    with_mass = rubin.mechanical if pair.boundary == 1 else craig_bampton.mechanical
    rigid = pair.rigid_motions(held=False)
    if rigid.shape[1] > count:
        return with_mass(structure, count, duration)
    span = Orthonormal(pair.size, count, pair.inertia_of)
    span.add_each(rigid)
    span.add_each(pair.modes(count).shapes)
    modes, static = span.all(), np.column_stack([pair.solve(normal) for normal in contacts.normal])
    residual = np.column_stack([span.apart(response) for response in static.T])
    left, whole = (np.sum(contacts.normal.T * each, axis=0) for each in (residual, static))
    if not contacts.is_massless and np.any(left <= DEPENDENT * whole):
        return with_mass(structure, count, duration)
    deformation = pair.deformation_of(modes)
    deformation[:, : rigid.shape[1]] = 0.0
    return Vectors(modes, deformation, pair.inertia_of(modes).T, residual)
