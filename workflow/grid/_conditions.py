"""Conditions of the cases of a batch: contact law, clearance, loads and initial states as arrays."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from workflow.declare import Values
from workflow.models import Array, Cases, Structure, static_equilibrium
from workflow.study import Cell, Initial


def conditions(cell: Cell, structure: Structure, varying: Mapping[str, Array], count: int) -> Cases:
    """Return the cases of a batch on the full structure; ``initial: static`` is left to :func:`at_rest`.

    Parameters
    ----------
    cell
        Settings that all cases of the batch share.
    structure
        The full structure; loads and initial states are given per node, or in the coordinates it was given in.
    varying
        Values of the axes along which the cases differ, by path, each ``(case,)``.
    count
        Number of cases.
    """
    scene = cell.scene

    def of_case(path: str, value: float) -> Array:
        return np.array(np.broadcast_to(varying.get(path, np.float64(value)), (count,)), dtype=np.float64)

    mechanical, thermal = structure.given_sizes

    def of_node(path: str, value: Values, size: int = mechanical) -> Array:
        if path in varying:
            return np.repeat(np.asarray(varying[path], dtype=np.float64)[:, None], size, axis=1)
        return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (count, size)))

    load = scene.load
    gap = of_case("scene.casing.gap", scene.gap)
    mean = of_case("scene.load.mean", load.mean)
    steady = of_node("scene.load.steady", load.steady)
    heating = of_node(f"scene.{scene.model}.heating", heat_load(scene.parameters), thermal)
    initial = Initial() if scene.initial == "static" else scene.initial  # see at_rest
    displacement = of_node("scene.initial.displacement", initial.displacement)
    velocity = of_node("scene.initial.velocity", initial.velocity)
    temperature = of_node("scene.initial.temperature", initial.temperature, thermal)
    cases = Cases(
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
    return cases if structure.coordinates is None else structure.coordinates.taken(cases)


def heat_load(parameters: Any) -> Values:
    """Return the constant heat load of a model's parameters, W; 0 of a model that declares no ``heating``."""
    declared = {entry.name for entry in dataclasses.fields(parameters)}
    value: Values = parameters.heating if "heating" in declared else 0.0
    return value


def at_rest(structure: Structure, cases: Cases) -> Cases:
    """Return the cases started in equilibrium under their constant loads, each distinct one solved once.

    ``structure`` is the one they are run on, reduced or full, so that none of its modes swings.

    Raises
    ------
    NoEquilibriumError
        The constant loads of a case move the structure for ever.
    """
    load = cases.steady.copy()
    load[:, -1] += cases.mean
    rows = np.column_stack([load, cases.heating, cases.gap])
    distinct, where = np.unique(rows, axis=0, return_inverse=True)
    size = load.shape[1]
    states = [static_equilibrium(structure, row[:size], row[size:-1], float(row[-1])) for row in distinct]
    displacement = np.stack([x for x, _ in states])[where.ravel()]
    temperature = np.stack([theta for _, theta in states])[where.ravel()]
    return replace(cases, displacement=displacement, temperature=temperature)
