"""Refining the finite element blade: what its tip does converges; the temperature and the mass of one node do not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from scenes import cases, sampling, step
from scripts import script
from workflow.models import (
    GivenMatrices,
    Rayleigh,
    Sparse,
    static_tip_growth,
    structure_from_sparse,
    tip_flexibility,
)
from workflow.models._factors import factorised
from workflow.reduction import reduce_structure

MESHES = ((4, 6, 1), (6, 12, 1), (8, 20, 1))
PATCH = 16e-3
"""Radius of the part of the tip that takes the heat where it is no single node, m."""

ROUGH = ("displacement", "temperature of a patch")
"""Bounded only: the largest swing between impacts moves by percents with little else, as does a patch of few nodes."""


def structure(entries: Any, shares: np.ndarray) -> Sparse:
    names = ("mass", "stiffness", "coupling", "heat_capacity", "conductance", "contact")
    none = np.zeros(entries["contact"].size), np.zeros(shares.size)
    given = GivenMatrices(*(entries[name] for name in names), shares, *none, Rayleigh(8.0, 1e-6))
    assembled = structure_from_sparse(given)
    assert isinstance(assembled, Sparse)
    return assembled


def rub(blade: Sparse, basis: str) -> tuple[float, float, float]:
    """Impulse, largest displacement and temperature in five periods of a load of 20 N."""
    reduction = reduce_structure(blade, 12, 16, basis, 0.03)
    batch = cases(blade, alpha=np.array([2.0]), gap=2e-5, amplitude=20.0, frequency=150.0)
    results = step(reduction.structure, reduction.project(batch), 1e-6, sampling(0.03, 2.5e-4))
    reach = np.abs(results.histories["displacement"][0]).max()
    return float(results.histories["impulse"][0, -1]), float(reach), float(results.metrics["max_temperature"][0])


def measured(elements: tuple[int, int, int]) -> dict[str, float]:
    module = script("finite_element_blade")
    entries = module.matrices(elements)
    point = structure(entries, entries["thermal_contact"])
    near = np.linalg.norm(entries["places"] - entries["places"][:, [int(entries["thermal_contact"].argmax())]], axis=0)
    weights = np.where(near < PATCH, 1 - near / PATCH, 0.0) * np.asarray(entries["heat_capacity"].sum(axis=1)).ravel()
    patch = structure(entries, weights / weights.sum())
    tip = np.zeros(point.mechanical_size)
    tip[-1] = 1.0
    with_mass, without = rub(point, "krylov"), rub(point, "massless")
    return {
        "frequency": float(point.mechanical.modes(1).values[0]) ** 0.5,
        "flexibility": tip_flexibility(point),
        "growth": float(static_tip_growth(point).sum()),
        "impulse": with_mass[0],
        "impulse without mass": without[0],
        "displacement": with_mass[1],
        "temperature of a node": with_mass[2],
        "temperature of a patch": rub(patch, "krylov")[2],
        "mass of a node": 1 / float(factorised(point.mechanical.inertia)(tip)[-1]),
    }


@pytest.mark.slow
def test_what_converges_under_refinement_and_what_does_not() -> None:
    """810, 2808 and 6120 displacements: elements of the last mesh are half as long as those of the first."""
    pytest.importorskip("skfem")
    coarse, middle, fine = (measured(elements) for elements in MESHES)
    last = {name: abs(fine[name] / middle[name] - 1) for name in fine}
    for name, most in (
        ("frequency", 0.005),
        ("growth", 0.01),
        ("flexibility", 0.02),
        ("impulse", 0.005),
        ("impulse without mass", 0.005),
        ("displacement", 0.06),
        ("temperature of a patch", 0.05),
    ):
        assert last[name] < most, (name, coarse[name], middle[name], fine[name])
        if name not in ROUGH:
            assert last[name] < abs(middle[name] / coarse[name] - 1) + 0.005, name
    assert fine["temperature of a node"] > 1.8 * middle["temperature of a node"] > 3 * coarse["temperature of a node"]
    assert fine["mass of a node"] < 0.5 * middle["mass of a node"] < 0.2 * coarse["mass of a node"]
    assert fine["impulse without mass"] == pytest.approx(fine["impulse"], rel=0.01)
