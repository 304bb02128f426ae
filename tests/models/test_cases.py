"""Cases that are alike are found, whatever varies among the others."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from workflow.models import distinct_rows

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
