"""Elementary functions against mpmath, within one unit in the last place; packs against NumPy, bit for bit."""

from collections.abc import Callable, Iterable
from typing import Any

import mpmath
import numba
import numpy as np
import pytest

from workflow.kernels import Array, elementary, elementwise
from workflow.kernels.compiled import kernel
from workflow.kernels.lanes import LANES, PACK, lane_rows
from workflow.kernels.pack_operations import BROAD
from workflow.kernels.packs import broad, narrow, pack, shared, some, some_nonzero, store, where

RANDOM = np.random.default_rng(20261122)
COUNT = 4000
TINY = 5e-324


def powers(low: float, high: float, count: int = 500) -> Any:
    return np.clip(10.0 ** RANDOM.uniform(low, high, count), TINY, 1.7e308)


def worst(values: Any, arguments: Any, function: Callable[[Any], Any], digits: int = 60) -> float:
    """The largest error, in units in the last place of what was found."""
    with mpmath.workdps(digits):
        errors = [
            abs(mpmath.mpf(float(value)) - function(mpmath.mpf(float(x)))) / float(np.spacing(abs(value)))
            for value, x in zip(values, arguments, strict=True)
        ]
    return float(max(errors))


def near_multiples(count: int) -> Iterable[float]:
    """Doubles nearest to multiples of π/2, whose sine or cosine nearly vanishes."""
    with mpmath.workdps(60):
        for k in (*range(1, count), *(int(k) for k in RANDOM.integers(1, 2**39, count))):
            yield float(k * mpmath.pi / 2)


@kernel
def _exp(x: Array, powers: Array) -> None:
    for i in range(x.size):
        powers[i] = elementary.exp(x[i])


def exp(x: Any) -> Array:
    powers = np.zeros(len(x))
    _exp(np.array(x), powers)
    return powers


def test_exponential() -> None:
    x = np.concatenate([RANDOM.uniform(-745, 709.7, COUNT), RANDOM.uniform(-1, 1, COUNT), powers(-320, 0)])
    x = np.concatenate([x, -powers(-320, 0), RANDOM.uniform(-745.13, -708, COUNT), [709.782712893384]])
    assert worst(exp(x), x, mpmath.exp) < 1


@pytest.mark.parametrize("which", [0, 1], ids=["sine", "cosine"])
def test_sine_and_cosine(which: int) -> None:
    x = np.concatenate([RANDOM.uniform(-10, 10, COUNT), RANDOM.uniform(-1.7e6, 1.7e6, COUNT), powers(6, 12)])
    x = np.concatenate([x, -powers(-323, 6), -powers(6, 12), list(near_multiples(1000))])
    values, function = elementwise.sine_cosine(x)[which], (mpmath.sin, mpmath.cos)[which]
    assert worst(values, x, function) < 1


def test_special_values() -> None:
    inf, nan = np.inf, np.nan
    arguments = [0.0, -0.0, inf, -inf, nan, 710.0, -746.0, TINY]
    np.testing.assert_array_equal(exp(arguments), [1, 1, inf, 0, nan, inf, 0, 1])
    sin, cos = elementwise.sine_cosine([0.0, -0.0, inf, -inf, nan, TINY, 1e300])
    np.testing.assert_array_equal(sin, [0, 0, nan, nan, nan, TINY, nan])
    np.testing.assert_array_equal(np.signbit(sin[:2]), [False, True])
    np.testing.assert_array_equal(cos, [1, 1, nan, nan, nan, 1, nan])


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
    return _compute(coefficient, rows, broad(PACK, None))


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
