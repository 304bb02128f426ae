"""Eigenvalues and eigenvectors of general matrices against 40 digits, LAPACK and their definition."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow.kernels.algebra import eigenvalues, eigenvectors

EPS = np.finfo(float).eps


def distance(values: np.ndarray, exact: np.ndarray) -> float:
    """Largest distance of values paired one by one, nearest first."""
    left, worst = list(exact), 0.0
    for value in sorted(values, key=abs, reverse=True):
        nearest = int(np.argmin([abs(value - other) for other in left]))
        worst = max(worst, abs(value - left.pop(nearest)))
    return worst


def held(n: int, alpha: float) -> np.ndarray:
    """A chain of soft heat and stiff springs whose reaction at one end warms it: eleven decades of eigenvalues."""
    k, m, c = 2e7, 2.5e-3, 1.3
    line = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    a = np.zeros((3 * n, 3 * n))
    x, v, heat = slice(0, n), slice(n, 2 * n), slice(2 * n, None)
    a[x, v], a[v, x], a[v, v] = np.eye(n), -k / m * line, -10 * np.eye(n) - 2e-7 * k / m * line
    a[v, heat], a[heat, heat] = -k * 2e-8 / m * (np.eye(n) - np.eye(n, k=1)), -0.6 / c * line
    a[-1, n - 1] = alpha * k / c
    return a


def check(matrix: np.ndarray) -> None:
    values, right, left = eigenvectors(matrix)
    n = matrix.shape[0]
    upper = np.flatnonzero(values.imag > 0)
    assert np.array_equal(values[upper + 1], values[upper].conj())
    assert np.array_equal(right[:, upper + 1], right[:, upper].conj())
    assert np.array_equal(left[upper + 1], left[upper].conj())
    assert not right[:, values.imag == 0].imag.any()
    assert 2 * upper.size + np.count_nonzero(values.imag == 0) == n
    size = np.linalg.norm(matrix)
    assert np.abs(matrix @ right - right * values).max(initial=0.0) <= 20 * n * EPS * size
    np.testing.assert_allclose(np.linalg.norm(right, axis=0), 1.0, rtol=1e-14)
    loss = np.linalg.cond(right) if n else 1.0
    np.testing.assert_allclose(left @ right, np.eye(n), rtol=0, atol=20 * n * EPS * loss)
    np.testing.assert_allclose(
        np.sort_complex(eigenvalues(matrix)), np.sort_complex(values), rtol=0, atol=n * EPS * size
    )


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 14))
def test_definition_holds_for_random_matrices(seed: int, n: int) -> None:
    check(np.random.default_rng(seed).normal(size=(n, n)))


@pytest.mark.parametrize("n", [100, 298])
def test_definition_holds_for_large_matrices(n: int) -> None:
    check(np.random.default_rng(n).normal(size=(n, n)))


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((0, 0)), np.ones((1, 1)), np.zeros((4, 4)), np.eye(5), np.array([[0.0, 1.0], [-1.0, 0.0]]),
        np.diag([3.0, 1.0, 2.0]), np.roll(np.eye(8), 1, axis=0), np.ones((6, 6)),
        np.array([[1.0, 1e8], [-1e-8, 1.0]]),
    ],
    ids=lambda m: f"{m.shape[0]}",
)  # fmt: skip
def test_special_matrices(matrix: np.ndarray) -> None:
    values = eigenvalues(matrix)
    assert distance(values, np.linalg.eigvals(matrix)) <= 20 * EPS * max(1.0, np.abs(matrix).max(initial=0.0))
    if matrix.shape[0] != 6:  # whose null vectors LAPACK's and ours span, each with another condition
        check(matrix)


@pytest.mark.parametrize("alpha", [0.0, 0.3, 30.0])
def test_eigenvalues_err_by_rounding_of_the_largest_as_those_of_lapack(alpha: float) -> None:
    matrix = held(5, alpha)
    with mpmath.workdps(40):
        exact = np.array([complex(s) for s in mpmath.eig(mpmath.matrix(matrix.tolist()), left=False, right=False)])
    largest = np.abs(exact).max()
    error = distance(eigenvalues(matrix), exact)
    assert error <= max(20 * EPS * largest, 3 * distance(np.linalg.eigvals(matrix), exact))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 40), st.sampled_from([0.0, 1e-12, 1e-3]))
def test_undamped_structures_converge(seed: int, n: int, damping: float) -> None:
    """Their Hessenberg forms have a diagonal of zeros, with which LAPACK's test alone compares in vain."""
    rng = np.random.default_rng(seed)
    roots = rng.uniform(1e3, 1e6, n)
    turn, _ = np.linalg.qr(rng.normal(size=(n, n)))
    stiffness = turn @ np.diag(roots**2) @ turn.T
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-(stiffness + stiffness.T) / 2, -damping * np.eye(n)]])
    values = eigenvalues(matrix)
    np.testing.assert_allclose(np.sort(values.imag[values.imag > 0]), np.sort(roots), rtol=1e-7)


@pytest.mark.parametrize("seed", range(10))
def test_pairs_on_a_diagonal_of_zeros_are_told_apart(seed: int) -> None:
    """Blocks of two that next to nothing links: with the test of LAPACK alone none of these converges."""
    rng = np.random.default_rng(seed)
    matrix, frequency = np.zeros((12, 12)), rng.uniform(1e5, 5e6, 6)
    for block in range(6):
        k = 2 * block
        matrix[k, k + 1], matrix[k + 1, k] = frequency[block], -frequency[block]
        if block:
            matrix[k, k - 1], matrix[k - 1, k] = 10.0 ** rng.uniform(-190, -5), rng.normal() * 1e-6
    values = eigenvalues(matrix)
    np.testing.assert_allclose(np.sort(values.imag[values.imag > 0]), np.sort(frequency), rtol=1e-12)


def test_rates_that_nothing_acts_upon_are_kept_apart_from_fast_ones() -> None:
    """Rows that are eigenvalues by themselves are split off before any rounding."""
    matrix = held(4, 0.0)
    matrix[8:, 8:] = -np.diag([1e-6, 3e-4, 0.2, 7.0])
    assert {-1e-6, -3e-4, -0.2, -7.0} <= {s.real for s in eigenvalues(matrix) if s.imag == 0}


def test_vectors_of_badly_scaled_matrices() -> None:
    """In coordinates of one size right and left vectors are orthogonal to rounding."""
    matrix = held(20, 0.3)
    _, right, left = eigenvectors(matrix)
    assert np.abs(left @ right - np.eye(60)).max() < 1e-12


def test_a_companion_matrix_of_known_roots() -> None:
    """Roots of the polynomial with roots 1 to 10, in 30 digits before it is rounded to a matrix."""
    coefficients = np.poly(np.arange(1, 11))
    assert (
        distance(eigenvalues(np.diag(np.ones(9), -1) - np.outer(np.eye(10)[0], coefficients[1:])), np.arange(1, 11))
        < 1e-6
    )


def test_entries_that_are_not_finite_are_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        eigenvalues(np.array([[1.0, np.inf], [0.0, 1.0]]))
