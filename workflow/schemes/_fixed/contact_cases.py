"""A batch of fixed steps with several contacts, or contacts without mass: its beginning, results and messages."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array, elementwise
from workflow.kernels.algebra import eigenvalues
from workflow.models import Cases, ContactBasis, Structure, analyse_contacts, poles, project, stops_together
from workflow.schemes._exact.batch import record_of, results_of, state_of
from workflow.schemes._exact.contact_batch import conditions_of, fill_first_sample, static_growth, with_contacts
from workflow.schemes._exact.contact_motion import ContactCase
from workflow.schemes._exact.event_loop import COMPLETED, NO_IMPACT_LAW, NOT_FINITE
from workflow.schemes._exact.tables import wave
from workflow.schemes._fixed import central
from workflow.schemes._fixed.balance import REST, Balance
from workflow.schemes._fixed.central import Differences
from workflow.schemes._fixed.contact_record import SUMS, Balancing, Ending, Marks
from workflow.schemes._fixed.contact_steps import (
    CasingSteps,
    Method,
    Stepping,
    memory,
    step_cases,
    stepping,
)
from workflow.schemes._fixed.loads import discrete_gains
from workflow.schemes._fixed.outcome import ROUNDING, Outcome, effective_restitution, judged
from workflow.schemes._fixed.step_limits import largest_stable_step, largest_step, limit_text
from workflow.schemes._fixed.stepping import period_marks
from workflow.schemes._interface import AT_REST, Results, Sampling, complete_periods, schedule


@dataclass(frozen=True, eq=False)
class ContactSteps:
    """Common data of a batch: the structure, in modes, its step h [s] and contact, and difference formulas, if any."""

    structure: Structure
    basis: ContactBasis
    h: float
    method: Method
    differences: Differences | None

    @cached_property
    def bases(self) -> tuple[ContactBasis, ContactBasis]:
        """The basis without and with thermal modes."""
        return self.basis.unheated, self.basis

    @cached_property
    def steps(self) -> tuple[Stepping, Stepping]:
        """The steps of both."""
        cold, warm = (stepping(basis, self.h, self.method) for basis in self.bases)
        return cold, warm

    def run(self, cases: Cases, sampling: Sampling, heated: bool) -> Results:
        """Step cases that all carry thermal states, or that all carry none."""
        basis, step, h, method = self.bases[heated], self.steps[heated], self.h, self.method
        cases = cases if method.rebounds else replace(cases, e=np.zeros(cases.count))
        periods, when = complete_periods(cases.period_frequency, sampling), schedule(sampling, h)
        record = record_of(cases, sampling, periods, basis.sensors)
        conditions = conditions_of(basis, cases, sampling.duration)
        record.tally["next_sample"] = 1
        casing_flexibility = 1 / method.spring if method.spring > 0 else basis.contacts.casing_flexibility
        contacts = replace(basis.contacts, casing_flexibility=casing_flexibility)
        fill_first_sample(record, replace(basis, contacts=contacts), cases)
        speeds = _speeds(conditions, h, method.theta)
        casing = CasingSteps(speeds, _begun(basis, cases, conditions, speeds, self))
        marks = Marks(when.steps, when.due, when.weight, *period_marks(cases, periods, when.steps, h))
        ended, split = np.full(cases.count, NOT_FINITE), with_contacts(record, basis)
        content = self.structure.content @ basis.heat_shapes
        begun = conditions.modal.copy()
        deepest, sums = np.zeros((cases.count, basis.contacts.count)), np.zeros(cases.count, dtype=SUMS)
        ending = Ending(ended, deepest, sums, Balancing(sampling.balances, content), begun.copy())
        step_cases(
            step,
            conditions,
            casing,
            np.flatnonzero(cases.finite),
            split,
            marks,
            memory(step, len(basis.sensors)),
            ending,
        )
        tally, completed = record.tally, ended == COMPLETED
        each = completed.reshape(-1, *(1,) * (tally.ndim - 1))
        metrics = {name: np.where(each, tally[name], np.nan) for name in ("impacts", "contact_time", "max_temperature")}
        metrics["max_penetration"] = np.where(each, ending.penetration.reshape(tally.shape), np.nan)
        closing = project(static_growth(basis), conditions.modal[:, 2 * basis.frequency.size :]).max(axis=1)
        own = {"thermal_closing": closing}
        if method.spring > 0 or not method.rebounds:
            own |= effective_restitution(ending.sums["approached"], ending.sums["separated"])
        if sampling.balances:
            own |= _balance(basis, cases, conditions, begun, content, when.steps * h, ending.sums).residuals()
        metrics |= {name: np.where(completed, values, np.nan) for name, values in own.items()}
        metrics["steps"] = np.full(cases.count, float(when.steps))
        status, messages = _judge(self, cases, ended, split.tally["time"][:, 0])
        given = {"metrics": metrics, "status": status, "messages": messages}
        given["end"] = state_of(basis.shapes, basis.heat_shapes, ending.state)
        return results_of(record, cases, periods, self.structure.sensors, **given)


def theta_steps(structure: Structure, h: float, theta: float, **contact: Any) -> ContactSteps:
    """Return the θ-method for a structure with contacts; ``contact`` are fields of :class:`Method`."""
    method = Method(theta, theta, **contact)
    return ContactSteps(structure, analyse_contacts(structure), h, method, None)


def central_steps(structure: Structure, h: float, differences: Differences, **contact: Any) -> ContactSteps:
    """Return central differences for a structure with contacts; ``contact`` are fields of :class:`Method`."""
    method = Method(0.0, float(differences.implicit_heat), True, differences.lagged, **contact)
    return ContactSteps(structure, analyse_contacts(structure), h, method, differences)


def _balance(
    basis: ContactBasis,
    cases: Cases,
    conditions: ContactCase,
    begun: Array,
    content: Array,
    elapsed: float,
    sums: NDArray[np.void],
) -> Balance:
    """Return the balances of a march over ``elapsed`` seconds, from [y, y', τ] that ``begun`` it and what it summed."""
    n = basis.frequency.size
    load = np.abs(cases.mean) + cases.load_harmonics.reach
    pushed = elapsed * (np.abs(conditions.constant[:, :n]) + load[:, None] * np.abs(basis.load))
    return Balance(
        sums.view(np.recarray),
        sums["gained"],
        initial=project(np.abs(content), np.abs(begun[:, 2 * n :])),
        heating=elapsed * project(content, conditions.constant[:, n : n + content.size]),
        rest=0.5 * ((REST * pushed) ** 2).sum(axis=1),
    )


def _speeds(conditions: ContactCase, h: float, theta: float) -> Array:
    """Return V of each contact per cos ψ and sin ψ of each wave, m/s, ``(case, wave, 2, contact)``."""
    real, imaginary = (g[..., None] for g in discrete_gains(1.0, conditions.waves[:, :, wave.OMEGA], h, theta))
    cos, sin = conditions.casing[:, :, 0], conditions.casing[:, :, 1]
    return np.stack([real * cos + imaginary * sin, real * sin - imaginary * cos], axis=2)


def _begun(basis: ContactBasis, cases: Cases, conditions: ContactCase, speeds: Array, operator: ContactSteps) -> Array:
    """Return r and u at t = 0, ``(case, 2, contact)``; of central differences u is half a step before.

    In the θ-method contacts with mass that start on the casing and move with it, both up to rounding, have r = u = 0,
    and their modes the velocity V(0) there; in central differences modes begin with w_-½.
    """
    rows, central = basis.contacts.normal, operator.method.central
    x, v = project(rows, cases.displacement), project(rows, cases.velocity)
    place, moves = cases.casing_of_contacts(0.0)
    before = operator.h * conditions.waves[:, :, wave.OMEGA] if central else 0.0
    sin, cos = elementwise.sine_cosine(conditions.waves[:, :, wave.PHASE] - before)
    begins = (speeds[:, :, 0] * cos[:, :, None] + speeds[:, :, 1] * sin[:, :, None]).sum(axis=1)
    modal = conditions.modal[:, basis.frequency.size : 2 * basis.frequency.size]
    if central:
        force = operator.method.spring * np.fmax(0.0, x - place)
        modal -= 0.5 * operator.h * _free_acceleration(basis, cases, conditions)
        along = cases.friction[:, None] * project(basis.tangent.T, force)
        modal += 0.5 * operator.h * (project(basis.normal.T, force) - along)
        v = project(basis.normal, modal)
    begun = np.stack([x - place, v - begins], axis=1)
    if basis.contacts.is_compliant or central:
        return begun
    lengths, speeds = (each[:, None] for each in cases.casing_harmonics.rounding_scales(conditions.duration))
    lengths = lengths + project(np.abs(rows), np.abs(cases.displacement)) + np.abs(cases.clearances)
    speeds = speeds + project(np.abs(rows), np.abs(cases.velocity)) + lengths / operator.h
    beside = np.fmin(np.abs(v - moves), np.abs(v - begins))
    held = (np.abs(x - place) <= AT_REST * lengths) & (beside <= AT_REST * speeds)
    for i in np.flatnonzero(held.any(axis=1)):
        modal[i] += np.linalg.pinv(basis.normal[held[i]]) @ (begins - v)[i, held[i]]
        begun[i, 1] = basis.normal @ modal[i] - begins[i]
    begun.swapaxes(1, 2)[held] = 0.0
    return begun


def _free_acceleration(basis: ContactBasis, cases: Cases, conditions: ContactCase) -> Array:
    """Return y'' at t = 0 without contact, ``(case, mode)``."""
    n = basis.frequency.size
    y, v, tau = np.split(conditions.modal, [n, 2 * n], axis=1)
    damped = project(basis.damping, v) if basis.damping.ndim == 2 else basis.damping * v
    load = conditions.constant[:, :n] + cases.load_at(0.0)[:, None] * basis.load
    return np.asarray(load - damped - basis.frequency**2 * y - project(basis.coupling, tau))


def _judge(operator: ContactSteps, cases: Cases, ended: NDArray[np.int64], reached: Array) -> Outcome:
    """Return status and message of each case."""
    basis, h, method = operator.basis, operator.h, operator.method

    @cache  # a limit takes hundreds of trials
    def advice(alpha: float, friction: float) -> str:
        least = largest_step(lambda step: _is_unique(stepping(basis, step, method), basis, alpha, friction), h)
        if least > 0:
            return f"the symmetric part of its matrix is positive definite up to h = {limit_text(least)} s"
        return (
            "friction pushes them into the casing more than contact forces push them out; lower the coefficient of "
            f"friction, {friction:.6g}"
        )

    def explain(case: int) -> str:
        own = float(cases.alpha[case]), float(cases.friction[case])
        return (
            f"contact has no unique solution at h = {h:.6g} s, t = {reached[case]:.6g} s, contacts "
            f"{', '.join(basis.contacts.labels)}: {advice(*own)}"
        )

    left = f"the state left the finite numbers at h = {h:.6g} s"
    return judged(ended == COMPLETED, ended == NO_IMPACT_LAW, explain, _grown(operator), left)


def _grown(operator: ContactSteps) -> str | None:
    """Return how the free step grows, ``None`` where it does not."""
    h, theta = operator.h, operator.method.theta
    if operator.differences is not None:
        return central.growth(operator.structure, h, operator.differences)
    limit = largest_stable_step(np.concatenate([_poles(operator.basis), -operator.basis.rate]), theta)
    if h <= limit * (1 + ROUNDING):
        return None
    return f"the free step grows at theta = {theta:g} and h = {h:.6g} s; it is stable up to h = {limit_text(limit)} s"


def _poles(basis: ContactBasis) -> NDArray[np.complex128]:
    """Return the poles of the mechanical modes with all contacts open, 1/s."""
    if basis.damping.ndim == 1:
        return poles(basis.frequency, basis.damping).ravel()
    n = basis.frequency.size
    return eigenvalues(np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(basis.frequency**2), -basis.damping]]))


def _is_unique(s: Stepping, basis: ContactBasis, alpha: float, friction: float) -> bool:
    """Whether the symmetric part of the step's matrix is positive definite; of opposite stops that of either."""
    parts = s.law[:, : basis.contacts.count, : basis.contacts.count]
    matrix = parts[0] + friction * parts[1] + alpha * parts[2]
    sets = (matrix[np.ix_(closed, closed)] for closed in stops_together(basis.contacts))
    return all(np.linalg.eigvalsh(one + one.T)[0] > 0 for one in sets)
