"""Balances of energy and heat of a fixed step, counted at its end.

The energy is that of all modes that move the contacts, relative to the particular solution for heat and constant loads.
In the v and ξ of the modes (:mod:`workflow.schemes._fixed.blocks`), with η = ξ + ℓ v, it is E = (m v² + ω² η²)/2; ℓ =
hθ and m = 1 of the θ-method, ℓ = h/2 and m = 1 - (hω/2)² of central differences, whose energy is (w² + ω² η_k η_k+1)/2
with w = w_k+½. An input that adds δv and δξ in a step is the impulse I = Ŵ δv + ℓ ω² δξ and the jump J = δξ. With
midpoint values (·)_m = (end + begin)/2 the energy residual is the sum over modes and steps of

    ΔE + hc v_m² - I v_m - ω² J η_m.

For the part of load and contact that acts at a contact Σ I v_m is (S_load - p) times the contact's velocity relative to
the particular solution; of several contacts the load is counted in the modes. That velocity is taken from the contact
law (``End.driven``), not from the modes, so that an impulse without the effect its law states shows in the residual.
The heat and the friction of a contact impulse are inputs besides. Damping that couples modes is one more impulse, -h C
v_m with the off-diagonal C. Energy that a contact law creates besides its impulse, as a contact spring where contact
begins and ends, is added (:func:`contact_gain`).

Of one contact the free step sums hc v_m² and, per unit impulse, (hc a - I) v_m - ω² J η_m, with the change a of v and
the inputs I and J by heat and friction; both are of the motion without the impulse p of the step, which then adds p
times the second, and p² times what a unit impulse takes from the motion that it causes (``Totals.square``). Else
matrices count inputs and damping at the step's end (:class:`Dense`).

The mean velocity is that of the power of an impact, p (v + v')/2, whatever θ is; on a casing that moves p (V + V')/2
of it is the casing's. Without heat the sum over the steps of a mode is

    -(2θ - 1) h² ω² Σ v_m² + (θ - 1/2) h [ω² ηv - (ω² (θ - 1/2) h + c/2) v²],

with brackets for changes from the first state to the last: no work of load, contact or casing accumulates in it, and a
rigid mode without damping leaves rounding. With θ-weighted velocities it would be -(θ - 1/2) (Δv² + ω² Δη²) in each
step, which counts the jump of each impact as an error of the scheme.
The largest energy is that of all step ends, of which few are computed. With v_ℓ = v + ℓ/h Δv, η_ℓ likewise,

    ΔE = I v_ℓ + ω² J η_ℓ - h c v_ℓ² - (ℓ/h - 1/2) (Δv² + ω² Δη²),    of central differences with v_m, η_m,

so that for ℓ >= h/2 no energy exceeds the last one computed by more than Σ (S_load - p) v_ℓ of the tip and
p √(2 max E) √(I² + ω² J²), with the inputs I, J by heat and friction of a unit impulse of contact. E is computed where
this bound exceeds the largest one so far. The roots are those of up to twice max E, so that few are taken.
The load counts as the step weights it, F_θ, in every representation of a structure. A quasi-static motion under it
leaves -2 (θ - 1/2) h ∫ k v² dt, half of which is the difference of F_θ from the mean of the load at the step's ends.

The heat residual is that of pᵀ (1b), with p the temperatures of ``Structure.uniform_rise``: the change of the content
H = pᵀC2 T less αJ + ∫pᵀq - ∫L dt, with the loss L = pᵀK2 T by the temperatures T as the step weights them. It is
rounding, whether the structure is full or reduced.

With the weight θ of a step's end the loss is summed as h Σ L over all step ends but the last, plus hθ L_end and
h (1-θ) L_0.

With the energy E, dissipation D less the work of loads and contact, heat content H, losses L, friction heat αJ and
heating Q = ∫pᵀq of a whole march the residuals are, and 0 where the denominator is 0,

    energy residual = (E_end - E_0 + D) / max E
    heat residual = (H_end - H_0 - αJ - Q + L) / (αJ + |Q| + ∫|dL| + Σ|c T_0|).

The balances run over whole steps: from t = 0 to the end of the last step, which lies at the duration
or, where the duration is no multiple of h, up to one step beyond it; those of central differences are h/2 longer at
either end, and that of heat is a step longer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import ROW, lane_rows, named_rows, rows_in
from workflow.kernels.packs import (
    Lane,
    Pack,
    fused,
    lanes_of,
    magnitude,
    pack,
    shared,
    some,
    spread,
    store,
    where,
)
from workflow.models import Array, Cases, ContactBasis, Structure, project, row_totals
from workflow.schemes._fixed.blocks import Blocks, modes_at
from workflow.schemes._fixed.contact import End, contact_gain, count_of, was_pressed
from workflow.schemes._fixed.free_motion import (
    PLACE,
    SPEED,
    FreeStep,
    InitialState,
    ModeWork,
    Moved,
    Spent,
    State,
    contact_heat,
    drives,
)
from workflow.schemes._fixed.law import TipStep
from workflow.schemes._fixed.rows import Totals

DAMPING, KINETIC, ELASTIC = range(3)
"""Coefficients of a mode, divided by φ_n² where φ_n scales its states: hc/4, energy per v² and energy per η²."""


class SparseRows(NamedTuple):
    """The entries of a matrix other than 0: those of row i from ``starts[i]`` up to ``starts[i + 1]``."""

    starts: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: Array


def sparse_rows(matrix: Array) -> SparseRows:
    """Return the entries of a matrix other than 0."""
    rows, columns = np.nonzero(matrix)
    return SparseRows(np.searchsorted(rows, np.arange(len(matrix) + 1)), columns, matrix[rows, columns])


class Dense(NamedTuple):
    """Balance of modes by matrices: of several contacts, where modes are coupled, near resonance with heat, or drift.

    States are v of all modes and then ξ of all. An input has the energy that it takes per 2 v_m, -(I + ℓ ω² J)/2, of
    all modes and then that per ξ' - h v/2, -ω² J: together -I v_m - ω² J (η_m + J/2).
    """

    outward: SparseRows
    """States per u and then η of all blocks as kernels scale them, ``(2 mode, 2 block)``."""
    off_diagonal: SparseRows
    """h times the off-diagonal damping, ``(mode, mode)``."""
    lagged: bool
    """Whether v at a step's beginning damps."""
    load: Array
    """Input per unit impulse of the load, without the part that acts on the tip, ``(mode,)``."""
    half_flexibility: Array
    """1/(2 ω²), 0 of rigid modes, ``(mode,)``."""
    pair_inputs: Array
    """Input per τ near resonance, ``(pair, 2 mode)``."""
    constant: Array
    """Input of constant loads on drifting blocks, ``(2 mode, lane)``."""
    contact_inputs: Array
    """Input by heat and friction of a unit impulse, ``(contact, 2 mode, lane)``."""
    losses: Array
    """Heat loss per τ, W, ``(thermal mode,)``."""
    velocity_before: Array
    """v at the last step's end, ``(mode, lane)``."""
    modal_states: Array
    """v and ξ at the step's end, ``(2 mode, lane)``."""
    inputs: Array
    """All inputs of that step, ``(2 mode, lane)``."""


class Account(NamedTuple):
    """Coefficients and sums of the balances of a block; ``None`` in kernels where no balances are asked for."""

    modes: Array
    """``(mode, coefficient)``."""
    sums: Totals
    h: float
    """s."""
    energy_lever: float
    """ℓ, s."""
    load_share: float
    """Fraction of the load that acts on the tip."""
    heat_theta: float
    """Weight of the temperatures at a step's end in its heat loss."""
    loss_of_heat: float
    """Heat loss at the step's end per heat of one contact in it, 1/s."""
    unbounded: float
    """0, or ∞ of the θ-method with θ < 1/2, whose free motion may gain energy."""
    dense: Dense | None
    """``None`` where the free step of one contact counts the work of each mode."""


@inlined
def dense_of(account: Account | None) -> Dense | None:
    """Return the matrices of an account, ``None`` where free steps count the work of modes, or nothing does."""
    return None if account is None else account.dense


@inlined
def lay_out_account(account: Account | None, dense: Dense | None) -> None:
    """Assert the strides of the rows, as :func:`~workflow.schemes._fixed.free_motion.lay_out` does for a march."""
    if account is not None:
        assert account.modes.shape[1] == ELASTIC + 1
    if dense is not None:
        assert dense.contact_inputs.shape[2] == ROW
        assert dense.velocity_before.shape[1] == ROW


@inlined
def _add_to(row: Array, numbers: Pack, lane: Lane) -> None:
    """Add numbers to a row."""
    store(row, lane, pack(row, lane) + numbers)


@inlined
def count_work(
    account: Account | None,
    step: TipStep,
    end: End,
    load: Pack,
    moved: Moved,
    state: State,
    c: int,
    engaged: bool,
    lane: Lane,
) -> Pack:
    """Add the friction heat of a step at contact ``c`` to the sums; return what load and contact there took, J."""
    if account is None:
        return spread(0.0, lane)
    sums, act = account.sums, state.acts[c]
    before, after = pack(act.relative, lane), end.driven - moved.thermal_velocity
    if engaged:
        for j in range(count_of(state.coupling, state.acts)):
            heat = pack(state.own.alpha, lane) * pack(state.acts[j].impulse, lane)
            after -= shared(step.thermal_velocity, (c, j), lane) * heat
        _add_to(sums.friction_heat, pack(state.own.alpha, lane) * end.acting, lane)
        _add_to(sums.energy_bound, end.acting * pack(sums.work_bound, lane), lane)
    store(act.relative, lane, after)
    impulse = account.load_share * load - end.acting
    working = fused(spread(account.energy_lever / step.h, lane), after - before, before)
    store(sums.energy_bound, lane, fused(impulse, working, pack(sums.energy_bound, lane)))
    return fused(impulse, -0.5 * (after + before), contact_gain(step, end, act, lane))


@inlined
def count_step(
    account: Account | None,
    dense: Dense | None,
    step: FreeStep,
    state: State,
    spent: Spent,
    load: Pack,
    taken: Pack,
    waits: bool,
    last: bool,
    lane: Lane,
) -> None:
    """Add what load and contact have ``taken`` in a step, what damping and inputs took, and the heat lost, to the sums.

    The energy at the step's end is computed where it may be the largest.
    """
    if account is None:
        return
    sums = account.sums
    if dense is None:
        damped, loss = spent.damped, spent.heat
        if was_pressed(state.own, lane):
            p = pack(state.acts[0].impulse, lane)
            heat = pack(state.own.alpha, lane) * p
            given = fused(pack(sums.square, lane), p, spent.by_impulse)
            damped = fused(fused(pack(state.own.alpha, lane), spent.by_heat, given), p, damped)
            loss = fused(spread(account.loss_of_heat, lane), heat, loss)
    else:
        damped, loss = _count_modes(dense, account, step, state, load, lane)
    _add_to(sums.dissipated, taken + damped, lane)
    if state.tau.shape[0] > 0:
        loss = (account.h * account.heat_theta if last else account.h) * (loss + pack(sums.settled_loss, lane))
        _add_to(sums.lost, loss, lane)
        _add_to(sums.turned_over, magnitude(loss), lane)
    if last or dense is not None or some(pack(sums.energy_bound, lane) > pack(sums.largest_energy, lane)):
        _measure(dense, account, step, state, waits, lane)


@inlined
def _count_modes(
    dense: Dense, account: Account, step: FreeStep, state: State, load: Pack, lane: Lane
) -> tuple[Pack, Pack]:
    """Return what damping and inputs took from modes by matrices, J, and the heat lost at the step's end, W."""
    sums, modes, loss = account.sums, dense.velocity_before.shape[0], spread(0.0, lane)
    _fill_dense(dense, account, step, state, load, lane)
    dissipated = pack(sums.square, lane)
    for j in range(modes):
        v, before = pack(dense.modal_states, (j, lane)), pack(dense.velocity_before, (j, lane))
        twice = v + before
        between = fused(spread(-0.5 * account.h, lane), before, pack(dense.modal_states, (modes + j, lane)))
        dissipated = fused(pack(dense.inputs, (j, lane)), twice, dissipated)
        dissipated = fused(pack(dense.inputs, (modes + j, lane)), between, dissipated)
        dissipated = fused(shared(account.modes, (j, DAMPING), lane) * twice, twice, dissipated)
        store(dense.velocity_before, (j, lane), v)
    for k in range(state.tau.shape[0]):
        loss = fused(shared(dense.losses, (k,), lane), pack(state.tau, (k, 0, lane)), loss)
    return dissipated, loss


@inlined
def _modal(dense: Dense | None, state: State, p: Pack, j: int, lane: Lane) -> tuple[Pack, Pack]:
    """Return v and ξ of mode j at the step's end, with an impulse p of one contact that it has not received yet."""
    if dense is None:
        v, xi = pack(state.motion, (j, SPEED, lane)), pack(state.motion, (j, PLACE, lane))
        by_speed, by_place = pack(state.drives, (0, j, SPEED, lane)), pack(state.drives, (0, j, PLACE, lane))
        return fused(by_speed, p, v), fused(by_place, p, xi)
    return pack(dense.modal_states, (j, lane)), pack(dense.modal_states, (dense.velocity_before.shape[0] + j, lane))


@part
def _measure(dense: Dense | None, account: Account, step: FreeStep, state: State, waits: bool, lane: Lane) -> None:
    """Compute the energy at a step's end, and update the largest one; a NaN stays.

    Out of line: so seldom that the step is faster without it.
    """
    sums, energy, waiting = account.sums, spread(0.0, lane), spread(0.0, lane)
    if waits and was_pressed(state.own, lane):
        waiting = pack(state.acts[0].impulse, lane)
    for j in range(account.modes.shape[0]):
        v, xi = _modal(dense, state, waiting, j, lane)
        eta = xi + account.energy_lever * v
        energy = fused(shared(account.modes, (j, KINETIC), lane) * v, v, energy)
        energy = fused(shared(account.modes, (j, ELASTIC), lane) * eta, eta, energy)
    largest = pack(sums.largest_energy, lane)
    store(sums.last_energy, lane, energy)
    store(sums.energy_bound, lane, energy + account.unbounded)
    largest = where(energy <= largest, largest, energy)
    store(sums.largest_energy, lane, largest)
    work = pack(sums.work_bound, lane)
    if some(2.0 * pack(sums.input_square, lane) * largest > work * work):
        for i in range(*lanes_of(lane)):
            sums.work_bound[i] = 2.0 * math.sqrt(sums.input_square[i] * sums.largest_energy[i])


@part
def _fill_dense(dense: Dense, account: Account, step: FreeStep, state: State, load: Pack, lane: Lane) -> None:
    """Compute the states of the modes at the step's end, the inputs of the step, and Σ ω² J²/2 of these."""
    blocks, modes, acts = state.motion.shape[0], dense.velocity_before.shape[0], state.acts
    outward, damping = dense.outward, dense.off_diagonal
    for i in range(2 * modes):
        total, inputs = spread(0.0, lane), pack(dense.constant, (i, lane))
        for k in range(outward.starts[i], outward.starts[i + 1]):
            at = outward.columns[k] % blocks, outward.columns[k] // blocks, lane
            total += shared(outward.values, (k,), lane) * pack(state.motion, at)
        store(dense.modal_states, (i, lane), total)
        if i < modes:
            inputs += shared(dense.load, (i,), lane) * load
        for pair in range(step.pair_heat.size):
            tau = pack(state.tau_before, (step.pair_heat[pair], 0, lane))
            inputs += shared(dense.pair_inputs, (pair, i), lane) * tau
        store(dense.inputs, (i, lane), inputs)
    for c in range(count_of(state.coupling, acts)):
        p = pack(acts[c].impulse, lane)
        for i in range(2 * modes if some(~(magnitude(p) <= 0.0)) else 0):
            _add_to(dense.inputs[i], pack(dense.contact_inputs, (c, i, lane)) * p, lane)
    square = spread(0.0, lane)
    for i in range(modes):
        inputs, jump = pack(dense.inputs, (i, lane)), pack(dense.inputs, (modes + i, lane))
        square += shared(dense.half_flexibility, (i,), lane) * jump * jump
        for k in range(damping.starts[i], damping.starts[i + 1]):
            begun = pack(dense.velocity_before, (damping.columns[k], lane))
            ended = pack(dense.modal_states, (damping.columns[k], lane))
            inputs += 0.25 * shared(damping.values, (k,), lane) * (2.0 * begun if dense.lagged else begun + ended)
        store(dense.inputs, (i, lane), inputs)
    store(account.sums.square, lane, square)


REST = 1e-12
"""Fraction of the velocity that the tip load could give within the run, below which the tip is at rest: a few thousand
roundings."""


class Balances:
    """Balances of a batch.

    Attributes
    ----------
    rows
        Named rows for the march, ``(row, case)``, with their initial values.
    relative
        Velocity of each contact relative to the particular solution at t = 0, m/s, ``(case, contact)``.
    """

    def __init__(self, structure: Structure, blocks: Blocks, free: FreeStep, cases: Cases, begun: InitialState) -> None:
        modal, step = blocks.modal, blocks.step
        self._blocks, self._free, self._cases, self._begun = blocks, free, cases, begun
        self._content = structure.content @ modal.heat_shapes
        self._loss = self._content * modal.rate
        self._at_tip = modes_at(modal.normal).astype(float) if modal.is_single else np.ones_like(modal.load)
        self._kinetic = 1.0 - modal.frequency**2 * (step.lever - step.energy_lever) ** 2
        self._kinetic -= 0.5 * step.tip.h * modal.damping if step.lagged else 0.0
        self._is_dense = not modal.is_single or blocks.pairs.size + begun.drifting.size > 0

        v, xi = blocks.in_modes(begun.states)
        inputs = np.stack([_energy_rows(blocks, each) for each in contact_heat(blocks, cases)])
        sums, self.relative = self._first_sums(v, xi, inputs[0]), project(modal.normal, v.T)
        self._unscale = self._at_tip
        if self._is_dense:
            steady = np.zeros((2, blocks.damping.size, cases.count))
            steady[0, begun.drifting] = begun.steady
            constant = _energy_rows(blocks, steady)
            self.rows = {"velocity_before": self._at_tip[:, None] * v, "contact_inputs": inputs, "constant": constant}
        else:
            self._unscale = self._at_tip / np.where(self._at_tip, modal.normal[0], 1.0)
            own, doubly = self._at_tip[:, None] * drives(blocks, cases)[0], 0.5 * step.tip.h * modal.damping[:, None]
            impulse = self._at_tip[:, None] * inputs[0, : v.shape[0]]
            named_rows(Totals, sums).square += row_totals(((0.5 * doubly * own[0] + impulse) * own[0]).T)
            named_rows(Totals, sums).square += row_totals((inputs[0, v.shape[0] :] * own[1]).T)
            self.rows = {"impulse_work": self._unscale[:, None] * (doubly * own[0] + impulse)}
        self.rows["sums"] = sums

    def _first_sums(self, v: Array, xi: Array, inputs: Array) -> Array:
        """Return the sums at t = 0 as rows, of modes with v and ξ and the ``inputs`` of a unit impulse of contact."""
        modal, step, begun, at_tip = self._blocks.modal, self._blocks.step, self._begun, self._at_tip
        omega2, n = modal.frequency**2, modal.frequency.size
        eta = xi + step.energy_lever * v
        energy = 0.5 * (project(at_tip * self._kinetic, v.T**2) + project(at_tip * omega2, eta.T**2))
        rows = np.zeros((rows_in(Totals), self._cases.count))
        sums = named_rows(Totals, rows)
        sums.first_energy = sums.last_energy = sums.largest_energy = energy
        sums.energy_bound = energy + self._unbounded
        sums.settled_loss = settled = project(self._loss, begun.settled.T)
        sums.lost = step.tip.h * (1 - step.heat_theta) * (settled + project(self._loss, begun.heat.T))
        sums.turned_over = np.abs(sums.lost)
        impulses, pulls = step.energy_lever * inputs[n:] - 2.0 * inputs[:n], inputs[n:]
        size2 = project(at_tip / np.maximum(self._kinetic, np.finfo(float).tiny), impulses.T**2)
        size2 += project(2.0 * at_tip * _half_flexibility(modal), pulls.T**2)
        sums.input_square = size2
        sums.work_bound = 2.0 * np.sqrt(energy * size2)
        sums.square = project(at_tip * _half_flexibility(modal), pulls.T**2)
        return rows

    @property
    def _unbounded(self) -> float:
        step = self._blocks.step
        return np.inf if step.energy_lever < 0.5 * step.tip.h else 0.0

    def account(self, lanes: Mapping[str, Array]) -> Account:
        """Return the coefficients and sums for kernels, with the lanes of :attr:`rows`."""
        modal, step = self._blocks.modal, self._blocks.step
        modes = np.stack([0.25 * step.tip.h * modal.damping, 0.5 * self._kinetic, 0.5 * modal.frequency**2], axis=1)
        return Account(
            modes=modes * self._unscale[:, None] ** 2,
            sums=named_rows(Totals, lanes["sums"]),
            h=step.tip.h,
            energy_lever=step.energy_lever,
            load_share=float(modal.is_single),
            heat_theta=step.heat_theta,
            loss_of_heat=float(self._loss @ step.heat_gain[0]),
            unbounded=self._unbounded,
            dense=self._dense(lanes) if self._is_dense else None,
        )

    def work(self, lanes: Mapping[str, Array]) -> ModeWork | None:
        """Return the coefficients by which free steps count the work of modes; ``None`` where matrices do."""
        if self._is_dense:
            return None
        blocks, step = self._blocks, self._blocks.step
        heat = _energy_rows(blocks, blocks.of_heat(step.heat_gain.T))[blocks.modal.frequency.size :, 0]
        return ModeWork(
            damping=self._unscale**2 * 0.25 * step.tip.h * blocks.modal.damping,
            impulse=lanes["impulse_work"],
            heat=0.5 * self._unscale * heat,
            loss=self._loss / blocks.heat_scale,
        )

    def _dense(self, lanes: Mapping[str, Array]) -> Dense:
        """Return the matrices for the balances of modes where these are not blocks, are drifting or near resonance."""
        blocks, modal, step, C = self._blocks, self._blocks.modal, self._blocks.step, self._blocks.modal.damping_matrix
        n, count = modal.frequency.size, blocks.damping.size
        unscale = np.divide(1.0, blocks.scale, out=np.zeros(count), where=modes_at(blocks.scale[None]))
        outward = np.eye(2 * n) if blocks.outward is None else blocks.outward.reshape(2 * n, 2 * count)
        load = np.zeros(n) if modal.is_single else modal.load
        pulls = np.zeros((2, count, len(blocks.pairs)))
        for pair, (j, k) in enumerate(blocks.pairs):
            pulls[:, j, pair] = blocks.thermal_load[:, j, k] / blocks.heat_scale[k]
        return Dense(
            outward=sparse_rows(outward * np.tile(unscale, 2)),
            off_diagonal=sparse_rows(np.zeros((n, n)) if C is None else step.tip.h * (C - np.diag(modal.damping))),
            lagged=step.lagged,
            load=-0.5 * load,
            half_flexibility=_half_flexibility(modal),
            pair_inputs=np.ascontiguousarray(_energy_rows(blocks, pulls).T),
            constant=lanes["constant"],
            contact_inputs=lanes["contact_inputs"],
            losses=self._loss / self._blocks.heat_scale,
            velocity_before=lanes["velocity_before"],
            modal_states=lane_rows(2 * n),
            inputs=lane_rows(2 * n),
        )

    def result(self, ended: Mapping[str, Array], elapsed: float) -> Balance:
        """Return the balances after ``elapsed`` seconds, from the rows of the march at its end."""
        modal, begun = self._blocks.modal, self._begun
        warmed_for = elapsed + self._blocks.step.tip.h * self._blocks.step.is_central
        warmed = ended["tau"][:, 0] / self._blocks.heat_scale[:, None] - begun.heat + warmed_for * begun.warming_modes
        initial = project(np.abs(self._content), np.abs(begun.heat + begun.settled).T)
        heating = warmed_for * project(self._content, project(modal.heat_shapes.T, self._cases.heating))
        sums, gained = named_rows(Totals, ended["sums"]), project(self._content, warmed.T)
        return Balance(sums, gained, initial, heating, self._rest_energy(elapsed))

    def _rest_energy(self, elapsed: float) -> Array:
        """Return the energy below which the tip is at rest, J, ``(case,)``.

        It is that of :data:`REST` times a bound of the load's impulse over ``elapsed`` seconds. Where load and contact
        force cancel at a gap of 0 nothing else moves, and energy and residual are both rounding.
        """
        modal, cases, begun = self._blocks.modal, self._cases, self._begun
        mobility, h = np.sum(modal.load**2), self._free.contact.h
        drifts = row_totals(np.abs(begun.steady).T) / h
        impulse = elapsed * (np.abs(cases.mean) + cases.load_harmonics.reach)
        return np.asarray(0.5 * mobility * (REST * impulse) ** 2 + 0.5 * (REST * elapsed * drifts) ** 2)


def _energy_rows(blocks: Blocks, states: Array) -> Array:
    """Return the input, see :class:`Dense`, that adds ``states`` to blocks, ``(2 mode, column)``."""
    v, xi = blocks.in_modes(states)
    inertia, pulled = blocks.step.inertia, blocks.modal.frequency[:, None] ** 2 * xi
    impulse = project(inertia, v.T).T if inertia.ndim == 2 else inertia[:, None] * v
    return np.concatenate([-0.5 * impulse - blocks.step.energy_lever * pulled, -pulled])


def _half_flexibility(modal: ContactBasis) -> Array:
    """Return 1/(2 ω²), 0 of rigid modes, ``(mode,)``."""
    return np.divide(0.5, modal.frequency**2, out=np.zeros_like(modal.frequency), where=modal.frequency > 0)


class Balance(NamedTuple):
    """Balances of cases after their march, J, ``(case,)``."""

    totals: Any
    """:class:`Totals`, or an array with the fields that they share with it."""
    gained: Array
    """H_end - H_0."""
    initial: Array
    """Σ|c T_0|."""
    heating: Array
    """Q = ∫pᵀq."""
    rest: Array | float = 0.0
    """Energy below which all is rounding: the least value of max E."""

    def residuals(self) -> dict[str, Array]:
        """Return ``energy_residual`` and ``heat_residual``, ``(case,)``."""
        totals, friction = self.totals, self.totals.friction_heat
        change = totals.last_energy - totals.first_energy + totals.dissipated
        gained = self.gained - friction - self.heating + totals.lost
        turned = friction + np.abs(self.heating) + totals.turned_over + self.initial
        largest = np.maximum(totals.largest_energy, self.rest)
        return {"energy_residual": ratio(change, largest), "heat_residual": ratio(gained, turned)}


def ratio(part: Array, whole: Array) -> Array:
    """Return part/whole, 0 where the whole is 0."""
    nothing = whole == 0
    return np.where(nothing, 0.0, part / np.where(nothing, 1.0, whole))
