"""Balances of modes: coefficients and sums of a batch, and what the next step does not count.

That is the last step, and modes by matrices. The equations are those of :mod:`workflow.schemes._fixed.balance`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import PACK, lane_rows, named_rows, rows_in
from workflow.kernels.packs import (
    Lane,
    Pack,
    fused,
    lanes_of,
    narrow,
    pack,
    shared,
    some,
    spread,
    store,
    where,
)
from workflow.models import Array, Cases, Structure, project
from workflow.schemes._fixed import balance
from workflow.schemes._fixed.balance import ELASTIC, KINETIC, Account, Balance, Content, Dense
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.contact import friction_heat
from workflow.schemes._fixed.decoupled import Decoupled, modes_at_tip
from workflow.schemes._fixed.free_motion import HEAT_INPUT, FreeStep, InitialState, State, contact_heat, ended
from workflow.schemes._fixed.rows import Own, Totals


@inlined
def count_step(account: Account | None, step: FreeStep, state: State, last: bool, lanes: int) -> None:
    """Add the part of a step that the next one does not count to the balances, and update the largest energy."""
    if account is not None:
        _count(state.dense, account, step, state, last, lanes)


@part
def _count(dense: Dense | None, account: Account, step: FreeStep, state: State, last: bool, lanes: int) -> None:
    _fill_dense(dense, account, step.coupled, step, state, lanes)
    for first in range(0, lanes, PACK):
        _count_pack(dense, account, step, state, last, narrow(first))


@inlined
def _count_pack(dense: Dense | None, account: Account, step: FreeStep, state: State, last: bool, lane: Lane) -> None:
    contact, inputs = _inputs(dense, account, pack(state.own.impulse, lane), lane)
    taken, load = balance.nothing_taken(lane), pack(state.own.load, lane)
    sums, whole = account.sums, last or dense is not None
    if whole:
        for j in range(account.velocity_before.shape[0]):
            v, xi = _at_end(dense, step, state, j, load, lane)
            taken = balance.count_inputs(account, inputs, j, v, xi, contact, taken, lane)
        balance.add_dissipation(account, taken, contact, lane)
    if whole or some(pack(sums.energy_bound, lane) > pack(sums.largest_energy, lane)):
        _energy(dense, account, step, state, load, lane)
    if last:
        loss = spread(0.0, lane)
        for k in range(state.tau.shape[0]):
            loss = balance.with_loss(account, k, pack(state.tau, (k, lane)), loss, lane)
        balance.add_loss(account, step.tip.h * account.heat_theta, loss, friction_heat(state.own, lane), lane)


@inlined
def _inputs(dense: Dense | None, account: Account, contact: Pack, lane: Lane) -> tuple[Pack, Array]:
    """Return the factor of the inputs of a step, and the inputs."""
    return (contact, account.contact_inputs) if dense is None else (spread(1.0, lane), dense.inputs)


@inlined
def _at_end(dense: Dense | None, step: FreeStep, state: State, j: int, load: Pack, lane: Lane) -> tuple[Pack, Pack]:
    """Return v and ξ of mode j at the step's end."""
    if dense is None:
        return ended(None, step, state, j, load, pack(state.own.impulse, lane), lane)
    return pack(dense.modal_states, (j, lane)), pack(dense.modal_states, (dense.off_diagonal.shape[0] + j, lane))


@inlined
def _energy(dense: Dense | None, account: Account, step: FreeStep, state: State, load: Pack, lane: Lane) -> None:
    """Compute the energy at the end of the last step, and update the largest one; a NaN stays."""
    sums, energy = account.sums, spread(0.0, lane)
    for j in range(account.velocity_before.shape[0]):
        v, xi = _at_end(dense, step, state, j, load, lane)
        eta = xi + account.energy_lever * v
        energy = fused(shared(account.modes, (j, KINETIC), lane) * v, v, energy)
        energy = fused(shared(account.modes, (j, ELASTIC), lane) * eta, eta, energy)
    largest = pack(sums.largest_energy, lane)
    store(sums.last_energy, lane, energy)
    store(sums.energy_bound, lane, energy + account.unbounded)
    store(sums.largest_energy, lane, where(energy <= largest, largest, energy))
    for i in range(*lanes_of(lane)):
        sums.work_bound[i] = sums.input_size[i] * math.sqrt(2.0 * sums.largest_energy[i])


@part
def _add_product(matrix: Array, states: Array, sums: Array, lanes: int) -> None:
    """Add matrix · states to ``sums``, ``(row, lane)``."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            factor = matrix[i, j]
            if factor != 0.0:
                for lane in range(lanes):
                    sums[i, lane] += factor * states[j, lane]


@inlined
def _fill_dense(
    dense: Dense | None, account: Account, coupled: Array | None, step: FreeStep, state: State, lanes: int
) -> None:
    """Compute the states of the modes at the step's end and the inputs of the step, where balances need matrices."""
    if dense is None:
        return
    blocks, modes, own = state.motion.shape[0], dense.off_diagonal.shape[0], state.own
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        contact, load = pack(own.impulse, lane), pack(own.load, lane)
        for j in range(blocks):
            u, eta = ended(coupled, step, state, j, load, contact, lane)
            store(dense.states, (j, lane), u)
            store(dense.states, (blocks + j, lane), eta)
        for i in range(2 * modes):
            inputs = pack(dense.constant, (i, lane)) + pack(account.contact_inputs, (i, lane)) * contact
            if i < modes:
                inputs += shared(dense.load, (i,), lane) * load
            for pair in range(step.pair_heat.size):
                tau = pack(state.tau_paired, (step.pair_heat[pair], lane))
                inputs += shared(dense.pair_inputs, (pair, i), lane) * tau
            store(dense.inputs, (i, lane), inputs)
            store(dense.modal_states, (i, lane), spread(0.0, lane))
    _add_product(dense.outward, dense.states, dense.modal_states, lanes)
    _damp(dense, account.velocity_before, account.sums, lanes)


@part
def _damp(dense: Dense, velocity_before: Array, sums: Totals, lanes: int) -> None:
    """Add off-diagonal damping to the inputs, and store Σ ω² J²/2 of all."""
    modes = dense.off_diagonal.shape[0]
    for lane in range(lanes):
        sums.square[lane] = 0.0
    for i in range(modes):
        for lane in range(lanes):
            sums.square[lane] += dense.half_flexibility[i] * dense.inputs[modes + i, lane] ** 2
        for j in range(modes):
            factor = 0.25 * dense.off_diagonal[i, j]
            for lane in range(lanes):
                begun = velocity_before[j, lane]
                damps = 2.0 * begun if dense.lagged else begun + dense.modal_states[j, lane]
                dense.inputs[i, lane] += factor * damps


REST = 1e-12
"""Fraction of the velocity that the tip load could give within the run, below which the tip is at rest: a few thousand
roundings."""


class Balances:
    """Balances of a batch.

    Attributes
    ----------
    rows
        Named rows for the march, ``(row, case)``, with their initial values.
    """

    def __init__(self, structure: Structure, blocks: Blocks, free: FreeStep, cases: Cases, begun: InitialState) -> None:
        modal, step = blocks.modal, blocks.step
        self._blocks, self._free, self._cases, self._begun = blocks, free, cases, begun
        self._content = structure.content @ modal.heat_shapes
        self._loss = self._content * modal.rate
        self._load_direction = structure.load_direction
        self._at_tip = np.where(modal.is_coupled, 1.0, modes_at_tip(modal.tip))
        self._kinetic = modal.mass - modal.frequency**2 * (step.lever - step.energy_lever) ** 2
        self._kinetic -= 0.5 * step.tip.h * modal.damping if step.lagged else 0.0
        self._is_dense = modal.is_coupled or blocks.pairs.size + begun.drifting.size > 0

        v, xi = blocks.in_modes(begun.states)
        massless = modal.mass == 0
        self._moving = 0.5 * project((step.tip.h * modal.frequency[massless]) ** 2, v[massless].T ** 2)
        inputs, scaled, self._unscale = _energy_rows(blocks, contact_heat(blocks, cases)), self._at_tip, self._at_tip
        sums = self._first_sums(v, xi, inputs)
        if self._is_dense:
            steady = np.zeros((2, blocks.damping.size, cases.count))
            steady[0, begun.drifting] = begun.steady
            self.rows = {"constant": _energy_rows(blocks, steady)}
        else:
            scaled = self._at_tip * modal.tip
            self._unscale = self._at_tip / np.where(self._at_tip, modal.tip, 1.0)
            inputs *= np.tile(self._unscale, 2)[:, None]
            self.rows = {}
        self.rows |= {"sums": sums, "velocity_before": scaled[:, None] * v, "contact_inputs": inputs}

    def _first_sums(self, v: Array, xi: Array, inputs: Array) -> Array:
        """Return the sums at t = 0 as rows, of modes with v and ξ and the ``inputs`` of a unit impulse of contact."""
        modal, step, begun, at_tip = self._blocks.modal, self._blocks.step, self._begun, self._at_tip
        omega2, n = modal.frequency**2, modal.tip.size
        eta = xi + step.energy_lever * v
        energy = 0.5 * (project(at_tip * self._kinetic, v.T**2) + project(at_tip * omega2, eta.T**2))
        rows = np.zeros((rows_in(Totals), self._cases.count))
        sums = named_rows(Totals, rows)
        sums.first_energy = sums.last_energy = sums.largest_energy = energy
        sums.energy_bound = energy + self._unbounded
        sums.relative = project(modal.tip, v.T)
        sums.settled_loss = settled = project(self._loss, begun.settled.T)
        sums.lost = -step.tip.h * step.heat_theta * (settled + project(self._loss, begun.heat.T))
        if step.heat_counts and not self._is_dense:  # the first step counts the damping of a step that ends at t = 0
            sums.dissipated = -project(step.tip.h * at_tip * modal.damping, v.T**2)
        impulses, pulls = step.energy_lever * inputs[n:] - 2.0 * inputs[:n], inputs[n:]
        size2 = project(at_tip / np.maximum(self._kinetic, np.finfo(float).tiny), impulses.T**2)
        size2 += project(2.0 * at_tip * _half_flexibility(modal), pulls.T**2)
        sums.input_size = np.sqrt(size2)
        sums.work_bound = np.sqrt(2.0 * energy * size2)
        sums.square = project(at_tip * _half_flexibility(modal), pulls.T**2)
        return rows

    @property
    def _unbounded(self) -> float:
        step = self._blocks.step
        return np.inf if step.energy_lever < 0.5 * step.tip.h else 0.0

    def account(self, lanes: Mapping[str, Array]) -> Account:
        """Return the coefficients and sums for kernels, with the lanes of :attr:`rows`."""
        blocks, modal, step = self._blocks, self._blocks.modal, self._blocks.step
        losses = self._loss / modal.heat_scale
        modes = np.stack([0.25 * step.tip.h * modal.damping, 0.5 * self._kinetic, 0.5 * modal.frequency**2], axis=1)
        return Account(
            modes=modes * self._unscale[:, None] ** 2,
            contact_inputs=lanes["contact_inputs"],
            losses=losses,
            velocity_before=lanes["velocity_before"],
            sums=named_rows(Totals, lanes["sums"]),
            h=step.tip.h,
            energy_lever=step.energy_lever,
            load_share=float(self._load_direction[-1]),
            thermal_velocity=np.sum(blocks.tip * blocks.thermal_response(step.heat_gain[:, None])[..., 0]),
            heat_loss=np.sum(losses * self._free.heat_modes[:, HEAT_INPUT]) if step.heat_counts else 0.0,
            heat_theta=step.heat_theta,
            unbounded=self._unbounded,
        )

    def dense(self, lanes: Mapping[str, Array]) -> Dense | None:
        """Return the matrices for the balances of modes where these are not blocks, are drifting or near resonance."""
        if not self._is_dense:
            return None
        blocks, modal, step, C = self._blocks, self._blocks.modal, self._blocks.step, self._blocks.modal.damping_matrix
        n, count = modal.tip.size, blocks.damping.size
        unscale = np.divide(1.0, blocks.scale, out=np.zeros(count), where=modes_at_tip(blocks.scale))
        outward = np.eye(2 * n) if blocks.outward is None else blocks.outward.reshape(2 * n, 2 * count)
        load = np.zeros(n) if modal.load is None else modal.load - self._load_direction[-1] * modal.tip
        pulls = np.zeros((2, count, len(blocks.pairs)))
        for pair, (j, k) in enumerate(blocks.pairs):
            pulls[:, j, pair] = blocks.thermal_load[:, j, k] / modal.heat_scale[k]
        return Dense(
            outward=outward * np.tile(unscale, 2),
            off_diagonal=np.zeros((n, n)) if C is None else step.tip.h * (C - np.diag(modal.damping)),
            lagged=step.lagged,
            load=-0.5 * load,
            half_flexibility=_half_flexibility(modal),
            pair_inputs=np.ascontiguousarray(_energy_rows(blocks, pulls).T),
            constant=lanes["constant"],
            states=lane_rows(2 * count),
            modal_states=lane_rows(2 * n),
            inputs=lane_rows(2 * n),
        )

    def result(self, ended: Mapping[str, Array], elapsed: float) -> Balance:
        """Return the balances after ``elapsed`` seconds, from the rows of the march at its end."""
        modal, begun = self._blocks.modal, self._begun
        sums, own = named_rows(Totals, ended["sums"]), named_rows(Own, ended["own"])
        if not self._free.heat_counts:
            sums.friction_heat -= own.alpha * own.impulse
        warmed = ended["tau"] / modal.heat_scale[:, None] - begun.heat + elapsed * begun.warming_modes
        initial = project(np.abs(self._content), np.abs(begun.heat + begun.settled).T)
        heating = elapsed * project(self._content, project(modal.heat_shapes.T, self._cases.heating))
        content = Content(project(self._content, warmed.T), initial, heating)
        return Balance(sums, content, self._rest_energy(elapsed) + self._moving)

    def _rest_energy(self, elapsed: float) -> Array:
        """Return the energy below which the tip is at rest, J, ``(case,)``.

        It is that of :data:`REST` times a bound of the load's impulse over ``elapsed`` seconds. Where load and contact
        force cancel at a gap of 0 nothing else moves, and energy and residual are both rounding.
        """
        modal, cases, begun = self._blocks.modal, self._cases, self._begun
        mobility, h = np.sum(modal.mass * modal.tip**2), self._free.tip.h
        drifts = np.abs(begun.steady).sum(axis=0) / h
        impulse = elapsed * (np.abs(cases.mean) + cases.load_harmonics.reach)
        return np.asarray(0.5 * mobility * (REST * impulse) ** 2 + 0.5 * (REST * elapsed * drifts) ** 2)


def _energy_rows(blocks: Blocks, states: Array) -> Array:
    """Return the input, see :class:`Dense`, that adds ``states`` to blocks, ``(2 mode, column)``."""
    v, xi = blocks.in_modes(states)
    inertia, pulled = blocks.step.inertia, blocks.modal.frequency[:, None] ** 2 * xi
    impulse = project(inertia, v.T).T if inertia.ndim == 2 else inertia[:, None] * v
    return np.concatenate([-0.5 * impulse - blocks.step.energy_lever * pulled, -pulled])


def _half_flexibility(modal: Decoupled) -> Array:
    """Return 1/(2 ω²), 0 of rigid modes, ``(mode,)``."""
    return np.divide(0.5, modal.frequency**2, out=np.zeros_like(modal.frequency), where=modal.frequency > 0)
