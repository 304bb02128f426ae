"""Assembly of the lumps, modes, equilibrium, runaway and reach against what can be written by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scenes import cases, chain, heavy_chain, sampling, static_equilibrium, step, with_dashpot
from workflow import models
from workflow.models import NoEquilibriumError, Rayleigh, Structure, critical_alpha, distinct_rows, free_reach, project
from workflow.reduction import reduce_structure


def test_chain_of_two_by_hand() -> None:
    """Equation (1): K1 and K12 from N_i = k_i (x_i - x_{i-1} - a ℓ_i (θ_{i-1} + θ_i)/2)."""
    structure = chain(
        nodes=2,
        mass=(1.0, 2.0),
        stiffness=(3.0, 5.0),
        spacing=(0.1, 0.2),
        expansion=(0.01, 0.02),
        heat_capacity=(7.0, 8.0),
        conductance=(0.3, 0.5),
        convection=(0.01, 0.02),
        damping=Rayleigh(0.4, 0.05),
    )
    k1 = np.array([[8.0, -5.0], [-5.0, 5.0]])
    f1, f2 = 3.0 * 0.01 * 0.1 / 2, 5.0 * 0.02 * 0.2 / 2  # k a ℓ / 2
    assert np.allclose(structure.stiffness_matrix, k1, rtol=1e-15)
    assert np.allclose(structure.coupling_matrix, [[-f1 + f2, f2], [-f2, -f2]], rtol=1e-14)
    assert np.allclose(structure.conductance_matrix, [[0.81, -0.5], [-0.5, 0.52]], rtol=1e-14)
    assert np.allclose(structure.damping_matrix, 0.4 * np.diag([1.0, 2.0]) + 0.05 * k1, rtol=1e-14)
    assert np.array_equal(np.diag(structure.heat_capacity), [7.0, 8.0])


def test_modes_diagonalise_and_keep_low_frequencies_of_graded_chains() -> None:
    """Springs of ratio 1e8 and a tip 1e6 times lighter: ω1 against the soft root spring's own."""
    structure = chain(nodes=3, mass=(1.0, 1.0, 1e-6), stiffness=(1.0, 1e8, 1e8))
    modes = models.mechanical_modes(structure)
    gram = modes.shapes.T @ structure.mass @ modes.shapes
    assert np.abs(gram - np.eye(3)).max() < 1e-12
    assert modes.values[0] == pytest.approx(np.sqrt(1.0 / 2.000001), rel=1e-7)
    assert models.mechanical_modes(chain(nodes=3, mass=1.0, stiffness=(0.0, 4.0, 9.0))).values[0] == 0.0


@pytest.mark.parametrize("basis", ["macneal", "massless"])
def test_a_free_body_whose_tip_has_no_mass(basis: str) -> None:
    """A rigid motion, three that vibrate, and a tip that gives way: a force on it is balanced by inertia."""
    whole = chain(nodes=9, mass=1.0, stiffness=(0.0, *[4.0] * 8))
    structure = reduce_structure(whole, 4, 4, basis).structure
    modes, contacts = models.mechanical_modes(structure), structure.contacts
    assert models.frequencies(structure)[0] == 0.0
    assert modes.values[1] > 0
    flexibility = ((contacts.normal @ modes.shapes[:, 1:] / modes.values[1:]) ** 2).sum() + contacts.flexibility(0.0)
    balanced = np.eye(9)[-1] - 1 / 9
    exact = balanced @ np.linalg.lstsq(whole.stiffness_matrix, balanced, rcond=None)[0]
    if basis == "macneal":  # massless leaves inertia out of the balance
        assert flexibility.item() == pytest.approx(exact, rel=1e-9)


def test_runaway_decided_by_rank() -> None:
    heated = {"nodes": 4, "mass": 1.0, "spacing": 0.1, "expansion": 1e-3, "conductance": 1.0}
    free_root = chain(stiffness=(0.0, 5.0, 5.0, 5.0), **heated)
    assert critical_alpha(free_root) == np.inf
    insulated = chain(stiffness=5.0, **{**heated, "conductance": (0.0, 1.0, 1.0, 1.0)})
    assert critical_alpha(insulated) == 0.0
    assert critical_alpha(chain(stiffness=5.0, **{**heated, "expansion": 0.0})) == np.inf
    assert critical_alpha(chain(stiffness=5.0, **{**heated, "expansion": -1e-3})) == np.inf
    broken_off = chain(stiffness=(5.0, 0.0, 5.0, 5.0), **heated)
    assert critical_alpha(broken_off) == np.inf


def test_equilibrium_free_pressed_and_none() -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=6.0, spacing=1.0, expansion=0.1, conductance=2.0)
    load = np.array([0.0, 0.0, 1.0])
    x, theta = static_equilibrium(structure, load, np.zeros(3), gap=10.0)
    assert np.allclose(x, [1 / 6, 2 / 6, 3 / 6], rtol=1e-12)
    assert np.all(theta == 0)
    x, _ = static_equilibrium(structure, load, np.zeros(3), gap=0.3)
    assert np.allclose(x, [0.1, 0.2, 0.3], rtol=1e-12)
    _, theta = static_equilibrium(structure, load, np.array([0.0, 0.0, 4.0]), gap=10.0)
    assert np.allclose(theta, [2.0, 4.0, 6.0], rtol=1e-12)
    ball = chain(nodes=1, mass=1.0, stiffness=0.0)
    x, _ = static_equilibrium(ball, np.array([2.0]), np.zeros(1), gap=0.5)
    assert x[0] == 0.5
    with pytest.raises(NoEquilibriumError, match="for ever"):
        static_equilibrium(ball, np.array([-2.0]), np.zeros(1), gap=0.5)
    with pytest.raises(NoEquilibriumError, match="cannot leave"):
        static_equilibrium(ball, np.array([2.0]), np.ones(1), gap=0.5)


def test_a_tip_pressed_far_beyond_its_free_place_keeps_its_digits() -> None:
    """x = d ψ, where the free place is a million times as far: forces have too few digits for it."""
    structure = chain(nodes=4, mass=1.0, stiffness=5.0)
    for gap in (-1e-6, 1e-9):
        x, _ = static_equilibrium(structure, np.array([0.0, 0.0, 0.0, 3.0]), np.zeros(4), gap)
        assert x == pytest.approx(gap * np.array([0.25, 0.5, 0.75, 1.0]), rel=1e-12)
        assert x[-1] == gap


@pytest.mark.parametrize("nodes", range(2, 13))
@pytest.mark.parametrize("heating", [0.0, 1.0])
def test_a_free_body_that_only_touches_is_at_rest(nodes: int, heating: float) -> None:
    """A reaction of exactly zero must not be decided by the sign of its rounding."""
    springs = np.random.default_rng(nodes).uniform(0.5, 3, nodes - 1)
    structure = chain(nodes=nodes, mass=1.0, stiffness=(0.0, *springs), spacing=1.0, expansion=0.01, conductance=0.1)
    for gap in (-0.1, 0.0):
        x, _ = static_equilibrium(structure, np.zeros(nodes), np.full(nodes, heating), gap)
        assert x[-1] <= gap + 1e-12


@pytest.mark.parametrize(
    "conditions",
    [
        {"amplitude": 24.0, "frequency": 5.0},
        {"amplitude": 10.0, "frequency": 1090.0},
        {"amplitude": 10.0, "frequency": 3000.0, "phase": 1.2},
        {"mean": 20.0},
        {"mean": -20.0, "velocity": 0.3},
        {"displacement": 1e-5, "amplitude": 5.0, "frequency": 0.0, "phase": np.pi / 2},
    ],
)
def test_the_free_tip_stays_within_its_reach(conditions: dict[str, float]) -> None:
    """An upper bound, and no more than 2.5 times what is reached where anything moves towards the casing."""
    structure = heavy_chain()
    batch = cases(structure, gap=10.0, **conditions)
    over = sampling(0.2, 1e-5)
    results = step(structure, batch, 0.0, over, "event_driven")
    reached = float(results.histories["displacement"].max())
    bound = float(free_reach(structure, batch, over.duration)[0, 0])
    assert reached <= bound * (1 + 1e-9)
    if reached > 1e-6:
        assert bound < 2.5 * reached


FREE = chain(nodes=3, mass=1.0, stiffness=(0.0, 1e6, 1e6))


@pytest.mark.parametrize("structure", [FREE, with_dashpot(heavy_chain(nodes=4), 0, 2, 60.0)], ids=["free", "coupled"])
def test_no_bound_is_known_of_a_free_body_and_where_damping_couples_modes(structure: Structure) -> None:
    assert np.isinf(free_reach(structure, cases(structure, gap=1.0, mean=1.0), 1.0)[0, 0])


TABLES = st.tuples(st.integers(1, 12), st.integers(1, 3), st.integers(1, 3)).flatmap(
    lambda size: st.tuples(
        *(arrays(float, (size[0], width), elements=st.sampled_from([-1.0, 0.0, -0.0, 2.5])) for width in size[1:])
    )
)


@given(TABLES)
def test_each_distinct_row_is_named_once_by_its_first_place(tables: tuple[np.ndarray, np.ndarray]) -> None:
    first, which = distinct_rows(*tables)
    rows = [tuple(row) for row in np.column_stack(tables).tolist()]
    assert sorted(first.tolist()) == sorted(rows.index(row) for row in set(rows))
    assert [rows[first[k]] for k in which] == rows


def test_a_row_gives_what_it_gives_in_a_matrix_whatever_the_batch() -> None:
    random = np.random.default_rng(20261123)
    matrix, states = random.normal(size=(3, 7)), random.normal(size=(5, 7))
    projected = project(matrix, states)
    np.testing.assert_allclose(projected, states @ matrix.T, rtol=0, atol=1e-14)
    for row in range(3):
        assert np.array_equal(project(matrix[row], states), projected[:, row])
    assert np.array_equal(project(matrix[0], states[2:3]), projected[2:3, 0])
