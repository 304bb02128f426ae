"""The two linear systems between contact events: tip free and tip held at the gap.

Both are written in real modal blocks that evolve alone, so that a motion of any length costs one
exponential per block:

    blocks        η' = u + β(t),   u' = -c u - ω² η + γ(t)   (+ drive · ξ in one-way regimes)
    first order   ξ' = -μ ξ + χ(t)

The tip free, blocks are the mechanical modes and first-order states the thermal modes, which drag a
quasi-static response of the blocks along. The tip held, x_n = d, the force on the casing is

    λ = f_n - M_ni v_i' - C_ni v_i - K_ni x_i - K_nn d - K12_n θ.

Without friction heat (α = 0) the held system has the same one-way form, in the modes of the
structure with its tip fixed. With α > 0 heat and motion act on each other: its matrix is the one
of α = 0 plus α times a rank-one term, and blocks are its complex pairs of eigenvalues, first-order
states its real ones (:mod:`workflow.schemes._event_spectrum`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from workflow.models import (
    Array,
    Structure,
    mechanical_modes,
    modal_coupling,
    static_tip_growth,
    thermal_modes,
)


class Regime(NamedTuple):
    """A linear system in real modal blocks, what is seen of it and how it is entered and left.

    Coordinates are [η (block), u (block), ξ (first order)], N in all; raw coordinates are the free
    modal ones [y, y', τ]. The *signal* is what the regime ends by when it falls through zero: the
    gap d - x_n where the tip is free, the contact force λ where it is held.
    """

    damping: Array
    """c of each block, ``(block,)``."""
    stiffness: Array
    """ω² of each block, ascending, ``(block,)``."""
    rate: Array
    """μ of each first-order state, ``(first,)``."""
    coupling: Array
    """Force on a block per first-order state and the response η = a ξ + b ξ' that it drags along,
    ``(3, block, first)``: force, a, b; zero where coupling is two-way."""
    near: Array
    """1 where a block has no such response because it resonates with a first-order state, ``(block,)``."""
    signal_value: Array
    signal_slope: Array
    signal_first: Array
    """Signal per η, u and ξ."""
    signal_steady: Array
    signal_tip: float
    signal_gap: float
    """Signal per constant load, tip load and gap."""
    heat_value: Array
    heat_slope: Array
    heat_first: Array
    """Tip temperature per η, u and ξ."""
    source_steady: Array
    source_heating: Array
    source_tip: Array
    source_gap: Array
    """Sources [β, γ, χ] per constant load ``(N, mechanical)``, heating ``(N, thermal)``, tip load, gap ``(N,)``."""
    enter: Array
    enter_gap: Array
    leave: Array
    leave_gap: Array
    """Coordinates from raw ones ``(raw, N)`` and the gap, and back ``(N, raw)``: rows are inputs."""


@dataclass(frozen=True, eq=False)
class Held:
    """The structure with its tip held, in the modes z of its other coordinates.

    λ = force_steady · f̄ + f_n - stiffness_gap d - r · (z + a_K z') - k · τ.
    """

    frequency: Array
    damping: Array
    coupling: Array
    rate: Array
    heat_tip: Array
    reaction: Array
    """r, ``(mode,)``."""
    relaxation: float
    """a_K, s."""
    thermal_reaction: Array
    """k, ``(thermal mode,)``."""
    force_steady: Array
    stiffness_gap: float
    shapes: Array
    heat_shapes: Array
    to_held: Array
    """z per raw y, ``(mode, free mode)``."""
    to_held_gap: Array
    to_free: Array
    """y per z, ``(free mode, mode)``."""
    to_free_gap: Array


_DRAGGED_NEAR_RESONANCE = 1e-3
"""A block keeps its thermal force explicit where its denominator μ² - μ c + ω² is below this share
of the *sum* of its terms: the quasi-static response would lose more than three of sixteen digits. A
block as a whole becomes explicit, where the fixed-step schemes couple single pairs."""


def quasi_static(frequency: Array, damping: Array, rate: Array, drive: Array) -> tuple[Array, Array, Array]:
    """Return a, b of the response η = a τ + b τ' of blocks to first-order states, and where it fails.

    p(-μ) = μ² - μ c + ω²;  a = drive/ω²,  b = -drive (c - μ)/(ω² p(-μ)).
    """
    if rate.size == 0 or frequency.size == 0:
        return np.zeros_like(drive), np.zeros_like(drive), np.zeros(frequency.size)
    omega2, c = frequency[:, None] ** 2, damping[:, None]
    polynomial = rate**2 - rate * c + omega2
    size = rate**2 + rate * c + omega2
    forced = drive != 0
    near = np.any(forced & (np.abs(polynomial) < _DRAGGED_NEAR_RESONANCE * size), axis=1)
    use = forced & ~near[:, None]
    a, b = np.zeros_like(drive), np.zeros_like(drive)
    np.divide(drive, omega2, out=a, where=use)
    np.divide(-drive * (c - rate), omega2 * polynomial, out=b, where=use)
    return a, b, near.astype(np.float64)


@dataclass(frozen=True, eq=False)
class Basis:
    """What all regimes of a structure share: raw coordinates and the free regime."""

    to_modes: Array
    """φᵀ M."""
    to_thermal: Array
    """χᵀ C2."""
    tip: Array
    """φ_n, ``(mode,)``."""
    heat_tip: Array
    """χ_n, ``(thermal mode,)``."""
    closing: Array
    """Quasi-static tip growth per τ, m, ``(thermal mode,)``."""
    mobility: float
    """Delassus operator of an impact, e_nᵀ M⁻¹ e_n, 1/kg."""
    free: Regime
    held: Held


def analyse(structure: Structure) -> Basis:
    """Diagonalise the structure with its tip free and with its tip held."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    coupling = modal_coupling(structure, mechanical, thermal)
    frequency, rate, tip = mechanical.values, thermal.values, mechanical.tip
    damping = structure.damping.mass + structure.damping.stiffness * frequency**2
    modes, heats = frequency.size, rate.size
    size = 2 * modes + heats
    a, b, near = quasi_static(frequency, damping, rate, -coupling)
    source_steady = np.zeros((size, modes))
    source_steady[modes : 2 * modes] = mechanical.shapes.T
    source_heating = np.zeros((size, heats))
    source_heating[2 * modes :] = thermal.shapes.T
    source_tip = np.zeros(size)
    source_tip[modes : 2 * modes] = tip
    free = Regime(
        damping=damping,
        stiffness=frequency**2,
        rate=rate,
        coupling=np.stack([-coupling, a, b]),
        near=near,
        signal_value=-tip,
        signal_slope=np.zeros(modes),
        signal_first=np.zeros(heats),
        signal_steady=np.zeros(modes),
        signal_tip=0.0,
        signal_gap=1.0,
        heat_value=np.zeros(modes),
        heat_slope=np.zeros(modes),
        heat_first=thermal.tip,
        source_steady=source_steady,
        source_heating=source_heating,
        source_tip=source_tip,
        source_gap=np.zeros(size),
        enter=np.eye(size),
        enter_gap=np.zeros(size),
        leave=np.eye(size),
        leave_gap=np.zeros(size),
    )
    return Basis(
        to_modes=np.ascontiguousarray(mechanical.shapes.T @ structure.mass),
        to_thermal=np.ascontiguousarray(thermal.shapes.T @ structure.heat_capacity),
        tip=tip.copy(),
        heat_tip=thermal.tip.copy(),
        closing=static_tip_growth(structure) @ thermal.shapes,
        mobility=float(np.sum(tip**2)),
        free=contiguous(free),
        held=hold(structure),
    )


def hold(structure: Structure) -> Held:
    """Fix the tip at the gap and take the modes of what is left."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    whole = structure.matrices()
    interior = replace(whole, mass=structure.mass[:-1, :-1].copy(), elongation=structure.elongation[:, :-1].copy())
    modes = mechanical_modes(interior)
    frequency, shapes = modes.values, modes.shapes
    root = np.sqrt(structure.springs)
    strain = root[:, None] * interior.elongation
    tip_strain = root * structure.elongation[:, -1]
    # the held tip's static shape, of minimum norm
    rest = np.zeros(frequency.size)
    if frequency.size:
        rest[:] = np.linalg.lstsq(strain, -tip_strain, rcond=None)[0]
    whole_strain = strain @ rest + tip_strain
    row = tip_strain @ (strain @ shapes)  # K_ni φ
    row[frequency == 0] = 0.0
    inertia = structure.mass[-1, :-1] @ shapes  # M_ni φ
    coupling = modal_coupling(interior, modes, thermal)
    force_steady = np.append(-shapes @ inertia, 1.0)
    to_modes = mechanical.shapes.T @ structure.mass
    return Held(
        frequency=frequency,
        damping=structure.damping.mass + structure.damping.stiffness * frequency**2,
        coupling=coupling,
        rate=thermal.values,
        heat_tip=thermal.tip,
        reaction=row - inertia * frequency**2,
        relaxation=structure.damping.stiffness,
        thermal_reaction=structure.coupling_matrix[-1] @ thermal.shapes - inertia @ coupling,
        force_steady=force_steady,
        stiffness_gap=float(whole_strain @ tip_strain),
        shapes=shapes,
        heat_shapes=thermal.shapes,
        to_held=shapes.T @ interior.mass @ mechanical.shapes[:-1],
        to_held_gap=-shapes.T @ interior.mass @ rest,
        to_free=to_modes[:, :-1] @ shapes,
        to_free_gap=to_modes @ np.append(rest, 1.0),
    )


def held_system(held: Held, alpha: float) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return X' = A X + …, X = [z, z', τ], and λ and tip temperature as rows, and the sources.

    Returns A ``(N, N)``, the row of λ ``(N,)``, sources per constant load ``(N, mechanical)``,
    heating ``(N, thermal)``, tip load and gap ``(N,)``.
    """
    modes, heats = held.frequency.size, held.rate.size
    size = 2 * modes + heats
    z, u, tau = slice(0, modes), slice(modes, 2 * modes), slice(2 * modes, size)
    force = np.concatenate([-held.reaction, -held.relaxation * held.reaction, -held.thermal_reaction])
    warming = np.zeros(size)
    warming[tau] = alpha * held.heat_tip
    A = np.zeros((size, size))
    A[z, u] = np.eye(modes)
    A[u, z] = -np.diag(held.frequency**2)
    A[u, u] = -np.diag(held.damping)
    A[u, tau] = -held.coupling
    A[tau, tau] = -np.diag(held.rate)
    A += np.outer(warming, force)
    steady = np.outer(warming, held.force_steady)
    steady[u, :-1] += held.shapes.T
    heating = np.zeros((size, heats))
    heating[tau] = held.heat_shapes.T
    return A, force, steady, heating, warming.copy(), -held.stiffness_gap * warming


def contiguous(regime: Regime) -> Regime:
    """Return the regime with C-contiguous float64 arrays, as the compiled kernel expects them."""
    fields: list[Any] = [
        np.ascontiguousarray(value, dtype=np.float64) if isinstance(value, np.ndarray) else float(value)
        for value in regime
    ]
    return Regime(*fields)
