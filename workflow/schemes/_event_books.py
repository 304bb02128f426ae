"""What the balances of the event-driven scheme need of a regime: its poles, and its power form per case.

The integrals themselves are in :mod:`workflow.schemes._event_balance`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workflow.models import Array, Structure
from workflow.schemes._event_balance import COUNT, LARGEST, SLOW, SPENT, Complex, Form, Log, integrate
from workflow.schemes._event_regimes import Basis, Held, held_system
from workflow.schemes._event_response import Load
from workflow.schemes._event_secular import secular_spectrum
from workflow.schemes._event_spectrum import linked

POOR = 1e3
"""Condition of the eigenvectors above which they are not used: the integrals lose its square."""

NEAR = 1e-4
"""An answer to the loads is split off where its pole is this far from theirs, times the duration."""


@dataclass(frozen=True, eq=False)
class _Poles:
    """Eigenvectors of a regime, shared by cases; of no size where they are poor.

    Pairs σ ± iν come first and once, with ν > 0, then real poles.
    """

    values: Complex
    right: Complex
    left: Complex
    pairs: int
    fastest: float


def _poles(A: Array, held: Held, alpha: float) -> _Poles:
    """Diagonalise A: each pole to its own accuracy where it can be, else by the general solver."""
    frequency, modes, size = held.frequency, held.frequency.size, A.shape[0]
    scale = np.ones(size)  # to coordinates of one size, [ω z, z', σ τ]
    scale[:modes] = np.where(frequency > 0, frequency, 1.0)
    largest = float((np.abs(held.coupling) / scale[:modes, None]).max(initial=0.0))
    scale[2 * modes :] = largest if largest > 0 else 1.0
    left: Any
    found = secular_spectrum(held, alpha, A)
    if found is not None:
        values, right, left = found.values, found.right * scale[:, None], found.left / scale
    else:
        values, right = np.linalg.eig(scale[:, None] * A / scale)
        try:
            left = np.linalg.inv(right)
        except np.linalg.LinAlgError:
            left = np.full((size, size), np.inf + 0j)
    fastest = float(np.abs(values).max(initial=0.0))
    lengths = np.sqrt(np.sum(right.real**2 + right.imag**2, axis=0))
    pair, real = np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag == 0)
    order = np.concatenate([pair, real])
    if 2 * pair.size + real.size != size or not float((np.abs(left) * lengths[:, None]).max(initial=0.0)) < POOR:
        order, pair = order[:0], pair[:0]
    into, out = right / scale[:, None], left * scale
    return _Poles(
        np.asarray(values[order], dtype=np.complex128),
        np.asarray(into[:, order], dtype=np.complex128),
        np.asarray(out[order], dtype=np.complex128),
        pair.size,
        fastest,
    )


@dataclass(frozen=True, eq=False)
class _Regime:
    """What a form needs of a regime before it knows a case."""

    A: Array
    frequency: Array
    damping: Array
    coupling: Array
    modes_load: Array
    """Force on the modes per constant load, ``(mode, mechanical)``."""
    modes_tip: Array
    """… and per tip load: what works."""
    steady: Array
    heating: Array
    tip: Array
    gap: Array
    entry: Array
    entry_gap: Array
    loss: Array
    poles: _Poles


class Books:
    """The balances of a batch: what its cases share."""

    def __init__(self, structure: Structure, basis: Basis):
        self._basis = basis
        shapes = basis.held.heat_shapes
        self._content, self._loss = structure.content @ shapes, structure.loss_row @ shapes
        self._heat_shapes = shapes
        self._known: dict[tuple[Any, ...], _Regime] = {}

    def log(self, alpha: float, raw: int, phases: int) -> Log:
        """Return an empty log of a case with so many raw states, for so many phases."""
        return Log(
            stiffness=self._basis.free.stiffness,
            begun=np.zeros(phases),
            held=np.zeros(phases, dtype=np.bool_),
            state=np.zeros((phases, raw)),
            final=np.zeros(raw),
            totals=np.zeros(SPENT + 1),
            hidden=alpha != 0 and linked(self._basis.held).frequency.size < self._basis.held.frequency.size,
        )

    def residuals(self, log: Log, raw: Array, load: Load, alpha: float, impulse: float) -> tuple[float, float]:
        """Return the energy and the heat residual of a case that came to its end."""
        count, modes = int(log.totals[COUNT]), self._basis.tip.size
        heats = raw.size - 2 * modes
        begun, held = log.begun[:count], log.held[:count]
        span = np.diff(begun, append=load.duration)
        spent = lost = turned = 0.0
        for which, key in ((~held, None), (held, alpha)):
            which = which & (span > 0)
            if raw.size and which.any():
                form = _form(self._regime(key, heats), load)
                power, loss = integrate(form, load, log.state[:count][which], begun[which], span[which])
                spent, lost = spent + float(power.sum()), lost + float(loss.sum())
                turned += float(np.abs(loss).sum())
        squares = np.concatenate([log.stiffness, np.ones(modes)])
        change = 0.5 * float(squares @ (log.final[: 2 * modes] ** 2 - raw[: 2 * modes] ** 2))
        largest = float(log.totals[LARGEST])
        energy = (change + spent + float(log.totals[SPENT])) / largest if largest != 0 else 0.0
        if heats == 0:
            return energy, 0.0
        before, after = raw[-heats:], log.final[-heats:]
        heating = load.duration * float(self._content @ (self._heat_shapes.T @ load.heating))
        change = float(self._content @ after - self._content @ before) - alpha * impulse - heating + lost
        turned += alpha * impulse + abs(heating) + float(np.abs(self._content) @ np.abs(before))
        return energy, change / turned if turned != 0 else 0.0

    def _regime(self, alpha: float | None, heats: int) -> _Regime:
        """Return the free regime (``None``) or the held one for an α."""
        key = (alpha, heats)
        if key not in self._known:
            self._known[key] = self._free(heats) if alpha is None else self._held(alpha, heats)
        return self._known[key]

    def _free(self, heats: int) -> _Regime:
        free = self._basis.free
        modes, size = free.damping.size, 2 * free.damping.size + heats
        A = np.zeros((size, size))
        A[:modes, modes : 2 * modes] = np.eye(modes)
        A[modes : 2 * modes, :modes] = -np.diag(free.stiffness)
        A[modes : 2 * modes, modes : 2 * modes] = -np.diag(free.damping)
        coupling = -free.coupling[0][:, :heats]
        A[modes : 2 * modes, 2 * modes :] = -coupling
        A[2 * modes :, 2 * modes :] = -np.diag(free.rate[:heats])
        frequency = np.sqrt(free.stiffness)
        modal: dict[str, Any] = {
            "frequency": frequency,
            "damping": free.damping,
            "coupling": coupling,
            "rate": free.rate[:heats],
            "heat_tip": self._basis.heat_tip[:heats],
            "reaction": np.zeros(modes),
            "thermal_reaction": np.zeros(heats),
        }
        return _Regime(
            A=A,
            frequency=frequency,
            damping=free.damping,
            coupling=coupling,
            modes_load=free.source_steady[modes : 2 * modes],
            modes_tip=free.source_tip[modes : 2 * modes],
            steady=free.source_steady[:size],
            heating=free.source_heating[:size],
            tip=free.source_tip[:size],
            gap=np.zeros(size),
            entry=np.eye(size),
            entry_gap=np.zeros(size),
            loss=np.concatenate([np.zeros(2 * modes), self._loss[:heats]]),
            poles=_poles(A, replace(self._basis.held, **modal), 0.0),
        )

    def _held(self, alpha: float, heats: int) -> _Regime:
        held: Held = self._basis.held if alpha == 0 else linked(self._basis.held)
        modes, free = held.to_held.shape
        size = 2 * modes + heats
        A, _, steady, heating, tip, gap = held_system(held, alpha)
        entry = np.zeros((size, 2 * free + heats))
        entry[:modes, :free] = held.to_held
        entry[modes : 2 * modes, free : 2 * free] = held.to_held
        entry[2 * modes :, 2 * free :] = np.eye(heats)
        A = A[:size, :size].copy()
        thermal: dict[str, Any] = {
            "coupling": held.coupling[:, :heats],
            "rate": held.rate[:heats],
            "heat_tip": held.heat_tip[:heats],
            "thermal_reaction": held.thermal_reaction[:heats],
        }
        return _Regime(
            A=A,
            frequency=held.frequency,
            damping=held.damping,
            coupling=held.coupling[:, :heats],
            modes_load=np.pad(held.shapes.T, ((0, 0), (0, 1))),
            modes_tip=np.zeros(modes),
            steady=steady[:size],
            heating=heating[:size],
            tip=tip[:size],
            gap=gap[:size],
            entry=entry,
            entry_gap=np.concatenate([held.to_held_gap, np.zeros(modes + heats)]),
            loss=np.concatenate([np.zeros(2 * modes), self._loss[:heats]]),
            poles=_poles(A, replace(held, **thermal), alpha),
        )


def _form(regime: _Regime, load: Load) -> Form:
    """Return the form of a regime under the loads of a case."""
    modes, size, omega = regime.frequency.size, regime.A.shape[0], load.omega
    v, tau = slice(modes, 2 * modes), slice(2 * modes, size)
    whole, power = np.zeros((size + 3, size + 3)), np.zeros((size + 3, size + 3))
    whole[:size, :size] = regime.A
    whole[:size, size] = regime.steady @ load.steady + regime.heating @ load.heating + regime.tip * load.mean
    whole[:size, size] += regime.gap * load.gap
    whole[:size, size + 2] = regime.tip * load.amplitude
    whole[size + 1, size + 2], whole[size + 2, size + 1] = -omega, omega
    power[v, v] = np.diag(regime.damping)
    power[v, tau] = regime.coupling
    power[v, size] = -(regime.modes_load @ load.steady + regime.modes_tip * load.mean)
    power[v, size + 2] = -regime.modes_tip * load.amplitude
    power = (power + power.T) / 2
    loss = np.concatenate([regime.loss, np.zeros(3)])
    form = Form(
        entry=regime.entry,
        entry_gap=regime.entry_gap,
        whole=whole,
        power=power,
        loss=loss,
        fastest=max(regime.poles.fastest, omega),
        pairs=np.zeros(0, dtype=np.complex128),
        reals=np.zeros(0),
        inward=np.zeros((size, 0)),
        answer=np.zeros((3, size)),
        quadratic=np.zeros((0, 0)),
        slow=np.zeros((0, 2), dtype=np.int64),
        slow_weight=np.zeros(0, dtype=np.complex128),
        slow_value=np.zeros(0, dtype=np.complex128),
        loss_pairs=np.zeros(0, dtype=np.complex128),
        loss_reals=np.zeros(0),
        loss_load=np.zeros(3),
    )
    answers = _answers(regime.poles, whole, load)
    return form if answers is None else _diagonal(form, regime.poles, answers, load)


def _diagonal(form: Form, poles: _Poles, answers: Complex, load: Load) -> Form:
    """Write the form in the eigenvectors."""
    pairs, size = poles.pairs, poles.right.shape[0]
    pair, real = poles.right[:, :pairs], poles.right[:, pairs:]
    wave = answers[1] / 2j
    # columns of the motion: pairs, their conjugates, reals, and 1, exp iψ, exp -iψ
    columns = np.zeros((size + 3, size + 3), dtype=np.complex128)
    columns[:size] = np.concatenate(
        [pair, pair.conj(), real, np.stack([answers[0], wave, wave.conj()], axis=1)], axis=1
    )
    columns[size, -3] = 1.0
    columns[size + 1, -2:] = 0.5
    columns[size + 2, -2:] = -0.5j, 0.5j
    s, loaded = poles.values, 1j * load.omega
    values = np.concatenate([s[:pairs], s[:pairs].conj(), s[pairs:], [0.0, loaded, -loaded]])
    q = columns.T @ (form.power @ columns)
    sums = values[:, None] + values
    near = np.abs(sums) * load.duration < SLOW
    slow = np.argwhere(near & (np.triu(q) != 0))
    twice = np.where(slow[:, 0] == slow[:, 1], 1.0, 2.0)
    weight = np.asarray(twice * q[slow[:, 0], slow[:, 1]], dtype=np.complex128)
    quadratic = np.where(near, 0.0, q / np.where(near, 1.0, sums))
    for _ in range(2):  # from [Z, conj Z, …, exp iψ, exp -iψ] to [Re Z, Im Z, …, cos ψ, sin ψ]
        quadratic = quadratic.T.copy()
        for one, other in ((slice(0, pairs), slice(pairs, 2 * pairs)), (slice(-2, -1), slice(-1, None))):
            a, b = quadratic[one] + quadratic[other], 1j * (quadratic[one] - quadratic[other])
            quadratic[one], quadratic[other] = a, b
    left = poles.left
    weights = form.loss[:size] @ poles.right
    answer = np.stack([answers[0].real, answers[1].imag, answers[1].real])
    return form._replace(
        pairs=s[:pairs],
        reals=s[pairs:].real,
        inward=np.concatenate([left[:pairs].real, left[:pairs].imag, left[pairs:].real]).T,
        answer=answer,
        quadratic=quadratic.real,
        slow=slow,
        slow_weight=weight,
        slow_value=sums[slow[:, 0], slow[:, 1]],
        loss_pairs=2 * weights[:pairs],
        loss_reals=weights[pairs:].real,
        loss_load=answer @ form.loss[:size],
    )


def _answers(poles: _Poles, whole: Array, load: Load) -> Complex | None:
    """Return the answers to b and w exp iψ, ``(2, n)``; ``None`` where they resonate or poles are poor."""
    size = poles.right.shape[0]
    if poles.values.size == 0:
        return None
    found = np.zeros((2, size), dtype=np.complex128)
    conjugate, pairs = poles.values[: poles.pairs].conj(), poles.pairs
    for row, (column, pole) in enumerate(((size, 0.0), (size + 2, 1j * load.omega))):
        share, distance = poles.left @ whole[:size, column], pole - poles.values
        other = pole - conjugate
        driven = np.abs(share) > 1e-15 * np.abs(share).max(initial=0.0)
        close = np.abs(distance) * load.duration < NEAR
        close[:pairs] |= np.abs(other) * load.duration < NEAR
        if np.any(driven & close):
            return None
        found[row] = poles.right @ np.where(driven, share / np.where(driven, distance, 1), 0)
        share = np.where(driven, share, 0)[:pairs].conj()
        found[row] += poles.right[:, :pairs].conj() @ (share / np.where(share != 0, other, 1))
    return found
