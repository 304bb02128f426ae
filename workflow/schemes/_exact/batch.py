"""A batch of the event-driven scheme: cases are marched one by one, and those of one α share a held regime."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, Structure, project
from workflow.schemes._exact import outcome
from workflow.schemes._exact.conditions import load_of, penetration, tip_of
from workflow.schemes._exact.held_regime import HeldRegimes
from workflow.schemes._exact.impacts import Case, Thresholds
from workflow.schemes._exact.layout import Memory, Regime, memory
from workflow.schemes._exact.march import march
from workflow.schemes._exact.modal_system import ModalBasis, analyse
from workflow.schemes._exact.outcome import Budget
from workflow.schemes._exact.record import TALLY, Record
from workflow.schemes._exact.regimes import InseparablePolesError, regime_of
from workflow.schemes._interface import HISTORIES, Results, Sampling, Status, complete_periods, sections_of

THRESHOLDS = Thresholds(height=1e-10, speed=1e-3, force=64.0)


@dataclass(frozen=True, eq=False)
class Operator:
    """Common data of the cases of a batch; ``budget`` limits events and steps of one case."""

    basis: ModalBasis
    held: HeldRegimes
    budget: Budget
    thresholds: Thresholds = THRESHOLDS

    @cached_property
    def heated(self) -> Regime:
        """The regime of a free tip with thermal modes."""
        return regime_of(self.basis.free)

    @cached_property
    def unheated(self) -> Regime:
        """The regime of a free tip without thermal modes."""
        return regime_of(self.basis.free.unheated)


def make_operator(structure: Structure, budget: Budget) -> Operator:
    """Diagonalise the structure with its tip free and held.

    Raises
    ------
    InseparablePolesError
        Three poles coincide with the tip free.
    """
    basis = analyse(structure)
    operator = Operator(basis, HeldRegimes(basis.held), budget)
    _ = operator.unheated
    return operator


def run_batch(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Run all cases in the order of α, so that those of one α share its held regime."""
    batch = BatchRun(operator, cases, sampling)
    for i in np.argsort(cases.alpha, kind="stable"):
        batch.run(int(i))
    return batch.results()


def heat_acts(cases: Cases, i: int) -> bool:
    """Tell whether thermal states can act in case ``i``."""
    sources = cases.alpha[i], cases.friction[i], cases.heating[i], cases.temperature[i]
    return any(np.any(source != 0) for source in sources)


class MarchInput(NamedTuple):
    """Arguments of the march, without the record."""

    free: Regime
    held: Regime
    case: Case
    memories: tuple[Memory, Memory]
    tip: Array
    """φ_n, ``(mode,)``."""


class BatchRun:
    """The cases of a batch and the arrays of their results."""

    def __init__(self, operator: Operator, cases: Cases, sampling: Sampling):
        count, basis = cases.count, operator.basis
        self.operator, self.cases, self.sampling = operator, cases, sampling
        self.times = sampling.times
        self.frequency = cases.period_frequency
        self.periods = complete_periods(self.frequency, sampling)
        self.finite = cases.finite
        moving = (project(basis.to_modes, states) for states in (cases.displacement, cases.velocity))
        self.modal = np.hstack([*moving, project(basis.to_thermal, cases.temperature)])
        self.held: tuple[tuple[float, float, bool], Regime] | None = None
        self.memory: dict[tuple[int, int, int, bool, bool], Memory] = {}
        self.histories = np.full((count, len(HISTORIES), sampling.count), np.nan)
        self.period_values = np.full((count, 7, int(self.periods.max(initial=0))), np.nan)
        self.tally = np.zeros(count, dtype=TALLY)
        self.ended = np.full(count, outcome.INVALID)

    def run(self, i: int) -> None:
        """Run case ``i``."""
        if not self.finite[i]:
            return
        try:
            self.ended[i] = self._march(i)
        except InseparablePolesError:
            self.ended[i] = outcome.INSEPARABLE_POLES

    def _held(self, alpha: float, friction: float, heated: bool) -> Regime:
        """Return the held regime at α and µ; the last one is kept for the next case."""
        key = alpha, friction, heated
        if self.held is None or self.held[0] != key:
            self.held = key, self.operator.held.at(alpha, friction, heated=heated)
        return self.held[1]

    def _memory(self, regime: Regime, waves: int, *, is_free: bool) -> Memory:
        """Return the memory that cases with regimes of one size use in turn."""
        key = regime.blocks, regime.firsts, waves, regime.is_modal, is_free
        if key not in self.memory:
            self.memory[key] = memory(regime, waves)
        return self.memory[key]

    def _march(self, i: int) -> int:
        """March case ``i`` and return how it ended."""
        free, held, case, memories, _ = self.march_input(i)
        n, frequency = int(self.periods[i]), float(self.frequency[i])
        ends = np.arange(1, n + 1) / frequency if n else np.zeros(0)
        none = np.zeros((0, 0))
        record = Record(self.times, ends, self.histories[i], self.period_values[i], self.tally[i], none)
        return int(march(free, held, case, record, memories))

    def march_input(self, i: int, *, heated: bool = False) -> MarchInput:
        """Return the arguments of the march of case ``i``, with thermal states where heat acts or ``heated`` is set."""
        cases, operator, basis = self.cases, self.operator, self.operator.basis
        heated = heated or heat_acts(cases, i)
        free = operator.heated if heated else operator.unheated
        held = self._held(float(cases.alpha[i]), float(cases.friction[i]), heated)
        load, size = load_of(cases, i, self.sampling.duration), free.inward.shape[0]
        closing = basis.closing[: size - 2 * basis.tip.size]
        tip = tip_of(cases, i, basis, free, load)
        case = Case(load, tip, self.modal[i, :size], closing, operator.budget, operator.thresholds)
        waves = load.waves.shape[0]
        memories = self._memory(free, waves, is_free=True), self._memory(held, waves, is_free=False)
        return MarchInput(free, held, case, memories, basis.tip)

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
        names = ("impacts", "contact_time", "max_temperature", "thermal_closing", "releases")
        residuals = ("energy_residual", "heat_residual") if self.sampling.balances else ()
        metrics = {name: np.where(completed, self.tally[name], np.nan) for name in names}
        metrics["steps"] = np.where(self.tally["steps"] > 0, self.tally["steps"], np.nan)
        metrics |= {name: np.full(completed.size, np.nan) for name in residuals}  # residuals of steps; there are none
        metrics["max_penetration"] = penetration(self.cases, displacement, self.times)
        return metrics

    def _messages(self) -> dict[int, str]:
        """Return the messages of cases that did not complete or were extrapolated."""
        budget, messages = self.operator.budget, {}
        for i, tally in enumerate(self.tally):
            if self.ended[i] != outcome.COMPLETED:
                messages[i] = outcome.failure(int(self.ended[i]), tally, budget, float(self.cases.e[i]))
            elif tally["summed_speed"] > 0:
                messages[i] = outcome.extrapolation(tally, budget)
        return messages
