"""The march of the θ-method over a long chain: passes along it, and contact at its tip in between."""

from __future__ import annotations

import numpy as np

from workflow.kernels.compiled import inlined
from workflow.kernels.lanes import ROW, lane_rows
from workflow.kernels.packs import narrow, pack, spread
from workflow.models import Array, Cases
from workflow.schemes._fixed import case_row, tip_row, total_row
from workflow.schemes._fixed.contact import Free, Law, TipStep, meet
from workflow.schemes._fixed.drive import drive_of, turn_drive
from workflow.schemes._fixed.march import law_lanes
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.stepping import Ended, blocks, count_stored, load_impulse, step_at, store_end, watch
from workflow.schemes._fixed.theta_method import Operator
from workflow.schemes._fixed.tip_load import start_load, turn_load
from workflow.schemes._fixed.totals import Balance, content_of
from workflow.schemes._interface import Sampling
from workflow.schemes._sweep import node_row, step_row
from workflow.schemes._sweep.balance import Account, count_step, start_account, weights
from workflow.schemes._sweep.sweeps import Nodes, Swept, eliminate_heat, node_rows, step_to_root, step_to_tip


@inlined
def march_nodes(nodes: Nodes, law: Law, own: Array, block: Block, account: Account) -> None:
    """Step the case in lane 0 along the nodes of its chain; the kernel that calls it is the scheme's."""
    load, tip, lanes, h, theta = block.load, block.tip, block.lanes, block.h, nodes.theta
    assert own.shape[1] == ROW
    assert load.shape[1] == ROW
    assert tip.shape[1] == ROW
    assert account.totals.shape[1] == ROW
    balances, lane, last = account.weight.shape[0] > 0, narrow(0), nodes.tip
    leader = start_load(h, load, lanes)
    turn_drive(block.drive, 0, h, theta, tip, lanes)
    if balances:
        start_account(nodes, account)
    if nodes.heated:
        eliminate_heat(nodes)
    step = TipStep(
        h, theta, 1.0 - theta, nodes.step[step_row.INVERSE_PIVOT, last], nodes.step[step_row.HEAT_ANSWER, last]
    )
    for k in range(1, block.steps + 1):
        velocity, temperature = step_to_tip(nodes)
        turn_load(k, h, leader, load, lanes)
        turn_drive(block.drive, k, h, theta, tip, lanes)
        now, gap = step_at(k, theta, leader, False, block), pack(tip, (tip_row.GAP, lane))
        impulse = load_impulse(now, h, block, lane)
        free = Free(spread(velocity, lane), spread(temperature, lane), impulse, gap, block.drive)
        end = meet(law, step, free, own, tip, lane)
        store_end(end, tip, lane)
        heat = own[case_row.HEAT, 0]
        step_to_root(nodes, tip[tip_row.NEW_DISPLACEMENT, 0], tip[tip_row.NEW_VELOCITY, 0], heat)
        if balances:
            count_step(nodes, account, heat, own[case_row.IMPULSE, 0])
        count_stored(k, block)


def _fill(nodes: Nodes, cases: Cases, case: int) -> None:
    """Put the initial state and the constant loads of a case in the rows of its nodes."""
    inside, state, loads, h = slice(1, nodes.tip + 1), nodes.state, nodes.loads, nodes.h
    state[:] = 0.0
    state[node_row.X, inside], state[node_row.V, inside] = cases.displacement[case], cases.velocity[case]
    state[node_row.TAU, inside] = cases.temperature[case]
    loads[node_row.LOAD_STEADY, inside], loads[node_row.LOAD_HEATING, inside] = (
        h * cases.steady[case],
        h * cases.heating[case],
    )


def sweep(operator: Operator, law: Law, cases: Cases, sampling: Sampling, heated: bool) -> Ended:
    """Step all cases, one by one, by the scheme's kernel; ``heated`` where they carry temperatures."""
    h, theta, swept = operator.h, operator.theta, operator.motion
    assert isinstance(swept, Swept)
    chain, last = swept.chain, swept.chain.mechanical_size
    drive, stepped = drive_of(cases, h, theta)
    watched = watch(cases, cases.mean, sampling, h, drive)
    step, lever = swept.coefficients(h, theta), h * theta + chain.damping.stiffness
    nodes = Nodes(
        last, h, theta, lever, heated, step, node_rows(node_row.ROWS, last), node_rows(node_row.LOAD_ROWS, last)
    )
    account = Account(weights(chain) if sampling.balances else np.zeros((0, 0)), lane_rows(total_row.ROWS))
    lanes, filled = law_lanes(law)
    own, rows, inside = lane_rows(case_row.ROWS), np.zeros((case_row.ROWS, cases.count)), slice(1, last + 1)
    rows[case_row.ALPHA] = cases.alpha
    closing, heat = np.zeros(cases.count), np.zeros((cases.count, last))
    totals = np.zeros((total_row.ROWS, cases.count))
    for part, block in blocks(watched, 1, (own, rows), *filled):
        case = part.start
        _fill(nodes, stepped, case)
        operator.contact.kernels.nodes(nodes, lanes, own, block, account)
        heat[case], totals[:, case] = nodes.state[node_row.TAU, inside], account.totals[:, 0]
        if heated:
            in_last_step = (
                nodes.state[node_row.WARMED, inside] + own[case_row.HEAT, 0] * step[step_row.HEAT_ANSWER, inside]
            )
            closing[case] = np.sum(
                swept.static_growth * (heat[case] - (1 - watched.schedule.weight[-1]) * in_last_step)
            )
    balance = Balance(totals, content_of(chain, cases, heat, watched.elapsed))
    return Ended(watched, closing, {}, balance if sampling.balances else None)
