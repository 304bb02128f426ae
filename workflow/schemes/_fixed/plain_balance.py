"""Energy and heat of a scheme that steps plain states, summed over whole steps.

A structure that modes separate is counted as in :mod:`workflow.schemes._fixed.balance` with θ = 1/2, the states at the
ends of a step taken to its coordinates; one that needs matrices as in :mod:`workflow.schemes._fixed.dense_balance`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.models import Cases, Structure, directions, project
from workflow.schemes._fixed import total_row
from workflow.schemes._fixed.decoupled import decouple, felt_modes, start
from workflow.schemes._fixed.modal_balance import rest_energy
from workflow.schemes._fixed.totals import Balance, content_of, row_totals

States = tuple[Array, Array, Array]
"""Displacement and velocity ``(case, mechanical)``, temperature ``(case, thermal)``."""


class PlainBalance:
    """Sums of a batch; ``coupled`` where its structure needs matrices."""

    def __init__(self, structure: Structure, cases: Cases, h: float, coupled: bool) -> None:
        self._structure, self._cases, self._h, self._step = structure, cases, h, 0
        self._motion = (_InMatrices if coupled else _InModes)(structure, cases, h)
        self._totals = np.zeros((total_row.ROWS, cases.count))
        self._keep(self._motion.first)
        self._totals[total_row.FIRST_ENERGY] = self._motion.first

    def _keep(self, energy: Array) -> None:
        self._totals[total_row.LAST_ENERGY] = energy
        self._totals[total_row.LARGEST_ENERGY] = np.maximum(self._totals[total_row.LARGEST_ENERGY], energy)

    @np.errstate(over="ignore", invalid="ignore")  # of a case that leaves the finite numbers
    def add(self, before: States, after: States, impulse: Array, load: Array) -> None:
        """Add a step from its states at both ends, the impulse p and the load F_θ in it, N s and N, ``(case,)``."""
        self._step += 1
        dissipated, energy = self._motion.step(before, after, impulse, load)
        loss = self._h * project(self._structure.loss_row, 0.5 * (before[2] + after[2]))
        self._totals[total_row.DISSIPATED] += dissipated
        self._totals[total_row.LOST] += loss
        self._totals[total_row.TURNED_OVER] += np.abs(loss)
        self._totals[total_row.FRICTION_HEAT] += self._cases.alpha * impulse
        self._keep(energy)

    def result(self, last: States) -> Balance:
        """Return the balances up to the end of the last step, with its states."""
        elapsed = self._step * self._h
        heat = content_of(self._structure, self._cases, last[2], elapsed)
        return Balance(self._totals, heat, self._motion.rest(elapsed))


class _InMatrices:
    """Energy of the whole motion, J, ``(case,)``."""

    def __init__(self, structure: Structure, cases: Cases, h: float) -> None:
        self._structure, self._cases, self._h = structure, cases, h
        self._pushes = directions(structure, cases.friction)
        self.first = self._energy(cases.displacement, cases.velocity)

    def _energy(self, x: Array, v: Array) -> Array:
        kinetic = row_totals(v * project(self._structure.mass, v))
        return 0.5 * (kinetic + row_totals(x * project(self._structure.stiffness_matrix, x)))

    def step(self, before: States, after: States, impulse: Array, load: Array) -> tuple[Array, Array]:
        """Return the energy that a step dissipates less the work of load and contact, and that at its end."""
        structure = self._structure
        v, temperature = (0.5 * (begun + ended) for begun, ended in zip(before[1:], after[1:], strict=True))
        forces = project(structure.damping_matrix, v) + project(structure.coupling_matrix, temperature)
        work = row_totals(v * (forces - self._cases.steady))
        driven, pushed = row_totals(structure.load_direction * v), row_totals(self._pushes * v)
        return self._h * (work - load * driven) + impulse * pushed, self._energy(after[0], after[1])

    def rest(self, elapsed: float) -> Array:
        """Return the energy below which all is rounding: none is known."""
        return np.zeros(self._cases.count)


class _Relative(NamedTuple):
    """The relative motion at a step end: ωη, ζ ``(case, mode)``, τ ``(case, thermal mode)``, energy ``(case,)``."""

    stretch: Array
    zeta: Array
    tau: Array
    energy: Array


class _InModes:
    """Energy of the motion relative to what heat and constant loads drag along, J, ``(case,)``."""

    def __init__(self, structure: Structure, cases: Cases, h: float) -> None:
        self._modal, self._cases, self._h, self._steps = decouple(structure), cases, h, 0
        self._begun = start(self._modal, cases)
        self._felt = felt_modes(self._modal.tip)
        self._before = self._relative((cases.displacement, cases.velocity, cases.temperature))
        self.first = self._before.energy

    def _relative(self, states: States) -> _Relative:
        """Return the relative motion in the modes with a share in the tip."""
        modal, begun, cases, t = self._modal, self._begun, self._cases, self._steps * self._h
        drift, response = project(modal.response, begun.warming_modes), modal.response
        rest = project(modal.to_modes, cases.displacement) - begun.position - project(response, begun.heat)
        tau = project(modal.to_thermal, states[2]) - begun.settled - t * begun.warming_modes
        eta = project(modal.to_modes, states[0]) - rest - t * drift - project(response, tau)
        zeta = project(modal.to_modes, states[1]) - drift + project(response * modal.rate, tau)
        stretch, zeta = (modal.frequency * eta)[:, self._felt], zeta[:, self._felt]
        return _Relative(stretch, zeta, tau, 0.5 * row_totals(stretch**2 + modal.mass[self._felt] * zeta**2))

    def _dissipation(self, after: _Relative, impulse: Array, slid: Array, heat: Array) -> Array:
        """Return the energy that damping, friction and heat take in a step, less the work of load and contact, J."""
        modal, felt, before, h = self._modal, self._felt, self._before, self._h
        zeta, stretch = (0.5 * (a + b) for a, b in ((before.zeta, after.zeta), (before.stretch, after.stretch)))
        drags = (modal.response @ modal.heat_tip)[felt] * modal.frequency[felt]
        pushes = (modal.mass * (modal.response @ (modal.rate * modal.heat_tip)))[felt]
        near = np.where(modal.response == 0, modal.coupling, 0.0)[felt]
        work = h * modal.damping[felt] * zeta + h * project(near, 0.5 * (before.tau + after.tau))
        work -= impulse[:, None] * modal.tip[felt] + heat[:, None] * pushes
        if modal.along is not None:
            work -= slid[:, None] * modal.along[felt]
        return row_totals(zeta * work + heat[:, None] * drags * stretch)

    def step(self, before: States, after: States, impulse: Array, load: Array) -> tuple[Array, Array]:
        """Return the energy that a step dissipates less the work of load and contact, and that at its end."""
        self._steps += 1
        ended, heat = self._relative(after), self._cases.alpha * impulse
        driven = self._h * (load + self._begun.tip_force) - impulse
        dissipated = self._dissipation(ended, driven, self._cases.friction * impulse, heat)
        self._before = ended
        return dissipated, ended.energy

    def rest(self, elapsed: float) -> Array:
        """Return the energy below which the tip is at rest."""
        return rest_energy(self._modal, self._cases, self._begun, elapsed)
