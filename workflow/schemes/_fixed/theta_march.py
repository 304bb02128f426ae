"""Steps a batch by the θ-method and judges its cases.

The equations stand in :mod:`workflow.schemes._fixed.theta_method`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, Structure, poles, project
from workflow.schemes._fixed import theta_method, tip_row
from workflow.schemes._fixed.block_march import step_blocks
from workflow.schemes._fixed.blocks import separate
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.decoupled import Decoupled, decouple, start
from workflow.schemes._fixed.drive import drive_of
from workflow.schemes._fixed.march import Batch, case_rows, march_blocks
from workflow.schemes._fixed.marches import KERNELS
from workflow.schemes._fixed.modal_balance import Balances, Start, energy_of_modes
from workflow.schemes._fixed.outcome import ROUNDING, Outcome, by_heat, judged
from workflow.schemes._fixed.sliding import friction_message, slides
from workflow.schemes._fixed.stable_steps import largest_step, limit_text
from workflow.schemes._fixed.stepping import Ended, collect, watch
from workflow.schemes._fixed.theta_method import Operator
from workflow.schemes._interface import Results, Sampling

_MOST_GROWTH = 300.0
"""Logarithm of the largest growth within a run that still has squares among the finite numbers (355), with a margin of
1e24 for loads and units."""


def init(structure: Structure, h: float, theta: float, contact: Contact) -> Operator:
    """Diagonalise a structure once for a batch, and separate it into blocks where its modes are coupled."""
    motion = decouple(structure)
    blocks = separate(motion, theta_method.step(motion, h, theta)) if motion.is_coupled else None
    return Operator(structure, h, theta, motion, contact, blocks)


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    return by_heat(cases, lambda some, heated: _run(operator, some, sampling, heated))


def _run(operator: Operator, cases: Cases, sampling: Sampling, heated: bool) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    motion, w = operator.motion, operator.delassus(operator.h, cases.alpha, cases.friction)
    modal = motion if heated else motion.without_heat()
    step = step_modes if operator.blocks is None else _step_blocks
    ended = step(operator, modal, operator.contact.mobility(operator.h, w), cases, sampling)
    if not operator.contact.judges_heat:
        operator = replace(operator, motion=modal)
    finite = ended.watched.finite(tip_row.DISPLACEMENT, tip_row.TEMPERATURE)
    return collect(ended, *_judge(operator, cases, sampling.duration, finite))


def step_modes(operator: Operator, modal: Decoupled, w: Array, cases: Cases, sampling: Sampling) -> Ended:
    """Step cases in modes by the scheme's kernel with W, ``(case,)``; ``modal`` has thermal states or has not."""
    h, theta = operator.h, operator.theta
    drive, stepped = drive_of(cases, h, theta)
    begun = start(modal, stepped)
    watched = watch(cases, cases.mean + begun.tip_force, sampling, h, drive)
    zeta = begun.velocity * modal.tip
    xi = begun.position * modal.tip - h * theta * zeta
    free = theta_method.coefficients(modal, h, theta, slides(modal, cases))
    free, law = free._replace(tip=operator.contact.felt_by(free.tip)), operator.contact.law(cases)
    balance = None
    if sampling.balances:
        terms, begins = theta_method.terms(modal, h, theta, begun), Start(modal, stepped, begun)
        energy = energy_of_modes(begins, free, terms, watched.elapsed)
        balance = Balances(operator.structure, free, begins, theta_method.step(modal, h, theta), energy)
    own, march = case_rows(cases, begun, w), KERNELS[type(law)]
    batch = Batch(modal, begun, free, operator.contact, law, march, zeta, xi, own, balance)
    return march_blocks(batch, watched, sampling.duration)


def _step_blocks(operator: Operator, modal: Decoupled, w: Array, cases: Cases, sampling: Sampling) -> Ended:
    """Step cases in blocks."""
    drive, stepped = drive_of(cases, operator.h, operator.theta)
    return step_blocks(operator, w, stepped, project(modal.to_modes, stepped.velocity), sampling, drive)


def _judge(operator: Operator, cases: Cases, duration: float, finite: NDArray[np.bool_]) -> Outcome:
    """Decide what became of each case."""
    h, theta, growth = operator.h, operator.theta, _growth(operator)
    grown = None
    if growth > 1 + ROUNDING:
        limit = _largest_stable_step(operator)
        grown = f"the free step grows {growth:.6g}-fold at theta = {theta:g} and h = {h:.6g} s; " + (
            f"it is stable up to h = {limit_text(limit)} s" if limit > 0 else "it is stable at no h"
        )

    @cache  # a limit is found by hundreds of trials
    def explained(alpha: float, friction: float) -> str:
        return _message(operator, alpha, friction, duration)

    def explain(case: int) -> str:
        return explained(float(cases.alpha[case]), float(cases.friction[case]))

    ill_posed = operator.factor(h, cases.alpha, cases.friction) <= 0
    return judged(finite, ill_posed, explain, grown, f"the state left the finite numbers at h = {h:.6g} s")


def _growth(operator: Operator) -> float:
    """Return the largest factor of a free step; none is above 1 where θ >= 1/2."""
    motion, h, theta = operator.motion, operator.h, operator.theta
    if operator.blocks is not None:
        return operator.blocks.growth
    if theta >= 0.5:
        return 1.0
    frequency = motion.frequency.copy()
    if operator.structure.has_massless_tip:
        frequency[-1] = np.inf
    free = np.abs(theta_method.amplification(frequency, motion.damping, h, theta)).max(initial=0.0)
    heat = np.abs(theta_method.thermal_amplification(motion.rate, h, theta)).max(initial=0.0)
    return float(max(free, heat))


def _largest_stable_step(operator: Operator) -> float:
    """Return the step up to which no free mode grows where θ < 1/2: 2 Re λ + (1-2θ) h |λ|² <= 0 for every λ."""
    motion, theta = operator.motion, operator.theta
    if operator.structure.has_massless_tip:
        return 0.0
    lam = np.concatenate([poles(motion.frequency, motion.damping).ravel(), -motion.rate + 0j])
    lam = lam[lam != 0]
    return float(np.min(-2 * lam.real / ((1 - 2 * theta) * (lam.real**2 + lam.imag**2)), initial=np.inf))


def _message(operator: Operator, alpha: float, friction: float, duration: float) -> str:
    """Return what is said of a case whose contact has no unique solution."""
    h, name = operator.h, operator.contact.name

    def factor(step: float, coupling: float) -> float:
        return float(operator.factor(step, np.array(coupling), np.array(friction)))

    if factor(h, 0.0) <= 0:
        return friction_message(h, friction, name)
    limit = largest_step(lambda step: factor(step, alpha) > 0, h)
    return f"contact has no unique solution at h = {h:.6g} s ({name} <= 0 at alpha = {alpha:.6g}): " + _admissible_step(
        limit, operator.theta, duration
    )


def _admissible_step(limit: float, theta: float, duration: float) -> str:
    """Return up to which step a case without a unique solution runs; ``limit`` is that up to which W > 0.

    W falls to 0 as friction heat that stays at the tip pushes it on: about linearly, as 1 - r at h = r ``limit``. A
    pressed tip's heat then grows by the factor (1 + r (1 - θ)/θ)/(1 - r) in each step, which has no bound at the limit
    itself. Half of it is recommended, or a smaller share where that growth over the duration would leave numbers
    whose squares are finite; as r → 0 the growth is that of the model.
    """
    for share in (0.5, 0.1, 0.01) if limit > 0 else ():
        factor = (1 + share * (1 - theta) / theta) / (1 - share)
        if np.log(factor) * duration / (share * limit) < _MOST_GROWTH:
            return (
                f"{limit:.6g} s is the limit, near which the heat of a step multiplies itself; "
                f"the largest admissible h is {share * limit:.6g} s"
            )
    return (
        f"{limit:.6g} s is the limit, but there is no largest admissible h, as no step helps: the heat of a pressed "
        "tip grows out of the finite numbers within the duration; shorten it, or lower alpha"
    )
