"""Energy and heat balances of the event-driven scheme, integrated beside its march.

In a phase between two events the state X = [y, y', τ] (tip free, free modes) or [z, z', τ] (tip
held, held modes) obeys X' = A X + b + w sin ψ, ψ = Ω t + φ. The power that leaves the energy,

    D = Σ c_j v_j² + vᵀ G τ - fᵀv,   v = y' or z',

and the heat loss L(τ) are integrated over the phase from the state in which it began:

- in the eigenvectors of A, X = Σ U_m Z_m exp(s_m t), constant and harmonic answers among the
  columns of U, so that ∫D dt = Σ Q_mk Z_m Z_k ∫exp((s_m + s_k) t) dt and ∫L dt likewise;
- where eigenvectors are poor or an answer to the loads resonates (rigid and critical modes,
  resonance, heat without outlet), by Gauss-Legendre panels on the Taylor series of X, which needs
  neither, but takes longer; NaN where it would take more than :data:`MOST_PANELS`.

The integrals know the march only by the instants and states at which phases begin; energies at the
ends of phases are the march's own. Impulses lose p (v⁻ + v⁺)/2; the held tip does no work. The
largest E is taken over the ends of all certified steps.

Modes that the held tip does not feel are let go where a contact with friction heat begins (see
:func:`~workflow.schemes._event_spectrum.linked`): their energy leaves the balance there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.schemes._event_response import Load
from workflow.schemes._kernel import kernel

Complex = NDArray[np.complex128]

SLOW = 1e-3
"""Below this |s_m + s_k| · duration the exponential is integrated by its series."""

ORDER, NODES = 24, 12
"""Of the Taylor series, on panels of 1/fastest (1/24! = 2e-24), and of Gauss-Legendre on them."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(NODES)
POINTS, WEIGHTS = (_POINTS + 1) / 2, _WEIGHTS / 2


class Form(NamedTuple):
    """A regime of one case with its power form."""

    entry: Array
    """X per raw state, ``(n, raw)``."""
    entry_gap: Array
    """X for the gap, ``(n,)``."""
    state: Array
    """A, ``(n, n)``."""
    source: Array
    """b and w, ``(2, n)``."""
    power: Array
    """XᵀPX is D without loads, ``(n, n)``."""
    power_load: Array
    """X times these is -fᵀv: its constant part and that of sin ψ, ``(2, n)``."""
    loss: Array
    """L per X, ``(n,)``."""
    fastest: float
    """Largest pole, 1/s."""
    inward: Complex
    """Z per X - answers, ``(pole, n)``; no rows where panels are used."""
    answer: Complex
    """Answers to 1 and exp iψ (of which the imaginary part counts), ``(2, n)``."""
    values: Complex
    """s_m, then 0, iΩ and -iΩ, ``(column,)``."""
    quadratic: Complex
    """(Q_mk + Q_km)/(s_m + s_k), upper triangle with half its diagonal, ``(column, column)``."""
    slow: NDArray[np.int64]
    """Pairs of columns left out of it, ``(pair, 2)``."""
    slow_weight: Complex
    slow_value: Complex
    """Q_mk + Q_km (half on the diagonal) and s_m + s_k of such pairs, ``(pair,)``."""
    loss_weight: Complex
    """L of each column, ``(column,)``."""


BEGUN, FIRST, LARGEST, FINAL, SPENT, LOST, TURNED = range(7)
"""Totals: where the present phase began; energy at t = 0, the largest, at the end; energy spent;
heat lost, and turned over by losses."""


class Ledger(NamedTuple):
    """What the march writes its balances in; of no size where none are asked for."""

    free: Form
    held: Form
    stiffness: Array
    """ω² of the free modes."""
    start: Array
    """Raw state at the beginning of the present phase."""
    final: Array
    """Raw state at the end."""
    totals: Array
    hidden: bool
    """Whether modes are let go at entry, see above."""


@kernel
def energy_of(ledger: Ledger, raw: Array) -> float:
    """Return E of a raw state, and remember the largest."""
    energy, modes = 0.0, ledger.stiffness.size
    for j in range(modes):
        energy += 0.5 * (raw[modes + j] ** 2 + ledger.stiffness[j] * raw[j] ** 2)
    ledger.totals[LARGEST] = max(ledger.totals[LARGEST], energy)
    return energy


@kernel
def begin_phase(ledger: Ledger, raw: Array, t: float) -> None:
    """Note where and when a phase begins."""
    ledger.totals[BEGUN] = t
    for j in range(ledger.start.size):
        ledger.start[j] = raw[j]
    energy_of(ledger, raw)


@kernel
def let_go(ledger: Ledger, before: Array, after: Array) -> None:
    """Take the energy of modes that are let go out of the balance."""
    ledger.totals[SPENT] += energy_of(ledger, before) - energy_of(ledger, after)


@kernel
def settle(ledger: Ledger, holding: bool, load: Load, t: float) -> None:
    """Integrate over the phase that ends at t."""
    form = ledger.held if holding else ledger.free
    begun = ledger.totals[BEGUN]
    n = form.state.shape[0]
    if t <= begun or n == 0:
        return
    x = np.zeros(n)
    for i in range(n):
        x[i] = form.entry_gap[i] * load.gap
        for j in range(ledger.start.size):
            x[i] += form.entry[i, j] * ledger.start[j]
    psi = load.omega * begun + load.phase
    if form.inward.shape[0] > 0:
        spent, lost = _by_poles(form, x, psi, t - begun)
    else:
        spent, lost = _by_panels(form, x, load.omega, psi, t - begun)
    ledger.totals[SPENT] += spent
    ledger.totals[LOST] += lost
    ledger.totals[TURNED] += abs(lost)


@kernel
def _by_poles(form: Form, x: Array, psi: float, span: float) -> tuple[float, float]:
    """Return ∫D dt and ∫L dt in the eigenvectors."""
    poles, n = form.inward.shape
    count = form.values.size
    turn = np.exp(1j * psi)
    z = np.zeros(count, dtype=np.complex128)
    for j in range(n):
        rest = x[j] - form.answer[0, j].real - (form.answer[1, j] * turn).imag
        for m in range(poles):
            z[m] += form.inward[m, j] * rest
    z[poles], z[poles + 1], z[poles + 2] = 1.0, turn, np.conj(turn)
    end = z * np.exp(form.values * span)
    spent = 0.0
    for m in range(count):
        begin_sum = end_sum = 0.0 + 0.0j
        for k in range(m, count):
            q = form.quadratic[m, k]
            begin_sum += q * z[k]
            end_sum += q * end[k]
        spent += (end_sum * end[m] - begin_sum * z[m]).real
    for pair in range(form.slow_weight.size):
        a = form.slow_value[pair] * span
        grown = 1.0 + a / 2.0 * (1.0 + a / 3.0 * (1.0 + a / 4.0 * (1.0 + a / 5.0 * (1.0 + a / 6.0))))
        spent += (form.slow_weight[pair] * z[form.slow[pair, 0]] * z[form.slow[pair, 1]] * grown).real * span
    lost = 0.0
    for m in range(count):
        a = form.values[m] * span
        if abs(a) < SLOW:
            grown = 1.0 + a / 2.0 * (1.0 + a / 3.0 * (1.0 + a / 4.0 * (1.0 + a / 5.0 * (1.0 + a / 6.0))))
            lost += (form.loss_weight[m] * z[m] * grown).real * span
        else:
            lost += (form.loss_weight[m] * (end[m] - z[m]) / form.values[m]).real
    return spent, lost


MOST_PANELS = 20_000
"""Of one phase, about a second; a phase that would take more leaves the residuals NaN."""


@kernel
def _by_panels(form: Form, x: Array, omega: float, psi: float, span: float) -> tuple[float, float]:
    """Return ∫D dt and ∫L dt by Gauss-Legendre panels on Taylor series; ``x`` is used up."""
    n = x.size
    panels = max(1, int(np.ceil(span * form.fastest)))
    if panels > MOST_PANELS:
        return np.nan, np.nan
    h = span / panels
    series = np.zeros((ORDER + 1, n))
    at = np.zeros(n)
    spent = lost = 0.0
    for panel in range(panels):
        angle = psi + omega * (panel * h)
        s, c = np.sin(angle), np.cos(angle)
        series[0] = x
        scale = 1.0  # (Ω h)^k / k!
        for k in range(ORDER):
            wave = scale * (s if k % 4 == 0 else c if k % 4 == 1 else -s if k % 4 == 2 else -c)
            for i in range(n):
                rate = form.source[1, i] * wave + (form.source[0, i] if k == 0 else 0.0)
                for j in range(n):
                    rate += form.state[i, j] * series[k, j]
                series[k + 1, i] = rate * h / (k + 1)
            scale *= omega * h / (k + 1)
        for node in range(NODES):
            share = POINTS[node]
            for i in range(n):
                value = series[ORDER, i]
                for k in range(ORDER - 1, -1, -1):
                    value = value * share + series[k, i]
                at[i] = value
            wave = np.sin(angle + omega * h * share)
            power = leak = 0.0
            for i in range(n):
                force = form.power_load[0, i] + form.power_load[1, i] * wave
                for j in range(n):
                    force += form.power[i, j] * at[j]
                power += at[i] * force
                leak += at[i] * form.loss[i]
            spent += h * WEIGHTS[node] * power
            lost += h * WEIGHTS[node] * leak
        for i in range(n):
            value = series[ORDER, i]
            for k in range(ORDER - 1, -1, -1):
                value += series[k, i]
            x[i] = value
    return spent, lost


def no_ledger() -> Ledger:
    """Return what the march takes where no balances are asked for."""
    row, none = np.zeros(0), np.zeros(0, dtype=np.complex128)
    table, square, pairs = np.zeros((0, 0)), np.zeros((0, 0), dtype=np.complex128), np.zeros((0, 2), dtype=np.int64)
    form = Form(table, row, table, table, table, table, row, 0.0, square, square, none, square, pairs, none, none, none)
    return Ledger(form, form, row, row, row, row, False)
