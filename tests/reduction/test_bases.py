"""What single bases promise beside the contract."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import blade, cases, heavy_chain, sampling, step
from workflow.reduction import projection_residual, reduce_structure


def test_weakly_coupled_moves_the_tip_as_craig_bampton() -> None:
    structure = blade()
    batch = cases(structure, 1, alpha=30.0, gap=2e-5, amplitude=24.0, frequency=5.0, heating=0.1)
    displacements = {}
    for basis in ("craig_bampton", "weakly_coupled"):
        small = reduce_structure(structure, 2, 5, basis)
        run = step(small.structure, small.project(batch), 1e-4, sampling(0.5, 1e-3))
        displacements[basis] = run.histories["displacement"]
    ours, theirs = displacements["weakly_coupled"], displacements["craig_bampton"]
    assert np.abs(ours - theirs).max() < 1e-11 * np.abs(theirs).max()


def test_weakly_coupled_holds_a_warm_start_at_rest() -> None:
    structure = heavy_chain()
    small = {name: reduce_structure(structure, 0, 8, name) for name in ("craig_bampton", "weakly_coupled")}
    warm = small["craig_bampton"].temperature_basis @ np.linspace(1.0, 2.0, 9)
    forces = -structure.coupling_matrix @ warm
    rest = structure.mechanical.static_solutions(forces[None, :])[0]
    batch = cases(structure, 1, gap=1.0, temperature=warm, displacement=rest)
    lost = {name: projection_residual(structure, basis, batch)[0] for name, basis in small.items()}
    assert lost["weakly_coupled"] < 1e-10
    assert lost["craig_bampton"] > 0.01


def test_rubin_of_a_free_body_holds_its_answer_to_a_steady_push() -> None:
    """The elastic part of the inertia-relieved answer is in the span of one vector and the rigid motion."""
    springs = [2.0e7] * 20
    springs[0] = 0.0
    structure = heavy_chain(stiffness=tuple(springs))
    m = structure.masses
    push = -m / m.sum()
    push[-1] += 1.0  # a force on the tip and the inertia that balances it
    answer = np.linalg.lstsq(structure.stiffness_matrix, push, rcond=None)[0]
    shapes = reduce_structure(structure, 1, 1, "rubin").displacement_basis
    left = answer - shapes @ np.linalg.lstsq(shapes, answer, rcond=None)[0]
    assert np.linalg.norm(left) < 1e-9 * np.linalg.norm(answer)


def test_krylov_matches_the_moments_of_the_tip() -> None:
    """e_nᵀ (K1⁻¹ M)^k K1⁻¹ e_n of the reduced model for the first moments: two for each vector."""
    structure = heavy_chain()
    small = reduce_structure(structure, 3, 3, "krylov", 0.3).structure
    moments = []
    for k1, m in ((structure.stiffness_matrix, structure.mass), (small.stiffness_matrix, small.mass)):
        vector, values = np.linalg.solve(k1, np.eye(len(m))[-1]), []
        for _ in range(8):
            values.append(vector[-1])
            vector = np.linalg.solve(k1, m @ vector)
        moments.append(values)
    assert np.allclose(moments[1], moments[0], rtol=1e-8, atol=0)


def test_krylov_needs_the_duration() -> None:
    with pytest.raises(ValueError, match="duration"):
        reduce_structure(heavy_chain(), 3, 3, "krylov")
