"""A damped lump that is pressed on its casing by a harmonic load, every bounce followed: a plain loop.

Between impacts the gap g obeys g'' = -c g' + ω² (d - g) - f(t)/m, by its Taylor series, piece by
piece; a flight that begins at the casing ends at a zero of series/τ, so that no digit is lost however
low it is. It shares nothing with the schemes.
"""

from __future__ import annotations

import numba
import numpy as np

TERMS = 24


@numba.njit
def _series(s: np.ndarray, g: float, u: float, t: float, lump: np.ndarray) -> None:
    """Fill the Taylor coefficients of the gap about t."""
    c, w2, gap, force, omega = lump
    s[0], s[1] = g, u
    cos, sin, scale = force * np.cos(omega * t), force * np.sin(omega * t), 1.0
    push = w2 * gap - sin
    for n in range(TERMS - 2):
        s[n + 2] = (-c * (n + 1) * s[n + 1] - w2 * s[n] + push) / ((n + 1) * (n + 2))
        sin, cos = omega * cos, -omega * sin
        scale *= n + 1.0
        push = -sin / scale


@numba.njit
def _at(s: np.ndarray, tau: float, lowest: int) -> tuple[float, float]:
    """Return Σ s_n τ^(n - lowest) and its derivative."""
    value, rate = 0.0, 0.0
    for n in range(TERMS - 1, lowest - 1, -1):
        rate = rate * tau + value
        value = value * tau + s[n]
    return value, rate


@numba.njit
def _next_zero(s: np.ndarray, u: float, piece: float, lowest: int) -> tuple[float, bool]:
    """Return the first zero of the gap within a piece, by signs at 16 points, or a piece without one."""
    right = min(piece, -1.5 * u / s[2]) if lowest == 1 and s[2] < 0.0 < u else piece
    for i in range(1, 17):
        low, high = right * (i - 1) / 16, right * i / 16
        if _at(s, high, lowest)[0] < 0.0:
            tau = 0.5 * (low + high)
            for _ in range(100):
                value, rate = _at(s, tau, lowest)
                low, high = (tau, high) if value > 0.0 else (low, tau)
                step = -value / rate if rate != 0.0 else np.inf
                if low < tau + step < high:
                    tau += step
                    if abs(step) <= 1e-16 * tau:
                        break
                else:
                    tau = 0.5 * (low + high)
            return tau, True
    return right, False


@numba.njit
def follow(lump: np.ndarray, e: float, times: np.ndarray, velocity: np.ndarray) -> tuple[float, int]:
    """Fill velocities at the sample times; return the time in contact and the number of bounces.

    ``lump`` is c, ω², gap, force/mass, Ω. It rests where its next flights take less than 1e-16 s in all.
    """
    c, w2, gap, force, omega = lump
    s, piece, end = np.zeros(TERMS), 0.05 / c, times[-1]
    t, g, u, k, contact, bounces = 0.0, gap, 0.0, 0, 0.0, 0
    while t < end:
        _series(s, g, u, t, lump)
        tau, hit = _next_zero(s, u, piece, 1 if g == 0.0 else 0)
        while k < times.size and times[k] < t + tau:
            velocity[k] = -_at(s, times[k] - t, 0)[1]
            k += 1
        after, rate = _at(s, tau, 0)
        t, g, u = t + tau, after, rate
        if hit:
            bounces += 1
            g, u = 0.0, -e * rate
            pressing = force * np.sin(omega * t) - w2 * gap
            if pressing > 0.0 and 2.0 * u / (pressing * (1.0 - e)) < 1e-16:
                turn = np.floor(omega * t / (2.0 * np.pi)) * 2.0 * np.pi
                lifts = min((turn + np.pi - np.arcsin(w2 * gap / force)) / omega, end)
                while k < times.size and times[k] < lifts:
                    velocity[k] = 0.0
                    k += 1
                contact += lifts - t
                t, u = lifts, 0.0
    return contact, bounces
