"""Recorder of a scheme that steps nodal states: histories, counts, load periods and balances of a whole batch.

A scheme that loops over its steps in NumPy passes the states at each step's end to :meth:`Recorder.record` and
returns :meth:`Recorder.results`. Samples, impacts, contact time, load periods and maxima are counted by the
kernels of the other fixed-step schemes (:mod:`~workflow.schemes._fixed.stepping`), with the same definitions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import kernel
from workflow.kernels.lanes import LANES, lane_table, named_rows, rows_in
from workflow.models import Cases, EndState, Structure, project, row_totals, static_growth
from workflow.schemes._fixed.balance import Balance
from workflow.schemes._fixed.loads import Start
from workflow.schemes._fixed.operator import judged
from workflow.schemes._fixed.rows import ContactRecord, Totals
from workflow.schemes._fixed.stepping import (
    WAITING,
    Batch,
    CaseBlock,
    Ended,
    batch_of,
    collect,
    count_marked,
    load_block,
    packed,
    recorded_temperatures,
    rows_of,
    store_block,
    watch,
)
from workflow.schemes._interface import Results, Sampling

States = tuple[Array, Array, Array]
"""Displacement and velocity ``(case, mechanical)``, temperature ``(case, thermal)``."""


class PlainBalance:
    """Sums of the balances of a batch, of the whole motion: see :mod:`~workflow.schemes._fixed.balance`."""

    def __init__(self, structure: Structure, cases: Cases, h: float) -> None:
        self._structure, self._cases, self._h, self._steps = structure, cases, h, 0
        contacts = structure.contacts
        self._contact_directions = contacts.normal - cases.friction[:, None, None] * contacts.tangent
        self._totals = named_rows(Totals, np.zeros((rows_in(Totals), cases.count)))
        self._totals.first_energy = self._keep(cases.displacement, cases.velocity)

    def _keep(self, x: Array, v: Array) -> Array:
        """Store the energy ½ vᵀM v + ½ xᵀK1 x at a step's end, and update the largest one."""
        kinetic = row_totals(v * project(self._structure.mass, v))
        energy = 0.5 * (kinetic + row_totals(x * project(self._structure.stiffness_matrix, x)))
        self._totals.last_energy = energy
        self._totals.largest_energy = np.maximum(self._totals.largest_energy, energy)
        return energy

    @np.errstate(over="ignore", invalid="ignore")  # of a case that is no longer finite
    def add(self, before: States, after: States, impulse: Array, load: Array) -> None:
        """Add a step from its states at both ends, its impulses ``(case, contact)`` and its load F_θ ``(case,)``."""
        structure, totals = self._structure, self._totals
        v, temperature = (0.5 * (begun + ended) for begun, ended in zip(before[1:], after[1:], strict=True))
        forces = project(structure.damping_matrix, v) + project(structure.coupling_matrix, temperature)
        work = row_totals(v * (forces - self._cases.steady)) - load * row_totals(structure.load_direction * v)
        loss = self._h * project(structure.loss_row, temperature)
        speeds = (self._contact_directions * v[:, None]).sum(axis=2)
        totals.dissipated += self._h * work + row_totals(impulse * speeds)
        totals.lost += loss
        totals.turned_over += np.abs(loss)
        totals.friction_heat += self._cases.alpha * row_totals(impulse)
        self._keep(after[0], after[1])
        self._steps += 1

    def result(self, last: States) -> Balance:
        """Return the balances up to the end of the last step, with its states."""
        content, cases = self._structure.content, self._cases
        initial = content * cases.temperature
        gained = row_totals(content * last[2] - initial)
        heating = self._steps * self._h * row_totals(self._structure.uniform_rise * cases.heating)
        return Balance(self._totals, gained, row_totals(np.abs(initial)), heating)


@kernel
def _count(step: int, batch: Batch) -> None:
    """Write the samples and load periods of a step, then count impact, contact and maxima at its end."""
    whole = batch.whole
    for first in range(0, batch.values.shape[1], whole.lanes):
        count = load_block(batch, first)
        size = first, count, packed(count), whole.steps, whole.h
        block = CaseBlock(whole.load, whole.contacts, whole.marks, whole.record, whole.drive, *size)
        count_marked(step, block)
        store_block(batch, first)


class Recorder:
    """Records a batch that is stepped with a fixed h.

    Parameters
    ----------
    structure
        The structure that is stepped, full or reduced.
    cases
        The batch, in the structure's coordinates.
    sampling
        Samples asked for, and whether balances are.
    h
        Step, s.

    Attributes
    ----------
    steps
        Number of steps to take.
    """

    def __init__(self, structure: Structure, cases: Cases, sampling: Sampling, h: float) -> None:
        self._structure, self._cases, self._h, self._contacts = structure, cases, h, structure.contacts.normal
        x, v = project(self._contacts, cases.displacement), project(self._contacts, cases.velocity)
        gap, rest = cases.casing_of_contacts(0.0)[0], np.zeros_like(x)
        begins = Start(x, v, gap, x, v, rest, rest, cases.velocity)
        self._watched = watch(structure, cases, sampling, h, begins)
        self.steps = self._watched.schedule.steps
        samples = 4 * WAITING * len(self._contacts)
        waiting = {"samples": np.zeros((samples, cases.count))}  # each block's, from step to step
        table = lane_table({**rows_of(self._watched), **waiting})
        self._rows, self._shown = table.cases["contacts"], table.cases["shown"]
        self._batch = batch_of(self._watched, table, table.lanes["samples"], LANES)
        self._growth = static_growth(structure)
        self._balances = PlainBalance(structure, cases, h) if sampling.balances else None
        self._step = 0
        self._states = cases.displacement, cases.velocity, cases.temperature
        self._before = self._states

    def load(self, share: float = 1.0) -> Array:
        """Return the load f(t) with its harmonics at a fraction of the step that is due, N, ``(case,)``."""
        return self._cases.load_at((self._step + share) * self._h)

    def record(
        self, displacement: Array, velocity: Array, temperature: Array, impulse: Array, load: Array | None = None
    ) -> None:
        """Record the end of a step.

        Parameters
        ----------
        displacement, velocity
            m and m/s, ``(case, mechanical)``.
        temperature
            K, ``(case, thermal)``.
        impulse
            Impulse p >= 0 of the casing on each contact in the step, N s, ``(case, contact)``, or ``(case,)`` for one.
        load
            The load that the step has used, whose work the balances count, N, ``(case,)``; by default the mean of
            :meth:`load` at both ends.
        """
        before, after = self._states, (displacement, velocity, temperature)
        impulse = impulse.reshape(self._cases.count, len(self._contacts))
        if self._balances is not None:
            step_load = 0.5 * (self.load(0.0) + self.load(1.0)) if load is None else load
            self._balances.add(before, after, impulse, step_load)
        self._step += 1
        self._before, self._states = before, after
        x, gap = project(self._contacts, displacement), self._cases.casing_of_contacts(self._step * self._h)[0]
        contact: Any = named_rows(ContactRecord, self._rows)
        contact["displacement_end"], contact["depth_end"], contact["step_impulse"] = x.T, (x - gap).T, impulse.T
        contact["velocity_end"] = project(self._contacts, velocity).T
        contact["temperature_end"] = recorded_temperatures(self._structure, temperature).T
        if self._structure.sensors is not None:
            self._shown[0], self._shown[1] = self._shown[1], self._structure.sensors.of(displacement, temperature).T
        _count(self._step, self._batch)

    @np.errstate(over="ignore", invalid="ignore")
    def results(self) -> Results:
        """Return the results of the batch; a case whose contacts are not finite is ``diverged``."""
        watched = self._watched
        watched.contacts[:] = self._rows
        finite = watched.finite("displacement", "velocity", "temperature")
        left = f"the state left the finite numbers at h = {self._h:.6g} s"
        reached = watched.reached(self._before[2], self._states[2])
        metrics = {
            "thermal_closing": (self._structure.contacts.growth_at_once + project(self._growth, reached)).max(axis=1)
        }
        balance = None if self._balances is None else self._balances.result(self._states)
        outcome = judged(finite, np.zeros_like(finite), str, None, left)
        end, solved = EndState(*self._states), np.zeros(self._cases.count)
        return collect(Ended(watched, metrics, balance, end, solved > 0, solved), *outcome)
