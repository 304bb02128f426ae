"""Elementary functions of arrays, element by element, with the same bits on every processor.

NumPy chooses between implementations of its own by what the processor offers, and they differ in the
last places. See :mod:`workflow.kernels.elementary` for what is used instead.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workflow.kernels import elementary
from workflow.kernels.compiled import uncounted
from workflow.kernels.complex_numbers import Complex, complex_of

Real = NDArray[np.float64]


@uncounted
def _exp(x: Real, out: Real) -> None:
    """Fill e^x."""
    for i in range(x.size):
        out[i] = elementary.exp(x[i])


@uncounted
def _expm1(x: Real, out: Real) -> None:
    """Fill e^x - 1."""
    for i in range(x.size):
        out[i] = elementary.expm1(x[i])


@uncounted
def _log(x: Real, out: Real) -> None:
    """Fill ln x."""
    for i in range(x.size):
        out[i] = elementary.log(x[i])


@uncounted
def _sine_cosine(x: Real, sin: Real, cos: Real) -> None:
    """Fill sin x and cos x."""
    for i in range(x.size):
        sin[i], cos[i] = elementary.sine_cosine(x[i])


@uncounted
def _hypot(x: Real, y: Real, out: Real) -> None:
    """Fill √(x² + y²)."""
    for i in range(x.size):
        out[i] = elementary.hypot(x[i], y[i])


def _of_each(function: Callable[..., None], *operands: ArrayLike, results: int = 1) -> tuple[Real, ...]:
    """Return the results of a kernel for all elements, of the arguments' common shape."""
    arguments = np.broadcast_arrays(*(np.asarray(each, dtype=np.float64) for each in operands))
    shape = arguments[0].shape
    outputs = [np.empty(arguments[0].size) for _ in range(results)]
    function(*(np.array(each).reshape(-1) for each in arguments), *outputs)
    return tuple(each.reshape(shape) for each in outputs)


def exp(x: ArrayLike) -> Real:
    """Return e^x."""
    return _of_each(_exp, x)[0]


def expm1(x: ArrayLike) -> Real:
    """Return e^x - 1."""
    return _of_each(_expm1, x)[0]


def log(x: ArrayLike) -> Real:
    """Return the natural logarithm."""
    return _of_each(_log, x)[0]


def sine_cosine(x: ArrayLike) -> tuple[Real, Real]:
    """Return sin x and cos x."""
    sin, cos = _of_each(_sine_cosine, x, results=2)
    return sin, cos


def hypot(x: ArrayLike, y: ArrayLike) -> Real:
    """Return √(x² + y²)."""
    return _of_each(_hypot, x, y)[0]


def complex_exp(a: Any) -> Complex:
    """Return e^a of complex numbers."""
    a = np.asarray(a)
    (sin, cos), grown = sine_cosine(a.imag), exp(a.real)
    return complex_of(grown * cos, grown * sin)
