"""Real blocks of a matrix by the general eigenvalue solver; of poles that coincide, by invariant subspaces.

X' = A X is separated into blocks η' = u, u' = -c u - ω² η and first-order states ξ' = -μ ξ with

    X = p η + q u + x ξ,   A q = p - c q,   A p = -ω² q,

q any vector of the invariant subspace of a block's two poles that is no eigenvector. For a pair s = σ ± iν with the
eigenvector x it is 2 Im x/ν, and p = 2 Re x - σ q. Eigenvectors x of two close poles nearly agree; x and a generalised
eigenvector w, (A - s) w = x with s one of the poles, span their subspace instead. A load on a slow block with
displacements in q, coordinates y with y' = v, would cancel in u + β: q has as little of them as can be.

Where eigenvectors do not separate A, invariant subspaces of clusters of poles do, from an ordered Schur form. In that
of real poles near μ, N = A - μ of rank r there with N² near 0 makes r blocks (N q, q), and first-order states of the
rest, whether poles have eigenvectors of their own or one for two.

The general solver leaves an error of rounding times the fastest pole in all of them. A step of Newton's method on
A V = V diag(s), V the eigenvectors, E = V⁻¹ A V - diag(s), gives each pole an accuracy relative to its own size in
graded matrices, such as those of motion and heat:

    s_j + E_jj,   v_j + Σ_i v_i E_ij/(s_j - s_i).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.linalg import lapack, solve_sylvester
from scipy.sparse.csgraph import connected_components

from workflow.kernels import Array
from workflow.kernels.algebra import Complex, connected_parts

_NEAR = 1e-3
"""Distance of two unit eigenvectors up to which they cost more than three digits."""

_SINGULAR = 1e-13
"""Singular values of A - s, over the largest, up to which they are 0: s is a pole."""

_ROUNDING = float(np.finfo(float).eps)
_SOUND, _KEPT = 2.5e-10, 1e-7
"""Error of a separation up to which no other is looked for: a condition of 1e6; up to which it is taken."""

_RIGHT, _MOST = 1e-8, 1e-3
"""Error of a propagated state up to which no other separation is looked for: the least of motions of all coordinates;
up to which it is taken: links of 1e12 times the stiffness of others leave 1e-4, wrong separations 1 and more."""

_CLUSTERS = 1e-12, 1e-9, 1e-7, 1e-5, 1e-3
"""Relative distances of neighbours in a cluster: poles that rounding parts, those of two that coincide, of three."""

_ZERO = 1e-15
"""Poles over the largest that are 0 but for rounding."""

_WEAK = 1e-8
"""Link of coinciding poles, over them, up to which it is left out: a block of two would lose as much."""

_TIMES: Array = 0.1 ** np.arange(12.0)
"""Times at which a propagated state is seen, over the last: from the fastest pole to the end of a case."""

_Places = NDArray[np.intp]
_Blocks = tuple[Array, Array, Array, Array]
"""c, ω², p and q: ``(block,)``, ``(N, block)``."""


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


def real_blocks(A: Array, duration: float = 1.0, parting: float = 1e-11) -> RealBlocks:
    """Return blocks for complex pairs and nearly coinciding real poles, and first-order states for other real poles.

    Parts of A that no entry links are separated apart. Eigenvectors are taken where they separate A, else clusters of
    coinciding poles. Two pairs with one eigenvector are parted by a relative change of A, ``parting``: by its root,
    which leaves ten digits; three poles by its third. A state is propagated over the ``duration`` [s] to see the error.

    Raises
    ------
    numpy.linalg.LinAlgError
        No separation keeps seven digits, or loses less than a hundred times ``parting``.
    """
    y, v, alone, parts = _parts(np.asarray_chkfinite(A))
    if parts and parts[0].size == len(A):
        return _blocks_of_part(A, duration, parting)
    each = [_blocks_of_part(A[part[:, None], part], duration, parting) for part in parts]
    each.append(RealBlocks(-A[v, v], -A[v, y], -A[alone, alone], *[np.eye(2 * y.size + alone.size)] * 2))
    parts.append(np.concatenate([y, v, alone]))
    c, w2, mu = (np.concatenate([blocks[i] for blocks in each]) for i in range(3))
    order, inward, outward = np.argsort(w2), np.zeros(A.shape), np.zeros(A.shape)
    block, first = np.argsort(order), 2 * c.size + np.arange(mu.size)
    for part, own in zip(parts, each, strict=True):
        k, j = own.damping.size, own.rate.size
        place = np.concatenate([block[:k], c.size + block[:k], first[:j]])
        inward[place[:, None], part], outward[part[:, None], place] = own.inward, own.outward
        block, first = block[k:], first[j:]
    return RealBlocks(c[order], w2[order], mu, inward, outward)


def _parts(A: Array) -> tuple[_Places, _Places, _Places, list[_Places]]:
    """Return y and v of blocks y' = v, v' = -ω² y - c v, states of their own, and the other parts no entry links."""
    links = (A != 0) | (A != 0).T | np.eye(len(A), dtype=np.bool_)
    count = np.count_nonzero(links, axis=1)
    y = np.flatnonzero(_displacements(A) & (count == 2))
    v = np.nonzero(A[y])[1]
    are_blocks = (count[v] == 2) & (A[v, y] <= 0)
    y, v, alone = y[are_blocks], v[are_blocks], np.flatnonzero(count == 1)
    linked = count > 1
    linked[y] = linked[v] = False
    rest = np.flatnonzero(linked)
    return y, v, alone, [rest[part] for part in connected_parts(links[rest][:, rest])]


def _blocks_of_part(A: Array, duration: float, parting: float) -> RealBlocks:
    """Return the blocks of A, all coordinates of which are linked."""
    least, best = _MOST, None
    by_clusters: list[Callable[[Array], RealBlocks]]
    by_clusters = [partial(_by_clusters, near=near, change=change) for change in (0.0, parting) for near in _CLUSTERS]
    for separate in (_by_eigenvectors, *by_clusters):
        with suppress(np.linalg.LinAlgError, ValueError):
            blocks = _beside_rigid_motions(A, separate)
            error, lost = _error_of(A, blocks), propagated_error(A, blocks, duration)
            if error < max(_KEPT, 100 * parting) and lost < least:
                least, best = lost, blocks
            if error <= _SOUND and lost <= _RIGHT:
                break
    if best is None:
        raise np.linalg.LinAlgError("poles coincide, and their eigenvectors depend on each other")
    return best


def _displacements(A: Array) -> NDArray[np.bool_]:
    """Return which coordinates y have y' = v, another coordinate."""
    return np.asarray((np.sum(A != 0, axis=1) == 1) & (A.max(axis=1, initial=0.0) == 1))


def _by_eigenvectors(A: Array) -> RealBlocks:
    """Return the blocks of A by its eigenvectors."""
    balanced, _, _, scale, _ = lapack.dgebal(A, scale=1)  # D⁻¹ A D and D
    values, vectors = (found.astype(np.complex128) for found in np.linalg.eig(balanced))
    near, alone = _near_pairs(values, vectors), np.ones(values.size, dtype=np.bool_)
    for pair in near:
        vectors[:, pair] = _subspace(balanced, vectors[:, pair[0]].real, values[pair[1]].real)
    alone[near] = False
    moved = np.linalg.solve(vectors, balanced @ vectors)
    change, apart = moved - np.diag(values), values - values[:, None]
    step = np.divide(change, apart, out=np.zeros_like(change), where=np.abs(change) < _NEAR * np.abs(apart))
    step[:, ~alone] = 0.0
    for pair in near:
        apart = moved[np.ix_(pair, pair)] - values[alone][:, None, None] * np.eye(2)
        step[np.ix_(alone, pair)] = (moved[alone][:, None, pair] @ np.linalg.pinv(apart))[:, 0]
    firsts = alone & (values.imag == 0)
    values, vectors = values + np.diag(change), vectors + vectors @ step
    above, y = alone & ~firsts & (values.imag > 0), _displacements(A)
    blocks = [_blocks_of_pairs(values[above], vectors[:, above], y)]
    blocks += [_block_of(moved[np.ix_(pair, pair)].real, vectors[:, pair].real, y) for pair in near]
    return _assembled(blocks, -values[firsts].real, vectors[:, firsts].real, scale)


def _assembled(each: list[_Blocks], rate: Array, firsts: Array, scale: Array) -> RealBlocks:
    """Return blocks in the order of ω², then first-order states, of a matrix that was balanced by ``scale``."""
    damping, stiffness, p, q = (np.concatenate([blocks[i] for blocks in each], axis=-1) for i in range(4))
    order = np.argsort(stiffness, kind="stable")
    outward = np.concatenate([p[:, order], q[:, order], firsts], axis=1)
    return RealBlocks(damping[order], stiffness[order], rate, np.linalg.inv(outward) / scale, scale[:, None] * outward)


def _error_of(A: Array, blocks: RealBlocks) -> float:
    """Return what the blocks lose: their relative residual, or rounding times the condition of a coordinate."""
    condition = np.sum(np.abs(blocks.inward) * np.abs(blocks.outward.T), 1).max(initial=0.0)
    return max(relative_residual(A, blocks), _ROUNDING * float(condition))


def propagated_error(A: Array, blocks: RealBlocks, duration: float) -> float:
    """Return the error of a state that the blocks propagate over a time [s], of each coordinate over its largest value.

    The state begins with velocities and temperatures. X = outward · [η, u, ξ] has the defect X' - A X, integrated in
    time; what rounding of A would do as well does not count. At 0 it is outward · inward X - X.
    """
    c, w2, mu, inward, outward = blocks
    begin = np.where(_displacements(A), 0.0, lapack.dgebal(A, scale=1)[3] * np.cos(np.arange(len(A)) ** 2))
    times, half = duration * _TIMES, c / 2
    growth = max((np.sqrt(half**2 - w2 + 0j) - half).real.max(initial=0.0), -mu.min(initial=0.0))
    C, S = oscillations(half + growth, half**2 - w2, times)
    eta, u, xi = np.split(inward @ begin, [c.size, 2 * c.size])
    eta, u = eta * (C + half * S) + u * S, u * (C - half * S) - eta * w2 * S
    xi = xi * np.exp(-(mu + growth) * times[:, None])
    states = [eta, u, xi], [u, -c * u - w2 * eta, -mu * xi]
    X, slope = (outward @ np.concatenate(state, axis=1).T for state in states)
    beyond = np.abs(slope - A @ X) - 16 * _ROUNDING * (np.abs(A) @ np.abs(X))
    largest = np.maximum(np.abs(X).max(axis=1), np.abs(begin))
    error = np.abs(outward @ (inward @ begin) - begin) + np.maximum(beyond, 0.0) @ times
    return float(np.max(np.divide(error, largest, out=error, where=largest > 0)))


def oscillations(half: Array, square: Array, times: Array) -> tuple[Array, Array]:
    """Return e^(-c t/2) cosh(r t) and e^(-c t/2) sinh(r t)/r by c/2 and r² of blocks, ``(time, block)``."""
    t, root = times[:, None], np.sqrt(square + 0j)
    z, one, other = root * t, np.exp((root - half) * t), np.exp((-root - half) * t)
    near = np.abs(z) < 1  # sinh(z)/z is sinc(iz/π)
    still = t * np.exp(-half * t) * np.sinc(np.where(near, z, 0) * (1j / np.pi))
    return ((one + other) / 2).real, np.where(near, still, (one - other) / np.where(near, 1.0, 2 * root)).real


def relative_residual(A: Array, blocks: RealBlocks) -> float:
    """Return max |A - blocks| / max |A|: rounding times the condition number of the eigenvectors."""
    seconds = blocks.damping.size
    p, q, x = np.split(blocks.outward, [seconds, 2 * seconds], axis=1)
    moved = np.concatenate([-blocks.stiffness * q, p - blocks.damping * q, -blocks.rate * x], axis=1)
    return float(np.abs(moved @ blocks.inward - A).max(initial=0.0) / np.abs(A).max(initial=1e-300))


def _beside_rigid_motions(A: Array, separate: Callable[[Array], RealBlocks]) -> RealBlocks:
    """Return the blocks of A; nothing depends on displacements y of rigid motions, y' = P X are velocities.

    Of the other coordinates the first-order states with the largest effect on y, as many as y, become blocks with
    ω² = 0, u = ξ and y = V η. The rest contributes y' = r η + r' u, integrated to (r' - c r/ω²) η - r/ω² u.
    """
    if A.any(axis=0).all() or not (drifts := np.flatnonzero(~A.any(axis=0) & _displacements(A))).size:
        return separate(A)
    others = np.setdiff1d(np.arange(len(A)), drifts)
    c, w2, mu, inward, outward = separate(A[np.ix_(others, others)])
    at, P = [c.size, 2 * c.size], A[np.ix_(drifts, others)]
    (r, slope, per_first), (eta, u, xi) = np.split(P @ outward, at, axis=1), np.split(inward, at)
    share = np.linalg.norm(per_first, axis=0) * np.linalg.norm(xi[:, P.any(axis=0)], axis=1)
    most, rest = np.split(np.argsort(-share, kind="stable"), [drifts.size])
    V, decay = per_first[:, most], -np.divide(per_first, mu, out=np.zeros_like(per_first), where=mu != 0)
    y, y_slope = slope - c * r / w2, -r / w2
    apart = np.linalg.solve(V, y @ eta + y_slope @ u + decay[:, rest] @ xi[rest])
    into, out, still = np.zeros(A.shape), np.zeros(A.shape), np.zeros((others.size, drifts.size))
    into[:, others] = np.concatenate([-apart, eta, xi[most], u, xi[rest]])
    into[: drifts.size, drifts] = np.linalg.inv(V)
    out_eta, out_u, out_xi = np.split(outward, at, axis=1)
    out[others] = np.concatenate([still, out_eta, out_xi[:, most], out_u, out_xi[:, rest]], axis=1)
    out[drifts] = np.concatenate([V, y, np.zeros_like(V), y_slope, decay[:, rest]], axis=1)
    return RealBlocks(np.append(mu[most], c), np.append(np.zeros(most.size), w2), mu[rest], into, out)


def _by_clusters(A: Array, near: float, change: float = 0.0) -> RealBlocks:
    """Return the blocks of A by invariant subspaces of clusters of poles, up to ``near`` from one to the next.

    ``change`` is the relative size of a random change of A that parts poles whose eigenvectors coincide.
    """
    y = _displacements(A)
    A = A * (1 + change * np.random.default_rng(0).uniform(-1, 1, A.shape))
    balanced, _, _, scale, _ = lapack.dgebal(A, scale=1)  # D⁻¹ A D and D
    T, Q = scipy.linalg.rsf2csf(*scipy.linalg.schur(balanced))
    values = np.diag(T)
    close = near * np.maximum(np.abs(values), np.abs(values[:, None])) + _ZERO * np.abs(values).max()
    count, label = connected_components(np.abs(values - values[:, None]) <= close, directed=False)
    spaces, places, at = [], [], 0
    for members in (label == k for k in range(count)):
        lowest, highest = values[members].imag.min(), values[members].imag.max()
        if highest >= 0:  # of conjugate clusters the one above the real axis
            space = lapack.ztrsen(members, T, Q, job="N", lwork=1)[1][:, : members.sum()]
            is_real, size = lowest <= 0, space.shape[1]
            if is_real:
                space = np.linalg.svd(np.hstack([space.real, space.imag]))[0][:, :size]
            spaces += [space] if is_real else [space, space.conj()]
            places.append((is_real, np.arange(at, at := at + size)))
            at += 0 if is_real else size
    V = np.hstack(spaces)
    V = V @ _refinement(np.linalg.solve(V, balanced @ V), [space.shape[1] for space in spaces])
    moved = np.linalg.solve(V, balanced @ V)
    blocks = [_blocks_of_pairs(values[:0], V[:, :0], y)]
    rates: list[float] = []
    firsts: list[Array] = []
    for is_real, place in places:
        M, space = moved[np.ix_(place, place)], V[:, place]
        if is_real:
            inner = _by_eigenvectors(M.real)
            if _error_of(M.real, inner) <= _SOUND:  # neighbours for the size of A alone
                p, q, x = np.split(space.real @ inner.outward, [inner.damping.size, 2 * inner.damping.size], axis=1)
                blocks.append((inner.damping, inner.stiffness, p, q))
                rates, firsts = [*rates, *inner.rate], [*firsts, *x.T]
                continue
            basis, pairs = _pairs_and_singles(M.real)
            M, space = np.linalg.solve(basis, M.real @ basis), space.real @ basis
            blocks += [_block_of(M[k : k + 2, k : k + 2], space[:, k : k + 2], y) for k in range(0, 2 * pairs, 2)]
            rates += list(-np.diag(M)[2 * pairs :])
            firsts += list(space[:, 2 * pairs :].T)
            continue
        basis = _independent(M)
        space, M = space @ basis, np.linalg.solve(basis, M @ basis)
        blocks.append(_blocks_of_pairs(np.diag(M), space, y))
    return _assembled(blocks, np.array(rates), np.array(firsts).reshape(-1, len(A)).T, scale)


def _refinement(moved: Complex, sizes: list[int]) -> Complex:
    """Return the change of subspaces V by a step of Newton's method, Sylvester's equations; ``moved`` is V⁻¹ A V."""
    owner, size = np.repeat(np.arange(len(sizes)), sizes), np.repeat(sizes, sizes)
    D, alone = np.where(owner[:, None] == owner, moved, 0), np.flatnonzero(size == 1)
    step, poles = np.eye(len(D), dtype=np.complex128), np.diag(D)[alone]
    apart = poles - poles[:, None] + np.eye(alone.size)
    step[np.ix_(alone, alone)] += (moved - D)[np.ix_(alone, alone)] / apart
    for k in np.flatnonzero(np.array(sizes) > 1):
        own, others = np.flatnonzero(owner == k), np.flatnonzero(owner != k)
        for rows, columns in ((own, others), (alone, own)):
            block, beside = D[np.ix_(rows, rows)], D[np.ix_(columns, columns)]
            step[np.ix_(rows, columns)] = solve_sylvester(block, -beside, -moved[np.ix_(rows, columns)])
    return step


def _pairs_and_singles(B: Array) -> tuple[Array, int]:
    """Return a basis in which B, of nearly coinciding real poles μ, consists of pairs, which come first, and poles.

    With N = B - μ of rank r and N² = 0 the pairs are (N q, q), q the right singular vectors.
    """
    size, mean = len(B), np.trace(B) / len(B)
    N = B - mean * np.eye(size)
    left, s, right = np.linalg.svd(N)
    pairs = int(np.sum(s > _WEAK * abs(mean)))
    if 2 * pairs > size:
        raise np.linalg.LinAlgError("more than two poles with one eigenvector")
    frame = np.linalg.qr(np.hstack([left[:, :pairs], right[:pairs].T, np.eye(size)]))[0]
    q, rest = frame[:, pairs : 2 * pairs], frame[:, 2 * pairs :]
    p = N @ q
    if pairs:
        turn, back = np.split(np.linalg.lstsq(np.hstack([p, q]), N @ p)[0], 2)
        q = q @ _independent(turn + back / abs(mean))
        p = N @ q
        pull = left[:, :pairs].T
        rest = rest - q @ np.linalg.solve(pull @ p, pull @ N @ rest)
        p = p / np.linalg.norm(p, axis=0)
    basis = np.hstack([np.stack([p, q], 2).reshape(size, 2 * pairs), rest])
    inner = np.linalg.solve(basis, B @ basis)[2 * pairs :, 2 * pairs :]
    basis[:, 2 * pairs :] = rest @ _independent(inner)
    return basis, pairs


def _independent(M: Array) -> Array:
    """Return the eigenvectors of M, or unit vectors where they are not real or depend on each other."""
    if len(M) < 2:
        return np.eye(len(M))
    vectors = np.linalg.eig(M)[1]
    usable = (np.iscomplexobj(M) or np.isrealobj(vectors)) and np.linalg.cond(vectors) < 1 / _WEAK
    return vectors if usable else np.eye(len(M))


def _near_pairs(values: Complex, vectors: Complex) -> NDArray[np.intp]:
    """Return pairs of poles, conjugate or real of the same sign, whose eigenvectors nearly agree, ``(pair, 2)``."""
    real, near = values.imag == 0, []
    mates = (values.conj() == values[:, None]) | (real & real[:, None] & (values.real * values.real[:, None] >= 0))
    cosine = np.where(mates, np.abs(vectors.conj().T @ vectors), 0.0)
    np.fill_diagonal(cosine, 0.0)
    while cosine.max() > 1 - _NEAR**2 / 2:
        pair = np.array(np.unravel_index(cosine.argmax(), cosine.shape))
        near.append(pair)
        cosine[pair, :] = cosine[:, pair] = 0.0
    return np.array(near, dtype=np.intp).reshape(-1, 2)


def _subspace(A: Array, x: Array, s: float) -> Array:
    """Return an orthonormal basis of the invariant subspace of two nearly coinciding poles: x and w, (A - s) w = x."""
    w = scipy.linalg.lstsq(A - s * np.eye(x.size), x, cond=_SINGULAR)[0]
    return np.asarray(np.linalg.qr(np.column_stack([x, w]))[0])


def _blocks_of_pairs(s: Complex, x: Complex, y: NDArray[np.bool_]) -> _Blocks:
    """Return the blocks of pairs of poles, s and eigenvectors x above the real axis, turned to real x[y]."""
    x = x * np.exp(-0.5j * np.angle(np.sum(x[y] ** 2, axis=0)))
    q = 2 * x.imag / s.imag
    return -2 * s.real, s.real**2 + s.imag**2, 2 * x.real - s.real * q, q


def _block_of(pair: Array, space: Array, y: NDArray[np.bool_]) -> _Blocks:
    """Return the block of two poles, with ``pair`` the matrix of A in their invariant subspace."""
    c = -np.trace(pair)
    seen = np.vstack([space[y], _WEAK * np.eye(2)])
    q = np.linalg.svd(seen @ (pair + c / 2 * np.eye(2)))[2][:1].T
    return np.array([c]), np.array([max(0.0, np.linalg.det(pair))]), space @ (pair @ q + c * q), space @ q
