"""Linear algebra against its definitions and 100 digits: pairs to the bit, and every value to its own size."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow.kernels.algebra import eigenvalues, least_squares, singular

EPS = np.finfo(float).eps
SEEDS = st.integers(0, 2**32 - 1)


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.integers(1, 14))
def test_eigenvalues_come_in_pairs(seed: int, n: int) -> None:
    matrix = np.random.default_rng(seed).normal(size=(n, n))
    values, size = eigenvalues(matrix), np.linalg.norm(matrix)
    upper = np.flatnonzero(values.imag > 0)
    assert np.array_equal(values[upper + 1], values[upper].conj())
    assert 2 * upper.size + np.count_nonzero(values.imag == 0) == n
    for s in values:
        assert np.linalg.svd(matrix - s * np.eye(n))[1][-1] <= 20 * n * EPS * size


def chain(stiffness: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """√k · elongation · 1/√m of springs in line."""
    n = mass.size
    return np.sqrt(stiffness)[:, None] * (np.eye(n) - np.eye(n, k=-1)) / np.sqrt(mass)


def graded() -> dict[str, np.ndarray]:
    """Matrices over twelve decades of stiffness."""
    rng, n = np.random.default_rng(12), 12
    decades = 10.0 ** np.linspace(-6, 6, n)
    mixed = rng.permutation(decades)
    return {
        "stiff tip": chain(decades, np.ones(n)),
        "stiff root": chain(decades[::-1], np.ones(n)),
        "mixed springs and masses": chain(mixed, rng.permutation(decades)),
        "rows and columns": np.sqrt(mixed)[:, None] * rng.normal(size=(n, n)) * rng.permutation(decades),
        "more rows": np.vstack([chain(mixed, decades), np.diag(1e-3 / np.sqrt(decades))]),
        "fewer rows": chain(mixed, np.ones(n))[4:],
    }


@pytest.mark.parametrize("kind", graded())
def test_every_singular_value_of_a_graded_matrix_is_accurate_to_its_own_size(kind: str) -> None:
    matrix = graded()[kind]
    with mpmath.workdps(100):  # of an eigenvalue problem, which squaring costs a few
        a = mpmath.matrix(matrix.tolist())
        squares = mpmath.eigsy(a.T * a, eigvals_only=True)
        exact = np.array(sorted((float(mpmath.sqrt(max(s, 0))) for s in squares), reverse=True))
    values, rank = singular(matrix)[0], min(matrix.shape)
    regular = (exact > 0) & (np.arange(exact.size) < rank)
    np.testing.assert_allclose(values[regular], exact[regular], rtol=1e-13)
    np.testing.assert_array_equal(values[rank:], 0.0)


def check_singular(matrix: np.ndarray) -> None:
    m, n = matrix.shape
    values, vectors = singular(matrix)
    size, largest = max(m, n), values.max(initial=0.0)
    assert values.shape == (n,)
    assert vectors.shape == (n, n)
    assert np.all(np.diff(values) <= 0)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(n), rtol=0, atol=8 * size * EPS)
    products = matrix @ vectors
    np.testing.assert_allclose(products.T @ products, np.diag(values**2), rtol=0, atol=16 * size * EPS * largest**2)
    expected = np.linalg.svd(matrix, compute_uv=False) if n and m else np.zeros(0)
    np.testing.assert_allclose(values[: expected.size], expected, rtol=0, atol=8 * size * EPS * largest)


@settings(max_examples=80, deadline=None)
@given(SEEDS, *[st.integers(0, 12)] * 3, st.integers(-300, 300))
def test_singular_vectors_of_any_shape_rank_and_size(seed: int, m: int, n: int, rank: int, power: int) -> None:
    rng, r = np.random.default_rng(seed), min(rank, m, n)
    check_singular(rng.normal(size=(m, r)) @ rng.normal(size=(r, n)) * 2.0 ** (power / 3))


@pytest.mark.parametrize("shape", [(400, 200), (60, 90), (320, 310)])
def test_singular_vectors_of_large_matrices(shape: tuple[int, int]) -> None:
    check_singular(np.random.default_rng(3).normal(size=shape))


def test_a_free_chain_has_one_null_vector_of_equal_entries() -> None:
    stiffness = 10.0 ** np.random.default_rng(4).uniform(-6, 6, 40)
    stiffness[0] = 0.0
    values, vectors = singular(chain(stiffness, np.ones(40)))
    assert values[-1] <= 40 * EPS * values[0]
    assert values[-2] > 1e-4
    np.testing.assert_allclose(np.abs(vectors[:, -1]), 1 / np.sqrt(40), rtol=1e-13)


@settings(max_examples=80, deadline=None)
@given(SEEDS, st.integers(1, 12), st.integers(1, 12), st.integers(0, 12), st.integers(1, 3))
def test_least_squares_is_that_of_minimum_norm(seed: int, m: int, n: int, rank: int, columns: int) -> None:
    rng, r = np.random.default_rng(seed), min(rank, m, n)
    matrix, right = rng.normal(size=(m, r)) @ rng.normal(size=(r, n)), rng.normal(size=(m, columns))
    values = np.linalg.svd(matrix, compute_uv=False)[:r]
    condition = values[0] / values[-1] if r else 1.0
    if condition < 1e8:
        expected = np.linalg.pinv(matrix, rcond=1e-11) @ right
        tolerance = 100 * EPS * condition**2 * (1 + np.abs(expected).max(initial=0.0))
        np.testing.assert_allclose(least_squares(matrix, right), expected, rtol=0, atol=tolerance)
        np.testing.assert_allclose(least_squares(matrix, right[:, 0]), expected[:, 0], rtol=0, atol=tolerance)


def test_least_squares_of_a_graded_chain_keeps_its_digits() -> None:
    """The static shape of the interior to a unit tip, known exactly: springs in series."""
    stiffness = 10.0 ** np.random.default_rng(6).permutation(np.linspace(-6, 6, 20))
    strain = chain(stiffness, np.ones(20))
    give = np.cumsum(1 / stiffness)
    np.testing.assert_allclose(least_squares(strain[:, :-1], -strain[:, -1]), give[:-1] / give[-1], rtol=1e-12)


@pytest.mark.parametrize("function", [singular, eigenvalues])
def test_entries_that_are_not_finite_are_refused(function: object) -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        function(np.array([[1.0, np.nan], [0.0, 1.0]]))
