"""Balances of a batch: their states and coefficients before the march, the residuals after it.

What is summed, and why, stands in :mod:`workflow.schemes._fixed.balance`.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels.lanes import fill_lanes, lane_rows
from workflow.kernels.sums import product
from workflow.models import Array, Cases, Structure, project
from workflow.schemes._fixed.balance import (
    AUDIT_HEAT_LOSS,
    AUDIT_MODE_MASS,
    AUDIT_STEADY,
    GROUP,
    SUM_ENERGY,
    SUM_FIRST_ENERGY,
    SUM_FRICTION_HEAT,
    SUM_LARGEST_ENERGY,
    SUM_LOSS_RATE,
    SUM_LOST,
    SUM_ROWS,
    SUM_SPENT,
    SUM_TURNED_OVER,
    SUM_VELOCITY,
    Audit,
)
from workflow.schemes._fixed.decoupled import Decoupled
from workflow.schemes._fixed.modal_lanes import by_mode


def grouped(*rows: Array) -> Array:
    """Return arrays ``(mode, …)`` as one, ``(mode, row, …)``, with zeros for modes that fill up the last group."""
    count = rows[0].shape[0]
    padded = np.zeros((-(-count // GROUP) * GROUP, len(rows), *rows[0].shape[1:]))
    padded[:count] = by_mode(*rows)
    return padded


class Books:
    """The balances of a batch: :meth:`open` them for a block, :meth:`close` them after it.

    Attributes
    ----------
    audit
        What the kernel takes; all blocks share its arrays.
    energy_residual, heat_residual
        Of the blocks that are closed, ``(case,)``.
    """

    def __init__(self, structure: Structure, modal: Decoupled, cases: Cases, tip_force: Array, h: float, theta: float):
        omega2, c, mu = modal.frequency**2, modal.damping, modal.rate
        inertia = modal.inertia(h, theta)
        slow = 1 + h * theta * mu
        warmth_row = product(structure.content, modal.heat_shapes) if mu.size else np.zeros(0)
        loss_row = product(structure.loss_row, modal.heat_shapes) if mu.size else np.zeros(0)
        modes = grouped(
            -(h * c + h * h * theta * omega2) / inertia,
            -h * modal.frequency / inertia,
            modal.tip / inertia,
            h / inertia,
            h * modal.frequency,
            c,
            modal.tip,
            modal.mass,
        )
        heat_modes = by_mode(-h * mu / slow, modal.heat_tip / slow, loss_row)
        coupling = np.zeros((modes.shape[0], mu.size))
        coupling[: omega2.size] = modal.coupling
        place = modal.frequency * project(modal.to_modes, cases.displacement)
        velocity = project(modal.to_modes, cases.velocity)
        tau, heating = project(modal.to_thermal, cases.temperature), project(modal.heat_shapes.T, cases.heating)
        steady = project(modal.shapes.T, cases.steady) - tip_force[:, None] * modal.tip
        force = steady - project(modal.coupling, tau)
        self._motion = grouped(velocity.T, place.T, force.T, steady.T)
        self._heat = np.ascontiguousarray(tau.T)
        self._heating_in_step = (heating * (h / slow)).T[: None if heating.any() else 0]
        energy = 0.5 * project(np.ones((1, c.size)), modal.mass * velocity**2 + place**2)[:, 0]
        self._begun = np.zeros((SUM_ROWS, cases.count))
        self._begun[[SUM_ENERGY, SUM_FIRST_ENERGY, SUM_LARGEST_ENERGY]] = energy
        self._begun[SUM_VELOCITY] = project(modal.tip[None, :], velocity)[:, 0]
        self._begun[SUM_LOSS_RATE] = project(loss_row[None, :], tau)[:, 0]
        self._content = warmth_row
        self._contained = project(warmth_row[None, :], tau)[:, 0]
        self._initial = project(np.abs(warmth_row)[None, :], np.abs(tau))[:, 0]
        self._heating = project(warmth_row[None, :], heating)[:, 0]
        self.audit = Audit(
            modes=modes,
            heat_modes=heat_modes,
            coupling=np.ascontiguousarray(coupling.reshape(modes.shape[0] // GROUP, GROUP, mu.size).swapaxes(1, 2)),
            motion=lane_rows(*self._motion.shape[:2]),
            heat=lane_rows(self._heat.shape[0]),
            heating=lane_rows(self._heating_in_step.shape[0]),
            sums=lane_rows(SUM_ROWS),
            stored_end=False,
        )
        self.energy_residual, self.heat_residual = np.zeros(cases.count), np.zeros(cases.count)

    @property
    def rows(self) -> int:
        """Rows of lanes that balances add to a step's."""
        modes, rows, _ = self.audit.motion.shape
        return int(modes * rows + self.audit.heat.shape[0] + self.audit.heating.shape[0] + SUM_ROWS)

    @property
    def residuals(self) -> dict[str, Array]:
        """The metrics that the balances give."""
        return {"energy_residual": self.energy_residual, "heat_residual": self.heat_residual}

    def open(self, part: slice) -> None:
        """Put the initial states of some cases in the lanes."""
        fill_lanes(self.audit.motion, self._motion[..., part])
        fill_lanes(self.audit.heat, self._heat[..., part])
        fill_lanes(self.audit.heating, self._heating_in_step[..., part])
        fill_lanes(self.audit.sums, self._begun[:, part])

    def close(self, part: slice, elapsed: float) -> None:
        """Take the balances of the lanes after ``elapsed`` seconds."""
        count = part.stop - part.start
        sums = self.audit.sums[:, :count]
        change = sums[SUM_ENERGY] - sums[SUM_FIRST_ENERGY] + sums[SUM_SPENT]
        self.energy_residual[part] = share(change, sums[SUM_LARGEST_ENERGY])
        content = product(self._content, self.audit.heat)[:count]
        heating = elapsed * self._heating[part]
        change = content - self._contained[part] - sums[SUM_FRICTION_HEAT] - heating + sums[SUM_LOST]
        turned = sums[SUM_FRICTION_HEAT] + np.abs(heating) + sums[SUM_TURNED_OVER] + self._initial[part]
        self.heat_residual[part] = share(change, turned)


def no_audit() -> Audit:
    """Return what the kernel takes where no balances are asked for."""
    return Audit(
        modes=np.zeros((0, AUDIT_MODE_MASS + 1)),
        heat_modes=np.zeros((0, AUDIT_HEAT_LOSS + 1)),
        coupling=np.zeros((0, 0, GROUP)),
        motion=lane_rows(0, AUDIT_STEADY + 1),
        heat=lane_rows(0),
        heating=lane_rows(0),
        sums=lane_rows(0),
        stored_end=False,
    )


def share(part: Array, whole: Array) -> Array:
    """Return part/whole, 0 where the whole is 0."""
    nothing = whole == 0
    return np.where(nothing, 0.0, part / np.where(nothing, 1.0, whole))
