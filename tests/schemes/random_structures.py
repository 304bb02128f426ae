"""Random structures that meet their casings, each described twice: for the package's models, and by plain matrices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from plain_structures import Plain, plain_chain, tip_last

from scenes import cases, chain
from workflow import models
from workflow.models import Array, Cases, GivenMatrices, Rayleigh, Structure, structure_from_matrices

Rng = np.random.Generator


class Described(NamedTuple):
    """A structure and its case as the package has them, and as plain matrices do; heat loads of a structure's own."""

    structure: Structure
    case: Cases
    plain: Plain
    plain_case: Cases


def random_scene(seed: int) -> Described:
    """Return a chain, matrices or a table of modes, in turn, that a load drives against its casing."""
    rng = np.random.default_rng(seed)
    structure, given, heating = (_chain, _matrices, _modes)[seed % 3](rng)
    displacement = rng.normal(0, 2e-5, given.mechanical_size) * rng.integers(0, 2)
    case = cases(
        given,
        heating=heating,
        e=rng.choice([0.0, rng.uniform(0.2, 0.9), 1.0]),
        alpha=rng.choice([0.0, rng.uniform(0, 0.5)]),
        gap=float(given.contact @ displacement) + 10 ** rng.uniform(-5.5, -4),
        mean=rng.uniform(-50, 200),
        amplitude=rng.uniform(0, 300) * rng.integers(0, 2),
        frequency=10 ** rng.uniform(1, 4),
        phase=rng.uniform(0, 6),
        steady=rng.normal(0, 50, given.mechanical_size) * rng.integers(0, 2),
        displacement=displacement,
        velocity=rng.normal(0, 0.5, given.mechanical_size) * rng.integers(0, 2),
        temperature=rng.normal(0, 5, given.thermal_size) * rng.integers(0, 2),
    )
    own = structure.coordinates
    ours = case if own is None else own.transformed(replace(case, heating=np.zeros_like(case.heating)))
    return Described(structure, ours, *tip_last(given, case))


def _damping(rng: Rng) -> Rayleigh:
    kinds = Rayleigh(), Rayleigh(rng.uniform(1, 500)), Rayleigh(rng.uniform(0, 50), 10 ** rng.uniform(-7, -5))
    return (*kinds, Rayleigh(ratio=rng.uniform(0.001, 0.05)))[rng.integers(0, 4)]


def _chain(rng: Rng) -> tuple[Structure, Plain, Array]:
    """A third has a free root, some a loose part."""
    n = int(rng.integers(1, 7))
    lumps: dict[str, Any] = {
        "nodes": n,
        "mass": rng.uniform(2e-3, 5e-2, n),
        "stiffness": 10 ** rng.uniform(5, 7, n) * (rng.random(n) < 0.9) * (np.arange(n) > (rng.random() < 0.3) - 1),
        "spacing": 1e-2,
        "expansion": 10 ** rng.uniform(-5, -4, n),
        "heat_capacity": 10 ** rng.uniform(-3, -2, n),
        "conductance": rng.uniform(0, 2, n) * (rng.random(n) < 0.9),
        "convection": rng.uniform(0, 1, n) * rng.integers(0, 2),
    }
    damping = _damping(rng)
    items = {name: value if name in ("nodes", "spacing") else tuple(value) for name, value in lumps.items()}
    return chain(**items, damping=damping), plain_chain(lumps, damping), rng.normal(0, 2, n) * rng.integers(0, 2)


def _matrices(rng: Rng) -> tuple[Structure, Plain, Array]:
    """M = GᵀmG of motions G x with mass, two or fewer without, and a temperature without heat capacity that is heated.

    Stiffnesses are whole numbers: what is free to move is so to the bit.
    """
    n, loose, t = (int(rng.integers(*bounds)) for bounds in ((2, 5), (0, 3), (2, 5)))
    size, k = n + loose, np.round(10 ** rng.uniform(5, 7, 3 * (n + loose)))
    inertial = np.hstack([np.eye(n), rng.integers(-1, 2, (n, loose)) * rng.integers(0, 2)])[:, rng.permutation(size)]
    springs = np.zeros((k.size, size))  # each to its neighbour, and between any two; the last third to the ground
    ends = np.array([[i % size, (i + 1) % size] if i < size else rng.choice(size, 2, False) for i in range(k.size)])
    springs[np.arange(k.size), ends[:, 0]] = 1
    springs[: 2 * size][np.arange(2 * size), ends[: 2 * size, 1]] = -1
    springs[2 * size :] *= rng.random() < 0.7
    root, dashpots = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    own = rng.random() < 0.3
    damping = Rayleigh() if own else _damping(rng)
    capacity, conduction = 10 ** rng.uniform(-3, -2, t), rng.uniform(0.1, 2, t + 1)
    capacity[rng.integers(0, t - 1)] *= rng.integers(0, 2)
    fluxes = np.eye(t + 1, t) - np.eye(t + 1, t, k=-1)
    fluxes[-1] *= rng.integers(0, 2)
    mass, stiffness = inertial.T @ (root @ root.T / n + np.eye(n)) @ inertial * 1e-2, springs.T @ np.diag(k) @ springs
    damper = inertial.T @ dashpots @ dashpots.T @ inertial * (10 ** rng.uniform(-2, 1) if own else 0.0)
    elsewhere = rng.normal(size=size) if rng.random() < 0.3 else None
    given = GivenMatrices(
        mass=mass,
        stiffness=stiffness,
        coupling=-springs.T @ (k[:, None] * rng.uniform(0, 1e-6, (k.size, t))),
        heat_capacity=np.diag(capacity),
        conductance=fluxes.T @ np.diag(conduction) @ fluxes,
        contact=inertial.T @ (np.eye(n)[-1] if rng.random() < 0.5 else rng.normal(size=n)),
        thermal_contact=np.eye(t)[-1],
        steady=np.zeros(size),
        heating=rng.normal(0, 5, t),
        damping=damping,
        damper=damper if own else None,
        load=elsewhere,
    )
    plain = Plain(
        mass=mass,
        damping_matrix=damping.mass * mass + damping.stiffness * stiffness + damper,
        stiffness_matrix=stiffness,
        coupling_matrix=given.coupling,
        heat_capacity=given.heat_capacity,
        conductance_matrix=given.conductance,
        contact=given.contact,
        thermal_contact=given.thermal_contact,
        load_direction=given.contact if elsewhere is None else elsewhere,
        ratio=damping.ratio,
    )
    return structure_from_matrices(given), plain, given.heating


def _modes(rng: Rng) -> tuple[Structure, Plain, Array]:
    """A table with a rigid mode or none, damping ratios alike or each of its own, and heat that moves the others."""
    n, t, rigid = int(rng.integers(1, 7)), int(rng.integers(1, 4)), int(rng.integers(0, 2))
    frequency = 10 ** rng.uniform(2, 4, n) * (np.arange(n) >= rigid)
    ratio = rng.uniform(0, 0.05, n if rng.random() < 0.5 else 1) * np.ones(n)
    coupling = rng.normal(0, 0.3, (n, t)) * (frequency > 0)[:, None]
    tip, rate, heat_tip = rng.normal(0, 10, n), 10 ** rng.uniform(0, 3, t), rng.normal(0, 20, t)
    model = models.load("modes")
    tables = np.column_stack([frequency, ratio, tip]), np.column_stack([rate, heat_tip]), coupling
    omega = 2 * np.pi * frequency
    plain = Plain(
        mass=np.eye(len(tip)),
        damping_matrix=np.diag(2 * ratio * omega),
        stiffness_matrix=np.diag(omega**2),
        coupling_matrix=coupling,
        heat_capacity=np.eye(len(rate)),
        conductance_matrix=np.diag(rate),
        contact=tip,
        thermal_contact=heat_tip,
        load_direction=tip,
    )
    return model.assemble(model.Parameters(*(tuple(map(tuple, table)) for table in tables))), plain, np.zeros(len(rate))
