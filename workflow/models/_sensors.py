"""Sensors: rows of the displacements and temperatures of a structure that are recorded beside its contacts.

    value = s_x · x + s_θ · θ + Σ_i B_i x_i

x_i are the places of contacts without mass, which have a part beside that of the modes: a sensor at such a contact has
its x_i, another one as much of that part as a force on the contacts moves there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workflow.kernels import Array
from workflow.models._cases import Cases, project


@dataclass(frozen=True)
class Sensor:
    """Where a sensor is: the number of a node, a label or a vector, of displacements or ``of_heat``."""

    at: str | int
    of_heat: bool = False

    @property
    def unit(self) -> str:
        """Unit of its values; the weights of a vector are numbers."""
        return "K" if self.of_heat else "m"


@dataclass(frozen=True, eq=False)
class Sensors:
    """Rows of sensors."""

    displacement: Array
    temperature: Array
    """``displacement``, ``temperature``: s_x and s_θ, ``(sensor, mechanical)`` and ``(sensor, thermal)``."""
    shares: Array
    """B, ``(sensor, contact)``; 0 for contacts with mass."""

    def in_modes(self, shapes: Array, heat_shapes: Array) -> Array:
        """Return the rows of modal coordinates, ``(sensor, mode + thermal mode)``."""
        return np.hstack([self.displacement @ shapes, self.temperature @ heat_shapes])

    def of(self, displacement: Array, temperature: Array) -> Array:
        """Return s_x · x + s_θ · θ of states ``(case, …)``, ``(case, sensor)``."""
        return project(self.displacement, displacement) + project(self.temperature, temperature)

    def with_contacts(self, values: Array, places: Array) -> Array:
        """Return values ``(case, sensor, t)`` with those of contacts at ``places`` x_i ``(case, contact, t)``."""
        whole = values.copy()
        for contact in np.flatnonzero(self.shares.any(axis=0)):
            whole += self.shares[:, contact, None] * places[:, contact, None]
        return whole


def sensed_values(sensors: Sensors | None, cases: Cases) -> Array:
    """Return what sensors show at t = 0, but for contacts without mass, ``(case, sensor)``; none without sensors."""
    return np.zeros((cases.count, 0)) if sensors is None else sensors.of(cases.displacement, cases.temperature)
