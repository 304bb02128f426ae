"""Balances of energy and heat of the event-driven scheme, integrated after its march.

    energy_residual = (ΔE + ∫D dt + E_lost)/max E,   E = Σ (y'² + ω² y²)/2,
    heat_residual   = (ΔQ + ∫L dt - α J - ∫q dt)/(∫|L| dt + α J + |∫q dt| + Σ|Q(0)|),   Q = cᵀ θ,

with D the power that leaves the energy and L the heat loss (:mod:`workflow.schemes._exact.phase_integrals`), J the
impulse and E_lost what impacts take, p (v⁻ + v⁺)/2. A tip that is held on a casing in motion does the work λ d', which
is part of D. The largest E is taken over the ends of all steps. Modes that the held tip does not feel are left out
where a contact with friction heat begins (see :func:`~workflow.schemes._exact.regimes.linked`): their energy is part
of E_lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import kernel
from workflow.kernels.complex_numbers import complex_product, magnitude, over, times
from workflow.kernels.eigen import eigenvalues, eigenvectors
from workflow.kernels.elementary import hypot, quotient
from workflow.kernels.sums import dot, norm, product, total
from workflow.models import Array, Structure
from workflow.schemes._exact import wave_table as wave
from workflow.schemes._exact.layout import Load
from workflow.schemes._exact.modal_system import Basis, ModalSystem, passages, signal_inputs, state_space
from workflow.schemes._exact.phase_integrals import SLOW_EXPONENT, Complex, EigenForm, Form, integrate
from workflow.schemes._exact.phase_log import Log
from workflow.schemes._exact.regimes import linked
from workflow.schemes._exact.spectrum import secular_spectrum

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
    """X from [y, y', τ] and, in the last rows, d and d', ``(modal + 2, N)``."""
    row: Array
    """Signal per X, ``(N,)``."""
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

    def log(self, law: tuple[float, float], states: int, phases: int) -> Log:
        """Return an empty log of a case with α and µ and so many modal states, for so many phases."""
        return Log(
            stiffness=self._basis.free.frequency**2,
            begun=np.zeros(phases),
            held=np.zeros(phases, dtype=np.bool_),
            state=np.zeros((phases, states)),
            final=np.zeros(states),
            reduced=any(law) and linked(self._basis.held).frequency.size < self._basis.held.frequency.size,
        )

    def residuals(
        self, log: Log, tally: Any, modal: Array, load: Load, law: tuple[float, float], impulse: float
    ) -> tuple[float, float]:
        """Return the energy and the heat residual of a case that completed; ``modal`` is its initial [y, y', τ].

        ``law`` is α and µ.
        """
        alpha, count, modes = law[0], int(tally["phases"]), self._basis.tip.size
        heats = modal.size - 2 * modes
        begun, held = log.begun[:count], log.held[:count]
        span = np.diff(begun, append=load.duration)
        spent = lost = turnover = 0.0
        for which, key in ((~held, None), (held, law)):
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

    def _regime(self, law: tuple[float, float] | None, heated: bool) -> _Regime:
        """Return the free regime (``None``) or the held one for α and µ."""
        key, (alpha, friction) = (law, heated), law or (0.0, 0.0)
        if key not in self._known:
            system = self._basis.free if law is None else self._basis.held.sliding(friction)
            system = linked(system) if any(law or ()) else system
            system = system if heated else system.without_heat()
            A, row, source = state_space(system, alpha)
            entry = _from_modal(system)
            loss = np.concatenate([np.zeros(2 * system.frequency.size), self._loss[: system.rate.size]])
            self._known[key] = _Regime(system, A, source, entry, row, loss, _poles(A, system, alpha))
        return self._known[key]


def _from_modal(system: ModalSystem) -> Array:
    """Return X from [y, y', τ] and, in the last rows, d and d', ``(modal + 2, N)``."""
    entry, heats = passages(system)[0], system.rate.size
    free, modes = entry.shape[0] - 1, entry.shape[1]
    whole = np.zeros((2 * free + heats + 2, 2 * modes + heats))
    whole[:free, :modes] = whole[free : 2 * free, modes : 2 * modes] = entry[:-1]
    whole[2 * free : -2, 2 * modes :] = np.eye(heats)
    whole[-2, :modes] = whole[-1, modes : 2 * modes] = entry[-1]
    return whole


def _form(regime: _Regime, load: Load) -> Form:
    """Return the power form of a regime under the loads of a case."""
    waves = load.waves if load.waves.size else np.zeros((1, wave.GIVEN))
    modes, size = regime.system.frequency.size, regime.A.shape[0]
    v, B, width = slice(modes, 2 * modes), regime.source, size + 1 + 2 * waves.shape[0]
    whole, power = np.zeros((width, width)), np.zeros((width, width))
    whole[:size, :size], whole[:size, size:] = regime.A, _driven(B, load, waves)
    cosine, sine = np.arange(size + 1, width, 2), np.arange(size + 2, width, 2)
    whole[cosine, sine], whole[sine, cosine] = -waves[:, wave.OMEGA], waves[:, wave.OMEGA]
    damping = regime.system.damping
    power[v, v] = damping if regime.system.is_coupled else np.diag(damping)
    power[v, 2 * modes : size] = regime.system.coupling
    pushes, pushed = B[v], regime.system.pushed
    if pushed is not None:
        pushes = pushes - np.outer(pushed, signal_inputs(regime.system))
        power[v] -= np.outer(pushed, _force(regime, load, waves))
    power[v, size] -= product(pushes[:, : load.steady.size], load.steady) + pushes[:, -4] * load.mean
    power[v, size + 2 :: 2] -= np.outer(pushes[:, -4], waves[:, wave.LOAD])
    moved = _casing_power(regime, load, waves)
    responses = _responses(regime.poles, whole[:size], load, waves)
    eigen = None if responses is None else _eigen_form((power[v] / 2, moved), regime, responses, load, waves)
    power += np.outer(*moved)
    return Form(
        waves=waves,
        entry=regime.entry,
        whole=whole,
        power=(power + power.T) / 2,
        loss=np.concatenate([regime.loss, np.zeros(width - size)]),
        fastest=max(regime.poles.fastest, float(waves[:, wave.OMEGA].max())),
        eigen=eigen,
    )


def _driven(B: Array, load: Load, waves: Array) -> Array:
    """Return B w per 1, and cos ψ and sin ψ of each wave, ``(row, 1 + 2 wave)``; w as in :func:`state_space`."""
    mechanical, (omega, _, push, amplitude) = load.steady.size, waves.T
    driven = np.zeros((B.shape[0], 1 + 2 * waves.shape[0]))
    driven[:, 0] = product(B[:, :mechanical], load.steady) + product(B[:, mechanical:-4], load.heating)
    driven[:, 0] += B[:, -4] * load.mean + B[:, -3] * load.gap
    driven[:, 1::2] = np.outer(B[:, -2], omega * amplitude)
    driven[:, 2::2] = np.outer(B[:, -4], push) + np.outer(B[:, -3], amplitude)
    driven[:, 2::2] -= np.outer(B[:, -1], omega * omega * amplitude)
    return driven


def _casing_power(regime: _Regime, load: Load, waves: Array) -> tuple[Array, Array]:
    """Return d' of a held tip and what it is multiplied by in the power, each per Y, ``(Y,)``."""
    system, size, modes = regime.system, regime.A.shape[0], regime.system.frequency.size
    speed, force = np.zeros(size + 1 + 2 * waves.shape[0]), np.zeros(size + 1 + 2 * waves.shape[0])
    if not system.dragged.any():
        return speed, force
    speed[size + 1 :: 2] = waves[:, wave.OMEGA] * waves[:, wave.CASING]
    force[:] = (1.0 - system.leaning) * _force(regime, load, waves)
    force[modes : 2 * modes] -= 2 * system.gap_source[:, 1]
    force[2 * modes : size] += system.dragged_coupling
    pushed = dot(system.dragged, system.load)
    force[size] -= dot(system.dragged, load.steady) + pushed * load.mean
    force[size + 2 :: 2] -= pushed * waves[:, wave.LOAD]
    return speed, force + system.dragged_damping * speed


def _force(regime: _Regime, load: Load, waves: Array) -> Array:
    """Return the contact force of a held tip per Y, ``(Y,)``."""
    return np.concatenate([regime.row, _driven(signal_inputs(regime.system)[None], load, waves)[0]])


def _columns(poles: _Poles, responses: Complex) -> Complex:
    """Return Y per pole and wave, ``(Y, Y)``: pairs, their conjugates, reals, 1, exp iψ and exp -iψ of each wave."""
    pairs, size = poles.pairs, poles.right.shape[0]
    pair, real = poles.right[:, :pairs], poles.right[:, pairs:]
    columns = np.zeros(2 * (size + 2 * responses.shape[0] - 1,), dtype=np.complex128)
    columns[:size, : size + 1] = np.concatenate([pair, pair.conj(), real, responses[0, :, None]], axis=1)
    columns[:size, size + 1 :: 2] = responses[1:].T * -0.5j
    columns[:size, size + 2 :: 2] = columns[:size, size + 1 :: 2].conj()
    columns[size, size] = 1.0
    for row in range(size + 1, columns.shape[0], 2):
        columns[row, row : row + 2] = 0.5
        columns[row + 1, row : row + 2] = -0.5j, 0.5j
    return columns


def _eigen_form(halves: Any, regime: _Regime, responses: Complex, load: Load, waves: Array) -> EigenForm:
    """Return the form in the eigenvectors.

    ``halves`` are half the power in the rows of velocities, whose transpose is the rest, and the two factors of the
    casing's.
    """
    (half, (speed, force)), poles, loss = halves, regime.poles, regime.loss
    s, pairs, size, modes = poles.values, poles.pairs, poles.right.shape[0], half.shape[0]
    columns, turning = _columns(poles, responses), 1j * waves[:, wave.OMEGA]
    values = np.concatenate([s[:pairs], s[:pairs].conj(), s[pairs:], [0.0], np.stack([turning, -turning], 1).ravel()])
    one_sided = complex_product(columns[modes : 2 * modes].T, complex_product(half, columns))
    if speed.any():
        one_sided += times(complex_product(speed, columns)[:, None], complex_product(force / 2, columns))
    q = one_sided + one_sided.T
    sums = values[:, None] + values
    quadratic, near = _integrated(q, values, SLOW_EXPONENT / load.duration)
    slow = np.argwhere(near & (np.triu(q) != 0))
    twice = np.where(slow[:, 0] == slow[:, 1], 1.0, 2.0)
    weight = np.asarray(twice * q[slow[:, 0], slow[:, 1]], dtype=np.complex128)
    turns = slice(size + 1, None, 2), slice(size + 2, None, 2)
    for _ in range(2):  # from [Z, conj Z, …, exp iψ, exp -iψ, …] to [Re Z, Im Z, …, cos ψ, sin ψ, …]
        quadratic = quadratic.T.copy()
        for one, other in ((slice(0, pairs), slice(pairs, 2 * pairs)), turns):
            a, b = quadratic[one] + quadratic[other], 1j * (quadratic[one] - quadratic[other])
            quadratic[one], quadratic[other] = a, b
    left, weights = poles.left, complex_product(loss, poles.right)
    response = np.zeros((1 + 2 * waves.shape[0], size))
    response[0], response[1::2], response[2::2] = responses[0].real, responses[1:].imag, responses[1:].real
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


def _responses(poles: _Poles, driven: Array, load: Load, waves: Array) -> Complex | None:
    """Return the responses to the constant load and to (w_s + i w_c) exp iψ of each wave, ``(1 + wave, n)``.

    ``driven`` are the rows of X in Y'. ``None`` where they resonate or there are no eigenvectors.
    """
    size, pairs = poles.right.shape[0], poles.pairs
    if poles.values.size == 0:
        return None
    responses = np.zeros((1 + waves.shape[0], size), dtype=np.complex128)
    sources = np.concatenate([driven[:, size, None], driven[:, size + 2 :: 2] + 1j * driven[:, size + 1 :: 2]], axis=1)
    for row, pole in enumerate(np.concatenate([[0.0], 1j * waves[:, wave.OMEGA]])):
        distance, other = pole - poles.values, pole - poles.values[:pairs].conj()
        share = complex_product(poles.left, sources[:, row])
        mirrored = complex_product(poles.left[:pairs], sources[:, row].conj()).conj()
        least = 1e-15 * max(magnitude(share).max(initial=0.0), magnitude(mirrored).max(initial=0.0))
        moves, sways = magnitude(share) > least, magnitude(mirrored) > least
        near, far = (magnitude(gap) * load.duration < _RESONANCE for gap in (distance, other))
        if np.any(moves & near) or np.any(sways & far):
            return None
        responses[row] = complex_product(poles.right, over(np.where(moves, share, 0), np.where(moves, distance, 1)))
        terms = over(np.where(sways, mirrored, 0), np.where(sways, other, 1))
        responses[row] += complex_product(poles.right[:, :pairs].conj(), terms)
    return responses
