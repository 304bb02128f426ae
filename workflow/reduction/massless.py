"""Massless: Craig–Bampton with the inertia of the contacts redistributed to the modes, so that they have none.

Mechanical: x = Φ η + Ψ̃ x_c with the fixed-interface modes Φ and, instead of the constraint modes Ψ,

    Ψ̃ = Ψ - Φ Φᵀ M Ψ,   that is Ψ - Φ Φᵀ (M_ib + M_ii Ψ) in the interior (i) and 1 at the contacts (b).

With Φ they span the same space, and they are orthogonal to Φ in M. The inertia of Ψ̃, which falls as modes are added, is
neglected, and x_c follows the forces statically: with K_cc = Ψ̃ᵀ K1 Ψ̃

    x = (Φ - Ψ̃ K_cc⁻¹ Ψ̃ᵀ K1 Φ) η + ΔF f,   ΔF = Ψ̃ K_cc⁻¹ Ψ̃ᵀ.

Contacts have no impacts then (:class:`~workflow.models.Contacts`). Contacts of which one moves freely with inertia that
no mode contains keep their mass, as with craig_bampton. Thermal: as craig_bampton. α_c is exact: S and K2⁻¹ e_n need
the constraint modes only.

Source: Monjaraz Tec, Gross, Krack, arXiv 2111.07693.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Structure
from workflow.models._pair import symmetric
from workflow.reduction._reduction import Vectors, fixed_interface_modes, mechanical_vectors
from workflow.reduction.craig_bampton import thermal

__all__ = ["CONTACTS", "mechanical", "thermal"]

CONTACTS = frozenset({"several"})

_FREE = 1e-13
"""Stiffness of a contact, over that with all else held, or deformation in a vector, over that of its mode, up to which
it is the rounding of zero."""


def mechanical(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the lowest ``count`` fixed-interface modes with x_c condensed, and ΔF w_i of the contacts."""
    pair, modes = structure.mechanical, fixed_interface_modes(structure, count)
    held, size, deformation = pair.boundary, pair.size, pair.deformation_of(modes)
    share = modes.T @ pair.inertia_of(pair.constraint)
    tip, strain = pair.constraint - modes @ share, pair.deformed - deformation @ share
    forces = pair.forces(strain)
    stiffness = symmetric(tip.T @ forces)
    alone = np.sqrt([pair.energies(unit).sum() or 1.0 for unit in np.eye(held, size, size - held)])
    if np.linalg.eigvalsh(stiffness / alone / alone[:, None])[0] <= _FREE:
        return mechanical_vectors(structure, modes)
    follows = -np.linalg.solve(stiffness, forces.T @ modes)
    condensed, rows = deformation + strain @ follows, structure.contacts.normal[:, -held:]
    own, left = (np.linalg.norm(np.sqrt(pair.weights) * each.T, axis=1) for each in (deformation, condensed))
    condensed[:, left <= _FREE * own] = 0.0
    residual = np.linalg.solve(stiffness, tip.T).T @ rows.T
    return Vectors(modes + tip @ follows, condensed, pair.inertia_of(modes).T, residual)
