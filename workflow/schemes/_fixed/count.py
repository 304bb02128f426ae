"""Balances that the next step does not count: the last step, and modes by matrices (see :mod:`.balance`)."""

from __future__ import annotations

import math

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import PACK
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
from workflow.models import Array
from workflow.schemes._fixed import balance
from workflow.schemes._fixed.balance import ELASTIC, KINETIC, Account, Dense
from workflow.schemes._fixed.contact import friction_heat
from workflow.schemes._fixed.free_motion import FreeStep, State, ended
from workflow.schemes._fixed.rows import Totals


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
    dissipated, given, load = spread(0.0, lane), spread(0.0, lane), pack(state.own.load, lane)
    sums, whole = account.sums, last or dense is not None
    if whole:
        for j in range(account.velocity_before.shape[0]):
            v, xi = _at_end(dense, step, state, j, load, lane)
            dissipated, given = balance.count_inputs(
                account, inputs, j, v, xi, step.tip.h, contact, dissipated, given, lane
            )
        balance.add_dissipation(account, dissipated, given, contact, lane)
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
