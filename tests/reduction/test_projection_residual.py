"""What a reduced basis cannot hold, against dense projections, and its word on a hot spot."""

from dataclasses import replace

import numpy as np
import pytest

from scenes import blade, cases, chain
from studies import SCENE, parsed
from workflow.cases import arrange
from workflow.models import Structure
from workflow.reduction import Reduction, projection_residual, reduce_structure
from workflow.solve import solve


def spot(node: int, value: float, nodes: int = 20) -> np.ndarray:
    values = np.zeros(nodes)
    values[node] = value
    return values


def best_static(stiffness: np.ndarray, basis: np.ndarray, load: np.ndarray) -> float:
    """Relative energy norm of what a Galerkin solution in the basis lacks, by dense solves."""
    full = np.linalg.solve(stiffness, load)
    lacking = full - basis @ np.linalg.solve(basis.T @ stiffness @ basis, basis.T @ load)
    return float(np.sqrt(lacking @ stiffness @ lacking / (full @ stiffness @ full)))


def expected(structure: Structure, reduction: Reduction, name: str, values: np.ndarray) -> float:
    x, theta = reduction.displacement_basis, reduction.temperature_basis
    if name in ("steady", "heating"):
        static = (structure.stiffness_matrix, x) if name == "steady" else (structure.conductance_matrix, theta)
        return best_static(*static, values)
    basis, projection = x, reduction.displacement_projection
    if name == "temperature":
        basis, projection = theta, reduction.temperature_projection
    norms = {"displacement": "stiffness_matrix", "velocity": "mass", "temperature": "heat_capacity"}
    norm, lacking = getattr(structure, norms[name]), values - basis @ (projection @ values)
    return float(np.sqrt(lacking @ norm @ lacking / (values @ norm @ values)))


@pytest.mark.parametrize("by_matrices", [False, True])
@pytest.mark.parametrize("name", ["displacement", "velocity", "temperature", "steady", "heating"])
def test_a_spot_on_an_inner_node(name: str, by_matrices: bool) -> None:
    structure = blade()
    reduction = reduce_structure(structure, 3, 12)
    residual = projection_residual(
        structure.matrices() if by_matrices else structure, reduction, cases(structure, 2, **{name: spot(10, -1.0)})
    )
    assert residual == pytest.approx(expected(structure, reduction, name, spot(10, -1.0)), rel=1e-9)
    assert np.all(residual > 0.2)


def test_the_largest_share_counts_case_by_case() -> None:
    structure = blade()
    reduction = reduce_structure(structure, 3, 12)
    hot = np.array([spot(10, 100.0), spot(19, 100.0), spot(0, 0.0)])
    both = projection_residual(structure, reduction, cases(structure, 3, temperature=hot, velocity=spot(10, 1.0)))
    velocity = expected(structure, reduction, "velocity", spot(10, 1.0))
    assert both == pytest.approx(np.full(3, velocity), rel=1e-9)  # more than the temperature loses
    alone = projection_residual(structure, reduction, cases(structure, 3, temperature=hot))
    assert alone[0] == pytest.approx(expected(structure, reduction, "temperature", spot(10, 1.0)), rel=1e-9)
    assert alone[2] == 0.0


@pytest.mark.parametrize("force", [3.0, -3.0])
def test_a_mean_load_is_a_constant_load_on_its_direction(force: float) -> None:
    """It is lost beside another constant load as their sum is, wherever the load acts."""
    along, beside = spot(19, 0.2) + spot(7, 1.0), spot(10, 1.0)
    structure = replace(blade().matrices(), load=along)
    reduction = reduce_structure(structure, 3, 12)
    lost = projection_residual(structure, reduction, cases(structure, steady=beside, mean=force))
    assert lost == pytest.approx(expected(structure, reduction, "steady", beside + force * along), rel=1e-9)


def test_parts_that_nothing_holds() -> None:
    """Loads on loose parts are balanced by inertia: what then deforms them is lost without interior modes."""
    structure = chain(
        nodes=6, mass=1.0, stiffness=(0.0, 3.0, 3.0, 3.0, 0.0, 3.0), conductance=(0.0, 1.0, 1.0, 1.0, 0.0, 1.0),
        heat_capacity=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    )  # fmt: skip
    for name in ("steady", "heating"):
        batch = cases(structure, 1, **{name: spot(2, 1.0, 6)})
        full, few = reduce_structure(structure, 5, 5), reduce_structure(structure, 3, 3)
        assert projection_residual(structure, full, batch) < 1e-12
        lost = projection_residual(structure, few, batch)
        assert lost > 0.5
        assert projection_residual(structure.matrices(), few, batch) == pytest.approx(lost, rel=1e-9)


def test_it_is_a_metric_of_every_study() -> None:
    text = "study: a\n" + SCENE + "  initial: {temperature: [0, 50, 0, 0]}\n"
    modes = "zip: {model: {mechanical_modes: [1, full], thermal_modes: [1, full]}}\noutput: {interval: 1 ms}\n"
    grid = arrange(parsed(text + modes))
    assert solve(grid, 0, np.arange(1)).values["projection_residual"][0] > 0.2
    assert solve(grid, 1, np.arange(1)).values["projection_residual"][0] == 0.0
