"""Steps a batch by central differences: contact, how it starts, and how its cases ended.

The equations stand in :mod:`workflow.schemes._fixed.central`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, Structure, project
from workflow.schemes._fixed import case_row, central, tip_row
from workflow.schemes._fixed.block_march import step_blocks
from workflow.schemes._fixed.central import Differences, Operator
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.decoupled import Decoupled, Motion, start
from workflow.schemes._fixed.drive import drive_of
from workflow.schemes._fixed.march import Batch, case_rows, march_blocks
from workflow.schemes._fixed.marches import KERNELS
from workflow.schemes._fixed.modal_balance import Balances, Start, energy_of_modes
from workflow.schemes._fixed.outcome import ROUNDING, Outcome, by_heat, judged
from workflow.schemes._fixed.sliding import friction_message, slides
from workflow.schemes._fixed.stable_steps import limit_text
from workflow.schemes._fixed.stepping import Ended, collect, watch
from workflow.schemes._interface import Results, Sampling


def _half_step_before(modal: Decoupled, cases: Cases, h: float) -> Array:
    """Return the modal w_-½ = v_0 - (h/2) a_0, with the acceleration without contact, ``(case, mode)``."""
    velocity = project(modal.to_modes, cases.velocity)
    force = cases.load_at(0.0)
    load = modal.tip if modal.load is None else modal.load
    acceleration = project(modal.shapes.T, cases.steady) + force[:, None] * load
    damped = modal.damping * velocity if modal.damper is None else project(modal.damper, velocity)
    acceleration -= damped + modal.frequency**2 * project(modal.to_modes, cases.displacement)
    acceleration -= project(modal.coupling, project(modal.to_thermal, cases.temperature))
    return np.asarray(velocity - 0.5 * h * acceleration)


def _remaining_before(operator: Operator, cases: Cases, begun: Motion) -> Array:
    """Return the remaining modal w_-½, relative to what heat drags along, ``(case, mode)``."""
    modal, slope = operator.modal, operator.differences.slope(operator.h, operator.modal.rate)
    half = _half_step_before(modal, cases, operator.h)
    # what start() took off as dragged velocity is that of continuous time
    remaining = begun.velocity - project(modal.response * modal.rate, begun.heat)
    remaining += half - project(modal.to_modes, cases.velocity)
    return np.asarray(remaining + project(operator.lead * slope, begun.heat))


def _first_free(operator: Operator, begun: Motion, before: Array) -> tuple[Array, Array]:
    """Return the remaining modal w_½ without tip load and contact, and that of the whole tip, ``(case,)``."""
    h, modal = operator.h, operator.modal
    inertia, factor = operator.differences.damped(h, modal.damping)
    slope = operator.differences.slope(h, modal.rate)
    free = factor * before - h * modal.frequency**2 / inertia * begun.position
    for mode, heat in modal.pairs:
        free[:, mode] -= h * modal.coupling[mode, heat] / inertia[mode] * begun.heat[:, heat]
    row = np.concatenate([modal.tip, -slope * modal.tip_response])
    whole = project(row, np.concatenate([free, begun.heat], axis=1)) + begun.drift
    return free, whole


def _run(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    contact, h, w = operator.contact, operator.h, operator.delassus(cases.friction)
    step = _step_modes if operator.blocks is None else _step_blocks
    ended = step(operator, contact.mobility(h, w), cases, sampling)
    # squared: a contact that grows can stop short of infinity where its energy is beyond it
    tip = ended.watched.tip[[tip_row.DISPLACEMENT, tip_row.VELOCITY, tip_row.TEMPERATURE]]
    finite = np.asarray(np.isfinite(tip**2).all(axis=0))
    return collect(ended, *_judge(operator, cases, contact.factor(h, w) <= 0, finite))


def _step_modes(operator: Operator, w: Any, cases: Cases, sampling: Sampling) -> Ended:
    """Step cases in modes scaled by the tip."""
    h, modal, free = operator.h, operator.modal, operator.coefficients(slides(operator.modal, cases))
    begun = start(modal, cases)
    drive, _ = drive_of(cases, h, theta=0.0)
    watched = watch(cases, cases.mean + begun.tip_force, sampling, h, drive)
    before = _remaining_before(operator, cases, begun)
    speed, free_tip = _first_free(operator, begun, before)
    law, own = operator.contact.law(cases), case_rows(cases, begun, w)
    own[case_row.AHEAD], own[case_row.FIRST] = cases.displacement[:, -1], free_tip
    own[case_row.HALF] = project(modal.tip, _half_step_before(modal, cases, h))
    balance = None
    if sampling.balances:
        terms, begins = central.terms(operator, begun, before), Start(modal, cases, begun)
        energy = energy_of_modes(begins, free, terms, watched.elapsed)
        balance = Balances(operator.structure, free, begins, central.step(modal, h, operator.differences), energy)
    place, march = begun.position * modal.tip, KERNELS[type(law)]
    batch = Batch(modal, begun, free, operator.contact, law, march, speed * modal.tip, place, own, balance)
    return march_blocks(batch, watched, sampling.duration)


def _step_blocks(operator: Operator, w: Any, cases: Cases, sampling: Sampling) -> Ended:
    """Step cases in blocks."""
    drive, _ = drive_of(cases, operator.h, theta=0.0)
    before = _half_step_before(operator.modal, cases, operator.h)
    return step_blocks(operator, w, cases, before, sampling, drive)


def _judge(operator: Operator, cases: Cases, ambiguous: Any, finite: NDArray[np.bool_]) -> Outcome:
    """Decide what became of each case; ``ambiguous`` are those whose contact has no unique solution, or one for all."""
    h, modal, differences = operator.h, operator.modal, operator.differences
    if operator.blocks is None:
        free = np.abs(differences.amplification(modal.frequency, modal.damping, h)).max(initial=0.0)
    else:
        free = operator.blocks.growth
    heat = np.abs(differences.decay(h, modal.rate)).max(initial=0.0)
    growth, grown = float(max(free, heat)), None
    if growth > 1 + ROUNDING:
        limit = differences.largest_stable_step(modal.frequency, modal.damping, modal.rate)
        what = "free step" if free >= heat else "explicit heat step"
        grown = (
            f"the {what} grows {growth:.6g}-fold at h = {h:.6g} s; central differences are stable up to "
            f"{limit_text(limit, 7)} s"
        )

    def explain(case: int) -> str:
        return friction_message(h, float(cases.friction[case]), operator.contact.name)

    left = f"the energy left the finite numbers at h = {h:.6g} s"
    return judged(finite, ambiguous & (grown is None), explain, grown, left)


def init(structure: Structure, h: float, differences: Differences, contact: Contact) -> Operator:
    """Diagonalise a structure once for a batch, and separate it into blocks where its modes are coupled."""
    return central.operator(structure, h, differences, contact)


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    return by_heat(cases, lambda some, hot: _run(operator if hot else operator.without_heat(), some, sampling))
