"""Balances of energy and heat of a scheme that steps nodal states, summed over whole steps.

They are those of the whole motion, with its midpoint values: see :mod:`workflow.schemes._fixed.balance`.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.kernels.lanes import named_rows, rows_in
from workflow.models import Cases, Structure, directions, project
from workflow.schemes._fixed.balance import Balance
from workflow.schemes._fixed.rows import Totals

States = tuple[Array, Array, Array]
"""Displacement and velocity ``(case, mechanical)``, temperature ``(case, thermal)``."""


def row_totals(terms: Array) -> Array:
    """Return the sum of each row, ``(row,)``, with the same bits for a case alone and among others."""
    return np.asarray(np.ascontiguousarray(terms).sum(axis=1))


class PlainBalance:
    """Sums of the balances of a batch."""

    def __init__(self, structure: Structure, cases: Cases, h: float) -> None:
        self._structure, self._cases, self._h, self._steps = structure, cases, h, 0
        self._pushes = directions(structure, cases.friction)
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
        """Add a step from its states at both ends, the impulse p and the load F_θ in it, N s and N, ``(case,)``."""
        structure, totals = self._structure, self._totals
        v, temperature = (0.5 * (begun + ended) for begun, ended in zip(before[1:], after[1:], strict=True))
        forces = project(structure.damping_matrix, v) + project(structure.coupling_matrix, temperature)
        work = row_totals(v * (forces - self._cases.steady)) - load * row_totals(structure.load_direction * v)
        loss = self._h * project(structure.loss_row, temperature)
        totals.dissipated += self._h * work + impulse * row_totals(self._pushes * v)
        totals.lost += loss
        totals.turned_over += np.abs(loss)
        totals.friction_heat += self._cases.alpha * impulse
        self._keep(after[0], after[1])
        self._steps += 1

    def result(self, last: States) -> Balance:
        """Return the balances up to the end of the last step, with its states."""
        content, cases = self._structure.content, self._cases
        initial = content * cases.temperature
        gained = row_totals(content * last[2] - initial)
        heating = self._steps * self._h * row_totals(self._structure.uniform_rise * cases.heating)
        return Balance(self._totals, gained, row_totals(np.abs(initial)), heating)
