"""Rows of the sensors of a study in the coordinates of a structure."""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.kernels import Array
from workflow.models._pair import UnusableMatricesError
from workflow.models._sensors import Sensor, Sensors
from workflow.models._structure import Coordinates, Structure

_MOVES = 1e-9
"""Part of a row, over its largest entry, up to which it is rounding: rows come from files of as many digits."""


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
