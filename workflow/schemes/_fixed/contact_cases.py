"""A batch of the θ-method with several contacts, or contacts without mass: its beginning, results and messages."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array, elementwise
from workflow.kernels.algebra import eigenvalues
from workflow.models import Cases, ContactBasis, Structure, analyse_contacts, poles, project, stops_together
from workflow.schemes._exact.batch import record_of, results_of
from workflow.schemes._exact.contact_batch import conditions_of, fill_first_sample, static_growth, with_contacts
from workflow.schemes._exact.contact_motion import ContactCase
from workflow.schemes._exact.event_loop import COMPLETED, NO_IMPACT_LAW, NOT_FINITE
from workflow.schemes._exact.tables import wave
from workflow.schemes._fixed.contact_steps import CasingSteps, Ending, Marks, Stepping, memory, step_cases, stepping
from workflow.schemes._fixed.loads import discrete_gains
from workflow.schemes._fixed.outcome import ROUNDING, Outcome, by_heat, judged
from workflow.schemes._fixed.step_limits import largest_stable_step, largest_step, limit_text
from workflow.schemes._fixed.stepping import period_marks
from workflow.schemes._interface import Results, Sampling, complete_periods, schedule

_AT_REST = 1e-13
"""Size of r and u at t = 0, relative to the lengths and velocities in them, up to which they are rounding: that of the
some hundred terms of a static start."""


@dataclass(frozen=True, eq=False)
class ContactSteps:
    """Common data of a batch: the structure in modes, step h [s] and θ."""

    basis: ContactBasis
    h: float
    theta: float

    @cached_property
    def bases(self) -> tuple[ContactBasis, ContactBasis]:
        """The basis without and with thermal modes."""
        return self.basis.unheated, self.basis

    @cached_property
    def steps(self) -> tuple[Stepping, Stepping]:
        """The steps of both."""
        cold, warm = (stepping(basis, self.h, self.theta) for basis in self.bases)
        return cold, warm


def make_contact_steps(structure: Structure, h: float, theta: float) -> ContactSteps:
    """Return a structure with several contacts, or one without mass, in its modes."""
    return ContactSteps(analyse_contacts(structure), h, theta)


def step_contacts(operator: ContactSteps, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    return by_heat(cases, lambda some, heated: _run(operator, some, sampling, heated))


def _run(operator: ContactSteps, cases: Cases, sampling: Sampling, heated: bool) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    basis, step, h = operator.bases[heated], operator.steps[heated], operator.h
    periods, when = complete_periods(cases.period_frequency, sampling), schedule(sampling, h)
    record, conditions = record_of(cases, sampling, periods), conditions_of(basis, cases, sampling.duration)
    record.tally["next_sample"] = 1
    fill_first_sample(record, basis, cases)
    speeds = _speeds(conditions, h, operator.theta)
    begun = _begun(basis, cases, conditions, speeds)
    marks = Marks(when.steps, when.due, when.weight, *period_marks(cases, periods, when.steps, h))
    ended, which, split = np.full(cases.count, NOT_FINITE), np.flatnonzero(cases.finite), with_contacts(record, basis)
    depth = np.zeros((cases.count, basis.contacts.count))
    casing, ending = CasingSteps(speeds, begun), Ending(ended, depth)
    step_cases(step, conditions, casing, which, split, marks, memory(step), ending)
    tally, completed = record.tally, ended == COMPLETED
    each = completed.reshape(-1, *(1,) * (tally.ndim - 1))
    metrics = {name: np.where(each, tally[name], np.nan) for name in ("impacts", "contact_time", "max_temperature")}
    metrics["max_penetration"] = np.where(each, depth.reshape(tally.shape), np.nan)
    closing = project(static_growth(basis), conditions.modal[:, 2 * basis.frequency.size :]).max(axis=1)
    metrics["thermal_closing"] = np.where(completed, closing, np.nan)
    metrics["steps"] = np.full(cases.count, float(when.steps))
    for name in ("energy_residual", "heat_residual") if sampling.balances else ():
        metrics[name] = np.full(cases.count, np.nan)  # not balanced
    status, messages = _judge(operator, cases, ended, split.tally["time"][:, 0])
    return results_of(record, cases, periods, metrics=metrics, status=status, messages=messages)


def _speeds(conditions: ContactCase, h: float, theta: float) -> Array:
    """Return V of each contact per cos ψ and sin ψ of each wave, m/s, ``(case, wave, 2, contact)``."""
    real, imaginary = (g[..., None] for g in discrete_gains(1.0, conditions.waves[:, :, wave.OMEGA], h, theta))
    cos, sin = conditions.casing[:, :, 0], conditions.casing[:, :, 1]
    return np.stack([real * cos + imaginary * sin, real * sin - imaginary * cos], axis=2)


def _begun(basis: ContactBasis, cases: Cases, conditions: ContactCase, speeds: Array) -> Array:
    """Return r and u at t = 0, ``(case, 2, contact)``.

    Contacts with mass that start on the casing and move with it, both up to rounding, have r = u = 0, and their modes
    the velocity V(0) there.
    """
    own, rows = cases.casing_harmonics, basis.contacts.normal
    x, v = project(rows, cases.displacement), project(rows, cases.velocity)
    place, moves = cases.casing_of_contacts(0.0)
    sin, cos = elementwise.sine_cosine(conditions.waves[:, :, wave.PHASE])
    begins = (speeds[:, :, 0] * cos[:, :, None] + speeds[:, :, 1] * sin[:, :, None]).sum(axis=1)
    begun = np.stack([x - place, v - begins], axis=1)
    if basis.contacts.is_compliant:
        return begun
    length = project(np.abs(rows), np.abs(cases.displacement)) + np.abs(cases.clearances) + own.reach[:, None]
    speed = project(np.abs(rows), np.abs(cases.velocity)) + np.abs(own.amplitude * own.angular).sum(axis=1)[:, None]
    held = (np.abs(x - place) <= _AT_REST * length) & (np.abs(v - moves) <= _AT_REST * speed)
    modal = conditions.modal[:, basis.frequency.size : 2 * basis.frequency.size]
    for i in np.flatnonzero(held.any(axis=1)):
        modal[i] += np.linalg.pinv(basis.normal[held[i]]) @ (begins - v)[i, held[i]]
        begun[i, 1] = basis.normal @ modal[i] - begins[i]
    begun.swapaxes(1, 2)[held] = 0.0
    return begun


def _judge(operator: ContactSteps, cases: Cases, ended: NDArray[np.int64], reached: Array) -> Outcome:
    """Return status and message of each case."""
    basis, h, theta, grown = operator.basis, operator.h, operator.theta, None
    limit = largest_stable_step(np.concatenate([_poles(basis), -basis.rate]), theta)
    if h > limit * (1 + ROUNDING):
        grown = (
            f"the free step grows at theta = {theta:g} and h = {h:.6g} s; it is stable up to h = {limit_text(limit)} s"
        )

    @cache  # a limit takes hundreds of trials
    def advice(alpha: float, friction: float) -> str:
        least = largest_step(lambda step: _is_unique(stepping(basis, step, theta), basis, alpha, friction), h)
        if least > 0:
            return f"the symmetric part of its matrix is positive definite up to h = {limit_text(least)} s"
        return (
            "friction pushes them into the casing more than contact forces push them out; lower the coefficient of "
            f"friction, {friction:.6g}"
        )

    def explain(case: int) -> str:
        return (
            f"contact has no unique solution at h = {h:.6g} s, t = {reached[case]:.6g} s, contacts "
            f"{', '.join(basis.contacts.labels)}: {advice(float(cases.alpha[case]), float(cases.friction[case]))}"
        )

    left = f"the state left the finite numbers at h = {h:.6g} s"
    return judged(ended == COMPLETED, ended == NO_IMPACT_LAW, explain, grown, left)


def _poles(basis: ContactBasis) -> NDArray[np.complex128]:
    """Return the poles of the mechanical modes with all contacts open, 1/s."""
    if basis.damping.ndim == 1:
        return poles(basis.frequency, basis.damping).ravel()
    n = basis.frequency.size
    return eigenvalues(np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(basis.frequency**2), -basis.damping]]))


def _is_unique(s: Stepping, basis: ContactBasis, alpha: float, friction: float) -> bool:
    """Whether the symmetric part of the step's matrix is positive definite; of opposite stops that of either."""
    matrix = s.law[0] + friction * s.law[1] + alpha * s.law[2]
    sets = (matrix[np.ix_(closed, closed)] for closed in stops_together(basis))
    return all(np.linalg.eigvalsh(one + one.T)[0] > 0 for one in sets)
