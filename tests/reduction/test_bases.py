"""What single bases promise beside the contract, with all modes and few, with friction, beside those of pyMOR."""

import numpy as np
import pytest

from scenes import blade, cases, chain, heavy_chain, sampling, step
from workflow import models, reduction
from workflow.models import Structure, critical_alpha
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
    closing = models.static_growth(reduction.structure)[0] @ (reduction.temperature_projection @ theta)
    assert closing == pytest.approx(models.static_growth(full)[0] @ theta, rel=1e-9)


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


DURATION = 0.3
FREQUENCIES = np.logspace(-3, 4, 300)
"""rad/s: the rates of the heavy chain are 0.018 to 1.8 1/s."""


def answer(structure: Structure) -> np.ndarray:
    """Temperature of the tip by a unit heat load on it, at each frequency, K/W."""
    capacity, conductance = structure.heat_capacity, structure.conductance_matrix
    tip = np.eye(len(capacity))[-1]
    return np.array([np.linalg.solve(1j * w * capacity + conductance, tip)[-1] for w in FREQUENCIES])


@pytest.mark.slow
@pytest.mark.parametrize("vectors", [4, 6, 8])
def test_what_balanced_truncation_can_do(vectors: int) -> None:
    """Its error is a law for all bases from below: the first Hankel singular value that is left out.

    Over all frequencies it is the best to be had. Bases here need right static answers (α_c) and right ones within the
    duration of a case: above 1/duration krylov is a hundred times better and more.
    """
    from pymor.core.logger import set_log_levels
    from pymor.models.iosys import LTIModel
    from pymor.reductors.bt import BTReductor
    from pymor.reductors.h2 import OneSidedIRKAReductor

    set_log_levels({"pymor": "ERROR"})
    whole = heavy_chain()
    tip = np.eye(20)[:, -1:]
    system = LTIModel.from_matrices(-whole.conductance_matrix, tip, tip.T, E=whole.heat_capacity)
    exact, least = answer(whole), system.hsv()
    others = {"balanced": BTReductor(system), "one-sided IRKA": OneSidedIRKAReductor(system, "V")}
    errors = {}
    for name, reductor in others.items():
        transfer = reductor.reduce(vectors).transfer_function
        errors[name] = np.abs(np.array([transfer.eval_tf(1j * w)[0, 0] for w in FREQUENCIES]) - exact)
    for name in reduction.names():
        small = reduce_structure(whole, None, vectors - 1, name, DURATION).structure
        errors[name] = np.abs(answer(small) - exact)
        assert errors[name].max() > 0.99 * least[vectors]
    assert errors["balanced"].max() < 2 * least[vectors:].sum()
    acting = FREQUENCIES > 1 / DURATION
    rivals = min(errors[name][acting].max() for name in others)
    assert errors["krylov"][acting].max() < 1e-2 * rivals
