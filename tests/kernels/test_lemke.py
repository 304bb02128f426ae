"""Lemke's method against all sets of basic variables, and what shows that a problem has no solution."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow.kernels.lemke import complementarity


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 6), st.integers(0, 2**32 - 1), st.booleans())
def test_the_only_solution_of_a_p_matrix(size: int, seed: int, skew: bool) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    matrix = root @ root.T + 0.1 * np.eye(size)
    if skew:  # positive definite, not symmetric
        turn = rng.normal(size=(size, size))
        matrix = matrix + turn - turn.T
    constant = rng.normal(size=size)
    solution = complementarity(matrix, constant)
    found = []
    for basic in product([False, True], repeat=size):
        own, active = np.zeros(size), np.array(basic)
        own[active] = np.linalg.solve(matrix[np.ix_(active, active)], -constant[active])
        if own.min() >= -1e-12 and (matrix @ own + constant).min() >= -1e-12:
            found.append(own)
    assert any(solution == pytest.approx(own, rel=1e-9, abs=1e-11) for own in found)


def test_sixty_four_variables() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(64, 64))
    matrix, constant = root @ root.T + np.eye(64), rng.normal(size=64)
    solution = complementarity(matrix, constant)
    rest = matrix @ solution + constant
    assert min(solution.min(), rest.min()) > -1e-10
    assert np.abs(solution * rest).max() < 1e-10


@pytest.mark.parametrize("matrix", [[[-1.0]], [[0.0]], [[1.0, -2.0], [-2.0, 1.0]]])
def test_no_solution_ends_in_a_ray(matrix: list[list[float]]) -> None:
    assert complementarity(np.array(matrix), -np.ones(len(matrix))) is None


@pytest.mark.parametrize("constant", [[-3.0, 3.0], [3.0, -3.0]])
def test_the_artificial_variable_leaves_first_in_a_tie(constant: list[float]) -> None:
    """A mass leaves a stop as it strikes the opposite one, which stops it: both rows are at 0, one is pressed."""
    solution = complementarity(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array(constant))
    assert solution == pytest.approx(np.maximum(0.0, -np.array(constant)))


@pytest.mark.parametrize(
    ("matrix", "constant", "truth"),
    [
        ([[1, 0, -1], [0, 1, -1], [-1, -1, 2]], [1, 0, -1], [0, 1, 1]),
        ([[1, 1, -1], [1, 2, -1], [-1, -1, 1]], [0, -1, 0], [0, 1, 1]),
    ],
)
def test_of_singular_matrices_that_tie_up_to_rounding(
    matrix: list[list[int]], constant: list[int], truth: list[int]
) -> None:
    """Where another variable reaches 0 with the artificial one but for rounding, the pivots after it end in a ray."""
    assert complementarity(np.array(matrix, float), np.array(constant, float)) == pytest.approx(truth, abs=1e-12)
