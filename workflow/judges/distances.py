"""Relative L2 distances of histories."""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array


def norms(rows: Array) -> Array:
    """Return the L2 norm of each row, scaled by a power of two so that squares neither overflow nor underflow."""
    _, exponent = np.frexp(np.abs(rows).max(axis=1))
    scaled = np.ldexp(rows, -exponent[:, None])
    return np.asarray(np.ldexp(np.linalg.norm(scaled, axis=1), exponent))


def relative(distance: Array, size: Array) -> Array:
    """Return distance/size: 0 where the distance is 0, else NaN where the quotient is not finite."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.where(distance == 0.0, 0.0, distance / size)
    return np.where(np.isfinite(ratio), ratio, np.nan)


def relative_distance(values: Array, truth: Array) -> Array:
    """Return the L2 distance of each row from that of ``truth``, over the norm of ``truth``."""
    return relative(norms(values - truth), norms(truth))
