"""Characteristic function of the contact-closed system, and its roots from approximate ones.

With the tip held and its contact force heating it, equation (1) closes through one number, the contact
force λ. An eigenvalue s fulfils 1 = α G(s), where G(s) is the contact force that a unit heat load at the
tip node causes, both as exp(s t). The eigenvalues are the roots of F = 1 - α G; the poles of G are those
of the tip held cold. F = P/Q with P'/P = F'/F + Σ 1/(s - pole).

Approximate roots are improved together (Ehrlich and Aberth, see Bini, Numer. Algorithms 13 (1996)): a Newton
step of P at one root, without what the other roots contribute to P'/P, so that no two end at the same place.
Where only some poles and roots were computed, the contributions of the others nearly cancel, and it is 0 at a root.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import kernel, part, uncounted

Complexes = NDArray[np.complex128]

_NEAR = 1e-6
"""Share of two roots of a mode below which their distance is not used."""

_MOST_STEPS = 60
"""Steps of the iteration; from eigenvalues of a reduced system it takes three to ten."""

_PRECISE = 1e-13
"""The last step of a root is below this share of it: convergence is at least quadratic, so what is left is rounding."""

_REPEATED = 1e-13
"""Roots nearer to each other than this share of them are one multiple root; neither repels the other."""


@part
def _inverse(z: complex) -> complex:
    """Return 1/z by Smith's rule, which cannot overflow on the way; 0 for 0."""
    if abs(z.real) >= abs(z.imag):
        if z.real == 0.0:
            return 0j
        ratio = z.imag / z.real
        size = z.real + z.imag * ratio
        return complex(1.0 / size, -ratio / size)
    ratio = z.real / z.imag
    size = z.imag + z.real * ratio
    return complex(ratio / size, -1.0 / size)


@part
def _along_chain(s: complex, lumps: Array, mass_damping: float, stiffness_damping: float) -> tuple[complex, complex]:
    """Return G(s) and its derivative for a chain, by one elimination from the root to the tip.

    ``o`` and ``w`` are what node i and all between it and the root resist with: o = s (s + a_M) m + (k' in series
    with the o before), k' = k (1 + a_K s), and w = s c + b + (κ in series with the w before). ``force`` is the
    contact force per kelvin of node i if it were the tip. For s > 0 only positive numbers are added. Rows of
    ``lumps``: m, k, a ℓ, c, κ, b. The root is clamped and cold: all of the first spring's elongation is its own.
    """
    ratio = 1.0 + stiffness_damping * s
    heavy, dheavy = s * (s + mass_damping), 2.0 * s + mass_damping
    o, do = lumps[1, 0] * ratio + heavy * lumps[0, 0], lumps[1, 0] * stiffness_damping + dheavy * lumps[0, 0]
    w, dw = lumps[4, 0] + s * lumps[3, 0] + lumps[5, 0], complex(lumps[3, 0])
    force, dforce = complex(0.5 * lumps[1, 0] * lumps[2, 0]), 0j
    for i in range(1, lumps.shape[1]):
        k, dk = lumps[1, i] * ratio, lumps[1, i] * stiffness_damping
        inverse = _inverse(k + o)
        moved = k * inverse  # displacement of the node before
        share = o * inverse  # elongation of the spring between
        dshare = (do * k - o * dk) * inverse * inverse
        inverse = _inverse(lumps[4, i] + w)
        below = lumps[4, i] * inverse  # temperature of the node before
        dbelow = -below * inverse * dw
        pull = 0.5 * lumps[1, i] * lumps[2, i]
        dforce = moved * (below * dforce + dbelow * force) - dshare * below * force
        dforce += pull * (dshare * (1.0 + below) + share * dbelow)
        force = moved * below * force + pull * share * (1.0 + below)
        o, do = k * share + heavy * lumps[0, i], dk * share + k * dshare + dheavy * lumps[0, i]
        w, dw = below * w + s * lumps[3, i] + lumps[5, i], below * below * dw + lumps[3, i]
    inverse = _inverse(w)
    return force * inverse, (dforce - force * inverse * dw) * inverse


@part
def _in_modes(s: complex, modes: Array, heat: Array, coupling: Array, mass_damping: float) -> tuple[complex, complex]:
    """Return G(s) and its derivative from modes, Σ_k [g_k + Σ_j L_j h_j(s) κ_jk] t_k/(s + μ_k).

    h_j = (s² + a_M s)/(s² + c_j s + ω_j²). Rows of ``modes``: ω², c, L; of ``heat``: μ, t, g.
    """
    total, dtotal = 0j, 0j
    for k in range(heat.shape[1]):
        inverse = _inverse(s + heat[0, k])
        total += heat[2, k] * heat[1, k] * inverse
        dtotal -= heat[2, k] * heat[1, k] * inverse * inverse
    numerator, dnumerator = s * (s + mass_damping), 2.0 * s + mass_damping
    for j in range(modes.shape[1]):
        driven, ddriven = 0j, 0j
        for k in range(heat.shape[1]):
            inverse = _inverse(s + heat[0, k])
            answer = coupling[j, k] * heat[1, k] * inverse
            driven += answer
            ddriven -= answer * inverse
        inverse = _inverse(s * (s + modes[1, j]) + modes[0, j])
        share = modes[2, j] * numerator * inverse
        dshare = (modes[2, j] * dnumerator - share * (2.0 * s + modes[1, j])) * inverse
        total += share * driven
        dtotal += dshare * driven + share * ddriven
    return total, dtotal


@kernel
def first_orders(modes: Array, heat: Array, coupling: Array, mass_damping: float, poles: Complexes) -> Complexes:
    """Return ds/dα at α = 0 of the eigenvalue at each pole: the residue of G there, 1/s per m/s.

    ``poles`` are both roots of each mode, then -μ. Where both roots of a mode nearly agree neither has a derivative:
    their distance is then taken as a share of them, so that the size alone is right.
    """
    derivatives = np.zeros(poles.size, dtype=np.complex128)
    for j in range(modes.shape[1]):
        for p in (2 * j, 2 * j + 1):
            s = poles[p]
            driven = 0j
            for k in range(heat.shape[1]):
                driven += coupling[j, k] * heat[1, k] * _inverse(s + heat[0, k])
            apart = 2.0 * s + modes[1, j]
            if _size(apart) < _NEAR * _size(s):
                apart = complex(_NEAR * _size(s))
            derivatives[p] = modes[2, j] * s * (s + mass_damping) * driven * _inverse(apart)
    for k in range(heat.shape[1]):
        s = -heat[0, k]
        share = heat[2, k]
        for j in range(modes.shape[1]):
            resistance = s * (s + modes[1, j]) + modes[0, j]
            if resistance != 0.0:
                share += modes[2, j] * s * (s + mass_damping) / resistance * coupling[j, k]
        derivatives[2 * modes.shape[1] + k] = heat[1, k] * share
    return derivatives


@part
def _size(s: complex) -> float:
    """Return |s| by operations that are rounded alike on every processor."""
    return float(np.sqrt(s.real * s.real + s.imag * s.imag))


@part
def _step(own: int, slope: complex, poles: Complexes, roots: Complexes) -> complex:
    """Return the step of the root ``own``, ``slope`` being F'/F there."""
    s = roots[own]
    for k in range(poles.size):
        slope += _inverse(s - poles[k])
    for k in range(roots.size):
        if k != own and _size(s - roots[k]) > _REPEATED * _size(s):
            slope -= _inverse(s - roots[k])
    return _inverse(slope)


@part
def _is_among(s: complex, poles: Complexes) -> bool:
    among = False
    for pole in poles:
        among |= pole == s
    return among


@uncounted
def improve(
    alpha: float,
    structure: tuple[Array, Array, Array],
    is_chain: bool,
    damping: tuple[float, float],
    poles: Complexes,
    roots: Complexes,
    left: Array,
) -> None:
    """Improve the first of the approximate ``roots`` of F in place, and put the last step of each in ``left``, 1/s.

    ``structure`` is (lumps, -, -) of a chain, see :func:`_along_chain`, else (modes, heat, coupling), see
    :func:`_in_modes`; ``damping`` is (a_M, a_K). ``poles`` and ``roots`` are those that were computed, both of each
    conjugate pair. A root that falls on a pole to the last bit is one: it does not take part in the contact. One that
    is nothing beside the slowest pole is 0.
    """
    for i in range(left.size):
        left[i] = np.inf
    nothing = np.inf
    for pole in poles:
        if pole != 0.0:
            nothing = min(nothing, _PRECISE * _size(pole))
    for _ in range(_MOST_STEPS):
        moving = False
        for i in range(left.size):
            s = roots[i]
            if left[i] <= _PRECISE * _size(s) or _size(s) <= nothing or _is_among(s, poles):
                left[i] = min(left[i], _PRECISE * _size(s))
                continue
            if is_chain:
                G, dG = _along_chain(s, structure[0], damping[0], damping[1])
            else:
                G, dG = _in_modes(s, structure[0], structure[1], structure[2], damping[0])
            F = 1.0 - alpha * G
            step = _step(i, -alpha * dG * _inverse(F), poles, roots) if F != 0.0 else 0j
            roots[i] = s - step
            left[i] = _size(step)
            moving = True
        if not moving:
            break
