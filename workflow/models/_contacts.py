"""Contacts of a structure: rows of the displacements and temperatures where each acts.

    M x'' + C1 x' + K1 x + K12 θ = f - Σ λ_i (w_i - µ t_i),   C2 θ' + K2 θ = q + Σ α λ_i s_i,
    0 <= d_i - x_i ⊥ λ_i >= 0,
    x_i = w_iᵀx + ρ_i F + x̄_i - Σ_j (R_ij - µ R^t_ij) λ_j - Σ_j r_ij θ_j

with the residual flexibility R of contacts without mass: what the modes lack of the static answer to forces there. On
an elastic casing gaps are d_i + c λ_i - x_i. Contacts without mass or on an elastic casing are compliant: their forces
are finite, and there is no impact law.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.models._pair import UnusableMatricesError

MOST_CONTACTS = 64
"""Largest number of contacts of a structure."""

_PARALLEL = 1e-10
"""1 - |cosine| of the angle between rows up to which they are parallel, and asymmetry of R over its largest entry."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Rows of m contacts."""

    labels: tuple[str, ...]
    """Name of each contact, m of them."""
    normal: Array
    tangent: Array
    """``normal``, ``tangent``: w_i, towards the casing, and t_i, in which the casing slides, 0 for none, ``(contact,
    mechanical)``."""
    heat: Array
    """s_i with the sum 1 over temperatures, ``(contact, thermal)``; θ_i = s_iᵀθ."""
    angle: Array
    """ψ_i, rad, ``(contact,)``: contact i sees the casing at Ωt + ψ_i."""
    observed: Array | None = None
    """Weights of the temperature that schemes record at a contact, ``(contact, thermal)``; ``None`` for s_i."""
    growth: Array | None = None
    """Static growth per temperature, m/K, ``(contact, thermal)``, where it is known from the full structure: of a body
    that moves freely it depends on the masses of the modes that a basis omits."""
    growth_at_once: Array | float = 0.0
    """Static growth by heat loads on temperatures without heat capacity, m, ``(contact,)``."""
    residual: Array | None = None
    """R = w ΔF wᵀ, m/N, ``(contact, contact)``; ``None`` for contacts with mass."""
    residual_tangent: Array = field(default_factory=lambda: np.zeros(0))
    """R^t = w ΔF tᵀ, m/N, ``(contact, contact)``; 0 by default."""
    residual_coupling: Array = field(default_factory=lambda: np.zeros(0))
    """r = w ΔF K12, m/K, ``(contact, thermal)``; 0 by default."""
    residual_load: Array = field(default_factory=lambda: np.zeros(0))
    """ρ = w ΔF b, m/N, ``(contact,)``; 0 by default."""
    residual_steady: Array | None = None
    """x̄ = w ΔF f̄, m, ``(contact,)``: the residual's answer to the constant loads of the file."""
    casing_flexibility: float = 0.0
    """c of an elastic casing, m/N; 0 for a rigid one."""

    def __post_init__(self) -> None:
        """Fill the residuals that are left out."""
        shapes = {"tangent": (self.count, self.count), "coupling": self.heat.shape, "load": (self.count,)}
        for name, shape in shapes.items():
            if not getattr(self, f"residual_{name}").size:
                object.__setattr__(self, f"residual_{name}", np.zeros(shape))

    @property
    def count(self) -> int:
        """Number of contacts."""
        return len(self.normal)

    @property
    def is_one_with_mass(self) -> bool:
        """Whether there is one contact, with mass, on a rigid casing."""
        return self.count == 1 and not self.is_compliant

    @property
    def recorded(self) -> Array:
        """Weights of the temperature that is recorded at each contact, ``(contact, thermal)``."""
        return self.heat if self.observed is None else self.observed

    @property
    def slides(self) -> bool:
        """Whether a casing slides along some direction in which friction acts."""
        return bool(self.tangent.any())

    @property
    def is_massless(self) -> bool:
        """Whether the contacts have a residual flexibility and no mass."""
        return self.residual is not None

    @property
    def is_compliant(self) -> bool:
        """Whether contact forces are finite: contacts without mass, or on an elastic casing."""
        return self.is_massless or self.casing_flexibility > 0

    @property
    def opposite(self) -> list[tuple[int, int, float]]:
        """Pairs i < j of stops with w_j = -c w_i, of contacts without mass x_j = -c x_i under all forces, and c.

        A contact is in one pair at most.
        """
        products = self.normal @ self.normal.T if self.residual is None else self.residual
        sizes = np.sqrt(np.diag(products))
        cosines = products / np.multiply.outer(sizes, sizes)
        pairs: list[tuple[int, int, float]] = []
        for j, i in np.argwhere(np.tril(cosines < _PARALLEL - 1)).tolist():
            if not any({i, j} & {*pair[:2]} for pair in pairs):
                pairs.append((i, j, float(sizes[j] / sizes[i])))
        return pairs

    def transformed(self, displacements: Any, temperatures: Any) -> Contacts:
        """Return the contacts in coordinates of which these bases, dense or sparse, give the present ones."""
        own: dict[str, Any] = {
            name: getattr(self, name) for name in ("heat", "observed", "growth", "residual_coupling")
        }
        warm: dict[str, Any] = {name: rows if rows is None else rows @ temperatures for name, rows in own.items()}
        return replace(self, normal=self.normal @ displacements, tangent=self.tangent @ displacements, **warm)

    def flexibility(self, friction: float) -> Array:
        """Return R - µ R^t, m/N, ``(contact, contact)``."""
        return np.asarray((0.0 if self.residual is None else self.residual) - friction * self.residual_tangent)

    def compliance(self, friction: float) -> Array:
        """Return R - µ R^t + c, m/N, ``(contact, contact)``."""
        return self.flexibility(friction) + self.casing_flexibility * np.eye(self.count)


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


def the_tip(displacements: int, temperatures: int) -> Contacts:
    """Return the one contact of a structure of so many coordinates, the last of them; its casing slides nowhere."""
    normal, heat = np.eye(1, displacements, displacements - 1), np.eye(1, temperatures, temperatures - 1)
    return Contacts(("tip",), normal, np.zeros_like(normal), heat, np.zeros(1))


def checked_contacts(contacts: Contacts, residual: str = "residual_flexibility") -> Contacts:
    """Return the contacts of a file, of which each can act, R symmetric; messages call it ``residual``.

    Raises
    ------
    UnusableMatricesError
        They are too many, depend on each other, slide along their own direction, or have a residual that is none.
    """
    count, labels = contacts.count, contacts.labels
    if count > MOST_CONTACTS:
        raise UnusableMatricesError(f"it has {count} contacts", f"choose up to {MOST_CONTACTS} of them")
    for label, w, t in zip(labels, contacts.normal, contacts.tangent, strict=True):
        of = f" of contact {label}" if count > 1 else ""
        if not np.any(w):
            raise UnusableMatricesError(f"`contact`{of} is zero everywhere", "write what it acts on")
        size = np.linalg.norm(w) * np.linalg.norm(t)
        if size > 0 and abs(w @ t) > (1 - _PARALLEL) * size:
            problem = f"`tangent`{of} is parallel to the contact's direction"
            raise UnusableMatricesError(problem, "write the direction in which the casing slides")
    if contacts.residual is None:
        _refuse_dependent(contacts, residual)
        return contacts
    symmetric = (contacts.residual + contacts.residual.T) / 2
    apart = np.abs(contacts.residual - contacts.residual.T).max()
    if apart > _PARALLEL * np.abs(symmetric).max() or np.linalg.eigvalsh(symmetric).min() <= 0:
        remedy = "write w ΔF wᵀ, the static flexibility less that of the modes that are given"
        raise UnusableMatricesError(f"`{residual}` is not symmetric and positive definite", remedy)
    return replace(contacts, residual=symmetric)


def _refuse_dependent(contacts: Contacts, residual: str) -> None:
    """Refuse contacts with mass whose rows depend on each other; of two opposite stops one counts."""
    which = np.delete(np.arange(contacts.count), [j for _, j, _ in contacts.opposite])
    rows = contacts.normal[which]
    left, singular, _ = np.linalg.svd(rows / np.linalg.norm(rows, axis=1)[:, None], full_matrices=False)
    if len(rows) > rows.shape[1] or singular.min() <= _PARALLEL * singular.max():
        those = [contacts.labels[k] for k, share in zip(which, left[:, -1], strict=True) if abs(share) > _PARALLEL]
        remedy = f"leave one out, or write `{residual}`, with which contacts have no mass"
        raise UnusableMatricesError(f"contacts {', '.join(those)} depend on each other", remedy)
