"""Bases of structures on which a casing slides: they hold what a force along n - µt deforms."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import cases, relative, sampling, step
from sliding import random_structure
from workflow.models import Structure, critical_alpha
from workflow.reduction import names, reduce_structure


def static(structure: Structure, friction: float) -> float:
    """nᵀK1⁻¹(n - µt)."""
    assert structure.tangent is not None
    direction = np.eye(structure.mechanical_size)[-1] - friction * structure.tangent
    return float(np.linalg.solve(structure.stiffness_matrix, direction)[-1])


@pytest.mark.parametrize("basis", [name for name in names() if name not in ("macneal", "massless")])
@pytest.mark.parametrize("count", [0, 1, 4])
def test_the_static_answer_is_exact_for_every_friction(basis: str, count: int) -> None:
    full = random_structure(np.random.default_rng(4), 8, 3)
    reduced = reduce_structure(full, count, None, basis).structure
    assert reduced.mechanical_size == count + 2  # the tip's own vector, and that of friction
    for friction in (0.0, 0.3, -0.8):
        assert static(reduced, friction) == pytest.approx(static(full, friction), rel=1e-10)
    assert critical_alpha(reduced, 0.2) == pytest.approx(critical_alpha(full, 0.2), rel=1e-9)


def test_all_modes_lose_nothing() -> None:
    full = random_structure(np.random.default_rng(4), 5, 3)
    reduction = reduce_structure(full, 4, 2)
    assert reduction.structure.mechanical_size == 5
    batch = cases(full, friction=0.3, alpha=0.1, gap=1e-3, mean=4.0, velocity=0.1, e=0.5)
    over = sampling(0.1, 1e-2)
    whole = step(full, batch, 1.0, over, "event_driven")
    reduced = step(reduction.structure, reduction.project(batch), 1.0, over, "event_driven")
    assert whole.metrics["impacts"][0] > 0
    assert relative(reduced.histories["displacement"], whole.histories["displacement"]) < 1e-11


@pytest.mark.parametrize("basis", ["macneal", "massless"])
def test_a_basis_without_mass_at_the_tip_is_refused(basis: str) -> None:
    with pytest.raises(ValueError, match="without mass, and friction acts along a direction of its own"):
        reduce_structure(random_structure(np.random.default_rng(4), 8, 3), 2, None, basis)
