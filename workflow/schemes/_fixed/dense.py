"""Fixed steps by dense matrices, where damping couples the modes of the free tip or the load does not act on it.

With X = [x, v, θ] a free step is X' = A X + b, one matrix for the whole structure; a step of a case costs the square of
the number of its states instead of a few operations for each mode. The θ-method has

    Ŵ = M + hθC1 + h²θ²K1,   T̂ = C2 + hθK2,   W = e_nᵀ Ŵ⁻¹ (e_n - µ t + α hθ K12 T̂⁻¹ e_n),

central differences Ŵ = M + h/2 C1 (M where damping lags) and the heat of a step in the next one. The march is
:mod:`workflow.schemes._fixed.dense_march`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import eigenvalues, inverse
from workflow.kernels.lanes import ROW, lane_rows
from workflow.models import NO_HARMONICS, Cases, Structure, mechanical_modes, needs_matrices, project, static_tip_growth
from workflow.schemes._fixed import case_row, tip_row
from workflow.schemes._fixed.central import Differences
from workflow.schemes._fixed.contact import CentralStep, Contact, TipStep
from workflow.schemes._fixed.dense_balance import account_of, no_account
from workflow.schemes._fixed.dense_march import CONTACT_SPEED, DenseState, FreeStep
from workflow.schemes._fixed.drive import drive_of
from workflow.schemes._fixed.march import law_rows
from workflow.schemes._fixed.marches import KERNELS
from workflow.schemes._fixed.outcome import ROUNDING, Outcome, effective_restitution, judged
from workflow.schemes._fixed.sliding import friction_message
from workflow.schemes._fixed.stepping import Ended, Watch, block_lanes, blocks, collect, watch
from workflow.schemes._fixed.totals import Balance, content_of
from workflow.schemes._interface import Results, Sampling

_CHUNK = 1024
"""Steps whose loads are evaluated at once."""


@dataclass(frozen=True, eq=False)
class DenseOperator:
    """The free step and the responses to an impulse.

    Attributes
    ----------
    structure, contact
        What is stepped, and how it meets the casing.
    free
        The free step as the march takes it.
    mobility, warming
        Ŵ⁻¹ and what a step makes of heat, 1/kg and K/J.
    dragged
        Ŵ⁻¹ hθ K12 T̂⁻¹ e_n, by which an impulse's heat drives velocities, per α.
    growth
        Spectral radius of A.
    most
        Growth up to which A is stable, but for rounding.
    """

    structure: Structure
    contact: Contact
    free: FreeStep
    mobility: Array
    warming: Array
    dragged: Array
    growth: float
    most: float

    def contact_response(self, alpha: Array, friction: Array) -> Array:
        """Return velocities per impulse of contact, 1/kg, ``(case, mechanical)``; the tip's is W."""
        responses = self.mobility[:, -1] + alpha[:, None] * self.dragged
        if self.structure.tangent is not None:
            responses = responses - friction[:, None] * (self.mobility @ self.structure.tangent)
        return np.asarray(responses)


def init(structure: Structure, h: float, theta: float, contact: Contact) -> DenseOperator:
    """Invert Ŵ and T̂ of the θ-method once for a batch."""
    M, C, K = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    coupling, capacity, losses = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    heats, rest = capacity.shape[0], 1 - theta
    mobility = inverse(M + h * theta * C + h * h * theta * theta * K)
    warming = inverse(capacity + h * theta * losses)
    cooled = warming @ (capacity - h * rest * losses)
    velocity = (
        -h * (mobility @ K),
        mobility @ (M - h * rest * C - h * h * theta * rest * K),
        -h * (mobility @ (coupling @ (theta * cooled + rest * np.eye(heats)))),
    )
    dragged = h * theta * (mobility @ (coupling @ warming[:, -1]))
    tip = contact.felt_by(TipStep(h, theta, rest, float(mobility[-1, -1]), float(warming[-1, -1])))
    response, warm = mobility @ structure.load_direction, warming[:, -1].copy()
    free = FreeStep(tip, np.hstack(velocity), cooled, response, warm, heat_counts=True, heat_theta=theta, lagged=False)
    return DenseOperator(structure, contact, free, mobility, warming, dragged, *_growth(structure, free))


def init_central(structure: Structure, h: float, differences: Differences, contact: Contact) -> DenseOperator:
    """Invert Ŵ and what heat is divided by in central differences once for a batch."""
    M, C, K = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    capacity, losses = structure.heat_capacity, structure.conductance_matrix
    ahead, behind = (M, M - h * C) if differences.lagged else (M + h / 2 * C, M - h / 2 * C)
    mobility = inverse(ahead)
    warming = inverse(capacity + h * losses if differences.implicit_heat else capacity)
    cooled = warming @ (capacity if differences.implicit_heat else capacity - h * losses)
    pulls = -h * (mobility @ K), mobility @ behind, -h * (mobility @ structure.coupling_matrix)
    tip = contact.felt_by(CentralStep(h, 1.0, 0.0, float(mobility[-1, -1]), float(warming[-1, -1])))
    response, warm = mobility @ structure.load_direction, warming[:, -1].copy()
    implicit, lagged = float(differences.implicit_heat), differences.lagged
    free = FreeStep(tip, np.hstack(pulls), cooled, response, warm, False, implicit, lagged)
    none = np.zeros(M.shape[0])
    return DenseOperator(structure, contact, free, mobility, warming, none, *_growth(structure, free))


def _growth(structure: Structure, free: FreeStep) -> tuple[float, float]:
    """Return the spectral radius of a free step, and what of it is rounding.

    A rigid mode has the double eigenvalue 1, which errs by the root of rounding.
    """
    n, h, theta = free.velocity.shape[0], free.tip.h, free.tip.theta
    size = free.velocity.shape[1]
    A = np.zeros((size, size))
    A[n : 2 * n] = free.velocity
    A[:n] = h * theta * free.velocity
    A[:n, :n] += np.eye(n)
    A[:n, n : 2 * n] += h * (1 - theta) * np.eye(n)
    A[2 * n :, 2 * n :] = free.cooling
    modes = mechanical_modes(structure)
    is_rigid = bool(np.any((modes.values == 0) & (modes.inertia > 0)))
    rounding = ROUNDING * size
    return float(np.abs(eigenvalues(A)).max(initial=0.0)), 1 + (np.sqrt(rounding) if is_rigid else rounding)


@np.errstate(over="ignore", invalid="ignore")  # the status of a case that left the finite numbers says so
def compute(operator: DenseOperator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch."""
    structure, free, contact = operator.structure, operator.free, operator.contact
    count, heats = cases.count, free.warming.size
    theta = free.tip.theta if free.heat_counts else 0.0  # central differences take V of the step ahead
    # loads have their harmonics already
    drive, begun = drive_of(replace(cases, load_harmonics=NO_HARMONICS), free.tip.h, theta)
    watched = watch(cases, cases.mean, sampling, free.tip.h, drive)
    response = operator.contact_response(cases.alpha, cases.friction)
    steady, states = _steady(operator, cases), _begin(operator, cases, begun.velocity)
    own = np.zeros((case_row.ROWS, count))
    own[case_row.MOBILITY] = contact.mobility(free.tip.h, response[:, -1])
    own[case_row.ALPHA], own[case_row.AHEAD] = cases.alpha, cases.displacement[:, -1]
    own[case_row.HALF] = states[:, 2 * response.shape[1] - 1]
    own, law = law_rows(own, contact.law(cases))
    account, filled = account_of(structure, cases) if sampling.balances else (no_account(), [])
    lanes = DenseState(
        own=lane_rows(len(own)),
        states=lane_rows(states.shape[1]),
        ahead=lane_rows(steady.shape[1]),
        contact_response=lane_rows(response.shape[1]),
        steady=lane_rows(steady.shape[1]),
        sampled=lane_rows(2, heats),
        before=lane_rows(response.shape[1]),
        by_contact=lane_rows(CONTACT_SPEED + 1),
    )
    filled += [(lanes.own, own), (lanes.states, states.T), (lanes.steady, steady.T)]
    filled += [(lanes.contact_response, response.T), (lanes.sampled[1], cases.temperature.T)]
    reached, last = np.zeros((2, count, heats))
    totals = np.zeros((account.totals.shape[0], count))
    for part, block in blocks(watched, block_lanes(4 * states.shape[1]), *filled):
        for first, loads in _loads(free, cases.take(part), watched.schedule.steps):
            KERNELS[type(law)].matrices(free, law, lanes, block, account, loads, first)
        size = part.stop - part.start
        own[:, part], totals[:, part] = lanes.own[:, :size], account.totals[:, :size]
        before, after = lanes.sampled[..., :size].swapaxes(1, 2)
        last[part], reached[part] = lanes.states[2 * response.shape[1] :, :size].T, watched.reached(before, after)
    rebounds = effective_restitution(own) if contact.rebounds else {}
    elapsed = watched.elapsed + (0.0 if free.heat_counts else free.tip.h)
    content = content_of(structure, cases, last, elapsed)
    closing = project(static_tip_growth(structure), reached)
    outcome = _judged(operator, cases, response[:, -1], watched)
    balance = Balance(totals, content) if sampling.balances else None
    return collect(Ended(watched, closing, rebounds, balance), *outcome)


def _steady(operator: DenseOperator, cases: Cases) -> Array:
    """Return the velocities and temperatures that constant loads and heating add in a step, ``(case, …)``."""
    h, free = operator.free.tip.h, operator.free
    heat, force = h * project(operator.warming, cases.heating), cases.steady
    if free.heat_counts:
        force = force - free.tip.theta * project(operator.structure.coupling_matrix, heat)
    return np.hstack([h * project(operator.mobility, force), heat])


def _begin(operator: DenseOperator, cases: Cases, velocity: Array) -> Array:
    """Return x, v and θ at t = 0, ``(case, state)``; w_-½ = v_0 - (h/2) M⁻¹ f_0 of central differences for v."""
    structure, h = operator.structure, operator.free.tip.h
    if not operator.free.heat_counts:
        velocity = cases.velocity
        force = cases.steady + cases.load_at(0.0)[:, None] * structure.load_direction
        force = force - project(structure.damping_matrix, velocity)
        force = force - project(structure.stiffness_matrix, cases.displacement)
        force = force - project(structure.coupling_matrix, cases.temperature)
        velocity = velocity - 0.5 * h * project(inverse(structure.mass), force)
    return np.hstack([cases.displacement, velocity, cases.temperature])


def _loads(free: FreeStep, cases: Cases, steps: int) -> Iterator[tuple[int, Array]]:
    """Yield the first of some steps and the loads in them, N, ``(step, lane)``."""
    begins, theta = int(free.heat_counts), free.tip.theta
    for first in range(begins, steps + 1, _CHUNK):
        stop = min(first + _CHUNK, steps + 1)
        loads = cases.load_at(np.arange(first - begins, stop, dtype=np.float64)[:, None] * free.tip.h)
        if begins:
            loads = theta * loads[1:] + (1 - theta) * loads[:-1]
        lanes = np.zeros((loads.shape[0], ROW))
        lanes[:, : cases.count] = loads
        yield first, lanes


def _judged(operator: DenseOperator, cases: Cases, w: Array, watched: Watch) -> Outcome:
    """Decide what became of each case by what theory knows: no unique solution, or a free step that grows."""
    contact, h = operator.contact, operator.free.tip.h
    jams = contact.factor(h, operator.contact_response(np.zeros(cases.count), cases.friction)[:, -1]) <= 0

    def explain(case: int) -> str:
        if jams[case]:
            return friction_message(h, float(cases.friction[case]), contact.name)
        return f"contact has no unique solution at h = {h:.6g} s ({contact.name} <= 0); take a smaller h"

    grows = operator.growth > operator.most
    grown = f"the free step grows {operator.growth:.6g}-fold at h = {h:.6g} s" if grows else None
    finite = watched.finite(tip_row.DISPLACEMENT, tip_row.VELOCITY, tip_row.TEMPERATURE, tip_row.IMPULSE)
    left = f"the state left the finite numbers at h = {h:.6g} s"
    return judged(finite, contact.factor(h, w) <= 0, explain, grown, left)


def operator_name(structure: Structure) -> str:
    """Return what a structure is stepped by, as ``plan`` says it: by modes where it can be."""
    if not needs_matrices(structure):
        return f"{structure.mechanical_size} + {structure.thermal_size} modes with the tip's own"
    states = 2 * structure.mechanical_size + structure.thermal_size
    reason = "the load does not act on the tip" if structure.damper is None else "damping couples the modes"
    return f"a dense matrix of {states} states, as {reason}: {states * states} products a step"
