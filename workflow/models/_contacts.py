"""Several contacts of a structure, or one without mass: rows of the displacements and temperatures where each acts.

    M x'' + C1 x' + K1 x + K12 θ = f - Σ λ_i (w_i - µ t_i),   C2 θ' + K2 θ = q + Σ α λ_i s_i,
    0 <= d_i - x_i ⊥ λ_i >= 0,
    x_i = w_iᵀx + ρ_i F - Σ_j (R_ij - µ R^t_ij) λ_j - Σ_j r_ij θ_j

with the residual flexibility R of contacts without mass: what the modes lack of the static answer to forces there. On
an elastic casing gaps are d_i + c λ_i - x_i. Contacts without mass or on an elastic casing are compliant: their forces
are finite, and there is no impact law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workflow.kernels import Array


@dataclass(frozen=True, eq=False)
class Contacts:
    """Rows of m contacts.

    Attributes
    ----------
    labels
        Name of each contact, m of them.
    normal, tangent
        w_i, towards the casing, and t_i, in which the casing slides, 0 for none, ``(contact, mechanical)``.
    heat
        s_i with the sum 1 over temperatures, ``(contact, thermal)``; θ_i = s_iᵀθ.
    angle
        ψ_i, rad, ``(contact,)``: contact i sees the casing at Ωt + ψ_i.
    residual, residual_tangent
        R = w ΔF wᵀ and R^t = w ΔF tᵀ, m/N, ``(contact, contact)``; ``None`` for contacts with mass.
    residual_coupling
        r = w ΔF K12, m/K, ``(contact, thermal)``.
    residual_load
        ρ = w ΔF b, m/N, ``(contact,)``.
    casing_flexibility
        c of an elastic casing, m/N; 0 for a rigid one.
    """

    labels: tuple[str, ...]
    normal: Array
    tangent: Array
    heat: Array
    angle: Array
    residual: Array | None = None
    residual_tangent: Array | None = None
    residual_coupling: Array | None = None
    residual_load: Array | None = None
    casing_flexibility: float = 0.0

    @property
    def count(self) -> int:
        """Number of contacts."""
        return len(self.normal)

    @property
    def is_massless(self) -> bool:
        """Whether the contacts have a residual flexibility and no mass."""
        return self.residual is not None

    @property
    def is_compliant(self) -> bool:
        """Whether contact forces are finite: contacts without mass, or on an elastic casing."""
        return self.is_massless or self.casing_flexibility > 0

    def transformed(self, displacements: Any, temperatures: Any) -> Contacts:
        """Return the contacts in coordinates of which these bases, dense or sparse, give the present ones."""
        heat: dict[str, Any] = {"heat": self.heat @ temperatures}
        if self.residual_coupling is not None:
            heat["residual_coupling"] = self.residual_coupling @ temperatures
        return replace(self, normal=self.normal @ displacements, tangent=self.tangent @ displacements, **heat)

    def with_residual(self, **more: Array) -> Contacts:
        """Return the contacts with these residuals added to their own."""
        both: dict[str, Any] = {name: (getattr(self, name), value) for name, value in more.items()}
        return replace(self, **{name: new if own is None else own + new for name, (own, new) in both.items()})

    def flexibility(self, friction: float) -> Array:
        """Return R - µ R^t, m/N, ``(contact, contact)``."""
        if self.residual is None:
            return np.zeros((self.count, self.count))
        if friction == 0 or self.residual_tangent is None:
            return self.residual
        return np.asarray(self.residual - friction * self.residual_tangent)

    def compliance(self, friction: float) -> Array:
        """Return R - µ R^t + c, m/N, ``(contact, contact)``."""
        return self.flexibility(friction) + self.casing_flexibility * np.eye(self.count)
