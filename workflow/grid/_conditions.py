"""Conditions of the cases of a batch: contact law, clearance, loads and initial states as arrays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workflow.declare import Values
from workflow.models import Array, Cases, Structure, static_equilibrium
from workflow.study import Cell


def conditions(cell: Cell, structure: Structure, varying: Mapping[str, Array], count: int) -> Cases:
    """Return the cases of a batch on the full structure.

    Parameters
    ----------
    cell
        Settings that all cases of the batch share.
    structure
        The full structure, whose coordinates are the nodes.
    varying
        Values of the axes along which the cases differ, by path, each ``(case,)``.
    count
        Number of cases.

    Raises
    ------
    NoEquilibriumError
        ``initial: static`` of a structure that its constant loads move for ever.
    """
    scene = cell.scene
    nodes = structure.mechanical_size

    def of_case(path: str, value: float) -> Array:
        return np.array(np.broadcast_to(varying.get(path, np.float64(value)), (count,)), dtype=np.float64)

    def of_node(path: str, value: Values) -> Array:
        if path in varying:
            return np.repeat(np.asarray(varying[path], dtype=np.float64)[:, None], nodes, axis=1)
        return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (count, nodes)))

    load = scene.load
    gap = of_case("scene.casing.gap", scene.gap)
    mean = of_case("scene.load.mean", load.mean)
    steady = of_node("scene.load.steady", load.steady)
    heating = of_node(f"scene.{scene.model}.heating", scene.parameters.heating)
    if scene.initial == "static":
        displacement, temperature = _at_rest(structure, mean, steady, heating, gap)
        velocity = np.zeros((count, nodes))
    else:
        displacement = of_node("scene.initial.displacement", scene.initial.displacement)
        velocity = of_node("scene.initial.velocity", scene.initial.velocity)
        temperature = of_node("scene.initial.temperature", scene.initial.temperature)
    return Cases(
        e=of_case("e", cell.e),
        alpha=of_case("alpha", cell.alpha),
        gap=gap,
        mean=mean,
        amplitude=of_case("scene.load.amplitude", load.amplitude),
        frequency=of_case("scene.load.frequency", load.frequency),
        phase=of_case("scene.load.phase", load.phase),
        steady=steady,
        heating=heating,
        displacement=displacement,
        velocity=velocity,
        temperature=temperature,
    )


def _at_rest(structure: Structure, mean: Array, steady: Array, heating: Array, gap: Array) -> tuple[Array, Array]:
    """Return the static states of all cases, each distinct set of constant loads solved once."""
    load = steady.copy()
    load[:, -1] += mean
    rows = np.column_stack([load, heating, gap])
    distinct, where = np.unique(rows, axis=0, return_inverse=True)
    nodes = load.shape[1]
    states = [static_equilibrium(structure, row[:nodes], row[nodes:-1], float(row[-1])) for row in distinct]
    displacement = np.stack([x for x, _ in states])
    temperature = np.stack([theta for _, theta in states])
    return displacement[where.ravel()], temperature[where.ravel()]
