"""One acceptance test that every basis in the directory passes unasked, and what each of them is worth."""

from itertools import product

import numpy as np
import pytest

from scenes import blade, cases, chain, finer_chain, heavy_chain, relative, sampling, step
from workflow import reduction
from workflow.models import Cases, Chain, Structure, critical_alpha
from workflow.reduction import Reduction, reduce_structure
from workflow.schemes import HISTORIES, Results

BASES = reduction.names()
LIGHTENED = ("macneal", "massless")
"""Bases that leave out inertia: even with all vectors they are not the full model."""
EXACT = tuple(name for name in BASES if name not in LIGHTENED)


def broken() -> Chain:
    """Five unequal nodes; a broken spring frees the tip's part, a broken conductor keeps its heat in."""
    return chain(
        nodes=5, mass=(1.0, 2.0, 1.5, 1.0, 0.5), stiffness=(4.0, 3.0, 0.0, 6.0, 2.0), spacing=0.3, expansion=0.05,
        heat_capacity=(1.0, 2.0, 1.0, 3.0, 1.0), conductance=(1.0, 0.5, 0.0, 1.0, 2.0), convection=0.1,
    )  # fmt: skip


def graded() -> Chain:
    """Stiffness and conductance over six decades."""
    decades = tuple(10.0**k for k in range(6))
    return chain(nodes=6, mass=1.0, stiffness=decades, heat_capacity=1.0, conductance=decades[::-1], spacing=0.3,
                 expansion=0.05)  # fmt: skip


STRUCTURES = {"heavy": heavy_chain, "blade": blade, "broken": broken, "graded": graded}


def built(
    structure: Structure, basis: str, mechanical: int | None, thermal: int | None, time: float = 0.3
) -> Reduction:
    return reduce_structure(structure, mechanical, thermal, basis, time)


@pytest.mark.parametrize("structure", STRUCTURES.values(), ids=STRUCTURES.keys())
@pytest.mark.parametrize("basis", BASES)
def test_matrices_are_symmetric_and_definite_and_the_tip_is_a_coordinate(basis: str, structure: object) -> None:
    whole = structure()
    for count in range(whole.mechanical_size):
        reduction = built(whole, basis, count, count)
        small = reduction.structure
        assert (small.mechanical_size, small.thermal_size) == (count + (not small.contacts.is_massless), count + 1)
        for matrix in (small.mass, small.stiffness_matrix, small.heat_capacity, small.conductance_matrix):
            assert np.abs(matrix - matrix.T).max(initial=0) <= 1e-13 * np.abs(matrix).max(initial=0)
        for inertia in (small.mass, small.heat_capacity):
            assert np.linalg.eigvalsh((inertia + inertia.T) / 2).min(initial=1.0) > 0
        assert not small.contacts.is_massless or basis in LIGHTENED
        retained = [reduction.temperature_basis]
        if not small.contacts.is_massless:
            retained.append(reduction.displacement_basis)
        else:
            assert small.contacts.flexibility(0.0) > 0
        for shapes in retained:
            assert np.array_equal(shapes[-1], np.eye(count + 1)[-1])
        warmths = reduction.temperature_basis[:, :-1]
        assert np.abs(small.mass[:count, :count] - np.eye(count)).max(initial=0) < 1e-12
        for shapes, onto in (
            (reduction.displacement_basis, reduction.displacement_projection),
            (reduction.temperature_basis, reduction.temperature_projection),
        ):
            apart = np.abs(onto @ shapes - np.eye(len(onto)))
            assert apart.max(initial=0) <= 1e-11 * np.abs(shapes).max(initial=0)
        assert np.abs(warmths.T @ whole.thermal.inertia_of(warmths) - np.eye(count)).max(initial=0) < 1e-12


@pytest.mark.parametrize("structure", STRUCTURES.values(), ids=STRUCTURES.keys())
@pytest.mark.parametrize("basis", BASES)
def test_critical_alpha_is_that_of_the_full_model(basis: str, structure: object) -> None:
    whole = structure()
    exact, most = critical_alpha(whole), whole.mechanical_size - 1
    for counts in product({0, 1, 2, most // 2, most}, repeat=2):
        assert critical_alpha(built(whole, basis, *counts).structure) == pytest.approx(exact, rel=1e-6, abs=0)


def driven(structure: Structure) -> Cases:
    """Loads, heating and a bent, moving and warm start, at rates that the structure answers."""
    rng = np.random.default_rng(3)
    n = structure.mechanical_size
    return cases(
        structure, 2, e=[0.3, 0.8], alpha=[0.0, 0.5], gap=0.4, mean=0.2, amplitude=1.0, frequency=0.3,
        steady=rng.normal(size=n), heating=rng.normal(size=n), displacement=rng.uniform(-0.3, 0.3, n),
        velocity=rng.normal(size=n), temperature=rng.normal(size=n),
    )  # fmt: skip


@pytest.mark.parametrize("structure", [broken, graded])
@pytest.mark.parametrize("basis", EXACT)
def test_all_vectors_lose_nothing(basis: str, structure: object) -> None:
    whole = structure()
    most = whole.mechanical_size - 1
    reduction = built(whole, basis, most, most, 5.0)
    batch, over = driven(whole), sampling(5.0, 0.1)
    full, small = step(whole, batch, 0.01, over), step(reduction.structure, reduction.project(batch), 0.01, over)
    assert full.metrics["impacts"].min() > 0
    for name in HISTORIES:
        assert np.abs(small.histories[name] - full.histories[name]).max() < 1e-9 * np.abs(full.histories[name]).max()


def rub(structure: Structure) -> Cases:
    return cases(structure, 1, alpha=50.0, gap=5e-5, amplitude=100.0, frequency=20.0)


OVER = sampling(0.3, 1e-3)


@pytest.fixture(scope="module")
def full_runs() -> dict[int, Results]:
    return {n: step(finer_chain(n), rub(finer_chain(n)), 1e-5, OVER) for n in (20, 200)}


def error(full: Results, basis: str, nodes: int, mechanical: int | None, thermal: int | None, name: str) -> float:
    structure = finer_chain(nodes)
    reduction = built(structure, basis, mechanical, thermal)
    run = step(reduction.structure, reduction.project(rub(structure)), 1e-5, OVER)
    return relative(run.histories[name], full.histories[name])


@pytest.mark.parametrize(
    ("basis", "nodes", "thermal", "least", "most"),
    [
        ("krylov", 20, 5, 0.0, 1e-6),  # 4.0e-10
        ("krylov", 200, 7, 0.0, 2e-5),  # 5.8e-6
        ("craig_bampton", 20, 12, 8.5e-4, 9.1e-4),
        ("craig_bampton", 200, 40, 2.3e-2, 2.7e-2),
        ("weakly_coupled", 20, 12, 8.5e-4, 9.1e-4),
        ("rubin", 20, 12, 8.5e-4, 9.1e-4),
    ],
)
def test_tip_temperature_by_thermal_vectors(
    basis: str, nodes: int, thermal: int, least: float, most: float, full_runs: dict[int, Results]
) -> None:
    """Displacements are not reduced."""
    assert least <= error(full_runs[nodes], basis, nodes, None, thermal, "temperature") < most


@pytest.mark.parametrize(
    ("basis", "nodes", "most"),
    [
        ("craig_bampton", 200, 1.7e-4),  # 1.60e-4
        ("weakly_coupled", 200, 1.7e-4),  # 1.60e-4
        ("rubin", 200, 4.4e-5),  # 4.17e-5
        ("krylov", 200, 2e-8),  # 1.9e-8
        ("krylov", 20, 1e-9),  # 7.7e-10
        ("macneal", 200, 7.2e-4),  # 6.8e-4, and no less with more: contact without mass has another law
        ("massless", 200, 1.7e-3),  # 1.59e-3
    ],
)
def test_tip_displacement_by_eight_mechanical_vectors(
    basis: str, nodes: int, most: float, full_runs: dict[int, Results]
) -> None:
    assert error(full_runs[nodes], basis, nodes, 8, None, "displacement") < most


@pytest.mark.parametrize("basis", BASES)
def test_more_vectors_than_there_are_nodes_are_refused(basis: str) -> None:
    for counts in ((20, 3), (3, 20), (-1, 3)):
        with pytest.raises(ValueError, match="interior modes"):
            built(heavy_chain(), basis, *counts)


@pytest.mark.parametrize("basis", BASES)
def test_a_long_chain_is_reduced_without_its_matrices(basis: str) -> None:
    long = finer_chain(5000)
    reduction = built(long, basis, 5, 7)
    assert reduction.structure.mass.shape in ((5, 5), (6, 6))
    assert critical_alpha(reduction.structure) == pytest.approx(critical_alpha(long), rel=1e-6)
    assert np.abs(reduction.structure.mass[:5, :5] - np.eye(5)).max() < 1e-10


@pytest.mark.parametrize("basis", EXACT)
def test_a_reduction_of_a_reduction(basis: str) -> None:
    """Of all vectors of the exact model fewer are the same few, in other coordinates."""
    whole = heavy_chain(nodes=8)
    twice, once = built(built(whole, "craig_bampton", 7, 7).structure, basis, 3, 3), built(whole, basis, 3, 3)
    for name in ("mass", "stiffness_matrix", "heat_capacity", "conductance_matrix"):
        exact = np.linalg.eigvalsh(getattr(once.structure, name))
        assert np.allclose(np.linalg.eigvalsh(getattr(twice.structure, name)), exact, rtol=0, atol=1e-9 * exact.max())
