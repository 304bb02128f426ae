"""Sums and products: right, and the same bits whatever stands beside them and on whatever processor."""

from __future__ import annotations

import hashlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processors import on_every_processor, printed_here, printed_under
from workflow.kernels.complex_numbers import complex_product, complex_total, magnitude, over, square_root, times
from workflow.kernels.sums import dot, norm, product, total

EPS = np.finfo(float).eps
numbers = st.floats(-1e100, 1e100, allow_subnormal=False)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 127, 128, 129, 640, 1000, 100_003])
def test_total_is_exact_to_few_roundings(count: int) -> None:
    terms = np.random.default_rng(count).normal(size=count)
    assert abs(total(terms) - math.fsum(terms)) <= (20 + math.log2(count + 1)) * EPS * np.abs(terms).sum()


@pytest.mark.parametrize("shape", [(1, 5), (7, 300), (64, 3), (0, 4), (3, 0)])
def test_total_of_a_row_does_not_depend_on_other_rows(shape: tuple[int, int]) -> None:
    terms = np.random.default_rng(1).normal(size=shape)
    assert total(terms, 1).tolist() == [total(row) for row in terms]
    assert total(terms, 0).tolist() == [total(column) for column in terms.T]
    assert total(np.asfortranarray(terms), 1).tolist() == total(terms, 1).tolist()


def test_total_takes_any_axis_and_kind() -> None:
    counts = np.arange(24).reshape(2, 3, 4)
    for axis in (-3, -2, -1, 0, 1, 2):
        np.testing.assert_array_equal(total(counts, axis), counts.sum(axis))
    assert total(np.array([True, True, False])) == 2.0
    assert total([1.0, 2.0]) == 3.0


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 9), st.integers(0, 9), st.integers(0, 9))
def test_product_is_the_same_row_by_row_and_column_by_column(seed: int, m: int, n: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(m, n)), rng.normal(size=(n, k))
    whole = product(a, b)
    np.testing.assert_allclose(whole, a @ b, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(whole, np.array([product(row, b) for row in a]).reshape(m, k))
    np.testing.assert_array_equal(whole, np.array([product(a, column) for column in b.T]).reshape(k, m).T)
    np.testing.assert_array_equal(whole, product(np.asfortranarray(a), b[:, ::-1])[:, ::-1])


def test_product_of_vectors_is_a_float_and_shapes_are_checked() -> None:
    assert product(np.array([1.0, 2.0]), np.array([3.0, 4.0])) == 11.0
    assert dot([1, 2], [3, 4]) == 11.0
    with pytest.raises(ValueError, match=r"\(2, 3\) and \(2,\)"):
        product(np.ones((2, 3)), np.ones(2))


def test_read_only_operands_are_taken() -> None:
    fixed = np.eye(3)
    fixed.flags.writeable = False
    assert product(fixed, fixed[0]).tolist() == [1.0, 0.0, 0.0]


def test_norms() -> None:
    values = np.random.default_rng(3).normal(size=(4, 9)) * (1 + 2j)
    np.testing.assert_allclose(norm(values, 0), np.linalg.norm(values, axis=0), rtol=1e-15)
    assert norm(values) == pytest.approx(np.linalg.norm(values), rel=1e-15)
    assert norm(np.zeros(0)) == 0.0


@settings(max_examples=200, deadline=None)
@given(numbers, numbers, numbers, numbers)
def test_complex_arithmetic(a: float, b: float, c: float, d: float) -> None:
    x, y = complex(a, b), complex(c, d)
    assert times(x, y).item() == complex(a * c - b * d, a * d + b * c)
    assert magnitude(x).item() == pytest.approx(math.hypot(a, b), rel=2 * EPS)
    if y != 0 and abs(x) > 1e-100 and abs(y) > 1e-100:
        assert abs(over(x, y).item() - x / y) <= 8 * EPS * abs(x / y)
    root = square_root(x).item()
    assert root.real >= 0
    assert abs(root * root - x) <= 8 * EPS * abs(x)


def test_complex_roots_of_real_numbers() -> None:
    assert square_root(np.array([-4.0, 0.0, 9.0])).tolist() == [2j, 0, 3]
    assert square_root(complex(-4.0, -0.0)).item() == -2j


def test_complex_products_and_totals() -> None:
    rng = np.random.default_rng(5)
    a = rng.normal(size=(4, 6)) + 1j * rng.normal(size=(4, 6))
    b = rng.normal(size=(6, 5)) - 1j * rng.normal(size=(6, 5))
    for p, q in ((a, b), (a.real, b), (a, b.real), (a[0], b), (a, b[:, 0]), (a[0], b[:, 0])):
        np.testing.assert_allclose(complex_product(p, q), p @ q, rtol=0, atol=1e-14)
    np.testing.assert_allclose(complex_total(a, 0), a.sum(0), rtol=0, atol=1e-14)


HASH = """
import hashlib, numpy as np
from workflow.kernels.complex_numbers import magnitude, over, square_root, times
from workflow.kernels.eigen import eigenvectors
from workflow.kernels.singular import least_squares, singular
from workflow.kernels.solving import cholesky, inverse, solve_triangular
from workflow.kernels.sums import norm, product, total

bits = np.random.PCG64(7).random_raw(3000) >> np.uint64(11)
numbers = bits.astype(np.float64) / 2.0**52 - 1.0
a, b = numbers[:1200].reshape(40, 30), numbers[1200:2400].reshape(30, 40)
square = product(a, b)
results = [square, singular(a).values, singular(a).vectors, least_squares(a, square), *eigenvectors(square)]
definite = product(b, b.T) + 40 * np.eye(30)
results += [cholesky(definite), inverse(definite), solve_triangular(cholesky(definite), b, True)]
results += [total(a, 0), total(numbers), norm(square, 1)]
z, w = numbers[:1500] + 1j * numbers[1500:], numbers[1500:] - 1j * numbers[:1500]
results += [times(z, w), over(z, w), magnitude(z), square_root(z)]
print(hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in results)).hexdigest())
"""


@on_every_processor
def test_bits_are_the_same_on_every_processor(settings: dict[str, str]) -> None:
    here = printed_here(HASH)
    assert len(here) == hashlib.sha256().digest_size * 2
    assert printed_under(settings, "-c", HASH) == here
