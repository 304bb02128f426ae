"""Sine and cosine of arrays, with bits of an element that do not depend on the others.

NumPy, in contrast, chooses between implementations by length and alignment. The functions are those of
:mod:`workflow.kernels.elementary`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workflow.kernels import Array, elementary
from workflow.kernels.compiled import kernel


@kernel
def _sine_cosine(x: Array, sin: Array, cos: Array) -> None:
    """Fill sin x and cos x."""
    for i in range(x.size):
        sin[i], cos[i] = elementary.sine_cosine(x[i])


def sine_cosine(x: ArrayLike) -> tuple[Array, Array]:
    """Return sin x and cos x."""
    arguments = np.array(x, dtype=np.float64, order="C")
    sin, cos = np.empty(arguments.shape), np.empty(arguments.shape)
    _sine_cosine(arguments.reshape(-1), sin.reshape(-1), cos.reshape(-1))
    return sin, cos
