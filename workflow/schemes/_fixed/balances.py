"""Balances of a batch: coefficients and sums before the march, residuals after it.

The equations are those of :mod:`workflow.schemes._fixed.balance`.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels.lanes import lane_rows, named_rows, rows_in
from workflow.models import Array, Cases, Structure, project
from workflow.schemes._fixed.balance import Account, Dense
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.decoupled import Decoupled, modes_at_tip
from workflow.schemes._fixed.free_motion import HEAT_INPUT, FreeStep, State
from workflow.schemes._fixed.rows import Totals
from workflow.schemes._fixed.start import InitialState, contact_heat
from workflow.schemes._fixed.totals import Balance, Content

REST = 1e-12
"""Fraction of the velocity that the tip load could give within the run, below which the tip is at rest: a few thousand
roundings."""


class Balances:
    """Balances of a batch: each block starts from :attr:`filled` and ends with :meth:`close`; then :meth:`result`.

    Attributes
    ----------
    account, dense
        Arguments of the kernel; all blocks of cases share their arrays.
    filled
        Rows of lanes, with the initial values of all cases in them.
    """

    def __init__(self, structure: Structure, blocks: Blocks, free: FreeStep, cases: Cases, begun: InitialState) -> None:
        modal, step = blocks.modal, blocks.step
        self._modal, self._free, self._cases, self._begun = modal, free, cases, begun
        self._content = structure.content @ modal.heat_shapes
        loss = self._content * modal.rate
        settled = project(loss, begun.settled.T)

        omega2, at_tip = modal.frequency**2, np.where(modal.is_coupled, 1.0, modes_at_tip(modal.tip))
        kinetic = modal.mass - omega2 * (step.lever - step.energy_lever) ** 2
        kinetic -= 0.5 * step.tip.h * modal.damping if step.lagged else 0.0
        v, xi = blocks.in_modes(begun.states)
        eta = xi + step.energy_lever * v
        energy = 0.5 * (project(at_tip * kinetic, v.T**2) + project(at_tip * omega2, eta.T**2))
        self._rows, self._ended_heat = np.zeros((rows_in(Totals), cases.count)), np.zeros_like(begun.heat)
        self._ended = named_rows(Totals, self._rows)
        self._ended.first_energy = self._ended.last_energy = self._ended.largest_energy = energy
        unbounded = np.inf if step.energy_lever < 0.5 * step.tip.h else 0.0
        self._ended.energy_bound = energy + unbounded
        self._ended.relative = project(modal.tip, v.T)
        self._ended.settled_loss = settled
        self._ended.lost = -step.tip.h * step.heat_theta * (settled + project(loss, begun.heat.T))
        massless = modal.mass == 0
        self._moving = 0.5 * project((step.tip.h * modal.frequency[massless]) ** 2, v[massless].T ** 2)

        n, scale = modal.tip.size, modal.heat_scale
        inputs = _energy_rows(blocks, contact_heat(blocks, cases))
        impulses, pulls = step.energy_lever * inputs[n:] - 2.0 * inputs[:n], inputs[n:]
        size2 = project(at_tip / np.maximum(kinetic, np.finfo(float).tiny), impulses.T**2)
        size2 += project(2.0 * at_tip * _half_flexibility(modal), pulls.T**2)
        self._ended.input_size = np.sqrt(size2)
        self._ended.work_bound = np.sqrt(2.0 * energy * size2)
        self._ended.square = project(at_tip * _half_flexibility(modal), inputs[n:].T ** 2)
        self.dense: Dense | None
        self.dense, filled = _dense(structure, blocks, free, begun) if needs_dense(blocks, begun) else (None, [])
        scaled, unscale = at_tip, at_tip
        if self.dense is None:
            if step.heat_counts:  # the first step of the march counts the damping of a step that ends at t = 0
                self._ended.dissipated = -project(step.tip.h * at_tip * modal.damping, v.T**2)
            scaled, unscale = at_tip * modal.tip, at_tip / np.where(at_tip, modal.tip, 1.0)
            inputs *= np.tile(unscale, 2)[:, None]
        self._sums = lane_rows(rows_in(Totals))
        self.account = Account(
            modes=np.stack([0.25 * step.tip.h * modal.damping, 0.5 * kinetic, 0.5 * omega2], axis=1)
            * unscale[:, None] ** 2,
            contact_inputs=lane_rows(2 * n),
            losses=loss / scale,
            velocity_before=lane_rows(n),
            sums=named_rows(Totals, self._sums),
            energy_lever=step.energy_lever,
            load_share=float(structure.load_direction[-1]),
            thermal_velocity=np.sum(blocks.tip * blocks.thermal_response(step.heat_gain[:, None])[..., 0]),
            heat_loss=np.sum(loss / scale * free.heat_modes[:, HEAT_INPUT]) if step.heat_counts else 0.0,
            heat_theta=step.heat_theta,
            unbounded=unbounded,
        )
        account = self.account
        self.filled = [
            (self._sums, self._rows.copy()),
            (account.velocity_before, scaled[:, None] * v),
            (account.contact_inputs, inputs),
            *filled,
        ]

    @property
    def rows(self) -> int:
        """Number of rows of lanes that every step reads; contact reads others."""
        return rows_in(Totals) + len(self.account.velocity_before)

    def close(self, part: slice, state: State) -> None:
        """Store the final values of a block's lanes, which hold the cases of ``part``."""
        count = part.stop - part.start
        self._rows[:, part] = self._sums[:, :count]
        self._ended_heat[:, part] = state.tau[:, :count]
        if not self._free.heat_counts:
            last = state.own.alpha * state.own.impulse
            self._ended.friction_heat[part] -= last[:count]

    def result(self, elapsed: float) -> Balance:
        """Return the balances after ``elapsed`` seconds."""
        modal, begun = self._modal, self._begun
        warmed = self._ended_heat / modal.heat_scale[:, None] - begun.heat + elapsed * begun.warming_modes
        initial = project(np.abs(self._content), np.abs(begun.heat + begun.settled).T)
        heating = elapsed * project(self._content, project(modal.heat_shapes.T, self._cases.heating))
        content = Content(project(self._content, warmed.T), initial, heating)
        return Balance(self._ended, content, self._rest_energy(elapsed) + self._moving)

    def _rest_energy(self, elapsed: float) -> Array:
        """Return the energy below which the tip is at rest, J, ``(case,)``.

        It is that of :data:`REST` times a bound of the load's impulse over ``elapsed`` seconds. Where load and contact
        force cancel at a gap of 0 nothing else moves, and energy and residual are both rounding.
        """
        modal, cases, begun = self._modal, self._cases, self._begun
        mobility, h = np.sum(modal.mass * modal.tip**2), self._free.tip.h
        drifts = np.abs(begun.steady).sum(axis=0) / h
        impulse = elapsed * (np.abs(cases.mean) + np.abs(cases.amplitude) + cases.load_harmonics.reach)
        return np.asarray(0.5 * mobility * (REST * impulse) ** 2 + 0.5 * (REST * elapsed * drifts) ** 2)


def needs_dense(blocks: Blocks, begun: InitialState) -> bool:
    """Tell whether the balances of modes need matrices."""
    return blocks.modal.is_coupled or blocks.pairs.size + begun.drifting.size > 0


def _energy_rows(blocks: Blocks, states: Array) -> Array:
    """Return the input, see :class:`Dense`, that adds ``states`` to blocks, ``(2 mode, column)``."""
    v, xi = blocks.in_modes(states)
    inertia, pulled = blocks.step.inertia, blocks.modal.frequency[:, None] ** 2 * xi
    impulse = project(inertia, v.T).T if inertia.ndim == 2 else inertia[:, None] * v
    return np.concatenate([-0.5 * impulse - blocks.step.energy_lever * pulled, -pulled])


def _half_flexibility(modal: Decoupled) -> Array:
    """Return 1/(2 ω²), 0 of rigid modes, ``(mode,)``."""
    return np.divide(0.5, modal.frequency**2, out=np.zeros_like(modal.frequency), where=modal.frequency > 0)


def _dense(
    structure: Structure, blocks: Blocks, free: FreeStep, begun: InitialState
) -> tuple[Dense, list[tuple[Array, Array]]]:
    """Return the matrices for the balances of modes, and their rows of lanes with initial values."""
    modal, step, C = blocks.modal, blocks.step, blocks.modal.damping_matrix
    n, count = modal.tip.size, blocks.damping.size
    unscale = np.divide(1.0, blocks.scale, out=np.zeros(count), where=modes_at_tip(blocks.scale))
    outward = np.eye(2 * n) if blocks.outward is None else blocks.outward.reshape(2 * n, 2 * count)
    load = np.zeros(n) if modal.load is None else modal.load - structure.load_direction[-1] * modal.tip
    pulls = np.zeros((2, count, len(blocks.pairs)))
    for pair, (j, k) in enumerate(blocks.pairs):
        pulls[:, j, pair] = blocks.thermal_load[:, j, k] / modal.heat_scale[k]
    steady = np.zeros((2, count, begun.steady.shape[1]))
    steady[0, begun.drifting] = begun.steady
    dense = Dense(
        outward=outward * np.tile(unscale, 2),
        off_diagonal=np.zeros((n, n)) if C is None else step.tip.h * (C - np.diag(modal.damping)),
        lagged=step.lagged,
        load=-0.5 * load,
        half_flexibility=_half_flexibility(modal),
        pair_inputs=np.ascontiguousarray(_energy_rows(blocks, pulls).T),
        constant=lane_rows(2 * n),
        states=lane_rows(2 * count),
        modal_states=lane_rows(2 * n),
        inputs=lane_rows(2 * n),
    )
    return dense, [(dense.constant, _energy_rows(blocks, steady))]
