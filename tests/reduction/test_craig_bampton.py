"""The reduction against the full structure: nothing lost with all modes, little with few."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import blade, blade_rub, cases, chain, relative, sampling, step
from studies import parsed
from workflow import models
from workflow.grid import arrange, solve
from workflow.models import critical_alpha, growth_rate
from workflow.reduction import reduce_structure
from workflow.schemes import HISTORIES, Results


def reduced_run(mechanical: int, thermal: int) -> Results:
    structure = blade()
    reduction = reduce_structure(structure, mechanical, thermal)
    return step(reduction.structure, reduction.project(blade_rub(structure)), 1e-4, sampling(2.0, 1e-3))


@pytest.fixture(scope="module")
def full_run() -> Results:
    structure = blade()
    return step(structure, blade_rub(structure), 1e-4, sampling(2.0, 1e-3))


def test_all_modes_lose_nothing(full_run: Results) -> None:
    reduced = reduced_run(19, 19)
    for name in HISTORIES:
        scale = np.abs(full_run.histories[name]).max()
        assert np.abs(reduced.histories[name] - full_run.histories[name]).max() < 1e-10 * scale


def test_all_modes_lose_nothing_with_loads_heating_and_a_bent_start() -> None:
    structure = chain(
        nodes=5, mass=(1.0, 2.0, 1.5, 1.0, 0.5), stiffness=(4.0, 3.0, 0.0, 6.0, 2.0), spacing=0.3, expansion=0.05,
        heat_capacity=(1.0, 2.0, 1.0, 3.0, 1.0), conductance=(1.0, 0.5, 0.0, 1.0, 2.0), convection=0.1,
    )  # fmt: skip
    rng = np.random.default_rng(3)
    batch = cases(
        structure, 2, e=[0.3, 0.8], alpha=[0.0, 0.5], gap=0.4, mean=0.2, amplitude=1.0, frequency=0.3,
        steady=rng.normal(size=5), heating=rng.normal(size=5), displacement=rng.uniform(-0.3, 0.3, 5),
        velocity=rng.normal(size=5), temperature=rng.normal(size=5),
    )  # fmt: skip
    reduction = reduce_structure(structure, 4, 4)
    over = sampling(5.0, 0.1)
    full, reduced = step(structure, batch, 0.01, over), step(reduction.structure, reduction.project(batch), 0.01, over)
    assert full.metrics["impacts"].min() > 0
    for name in HISTORIES:
        assert np.abs(reduced.histories[name] - full.histories[name]).max() < 1e-10 * np.abs(full.histories[name]).max()


def test_few_modes_lose_little_on_the_abstract_figure(full_run: Results) -> None:
    reduced = reduced_run(3, 12)
    assert relative(reduced.histories["displacement"], full_run.histories["displacement"]) < 0.01
    assert relative(reduced.histories["temperature"], full_run.histories["temperature"]) < 0.02


def test_temperature_error_falls_as_thermal_modes_are_added(full_run: Results) -> None:
    errors = [
        relative(reduced_run(3, thermal).histories["temperature"], full_run.histories["temperature"])
        for thermal in (3, 4, 8, 12, 19)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] < 0.15
    assert errors[-1] < 1e-5  # what three mechanical modes leave


def test_static_answers_are_kept_by_any_number_of_modes() -> None:
    """The constraint modes carry S and β: α_c needs no interior mode at all."""
    structure = blade()
    for mechanical, thermal in ((0, 0), (1, 4), (3, 12)):
        reduced = reduce_structure(structure, mechanical, thermal).structure
        assert critical_alpha(reduced) == pytest.approx(critical_alpha(structure), rel=1e-10)
        assert reduced.mechanical_size == mechanical + 1
        assert reduced.thermal_size == thermal + 1
    full = growth_rate(structure, 30.0)
    assert growth_rate(reduce_structure(structure, 3, 12).structure, 30.0) == pytest.approx(full, rel=0.003)


def test_tip_is_kept_as_it_is() -> None:
    structure = blade(6)
    reduction = reduce_structure(structure, 2, 3)
    rng = np.random.default_rng(0)
    batch = cases(structure, 3, displacement=rng.normal(size=(3, 6)), temperature=rng.normal(size=(3, 6)))
    small = reduction.project(batch)
    assert np.array_equal(small.displacement[:, -1], batch.displacement[:, -1])
    assert np.array_equal(small.temperature[:, -1], batch.temperature[:, -1])
    assert np.array_equal(reduction.displacement_basis[-1], [0, 0, 1])
    assert np.array_equal(reduction.temperature_basis[-1], [0, 0, 0, 1])


def test_parts_not_linked_to_the_tip_have_no_constraint_mode() -> None:
    structure = chain(nodes=4, mass=1.0, stiffness=(0.0, 3.0, 0.0, 2.0), conductance=(1.0, 0.0, 1.0, 0.0))
    reduction = reduce_structure(structure, 1, 1)
    assert np.allclose(reduction.displacement_basis[:, -1], [0, 0, 1, 1], atol=1e-14)
    assert np.allclose(reduction.temperature_basis[:, -1], [0, 0, 0, 1], atol=1e-14)


@pytest.mark.parametrize("nodes", [3, 4, 6, 20, 60])
@pytest.mark.parametrize("by_matrices", [False, True])
def test_a_free_root_without_interior_modes(nodes: int, by_matrices: bool) -> None:
    """Rank decides where one vector is left: a rigid body, which heat does not strain, and no critical coupling.

    The quasi-static growth of the tip is that of the full structure.
    """
    full = chain(
        nodes=nodes, mass=1e-3, stiffness=(0.0, *[1e6] * (nodes - 1)), damping=models.Rayleigh(10.0, 0.0),
        spacing=1e-2, expansion=1e-5, heat_capacity=1e-2, conductance=0.1,
    )  # fmt: skip
    reduction = reduce_structure(full.matrices() if by_matrices else full, 0, nodes - 1)
    assert critical_alpha(reduction.structure) == np.inf
    assert models.mechanical_modes(reduction.structure).values[0] == 0.0
    theta = np.linspace(0, 1e-3, nodes)
    closing = models.static_tip_growth(reduction.structure) @ (reduction.temperature_projection @ theta)
    assert closing == pytest.approx(models.static_tip_growth(full) @ theta, rel=1e-9)


@pytest.mark.parametrize("modes", [0, 1, 3])
def test_every_scheme_gives_the_growth_of_a_free_root(modes: int) -> None:
    """Schemes with a fixed step took it from the modes that are left, so that it was 0 with none."""
    text = f"""
study: free
scene:
  chain: {{nodes: 4, mass: 1.0e-3, stiffness: [0, 1.0e6, 1.0e6, 1.0e6], damping: {{mass: 10}}, spacing: 1.0e-2,
          expansion: 1.0e-5, heat_capacity: 1.0e-2, conductance: 0.1}}
  casing: {{gap: 1}}
  initial: {{temperature: [10, 20, 50, 100]}}
  duration: 1.0e-6
schemes: {{spring: {{method: penalty, stiffness: 1.0e+7}}}}
axes: {{scheme: [moreau, carpenter, spring, event_driven], h: 1.0e-7, mechanical_modes: {modes}}}
output: {{interval: 1.0e-6}}
"""
    grid = arrange(parsed(text))
    closing = [solve(grid, outer, np.arange(grid.inner_count)).values["thermal_closing"] for outer in grid.places]
    assert np.ravel(closing) == pytest.approx(np.full(4, 7.75000125e-6), rel=1e-7)


def test_insulated_without_thermal_modes() -> None:
    """The same rank for heat: all of it stays, so that any coupling runs away."""
    for nodes in (3, 7, 20, 60):
        full = chain(
            nodes=nodes, mass=1.0, stiffness=5.0, spacing=0.1, expansion=1e-3,
            conductance=(0.0, *np.random.default_rng(nodes).uniform(0.5, 2, nodes - 1)),
        )  # fmt: skip
        for structure in (full, full.matrices()):
            reduced = reduce_structure(structure, nodes - 1, 0).structure
            assert models.thermal_modes(reduced).values[0] == 0.0
            assert critical_alpha(reduced) == 0.0


def test_reduction_of_a_reduced_structure() -> None:
    """Full model in, model of the same type out: it goes in again."""
    once = reduce_structure(blade(12), 6, 8).structure
    twice = reduce_structure(once, 2, 4).structure
    assert twice.mechanical_size == 3
    direct = reduce_structure(blade(12), 2, 4).structure
    first = models.mechanical_modes(twice).values[0]
    assert first == pytest.approx(models.mechanical_modes(direct).values[0], rel=1e-6)


@pytest.mark.parametrize("modes", [(6, 0), (0, 6), (-1, 0)])
def test_more_modes_than_there_are(modes: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="interior modes"):
        reduce_structure(blade(6), *modes)
