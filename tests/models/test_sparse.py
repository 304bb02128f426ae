"""Structures of sparse matrices and their factors: what the chain gives, without an array of n x n numbers."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron
from scipy.sparse.linalg import splu

from given_matrices import given
from scenes import blade, relative, tip_flexibility
from workflow.models import (
    GivenMatrices,
    Matrices,
    Structure,
    TooManyCoordinatesError,
    UnusableMatricesError,
    critical_alpha,
    expected_fill,
    frequencies,
    rates,
    static_growth,
    structure_from_matrices,
    structure_from_sparse,
    the_tip,
)
from workflow.models import _factors as factors
from workflow.models._from_matrices import _sparse_structure, with_contacts
from workflow.models._pair import MOST_FULL
from workflow.reduction import reduce_structure

NODES = 310


@pytest.fixture(scope="module")
def chain() -> Structure:
    return blade(NODES)


@pytest.fixture(scope="module")
def sparse(chain: Structure) -> Matrices:
    structure = structure_from_sparse(given(chain, csc_array))
    assert structure.is_sparse
    return structure


def test_statics_are_those_of_the_chain(chain: Structure, sparse: Matrices) -> None:
    assert tip_flexibility(sparse) == pytest.approx(tip_flexibility(chain), rel=1e-11)
    assert critical_alpha(sparse) == pytest.approx(critical_alpha(chain), rel=1e-11)
    assert relative(static_growth(sparse), static_growth(chain)) < 1e-11
    loads = np.random.default_rng(1).normal(size=(2, NODES))
    assert relative(sparse.mechanical.static_solutions(loads), chain.mechanical.static_solutions(loads)) < 1e-10
    assert relative(sparse.thermal.static_solutions(loads), chain.thermal.static_solutions(loads)) < 1e-10
    assert frequencies(sparse)[0] == pytest.approx(frequencies(chain)[0], rel=1e-9)
    assert rates(sparse)[0] == pytest.approx(rates(chain)[0], rel=1e-11)
    assert chain.thermal.largest() == pytest.approx(rates(chain)[-1], rel=1e-13)
    assert rates(sparse)[-1] == pytest.approx(rates(chain)[-1], rel=0.05)


def test_heat_that_cannot_leave(chain: Structure) -> None:
    """The uniform temperature is the slowest mode, with the rate 0; contact heat then always runs away."""
    insulated = chain.conductance_matrix - np.diag(chain.conductance_matrix.sum(axis=1))
    structure = structure_from_sparse(given(chain, csc_array, conductance=csc_array(insulated)))
    assert structure.is_sparse
    assert critical_alpha(structure) == 0.0
    reduced = reduce_structure(structure, 2, 4).structure
    assert rates(reduced)[0] == 0.0
    assert np.abs(reduced.loss_row).max() <= 1e-12 * np.abs(insulated).max()


def test_small_enough_it_can_be_kept_full(chain: Structure, sparse: Matrices) -> None:
    """Its dense matrices are those of the chain; one of more coordinates says what it can be reduced to."""
    assert frequencies(sparse.matrices()) == pytest.approx(frequencies(chain), rel=1e-8)
    assert rates(sparse.matrices()) == pytest.approx(rates(chain), rel=1e-8)
    large = structure_from_sparse(long_chain(2001))
    with pytest.raises(TooManyCoordinatesError, match="`auto` with a `tolerance`"):
        large.matrices()
    with pytest.raises(TooManyCoordinatesError):
        reduce_structure(large, 301, 4)


def long_chain(nodes: int, **other: Any) -> GivenMatrices:
    """Equal springs and masses, heat lost everywhere; no dense matrix is made."""
    springs = diags_array(
        [np.append(np.full(nodes - 1, 2.0), 1.0), *[np.full(nodes - 1, -1.0)] * 2], offsets=[0, -1, 1]
    )
    unit, tip = diags_array(np.ones(nodes)), np.zeros(nodes)
    tip[-1] = 1.0
    matrices = (unit, springs, -1e-5 * (springs - unit), unit, springs + 0.1 * unit)
    return replace(GivenMatrices(*map(csc_array, matrices), tip, tip, 0 * tip, 0 * tip), **other)


LINE = diags_array([np.ones(2001), *2 * [np.full(2000, -1.0)]], offsets=[0, 1, -1])
REFUSED = {
    "mass": ("mass", diags_array(np.full(2001, -1.0)), "contact acts on what has no inertia, among displacements"),
    "indefinite": ("stiffness", LINE, "stiffness is indefinite"),
    "loose": ("stiffness", diags_array(np.append(np.ones(2000), 0.0)), "nothing holds the part"),
}


@pytest.mark.parametrize(("name", "matrix", "problem"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_structure_is_refused(name: str, matrix: Any, problem: str) -> None:
    with pytest.raises(UnusableMatricesError, match=problem):
        structure_from_sparse(long_chain(2001, **{name: csc_array(matrix)}))


@pytest.mark.parametrize(
    "cut", [{"isolated": 100}, {"two pieces": 150}, {"all apart": None}], ids=lambda c: next(iter(c))
)
def test_a_loose_piece_of_heat_is_dense_or_refused(chain: Structure, cut: dict[str, int | None]) -> None:
    """Conductances at random, so that rounding leaves no pivot of the piece exactly zero."""
    for nodes in (NODES, 2001):
        ((kind, place),) = cut.items()
        conductances = np.random.default_rng(3).uniform(0.3, 3, nodes)  # the first to the root, where nothing is
        conductances[0] = 0.0
        conductances[slice(None) if place is None else slice(place, place + 1 + (kind == "isolated"))] = 0.0
        beyond = np.append(conductances[1:], 0.1 if kind == "two pieces" else 0.0)
        matrix = diags_array([conductances + beyond, *2 * [-conductances[1:]]], offsets=[0, 1, -1])
        given = long_chain(nodes, conductance=csc_array(matrix), coupling=csc_array((nodes, nodes)))
        if nodes > MOST_FULL:
            with pytest.raises(
                UnusableMatricesError, match="heat cannot leave some temperatures, nor reach the contact's: hold it"
            ):
                structure_from_sparse(given)
            continue
        structure = structure_from_sparse(given)
        assert not structure.is_sparse
        assert int((rates(structure) == 0).sum()) == {"isolated": 3, "two pieces": 1, "all apart": nodes}[kind]


def test_a_small_free_structure_is_dense(chain: Structure) -> None:
    """Rank decides there what moves; sparse factorisations would not find it."""
    free = chain.stiffness_matrix.copy()
    free[0, 0] /= 2
    taken = given(chain, csc_array, stiffness=csc_array(free), coupling=csc_array((NODES, NODES)))
    assert not structure_from_sparse(taken).is_sparse
    assert tip_flexibility(structure_from_sparse(taken)) == np.inf


def test_one_temperature_stands_for_no_heat(chain: Structure) -> None:
    """As files without heat are read: a single temperature that nothing cools and that moves nothing."""
    one, none = csc_array(np.ones((1, 1))), np.zeros(1)
    taken = given(chain, csc_array, heat_capacity=one, conductance=0 * one, thermal_contact=np.ones(1), heating=none)
    structure = structure_from_sparse(replace(taken, coupling=csc_array((NODES, 1))))
    assert structure.is_sparse
    assert critical_alpha(structure) == np.inf
    reduced = reduce_structure(structure, 3, 0).structure
    assert frequencies(reduced)[0] == pytest.approx(frequencies(structure)[0], rel=1e-3)
    assert rates(reduced) == pytest.approx([0.0])


def test_damping_and_load_of_a_large_file_are_reduced_with_it() -> None:
    """As the dense structure has them; a damping that is Rayleigh's keeps modes apart, to the bit."""
    given = long_chain(NODES)
    local = diags_array(np.where(np.arange(NODES) % 7 == 0, 1e-3, 0.0))
    along = np.sin(np.arange(NODES) / 50.0)
    proportional = 0.3 * given.mass + 1e-4 * given.stiffness
    for damper in (csc_array(proportional + local), csc_array(proportional)):
        own = replace(given, damper=damper, load=along)
        dense, large = structure_from_matrices(own), structure_from_sparse(own)
        of_dense, of_large = (reduce_structure(whole, 4, 4).structure for whole in (dense, large))
        assert large.is_sparse
        for name in ("damping_matrix", "load_direction"):  # modes point either way
            one, other = (np.abs(getattr(of, name)) for of in (of_large, of_dense))
            assert relative(one, other) < 1e-7, name
    assert of_large.damper is None
    assert of_large.damping.mass == pytest.approx(0.3, rel=1e-12)
    assert of_large.damping.stiffness == pytest.approx(1e-4, rel=1e-9)


def test_massless_degrees_of_freedom_of_a_large_structure_follow() -> None:
    """Every third node has no mass: as the dense structure of fewer nodes, from which they are condensed."""
    masses = np.where(np.arange(NODES) % 3 == 1, 0.0, 1.0)
    given = long_chain(NODES, mass=csc_array(diags_array(masses)))
    large = _sparse_structure(given)
    dense = structure_from_sparse(given)
    assert not dense.is_sparse
    assert dense.coordinates.condensed == (NODES // 3, 0)
    for basis in ("craig_bampton", "rubin"):
        of_dense, of_large = (reduce_structure(whole, 4, 4, basis).structure for whole in (dense, large))
        assert frequencies(of_large) == pytest.approx(frequencies(of_dense), rel=1e-8)
    dashpot = np.where(np.arange(NODES) == 4, 0.1, 0.0)
    held, loose = (
        replace(given, damper=csc_array(1e-3 * given.stiffness + diags_array(d))) for d in (0 * dashpot, dashpot)
    )
    for structure_of in (_sparse_structure, structure_from_sparse):
        structure_of(held)
        with pytest.raises(UnusableMatricesError, match="displacement 4, which has no mass"):
            structure_of(loose)


@pytest.mark.parametrize("is_sparse", [False, True])
def test_heat_without_heat_capacity_grows_the_structure_at_once(is_sparse: bool) -> None:
    """Of 4 W on a conductance of 2.5 W/K: 1.6 K, 0.32 N on each node, (1 · 0.32 + 2 · 0.32)/10⁴ m at the tip."""
    springs = 1e4 * np.array([[2.0, -1.0], [-1.0, 1.0]])
    conductors = np.array([[3.0, -1, 0], [-1, 2.5, -1], [0, -1, 1.5]])
    coupling = np.array([[-0.1, -0.2, 0.0], [0.0, -0.2, -0.1]])
    matrices = 0.01 * np.eye(2), springs, coupling, np.diag([0.1, 0.0, 0.1]), conductors
    rest = np.array([0.0, 1.0]), np.array([0.0, 0.0, 1.0]), np.zeros(2), np.array([0.0, 4.0, 0.0])
    sparse, dense = GivenMatrices(*map(csc_array, matrices), *rest), GivenMatrices(*matrices, *rest)
    structure = _sparse_structure(sparse) if is_sparse else structure_from_matrices(dense)
    tip = the_tip(2, 3)
    both = replace(tip, labels=("1", "0"), normal=np.eye(2)[::-1], tangent=np.zeros((2, 2)), heat=np.eye(3)[[2, 0]])
    contacts = with_contacts(structure, replace(both, angle=np.zeros(2))).contacts
    assert contacts.growth_at_once == pytest.approx([9.6e-5, 6.4e-5], rel=1e-12)


needs_cholmod = pytest.mark.skipif(not factors.has_cholmod(), reason="the extra `sparse` is not installed")


def lattice(nodes: int, ground: float) -> csc_array:
    """Springs between neighbours of a cube of so many nodes along each edge, and from each to the ground."""
    line = diags_array([np.r_[1.0, np.full(nodes - 2, 2.0), 1.0], *2 * [np.full(nodes - 1, -1.0)]], offsets=[0, 1, -1])
    one = eye_array(nodes)
    bars = [kron(kron(*two), three) for *two, three in ((line, one, one), (one, line, one), (one, one, line))]
    return csc_array(sum(bars) + ground * eye_array(nodes**3))


@needs_cholmod
@pytest.mark.parametrize(
    "matrix", [csc_array(diags_array([1.0, 0.0, 1.0])), lattice(5, -0.5)], ids=["loose", "indefinite"]
)
def test_what_nothing_holds_is_refused_by_cholmod_too(matrix: csc_array) -> None:
    with pytest.raises(factors.NotHeldError):
        factors._by_cholmod(matrix, factors._nested_dissection(matrix))


@needs_cholmod
def test_a_basis_is_the_same_by_both(monkeypatch: pytest.MonkeyPatch) -> None:
    taken, reduced = given(blade(NODES), csc_array), []
    for most in (factors.MOST_BY_SUPERLU, 0):
        monkeypatch.setattr(factors, "MOST_BY_SUPERLU", most)
        sparse = structure_from_sparse(taken)
        assert sparse.is_sparse
        reduced.append(reduce_structure(sparse, 6, 8, "krylov", 0.3).structure)
    by_superlu, by_cholmod = reduced
    assert critical_alpha(by_cholmod) == pytest.approx(critical_alpha(by_superlu), rel=1e-11)
    assert relative(frequencies(by_cholmod), frequencies(by_superlu)) < 1e-9
    assert relative(rates(by_cholmod), rates(by_superlu)) < 1e-9


def test_least_degree_fills_what_is_expected_within_a_factor_of_two() -> None:
    stiffness = lattice(20, 0.1)
    factor = splu(stiffness, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    bytes_of_entry = 10.5  # its value, and its share of the row that a supernode's columns have in common
    assert 0.5 < expected_fill(stiffness, False).size / (bytes_of_entry * factor.nnz) < 2
