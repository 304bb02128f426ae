"""What the balances of the event-driven scheme need of a regime: its poles, and its power form per case.

The integrals themselves are in :mod:`workflow.schemes._event_balance`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workflow.models import Array, Structure
from workflow.schemes._event_balance import FINAL, FIRST, LARGEST, LOST, SLOW, SPENT, TURNED, Complex, Form, Ledger
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
    """Eigenvectors of a regime, shared by cases; of no size where they are poor."""

    values: Complex
    right: Complex
    left: Complex
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
        pairs = found.values.imag > 0
        values = np.concatenate([found.values, found.values[pairs].conj()])
        right = np.asarray(np.concatenate([found.right, found.right[:, pairs].conj()], axis=1) * scale[:, None])
        left = np.asarray(np.concatenate([found.left, found.left[pairs].conj()]) / scale)
    else:
        values, right = np.linalg.eig(scale[:, None] * A / scale)
        try:
            left = np.linalg.inv(right)
        except np.linalg.LinAlgError:
            left = np.full((size, size), np.inf + 0j)
    fastest = float(np.abs(values).max(initial=0.0))
    lengths = np.sqrt(np.sum(right.real**2 + right.imag**2, axis=0))
    if values.size != size or not float((np.abs(left) * lengths[:, None]).max(initial=0.0)) < POOR:
        none = np.zeros(0, dtype=np.complex128)
        return _Poles(none, np.zeros((size, 0), dtype=np.complex128), np.zeros((0, size), dtype=np.complex128), fastest)
    into, out = (np.asarray(vectors, dtype=np.complex128) for vectors in (right / scale[:, None], left * scale))
    return _Poles(np.asarray(values, dtype=np.complex128), into, out, fastest)


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

    def ledger(self, alpha: float, load: Load, heats: int) -> Ledger:
        """Return an empty ledger of a case with so many thermal states."""
        basis = self._basis
        held = basis.held if alpha == 0 else linked(basis.held)
        raw = 2 * basis.tip.size + heats
        return Ledger(
            free=_form(self._regime(None, heats), load),
            held=_form(self._regime(alpha, heats), load),
            stiffness=basis.free.stiffness,
            start=np.zeros(raw),
            final=np.zeros(raw),
            totals=np.zeros(TURNED + 1),
            hidden=held.frequency.size < basis.held.frequency.size,
        )

    def residuals(self, ledger: Ledger, raw: Array, load: Load, alpha: float, impulse: float) -> tuple[float, float]:
        """Return the energy and the heat residual of a case that came to its end."""
        totals = ledger.totals
        change = totals[FINAL] - totals[FIRST] + totals[SPENT]
        energy = change / totals[LARGEST] if totals[LARGEST] != 0 else 0.0
        heats = ledger.final.size - 2 * self._basis.tip.size
        if heats == 0:
            return float(energy), 0.0
        before, after = raw[-heats:], ledger.final[-heats:]
        heating = load.duration * float(self._content @ (self._heat_shapes.T @ load.heating))
        content = float(self._content @ after - self._content @ before)
        change = content - alpha * impulse - heating + totals[LOST]
        turned = alpha * impulse + abs(heating) + totals[TURNED] + float(np.abs(self._content) @ np.abs(before))
        return float(energy), float(change / turned) if turned != 0 else 0.0

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
    modes, size = regime.frequency.size, regime.A.shape[0]
    v, tau = slice(modes, 2 * modes), slice(2 * modes, size)
    source = np.zeros((2, size))
    source[0] = regime.steady @ load.steady + regime.heating @ load.heating + regime.tip * load.mean
    source[0] += regime.gap * load.gap
    source[1] = regime.tip * load.amplitude
    power, power_load = np.zeros((size, size)), np.zeros((2, size))
    power[v, v] = np.diag(regime.damping)
    power[v, tau] = regime.coupling
    power_load[0, v] = -(regime.modes_load @ load.steady + regime.modes_tip * load.mean)
    power_load[1, v] = -regime.modes_tip * load.amplitude
    poles = regime.poles
    found = _answers(poles, source, load)
    count = 0 if found is None else poles.values.size + 3
    inward = np.zeros((0, size), dtype=np.complex128)
    answer = np.zeros((2, size), dtype=np.complex128)
    values, loss_weight = np.zeros(count, dtype=np.complex128), np.zeros(count, dtype=np.complex128)
    quadratic = np.zeros((count, count), dtype=np.complex128)
    slow = np.zeros((0, 2), dtype=np.int64)
    slow_weight = slow_value = np.zeros(0, dtype=np.complex128)
    if found is not None:
        inward, answer = poles.left, found
        values = np.concatenate([poles.values, [0, 1j * load.omega, -1j * load.omega]])
        wave = answer[1] / 2j
        columns = np.column_stack([poles.right, answer[0], wave, wave.conj()])
        forces = np.zeros((count, size), dtype=np.complex128)
        forces[-3], forces[-2], forces[-1] = power_load[0], power_load[1] / 2j, -power_load[1] / 2j
        q = columns.T @ (power @ columns) + (forces @ columns).T
        q = np.triu(q + q.T)
        q[np.diag_indices(count)] /= 2
        sums = values[:, None] + values
        near = np.abs(sums) * load.duration < SLOW
        quadratic = np.where(near, 0, q / np.where(near, 1, sums))
        slow = np.ascontiguousarray(np.argwhere(near & (q != 0)), dtype=np.int64)
        slow_weight, slow_value = q[slow[:, 0], slow[:, 1]], sums[slow[:, 0], slow[:, 1]]
        loss_weight = regime.loss @ columns
    return Form(
        entry=regime.entry,
        entry_gap=regime.entry_gap,
        state=regime.A,
        source=source,
        power=power,
        power_load=power_load,
        loss=regime.loss,
        fastest=max(poles.fastest, load.omega),
        inward=np.ascontiguousarray(inward),
        answer=np.ascontiguousarray(answer),
        values=values,
        quadratic=np.ascontiguousarray(quadratic),
        slow=slow,
        slow_weight=slow_weight,
        slow_value=slow_value,
        loss_weight=loss_weight,
    )


def _answers(poles: _Poles, source: Array, load: Load) -> Complex | None:
    """Return the answers to b and w exp iψ, ``(2, n)``; ``None`` where they resonate or poles are poor."""
    if poles.values.size == 0:
        return None
    found = np.zeros((2, source.shape[1]), dtype=np.complex128)
    for row, pole in enumerate((0.0, 1j * load.omega)):
        share, distance = poles.left @ source[row], pole - poles.values
        driven = np.abs(share) > 1e-15 * np.abs(share).max(initial=0.0)
        if np.any(driven & (np.abs(distance) * load.duration < NEAR)):
            return None
        found[row] = poles.right @ np.where(driven, share / np.where(driven, distance, 1), 0)
    return found
