"""Static answers of a structure: the tip's compliance and growth, equilibrium, α_c; a bound of motion without contact.

On a casing that slides without reversing the contact force acts along n - µt, and the gap is measured along n:

    M x'' + C1 x' + K1 x + K12 θ = f - λ (e_n - µ t),   x_n <= d

The compliance of the tip to such a force is that to a force along e_n times

    at an impact   nᵀM⁻¹(n - µt) / nᵀM⁻¹n = 1 - µ a,      at standstill   nᵀK1⁻¹(n - µt) / nᵀK1⁻¹n = 1 - µ s,   s = ψᵀt,

with the constraint mode ψ ∝ K1⁻¹ n. Where the first is not positive an impulse pushes the tip into the casing: there is
no impact law (Painlevé paradox). Where the second is not, a tip at rest on its casing is unstable.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._cases import Cases, distinct_rows
from workflow.models._contact_system import contacts_at_rest, critical_alphas_of_contacts
from workflow.models._modes import coupled_damping, mechanical_modes
from workflow.models._pair import UNBALANCED
from workflow.models._structure import Structure


def static_share(structure: Structure) -> float:
    """Return s = ψᵀt, 1: tangential over normal displacement at standstill by a force along the normal."""
    return float(structure.mechanical.constraint @ structure.contacts.tangent[0])


_GROWS = 1e-6
"""Growth over a duration, of a mode with negative damping, up to which it is rounding of six digits."""

_CANCELLED = 1e-13
"""Growth by the tip's heat, over its largest term, up to which it is rounding."""


def tip_flexibility(structure: Structure) -> float:
    """Return S = e_nᵀ K1⁻¹ e_n, the static compliance of the tip, m/N; ``inf`` for a free root."""
    stiffness = structure.mechanical.tip_stiffness
    return 1 / stiffness if stiffness > 0 else float("inf")


def static_tip_growth(structure: Structure) -> Array:
    """Return the row -e_nᵀ K1⁻¹ K12: quasi-static tip displacement per temperature, m/K.

    Shape ``(thermal,)``. Rigid modes are left out (their thermal load is zero): an unconstrained part grows about its
    centre of mass.
    """
    if structure.tip_growth is not None:
        return structure.tip_growth
    pair = structure.mechanical
    if pair.tip_stiffness > 0:
        response, deformation = pair.constraint / pair.tip_stiffness, pair.deformed / pair.tip_stiffness
    else:
        response = pair.solve(pair.unit_tip)
        deformation = pair.deformation_of(response)
    return pair.work(response, deformation, structure.expansion)


def statics(structure: Structure) -> tuple[Array, Array]:
    """Return S_i = w_iᵀ K1⁻¹ w_i with residual flexibility [m/N], ``(contact,)``, and the growth of each contact.

    S_i is infinite where nothing holds it; growth is -w_iᵀ K1⁻¹ K12 - r_i [m/K], ``(contact, thermal)``.
    """
    contacts, pair = structure.contacts, structure.mechanical
    if contacts.is_tip:
        return np.array([tip_flexibility(structure)]), static_tip_growth(structure)[None]
    responses = [pair.solve(normal) for normal in contacts.normal]
    rows = [pair.work(each, pair.deformation_of(each), structure.expansion) for each in responses]
    flexibilities = np.sum(contacts.normal * responses, axis=1)
    flexibilities += 0.0 if contacts.residual is None else contacts.residual.diagonal()
    is_free = [pair.moves(normal) for normal in contacts.normal]
    coupling = 0.0 if contacts.residual_coupling is None else contacts.residual_coupling
    return np.where(is_free, np.inf, flexibilities), np.array(rows) - coupling


def steady_warmth(structure: Structure) -> Array:
    """Return the steady temperatures by heat at each contact alone that warms it by 1 K, ``(contact, thermal)``."""
    thermal, rows = structure.thermal, structure.contacts.heat
    warm = np.array([structure.uniform_rise if thermal.moves(row) else thermal.solve(row) for row in rows])
    return np.asarray(warm / np.sum(rows * warm, axis=1)[:, None])


def static_reach(structure: Structure) -> Array:
    """Return the static displacement of each contact by the load of 1 N, m/N, ``(contact,)``."""
    rows, direction = structure.contacts, structure.load_direction
    if structure.mechanical.moves(direction):
        return np.full(rows.count, np.inf)
    return np.asarray(rows.normal @ structure.mechanical.solve(direction) + rows.residual_load_or_zero)


def critical_alpha(structure: Structure, friction: float = 0.0) -> float:
    """Return the least of :func:`critical_alphas`, W/N."""
    return min(critical_alphas(structure, friction).values())


def critical_alphas(structure: Structure, friction: float = 0.0) -> dict[tuple[str, ...], float]:
    """Return α_c of each closed set by its labels: of a tip S/β, above which it runs away, W/N; 0 if it always does.

    S = e_nᵀ K1⁻¹ (e_n - µ t) + c on a casing of flexibility c, see :mod:`workflow.models._static`, and
    β = -e_nᵀ K1⁻¹ K12 K2⁻¹ e_n. With the steady temperatures χ for 1 K at the tip and the conductance σ of the tip
    K2⁻¹ e_n = χ/σ. Singular cases are decided by rank: ``inf`` where the root is free or heat at the tip does not push
    it out (β <= 0), 0 where heat that cannot leave the structure (σ = 0) pushes the tip out. Several contacts:
    :func:`critical_alphas_of_contacts`.
    """
    rows, labels = structure.contacts, structure.contacts.labels
    if rows.count > 1 or rows.residual is not None:
        return critical_alphas_of_contacts(structure, friction)
    yields = 1 - friction * static_share(structure)
    if yields <= 0:
        return {labels: 0.0}
    terms = static_tip_growth(structure) * structure.thermal.constraint
    pushed, flexibility = float(terms.sum()), tip_flexibility(structure)
    if np.isinf(flexibility) or pushed <= _CANCELLED * np.abs(terms).max(initial=0.0):
        return {labels: float("inf")}
    return {labels: structure.thermal.tip_stiffness * (flexibility * yields + rows.casing_flexibility) / pushed}


def instantaneous_growth(structure: Structure) -> float:
    """Return the instantaneous static tip growth by heat loads on temperatures without heat capacity, m."""
    given = structure.coordinates
    if given is None or not given.expansive.any():
        return 0.0
    return float(structure.mechanical.solve(given.displacement_basis.T @ given.expansive)[-1])


def rounding_of_flexibility(structure: Structure) -> float:
    """Estimate the largest relative change of S = wᵀ K1⁻¹ w of a contact by the rounding of the entries of K1, 1.

    With u = K1⁻¹ w a change of the entries changes S by -uᵀ δK1 u; independent changes by half a unit in the last
    place give ε/2 √(Σ (u_i K_ij u_j)²)/S. It is large where entries cancel to a far smaller stiffness.
    """
    entries, lost = scipy.sparse.coo_array(structure.mechanical.stiffness), 0.0
    row, column = entries.coords
    for normal in structure.contacts.normal:
        response = structure.mechanical.solve(normal)
        energies = response[row] * entries.data * response[column]
        lost = max(lost, float(np.finfo(float).eps / 2 * np.linalg.norm(energies) / abs(normal @ response)))
    return lost


class NoEquilibriumError(ValueError):
    """A structure has no equilibrium under its constant loads."""


def static_equilibrium(
    structure: Structure, load: Array, heating: Array, gap: float, friction: float = 0.0
) -> tuple[Array, Array]:
    """Return displacement and temperature at rest under constant loads, casing included.

    K2 θ = q and K1 x + K12 θ = f - λ (e_n - µ t) with 0 <= gap - x_n ⊥ λ >= 0. At rest contact makes no heat.
    A pressed tip has x = gap ψ + K1⁻¹ (f + µ λ t - K12 θ), inverted with the tip held, and λ (1 - µ ψᵀt) = ψᵀ (f -
    K12 θ) - σ gap.

    Parameters
    ----------
    structure
        The full structure.
    load, heating
        Constant loads [N] and heat loads [W], ``(node,)``.
    gap
        Clearance d, m.
    friction
        Friction coefficient µ along the structure's tangent.

    Returns
    -------
    displacement, temperature
        m and K, ``(node,)``.

    Raises
    ------
    NoEquilibriumError
        The loads accelerate a free body, or heat that cannot leave warms the structure for ever.
    """
    pair, thermal = structure.mechanical, structure.thermal
    if thermal.moves(heating):
        raise NoEquilibriumError("the heat load cannot leave the structure, its temperature has no equilibrium")
    temperature = thermal.solve(heating)
    force = load + structure.thermal_forces(temperature)
    if not pair.moves(force):
        free = pair.solve(force)
        if free[-1] <= gap:
            return free, temperature
    moved, pressing = pair.constraint * force, pair.tip_stiffness * gap
    reaction, yields = float(moved.sum()) - pressing, 1.0
    if structure.contacts.slides:
        yields = 1 - friction * static_share(structure)
        slides = structure.contacts.tangent[0]
        force = force + friction * max(reaction, 0.0) / yields * slides if yields > 0 else force
    if reaction < -UNBALANCED * (np.abs(moved).sum() + abs(pressing)) or yields <= 0 or pair.moves(force, held=True):
        raise NoEquilibriumError("the constant loads move the structure for ever, it has no equilibrium")
    return gap * pair.constraint + pair.solve(force, held=True), temperature


def at_rest(structure: Structure, cases: Cases) -> Cases:
    """Return cases that start in equilibrium under their constant loads; a pressed tip has the velocity ḋ(0).

    ``structure`` is the one that is run, full or reduced, so that none of its modes is excited.

    Raises
    ------
    NoEquilibriumError
        A case has no equilibrium under its constant loads.
    """
    if not structure.contacts.is_tip:
        resting = contacts_at_rest(structure, cases)
        if resting is None:
            raise NoEquilibriumError("the constant loads move the structure for ever, it has no equilibrium")
        return resting
    load = cases.steady.copy()
    load += cases.mean[:, None] * structure.load_direction
    casing, moves = (each[:, 0] for each in cases.casing_of_contacts(0.0))
    first, which = distinct_rows(load, cases.heating, casing[:, None], cases.friction[:, None])
    laws = list(zip(casing.tolist(), cases.friction.tolist(), strict=True))
    states = [static_equilibrium(structure, load[k], cases.heating[k], *laws[k]) for k in first]
    displacement = np.stack([x for x, _ in states])[which]
    temperature = np.stack([theta for _, theta in states])[which]
    velocity = np.zeros_like(displacement)
    velocity[:, -1] = np.where(displacement[:, -1] == casing, moves, 0.0)
    return replace(cases, displacement=displacement, velocity=velocity, temperature=temperature)


def free_reach(structure: Structure, cases: Cases, duration: float) -> Array:
    """Return a bound of the displacement of each contact without contact, m, ``(case, contact)``.

    ``inf`` where a rigid mode moves one, damping couples modes, or a mode is driven by more than rounding.

    It sums the responses to constant and harmonic loads, the transient of the initial state, and twice the quasi-static
    growth by heating and initial temperatures. In modes, x_i = Σ φ_i η, with p̄ the constant load and p the harmonic
    one, η = p̄/ω² + Im[H e^{i(Ωt + φ)}] + a transient, with H = p/(ω² - Ω² + iΩc). The transient begins with the
    difference (Δη, Δζ) of the initial state from the first two, and stays below sqrt(Δη² + (Δζ/ω)²), as a free mode
    gains no energy.
    """
    modes = mechanical_modes(structure)
    omega, tip, damping = modes.values, structure.contacts.normal @ modes.shapes, coupled_damping(structure, modes)
    moving = (omega == 0) & (np.abs(tip) > 1e-9 * np.abs(tip).max()).any(axis=0)
    if np.any(moving) or damping.ndim == 2 or np.any(damping * duration < -_GROWS):
        return np.full((cases.count, len(tip)), np.inf)
    elastic, residual = omega > 0, structure.contacts.residual_load_or_zero
    omega, tip, damping, shapes = omega[elastic], tip[:, elastic].T, damping[elastic], modes.shapes[:, elastic]
    amplitudes, frequencies, phases = (row.T for row in cases.load_harmonics.rows)
    constant = frequencies == 0
    mean = cases.mean + np.where(constant, amplitudes * np.sin(phases), 0.0).sum(axis=0)
    drive = structure.load_direction @ shapes
    static = (cases.steady @ shapes + mean[:, None] * drive) / omega**2
    momenta = structure.mechanical.inertia_of(shapes)
    offset = cases.displacement @ momenta - static
    speed = cases.velocity @ momenta
    harmonic = np.abs(amplitudes).sum(axis=0)[:, None] * np.abs(residual)
    with np.errstate(divide="ignore", invalid="ignore"):
        for amplitude, frequency, phase in zip(np.where(constant, 0.0, amplitudes), frequencies, phases, strict=True):
            acts, turning = amplitude[:, None], 2 * np.pi * frequency[:, None]
            response = acts * drive / (omega**2 - turning**2 + 1j * turning * damping)
            response = np.where(acts == 0, 0.0, response)
            begins = response * np.exp(1j * phase[:, None])
            offset, speed = offset - begins.imag, speed - (1j * turning * begins).imag
            harmonic += np.abs(response @ tip)
        swing = np.hypot(offset, speed / omega)
        transient = swing @ np.abs(tip)
    growth = 2 * _warmest(structure, cases, duration) @ np.abs(statics(structure)[1]).T
    return np.asarray(static @ tip + cases.mean[:, None] * residual + harmonic + transient + growth)


def _warmest(structure: Structure, cases: Cases, duration: float) -> Array:
    """Return a bound of the temperatures due to initial ones and heating, K, ``(case, thermal)``."""
    started = np.abs(cases.temperature).max(axis=1, initial=0.0)[:, None]
    capacities = structure.thermal.inertia_of(np.ones(structure.thermal_size))
    heated = duration * (np.abs(cases.heating) / capacities).max(axis=1, initial=0.0)[:, None]
    return np.broadcast_to(started + heated, cases.temperature.shape)
