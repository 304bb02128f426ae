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
from workflow.kernels.packs import Lane, complex_at, magnitude, narrow, pack, some, spread, store_complex, times, where
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
    (shift, shift_im), same = complex_at(t, row.SHIFT, lane), DISTINCT * DISTINCT
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
        a, a_im = times(u[0, k], u[1, k], x, y)
        more, more_im = times(w[0, k], w[1, k], a, a_im)
        f, f_im = f - alpha * more, f_im - alpha * more_im
        store_complex(right, 2 * k, lane, (a, a_im))
        store_complex(left, 2 * k, lane, times(w[0, k], w[1, k], x, y))
    size = 1.0 / (f * f + f_im * f_im)
    f, f_im = f * size, -f_im * size
    (own_u, own_u_im), (own_w, own_w_im) = complex_at(t, row.U, lane), complex_at(t, row.W, lane)
    force, force_im = times(own_w, own_w_im, f, f_im)
    store_complex(t, row.FORCE, lane, (force, force_im))
    lead, lead_im = alpha * force, alpha * force_im
    follow, follow_im = times(own_u, own_u_im, f, f_im)
    follow, follow_im = alpha * follow, alpha * follow_im
    length, length_im, terms = zero + 1.0, zero, zero + 1.0
    for k in range(u.shape[1]):
        one = where(own(t, k, row.POLE, lane), 1.0, zero)
        x, y = complex_at(right, 2 * k, lane)
        p, q = complex_at(left, 2 * k, lane)
        x, y = times(x, y, lead, lead_im)
        p, q = times(p, q, follow, follow_im)
        part, part_im = times(x, y, p, q)
        length, length_im, terms = length + part, length_im + part_im, terms + (magnitude(part) + magnitude(part_im))
        store_complex(right, 2 * k, lane, (x + one, y))
        store_complex(left, 2 * k, lane, (p + one, q))
    square = length * length + length_im * length_im
    back, back_im = length / square, -length_im / square
    for k in range(u.shape[1]):
        p, q = complex_at(left, 2 * k, lane)
        store_complex(left, 2 * k, lane, times(p, q, back, back_im))
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
