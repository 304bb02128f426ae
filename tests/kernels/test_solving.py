"""Cholesky factors and systems of equations against 50 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow.kernels.solving import cholesky, inverse, solve, solve_triangular

EPS = np.finfo(float).eps


def definite(rng: np.random.Generator, n: int) -> np.ndarray:
    a = rng.normal(size=(n, n))
    return a @ a.T + n * np.eye(n)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 15), st.integers(0, 4))
def test_residuals_are_rounding(seed: int, n: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, spd = rng.normal(size=(n, n)), rng.normal(size=(n, columns)), definite(rng, n)
    lower = cholesky(spd)
    assert np.array_equal(lower, np.tril(lower))
    np.testing.assert_allclose(lower @ lower.T, spd, rtol=0, atol=4 * n * EPS * np.abs(spd).max(initial=0.0))
    for matrix, x in (
        (a, solve(a, b)),
        (lower, solve_triangular(lower, b)),
        (lower.T, solve_triangular(lower, b, transposed=True)),
    ):
        assert x.shape == b.shape
        growth = np.abs(matrix).max(initial=0.0) * np.abs(x).max(initial=0.0) + 1.0
        assert np.abs(matrix @ x - b).max(initial=0.0) <= 16 * n * n * EPS * growth


def test_solutions_have_the_digits_that_the_condition_leaves() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(12, 12)), rng.normal(size=12)
    with mpmath.workdps(50):
        exact = np.array([float(x) for x in mpmath.lu_solve(mpmath.matrix(a.tolist()), mpmath.matrix(b.tolist()))])
    np.testing.assert_allclose(solve(a, b), exact, rtol=10 * EPS * np.linalg.cond(a))


def test_a_column_does_not_depend_on_those_beside_it() -> None:
    rng = np.random.default_rng(8)
    a, b = rng.normal(size=(20, 20)), rng.normal(size=(20, 7))
    lower = cholesky(definite(rng, 20))
    for column in range(7):
        assert np.array_equal(solve(a, b)[:, column], solve(a, b[:, column]))
        assert np.array_equal(solve_triangular(lower, b)[:, column], solve_triangular(lower, b[:, column]))


def test_inverse_and_arguments_left_alone() -> None:
    a = np.random.default_rng(9).normal(size=(30, 30))
    before = a.copy()
    np.testing.assert_allclose(inverse(a) @ a, np.eye(30), rtol=0, atol=1e-12)
    assert np.array_equal(a, before)
    np.testing.assert_array_equal(inverse(np.diag([4.0, 0.5])), np.diag([0.25, 2.0]))


def test_what_has_no_solution_is_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        solve(np.ones((2, 2)), np.ones(2))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        inverse(np.full((2, 2), np.nan))
    with pytest.raises(np.linalg.LinAlgError, match="positive definite"):
        cholesky(np.diag([1.0, -1.0]))
    with pytest.raises(np.linalg.LinAlgError, match="positive definite"):
        cholesky(np.diag([1.0, np.inf]))
    with pytest.raises(ValueError, match=r"\(3,\) for 2 equations"):
        solve(np.eye(2), np.ones(3))
