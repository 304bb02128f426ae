"""A batch of the event-driven scheme: its cases as rows, held regimes by distinct α, and one kernel for all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, Structure, distinct_rows, project
from workflow.schemes._exact import outcome
from workflow.schemes._exact.conditions import conditions_of, penetration
from workflow.schemes._exact.held_regime import HeldRegimes
from workflow.schemes._exact.layout import Budget, Case, Thresholds, row_length, scratch
from workflow.schemes._exact.march import march
from workflow.schemes._exact.modal_system import ModalBasis, analyse, signal_inputs
from workflow.schemes._exact.record import TALLY, Record
from workflow.schemes._exact.regimes import InseparablePolesError, Regimes, fill_row
from workflow.schemes._interface import HISTORIES, Results, Sampling, Status, complete_periods, sections_of

THRESHOLDS = Thresholds(height=1e-10, speed=1e-3, force=64.0)

_REGIME_BYTES = 2**24
"""Memory of the held regimes that are known at a time."""


@dataclass(frozen=True, eq=False)
class Operator:
    """Common data of the cases of a batch; ``budget`` limits events and steps of one case."""

    basis: ModalBasis
    held: HeldRegimes
    length: int
    """Numbers of the row of a regime, see :func:`~workflow.schemes._exact.layout.tabulate`."""
    budget: Budget
    thresholds: Thresholds = THRESHOLDS

    @cached_property
    def free(self) -> Regimes:
        """The regimes of a free tip without and with thermal modes."""
        rows, free = np.empty((2, self.length)), self.basis.free
        return Regimes(rows, np.array([fill_row(rows[0], free.unheated), fill_row(rows[1], free)]))

    def conditions(self, cases: Cases, duration: float) -> Case:
        """Return the conditions of cases over a time, s."""
        return conditions_of(cases, self.basis, duration, self.budget, self.thresholds)


def make_operator(structure: Structure, budget: Budget) -> Operator:
    """Diagonalise the structure with its tip free and held.

    Raises
    ------
    InseparablePolesError
        Three poles coincide with the tip free.
    """
    basis = analyse(structure)
    size, inputs = 2 * basis.tip.size + basis.free.rate.size, signal_inputs(basis.free).size
    length = row_length(size, basis.tip.size, inputs)
    operator = Operator(basis, HeldRegimes(basis.held, length), length, budget)
    if not operator.free.separable[0]:
        raise InseparablePolesError
    return operator


def run_batch(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Run all cases that are finite; held regimes are made for as many α at a time as memory is bounded for."""
    batch = BatchRun(operator, cases, sampling)
    free, conditions, finite = operator.free, batch.conditions, np.flatnonzero(cases.finite)
    memory = scratch(conditions.modal.shape[1], conditions.waves.shape[1])
    alpha, friction, heated = cases.alpha[finite], cases.friction[finite], cases.heated[finite]
    first, regime = distinct_rows(alpha[:, None], friction[:, None], heated[:, None])
    order, most = np.argsort(regime, kind="stable"), max(1, _REGIME_BYTES // (8 * operator.length))
    for begin in range(0, first.size, most):
        some = first[begin : begin + most]
        held = operator.held.at(alpha[some], friction[some], heated[some])
        those = order[slice(*np.searchsorted(regime[order], (begin, begin + most)))]
        which, own = finite[those], regime[those] - begin
        conditions.held[which] = own
        separable = held.separable[own] & free.separable[conditions.free[which]]
        batch.ended[which[~separable]] = outcome.INSEPARABLE_POLES
        march(free.rows, held.rows, conditions, which[separable], batch.record, memory, batch.ended)
    return batch.results()


class BatchRun:
    """The conditions of the cases of a batch and the arrays of their results."""

    def __init__(self, operator: Operator, cases: Cases, sampling: Sampling):
        self.operator, self.cases, self.sampling = operator, cases, sampling
        self.conditions = operator.conditions(cases, sampling.duration)
        self.frequency = cases.period_frequency
        self.periods = complete_periods(self.frequency, sampling)
        numbers = np.arange(1, int(self.periods.max(initial=0)) + 1)
        with np.errstate(divide="ignore", invalid="ignore"):  # of constant loads
            ends = np.where(numbers <= self.periods[:, None], numbers / self.frequency[:, None], np.inf)
        self.histories = np.full((cases.count, len(HISTORIES), sampling.count), np.nan)
        self.period_values = np.full((cases.count, 7, numbers.size), np.nan)
        self.tally = np.zeros(cases.count, dtype=TALLY)
        self.ended = np.full(cases.count, outcome.INVALID)
        none = np.zeros((0, 0))
        self.record = Record(sampling.times, ends, self.histories, self.period_values, self.tally, none)

    def results(self) -> Results:
        """Return the results of the batch."""
        status = np.where(self.ended == outcome.COMPLETED, Status.OK, Status.FAILED).astype(np.int8)
        status[self.ended == outcome.NO_IMPACT_LAW] = Status.ILL_POSED
        status[self.ended == outcome.NOT_FINITE] = Status.DIVERGED
        histories = {name: self.histories[:, k].copy() for k, name in enumerate(HISTORIES)}
        share = self.period_values[:, 2] * self.frequency[:, None]
        return Results(
            histories=histories,
            metrics=self._metrics(status == Status.OK, histories["displacement"]),
            period_impulse=self.period_values[:, 0].copy(),
            period_temperature=self.period_values[:, 1].copy(),
            period_contact=share,
            status=status,
            messages=self._messages(),
            sections=sections_of(self.period_values[:, 3:], self.periods, self.histories[:, :3, 0]),
        )

    def _metrics(self, completed: NDArray[np.bool_], displacement: Array) -> dict[str, Array]:
        """Return the metrics; those of cases that did not complete are NaN, except ``steps``."""
        names = ("impacts", "contact_time", "max_temperature", "releases")
        residuals = ("energy_residual", "heat_residual") if self.sampling.balances else ()
        metrics = {name: np.where(completed, self.tally[name], np.nan) for name in names}
        metrics["steps"] = np.where(self.tally["steps"] > 0, self.tally["steps"], np.nan)
        metrics |= {name: np.full(completed.size, np.nan) for name in residuals}  # residuals of steps; there are none
        basis, modal = self.operator.basis, self.conditions.modal
        metrics["thermal_closing"] = np.where(completed, project(basis.closing, modal[:, 2 * basis.tip.size :]), np.nan)
        metrics["max_penetration"] = penetration(self.conditions, displacement, self.sampling.times)
        return metrics

    def _messages(self) -> dict[int, str]:
        """Return the messages of cases that did not complete or were extrapolated."""
        budget, messages = self.operator.budget, {}
        for i in np.flatnonzero((self.ended != outcome.COMPLETED) | (self.tally["summed_speed"] > 0)).tolist():
            if self.ended[i] != outcome.COMPLETED:
                messages[i] = outcome.failure(int(self.ended[i]), self.tally[i], budget, float(self.cases.e[i]))
            else:
                messages[i] = outcome.extrapolation(self.tally[i], budget)
        return messages
