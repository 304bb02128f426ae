"""Krylov vectors of structures above 300 coordinates: what space they span, and how far rounding moves it."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import subspace_angles

from workflow.declare import File
from workflow.models import Matrices
from workflow.models.matrices import Parameters, assemble
from workflow.reduction import krylov, load
from workflow.reduction._reduction import Vectors

BLADE = Path(__file__).parents[2] / "data" / "compressor_blade_coarse.npz"
DURATION = 0.1
BASIS = load("krylov")


@lru_cache
def blade(shaken: float = 0.0) -> Matrices:
    """504 displacements and 168 temperatures, as they are or changed by so much and a rounding of each entry."""
    structure = assemble(Parameters(replace(File("", BLADE.name, str(BLADE)), shaken=shaken)))
    assert structure.is_sparse
    return structure


def within(vectors: Vectors, inertia: np.ndarray) -> np.ndarray:
    """Return the interior vectors, orthonormal in the inertia, as vectors that are plainly orthonormal."""
    return np.linalg.cholesky(inertia).T @ vectors.shapes[:, :-1]


def outside(vector: np.ndarray, vectors: Vectors, inertia: np.ndarray) -> float:
    """Return which share of a vector, 0 at the tip, the interior vectors do not hold."""
    interior, whole = vectors.shapes[:, :-1], vector.copy()
    for _ in range(2):
        vector = vector - interior @ (interior.T @ inertia @ vector)
    return float(np.sqrt(vector @ inertia @ vector / (whole @ inertia @ whole)))


def test_moments_and_modes_are_in_the_mechanical_space() -> None:
    structure = blade()
    mass = structure.mechanical.inertia.toarray()
    vectors = BASIS.mechanical(structure, 18, None)
    moment = structure.mechanical.constraint[:, 0]
    for _ in range(krylov.MOST_MOMENTS - 1):
        moment = structure.mechanical.solve(mass @ moment, held=True)
        assert outside(moment, vectors, mass) < 1e-10
    modes = structure.mechanical.modes(14, held=True).shapes
    lost = [outside(mode, vectors, mass) for mode in modes.T]
    assert max(lost[:13]) < 1e-10
    assert lost[13] > 1e-6


def test_answers_at_shifts_are_in_the_thermal_space() -> None:
    """At the first shift, of 1/duration, and the last, 10/duration here: two answers alone are all of 2 vectors."""
    structure = blade()
    capacity = structure.thermal.inertia.toarray()
    answer = structure.thermal.shifted_solver()
    heat = capacity @ structure.thermal.constraint[:, 0]
    for count in (2, 12):
        vectors = BASIS.thermal(structure, count, DURATION)
        for shift in (1 / DURATION, 10 / DURATION):
            assert outside(answer(heat, shift), vectors, capacity) < 1e-12
    repeated = answer(capacity @ answer(heat, 10.0), 10.0)  # two vectors to a shift
    assert outside(repeated, vectors, capacity) < 1e-12


@pytest.mark.parametrize("counts", [(18, 12), (96, 24)])
def test_rounding_moves_no_space(counts: tuple[int, int]) -> None:
    """Entries changed by 1e-12 and a rounding each: without the recurrence the spaces turn by 0.4 and 2e-6."""
    exact, changed = blade(), blade(1e-12)
    for kind, count in zip(("mechanical", "thermal"), counts, strict=True):
        inertia = getattr(exact, kind).inertia.toarray()
        spaces = [within(getattr(BASIS, kind)(of, count, DURATION), inertia) for of in (exact, changed)]
        assert subspace_angles(*spaces).max() < 1e-8
