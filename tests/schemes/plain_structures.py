"""Structures by their matrices, in whatever coordinates these come, brought to equations (1a) and (1b) in 80 bits.

They share nothing with the package's models but the names of what a structure has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from plain_events import Long, inverse

from workflow.models import Array, Cases, Rayleigh


@dataclass(frozen=True)
class Plain:
    """M, C1, K1, K12, C2, K2; x_n = wᵀx and θ_n = sᵀθ touch, the load acts along b, modes have a damping ratio."""

    mass: Array
    damping_matrix: Array
    stiffness_matrix: Array
    coupling_matrix: Array
    heat_capacity: Array
    conductance_matrix: Array
    contact: Array
    thermal_contact: Array
    load_direction: Array
    ratio: float = 0.0
    tangent: None = None

    @property
    def mechanical_size(self) -> int:
        return len(self.mass)

    @property
    def thermal_size(self) -> int:
        return len(self.heat_capacity)

    def rounded(self) -> Plain:
        """Return it in 64 bits."""
        return replace(self, **{name: a.astype(float) for name, a in vars(self).items() if isinstance(a, np.ndarray)})


def plain_chain(lumps: dict[str, Any], damping: Rayleigh) -> Plain:
    """Return a chain of springs N_i = k_i (x_i - x_{i-1} - a ℓ_i (θ_{i-1} + θ_i)/2)."""
    n = lumps["nodes"]
    one, below = np.eye(n, dtype=Long), np.eye(n, k=-1, dtype=Long)
    names = "mass", "stiffness", "expansion", "heat_capacity", "conductance", "convection"
    m, k, a, c, kappa, b = (np.broadcast_to(np.array(lumps.get(name, 0.0), dtype=Long), n) * one for name in names)
    mass, stiffness = m, (one - below).T @ k @ (one - below)
    return Plain(
        mass=mass,
        damping_matrix=damping.mass * mass + damping.stiffness * stiffness,
        stiffness_matrix=stiffness,
        coupling_matrix=-(one - below).T @ k @ (a * lumps.get("spacing", 0.0)) @ (one + below) / 2,
        heat_capacity=c,
        conductance_matrix=(one - below).T @ kappa @ (one - below) + b,
        contact=one[-1],
        thermal_contact=one[-1],
        load_direction=one[-1],
        ratio=damping.ratio,
    )


def tip_last(p: Plain, batch: Cases) -> tuple[Plain, Cases]:
    """Return a structure and its cases in coordinates with inertia whose last is the tip.

    With displacements E y + N z, M N = 0, z follows at rest: NᵀK1 N z = Nᵀ(f - K1 E y - K12 θ), θ alike.
    """
    E, onto, _ = _inertial(p.mass, p.stiffness_matrix, p.contact)
    E_heat, onto_heat, follows = _inertial(p.heat_capacity, p.conductance_matrix, p.thermal_contact)
    mass, stiffness = E.T @ p.mass @ E, E.T @ p.stiffness_matrix @ E
    damping = E.T @ p.damping_matrix @ E
    if p.ratio:  # C1 = Σ 2 ζ ω (M φ)(M φ)ᵀ
        values, shapes = scipy.linalg.eigh(stiffness.astype(float), mass.astype(float))
        moved = mass @ shapes * np.sqrt(np.where(values > 1e-9 * values[-1], values, 0.0)) ** 0.5
        damping = damping + 2 * p.ratio * moved @ moved.T
    structure = Plain(
        mass=mass,
        damping_matrix=damping,
        stiffness_matrix=stiffness,
        coupling_matrix=E.T @ p.coupling_matrix @ E_heat,
        heat_capacity=E_heat.T @ p.heat_capacity @ E_heat,
        conductance_matrix=E_heat.T @ p.conductance_matrix @ E_heat,
        contact=np.eye(len(mass))[-1],
        thermal_contact=np.eye(E_heat.shape[1])[-1],
        load_direction=E.T @ p.load_direction,
    )
    steady = batch.steady - batch.heating @ (p.coupling_matrix @ follows).T
    return structure, replace(
        batch,
        steady=(steady @ E).astype(float),
        heating=(batch.heating @ E_heat).astype(float),
        displacement=(batch.displacement @ onto.T).astype(float),
        velocity=(batch.velocity @ onto.T).astype(float),
        temperature=(batch.temperature @ onto_heat.T).astype(float),
    )


def _inertial(inertia: Array, stiffness: Array, contact: Array) -> tuple[Array, Array, Array]:
    """Return E, the y of an x, and N (NᵀK N)⁻¹ Nᵀ, by which motions without inertia follow forces."""
    values, vectors = np.linalg.eigh(inertia.astype(float))
    loose = values < 1e-12 * values[-1]
    with_inertia, null = vectors[:, ~loose].astype(Long), vectors[:, loose].astype(Long)
    tip = (contact @ with_inertia)[None]
    to_own = np.vstack([scipy.linalg.null_space(tip.astype(float)).T, tip]).astype(Long)
    E, follows = with_inertia @ inverse(to_own), np.zeros_like(inertia)
    if loose.any():
        follows = null @ inverse(null.T @ stiffness @ null) @ null.T
    return E - follows @ stiffness @ E, to_own @ with_inertia.T, follows
