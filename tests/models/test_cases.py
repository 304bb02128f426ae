"""Cases that are alike are found, whatever varies among the others; states are projected case by case."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scenes import cases, chain
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


def test_load_periods_are_those_of_the_first_sinusoid_that_acts() -> None:
    """F1 where it is not 0, else the first load harmonic, else the first of the casing; a later one may be faster."""
    chords: dict[str, Any] = {"load_harmonics": [[1.0, [3.0, 4.0], 0.0], [1.0, 30.0, 0.0], [1.0, 0.5, 0.0]]}
    moving: dict[str, Any] = {"casing_harmonics": [[1e-6, [5.0, 6.0], 0.0], [1e-6, 50.0, 0.0]]}
    lump, sine = chain(nodes=1, mass=1.0, stiffness=1.0), {"frequency": 2.0, "amplitude": [1.0, 0.0]}
    assert cases(lump, 2, **sine).period_frequency.tolist() == [2.0, 2.0]
    assert cases(lump, 2, **sine, **moving).period_frequency.tolist() == [2.0, 6.0]
    assert cases(lump, 2, **sine, **chords).period_frequency.tolist() == [2.0, 4.0]
    assert cases(lump, 2, **sine, **chords, **moving).period_frequency.tolist() == [2.0, 4.0]
