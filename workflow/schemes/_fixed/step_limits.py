"""Largest time steps: by trial, with their text in messages, and of stability with a spring at each contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import ROUND_FLOOR, Context, Decimal

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import eigenvalues, singular
from workflow.models import Structure, mechanical_modes

_OCTAVES, _IN_OCTAVE = 40, 16
"""Steps are tried upwards from 2⁻⁴⁰ (1e-12) times the given one, sixteen to each doubling: 4 % apart."""

_RATIO = math.sqrt(math.sqrt(math.sqrt(math.sqrt(2.0))))

_HALVINGS = 40
"""Bisections of the last 4 %, after which the step is known to rounding."""


def largest_step(holds: Callable[[float], bool], h: float) -> float:
    """Return the largest step up to which ``holds`` is true, at most ``h``; 0 where it is false at the smallest one.

    Steps are products of ``h``, 2^(k/16) and powers of two, with the same bits on every processor.
    """
    good = 0.0
    for k in range(_IN_OCTAVE * _OCTAVES + 1):
        octave, within = divmod(k, _IN_OCTAVE)
        step = math.ldexp(h, octave - _OCTAVES)
        for _ in range(within):
            step *= _RATIO
        if not holds(step):
            return _between(holds, good, step) if good > 0 else 0.0
        good = step
    return good


def largest_stable_step(lam: NDArray[np.complex128], theta: float) -> float:
    """Return the step of the θ-method up to which no pole λ [1/s] grows, s; ``inf`` where θ >= 1/2.

    2 Re λ + (1-2θ) h |λ|² <= 0 for every λ.
    """
    if theta >= 0.5:
        return np.inf
    lam = lam[lam != 0]
    return float(np.min(-2 * lam.real / ((1 - 2 * theta) * (lam.real**2 + lam.imag**2)), initial=np.inf))


def limit_text(limit: float, digits: int = 6) -> str:
    """Return a limit in some digits, rounded down, so that a step copied from a message is not above the limit."""
    if not math.isfinite(limit):
        return f"{limit:g}"
    return f"{float(Context(prec=digits, rounding=ROUND_FLOOR).plus(Decimal(limit))):.{digits}g}"


def _between(holds: Callable[[float], bool], good: float, bad: float) -> float:
    """Bisect two steps for the largest one at which ``holds`` is true."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


_SWITCHING, _LASTING = 0.5, 0.95
"""Largest h √(κ W) and h ω_max/2 at which intermittent contact creates no energy, see :func:`switching_limit`."""

_SWITCHING_IMPLICIT, DISSIPATES = 0.25, 0.75
"""Largest h √(κ W) of the θ-method, and the θ from which on it has no limit, see :func:`implicit_limit`."""


ContactModes = tuple[Array, Array, Array]
"""ω [rad/s] of all modes, and w_i and w_i - µ t_i of the contacts in them, 1/√kg, ``(contact, mode)``; w_i twice where
no friction acts."""


def contact_modes(structure: Structure, friction: float = 0.0) -> ContactModes:
    """Return the modes at the contacts, the tip of one, with a coefficient of friction along their tangents."""
    modes, contacts = mechanical_modes(structure), structure.contacts
    rows = contacts.normal @ modes.shapes
    if friction == 0 or not contacts.tangent.any():
        return modes.values, rows, rows
    return modes.values, rows, rows - friction * contacts.tangent @ modes.shapes


def lasting_limit(modes: ContactModes, stiffness: float) -> float:
    """Return the largest stable step in lasting contact, s: 2/ω_max of K1 with κ at each contact.

    Central damping does not change it. Where friction turns the contact force away from the normal, ω_max² is the
    largest |eigenvalue| of diag(ω²) + κ Σ (w_i - µ t_i) w_iᵀ. Where that matrix has eigenvalues that are not positive
    the motion itself grows in contact, at any step.
    """
    frequency, rows, forces = modes
    if forces is not rows:
        spectrum = eigenvalues(np.diag(frequency**2) + stiffness * forces.T @ rows)
        return float(2 / np.sqrt(np.sqrt(np.max(spectrum.real**2 + spectrum.imag**2))))
    springs = np.sqrt(stiffness) * rows  # square-root factor of κ at the contacts, stacked below that of K1
    return float(2 / singular(np.vstack([np.diag(frequency), springs]))[0][0])


def mobility(modes: ContactModes) -> float:
    """Return W = e_nᵀ M⁻¹ e_n, or e_nᵀ M⁻¹ (e_n - µ t) where friction makes that larger, 1/kg.

    Of several contacts it is the largest singular value of W_ij = w_iᵀ M⁻¹ (w_j - µ t_j): all move together.
    """
    _, rows, forces = modes
    return float(max(np.linalg.norm(rows @ rows.T, 2), np.linalg.norm(rows @ forces.T, 2)))


def switching_limit(structure: Structure, stiffness: float, friction: float) -> float:
    """Return the largest step at which central differences are stable in intermittent contact, s.

    That is the smaller of 0.95 · 2/ω_max, with ω_max of K1 with κ at the tip, and 0.5/√(κ W): a quarter of 2/ω of the
    tip mass on the contact spring alone. 2/ω_max is the theoretical limit of a tip that stays in contact
    (:func:`lasting_limit`), at which rounding grows already. The second is measured, as no theory of intermittent
    contact gives it: each contact that begins or ends within a step creates or dissipates some energy, and above the
    limit their sum grows. It was measured once, in November 2026, in 120 scenes of 16 cases: random chains of 1 to 20
    nodes, the heavy chain, the blade and reduced models, κ of 1 to 3e4 static stiffnesses of the tip, with and without
    damper and friction heat, 50 periods of the first mode or 2e5 steps. Up to this limit no case created more energy
    than 0.4 times its largest; at 1.5 times the limit 22 % of the scenes have a case that created more than that, at
    2 times 32 %, at 4 times all. ``tests/schemes/test_contact_limit.py`` repeats five scenes at the limit and four at
    3.9 times.

    With friction the casing's drive does work, so that an energy balance is no criterion. The largest tip displacement
    was measured once, in November 2026, and no test repeats it: it stays small at an eighth of the limit in 99 of 120
    random structures. Of these it is at most 1.84 times as large at the limit, and more than twice as large at 1.5
    times the limit in 9 %, at 2 times in 21 %, at 4 times in 88 %. Several contacts were not measured.
    """
    modes = contact_modes(structure, friction)
    return float(min(_LASTING * lasting_limit(modes, stiffness), _SWITCHING / np.sqrt(stiffness * mobility(modes))))


def implicit_limit(structure: Structure, stiffness: float, friction: float) -> float:
    """Return the largest stable step of the θ-method with θ < 0.75 in intermittent contact, s: 0.25/√(κ W).

    It is stable in lasting contact, but a contact that begins or ends within a step creates energy unless the
    method dissipates more. It was measured once, in November 2026, in 60 of the scenes of explicit steps: with θ = ½
    at most 0.31 of the largest energy is created up to this limit, more than all of it at 2 times the limit in 1.7 %
    of the scenes, at 4 times in 13 %, at 30 times in 95 %. With θ = 0.75 nothing is created at 30 times that limit,
    0.24 at most at 100 times. ``tests/schemes/test_contact_limit.py`` repeats five scenes at the limit and
    four at 30 times with θ = ½, three at 30 times with θ = 0.75.
    """
    return float(_SWITCHING_IMPLICIT / np.sqrt(stiffness * mobility(contact_modes(structure, friction))))
