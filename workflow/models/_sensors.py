"""Sensors: rows of the displacements and temperatures of a structure that are recorded beside its contacts.

    value = s_x · x + s_θ · θ + Σ_i B_i x_i

x_i are the places of contacts without mass, which have a part beside that of the modes: a sensor at such a contact has
its x_i, another one as much of that part as a force on the contacts moves there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.kernels import Array
from workflow.models._cases import Cases, project
from workflow.models._pair import UnusableMatricesError

if TYPE_CHECKING:
    from workflow.models._structure import Coordinates, Structure

_MOVES = 1e-9
"""Part of a row, over its largest entry, up to which it is rounding: rows come from files of as many digits."""


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


def node_rows(parameters: Any, sensors: tuple[Sensor, ...], structure: Structure) -> list[Array]:
    """Return rows with a single 1 at the number of a node, from 1 on.

    Raises
    ------
    UnusableMatricesError
        There is no such node.
    """
    rows = []
    for sensor in sensors:
        size = structure.input_sizes[sensor.of_heat]
        if not isinstance(sensor.at, int) or not 1 <= sensor.at <= size:
            raise UnusableMatricesError(f"`{sensor.at}` is no node", f"write a number from 1 to {size}, the tip")
        rows.append(np.eye(1, size, sensor.at - 1)[0])
    return rows


def given_sensors(sensors: tuple[Sensor, ...], rows: list[Array], structure: Structure) -> Sensors:
    """Return sensors of a structure from their rows of the displacements, or temperatures, in which cases are given.

    Raises
    ------
    UnusableMatricesError
        A row acts on what is held, or has no mass or heat capacity.
    """
    sizes, contacts = (structure.mechanical_size, structure.thermal_size), structure.contacts
    own = np.zeros((len(rows), sizes[0])), np.zeros((len(rows), sizes[1]))
    for k, (sensor, row) in enumerate(zip(sensors, rows, strict=True)):
        own[sensor.of_heat][k] = _own(sensor, row, structure.coordinates)
    every = Sensors(*own, np.zeros((len(rows), contacts.count)))
    if not contacts.is_massless:
        return every
    apart = np.abs(every.displacement[:, None] - contacts.normal).max(axis=2)
    every.shares[apart <= _MOVES * np.abs(contacts.normal).max(axis=1)] = 1.0
    every.displacement[every.shares.any(axis=1)] = 0.0
    return every


def _own(sensor: Sensor, row: Array, given: Coordinates | None) -> Array:
    """Return a row in a structure's own coordinates."""
    if given is None:
        return row
    basis, projection = given.displacement_basis, given.displacement_projection
    if sensor.of_heat:
        basis, projection = given.temperature_basis, given.temperature_projection
    own = np.asarray(basis.T @ row)
    if np.abs(projection.T @ own - row).max() > _MOVES * np.abs(row).max():
        what, lacks = ("temperature", "heat capacity") if sensor.of_heat else ("displacement", "mass")
        raise UnusableMatricesError(f"`{sensor.at}` is held or has no {lacks}", f"choose a {what} that has {lacks}")
    return own


def sensed_values(sensors: Sensors | None, cases: Cases) -> Array:
    """Return what sensors show at t = 0, but for contacts without mass, ``(case, sensor)``; none without sensors."""
    return np.zeros((cases.count, 0)) if sensors is None else sensors.of(cases.displacement, cases.temperature)
