"""Energy and heat balances of the event-driven scheme, integrated after its march.

In a phase between two events the state X = [y, y', τ] (tip free, free modes) or [z, z', τ] (tip
held, held modes) obeys X' = A X + b + w sin ψ, ψ = Ω t + φ. The power that leaves the energy,

    D = Σ c_j v_j² + vᵀ G τ - fᵀv,   v = y' or z',

and the heat loss L(τ) are integrated over the phase from the state in which it began:

- in the eigenvectors of A, X = Σ U_m Z_m exp(s_m t), constant and harmonic answers among the
  columns of U, so that ∫D dt = Σ Q_mk Z_m Z_k ∫exp((s_m + s_k) t) dt and ∫L dt likewise;
- where eigenvectors are poor or an answer to the loads resonates (rigid and critical modes,
  resonance, heat without outlet), with the propagator E(h) of Y = [X, 1, cos ψ, sin ψ] over
  h = 2^k h_0, E(2h) = E(h)², and the form G(h) = ∫EᵀWE dt, D = YᵀWY, which doubles likewise:
  G(2h) = G(h) + E(h)ᵀ G(h) E(h). It needs no eigenvectors, and takes any phase in few products.

The integrals know the march only by the instants and states at which phases begin; energies at the
ends of phases are the march's own. Impulses lose p (v⁻ + v⁺)/2; the held tip does no work. The
largest E is taken over the ends of all certified steps.

Modes that the held tip does not feel are let go where a contact with friction heat begins (see
:func:`~workflow.schemes._event_spectrum.linked`): their energy leaves the balance there, their heat
does not, for every thermal state stays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.schemes._event_response import Load
from workflow.schemes._kernel import part, rare

Complex = NDArray[np.complex128]

SLOW = 1e-3
"""Below this |s_m + s_k| · duration the exponential is integrated by its series to the sixth power,
(1e-3)⁶/7! = 2e-22."""

ORDER, NODES = 24, 12
"""Of the Taylor series over at most 1/fastest (1/24! = 2e-24), and of Gauss-Legendre on it, exact to
the power 23."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(NODES)
POINTS, WEIGHTS = (_POINTS + 1) / 2, _WEIGHTS / 2


class Form(NamedTuple):
    """A regime of one case with its power form; pairs of poles s = σ ± iν count once."""

    entry: Array
    """X per raw state, ``(n, raw)``."""
    entry_gap: Array
    """X for the gap, ``(n,)``."""
    whole: Array
    """Y' = whole · Y, ``(n + 3, n + 3)``."""
    power: Array
    """W, symmetric, ``(n + 3, n + 3)``."""
    loss: Array
    """L per Y, ``(n + 3,)``."""
    fastest: float
    """Largest pole, 1/s."""
    pairs: Complex
    reals: Array
    """Poles, ``(pair,)`` and ``(real,)``; none of either where the propagator is used."""
    inward: Array
    """[Re Z, Im Z] of pairs and Z of real poles per X - answers, ``(n, 2 pair + real)``."""
    answer: Array
    """Answers to 1, cos ψ and sin ψ, ``(3, n)``."""
    quadratic: Array
    """∫D dt is the form of this at the end less that at the beginning, of [Re Z, Im Z, Z, 1, cos ψ, sin ψ]."""
    slow: NDArray[np.int64]
    """Pairs of columns left out of it, ``(pair, 2)``, in the order pairs, conjugates, reals, 0, ±iΩ."""
    slow_weight: Complex
    slow_value: Complex
    """Q_mk + Q_km (half on the diagonal) and s_m + s_k of such pairs, ``(pair,)``."""
    loss_pairs: Complex
    loss_reals: Array
    """L per Z of pairs (twice, of which the real part counts) and of real poles."""
    loss_load: Array
    """L of the answers, ``(3,)``."""


COUNT, LARGEST, SPENT = range(3)
"""Totals of a log: phases begun, largest energy, energy spent in impacts and let go."""


class Log(NamedTuple):
    """What the march notes for the balances; of no size where none are asked for."""

    stiffness: Array
    """ω² of the free modes."""
    begun: Array
    """When each phase begins, s, ``(phase,)``."""
    held: NDArray[np.bool_]
    """Whether the tip is held in it, ``(phase,)``."""
    state: Array
    """Raw state at its beginning, ``(phase, raw)``."""
    final: Array
    """Raw state at the end of the case, ``(raw,)``."""
    totals: Array
    hidden: bool
    """Whether modes are let go at entry, see above."""


@part
def energy_of(log: Log, raw: Array) -> float:
    """Return E of a raw state, and remember the largest."""
    energy, modes = 0.0, log.stiffness.size
    for j in range(modes):
        energy += 0.5 * (raw[modes + j] ** 2 + log.stiffness[j] * raw[j] ** 2)
    log.totals[LARGEST] = max(log.totals[LARGEST], energy)
    return energy


@rare
def begin_phase(log: Log, raw: Array, t: float, held: bool) -> None:
    """Note how and when a phase begins."""
    i = int(log.totals[COUNT])
    log.begun[i] = t
    log.held[i] = held
    for j in range(log.final.size):
        log.state[i, j] = raw[j]
    log.totals[COUNT] += 1.0
    energy_of(log, raw)


@rare
def let_go(log: Log, before: Array, after: Array) -> None:
    """Take the energy of modes that are let go out of the balance."""
    log.totals[SPENT] += energy_of(log, before) - energy_of(log, after)


def no_log() -> Log:
    """Return what the march takes where no balances are asked for."""
    row = np.zeros(0)
    return Log(row, row, np.zeros(0, dtype=np.bool_), np.zeros((0, 0)), row, row, False)


def integrate(form: Form, load: Load, state: Array, begun: Array, span: Array) -> tuple[Array, Array]:
    """Return ∫D dt and ∫L dt over phases that begin in raw states ``(phase, raw)``, each ``(phase,)``."""
    x = state @ form.entry.T + form.entry_gap * load.gap
    psi = load.omega * begun + load.phase
    wave = np.column_stack([np.ones(psi.size), np.cos(psi), np.sin(psi)])
    if form.pairs.size + form.reals.size == 0:
        return _by_doubling(form, np.concatenate([x, wave], axis=1), span)
    later = psi + load.omega * span
    final = np.column_stack([np.ones(psi.size), np.cos(later), np.sin(later)])
    return _by_poles(form, load.omega, x, wave, final, span)


def _by_poles(form: Form, omega: float, x: Array, wave: Array, final: Array, span: Array) -> tuple[Array, Array]:
    """Integrate in the eigenvectors."""
    pairs, time = form.pairs.size, span[:, None]
    z = (x - wave @ form.answer) @ form.inward
    a, b, real = z[:, :pairs], z[:, pairs : 2 * pairs], z[:, 2 * pairs :]
    shrink, angle = np.exp(form.pairs.real * time), form.pairs.imag * time
    cos, sin = shrink * np.cos(angle), shrink * np.sin(angle)
    end_a, end_b = a * cos - b * sin, a * sin + b * cos
    grown = np.expm1(form.reals * time)
    begin = np.concatenate([z, wave], axis=1)
    end = np.concatenate([end_a, end_b, real * (1.0 + grown), final], axis=1)
    spent = np.sum((end @ form.quadratic) * end - (begin @ form.quadratic) * begin, axis=1)
    pair = a + 1j * b
    if form.slow_weight.size:
        turn = (wave[:, 1] + 1j * wave[:, 2])[:, None]
        every = np.concatenate([pair, pair.conj(), real, np.ones_like(time), turn, turn.conj()], axis=1)
        products = every[:, form.slow[:, 0]] * every[:, form.slow[:, 1]]
        spent += np.sum((form.slow_weight * products * _mean(form.slow_value * time)).real, axis=1) * span
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.where(form.reals == 0, 1.0, grown / np.where(form.reals == 0, 1.0, form.reals * time))
        turned = form.pairs * time
        mean = np.where(np.abs(turned) < SLOW, _mean(turned), (cos + 1j * sin - 1) / turned)
    waves = np.column_stack([span, span * wave[:, 1], span * wave[:, 2]])
    if omega > 0:
        waves[:, 1:] = np.column_stack([final[:, 2] - wave[:, 2], wave[:, 1] - final[:, 1]]) / omega
    lost = np.sum(form.loss_pairs * pair * mean, axis=1).real + np.sum(form.loss_reals * real * exact, axis=1)
    return spent, lost * span + waves @ form.loss_load


def _mean(a: Any) -> Any:
    """Return (e^a - 1)/a of small a."""
    return 1.0 + a / 2.0 * (1.0 + a / 3.0 * (1.0 + a / 4.0 * (1.0 + a / 5.0 * (1.0 + a / 6.0))))


def _by_doubling(form: Form, y: Array, span: Array) -> tuple[Array, Array]:
    """Integrate with propagators over doubled times: a phase is a short piece and a sum of them."""
    short = 1.0 / form.fastest if form.fastest > 0 else max(float(span.max(initial=0.0)), 1.0)
    count = np.floor(span / short).astype(np.int64)
    rest = span - count * short
    terms = _series(form.whole, y, rest)
    spent, lost = np.zeros(span.size), np.zeros(span.size)
    for point, weight in zip(POINTS, WEIGHTS, strict=True):
        at = _total(terms, point)
        spent += weight * rest * np.sum((at @ form.power) * at, axis=1)
        lost += weight * rest * (at @ form.loss)
    y = _total(terms, 1.0)
    size = form.loss.size
    terms = _series(form.whole, np.eye(size), np.full(size, short))
    step = _total(terms[1:], 1.0).T  # E - 1: slow states keep their digits
    power, loss = np.zeros((size, size)), np.zeros(size)
    for point, weight in zip(POINTS, WEIGHTS, strict=True):
        at = _total(terms, point)
        power += short * weight * (at @ form.power @ at.T)
        loss += short * weight * (at @ form.loss)
    while count.any():
        odd = count % 2 == 1
        spent[odd] += np.sum((y[odd] @ power) * y[odd], axis=1)
        lost[odd] += y[odd] @ loss
        y[odd] += y[odd] @ step.T
        moved = power @ step
        power = 2 * power + moved + moved.T + step.T @ moved
        loss = 2 * loss + loss @ step
        step = 2 * step + step @ step
        count //= 2
    return spent, lost


def _series(whole: Array, y: Array, span: Array) -> list[Array]:
    """Return the terms of the Taylor series over short times, row by row."""
    terms = [y]
    for k in range(ORDER):
        terms.append((terms[-1] @ whole.T) * (span[:, None] / (k + 1)))
    return terms


def _total(terms: list[Array], share: float) -> Array:
    """Return Σ terms[k] shareᵏ."""
    total = terms[-1]
    for term in reversed(terms[:-1]):
        total = total * share + term
    return total
