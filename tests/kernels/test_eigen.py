"""Eigenvalues and eigenvectors of general matrices by their definition."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow.kernels.algebra import eigenvalues, eigenvectors

EPS = np.finfo(float).eps


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
        np.diag([3.0, 1.0, 2.0]), np.roll(np.eye(8), 1, axis=0),
        np.array([[1.0, 1e8], [-1e-8, 1.0]]),
    ],
    ids=lambda m: f"{m.shape[0]}",
)  # fmt: skip
def test_special_matrices(matrix: np.ndarray) -> None:
    check(matrix)


def test_vectors_of_badly_scaled_matrices() -> None:
    """In coordinates of one size right and left vectors are orthogonal to rounding."""
    matrix = held(20, 0.3)
    _, right, left = eigenvectors(matrix)
    assert np.abs(left @ right - np.eye(60)).max() < 1e-12


def test_entries_that_are_not_finite_are_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        eigenvalues(np.array([[1.0, np.inf], [0.0, 1.0]]))
