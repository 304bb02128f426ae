"""The march of ``moreau`` over the modes of a structure: a block of cases at once, contact in between.

In modal coordinates the pair (ζ, ξ = η - hθζ) of a mode takes an impulse in ζ alone and steps by

    ζ ← ζ + w s,   ζ' = a ζ + b ξ,   ξ' = ξ + h ζ,

with s the load's impulse less the contact's.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Cases, Structure
from workflow.schemes._balance import Audit, Books, audit_step, no_audit
from workflow.schemes._decoupled import Decoupled, Motion
from workflow.schemes._interface import Sampling
from workflow.schemes._kernel import inlined, kernel
from workflow.schemes._lanes import fill_lanes, lane_rows
from workflow.schemes._modal_lanes import (
    DRIFT,
    HEAT_MODES,
    MODES,
    WARMING,
    WARMTH,
    Coefficients,
    conduct,
    grouped,
    pull_pairs,
    swing,
    swing_heated,
    take_heat,
)
from workflow.schemes._prox import touch, touch_and_note
from workflow.schemes._stepping import Block, Watch, blocks, observe, start_load, take_marks, turn_load, weigh_load


def coefficients(modal: Decoupled, h: float, theta: float) -> Coefficients:
    """Return the step's coefficients, with or without thermal states."""
    omega2, c, tip, mu = modal.frequency**2, modal.damping, modal.tip, modal.rate
    inertia = 1 + h * theta * c + h**2 * theta**2 * omega2
    warm = modal.heat_tip / (1 + h * theta * mu)
    thermal_kick = -h * theta * (modal.coupling @ warm) / inertia
    decay = (1 - h * (1 - theta) * mu) / (1 + h * theta * mu)
    j, k = modal.pairs.T
    return Coefficients(
        modes=grouped(
            MODES,
            (1 - h * (1 - theta) * c - h**2 * theta * (2 - theta) * omega2) / inertia,
            -h * omega2 / inertia,
            tip**2 / inertia,
            tip * (thermal_kick + modal.response @ (mu * warm)),
            -tip * (modal.response @ modal.heat_tip),
        ),
        heat_modes=grouped(HEAT_MODES, decay, modal.glow * warm, -mu * modal.tip_response / modal.glow),
        pair_mode=j,
        pair_heat=k,
        pair_pull=-h * tip[j] * modal.coupling[j, k] * (theta * decay[k] + 1 - theta) / (inertia[j] * modal.glow[k]),
        inverse_mass=float(np.sum(tip**2 / inertia)),
        warming=float(np.sum(modal.heat_tip * warm)),
        theta=theta,
    )


@inlined
def move_freely(
    operator: Coefficients,
    t: float,
    h: float,
    ending: bool,
    own: Array,
    motion: Array,
    tau: Array,
    tau_before: Array,
    tip: Array,
    lanes: int,
) -> None:
    """Find velocity and temperature of the tip at t, without load and contact in the step that ends there.

    The thermal and mechanical modes take in the impulse and heat of the step before. At the ``ending``
    of the march ``tau_before`` is left with τ at the beginning of the step.
    """
    paired = operator.pair_mode.size > 0
    if tau.shape[0] == 0:
        swing(operator.modes, h, motion, own, tip, lanes)
        return
    if paired or ending:
        take_heat(operator.heat_modes, tau, own, tau_before, lanes)
    conduct(t, operator.heat_modes, tau, own, tip, lanes)
    swing_heated(operator.modes, h, motion, own, tip, lanes)
    if paired:
        pull_pairs(operator, tau_before, motion, tip, lanes)


@kernel
def _march(
    operator: Coefficients, own: Array, motion: Array, tau: Array, tau_before: Array, block: Block, audit: Audit
) -> None:
    """Step a block of cases; lanes never meet.

    A step: free motion, load and contact, what is watched, the balances if asked for.

    ``tau_before`` is left with τ at the beginning of the last step, ``tau`` with τ at its end.
    """
    load, tip, lanes, h, next_mark = block.load, block.tip, block.lanes, block.h, block.marks.next_mark
    theta, inverse_mass, warming = operator.theta, operator.inverse_mass, operator.warming
    start_load(h, load, lanes)
    for step in range(1, block.steps + 1):
        turn_load(step, h, load, lanes)
        sine = weigh_load(1.0 - theta, theta, load, lanes)
        move_freely(operator, step * h, h, step == block.steps, own, motion, tau, tau_before, tip, lanes)
        if step == next_mark[0]:
            touch(theta, inverse_mass, warming, h, sine, own, load, tip, lanes)
            observe(take_marks(step, block), tip, lanes)
        else:
            touch_and_note(theta, inverse_mass, warming, h, sine, own, load, tip, lanes)
        audit_step(theta, h, audit, own, load, lanes)
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
    pairs = grouped(MODES, zeta.T, xi.T).reshape(-1, 2 * MODES, cases.count)
    heat = grouped(HEAT_MODES, (begun.heat * modal.glow).T)[:, 0]
    own, motion = lane_rows(rows.shape[0]), lane_rows(*pairs.shape[:2])
    tau, tau_before = lane_rows(*heat.shape[:2]), lane_rows(*heat.shape[:2])
    closing = begun.closing + begun.closing_rate * sampling.duration
    growth = grouped(HEAT_MODES, modal.static_growth / modal.glow)[:, 0, :, None]
    books = Books(structure, modal, cases, begun.tip_force, h, theta) if sampling.balances else None
    audit = no_audit() if books is None else books.audit
    for part, block in blocks(watched):
        if books is not None:
            books.open(part)
        fill_lanes(own, rows[:, part])
        fill_lanes(motion, pairs[..., part])
        fill_lanes(tau, heat[..., part])
        _march(operator, own, motion, tau, tau_before, block, audit)
        if books is not None:
            books.close(part, plan.steps * h)
        reached = tau_before + plan.weight[-1] * (tau - tau_before)
        sums = np.sum(growth * reached, axis=(0, 1))  # in the same order whatever lanes are in use
        closing[part] += sums[: part.stop - part.start]
    return closing, {} if books is None else books.residuals
