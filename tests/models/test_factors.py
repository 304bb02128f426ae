"""Factors of large sparse matrices: SuperLU's and CHOLMOD's solve the same systems and refuse the same ones."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron
from scipy.sparse.linalg import splu
from test_sparse import NODES

from given_matrices import given
from scenes import blade, relative
from workflow.models import _factors as factors
from workflow.models import (
    critical_alpha,
    expected_fill,
    frequencies,
    rates,
    structure_from_sparse,
)
from workflow.reduction import reduce_structure

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
