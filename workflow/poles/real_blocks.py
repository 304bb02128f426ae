"""Real blocks of a matrix by the general eigenvalue solver; two nearly coinciding real poles are one block.

X' = A X is separated into blocks η' = u, u' = -c u - ω² η and first-order states ξ' = -μ ξ with

    X = p η + q u + x ξ,   A q = p - c q,   A p = -ω² q,

q any vector of the invariant subspace of a block's two poles that is no eigenvector. For a pair s = σ ± iν with the
eigenvector x it is 2 Im x/ν, and p = 2 Re x - σ q. Eigenvectors x of two close poles nearly agree; x and a generalised
eigenvector w, (A - s) w = x with s one of the poles, span their subspace instead.

The general solver leaves an error of rounding times the fastest pole in all of them. A step of Newton's method on
A V = V diag(s), V the eigenvectors, E = V⁻¹ A V - diag(s), gives each pole an accuracy relative to its own size in
graded matrices, such as those of motion and heat:

    s_j + E_jj,   v_j + Σ_i v_i E_ij/(s_j - s_i).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workflow.kernels.algebra import Complex, inverse
from workflow.models import Array

_NEAR = 1e-3
"""Distance of two unit eigenvectors up to which they cost more than three digits."""

_SINGULAR = 1e-13
"""Singular values of A - s, over the largest, up to which they are 0: s is a pole."""


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
    """Return blocks for complex pairs and nearly coinciding real poles, and first-order states for other real poles.

    Raises
    ------
    numpy.linalg.LinAlgError
        The iteration did not converge, or the eigenvectors are dependent.
    """
    drifts = np.flatnonzero(~A.any(axis=0) & (np.sum(A != 0, axis=1) == 1) & (A.max(axis=1, initial=0.0) == 1))
    if drifts.size:
        return _with_rigid_motions(A, drifts)
    balanced, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    values, vectors = scipy.linalg.eig(balanced)
    near, real = _near_pairs(values, vectors), values.imag == 0
    for pair in near:
        vectors[:, pair] = _subspace(balanced, vectors[:, pair[0]].real, values[pair[1]].real)
    alone = np.setdiff1d(np.arange(values.size), near)
    moved = np.linalg.solve(vectors, balanced @ vectors)
    change, apart = moved - np.diag(values), values - values[:, None]
    step = np.divide(change, apart, out=np.zeros_like(change), where=np.abs(change) < _NEAR * np.abs(apart))
    step[:, np.setdiff1d(np.arange(values.size), alone)] = 0.0
    for pair in near:
        apart = moved[np.ix_(pair, pair)] - values[alone, None, None] * np.eye(2)
        step[np.ix_(alone, pair)] = (moved[alone][:, None, pair] @ np.linalg.pinv(apart))[:, 0]
    values, vectors = values + np.diag(change), vectors + vectors @ step
    blocks = [_block_of(moved[np.ix_(pair, pair)].real, vectors[:, pair].real) for pair in near]
    for k in alone[(values.imag > 0)[alone] & ~real[alone]]:
        s, x = values[k], vectors[:, k]
        q = 2 * x.imag / s.imag
        blocks.append((-2 * s.real, s.real**2 + s.imag**2, 2 * x.real - s.real * q, q))
    blocks.sort(key=lambda block: block[1])
    firsts = alone[real[alone]]
    damping, stiffness = (np.array([block[i] for block in blocks]) for i in range(2))
    p, q = (np.array([block[i] for block in blocks]).reshape(len(blocks), values.size).T for i in (2, 3))
    outward = np.concatenate([p, q, vectors[:, firsts].real], 1)
    return RealBlocks(damping, stiffness, -values[firsts].real, inverse(outward) / scale, scale[:, None] * outward)


def relative_residual(A: Array, blocks: RealBlocks) -> float:
    """Return max |A - blocks| / max |A|: rounding times the condition number of the eigenvectors."""
    seconds = blocks.damping.size
    p, q, x = np.split(blocks.outward, [seconds, 2 * seconds], axis=1)
    moved = np.concatenate([-blocks.stiffness * q, p - blocks.damping * q, -blocks.rate * x], axis=1)
    return float(np.abs(moved @ blocks.inward - A).max(initial=0.0) / np.abs(A).max(initial=1e-300))


def _with_rigid_motions(A: Array, drifts: NDArray[np.intp]) -> RealBlocks:
    """Return the blocks of A with displacements y of rigid motions: nothing depends on them, y' = P X are velocities.

    Of the other coordinates the first-order states with the largest effect on y, as many as y, become blocks with
    ω² = 0, u = ξ and y = V η. The rest contributes y' = r η + r' u, integrated to (r' - c r/ω²) η - r/ω² u.
    """
    others = np.setdiff1d(np.arange(len(A)), drifts)
    c, w2, mu, inward, outward = real_blocks(A[np.ix_(others, others)])
    at, P = [c.size, 2 * c.size], A[np.ix_(drifts, others)]
    (r, slope, per_first), (eta, u, xi) = np.split(P @ outward, at, axis=1), np.split(inward, at)
    share = np.linalg.norm(per_first, axis=0) * np.linalg.norm(xi[:, P.any(axis=0)], axis=1)
    most, rest = np.split(np.argsort(-share, kind="stable"), [drifts.size])
    V, decay = per_first[:, most], -np.divide(per_first, mu, out=np.zeros_like(per_first), where=mu != 0)
    y, y_slope = slope - c * r / w2, -r / w2
    apart = np.linalg.solve(V, y @ eta + y_slope @ u + decay[:, rest] @ xi[rest])
    into, out, still = np.zeros(A.shape), np.zeros(A.shape), np.zeros((others.size, drifts.size))
    into[:, others], into[: drifts.size, drifts] = np.concatenate([-apart, eta, xi[most], u, xi[rest]]), inverse(V)
    out_eta, out_u, out_xi = np.split(outward, at, axis=1)
    out[others] = np.concatenate([still, out_eta, out_xi[:, most], out_u, out_xi[:, rest]], axis=1)
    out[drifts] = np.concatenate([V, y, np.zeros_like(V), y_slope, decay[:, rest]], axis=1)
    return RealBlocks(np.append(mu[most], c), np.append(np.zeros(most.size), w2), mu[rest], into, out)


def _near_pairs(values: Complex, vectors: Complex) -> NDArray[np.intp]:
    """Return pairs of poles, conjugate or real of the same sign, whose eigenvectors nearly agree, ``(pair, 2)``."""
    near = [[k, k + 1] for k in np.flatnonzero(values.imag > 0).tolist() if np.linalg.norm(vectors[:, k].imag) < _NEAR]
    left = np.flatnonzero(values.imag == 0).tolist()
    while len(left) > 1:
        k = left.pop(0)
        own, others = vectors[:, [k]].real, vectors[:, left].real
        apart = np.minimum(np.linalg.norm(own - others, axis=0), np.linalg.norm(own + others, axis=0))
        apart[(values[k] * values[left]).real < 0] = np.inf
        if apart.min() < _NEAR:
            near.append([k, left.pop(int(np.argmin(apart)))])
    return np.array(near, dtype=np.intp).reshape(-1, 2)


def _subspace(A: Array, x: Array, s: float) -> Array:
    """Return an orthonormal basis of the invariant subspace of two nearly coinciding poles: x and w, (A - s) w = x."""
    w = scipy.linalg.lstsq(A - s * np.eye(x.size), x, cond=_SINGULAR)[0]
    return np.asarray(np.linalg.qr(np.column_stack([x, w]))[0])


def _block_of(pair: Array, space: Array) -> tuple[float, float, Array, Array]:
    """Return c, ω², p and q of two poles, with ``pair`` the matrix of A in their invariant subspace."""
    c = -np.trace(pair)
    q = np.linalg.svd(pair + c / 2 * np.eye(2))[2][0]
    return c, max(0.0, np.linalg.det(pair)), space @ (pair @ q + c * q), space @ q
