"""Real Schur form of a Hessenberg matrix by the QR iteration with two shifts at a time.

Written after LAPACK's dlahqr and dlanv2 (Anderson and others, LAPACK Users' Guide, 1999), with its tests for what is
negligible (Ahues and Tisseur, LAPACK Working Note 122) and its shifts where it stalls.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part, uncounted

_EPS = float(np.finfo(float).eps)
_TINY = float(np.finfo(float).tiny) / _EPS

_STEPS = 30
"""Most steps per eigenvalue, as in LAPACK; two or three are usual."""

_STALLED = 10
"""Steps without an eigenvalue after which another shift is tried."""

_OTHER_DIAGONAL, _OTHER_PRODUCT = 0.75, -0.4375
"""What that shift is made of, as in EISPACK and LAPACK."""


@inlined
def _sized(value: float, sign: float) -> float:
    """Return the magnitude of a value with a sign."""
    return abs(value) if sign >= 0.0 else -abs(value)


@part
def _negligible(h: Array, k: int, first: int, last: int) -> Any:
    """Tell whether h[k, k-1] can be set to 0 without moving an eigenvalue by more than rounding.

    LAPACK compares with the diagonal alone, which is 0 for pairs without damping: it then waits for underflow. So the
    sizes of the eigenvalues of the blocks of two that end and begin here are looked at first.
    """
    below = abs(h[k, k - 1])
    before, after = abs(h[k - 1, k - 1]), abs(h[k, k])
    if k - 2 >= first:
        before += np.sqrt(abs(h[k - 1, k - 2])) * np.sqrt(abs(h[k - 2, k - 1]))
    if k + 1 <= last:
        after += np.sqrt(abs(h[k + 1, k])) * np.sqrt(abs(h[k, k + 1]))
    if below <= max(_TINY, _EPS * min(before, after)):
        return True
    beside = abs(h[k - 1, k - 1]) + abs(h[k, k])
    if beside == 0.0:
        if k - 2 >= first:
            beside += abs(h[k - 1, k - 2])
        if k + 1 <= last:
            beside += abs(h[k + 1, k])
    if below > _EPS * beside:
        return False
    above, distance = abs(h[k - 1, k]), abs(h[k - 1, k - 1] - h[k, k])
    high, low = max(below, above), min(below, above)
    most, least = max(abs(h[k, k]), distance), min(abs(h[k, k]), distance)
    sizes = most + high
    return low * (high / sizes) <= max(_TINY, _EPS * (least * (most / sizes)))


@part
def _shifts(h: Array, first: int, last: int, steps: int, shift: Array) -> None:
    """Put two shifts (real, imaginary, real, imaginary) in ``shift``: the eigenvalues of the last block of two."""
    a, b, c, d = h[last - 1, last - 1], h[last - 1, last], h[last, last - 1], h[last, last]
    if steps % (2 * _STALLED) == _STALLED:
        size = abs(h[first + 1, first]) + abs(h[first + 2, first + 1])
        a = _OTHER_DIAGONAL * size + h[first, first]
        b, c, d = _OTHER_PRODUCT * size, size, a
    elif steps > 0 and steps % (2 * _STALLED) == 0:
        size = abs(h[last, last - 1]) + abs(h[last - 1, last - 2])
        a = _OTHER_DIAGONAL * size + h[last, last]
        b, c, d = _OTHER_PRODUCT * size, size, a
    size = abs(a) + abs(b) + abs(c) + abs(d)
    if size == 0.0:
        shift[0] = shift[1] = shift[2] = shift[3] = 0.0
        return
    a, b, c, d = a / size, b / size, c / size, d / size
    middle = 0.5 * (a + d)
    determinant = (a - middle) * (d - middle) - b * c
    root = np.sqrt(abs(determinant))
    if determinant >= 0.0:
        shift[0], shift[1], shift[2], shift[3] = middle * size, root * size, middle * size, -root * size
    else:
        one, other = middle + root, middle - root
        nearest = (one if abs(one - d) <= abs(other - d) else other) * size
        shift[0], shift[1], shift[2], shift[3] = nearest, 0.0, nearest, 0.0


@part
def _begin(h: Array, first: int, last: int, shift: Array, v: Array) -> int:
    """Return the row in which a step can begin, and put the first column of the shifted product in ``v``."""
    m = last - 2
    while True:
        away = h[m, m] - shift[2]
        below = abs(h[m + 1, m])
        size = abs(away) + abs(shift[3]) + below
        below = h[m + 1, m] / size
        v[0] = below * h[m, m + 1] + (h[m, m] - shift[0]) * (away / size) - shift[1] * (shift[3] / size)
        v[1] = below * (h[m, m] + h[m + 1, m + 1] - shift[0] - shift[2])
        v[2] = below * h[m + 2, m + 1]
        size = abs(v[0]) + abs(v[1]) + abs(v[2])
        for k in range(3):
            v[k] /= size
        if m == first:
            return m
        around = abs(h[m - 1, m - 1]) + abs(h[m, m]) + abs(h[m + 1, m + 1])
        if abs(h[m, m - 1]) * (abs(v[1]) + abs(v[2])) <= _EPS * abs(v[0]) * around:
            return m
        m -= 1


@inlined
def _reflect(rows: Array, k: int, three: bool, begin: int, end: int, v: Array, weight: float) -> None:
    """Reflect rows k, k + 1 and k + 2 (or two of them), from column ``begin`` to ``end``."""
    second, third = v[1], v[2]
    for j in range(begin, end):
        share = rows[k, j] + second * rows[k + 1, j]
        if three:
            share += third * rows[k + 2, j]
        share *= weight
        rows[k, j] -= share
        rows[k + 1, j] -= share * second
        if three:
            rows[k + 2, j] -= share * third


@part
def _mirror(v: Array, three: bool) -> Any:
    """Replace v by u of the reflection 1 - w u uᵀ, u₀ = 1, that leaves its first entry alone; return w.

    What it leaves is put in ``v[3]``.
    """
    rest = v[1] * v[1] + (v[2] * v[2] if three else 0.0)
    if rest == 0.0:
        v[3] = v[0]
        v[1] = v[2] = 0.0
        return 0.0
    left = -_sized(np.sqrt(v[0] * v[0] + rest), v[0])
    weight = (left - v[0]) / left
    for k in range(1, 3):
        v[k] /= v[0] - left
    v[3] = left
    return weight


@part
def _step(h: Array, basis: Array, begin: int, active: tuple[int, int], whole: bool, v: Array) -> None:
    """Chase the bulge that the first reflection makes from row ``begin`` out of the active block."""
    first, last = active
    top, end = (0, h.shape[0]) if whole else (first, last + 1)
    for k in range(begin, last):
        three = k < last - 1
        if k > begin:
            v[0], v[1], v[2] = h[k, k - 1], h[k + 1, k - 1], h[k + 2, k - 1] if three else 0.0
            size = max(abs(v[0]), max(abs(v[1]), abs(v[2])))
            if size > 0.0:
                for i in range(3):
                    v[i] /= size
            weight = _mirror(v, three)
            h[k, k - 1] = v[3] * size
            h[k + 1, k - 1] = 0.0
            if three:
                h[k + 2, k - 1] = 0.0
        else:
            weight = _mirror(v, three)
            if k > first:
                h[k, k - 1] *= 1.0 - weight
        _reflect(h, k, three, k, end, v, weight)
        _reflect(h.T, k, three, top, min(k + 3, last) + 1, v, weight)
        if whole:
            _reflect(basis, k, three, 0, basis.shape[1], v, weight)


@part
def _standard(h: Array, k: int, rotation: Array) -> None:
    """Put the rotation (cos, sin) that makes the block at k triangular or its diagonal constant in ``rotation``.

    The block is replaced by its rotated form. LAPACK's dlanv2.
    """
    a, b, c, d = h[k, k], h[k, k + 1], h[k + 1, k], h[k + 1, k + 1]
    cosine, sine = 1.0, 0.0
    if c == 0.0:
        pass
    elif b == 0.0:
        cosine, sine = 0.0, 1.0
        a, b, c, d = d, -c, 0.0, a
    elif a == d and (b > 0.0) != (c > 0.0):
        pass
    else:
        half = 0.5 * (a - d)
        most = max(abs(b), abs(c))
        least = min(abs(b), abs(c)) * (1.0 if (b > 0.0) == (c > 0.0) else -1.0)
        size = max(abs(half), most)
        z = half / size * half + most / size * least
        if z >= 4.0 * _EPS:
            z = half + _sized(np.sqrt(size) * np.sqrt(z), half)
            a, d = d + z, d - most / z * least
            length = np.sqrt(c * c + z * z)
            cosine, sine = z / length, c / length
            b, c = b - c, 0.0
        else:
            sigma, apart = b + c, a - d
            length = np.sqrt(sigma * sigma + apart * apart)
            cosine = np.sqrt(0.5 * (1.0 + abs(sigma) / length))
            sine = -(half / (length * cosine)) * (1.0 if sigma >= 0.0 else -1.0)
            aa, bb = a * cosine + b * sine, b * cosine - a * sine
            cc, dd = c * cosine + d * sine, d * cosine - c * sine
            a, b = aa * cosine + cc * sine, bb * cosine + dd * sine
            c, d = cc * cosine - aa * sine, dd * cosine - bb * sine
            a = d = 0.5 * (a + d)
            if c != 0.0 and b == 0.0:
                b, c = -c, 0.0
                cosine, sine = -sine, cosine
            elif c != 0.0 and (b > 0.0) == (c > 0.0):
                root_b, root_c = np.sqrt(abs(b)), np.sqrt(abs(c))
                move, by = _sized(root_b * root_c, c), 1.0 / np.sqrt(abs(b + c))
                a, d = a + move, d - move
                b, c = b - c, 0.0
                turn, side = root_b * by, root_c * by
                cosine, sine = cosine * turn - sine * side, cosine * side + sine * turn
    h[k, k], h[k, k + 1], h[k + 1, k], h[k + 1, k + 1] = a, b, c, d
    rotation[0], rotation[1] = cosine, sine


@part
def _turn(h: Array, basis: Array, k: int, whole: bool, rotation: Array) -> None:
    """Split off the block of rows k and k + 1: bring it to its standard form, and turn the rest along."""
    _standard(h, k, rotation)
    cosine, sine = rotation[0], rotation[1]
    if not whole or (cosine == 1.0 and sine == 0.0):
        return
    for j in range(k + 2, h.shape[0]):
        h[k, j], h[k + 1, j] = cosine * h[k, j] + sine * h[k + 1, j], cosine * h[k + 1, j] - sine * h[k, j]
    for i in range(k):
        h[i, k], h[i, k + 1] = cosine * h[i, k] + sine * h[i, k + 1], cosine * h[i, k + 1] - sine * h[i, k]
    for j in range(basis.shape[1]):
        one, other = basis[k, j], basis[k + 1, j]
        basis[k, j], basis[k + 1, j] = cosine * one + sine * other, cosine * other - sine * one


@uncounted
def schur(h: Array, basis: Array, first: int, last: int, whole: bool, work: Array) -> bool:
    """Replace a Hessenberg matrix by its real Schur form, blocks of two being complex pairs with a constant diagonal.

    Parameters
    ----------
    h
        Hessenberg from row ``first`` to row ``last`` (exclusive), triangular elsewhere.
    basis
        Orthonormal basis in rows, turned along where ``whole`` says so.
    whole
        Form all of the matrix; else its diagonal blocks only, for eigenvalues.
    work
        Room for eight numbers.

    Returns
    -------
    bool
        False where the iteration did not converge.
    """
    shift, v = work[:4], work[4:]
    end, steps = last - 1, 0
    while end >= first:
        begin = end
        while begin > first and not _negligible(h, begin, first, last - 1):
            begin -= 1
        if begin > first:
            h[begin, begin - 1] = 0.0
        if begin >= end - 1:
            if begin == end - 1:
                _turn(h, basis, begin, whole, v)
            end, steps = begin - 1, 0
            continue
        if steps > _STEPS * max(10, last - first):
            return False
        _shifts(h, begin, end, steps, shift)
        start = _begin(h, begin, end, shift, v)
        _step(h, basis, start, (begin, end), whole, v)
        steps += 1
    return True
