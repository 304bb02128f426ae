"""Eigenvalues and eigenvectors of a diagonal matrix with a rank-one term, each to its own relative accuracy.

In the modes that are uncoupled without friction heat the held tip has the matrix D + α u wᵀ, D = diag(d): d are the
poles of the held structure and its thermal rates, u the response to heat at the tip, wᵀ the row of the contact force.
Its eigenvalues are the zeros of the secular function

    f(s) = 1 - α Σ u_k w_k/(s - d_k).

Newton's method finds the shift δ of each zero from its nearest pole, so that every difference s - d_k keeps its digits
(Golub, SIAM Review 15 (1973) 318–334; the shift from the nearest pole as in LAPACK's dlaed4): a general eigenvalue
solver errs by rounding times the *largest* eigenvalue, some 1e-11 1/s here, which spoils the slow thermal ones. Zeros
lie in lanes; complex pairs count once.
"""

from __future__ import annotations

from workflow.kernels.compiled import inlined, part
from workflow.kernels.packs import Lane, magnitude, narrow, pack, some, spread, store, where
from workflow.models import Array
from workflow.schemes._exact import zeros as row
from workflow.schemes._exact.zeros import RankOne, Scratch, difference, fill_up, inverse, newton, own, start, start_from

NEWTON_STEPS, CONVERGED = 12, 1e-10
"""Newton ends where a shift changes by less than this, relatively: its next change would be about the square of it."""
DISTINCT = 1e-6
"""Two zeros nearer than this share of their shifts, and eigenvectors whose product is below this share of its terms,
keep fewer than ten digits: the general solver does no worse."""


@part
def solve(matrix: RankOne, alpha: float, guesses: Array, work: Scratch) -> tuple[int, int]:
    """Find zeros and eigenvectors; return how many zeros are complex, and how many there are, 0 where they are poor.

    ``guesses`` of the zeros may be given, ``(2, guess)``, of no size where Newton's method starts from the poles.
    """
    u, w, residue, t = matrix.u, matrix.w, work.residue, work.lanes
    for k in range(u.shape[1]):
        residue[0, k] = alpha * (u[0, k] * w[0, k] - u[1, k] * w[1, k])
        residue[1, k] = alpha * (u[0, k] * w[1, k] + u[1, k] * w[0, k])
    count = start_from(matrix, residue, guesses, work) if guesses.shape[1] > 0 else start(matrix, residue, work)
    if count == 0:
        return 0, 0
    iteration = (0, 1.0, 0, CONVERGED)
    for first in range(0, fill_up(t, count), 8):
        moving = True
        for _ in range(NEWTON_STEPS):
            if moving:
                moving = newton(matrix, residue, t, iteration, narrow(first))
        if moving:
            return 0, 0
    pairs, sound = _in_order(work, count), True
    for first in range(0, fill_up(t, count), 8):
        sound &= _distinct(t, count, narrow(first))
        sound &= _vectors(matrix, alpha, t, work.right, work.left, narrow(first))
    return (pairs, count) if sound and pairs + count == u.shape[1] else (0, 0)


@part
def _distinct(t: Array, count: int, lane: Lane) -> bool:
    """Tell whether all zeros of a pack differ from each other zero and, if complex, from the real axis."""
    shift, shift_im, same = pack(t, (row.SHIFT, lane)), pack(t, (row.SHIFT_IM, lane)), DISTINCT * DISTINCT
    size = shift * shift + shift_im * shift_im
    for k in range(count):
        other = t[row.SHIFT, k] * t[row.SHIFT, k] + t[row.SHIFT_IM, k] * t[row.SHIFT_IM, k]
        if some(~(difference(t, k, lane)[2] > same * (size + other))):
            return False
    height = pack(t, (row.D_IM, lane)) + shift_im
    return not some((pack(t, (row.FREE, lane)) > 0.0) & ~((height > 0.0) & (height * height > same * size)))


@part
def _vectors(matrix: RankOne, alpha: float, t: Array, right: Array, left: Array, lane: Lane) -> bool:
    """Fill the eigenvectors (s - D)⁻¹ u and wᵀ (s - D)⁻¹ of a pack; tell whether their product keeps its digits.

    They are 1 at the nearest pole, so that an eigenvalue that does not move keeps its own.
    """
    u, w, zero = matrix.u, matrix.w, spread(0.0, lane)
    f, f_im = zero + 1.0, zero
    for k in range(u.shape[1]):
        x, y = inverse(matrix.d, k, t, lane)
        a, a_im = u[0, k] * x - u[1, k] * y, u[0, k] * y + u[1, k] * x
        f, f_im = f - alpha * (a * w[0, k] - a_im * w[1, k]), f_im - alpha * (a * w[1, k] + a_im * w[0, k])
        store(right, (0, k, lane), a)
        store(right, (1, k, lane), a_im)
        store(left, (0, k, lane), w[0, k] * x - w[1, k] * y)
        store(left, (1, k, lane), w[0, k] * y + w[1, k] * x)
    size = 1.0 / (f * f + f_im * f_im)
    f, f_im = f * size, -f_im * size
    force = pack(t, (row.W, lane)) * f - pack(t, (row.W_IM, lane)) * f_im
    force_im = pack(t, (row.W, lane)) * f_im + pack(t, (row.W_IM, lane)) * f
    store(t, (row.FORCE, lane), force)
    store(t, (row.FORCE_IM, lane), force_im)
    lead, lead_im = alpha * force, alpha * force_im
    follow = alpha * (pack(t, (row.U, lane)) * f - pack(t, (row.U_IM, lane)) * f_im)
    follow_im = alpha * (pack(t, (row.U, lane)) * f_im + pack(t, (row.U_IM, lane)) * f)
    length, length_im, terms = zero + 1.0, zero, zero + 1.0
    for k in range(u.shape[1]):
        one = where(own(t, k, row.POLE, lane), 1.0, zero)
        x, y = pack(right, (0, k, lane)), pack(right, (1, k, lane))
        p, q = pack(left, (0, k, lane)), pack(left, (1, k, lane))
        x, y = x * lead - y * lead_im, x * lead_im + y * lead
        p, q = p * follow - q * follow_im, p * follow_im + q * follow
        part, part_im = x * p - y * q, x * q + y * p
        length, length_im, terms = length + part, length_im + part_im, terms + (magnitude(part) + magnitude(part_im))
        store(right, (0, k, lane), x + one)
        store(right, (1, k, lane), y)
        store(left, (0, k, lane), p + one)
        store(left, (1, k, lane), q)
    square = length * length + length_im * length_im
    back, back_im = length / square, -length_im / square
    for k in range(u.shape[1]):
        p, q = pack(left, (0, k, lane)), pack(left, (1, k, lane))
        store(left, (0, k, lane), p * back - q * back_im)
        store(left, (1, k, lane), p * back_im + q * back)
    return not some(~(square > DISTINCT * DISTINCT * terms * terms))


@part
def _in_order(work: Scratch, count: int) -> int:
    """Put the zeros in order, complex ones first, each kind by its size; return how many are complex."""
    t, trial, pairs = work.lanes, work.trial, 0
    for i in range(count):
        for quantity in range(row.ROWS):
            trial[quantity, i] = t[quantity, i]
        pairs += int(t[row.FREE, i])
    for i in range(count):
        place, size = 0, _size(trial, i)
        for k in range(count):
            before, less = trial[row.FREE, k] - trial[row.FREE, i], _size(trial, k) - size
            place += int(before > 0.0 or (before == 0.0 and (less < 0.0 or (less == 0.0 and k < i))))
        for quantity in range(row.ROWS):
            t[quantity, place] = trial[quantity, i]
        t[row.PLACE, place] = place
    return pairs


@inlined
def _size(t: Array, i: int) -> float:
    """Return |s|² of lane ``i``."""
    return float((t[row.D, i] + t[row.SHIFT, i]) ** 2 + (t[row.D_IM, i] + t[row.SHIFT_IM, i]) ** 2)
