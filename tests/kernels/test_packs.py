"""Packs against NumPy: the same numbers bit for bit, lanes that never meet, NaN as in a plain loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest

from workflow.kernels.lanes import LANES, PACK, ROW, lane_rows
from workflow.kernels.pack_operations import BROAD
from workflow.kernels.packs import (
    Pack,
    align_stack,
    broad,
    flag,
    magnitude,
    narrow,
    pack,
    raised,
    shared,
    some,
    some_nonzero,
    spread,
    store,
    where,
)
from workflow.models import Array

RESULTS = 6


@numba.njit(error_model="numpy")
def _compute(a: Pack, b: Pack, c: Pack, rows: Array, lane: Any) -> None:
    store(rows, (3, lane), c * a + 2.0 * (b - 0.5) - a * -b)
    store(rows, (4, lane), where(a > b, a, b))
    store(rows, (5, lane), where((a >= 0.0) & ~(b <= 0.0), 1.0, -b))
    store(rows, (6, lane), magnitude(a) + spread(3.0, lane))
    a += b
    a -= c
    a *= 0.1
    store(rows, (7, lane), a)
    store(rows, (8, lane), where(a < b, 1.0, 0.0))


@numba.njit(error_model="numpy")
def in_narrow_packs(coefficient: Array, rows: Array, lanes: int) -> None:
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        _compute(pack(rows, (0, lane)), pack(rows, (1, lane)), shared(coefficient, (1, 2), lane), rows, lane)


@numba.njit(error_model="numpy")
def in_broad_packs(coefficient: Array, rows: Array, lanes: int) -> None:
    align_stack()
    for first in range(0, lanes, BROAD):
        lane = broad(first)
        _compute(pack(rows, (0, lane)), pack(rows, (1, lane)), shared(coefficient, (1, 2), lane), rows, lane)


@numba.njit(error_model="numpy")
def _tell(rows: Array, lane: Any) -> tuple[bool, bool]:
    return some(pack(rows, (0, lane)) > 1.0), some_nonzero(pack(rows, (0, lane)))


@numba.njit(error_model="numpy")
def tell(rows: Array) -> tuple[tuple[bool, bool], tuple[bool, bool]]:
    return _tell(rows, narrow(0)), _tell(rows, broad(0))


@pytest.mark.parametrize(
    ("lane", "value", "in_narrow", "in_broad"),
    [
        (3, 0.0, (False, False), (False, False)),
        (0, -0.0, (False, False), (False, False)),
        (7, 2.0, (True, True), (True, True)),
        (7, -2.0, (False, True), (False, True)),
        (8, 2.0, (False, False), (True, True)),
        (15, np.nan, (False, False), (False, True)),
        (0, np.nan, (False, True), (False, True)),
        (BROAD, 2.0, (False, False), (False, False)),
    ],
)
def test_what_holds_in_some_lane(
    lane: int, value: float, in_narrow: tuple[bool, bool], in_broad: tuple[bool, bool]
) -> None:
    rows = lane_rows(1)
    rows[0, lane] = value
    assert tell(rows) == (in_narrow, in_broad)


def expected(a: Array, b: Array, c: float) -> Array:
    further = ((a + b) - c) * 0.1
    return np.array(
        [
            c * a + 2.0 * (b - 0.5) - a * -b,
            np.where(a > b, a, b),
            np.where((a >= 0.0) & ~(b <= 0.0), 1.0, -b),
            np.abs(a) + 3.0,
            further,
            np.where(further < b, 1.0, 0.0),
        ]
    )


@pytest.mark.parametrize("march", [in_narrow_packs, in_broad_packs])
def test_arithmetic_of_each_lane(march: Callable[..., None]) -> None:
    rng = np.random.default_rng(5)
    rows, coefficient = lane_rows(3 + RESULTS), rng.normal(size=(2, 3))
    rows[:] = rng.normal(size=rows.shape)
    rows[0, 3], rows[1, 5], rows[0, 7], rows[0, 9], rows[1, 9] = np.nan, np.nan, -np.inf, 0.0, -0.0
    before = rows.copy()
    march(coefficient, rows, LANES // 2)
    used = slice(0, LANES // 2)
    by_numpy = expected(before[0, used], before[1, used], coefficient[1, 2])
    assert np.array_equal(rows[3:, used], by_numpy, equal_nan=True)
    assert np.array_equal(np.signbit(rows[3:, used]), np.signbit(by_numpy))
    assert np.array_equal(rows[:3], before[:3], equal_nan=True)
    assert np.array_equal(rows[:, LANES // 2 :], before[:, LANES // 2 :])  # nothing beside the lanes in use


@numba.njit(error_model="numpy")
def put(rows: Array, first: int, up: bool) -> tuple[bool, bool]:
    before = raised(rows, (1, narrow(first)))
    flag(rows, (1, narrow(first)), up)
    return before, raised(rows, (1, narrow(first)))


def test_a_pack_has_a_flag_of_its_own() -> None:
    rows = lane_rows(3)
    assert put(rows, PACK, True) == (False, True)
    assert put(rows, 0, False) == (False, False)
    assert put(rows, PACK, False) == (True, False)
    put(rows, PACK, True)
    assert np.argwhere(rows.view(np.int64)).tolist() == [[1, PACK]]


def test_rows_hold_whole_packs() -> None:
    assert LANES % BROAD == 0
    assert BROAD % PACK == 0
    assert ROW >= LANES
