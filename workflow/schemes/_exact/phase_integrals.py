"""Integrals of power and heat loss over the phases of the event-driven scheme, for the balances.

In a phase between two events the state X = [y, y', τ] (tip free, free modes) or [z, z', τ] (tip
held, held modes) obeys X' = A X + b + Σ (w_c cos ψ + w_s sin ψ), ψ = Ω t + φ of each wave. The power
that leaves the energy,

    D = Σ c_j v_j² + vᵀ G τ - fᵀv,   v = y' or z',

to which a casing that moves a held tip, x = s d + φ z with sᵀ K1 φ = 0, and friction µ along t add

    D = d' (2 b' · z' + sᵀ C1 s d' + sᵀ K12 θ - sᵀ f + λ (1 - µ sᵀt)) - µ λ tᵀφ z',

and the heat loss L(τ) are integrated over the phase from the state in which it began:

- in the eigenvectors of A, X = Σ U_m Z_m exp(s_m t), constant and harmonic responses among the
  columns of U, so that ∫D dt = Σ Q_mk Z_m Z_k ∫exp((s_m + s_k) t) dt and ∫L dt likewise;
- where eigenvectors are ill-conditioned or a response to the loads resonates (rigid and critical modes,
  resonance, heat without outlet), with the propagator E(h) of Y = [X, 1, cos ψ, sin ψ, …] over
  h = 2^k h_0, E(2h) = E(h)², and the form G(h) = ∫EᵀWE dt, D = YᵀWY, which doubles likewise:
  G(2h) = G(h) + E(h)ᵀ G(h) E(h). It needs no eigenvectors, and takes any phase in few products.

The integrals are independent of the march but for the instants and states at which phases begin
(:mod:`workflow.schemes._exact.phase_log`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import elementwise
from workflow.kernels.complex_numbers import magnitude, over, times
from workflow.kernels.sums import product, total
from workflow.models import Array
from workflow.schemes._exact.layout import Load

Complex = NDArray[np.complex128]

SLOW_EXPONENT = 1e-3
"""Below this |s_m + s_k| · duration the exponential is integrated by its series to the sixth power,
(1e-3)⁶/7! = 2e-22."""

_ORDER = 24
"""Order of the Taylor series over at most 1/fastest: 1/24! = 2e-24."""

_POINTS = np.array(
    [
        0.1252334085114689,
        0.3678314989981802,
        0.5873179542866175,
        0.7699026741943047,
        0.9041172563704749,
        0.9815606342467192,
    ]
)
_WEIGHTS = np.array(
    [
        0.24914704581340277,
        0.2334925365383548,
        0.20316742672306592,
        0.16007832854334622,
        0.10693932599531843,
        0.04717533638651183,
    ]
)
"""Positive half of the twelve Gauss-Legendre nodes on (-1, 1), exact to the power 23, and their weights."""
_NODES_01 = np.concatenate([1 - _POINTS[::-1], 1 + _POINTS]) / 2
_WEIGHTS_01 = np.concatenate([_WEIGHTS[::-1], _WEIGHTS]) / 2


class EigenForm(NamedTuple):
    """The power form in eigenvectors; pairs of poles s = σ ± iν count once."""

    pairs: Complex
    reals: Array
    """Poles, 1/s, ``(pair,)`` and ``(real,)``."""
    inward: Array
    """[Re Z, Im Z] of pairs and Z of real poles per X less its response to the loads, ``(n, 2 pair + real)``."""
    response: Array
    """Response to the loads: coefficients of 1, and of cos ψ and sin ψ of each wave, ``(1 + 2 wave, n)``."""
    quadratic: Array
    """∫D dt is the form of this at the end less that at the beginning, of [Re Z, Im Z, Z, 1, cos ψ, sin ψ, …]."""
    slow: NDArray[np.int64]
    """Pairs of columns left out of it, ``(pair, 2)``, in the order pairs, conjugates, reals, 0, ±iΩ of each wave."""
    slow_weight: Complex
    slow_value: Complex
    """Q_mk + Q_km (half on the diagonal) and s_m + s_k of such pairs, ``(pair,)``."""
    loss_pairs: Complex
    loss_reals: Array
    """L per Z of pairs (twice, of which the real part counts) and of real poles."""
    loss_load: Array
    """L of the response to the loads, ``(1 + 2 wave,)``."""


class Form(NamedTuple):
    """A regime of one case with its power form."""

    waves: Array
    """Ω, φ, A and a of each wave, ``(wave, 4)``."""
    entry: Array
    """X from [y, y', τ] and, in the last rows, d and d', ``(modal + 2, n)``."""
    whole: Array
    """Y' = whole · Y, ``(Y, Y)`` with n + 1 + 2 waves entries of Y."""
    power: Array
    """W, symmetric, ``(Y, Y)``."""
    loss: Array
    """L per Y, ``(Y,)``."""
    fastest: float
    """Largest pole, 1/s."""
    eigen: EigenForm | None
    """``None`` where the propagator is used."""


def integrate(form: Form, load: Load, state: Array, begun: Array, span: Array) -> tuple[Array, Array]:
    """Return ∫D dt and ∫L dt over phases that begin in modal states ``(phase, modal)``, each ``(phase,)``."""
    omega, phase, _, amplitude = form.waves.T
    psi = omega * begun[:, None] + phase
    wave = _wave(psi)
    place, speed = load.gap + product(wave[:, 2::2], amplitude), product(wave[:, 1::2], omega * amplitude)
    x = product(state, form.entry[:-2]) + form.entry[-2] * place[:, None] + form.entry[-1] * speed[:, None]
    if form.eigen is None:
        return _by_doubling(form, np.concatenate([x, wave], axis=1), span)
    return _by_poles(form.eigen, omega, x, wave, _wave(psi + omega * span[:, None]), span)


def _wave(psi: Array) -> Array:
    """Return 1, and cos ψ and sin ψ of each wave, ``(phase, 1 + 2 wave)``, from ψ ``(phase, wave)``."""
    found = np.ones((psi.shape[0], 1 + 2 * psi.shape[1]))
    found[:, 2::2], found[:, 1::2] = elementwise.sine_cosine(psi)
    return found


def _by_poles(form: EigenForm, omega: Array, x: Array, wave: Array, final: Array, span: Array) -> tuple[Array, Array]:
    """Integrate in the eigenvectors."""
    pairs, time = form.pairs.size, span[:, None]
    z = product(x - product(wave, form.response), form.inward)
    a, b, real = z[:, :pairs], z[:, pairs : 2 * pairs], z[:, 2 * pairs :]
    turning = elementwise.complex_exp(form.pairs * time)
    cos, sin = turning.real, turning.imag
    end_a, end_b = a * cos - b * sin, a * sin + b * cos
    grown = elementwise.expm1(form.reals * time)
    begin = np.concatenate([z, wave], axis=1)
    end = np.concatenate([end_a, end_b, real * (1.0 + grown), final], axis=1)
    spent = total(product(end, form.quadratic) * end - product(begin, form.quadratic) * begin, 1)
    pair = a + 1j * b
    if form.slow_weight.size:
        turn = np.repeat(wave[:, 1::2] + 1j * wave[:, 2::2], 2, axis=1)
        turn[:, 1::2] = turn[:, 1::2].conj()
        every = np.concatenate([pair, pair.conj(), real, np.ones_like(time), turn], axis=1)
        products = times(every[:, form.slow[:, 0]], every[:, form.slow[:, 1]])
        spent += total(times(times(form.slow_weight, products), _mean(form.slow_value * time)).real, 1) * span
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.where(form.reals == 0, 1.0, grown / np.where(form.reals == 0, 1.0, form.reals * time))
        turned = form.pairs * time
        mean = np.where(magnitude(turned) < SLOW_EXPONENT, _mean(turned), over(turning - 1, turned))
    waves = time * wave
    moving = np.flatnonzero(omega > 0)
    cosine, sine = 1 + 2 * moving, 2 + 2 * moving
    waves[:, cosine] = (final[:, sine] - wave[:, sine]) / omega[moving]
    waves[:, sine] = (wave[:, cosine] - final[:, cosine]) / omega[moving]
    lost = total(times(times(form.loss_pairs, pair), mean).real, 1) + total(form.loss_reals * real * exact, 1)
    return spent, lost * span + product(waves, form.loss_load)


def _mean(a: Any) -> Any:
    """Return (e^a - 1)/a of small complex a, by its series to the sixth power."""
    mean = 1.0 + a * (1 / 6)
    for n in (5, 4, 3, 2):
        mean = 1.0 + times(a * (1 / n), mean)
    return mean


def _by_doubling(form: Form, y: Array, span: Array) -> tuple[Array, Array]:
    """Integrate with propagators over doubled times: a phase is a short piece and a sum of them."""
    short = 1.0 / form.fastest if form.fastest > 0 else max(float(span.max(initial=0.0)), 1.0)
    count = np.floor(span / short).astype(np.int64)
    remainder = span - count * short
    terms = _series(form.whole, y, remainder)
    spent, lost = np.zeros(span.size), np.zeros(span.size)
    for point, weight in zip(_NODES_01, _WEIGHTS_01, strict=True):
        at = _total(terms, point)
        spent += weight * remainder * total(product(at, form.power) * at, 1)
        lost += weight * remainder * product(at, form.loss)
    y = _total(terms, 1.0)
    size = form.loss.size
    terms = _series(form.whole, np.eye(size), np.full(size, short))
    step = _total(terms[1:], 1.0).T  # E - 1: slow states keep their digits
    power, loss = np.zeros((size, size)), np.zeros(size)
    for point, weight in zip(_NODES_01, _WEIGHTS_01, strict=True):
        at = _total(terms, point)
        power += short * weight * product(product(at, form.power), at.T)
        loss += short * weight * product(at, form.loss)
    while count.any():
        odd = count % 2 == 1
        spent[odd] += total(product(y[odd], power) * y[odd], 1)
        lost[odd] += product(y[odd], loss)
        y[odd] += product(y[odd], step.T)
        moved = product(power, step)
        power = 2 * power + moved + moved.T + product(step.T, moved)
        loss = 2 * loss + product(loss, step)
        step = 2 * step + product(step, step)
        count //= 2
    return spent, lost


def _series(whole: Array, y: Array, span: Array) -> list[Array]:
    """Return the terms of the Taylor series over short times, row by row."""
    terms = [y]
    for k in range(_ORDER):
        terms.append(product(terms[-1], whole.T) * (span[:, None] / (k + 1)))
    return terms


def _total(terms: list[Array], share: float) -> Array:
    """Return Σ terms[k] shareᵏ."""
    total = terms[-1]
    for term in reversed(terms[:-1]):
        total = total * share + term
    return total
