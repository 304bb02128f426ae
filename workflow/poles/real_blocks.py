"""Real blocks of a matrix by the general solver; two poles that nearly coincide on the real axis are one block.

X' = A X moves in blocks η' = u, u' = -c u - ω² η and first-order states ξ' = -μ ξ with

    X = p η + q u + x ξ,   A q = p - c q,   A p = -ω² q,

q any vector of the space of both poles of a block that is no eigenvector. Of a pair s = σ ± iν with the eigenvector x
it is 2 Im x/ν, and p = 2 Re x - σ q. Eigenvectors of two poles near each other nearly agree: the first two vectors of
an ordered Schur form span their space instead (Golub, Van Loan, Matrix computations (4th ed., 2013), section 7.6).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg

from workflow.kernels.algebra import Complex, inverse
from workflow.models import Array

_NEAR = 1e-3
"""Distance up to which two eigenvectors of unit length take more than three digits from each other."""


class RealBlocks(NamedTuple):
    """Blocks and first-order states."""

    damping: Array
    """c, 1/s, ``(block,)``."""
    stiffness: Array
    """ω², 1/s², ascending, ``(block,)``."""
    rate: Array
    """μ, 1/s, ``(first,)``."""
    inward: Array
    """[η, u, ξ] per X, ``(N, N)``."""
    outward: Array
    """X per [η, u, ξ], ``(N, N)``."""


def real_blocks(A: Array) -> RealBlocks:
    """Return the blocks of complex pairs and of real poles that nearly coincide; other real poles are by themselves.

    Raises
    ------
    numpy.linalg.LinAlgError
        The iteration did not converge, or the eigenvectors are dependent.
    """
    balanced, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    values, right = scipy.linalg.eig(balanced)
    blocks, firsts = [], []
    for k in np.flatnonzero(values.imag > 0):
        x = right[:, k]
        if np.linalg.norm(x.imag) < _NEAR:  # its largest entry is real
            blocks.append(_between(balanced, values, values[k].real))
        else:
            q = 2 * x.imag / values[k].imag
            blocks.append((-2 * values[k].real, abs(values[k]) ** 2, 2 * x.real - values[k].real * q, q))
    real = np.flatnonzero(values.imag == 0)
    left = list(real[np.argsort(values[real].real)])
    while left:
        k, x = left[0], right[:, left[0]].real
        twin = left[1] if len(left) > 1 else k
        apart = min(np.linalg.norm(x - right[:, twin].real), np.linalg.norm(x + right[:, twin].real))
        if twin != k and apart < _NEAR and (values[k] * values[twin]).real > 0:
            blocks.append(_between(balanced, values, (values[k] + values[twin]).real / 2))
            del left[:2]
        else:
            firsts.append(left.pop(0))
    blocks.sort(key=lambda block: block[1])
    damping, stiffness = (np.array([block[i] for block in blocks]) for i in range(2))
    p, q = (np.array([block[i] for block in blocks]).reshape(len(blocks), A.shape[0]).T for i in (2, 3))
    outward = np.concatenate([p, q, right[:, firsts].real], 1)
    return RealBlocks(damping, stiffness, -values[firsts].real, inverse(outward) / scale, scale[:, None] * outward)


def missed_share(A: Array, blocks: RealBlocks) -> float:
    """Return the share of A that its blocks miss: rounding, by as much as eigenvectors depend on each other."""
    seconds = blocks.damping.size
    p, q, x = np.split(blocks.outward, [seconds, 2 * seconds], axis=1)
    moved = np.concatenate([-blocks.stiffness * q, p - blocks.damping * q, -blocks.rate * x], axis=1)
    return float(np.abs(moved @ blocks.inward - A).max(initial=0.0) / np.abs(A).max(initial=1e-300))


def _between(A: Array, values: Complex, middle: float) -> tuple[float, float, Array, Array]:
    """Return c, ω², p and q of the two poles nearest to ``middle``."""
    distance = np.sort(np.abs(values - middle))
    radius = (distance[1] + distance[2]) / 2 if distance.size > 2 else np.inf
    form, vectors, _ = scipy.linalg.schur(A, sort=lambda re, im: np.hypot(re - middle, im) < radius)
    pair = form[:2, :2]
    c, space = -np.trace(pair), vectors[:, :2]
    q = np.linalg.svd(pair + c / 2 * np.eye(2))[2][0]
    return c, np.linalg.det(pair), space @ (pair @ q + c * q), space @ q
