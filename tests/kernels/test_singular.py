"""Singular values against 60 digits; vectors, null vectors and least squares against their definitions."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow.kernels.algebra import least_squares, singular

EPS = np.finfo(float).eps


def exact_values(matrix: np.ndarray) -> np.ndarray:
    """Singular values, descending, from an eigenvalue problem in 100 digits, which squaring costs a few of."""
    with mpmath.workdps(100):
        a = mpmath.matrix(matrix.tolist())
        squares = mpmath.eigsy(a.T * a, eigvals_only=True)
        return np.array(sorted((float(mpmath.sqrt(max(s, 0))) for s in squares), reverse=True))


def chain(stiffness: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """√k · elongation · 1/√m of springs in line."""
    n = mass.size
    return np.sqrt(stiffness)[:, None] * (np.eye(n) - np.eye(n, k=-1)) / np.sqrt(mass)


def graded(kind: str) -> np.ndarray:
    rng = np.random.default_rng(12)
    n = 12
    decades = 10.0 ** np.linspace(-6, 6, n)
    mixed = rng.permutation(decades)
    return {
        "stiff tip": lambda: chain(decades, np.ones(n)),
        "stiff root": lambda: chain(decades[::-1], np.ones(n)),
        "mixed springs": lambda: chain(mixed, np.ones(n)),
        "mixed springs and masses": lambda: chain(mixed, rng.permutation(decades)),
        "rows and columns": lambda: np.sqrt(mixed)[:, None] * rng.normal(size=(n, n)) * rng.permutation(decades),
        "more rows": lambda: np.vstack([chain(mixed, decades), np.diag(1e-3 / np.sqrt(decades))]),
        "fewer rows": lambda: chain(mixed, np.ones(n))[4:],
    }[kind]()


@pytest.mark.parametrize(
    "kind",
    [
        "stiff tip", "stiff root", "mixed springs", "mixed springs and masses", "rows and columns", "more rows",
        "fewer rows",
    ],
)  # fmt: skip
def test_every_value_of_a_graded_matrix_is_accurate_to_its_own_size(kind: str) -> None:
    """Over twelve decades of stiffness; the usual method errs by rounding times the largest."""
    matrix = graded(kind)
    values, exact = singular(matrix)[0], exact_values(matrix)
    regular = exact > 0
    regular[min(matrix.shape) :] = False
    np.testing.assert_allclose(values[regular], exact[regular], rtol=1e-13)
    np.testing.assert_array_equal(values[min(matrix.shape) :], 0.0)


def check(matrix: np.ndarray) -> None:
    m, n = matrix.shape
    values, vectors = singular(matrix)
    size = max(m, n)
    assert values.shape == (n,)
    assert vectors.shape == (n, n)
    assert np.all(np.diff(values) <= 0)
    largest = values.max(initial=0.0)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(n), rtol=0, atol=8 * size * EPS)
    products = matrix @ vectors
    np.testing.assert_allclose(products.T @ products, np.diag(values**2), rtol=0, atol=16 * size * EPS * largest**2)
    expected = np.linalg.svd(matrix, compute_uv=False) if n and m else np.zeros(0)
    np.testing.assert_allclose(values[: expected.size], expected, rtol=0, atol=8 * size * EPS * largest)


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 12), st.integers(0, 12), st.integers(0, 12), st.integers(-300, 300))
def test_definition_holds_for_any_shape_rank_and_size(seed: int, m: int, n: int, rank: int, power: int) -> None:
    rng = np.random.default_rng(seed)
    r = min(rank, m, n)
    matrix = rng.normal(size=(m, r)) @ rng.normal(size=(r, n))
    matrix *= 2.0 ** (power / 3)
    check(matrix)


@pytest.mark.parametrize("shape", [(200, 200), (400, 200), (60, 90), (320, 310)])
def test_definition_holds_for_large_matrices(shape: tuple[int, int]) -> None:
    check(np.random.default_rng(3).normal(size=shape))


@pytest.mark.parametrize("matrix", [np.zeros((4, 3)), np.ones((5, 5)), np.eye(7), np.full((1, 4), 1e-300)])
def test_multiple_and_zero_values(matrix: np.ndarray) -> None:
    check(matrix)


def test_a_free_chain_has_one_null_vector_of_equal_entries() -> None:
    stiffness = 10.0 ** np.random.default_rng(4).uniform(-6, 6, 40)
    stiffness[0] = 0.0
    values, vectors = singular(chain(stiffness, np.ones(40)))
    assert values[-1] <= 40 * EPS * values[0]
    assert values[-2] > 1e-4
    np.testing.assert_allclose(np.abs(vectors[:, -1]), 1 / np.sqrt(40), rtol=1e-13)


def test_entries_that_are_not_finite_are_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        singular(np.array([[1.0, np.nan]]))


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 12), st.integers(0, 12), st.integers(1, 3))
def test_least_squares_is_that_of_minimum_norm(seed: int, m: int, n: int, rank: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    r = min(rank, m, n)
    matrix, right = rng.normal(size=(m, r)) @ rng.normal(size=(r, n)), rng.normal(size=(m, columns))
    values = np.linalg.svd(matrix, compute_uv=False)[:r]
    condition = values[0] / values[-1] if r else 1.0
    expected = np.linalg.pinv(matrix, rcond=1e-11) @ right
    if condition < 1e8:
        tolerance = 100 * EPS * condition**2 * (1 + np.abs(expected).max(initial=0.0))
        np.testing.assert_allclose(least_squares(matrix, right), expected, rtol=0, atol=tolerance)
        np.testing.assert_allclose(least_squares(matrix, right[:, 0]), expected[:, 0], rtol=0, atol=tolerance)


def test_least_squares_of_a_graded_chain_keeps_its_digits() -> None:
    """The static shape of the interior to a unit tip, known exactly: springs in series."""
    stiffness = 10.0 ** np.random.default_rng(6).permutation(np.linspace(-6, 6, 20))
    strain = chain(stiffness, np.ones(20))
    shape = least_squares(strain[:, :-1], -strain[:, -1])
    give = np.cumsum(1 / stiffness)
    np.testing.assert_allclose(shape, give[:-1] / give[-1], rtol=1e-12)
