"""First guesses of the zeros of a secular function and Newton's method, on the zeros in lanes.

See :mod:`workflow.schemes._exact.secular`. Poles of the structure hardly move, and Newton's method starts from them.
Thermal rates see a structure that yields quasi-statically: their zeros are first sought together by the iteration of
Aberth (Math. Comp. 27 (1973) 339–344), which keeps them apart. A start depends on the structure and on α alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels.compiled import inlined, part
from workflow.kernels.packs import Lane, Pack, complex_at, narrow, pack, some, spread, store_complex, times, where
from workflow.models import Array

ABERTH_STEPS, APART = 40, 1e-5
"""Aberth's iteration ends where shifts change by less than this, relatively: what is left is less than its cube."""
REAL = 1e-7
"""A zero whose imaginary part is below this share of its shift is sought as a real one."""
_TINY = 1e-300
"""A shift of zero has converged."""

# rows of lanes, a zero s = d + δ in each; imaginary parts lie behind real ones
POLE = 0  # index of the nearest pole d
D, D_IM = 1, 2  # the pole, 1/s
SHIFT, SHIFT_IM = 3, 4  # δ, 1/s
FREE = 5  # 1 where the zero is complex, 0 where it is real
RESIDUE, RESIDUE_IM = 6, 7  # α u w of the pole
U, U_IM, W, W_IM = 8, 9, 10, 11  # of the pole
FORCE, FORCE_IM = 12, 13  # contact force per right eigenvector
PLACE = 14  # index of the lane
ROWS = 15


class RankOne(NamedTuple):
    """The matrix D + α u wᵀ; rows of arrays are real and imaginary parts, ``(2, N)``, thermal rates come last."""

    thermal: int
    """How many of the poles are thermal rates."""
    d: Array
    u: Array
    w: Array


class Scratch(NamedTuple):
    """Where a spectrum is found."""

    lanes: Array
    """Zeros with imaginary part >= 0, pairs first, each by its size, ``(ROWS, N + …)``."""
    trial: Array
    """Likewise, before they are in order."""
    residue: Array
    """α u w, ``(2, N)``."""
    right: Array
    """Right eigenvectors in the coordinates in which D is diagonal, ``(2 N, N + …)``: the real parts of each
    coordinate, and in the next row the imaginary ones."""
    left: Array
    """Left ones, left · right = 1."""


def rank_one(d: Any, u: Any, w: Any, thermal: int) -> RankOne:
    """Return the matrix of complex d, u and w ``(N,)``."""
    return RankOne(thermal, *(np.array([x.real, x.imag]) for x in (d, u, w)))


def scratch(size: int) -> Scratch:
    """Return memory for a matrix of so many rows; cases may use it one after the other."""
    wide = 8 * (size // 8 + 2)
    lanes = np.zeros((2, ROWS, wide))
    return Scratch(lanes[0], lanes[1], np.zeros((2, size)), np.zeros((2 * size, wide)), np.zeros((2 * size, wide)))


@inlined
def own(t: Array, k: int, row: int, lane: Lane) -> Any:
    """Return in which lanes a row of indices holds ``k``."""
    return (pack(t, (row, lane)) >= 1.0 * k) & (pack(t, (row, lane)) <= 1.0 * k)


@inlined
def inverse(d: Array, k: int, t: Array, lane: Lane) -> tuple[Pack, Pack]:
    """Return 1/(s - d_k), 0 for the pole of the lane itself."""
    (pole, pole_im), (shift, shift_im) = complex_at(t, D, lane), complex_at(t, SHIFT, lane)
    x, y = (pole - d[0, k]) + shift, (pole_im - d[1, k]) + shift_im
    size = 1.0 / where(own(t, k, POLE, lane), np.inf, x * x + y * y)
    return x * size, -y * size


@inlined
def difference(t: Array, k: int, lane: Lane) -> tuple[Pack, Pack, Pack]:
    """Return s - s_k and the square of its size, which is infinite for the lane itself."""
    (pole, pole_im), (shift, shift_im) = complex_at(t, D, lane), complex_at(t, SHIFT, lane)
    x, y = (pole - t[D, k]) + (shift - t[SHIFT, k]), (pole_im - t[D_IM, k]) + (shift_im - t[SHIFT_IM, k])
    return x, y, where(own(t, k, PLACE, lane), np.inf, x * x + y * y)


@inlined
def newton(matrix: RankOne, residue: Array, t: Array, iteration: tuple[int, float, int, float], lane: Lane) -> bool:
    """Correct the shifts of a pack by Newton's method for g(δ) = δ f(d + δ); tell whether one has not converged.

    ``iteration``: the first pole that counts, the constant part of f (1, or what the faster poles add to it), how many
    zeros repel each other (Aberth; 0: none), and the relative change below which a shift has converged.
    """
    (first, constant, apart, least), zero = iteration, spread(0.0, lane)
    f, f_im, slope, slope_im, away, away_im = zero + constant, zero, zero, zero, zero, zero
    for k in range(first, matrix.d.shape[1]):
        x, y = inverse(matrix.d, k, t, lane)
        term, term_im = times(residue[0, k], residue[1, k], x, y)
        steeper, steeper_im = times(term, term_im, x, y)
        f, f_im = f - term, f_im - term_im
        slope, slope_im = slope + steeper, slope_im + steeper_im
        away, away_im = away + x, away_im + y
    weight = 1.0 if apart > 0 else 0.0
    for k in range(apart):
        x, y, size = difference(t, k, lane)
        away, away_im = away - x / size, away_im + y / size
    (shift, shift_im), (pole, pole_im) = complex_at(t, SHIFT, lane), complex_at(t, RESIDUE, lane)
    g, g_im = times(shift, shift_im, f, f_im)
    g, g_im = g - pole, g_im - pole_im
    change, change_im = times(shift, shift_im, slope, slope_im)
    repelled, repelled_im = times(g, g_im, away, away_im)
    rate, rate_im = f + change + weight * repelled, f_im + change_im + weight * repelled_im
    size = rate * rate + rate_im * rate_im
    step = (g * rate + g_im * rate_im) / size
    step_im = pack(t, (FREE, lane)) * ((g_im * rate - g * rate_im) / size)
    shift, shift_im = shift - step, shift_im - step_im
    store_complex(t, SHIFT, lane, (shift, shift_im))
    change, size = step * step + step_im * step_im, shift * shift + shift_im * shift_im
    return some(~(change <= least * least * size + _TINY))


@part
def put(matrix: RankOne, residue: Array, t: Array, i: int, k: int, shift: complex) -> None:
    """Put the zero d_k + ``shift`` in lane ``i``."""
    t[POLE, i], t[PLACE, i] = k, i
    t[D, i], t[D_IM, i] = matrix.d[0, k], matrix.d[1, k]
    t[SHIFT, i], t[SHIFT_IM, i] = shift.real, shift.imag
    t[FREE, i] = 1.0 if shift.imag != 0.0 or t[D_IM, i] != 0.0 else 0.0
    t[RESIDUE, i], t[RESIDUE_IM, i] = residue[0, k], residue[1, k]
    t[U, i], t[U_IM, i], t[W, i], t[W_IM, i] = matrix.u[0, k], matrix.u[1, k], matrix.w[0, k], matrix.w[1, k]


@part
def fill_up(t: Array, count: int) -> int:
    """Let the last lane fill up its pack; return the lanes of all packs."""
    wide = 8 * ((count + 7) // 8)
    for row in range(ROWS):
        for i in range(count, wide):
            t[row, i] = t[row, count - 1]
    return wide


@part
def nearest(matrix: RankOne, residue: Array, t: Array, i: int, own: int, shift: complex) -> None:
    """Put the zero d_own + ``shift`` in lane ``i``, as a shift from the nearest pole that moves."""
    d, best, nearest_shift = matrix.d, own, shift
    least = shift.real * shift.real + shift.imag * shift.imag
    for k in range(d.shape[1]):
        x, y = (d[0, own] - d[0, k]) + shift.real, (d[1, own] - d[1, k]) + shift.imag
        moves = residue[0, k] != 0.0 or residue[1, k] != 0.0
        if moves and x * x + y * y < least:
            best, nearest_shift, least = k, complex(x, y), x * x + y * y
    real = d[1, best] + nearest_shift.imag == 0.0 or abs(nearest_shift.imag) <= REAL * abs(nearest_shift.real)
    put(matrix, residue, t, i, best, complex(nearest_shift.real, 0.0) if real else nearest_shift)


@part
def start(matrix: RankOne, residue: Array, work: Scratch) -> int:
    """Put first guesses of the zeros in lanes; return how many, 0 where those of thermal rates are not separated."""
    d, t, trial = matrix.d, work.lanes, work.trial
    fast, yielding, count = d.shape[1] - matrix.thermal, 1.0, 0
    for k in range(fast):
        size = d[0, k] * d[0, k] + d[1, k] * d[1, k]
        yielding += (residue[0, k] * d[0, k] + residue[1, k] * d[1, k]) / size
        if d[1, k] >= 0.0:
            put(matrix, residue, t, count, k, 0.0j)
            count += 1
    for j in range(matrix.thermal):
        k, size = fast + j, abs(residue[0, fast + j] / yielding)
        for other in range(fast, d.shape[1]):
            if other != k:
                size = min(size, 0.5 * abs(d[0, k] - d[0, other]))
        size = np.copysign(0.7 * size, residue[0, k] / yielding)
        put(matrix, residue, trial, j, k, complex(size, -size if j % 2 else size))
    if matrix.thermal == 0:
        return count
    iteration = (fast, yielding, matrix.thermal, APART)
    for _ in range(ABERTH_STEPS):
        moving = False
        for first in range(0, fill_up(trial, matrix.thermal), 8):
            moving |= newton(matrix, residue, trial, iteration, narrow(first))
        if not moving:
            break
    above = 0
    for j in range(matrix.thermal):
        shift = complex(trial[SHIFT, j], trial[SHIFT_IM, j])
        if moving or shift != shift:
            return 0
        nearest(matrix, residue, t, count, fast + j, shift)
        if t[FREE, count] != 0.0 and t[D_IM, count] + t[SHIFT_IM, count] < 0.0:
            above -= 1
            continue
        above += int(t[FREE, count])
        count += 1
    return count if above == 0 else 0


@part
def start_from(matrix: RankOne, residue: Array, guesses: Array, work: Scratch) -> int:
    """Put guesses ``(2, guess)`` with imaginary part >= 0 in lanes, and poles without residue; return how many."""
    d, t, count = matrix.d, work.lanes, 0
    matched = work.trial[PLACE]
    for i in range(guesses.shape[1]):
        matched[i] = 0.0
    for k in range(d.shape[1]):
        if residue[0, k] == 0.0 and residue[1, k] == 0.0 and d[1, k] >= 0.0:
            put(matrix, residue, t, count, k, 0.0j)
            least, best = np.inf, 0
            for i in range(guesses.shape[1]):
                size = (guesses[0, i] - d[0, k]) ** 2 + (guesses[1, i] - d[1, k]) ** 2
                if matched[i] == 0.0 and size < least:
                    least, best = size, i
            matched[best] = 1.0
            count += 1
    for i in range(guesses.shape[1]):
        if matched[i] == 0.0 and count < guesses.shape[1]:
            for k in range(d.shape[1]):
                if residue[0, k] != 0.0 or residue[1, k] != 0.0:
                    shift = complex(guesses[0, i] - d[0, k], guesses[1, i] - d[1, k])
                    nearest(matrix, residue, t, count, k, shift)
                    count += 1
                    break
    return count
