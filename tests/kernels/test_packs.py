"""Packs against NumPy: the same numbers bit for bit, NaN as in a plain loop, nothing beside the lanes in use."""

from typing import Any

import numba
import numpy as np
import pytest

from workflow.kernels.lanes import LANES, PACK, lane_rows
from workflow.kernels.pack_operations import BROAD
from workflow.kernels.packs import broad, narrow, pack, shared, some, some_nonzero, store, where
from workflow.models import Array


@numba.njit(error_model="numpy")
def _compute(coefficient: Array, rows: Array, lane: Any) -> tuple[bool, bool]:
    a, b, c = pack(rows, (0, lane)), pack(rows, (1, lane)), shared(coefficient, (1, 2), lane)
    store(rows, (2, lane), c * a + 2.0 * (b - 0.5) - a * -b)
    store(rows, (3, lane), where(a > b, a, b))
    store(rows, (4, lane), where((a >= 0.0) & ~(b <= 0.0), 1.0, -b))
    return some(a > 1.0), some_nonzero(a)


@numba.njit(error_model="numpy")
def in_narrow(coefficient: Array, rows: Array) -> tuple[bool, bool]:
    return _compute(coefficient, rows, narrow(PACK))


@numba.njit(error_model="numpy")
def in_broad(coefficient: Array, rows: Array) -> tuple[bool, bool]:
    return _compute(coefficient, rows, broad(PACK))


@pytest.mark.parametrize(("compute", "width"), [(in_narrow, PACK), (in_broad, BROAD)])
@pytest.mark.parametrize("value", [0.0, -0.0, 2.0, -2.0, np.nan])
def test_a_number_in_the_last_lane(compute: Any, width: int, value: float) -> None:
    rng = np.random.default_rng(5)
    rows, coefficient, used = lane_rows(5), rng.normal(size=(2, 3)), slice(PACK, PACK + width)
    rows[:] = rng.normal(size=rows.shape)
    rows[0, used], rows[0, used.stop - 1], rows[1, PACK : PACK + 2] = 0.0, value, (np.nan, -0.0)
    a, b = rows[:2].copy()
    expected = [coefficient[1, 2] * a + 2.0 * (b - 0.5) - a * -b, np.where(a > b, a, b)]
    expected = np.array([*expected, np.where((a >= 0.0) & ~(b <= 0.0), 1.0, -b)])
    before = rows.copy()
    assert compute(coefficient, rows) == (value > 1.0, bool(value != 0.0))
    assert np.array_equal(rows[2:, used], expected[:, used], equal_nan=True)
    assert np.array_equal(np.signbit(rows[2:, used]), np.signbit(expected[:, used]))
    assert np.array_equal(np.delete(rows, np.r_[used], axis=1), np.delete(before, np.r_[used], axis=1))


def test_rows_hold_whole_packs() -> None:
    assert LANES % BROAD == BROAD % PACK == 0
