"""Cases that are alike are found, whatever varies among the others; states are projected case by case."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from workflow.models import distinct_rows, project

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
