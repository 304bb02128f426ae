"""The march of ``moreau`` over the modes of a structure: a block of cases at once, contact in between.

In modal coordinates the pair (ζ, ξ = η - hθζ) of a mode takes an impulse in ζ alone and steps by

    ζ ← ζ + w s,   ζ' = a ζ + b ξ,   ξ' = ξ + h ζ,

with s the load's impulse less the contact's.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Cases, Structure
from workflow.schemes._balance import Audit, Books, audit_step, lay_out_audit, no_audit
from workflow.schemes._decoupled import Decoupled, Motion
from workflow.schemes._interface import Sampling
from workflow.schemes._kernel import inlined, kernel
from workflow.schemes._lanes import PACK, WIDE, fill_lanes, lane_rows
from workflow.schemes._marks import GAP, Block, take_marks
from workflow.schemes._modal_lanes import (
    DRIFT,
    WARMING,
    WARMTH,
    Coefficients,
    by_mode,
    lay_out,
    moves_by_itself,
    step_freely,
    take_heat,
)
from workflow.schemes._packs import BROAD, Lane, align_stack, broad, narrow, pack, wide
from workflow.schemes._prox import meet
from workflow.schemes._stepping import Now, Watch, block_lanes, blocks, enter, note, observe
from workflow.schemes._tip_load import start_load, tip_load


def coefficients(modal: Decoupled, h: float, theta: float) -> Coefficients:
    """Return the step's coefficients, with or without thermal states."""
    omega2, c, tip, mu = modal.frequency**2, modal.damping, modal.tip, modal.rate
    inertia = 1 + h * theta * c + h**2 * theta**2 * omega2
    warm = modal.heat_tip / (1 + h * theta * mu)
    thermal_kick = -h * theta * (modal.coupling @ warm) / inertia
    decay = (1 - h * (1 - theta) * mu) / (1 + h * theta * mu)
    j, k = modal.pairs.T
    return Coefficients(
        modes=by_mode(
            (1 - h * (1 - theta) * c - h**2 * theta * (2 - theta) * omega2) / inertia,
            -h * omega2 / inertia,
            tip**2 / inertia,
            tip * (thermal_kick + modal.response @ (mu * warm)),
            -tip * (modal.response @ modal.heat_tip),
        ),
        heat_modes=by_mode(decay, modal.glow * warm, -mu * modal.tip_response / modal.glow),
        pair_mode=j,
        pair_heat=k,
        pair_pull=-h * tip[j] * modal.coupling[j, k] * (theta * decay[k] + 1 - theta) / (inertia[j] * modal.glow[k]),
        inverse_mass=float(np.sum(tip**2 / inertia)),
        warming=float(np.sum(modal.heat_tip * warm)),
        theta=theta,
        rest=None if theta == 1.0 else 1.0 - theta,
    )


@inlined
def _step(
    operator: Coefficients,
    now: Now,
    own: Array,
    motion: Array,
    tau: Array,
    tau_before: Array,
    block: Block,
    lane: Lane,
) -> None:
    """Take a pack of lanes through a step: free motion, load and contact, what is watched."""
    h, tip = block.h, block.tip
    free, temperature = step_freely(operator, now.known, now.t, h, own, motion, tau, tau_before, lane)
    gap = pack(tip, (GAP, lane))
    pushed = h * tip_load(now.sine, now.leader, block.load, lane)
    theta, rest, inverse_mass, warming = operator.theta, operator.rest, operator.inverse_mass, operator.warming
    engaged, x, v, temperature, p = meet(
        theta, rest, inverse_mass, warming, h, pushed, free, temperature, gap, own, tip, lane
    )
    note(now.marked, engaged, now.lasts, True, h, x, v, temperature, p, gap, tip, lane)


@kernel
def _march(
    operator: Coefficients, own: Array, motion: Array, tau: Array, tau_before: Array, block: Block, audit: Audit
) -> None:
    """Step a block of cases; lanes never meet.

    ``tau_before`` is left with τ at the beginning of the last step, ``tau`` with τ at its end.
    """
    load, tip, lanes, h, theta = block.load, block.tip, block.lanes, block.h, operator.theta
    align_stack()
    lay_out(operator, own, motion, tau, load, tip)
    lay_out_audit(audit)
    in_broad, in_wide = lanes // BROAD * BROAD, lanes // WIDE * WIDE
    paired, known, leader = operator.pair_mode.size > 0, moves_by_itself(own, lanes), start_load(h, load, lanes)
    for step in range(1, block.steps + 1):
        now = enter(step, 1.0 - theta, theta, leader, known, block)
        if paired or step == block.steps:
            take_heat(operator.heat_modes, tau, own, tau_before, lanes)
        for first in range(0, in_broad, BROAD):
            _step(operator, now, own, motion, tau, tau_before, block, broad(first))
        for first in range(in_broad, in_wide, WIDE):
            _step(operator, now, own, motion, tau, tau_before, block, wide(first))
        for first in range(in_wide, lanes, PACK):
            _step(operator, now, own, motion, tau, tau_before, block, narrow(first))
        if now.marked:
            observe(take_marks(step, block), tip, lanes)
        if audit.sums.shape[0] > 0:
            audit_step(theta, h, leader, audit, own, load, lanes)
    take_heat(operator.heat_modes, tau, own, tau, lanes)


def march(
    structure: Structure,
    modal: Decoupled,
    begun: Motion,
    h: float,
    theta: float,
    rows: Array,
    cases: Cases,
    watched: Watch,
    sampling: Sampling,
) -> tuple[Array, dict[str, Array]]:
    """Step all cases in blocks.

    ``rows`` is what contact reads of each case, to which what is known of its motion is added.
    Returns the quasi-static tip growth at the end, m, ``(case,)``, and the balances if asked for.
    """
    operator, plan = coefficients(modal, h, theta), watched.schedule
    rows[DRIFT], rows[WARMTH], rows[WARMING] = begun.drift, begun.warmth, begun.warming
    zeta = begun.velocity * modal.tip
    xi = begun.position * modal.tip - h * theta * zeta
    pairs, heat = by_mode(zeta.T, xi.T), (begun.heat * modal.glow).T
    own, motion = lane_rows(rows.shape[0]), lane_rows(*pairs.shape[:2])
    tau, tau_before = lane_rows(heat.shape[0]), lane_rows(heat.shape[0])
    closing = begun.closing + begun.closing_rate * sampling.duration
    growth = (modal.static_growth / modal.glow)[:, None]
    books = Books(structure, modal, cases, begun.tip_force, h, theta) if sampling.balances else None
    audit = no_audit() if books is None else books.audit
    for part, block in blocks(watched, block_lanes(pairs, heat, 0 if books is None else books.rows)):
        if books is not None:
            books.open(part)
        fill_lanes(own, rows[:, part])
        fill_lanes(motion, pairs[..., part])
        fill_lanes(tau, heat[..., part])
        _march(operator, own, motion, tau, tau_before, block, audit)
        if books is not None:
            books.close(part, plan.steps * h)
        reached = tau_before + plan.weight[-1] * (tau - tau_before)
        sums = np.sum(growth * reached, axis=0)  # in the same order whatever lanes are in use
        closing[part] += sums[: part.stop - part.start]
    return closing, {} if books is None else books.residuals
