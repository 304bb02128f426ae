"""The reduction against the full structure: nothing lost with all modes, little with few."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import cases, chain, sampling, step
from workflow import models
from workflow.models import Structure, critical_alpha
from workflow.reduction import reduce_structure


def free_chain(nodes: int) -> Structure:
    return chain(
        nodes=nodes, mass=1e-3, stiffness=(0.0, *[1e6] * (nodes - 1)), damping=models.Rayleigh(10.0, 0.0),
        spacing=1e-2, expansion=1e-5, heat_capacity=1e-2, conductance=0.1,
    )  # fmt: skip


@pytest.mark.parametrize("nodes", [3, 4, 6, 20, 60])
@pytest.mark.parametrize("by_matrices", [False, True])
def test_a_free_root_without_interior_modes(nodes: int, by_matrices: bool) -> None:
    """Rank decides where one vector is left: a rigid body, which heat does not strain, and no critical coupling.

    The quasi-static growth of the tip is that of the full structure.
    """
    full = free_chain(nodes)
    reduction = reduce_structure(full.matrices() if by_matrices else full, 0, nodes - 1)
    assert critical_alpha(reduction.structure) == np.inf
    assert models.mechanical_modes(reduction.structure).values[0] == 0.0
    theta = np.linspace(0, 1e-3, nodes)
    closing = models.static_tip_growth(reduction.structure) @ (reduction.temperature_projection @ theta)
    assert closing == pytest.approx(models.static_tip_growth(full) @ theta, rel=1e-9)


@pytest.mark.parametrize("modes", [0, 1, 3])
def test_every_scheme_gives_the_growth_of_a_free_root(modes: int) -> None:
    """Schemes with a fixed step took it from the modes that are left, so that it was 0 with none."""
    reduction = reduce_structure(free_chain(4), modes, None)
    batch = reduction.project(cases(free_chain(4), gap=1.0, temperature=[[10.0, 20.0, 50.0, 100.0]]))
    for scheme, options in (("moreau", {}), ("carpenter", {}), ("penalty", {"stiffness": 1e7}), ("event_driven", {})):
        run = step(reduction.structure, batch, 1e-7, sampling(1e-6, 1e-6), scheme, **options)
        assert run.metrics["thermal_closing"][0] == pytest.approx(7.75000125e-6, rel=1e-7), scheme


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
