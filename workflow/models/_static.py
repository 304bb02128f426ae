"""Static answers of a structure: compliance and growth of contacts, equilibrium, α_c; a bound of free motion.

On a casing that slides without reversing contact forces act along w_i - µ t_i, and gaps are measured along w_i:

    M x'' + C1 x' + K1 x + K12 θ = f - Σ λ_i (w_i - µ t_i),   w_i x <= d_i

With contacts closed for good forces and the places of contacts are related by

    at an impact   w_i M⁻¹ (w_j - µ t_j),      at standstill   S_ij = w_i K1⁻¹ (w_j - µ t_j) + R_ij - µ R^t_ij + c δ_ij

with the residual R of contacts without mass and the flexibility c of the casing. Where the first is not positive an
impulse pushes a contact into its casing: there is no impact law (Painlevé paradox). Where the second is not, contacts
at rest on their casing are unstable.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.lemke import complementarity
from workflow.models._cases import Cases, distinct_rows, project
from workflow.models._coating import coated_forces
from workflow.models._contacts import Contacts, closed_sets
from workflow.models._modes import coupled_damping, mechanical_modes
from workflow.models._pair import UNBALANCED
from workflow.models._structure import Structure

_GROWS = 1e-6
"""Growth over a duration, of a mode with negative damping, up to which it is rounding of six digits."""

_CANCELLED = 1e-13
"""Sum over its terms, or part of a row over the whole, up to which it is the rounding of some hundred terms."""

_REAL = 1e-9
"""Imaginary part of an eigenvalue, over it, up to which it is the rounding of a real one."""


def static_growth(structure: Structure) -> Array:
    """Return the growth -w_i K1⁻¹ K12 - r_i of each contact, m/K, ``(contact, thermal)``."""
    return _answers(structure)[1]


def _answers(structure: Structure) -> tuple[Array, Array]:
    """Return K1⁻¹ w_i, ``(contact, mechanical)``, and -w_i K1⁻¹ K12 - r_i, ``(contact, thermal)``.

    Rigid modes are left out (their thermal load is zero): an unconstrained part grows about its centre of mass.
    """
    pair, contacts = structure.mechanical, structure.contacts
    answers, deformations = zip(*map(pair.answer, contacts.normal), strict=True)
    if contacts.growth is not None:
        return np.array(answers), contacts.growth
    growth = [pair.work(*both, structure.expansion) for both in zip(answers, deformations, strict=True)]
    return np.array(answers), np.array(growth) - contacts.residual_coupling


def statics(structure: Structure) -> tuple[Array, Array]:
    """Return S_i = w_iᵀ K1⁻¹ w_i with residual flexibility [m/N], ``(contact,)``, and :func:`static_growth`.

    S_i is infinite where nothing holds it.
    """
    (answers, growth), contacts = _answers(structure), structure.contacts
    flexibility = np.sum(contacts.normal * answers, axis=1) + contacts.flexibility(0.0).diagonal()
    return np.where([structure.mechanical.moves(row) for row in contacts.normal], np.inf, flexibility), growth


@dataclass(frozen=True, eq=False)
class ContactStatics:
    """Static answers at the contacts of a structure; forces on a part that moves freely balance on its motions."""

    contacts: Contacts
    answers: Array
    """K1⁻¹ w_i, m/N, ``(contact, mechanical)``."""
    flexibility: Array
    sliding: Array
    """``flexibility``, ``sliding``: S_ij of a rigid casing per µ^0 and -µ, m/N, ``(contact, contact)``."""
    growth: Array
    """-w_i K1⁻¹ K12 - r_i, m/K, ``(contact, thermal)``."""
    motions: Array
    others: Array
    """``motions``, ``others``: motions without deformation that move a contact, and that move none, ``(mechanical,
    motion)``."""
    by_heat: Array
    kept: Array
    """``by_heat``, ``kept``: growth of contact i by steady heat at contact j, m/W, and per second by that which cannot
    leave, ``(contact, contact)``."""

    def compliance(self, friction: float) -> Array:
        """Return S, m/N, ``(contact, contact)``."""
        own = self.contacts.casing_flexibility * np.eye(self.contacts.count)
        return np.asarray(self.flexibility - friction * self.sliding + own)


def _sums(rows: Array, columns: Array) -> Array:
    """Return rows · columnsᵀ, 0 where that is the rounding of its terms."""
    sums = rows @ columns.T
    return np.where(np.abs(sums) <= _CANCELLED * (np.abs(rows) @ np.abs(columns.T)), 0.0, sums)


def contact_statics(structure: Structure) -> ContactStatics:
    """Return the static answers at the contacts of a structure."""
    pair, thermal, contacts = structure.mechanical, structure.thermal, structure.contacts
    answers, growth = _answers(structure)
    rigid, kept = pair.rigid_motions(False), thermal.rigid_motions(False)
    rank, _, turn = _rank(contacts.normal @ rigid, contacts.normal)
    kept = kept / np.sqrt(np.sum(kept * thermal.inertia_of(kept), axis=0))
    return ContactStatics(
        contacts=contacts,
        answers=answers,
        flexibility=contacts.normal @ answers.T + contacts.flexibility(0.0),
        sliding=answers @ contacts.tangent.T + contacts.flexibility(0.0) - contacts.flexibility(1.0),
        growth=growth,
        motions=rigid @ turn[:rank].T,
        others=rigid @ turn[rank:].T,
        by_heat=_sums(growth, np.array([thermal.answer(row)[0] for row in contacts.heat])),
        kept=_sums(growth, kept.T) @ (contacts.heat @ kept).T,
    )


def _rank(matrix: Array, whole: Array) -> tuple[int, Array, Array]:
    """Return the rank of a matrix beside the entries of a ``whole``, and its singular vectors."""
    left, sizes, right = np.linalg.svd(matrix)
    return int(np.sum(sizes > _CANCELLED * np.abs(whole).max(initial=0.0))), left, right


def steady_warmth(structure: Structure) -> Array:
    """Return the steady temperatures by heat at each contact alone that warms it by 1 K, ``(contact, thermal)``."""
    thermal, rows = structure.thermal, structure.contacts.heat
    warm = np.array([structure.uniform_rise if thermal.moves(row) else thermal.answer(row)[0] for row in rows])
    return np.asarray(warm / np.sum(rows * warm, axis=1)[:, None])


def static_reach(structure: Structure) -> Array:
    """Return the static displacement of each contact by the load of 1 N, m/N, ``(contact,)``."""
    rows, direction = structure.contacts, structure.load_direction
    if structure.mechanical.moves(direction):
        return np.full(rows.count, np.inf)
    return np.asarray(rows.normal @ structure.mechanical.solve(direction) + rows.residual_load)


def critical_alpha(structure: Structure, friction: float = 0.0) -> float:
    """Return the least of :func:`critical_alphas`, W/N."""
    return min(critical_alphas(structure, friction).values())


def critical_alphas(structure: Structure, friction: float = 0.0) -> dict[tuple[str, ...], float]:
    """Return the least α > 0 at which the static problem of each closed set is singular, W/N, by :func:`closed_sets`.

    det(S - α B) = 0 with B_ij = -(w_iᵀ K1⁻¹ K12 + r_i) K2⁻¹ s_j, under forces that balance on motions without
    deformation and heat that leaves; of a tip S/β, above which it runs away. ``inf`` for none, where the root is free
    or heat does not push contacts out; 0 where heat that cannot leave does, or friction alone makes the set unstable.
    """
    static = contact_statics(structure)
    sets = closed_sets(static.contacts).items()
    return {labels: _critical_alpha(static, closed, friction) for labels, closed in sets}


def _critical_alpha(static: ContactStatics, closed: NDArray[np.intp], friction: float) -> float:
    S, B, kept = (each[np.ix_(closed, closed)] for each in (static.compliance(friction), static.by_heat, static.kept))
    normal, tangent = (rows[closed] @ static.motions for rows in (static.contacts.normal, static.contacts.tangent))
    rank, held, moved = _rank(normal, static.contacts.normal @ static.motions)
    normal, pushed = normal @ moved[:rank].T, (normal - friction * tangent) @ moved[:rank].T
    if np.linalg.slogdet(_at_rest(normal, pushed, S))[0] * (-1) ** len(S) <= 0:
        return 0.0
    left, balanced = held[:, rank:].T, np.linalg.svd(pushed.T)[2][rank:].T
    S, B, kept = (left @ matrix @ balanced for matrix in (S, B, kept))
    if np.isfinite(_least_root(S, kept)):
        return 0.0
    rank, held, moved = _rank(kept, kept)
    return _least_root(held[:, rank:].T @ S @ moved[rank:].T, held[:, rank:].T @ B @ moved[rank:].T)


def _at_rest(normal: Array, sliding: Array, flexibility: Array) -> Array:
    """Return the matrix of the static problem: motions without deformation are unknowns before the forces."""
    rigid = normal.shape[1]
    return np.block([[np.zeros((rigid, rigid)), sliding.T], [normal, -flexibility]])


def _least_root(A: Array, B: Array) -> float:
    """Return the least z > 0 with det(A - z B) = 0; ``inf`` for none."""
    values = scipy.linalg.eigvals(B, A)  # 1/z
    values = values[np.isfinite(values)]
    real = values.real[np.abs(values.imag) <= _REAL * np.abs(values)]
    largest = float(real.max(initial=0.0))
    return 1 / largest if largest > _CANCELLED * np.abs(values).max(initial=0.0) else float("inf")


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
    static, contacts, found = contact_statics(structure), structure.contacts, []
    moved = np.linalg.solve(structure.mass, contacts.normal.T)
    own, along = contacts.normal @ moved, moved.T @ contacts.tangent.T
    normal, tangent = contacts.normal @ static.motions, contacts.tangent @ static.motions
    for labels, closed in closed_sets(contacts).items():
        w, t, pairs = normal[closed], tangent[closed], np.ix_(closed, closed)
        impact = np.inf if contacts.is_compliant else _least_root(own[pairs], along[pairs])
        pressed, aside = _at_rest(w, w, static.compliance(0.0)[pairs]), _at_rest(0 * w, t, static.sliding[pairs])
        found.append(CriticalFriction(labels, impact, _least_root(pressed, aside)))
    return found


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


def _equilibrium(
    structure: Structure,
    static: ContactStatics,
    load: Array,
    heating: Array,
    gap: Array,
    friction: float,
    level: Array,
    hardening: float,
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return x, θ and the contacts that touch, at rest under constant loads [N, W] with clearances d and levels F_y.

    K2 θ = q and K1 x + K12 θ = f - Σ λ_i (w_i - µ t_i) with 0 <= d - w x + (R - µ R^t + c) λ ⊥ λ >= 0. At rest contact
    makes no heat. Where contacts move a structure without deforming it, it rests on as many of them as it has such
    motions.
    """
    pair, contacts = structure.mechanical, structure.contacts
    if structure.thermal.moves(heating):
        raise NoEquilibriumError("the heat load cannot leave the structure, its temperature has no equilibrium")
    temperature = structure.thermal.solve(heating)
    force, push = load + structure.thermal_forces(temperature), contacts.normal - friction * contacts.tangent
    gap = gap + contacts.residual_coupling @ temperature
    free = pair.solve(force)
    apart = gap - contacts.normal @ free
    pressed = _pressed(static, force, push, apart, friction)
    if np.any(pressed > level):
        crushed = None
        if not static.motions.size:
            both = static.compliance(friction), apart, contacts.casing_flexibility
            crushed = coated_forces(*both, level, hardening)
        elif hardening > 0:
            crushed = pressed, np.fmax(0.0, pressed - level) / hardening
        if crushed is None:
            raise NoEquilibriumError("the constant loads crush the coating for ever, it has no equilibrium")
        pressed, gap = crushed[0], gap + crushed[1]
    x = pair.solve(force - pressed @ push) if pressed.any() else free
    own = gap + contacts.compliance(friction) @ pressed
    place = contacts.normal @ x
    apart = np.where(pressed > 0, own, np.minimum(own, place)) - place
    touched = contacts.normal @ static.motions
    if touched.size:
        x = x + static.motions @ np.linalg.solve(touched, apart)
    elif not contacts.is_compliant:  # where the free place is far beyond the gap, forces have too few digits
        held = static.answers[pressed > 0]
        x = x + np.linalg.solve(contacts.normal[pressed > 0] @ held.T, apart[pressed > 0]) @ held
    return x, temperature, (pressed > 0) | (contacts.normal @ x >= own)


def _pressed(static: ContactStatics, force: Array, push: Array, apart: Array, friction: float) -> Array:
    """Return the contact forces at rest, N, ``(contact,)``, where contacts would be ``apart`` without, m."""
    pressed, moved = None, static.motions.shape[1]
    if not moved:
        pressed = complementarity(static.compliance(friction), apart)
    elif moved == len(push):
        pressed = np.asarray(np.linalg.solve((push @ static.motions).T, _resultants(static.motions, force)))
    if pressed is None or np.any(pressed < 0) or _resultants(static.others, force).any():
        raise NoEquilibriumError("the constant loads move the structure for ever, it has no equilibrium")
    return pressed


def _resultants(motions: Array, force: Array) -> Array:
    """Return the resultants of forces on motions, N, ``(motion,)``; 0 where they balance."""
    sums = motions.T @ force
    least = UNBALANCED * np.abs(motions).max(axis=0, initial=0.0) * np.abs(force).sum()
    return np.where(np.abs(sums) <= least, 0.0, sums)


def at_rest(structure: Structure, cases: Cases) -> Cases:
    """Return cases that start in equilibrium under their constant loads and the gaps at t = 0.

    A contact with mass that touches its casing has the velocity of that. ``structure`` is the one that is run, full or
    reduced, so that none of its modes is excited.

    Raises
    ------
    NoEquilibriumError
        A case has no equilibrium under its constant loads.
    """
    static, contacts = contact_statics(structure), structure.contacts
    load = cases.steady + cases.mean[:, None] * structure.load_direction
    place, moves = cases.casing_of_contacts(0.0)
    gaps = place - cases.mean[:, None] * contacts.residual_load
    level, hardening = np.full_like(gaps, np.inf), np.zeros(cases.count)
    if cases.coating is not None:
        gaps, hardening = gaps + cases.coating.worn_at_start(), cases.coating.hardening
        level = cases.coating.level_at_start()
    numbers = np.column_stack([cases.friction, level, hardening])
    first, which = distinct_rows(load, cases.heating, gaps, numbers)
    rows = (load, cases.heating, gaps, cases.friction, level, hardening)
    states = [_equilibrium(structure, static, *(row[k] for row in rows)) for k in first]
    displacement, temperature, closed = (np.stack(rows)[which] for rows in zip(*states, strict=True))
    velocity = np.zeros_like(displacement)
    for i in np.flatnonzero(closed.any(axis=1) & (not contacts.is_compliant)):
        velocity[i] = np.linalg.pinv(contacts.normal[closed[i]]) @ moves[i, closed[i]]
    return replace(cases, displacement=displacement, velocity=velocity, temperature=temperature)


def compliant_places(structure: Structure, cases: Cases, spring_flexibility: float) -> Array:
    """Return x_i of compliant contacts at t = 0, m, ``(case, contact)``: d + w + c λ if they touch; NaN without a λ."""
    contacts, (surface, _), own = structure.contacts, cases.casing_of_contacts(0.0), cases.coating
    c, level, hardening = (
        contacts.casing_flexibility + spring_flexibility,
        np.full_like(surface, np.inf),
        np.zeros(cases.count),
    )
    if own is not None:
        surface, level, hardening = surface + own.worn_at_start(), own.level_at_start(), own.hardening
    free = project(contacts.normal, cases.displacement) + cases.load_at(0.0)[:, None] * contacts.residual_load
    free -= project(contacts.residual_coupling, cases.temperature)
    for i in np.flatnonzero((free > surface).any(axis=1)):
        flexibility = contacts.flexibility(float(cases.friction[i]))
        compliance = flexibility + c * np.eye(contacts.count)
        pressed = coated_forces(compliance, surface[i] - free[i], c, level[i], hardening[i])
        force, grown = (np.full(contacts.count, np.nan),) * 2 if pressed is None else pressed
        free[i] = np.where(force > 0, surface[i] + (grown + c * force), free[i] - flexibility @ force)
    return free


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
    elastic, residual = omega > 0, structure.contacts.residual_load
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
