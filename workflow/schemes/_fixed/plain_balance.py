"""Energy and heat of a scheme that steps plain states, summed over whole steps.

The states at the ends of a step are taken to the coordinates of :mod:`workflow.schemes._fixed.balance`, relative to
what heat and constant loads drag along. The energy residual is the sum of the left side of its equation with θ = 1/2,
over the largest E at a step end; the change of the heat content less αJ and heating plus the losses, over the heat
turned over, is the heat residual.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.sums import product, total
from workflow.models import Cases, Structure, project
from workflow.schemes._fixed.books import felt_modes, largest_load, rest_energy
from workflow.schemes._fixed.decoupled import decouple, start
from workflow.schemes._fixed.totals import Content, residuals

States = tuple[Array, Array, Array]
"""Displacement and velocity ``(case, mechanical)``, temperature ``(case, thermal)``."""


class _Motion(NamedTuple):
    """The relative motion at a step end: ωη, ζ ``(case, mode)``, τ ``(case, thermal mode)``, energy ``(case,)``."""

    stretch: Array
    zeta: Array
    tau: Array

    energy: Array


class PlainBalance:
    """Sums of a batch, ``(case,)`` each."""

    def __init__(self, structure: Structure, cases: Cases, h: float) -> None:
        self._modal, self._cases, self._h, self._step = decouple(structure), cases, h, 0
        self._begun = start(self._modal, cases)
        self._felt = felt_modes(self._modal.tip)
        self._content, self._losses = structure.content[None, :], structure.loss_row[None, :]
        self._before = self._first = self._relative((cases.displacement, cases.velocity, cases.temperature))
        self._largest = self._first.energy
        self._dissipated, self._lost, self._turned, self._heat = np.zeros((4, cases.count))

    def _relative(self, states: States) -> _Motion:
        """Return the relative motion in the modes with a share in the tip."""
        modal, begun, cases, t = self._modal, self._begun, self._cases, self._step * self._h
        drift, response = project(modal.response, begun.warming_modes), modal.response
        rest = project(modal.to_modes, cases.displacement) - begun.position - project(response, begun.heat)
        tau = project(modal.to_thermal, states[2]) - begun.settled - t * begun.warming_modes
        eta = project(modal.to_modes, states[0]) - rest - t * drift - project(response, tau)
        zeta = project(modal.to_modes, states[1]) - drift + project(response * modal.rate, tau)
        stretch, zeta = (modal.frequency * eta)[:, self._felt], zeta[:, self._felt]
        return _Motion(stretch, zeta, tau, 0.5 * total(stretch**2 + modal.mass[self._felt] * zeta**2, 1))

    def _dissipation(self, after: _Motion, impulse: Array, slid: Array, heat: Array) -> Array:
        """Return the energy that damping, friction and heat take in a step, less the work of load and contact, J."""
        modal, felt, before, h = self._modal, self._felt, self._before, self._h
        zeta, stretch = (0.5 * (a + b) for a, b in ((before.zeta, after.zeta), (before.stretch, after.stretch)))
        drags = product(modal.response, modal.heat_tip)[felt] * modal.frequency[felt]
        pushes = (modal.mass * product(modal.response, modal.rate * modal.heat_tip))[felt]
        near = np.where(modal.response == 0, modal.coupling, 0.0)[felt]
        work = h * modal.damping[felt] * zeta + h * project(near, 0.5 * (before.tau + after.tau))
        work -= impulse[:, None] * modal.tip[felt] + heat[:, None] * pushes
        if modal.along is not None:
            work -= slid[:, None] * modal.along[felt]
        return np.asarray(total(zeta * work + heat[:, None] * drags * stretch, 1))

    def add(self, before: States, after: States, impulse: Array, load: Array) -> None:
        """Add a step from its states at both ends, the impulse p and the load F_θ in it, N s and N, ``(case,)``."""
        h, cases = self._h, self._cases
        self._step += 1
        ended, heat = self._relative(after), cases.alpha * impulse
        load = load + self._begun.tip_force
        self._dissipated += self._dissipation(ended, h * load - impulse, cases.friction * impulse, heat)
        loss = h * project(self._losses, 0.5 * (before[2] + after[2]))[:, 0]
        self._lost += loss
        self._turned += np.abs(loss)
        self._heat += heat
        self._largest = np.maximum(self._largest, ended.energy)
        self._before = ended

    def residuals(self, last: States) -> dict[str, Array]:
        """Return ``energy_residual`` and ``heat_residual``; 0 where there is no energy, or no heat turned over."""
        cases, elapsed = self._cases, self._step * self._h
        largest = np.maximum(
            self._largest,
            rest_energy(total(self._modal.mass * self._modal.tip**2), elapsed * largest_load(cases, self._begun)),
        )
        energies = self._first.energy, self._before.energy, largest, self._dissipated
        heating = elapsed * total(cases.heating, 1)
        initial = self._content * cases.temperature
        content = Content(total(self._content * last[2] - initial, 1), total(np.abs(initial), 1), heating)
        return residuals(np.array([*energies, self._lost, self._turned, self._heat]), content)
