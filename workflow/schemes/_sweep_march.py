"""The march of ``moreau`` over a long chain: passes along it, and contact at its tip in between."""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Cases
from workflow.schemes._interface import Sampling
from workflow.schemes._kernel import kernel
from workflow.schemes._lanes import ROW, fill_lanes, lane_rows
from workflow.schemes._marks import GAP, NEW_DISPLACEMENT, NEW_VELOCITY, STEP_IMPULSE, Block, take_marks
from workflow.schemes._modal_lanes import HEAT
from workflow.schemes._packs import narrow, pack, spread
from workflow.schemes._prox import meet
from workflow.schemes._stepping import Watch, blocks, observe, prepare
from workflow.schemes._sweep_balance import SUMS, open_account, residuals, tally, weights
from workflow.schemes._sweeps import (
    HEATING,
    LOADS,
    STATE,
    STEADY,
    TAU,
    WARM,
    WARMED,
    YIELD,
    Swept,
    V,
    X,
    conduct,
    node_rows,
    settle,
    swing,
)
from workflow.schemes._tip_load import (
    AMPLITUDE,
    BALANCE_SINE,
    MEAN,
    OWN_SINE,
    start_load,
    tip_load,
    turn_load,
    weigh_load,
)


@kernel
def _march(
    last: int,
    theta: float,
    lever: float,
    step: Array,
    loads: Array,
    state: Array,
    own: Array,
    block: Block,
    heated: bool,
    weight: Array,
    sums: Array,
) -> None:
    """Step the case in lane 0 along nodes 1 … ``last``; ``weight`` has rows where balances are asked for."""
    load, tip, lanes, h, next_mark = block.load, block.tip, block.lanes, block.h, block.marks.next_mark
    assert own.shape[1] == ROW
    assert load.shape[1] == ROW
    assert tip.shape[1] == ROW
    audited, lane = weight.shape[0] > 0, narrow(0)
    leader = start_load(h, load, lanes)
    if audited:
        open_account(last, weight, state, sums)
    if heated:
        conduct(last, step, state, loads)
    for k in range(1, block.steps + 1):
        free, warmed = swing(last, step, state, loads, theta, lever, heated)
        turn_load(k, h, leader, load, lanes)
        pushed = h * tip_load(weigh_load(1.0 - theta, theta, OWN_SINE, leader, load, lanes), leader, load, lane)
        mobility, warming, gap = step[YIELD, last], step[WARM, last], pack(tip, (GAP, lane))
        before_contact = spread(free, lane), spread(warmed, lane)
        _, x, v, temperature, p = meet(
            theta, 1.0 - theta, mobility, warming, h, pushed, *before_contact, gap, own, tip, lane
        )
        prepare(x, v, temperature, p, tip, lane)
        heat = own[HEAT, 0]
        place, speed = tip[NEW_DISPLACEMENT, 0], tip[NEW_VELOCITY, 0]
        settle(last, step, state, loads, h, theta, place, speed, heat, heated)
        if audited:
            sine = weigh_load(0.5, 0.5, BALANCE_SINE, leader, load, lanes) + load[BALANCE_SINE, 0]
            taken = h * (load[MEAN, 0] + load[AMPLITUDE, 0] * sine) - tip[STEP_IMPULSE, 0]
            tally(last, step, weight, state, loads, h, heat, taken, sums)
        observe(take_marks(k, block) if k == next_mark[0] else h, tip, lanes)


def sweep(
    swept: Swept, h: float, theta: float, rows: Array, cases: Cases, watched: Watch, sampling: Sampling, heated: bool
) -> tuple[Array, dict[str, Array]]:
    """Step all cases, one by one.

    ``rows`` is what contact reads of each case. Returns the quasi-static tip growth at the end, m,
    ``(case,)``, and the balances if they are asked for.
    """
    chain, nodes = swept.chain, swept.chain.mechanical_size
    step = swept.coefficients(h, theta)
    state, loads = node_rows(STATE, nodes), node_rows(LOADS, nodes)
    inside = slice(1, nodes + 1)
    weight = weights(chain) if sampling.balances else np.zeros((0, 0))
    own, sums, closing = lane_rows(rows.shape[0]), np.zeros(SUMS), np.zeros(cases.count)
    balances = {name: np.zeros(cases.count) for name in ("energy_residual", "heat_residual") if sampling.balances}
    lever, plan = h * theta + chain.damping.stiffness, watched.schedule
    for part, block in blocks(watched, most=1):
        case = part.start
        fill_lanes(own, rows[:, part])
        state[:] = 0.0
        state[X, inside], state[V, inside], state[TAU, inside] = (
            cases.displacement[case],
            cases.velocity[case],
            cases.temperature[case],
        )
        loads[STEADY, inside], loads[HEATING, inside] = h * cases.steady[case], h * cases.heating[case]
        _march(nodes, theta, lever, step, loads, state, own, block, heated, weight, sums)
        if heated:
            in_last_step = state[WARMED, inside] + own[HEAT, 0] * step[WARM, inside]
            reached = state[TAU, inside] - (1 - plan.weight[-1]) * in_last_step
            closing[case] = np.sum(swept.static_growth * reached)
        if balances:
            heating = plan.steps * h * float(cases.heating[case].sum())
            found = residuals(sums, chain, cases.temperature[case], state[TAU, inside], heating)
            balances["energy_residual"][case], balances["heat_residual"][case] = found
    return closing, balances
