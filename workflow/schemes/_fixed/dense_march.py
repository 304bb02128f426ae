"""The march of a structure that modes do not separate: one matrix for all states, contact by the scheme's law.

The θ-method and central differences share it. A free step gives velocities V [x, v, θ] and temperatures D θ; a load and
an impulse of contact act on velocities by the columns Ŵ⁻¹ b and Ŵ⁻¹ (e_n - µ t + α hθ K12 T̂⁻¹ e_n), and
x' = x + h (θ v' + (1-θ) v). Central differences have x_k, w_k-½ and θ_k for [x, v, θ] and θ = 1. Contact laws
(:mod:`workflow.schemes._fixed.contact`) and the casing's motion (:mod:`workflow.schemes._fixed.drive`) are those of
modes: the tip's velocity without contact is known with the load in it, so that a law is given no load.
"""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import PACK, ROW
from workflow.kernels.packs import narrow, pack, spread, store
from workflow.schemes._fixed import case_row, tip_row, total_row
from workflow.schemes._fixed.contact import Free, Law, TipStep, contact_gain, meet
from workflow.schemes._fixed.dense_balance import Account, add_dissipation, count_lost_heat, multiply, store_energy
from workflow.schemes._fixed.drive import turn_drive
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.stepping import count_stored, store_end

CONTACT_IMPULSE, CONTACT_PLACE, CONTACT_SPEED = range(3)
"""Rows of what contact leaves: the impulse that acts on the states [N s], place and velocity of the tip ahead."""


class FreeStep(NamedTuple):
    """A free step, and what load and heat at the tip do in it."""

    tip: TipStep
    velocity: Array
    """V, ``(mechanical, state)``."""
    cooling: Array
    """D, ``(thermal, thermal)``."""
    load_response: Array
    """Velocities per impulse of the load, Ŵ⁻¹ b, 1/kg, ``(mechanical,)``."""
    warming: Array
    """Temperatures per heat at the tip, K/J, ``(thermal,)``."""
    heat_counts: bool
    """Whether temperatures at a step's end hold the heat of the contact in it: not those of central differences."""
    heat_theta: float
    """Weight of the temperatures at a step's end in what it loses."""
    lagged: bool
    """Whether the velocity at the step's beginning damps, instead of the mean one."""


class DenseState(NamedTuple):
    """States of a block, ``(…, lane)``."""

    own: Array
    """Rows of ``case_row``."""
    states: Array
    """x, v and θ at the step's beginning."""
    ahead: Array
    """v and θ at its end."""
    contact_response: Array
    """Velocities per impulse of contact, 1/kg, ``(mechanical, lane)``."""
    steady: Array
    """Velocities and temperatures that constant loads and heat loads add in a step, m/s and K."""
    sampled: Array
    """Temperatures at the last step's beginning and end as samples show them, ``(2, thermal, lane)``."""
    before: Array
    """Displacements at the last step's beginning, ``(mechanical, lane)``."""
    by_contact: Array
    """Rows ``CONTACT_…``."""


@inlined
def _move_freely(free: FreeStep, state: DenseState, load: Array, lanes: int) -> None:
    """Take all states through a step without contact."""
    n, heats, h = state.contact_response.shape[0], free.warming.size, free.tip.h
    multiply(free.velocity, state.states, state.ahead[:n], lanes)
    multiply(free.cooling, state.states[2 * n :], state.ahead[n:], lanes)
    for i in range(n):
        for lane in range(lanes):
            state.ahead[i, lane] += state.steady[i, lane] + (h * load[lane]) * free.load_response[i]
    for j in range(n, n + heats):
        for lane in range(lanes):
            state.ahead[j, lane] += state.steady[j, lane]


@inlined
def _meet(free: FreeStep, law: Law, state: DenseState, block: Block, account: Account, load: Array) -> None:
    """Close a step by contact; ``state.by_contact`` is left with what that does."""
    n, states, tip, own, step = state.contact_response.shape[0], state.states, block.tip, state.own, free.tip
    balances = account.mass.shape[0] > 0
    for first in range(0, block.lanes, PACK):
        lane = narrow(first)
        warmth = pack(state.ahead, (state.ahead.shape[0] - 1, lane))
        if not free.heat_counts:
            warmth = pack(states, (states.shape[0] - 1, lane))
        gap = pack(tip, (tip_row.GAP, lane))
        alone = Free(pack(state.ahead, (n - 1, lane)), warmth, spread(0.0, lane), gap, block.drive)
        end, ahead = meet(step, law, alone, own, tip, lane)
        if balances:
            before = pack(states, (2 * n - 1, lane))
            pushed = (step.h * account.load[n - 1]) * pack(load, (lane,))
            store(own, (case_row.IMPULSE, lane), pack(own, (case_row.IMPULSE, lane)) + pushed)
            gain = contact_gain(step, end, end.velocity - before, alone, own, tip, lane)
            store(
                account.totals, (total_row.DISSIPATED, lane), pack(account.totals, (total_row.DISSIPATED, lane)) + gain
            )
        store_end(end, tip, lane)
        store(state.by_contact, (CONTACT_IMPULSE, lane), ahead.impulse)
        store(state.by_contact, (CONTACT_PLACE, lane), ahead.place)
        store(state.by_contact, (CONTACT_SPEED, lane), ahead.velocity)


@inlined
def _add_impulse(free: FreeStep, state: DenseState, lanes: int) -> None:
    """Add what the impulse of contact and its heat do to all states; the tip's velocity is that of the contact law."""
    n, ahead = state.contact_response.shape[0], state.ahead
    for i in range(n):
        for lane in range(lanes):
            ahead[i, lane] -= state.by_contact[CONTACT_IMPULSE, lane] * state.contact_response[i, lane]
    for lane in range(lanes):
        ahead[n - 1, lane] = state.by_contact[CONTACT_SPEED, lane]
    for j in range(free.warming.size):
        for lane in range(lanes):
            heat = state.own[case_row.ALPHA, lane] * state.by_contact[CONTACT_IMPULSE, lane]
            ahead[n + j, lane] += heat * free.warming[j]
            shows = ahead[n + j, lane]
            if not free.heat_counts:
                shows = state.states[2 * n + j, lane] + (0.5 * free.warming[j]) * heat
            state.sampled[0, j, lane], state.sampled[1, j, lane] = state.sampled[1, j, lane], shows


@inlined
def _count(free: FreeStep, state: DenseState, account: Account, load: Array, lanes: int) -> None:
    """Add a step to the balances, energy at the mean velocity; of central differences at the middle's temperature."""
    n, states, ahead, middle = state.contact_response.shape[0], state.states, state.ahead, account.middle
    for lane in range(lanes):
        for i in range(n):
            middle[i, lane] = 0.5 * (states[n + i, lane] + ahead[i, lane])
            middle[n + i, lane] = states[n + i, lane] if free.lagged else middle[i, lane]
        for j in range(free.warming.size):
            now = states[2 * n + j, lane]
            middle[2 * n + j, lane] = 0.5 * (now + ahead[n + j, lane]) if free.heat_counts else now
    add_dissipation(account, free.tip.h, state.by_contact[CONTACT_IMPULSE], load, lanes)
    for lane in range(lanes):
        heat = state.own[case_row.ALPHA, lane] * state.by_contact[CONTACT_IMPULSE, lane]
        account.totals[total_row.FRICTION_HEAT, lane] += heat
    count_lost_heat(account, free.tip.h, free.heat_theta, states[2 * n :], ahead[n:], lanes)


@inlined
def _advance(free: FreeStep, state: DenseState, account: Account, lanes: int) -> None:
    """Take places to the step's end, and all states with them."""
    n, states, ahead, h, theta = state.contact_response.shape[0], state.states, state.ahead, free.tip.h, free.tip.theta
    before = state.before
    for i in range(n):
        for lane in range(lanes):
            before[i, lane] = states[i, lane]
            states[i, lane] += h * (theta * ahead[i, lane] + (1.0 - theta) * states[n + i, lane])
    for lane in range(lanes):
        states[n - 1, lane] = state.by_contact[CONTACT_PLACE, lane]
    for i in range(n + free.warming.size):
        for lane in range(lanes):
            states[n + i, lane] = ahead[i, lane]
    if account.mass.shape[0] > 0:
        store_energy(account, states[:n] if free.heat_counts else before, states[:n], states[n : 2 * n], lanes)


@inlined
def march_dense(
    free: FreeStep, law: Law, state: DenseState, block: Block, account: Account, loads: Array, first: int
) -> None:
    """Take a block through the steps that begin with ``first``; ``loads`` are those at the tip, N, ``(step, lane)``.

    Central differences have a step 0, from -h/2 to h/2, whose impulse counts whole.
    """
    assert loads.shape[1] == ROW
    assert state.states.shape[1] == ROW
    assert block.tip.shape[1] == ROW
    lanes, h, theta, balances = block.lanes, free.tip.h, free.tip.theta, account.mass.shape[0] > 0
    begins = 1 if free.heat_counts else 0
    for row in range(loads.shape[0]):
        step, load = first + row, loads[row]
        if step == begins:
            turn_drive(block.drive, 0, h, theta, block.tip, lanes)
            if balances:
                _begin(free, state, account, lanes)
        if step > 0:
            turn_drive(block.drive, step, h, theta, block.tip, lanes)
        _move_freely(free, state, load, lanes)
        _meet(free, law, state, block, account, load)
        _add_impulse(free, state, lanes)
        if balances:
            _count(free, state, account, load, lanes)
        _advance(free, state, account, lanes)
        if step > 0:
            count_stored(step, block)
        else:
            for lane in range(lanes):
                state.own[case_row.CONTACT, lane] *= 2.0


@part
def _begin(free: FreeStep, state: DenseState, account: Account, lanes: int) -> None:
    """Take the energy with which the first step begins."""
    n, before, h = state.contact_response.shape[0], state.before, free.tip.h
    for i in range(n):
        for lane in range(lanes):
            before[i, lane] = state.states[i, lane]
            if not free.heat_counts:
                before[i, lane] -= h * state.states[n + i, lane]
    store_energy(account, before, state.states[:n], state.states[n : 2 * n], lanes)
    for lane in range(lanes):
        account.totals[total_row.FIRST_ENERGY, lane] = account.totals[total_row.LAST_ENERGY, lane]
