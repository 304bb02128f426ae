"""Balances of energy and heat of the event-driven scheme, integrated after its march.

    energy_residual = (ΔE + ∫D dt + E_lost)/max E,   E = Σ (y'² + ω² y²)/2,
    heat_residual   = (ΔQ + ∫L dt - α J - ∫q dt)/(∫|L| dt + α J + |∫q dt| + Σ|Q(0)|),   Q = cᵀ θ,

with D the power that leaves the energy and L the heat loss (:mod:`workflow.schemes._exact.phase_integrals`), J the
impulse and E_lost what impacts take, p (v⁻ + v⁺)/2; the held tip does no work. The largest E is taken over the ends
of all steps. Modes that the held tip does not feel are left out where a contact with friction heat begins (see
:func:`~workflow.schemes._exact.regimes.linked`): their energy is part of E_lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import kernel
from workflow.kernels.complex_numbers import complex_product, magnitude, over
from workflow.kernels.eigen import eigenvalues, eigenvectors
from workflow.kernels.elementary import hypot, quotient
from workflow.kernels.sums import dot, norm, product, total
from workflow.models import Array, Structure
from workflow.schemes._exact.layout import Load
from workflow.schemes._exact.modal_system import Basis, ModalSystem, state_space
from workflow.schemes._exact.phase_integrals import SLOW_EXPONENT, Complex, EigenForm, Form, integrate
from workflow.schemes._exact.phase_log import Log
from workflow.schemes._exact.regimes import linked, passages
from workflow.schemes._exact.secular import secular_spectrum

ILL_CONDITIONED = 1e3
"""Condition of the eigenvectors above which they are not used: the integrals lose its square."""

_RESONANCE = 1e-4
"""Eigenvectors are not used where a pole is nearer to that of a load than this, times the duration."""


@dataclass(frozen=True, eq=False)
class _Poles:
    """Eigenvectors of a regime, shared by cases; of no size where they are ill-conditioned.

    Pairs σ ± iν come first and once, with ν > 0, then real poles.
    """

    values: Complex
    right: Complex
    left: Complex
    pairs: int
    fastest: float


def _poles(A: Array, system: ModalSystem, alpha: float) -> _Poles:
    """Diagonalise A: each pole to its own accuracy where it can be, else by the general solver."""
    frequency, modes, size = system.frequency, system.frequency.size, A.shape[0]
    scale = np.ones(size)  # to coordinates of one size, [ω z, z', σ τ]
    scale[:modes] = np.where(frequency > 0, frequency, 1.0)
    largest = float((np.abs(system.coupling) / scale[:modes, None]).max(initial=0.0))
    scale[2 * modes :] = largest if largest > 0 else 1.0
    left: Any
    spectrum = secular_spectrum(system, alpha, A)
    if spectrum is not None:
        values, right, left = spectrum.values, spectrum.right * scale[:, None], spectrum.left * (1 / scale)
    else:
        even = scale[:, None] * A / scale
        try:
            values, right, left = eigenvectors(even)
        except np.linalg.LinAlgError:  # dependent eigenvectors
            values, right = eigenvalues(even), np.zeros((size, size), dtype=np.complex128)
            left = np.full_like(right, np.inf)
    fastest = float(magnitude(values).max(initial=0.0))
    pair, real = np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag == 0)
    order = np.concatenate([pair, real])
    if (
        2 * pair.size + real.size != size
        or not float((magnitude(left) * norm(right, 0)[:, None]).max(initial=0.0)) < ILL_CONDITIONED
    ):
        order, pair = order[:0], pair[:0]
    into, out = right * (1 / scale)[:, None], left * scale
    return _Poles(
        np.asarray(values[order], dtype=np.complex128),
        np.asarray(into[:, order], dtype=np.complex128),
        np.asarray(out[order], dtype=np.complex128),
        pair.size,
        fastest,
    )


@dataclass(frozen=True, eq=False)
class _Regime:
    """What the forms of all cases take from a regime, X' = A X + sources."""

    system: ModalSystem
    A: Array
    source: Array
    """See :func:`~workflow.schemes._exact.modal_system.state_space`."""
    entry: Array
    """X from [y, y', τ] and, in the last row, the gap, ``(modal + 1, N)``."""
    loss: Array
    """Heat loss per X, W, ``(N,)``."""
    poles: _Poles


class EnergyBalance:
    """The balances of a batch: what its cases share."""

    def __init__(self, structure: Structure, basis: Basis):
        self._basis = basis
        shapes = basis.held.heat_shapes
        self._content, self._loss = product(structure.content, shapes), product(structure.loss_row, shapes)
        self._heat_shapes = shapes
        self._known: dict[tuple[Any, ...], _Regime] = {}

    def log(self, alpha: float, states: int, phases: int) -> Log:
        """Return an empty log of a case with so many modal states, for so many phases."""
        return Log(
            stiffness=self._basis.free.frequency**2,
            begun=np.zeros(phases),
            held=np.zeros(phases, dtype=np.bool_),
            state=np.zeros((phases, states)),
            final=np.zeros(states),
            reduced=alpha != 0 and linked(self._basis.held).frequency.size < self._basis.held.frequency.size,
        )

    def residuals(
        self, log: Log, tally: Any, modal: Array, load: Load, alpha: float, impulse: float
    ) -> tuple[float, float]:
        """Return the energy and the heat residual of a case that completed; ``modal`` is its initial [y, y', τ]."""
        count, modes = int(tally["phases"]), self._basis.tip.size
        heats = modal.size - 2 * modes
        begun, held = log.begun[:count], log.held[:count]
        span = np.diff(begun, append=load.duration)
        spent = lost = turnover = 0.0
        for which, key in ((~held, None), (held, alpha)):
            which = which & (span > 0)
            if modal.size and which.any():
                form = _form(self._regime(key, heats > 0), load)
                power, loss = integrate(form, load, log.state[:count][which], begun[which], span[which])
                spent, lost = spent + total(power), lost + total(loss)
                turnover += total(np.abs(loss))
        squares = np.concatenate([log.stiffness, np.ones(modes)])
        change = 0.5 * dot(squares, log.final[: 2 * modes] ** 2 - modal[: 2 * modes] ** 2)
        largest = float(tally["max_energy"])
        energy = (change + spent + float(tally["spent"])) / largest if largest != 0 else 0.0
        if heats == 0:
            return energy, 0.0
        before, after = modal[-heats:], log.final[-heats:]
        heating = load.duration * dot(self._content, product(self._heat_shapes.T, load.heating))
        change = dot(self._content, after) - dot(self._content, before) - alpha * impulse - heating + lost
        turnover += alpha * impulse + abs(heating) + dot(np.abs(self._content), np.abs(before))
        return energy, change / turnover if turnover != 0 else 0.0

    def _regime(self, alpha: float | None, heated: bool) -> _Regime:
        """Return the free regime (``None``) or the held one for an α."""
        key = (alpha, heated)
        if key not in self._known:
            system = self._basis.free if alpha is None else self._basis.held
            system = linked(system) if alpha else system
            system = system if heated else system.without_heat()
            A, _, source = state_space(system, alpha or 0.0)
            entry, _ = passages(system, np.eye(len(A)), np.eye(len(A)))
            loss = np.concatenate([np.zeros(2 * system.frequency.size), self._loss[: system.rate.size]])
            self._known[key] = _Regime(system, A, source, entry, loss, _poles(A, system, alpha or 0.0))
        return self._known[key]


def _form(regime: _Regime, load: Load) -> Form:
    """Return the power form of a regime under the loads of a case."""
    modes, size, omega = regime.system.frequency.size, regime.A.shape[0], load.omega
    v, tau, B, mechanical = slice(modes, 2 * modes), slice(2 * modes, size), regime.source, load.steady.size
    whole, power = np.zeros((size + 3, size + 3)), np.zeros((size + 3, size + 3))
    whole[:size, :size] = regime.A
    whole[:size, size] = product(B[:, :mechanical], load.steady) + product(B[:, mechanical:-2], load.heating)
    whole[:size, size] += B[:, -2] * load.mean + B[:, -1] * load.gap
    whole[:size, size + 2] = B[:, -2] * load.amplitude
    whole[size + 1, size + 2], whole[size + 2, size + 1] = -omega, omega
    damping = regime.system.damping
    power[v, v] = damping if regime.system.is_coupled else np.diag(damping)
    power[v, tau] = regime.system.coupling
    power[v, size] = -(product(B[v, :mechanical], load.steady) + B[v, -2] * load.mean)
    power[v, size + 2] = -B[v, -2] * load.amplitude
    responses = _responses(regime.poles, whole, load)
    return Form(
        entry=regime.entry,
        whole=whole,
        power=(power + power.T) / 2,
        loss=np.concatenate([regime.loss, np.zeros(3)]),
        fastest=max(regime.poles.fastest, omega),
        eigen=None if responses is None else _eigen_form(power[v] / 2, regime, responses, load),
    )


def _eigen_form(half: Array, regime: _Regime, responses: Complex, load: Load) -> EigenForm:
    """Return the form in the eigenvectors; the power is ``half`` in the rows of velocities plus its transpose."""
    poles, loss = regime.poles, regime.loss
    pairs, size = poles.pairs, poles.right.shape[0]
    pair, real = poles.right[:, :pairs], poles.right[:, pairs:]
    wave = responses[1] * -0.5j
    # columns of the motion: pairs, their conjugates, reals, and 1, exp iψ, exp -iψ
    columns = np.zeros((size + 3, size + 3), dtype=np.complex128)
    columns[:size] = np.concatenate(
        [pair, pair.conj(), real, np.stack([responses[0], wave, wave.conj()], axis=1)], axis=1
    )
    columns[size, -3] = 1.0
    columns[size + 1, -2:] = 0.5
    columns[size + 2, -2:] = -0.5j, 0.5j
    s, loaded = poles.values, 1j * load.omega
    values = np.concatenate([s[:pairs], s[:pairs].conj(), s[pairs:], [0.0, loaded, -loaded]])
    modes = half.shape[0]
    one_sided = complex_product(columns[modes : 2 * modes].T, complex_product(half, columns))
    q = one_sided + one_sided.T
    sums = values[:, None] + values
    quadratic, near = _integrated(q, values, SLOW_EXPONENT / load.duration)
    slow = np.argwhere(near & (np.triu(q) != 0))
    twice = np.where(slow[:, 0] == slow[:, 1], 1.0, 2.0)
    weight = np.asarray(twice * q[slow[:, 0], slow[:, 1]], dtype=np.complex128)
    for _ in range(2):  # from [Z, conj Z, …, exp iψ, exp -iψ] to [Re Z, Im Z, …, cos ψ, sin ψ]
        quadratic = quadratic.T.copy()
        for one, other in ((slice(0, pairs), slice(pairs, 2 * pairs)), (slice(-2, -1), slice(-1, None))):
            a, b = quadratic[one] + quadratic[other], 1j * (quadratic[one] - quadratic[other])
            quadratic[one], quadratic[other] = a, b
    left = poles.left
    weights = complex_product(loss, poles.right)
    response = np.stack([responses[0].real, responses[1].imag, responses[1].real])
    return EigenForm(
        pairs=s[:pairs],
        reals=s[pairs:].real,
        inward=np.concatenate([left[:pairs].real, left[:pairs].imag, left[pairs:].real]).T,
        response=response,
        quadratic=quadratic.real,
        slow=slow,
        slow_weight=weight,
        slow_value=sums[slow[:, 0], slow[:, 1]],
        loss_pairs=2 * weights[:pairs],
        loss_reals=weights[pairs:].real,
        loss_load=product(response, loss),
    )


@kernel
def _integrated(q: Complex, values: Complex, slowest: float) -> tuple[Complex, NDArray[np.bool_]]:
    """Return q_mk/(s_m + s_k), and where it is left out because s_m + s_k is below ``slowest``."""
    integrated, near = np.zeros_like(q), np.zeros(q.shape, dtype=np.bool_)
    for m in range(values.size):
        for k in range(values.size):
            s = values[m] + values[k]
            if hypot(s.real, s.imag) < slowest:
                near[m, k] = True
            else:
                integrated[m, k] = quotient(q[m, k], s)
    return integrated, near


def _responses(poles: _Poles, whole: Array, load: Load) -> Complex | None:
    """Return the responses to b and w exp iψ, ``(2, n)``; ``None`` where they resonate or there are no eigenvectors."""
    size = poles.right.shape[0]
    if poles.values.size == 0:
        return None
    responses = np.zeros((2, size), dtype=np.complex128)
    conjugate, pairs = poles.values[: poles.pairs].conj(), poles.pairs
    for row, (column, pole) in enumerate(((size, 0.0), (size + 2, 1j * load.omega))):
        share, distance = complex_product(poles.left, whole[:size, column]), pole - poles.values
        other = pole - conjugate
        driven = magnitude(share) > 1e-15 * magnitude(share).max(initial=0.0)
        close = magnitude(distance) * load.duration < _RESONANCE
        close[:pairs] |= magnitude(other) * load.duration < _RESONANCE
        if np.any(driven & close):
            return None
        responses[row] = complex_product(poles.right, over(np.where(driven, share, 0), np.where(driven, distance, 1)))
        share = np.where(driven, share, 0)[:pairs].conj()
        responses[row] += complex_product(poles.right[:, :pairs].conj(), over(share, np.where(share != 0, other, 1)))
    return responses
