"""Modal coordinates in which one free step of the structure needs no matrix product.

The coupling of equations (1a) and (1b) is one-way, so each thermal mode τ' = -μ τ drags a
mechanical response with it. In the first-order form X = [x, v, θ] that response is an eigenvector:

    x = Σ φ_j η_j + Σ x_l τ_l,   v = Σ φ_j ζ_j - Σ μ_l x_l τ_l,
    (μ² M - μ C1 + K1) x_l = -K12 χ_l,

which leaves the pairs (η_j, ζ_j) and the τ_l uncoupled in any scheme that is a rational function
of the free system, the θ-method among them. Only the tip is watched, so modes are scaled by their
share in the tip and those without one drop out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workflow.models import (
    Array,
    Cases,
    Modes,
    Structure,
    coupled_damping,
    mechanical_modes,
    modal_coupling,
    needs_matrices,
    project,
    thermal_modes,
)

NEAR_RESONANCE = 1e-3
"""A pair of modes stays coupled explicitly where its denominator μ² - μ c + ω² is below this share
of the largest of its terms: the transformation then loses at most three of sixteen digits."""

_LEAST_SHARE = 1e-30
"""Share in the tip's temperature, of the largest, below which a thermal mode is given that share."""


LEAST_SHARE = 1e-14
"""Share of a mode in the tip, of the largest, below which it has none but by the rounding of its shape."""


@dataclass(frozen=True, eq=False)
class Decoupled:
    """A structure in decoupled modal coordinates.

    Attributes
    ----------
    mass, frequency, damping
        1, ω_j [rad/s] and c_j = a_M + a_K ω_j² [1/s], ``(mode,)``. Of a tip without mass the last mode is its static
        deformation: 0, the root of its stiffness [√(N/m)] and a_K times the stiffness.
    tip
        φ_jn, 1/√kg, ``(mode,)``.
    rate, heat_tip
        μ_l [1/s] and χ_ln [1/√(J/K)], ``(thermal mode,)``.
    coupling
        G = φᵀ K12 χ, ``(mode, thermal mode)``.
    response
        φ_j-component of the dragged x_l, ``(mode, thermal mode)``; 0 for pairs near resonance.
    pairs
        Indices (mode, thermal mode) of the pairs near resonance, ``(pair, 2)``; normally none.
    to_modes, to_thermal
        φ⁻¹ = φᵀ M and χ⁻¹ = χᵀ C2, which take states to modal coordinates.
    shapes, heat_shapes
        φ and χ.
    static_growth
        Quasi-static tip displacement -e_nᵀ K1⁻¹ K12 χ_l of each thermal mode, ``(thermal mode,)``.
    along
        φ_jᵀ t of the direction of friction, 1/√kg, ``(mode,)``; ``None`` where there is none.
    damper
        φᵀ C1 φ where damping couples the modes, ``(mode, mode)``; ``damping`` is its diagonal.
    load
        φ_jᵀ b of a load that does not act on the tip, 1/√kg, ``(mode,)``.
    """

    mass: Array
    frequency: Array
    damping: Array
    tip: Array
    rate: Array
    heat_tip: Array
    coupling: Array
    response: Array
    pairs: NDArray[np.int64]
    to_modes: Array
    to_thermal: Array
    shapes: Array
    heat_shapes: Array
    static_growth: Array
    along: Array | None = None
    damper: Array | None = None
    load: Array | None = None

    @property
    def is_coupled(self) -> bool:
        """Whether the modes scaled by the tip do not say it all: they are stepped in blocks."""
        return self.damper is not None or self.load is not None

    @property
    def heat_scale(self) -> Array:
        """χ_ln by which kernels scale thermal modes, so that the tip's temperature is their sum, ``(thermal mode,)``.

        A mode without a share there is scaled by :data:`_LEAST_SHARE` of the largest: nothing beside rounding.
        """
        least = _LEAST_SHARE * np.abs(self.heat_tip).max(initial=0.0)
        return np.where(np.abs(self.heat_tip) > least, self.heat_tip, least)

    @property
    def tip_response(self) -> Array:
        """Tip displacement that each thermal mode drags along, ``(thermal mode,)``."""
        return self.tip @ self.response

    def inertia(self, h: float, theta: float) -> Array:
        """Return m + hθc + h²θ²ω² of each mode, the diagonal of Ŵ of a step of the θ-method."""
        lever = h * theta
        return np.asarray(self.mass + lever * self.damping + lever * lever * self.frequency**2)

    def weight(self, diagonal: Array, share: float) -> Array:
        """Return Ŵ of its diagonal and the share, s, that the damping matrix has in it, ``(mode, mode)``."""
        beside = 0.0 if self.damper is None else share * (self.damper - np.diag(self.damping))
        return np.asarray(np.diag(diagonal) + beside)

    def delassus(self, h: float, theta: float) -> tuple[float, float, float]:
        """Return e_nᵀ Ŵ⁻¹ e_n, e_nᵀ Ŵ⁻¹ hθ K12 T̂⁻¹ e_n and e_nᵀ Ŵ⁻¹ t, the parts of the Delassus operator W, 1/kg."""
        inertia, along = self.inertia(h, theta), np.zeros_like(self.tip) if self.along is None else self.along
        warm = self.heat_tip / (1 + h * theta * self.rate)
        if self.damper is None:
            heat = np.sum(self.tip * h * theta * (self.coupling @ warm) / inertia)
            return np.sum(self.tip**2 / inertia), heat, np.sum(self.tip * along / inertia)
        pulled = h * theta * (self.coupling @ warm)
        yields = np.linalg.solve(self.weight(inertia, h * theta), self.tip)
        return np.dot(yields, self.tip), np.dot(yields, pulled), np.dot(yields, along)

    def without_heat(self) -> Decoupled:
        """Return the same structure without thermal states, for cases where none can act."""
        none = np.zeros((self.frequency.size, 0))
        return replace(
            self,
            rate=np.zeros(0),
            heat_tip=np.zeros(0),
            coupling=none,
            response=none,
            pairs=np.zeros((0, 2), dtype=np.int64),
            to_thermal=np.zeros((0, self.to_thermal.shape[1])),
            heat_shapes=np.zeros((self.to_thermal.shape[1], 0)),
            static_growth=np.zeros(0),
        )


def dragged(coupling: Array, *terms: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return -coupling / (sum of the terms), and the pairs near resonance, which have 0 there.

    The terms are those of the denominator, which a scheme's own steps may alter.
    """
    parts = np.stack(np.broadcast_arrays(*terms))
    denominator = np.sum(parts, 0)
    near = np.abs(denominator) <= NEAR_RESONANCE * np.abs(parts).max(axis=0)
    response = np.zeros_like(coupling)
    response[~near] = -coupling[~near] / denominator[~near]
    return response, np.argwhere(near & (coupling != 0))


def decouple(structure: Structure) -> Decoupled:
    """Return the structure in decoupled modal coordinates."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    coupling = modal_coupling(structure, mechanical, thermal)
    frequency, rate = mechanical.values, thermal.values
    mass = mechanical.inertia
    damper = coupled_damping(structure, mechanical)
    damping = np.diag(damper).copy() if damper.ndim == 2 else damper
    response, pairs = dragged(coupling, rate**2 * mass[:, None], -rate * damping[:, None], frequency[:, None] ** 2)
    return Decoupled(
        mass=mass,
        frequency=frequency,
        damping=damping,
        tip=mechanical.tip,
        rate=rate,
        heat_tip=thermal.tip,
        coupling=coupling,
        response=response,
        pairs=pairs,
        to_modes=_to_modes(structure, mechanical),
        to_thermal=thermal.shapes.T @ structure.heat_capacity,
        shapes=mechanical.shapes,
        heat_shapes=thermal.shapes,
        static_growth=_static_growth(structure, mechanical, thermal, coupling),
        along=None if structure.tangent is None else mechanical.shapes.T @ structure.tangent,
        damper=damper if damper.ndim == 2 else None,
        load=None if structure.load is None else mechanical.shapes.T @ structure.load,
    )


def _to_modes(structure: Structure, modes: Modes) -> Array:
    """Return what takes displacements to modal ones; the static deformation of a tip is what the modes leave of it."""
    projection = modes.shapes.T @ structure.mass
    if modes.has_static:
        projection[-1] = -modes.tip[:-1] @ projection[:-1]
        projection[-1, -1] += 1.0
    return projection


def _static_growth(structure: Structure, mechanical: Modes, thermal: Modes, coupling: Array) -> Array:
    """Return -e_nᵀ K1⁻¹ K12 χ_l; of a reduced structure with a free root that of the structure it was made from.

    There what the growth moves depends on the masses of the modes that were left out.
    """
    elastic = mechanical.values > 0
    if structure.tip_growth is not None and not elastic.all():
        return structure.tip_growth @ thermal.shapes
    weights = mechanical.tip[elastic] / mechanical.values[elastic] ** 2
    return -weights @ coupling[elastic]


def felt_modes(tip: Array) -> NDArray[np.bool_]:
    """Return which modes have a share in the tip, ``(mode,)``."""
    return np.asarray(np.abs(tip) > LEAST_SHARE * np.abs(tip).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Motion:
    """Where the cases of a batch start, split in a known answer to constant loads and the rest.

    The known part of the tip is affine in time: displacement offset + drift · t, velocity drift,
    temperature warmth + warming · t.

    Attributes
    ----------
    position, velocity, heat
        Remaining modal states η_j, ζ_j, τ_l at t = 0, ``(case, mode)``.
    drift, warmth, warming
        Of the known part, ``(case,)``: m/s, K, K/s. Its offset follows from the tip's position.
    settled, warming_modes
        Modal temperatures of the known part, and their rise, ``(case, thermal mode)``.
    closing, closing_rate
        Quasi-static tip growth of the known temperatures, m and m/s, ``(case,)``.
    tip_force
        Constant force at the tip that moves rigid modes as the constant loads do, N, ``(case,)``.
    """

    position: Array
    velocity: Array
    heat: Array
    drift: Array
    warmth: Array
    warming: Array
    settled: Array
    warming_modes: Array
    closing: Array
    closing_rate: Array
    tip_force: Array


def start(modal: Decoupled, cases: Cases) -> Motion:
    """Split the initial states and constant loads of a batch into known answer and modal rest.

    Elastic and conducting modes rest at a static answer; an adiabatic mode warms steadily and
    drags its mechanical response along; the constant load on rigid modes acts as a tip force.
    """
    elastic, conducting = modal.frequency > 0, modal.rate > 0
    load = project(modal.shapes.T, cases.steady)
    heating = project(modal.heat_shapes.T, cases.heating)

    rigid_share = np.where(elastic | ~felt_modes(modal.tip), 0.0, modal.tip)
    participation = np.sum(rigid_share**2)
    tip_force = np.zeros(cases.count)
    if participation > 0:
        tip_force = project(rigid_share, load) / participation
    load = load - tip_force[:, None] * modal.tip

    settled = np.where(conducting, heating / np.where(conducting, modal.rate, 1.0), 0.0)
    warming = np.where(conducting, 0.0, heating)
    steady_velocity = project(modal.response, warming)
    stiffness = np.where(elastic, modal.frequency, 1.0) ** 2
    rest = load - project(modal.coupling, settled) - modal.damping * steady_velocity
    rest = np.where(elastic, rest / stiffness, 0.0)

    heat = project(modal.to_thermal, cases.temperature) - settled
    position = project(modal.to_modes, cases.displacement) - rest - project(modal.response, heat)
    velocity = project(modal.to_modes, cases.velocity) - steady_velocity
    velocity += project(modal.response * modal.rate, heat)

    return Motion(
        position=position,
        velocity=velocity,
        heat=heat,
        drift=project(modal.tip, steady_velocity),
        warmth=project(modal.heat_tip, settled),
        warming=project(modal.heat_tip, warming),
        settled=settled,
        warming_modes=warming,
        closing=project(modal.static_growth, settled),
        closing_rate=project(modal.static_growth, warming),
        tip_force=tip_force,
    )


def operator_name(structure: Structure) -> str:
    """Return what a structure is stepped by, as ``plan`` says it."""
    coupled = ", coupled by damping or by where the load acts" if needs_matrices(structure) else ""
    return f"{structure.mechanical_size} + {structure.thermal_size} modes with the tip's own{coupled}"
