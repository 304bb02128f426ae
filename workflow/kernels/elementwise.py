"""Elementary functions of arrays, element by element, with the same bits on every processor.

NumPy chooses between implementations of its own by what the processor offers, and they differ in the
last places. See :mod:`workflow.kernels.elementary` for what is used instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workflow.kernels import Array, elementary
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import uncounted


@uncounted
def _exp(x: Array, out: Array) -> None:
    """Fill e^x."""
    for i in range(x.size):
        out[i] = elementary.exp(x[i])


@uncounted
def _log(x: Array, out: Array) -> None:
    """Fill ln x."""
    for i in range(x.size):
        out[i] = elementary.log(x[i])


@uncounted
def _sine_cosine(x: Array, sin: Array, cos: Array) -> None:
    """Fill sin x and cos x."""
    for i in range(x.size):
        sin[i], cos[i] = elementary.sine_cosine(x[i])


def _flat(x: ArrayLike) -> Array:
    """Return a copy of numbers in one row."""
    return np.array(x, dtype=np.float64, order="C").reshape(-1)


def exp(x: ArrayLike) -> Array:
    """Return e^x."""
    powers = np.empty(np.shape(x))
    _exp(_flat(x), powers.reshape(-1))
    return powers


def log(x: ArrayLike) -> Array:
    """Return the natural logarithm."""
    logarithms = np.empty(np.shape(x))
    _log(_flat(x), logarithms.reshape(-1))
    return logarithms


def sine_cosine(x: ArrayLike) -> tuple[Array, Array]:
    """Return sin x and cos x."""
    sin, cos = np.empty(np.shape(x)), np.empty(np.shape(x))
    _sine_cosine(_flat(x), sin.reshape(-1), cos.reshape(-1))
    return sin, cos


def complex_exp(a: Any) -> Complex:
    """Return e^a of complex numbers."""
    a = np.asarray(a)
    (sin, cos), grown = sine_cosine(a.imag), exp(a.real)
    return grown * cos + 1j * (grown * sin)
