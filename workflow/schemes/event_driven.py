"""Event-driven scheme: the exact solution of the model, from contact event to contact event.

Between events the structure is linear and its load harmonic, so its motion is known in closed form,
with the tip free and with the tip held at the gap. Impacts follow Newton's law, a contact ends when
its force falls through zero. No event is missed: every step is certified (see
:mod:`workflow.schemes._event_search`). What remains is rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workflow.declare import quantity
from workflow.models import Array, Cases, Structure, poles
from workflow.schemes._event_balance import no_log
from workflow.schemes._event_books import Books
from workflow.schemes._event_march import BEYOND, DONE, EVENTS, FULL, NOT_FINITE, STEPS, Budget, Thresholds, Tip, march
from workflow.schemes._event_record import Record, watch
from workflow.schemes._event_regimes import Basis, Regime, analyse
from workflow.schemes._event_response import SLOW, TAYLOR_SPAN, Layout, Load, layout, tables
from workflow.schemes._event_spectrum import coupled_regime, held_regime
from workflow.schemes._interface import HISTORIES, Results, Sampling, Status, complete_periods

READS = frozenset({"e", "alpha"})

INPUT, SPECTRUM, STIFF = -1, -2, -3
"""How a case ended that was not run: a value of it is not finite, its eigenvalues were not found, or
a mode too slow to split its load off is damped so fast that its Taylor steps exceed the budget."""

PHASES = 1024
"""Phases that the log of the balances takes at first; a case with more is run again with a longer one."""

THRESHOLDS = Thresholds(excursion=1e-10, speed=1e-3, force=64.0)


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    events: int = quantity("1", "most contact events of one case", default=200_000, at_least=1)
    steps: int = quantity("1", "most certified steps of one case", default=5_000_000, at_least=1)


@dataclass(frozen=True, eq=False)
class Operator:
    """What a batch shares; regimes of the held tip are added per α as they are met."""

    structure: Structure
    basis: Basis
    free: Layout
    options: Options
    thresholds: Thresholds = THRESHOLDS


def init(structure: Structure, h: float, options: Options) -> Operator:
    """Diagonalise the structure with its tip free and held; ``h`` is not read."""
    basis = analyse(structure)
    return Operator(structure, basis, layout(basis.free), options)


def amplification(frequency: Array, damping: Array, h: float, options: Options) -> Any:
    """Return exp(s h) of the two poles s of each mode, complex, ``(mode, 2)``."""
    return np.exp(h * poles(frequency, damping))


def thermal_amplification(rate: Array, h: float, options: Options) -> Array:
    """Return exp(-μ h) of each thermal mode."""
    return np.asarray(np.exp(-rate * h))


def cost(structure: Structure, h: float, options: Options, sampling: Sampling) -> float:
    """Return estimated seconds per heated case: its events are not known beforehand, its samples are.

    Balances about double it, where there are many impacts they take up to three times as long again.
    """
    states = structure.mechanical_size + structure.thermal_size
    return (2e-8 * states * (sampling.count + 1000) + 1e-8 * states**3) * (2 if sampling.balances else 1)


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Run a whole batch, case by case; regimes of the held tip are shared by cases of one α."""
    count = cases.count
    periods = complete_periods(cases.frequency, sampling)
    most = int(periods.max(initial=0))
    written = np.full((count, len(HISTORIES), sampling.count), np.nan)
    periodic = np.full((count, 3, most), np.nan)
    counts = np.full((count, 7), np.nan)
    status = np.zeros(count, dtype=np.int8)
    messages: dict[int, str] = {}
    held: dict[float, tuple[Layout, bool]] = {}
    times = sampling.times
    books = Books(operator.structure, operator.basis) if sampling.balances else None
    residuals = np.full((count, 2), np.nan)
    finite = np.all([_finite_rows(getattr(cases, name)) for name in cases.__dataclass_fields__], axis=0)
    raw = np.concatenate(
        [
            _times(operator.basis.to_modes, cases.displacement),
            _times(operator.basis.to_modes, cases.velocity),
            _times(operator.basis.to_thermal, cases.temperature),
        ],
        axis=1,
    )
    for i in range(count):
        n, frequency, alpha = int(periods[i]), float(cases.frequency[i]), float(cases.alpha[i])
        record = Record(
            times,
            np.arange(1, n + 1) / frequency if n else np.zeros(0),
            written[i],
            periodic[i],
            counts[i],
        )
        ended = INPUT
        if finite[i]:
            try:
                if alpha not in held:
                    regime = (held_regime if alpha == 0 else coupled_regime)(operator.basis.held, alpha)
                    taylor_steps = _taylor_steps((operator.basis.free, regime), sampling.duration)
                    held[alpha] = layout(regime), taylor_steps > operator.options.steps
                rest, stiff = held[alpha]
                if stiff:
                    ended = STIFF
                else:
                    ended = _run(operator, rest, cases, i, raw[i], sampling.duration, record, books, residuals[i])
            except np.linalg.LinAlgError:
                ended = SPECTRUM
        if ended != DONE:
            status[i] = Status.FAILED
            messages[i] = _message(ended, operator.options, counts[i], float(cases.e[i]))
            counts[i, :4] = counts[i, 5:] = np.nan
        periodic[i, 2] *= frequency
    histories = {name: written[:, k].copy() for k, name in enumerate(HISTORIES)}
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(0.0, np.max(histories["displacement"] - cases.gap[:, None], axis=1))
    balances = {} if books is None else dict(zip(("energy_residual", "heat_residual"), residuals.T.copy(), strict=True))
    return Results(
        histories=histories,
        metrics={
            "impacts": counts[:, 0],
            "contact_time": counts[:, 1],
            "max_penetration": beyond,
            "max_temperature": counts[:, 2],
            "thermal_closing": counts[:, 3],
            "steps": counts[:, 4],
            "releases": counts[:, 5],
            **balances,
        },
        period_impulse=periodic[:, 0].copy(),
        period_temperature=periodic[:, 1].copy(),
        period_contact=periodic[:, 2].copy(),
        status=status,
        messages=messages,
    )


def _run(
    operator: Operator,
    held: Layout,
    cases: Cases,
    i: int,
    raw: Array,
    duration: float,
    record: Record,
    books: Books | None,
    residuals: Array,
) -> int:
    """Run case ``i`` and return how it ended."""
    basis, options = operator.basis, operator.options
    frequency, mean, amplitude = float(cases.frequency[i]), float(cases.mean[i]), float(cases.amplitude[i])
    if frequency == 0:
        mean, amplitude = mean + amplitude * float(np.sin(cases.phase[i])), 0.0
    load = Load(
        mean,
        amplitude,
        2 * np.pi * frequency if amplitude else 0.0,
        float(cases.phase[i]),
        float(cases.gap[i]),
        duration,
        np.ascontiguousarray(cases.steady[i]),
        np.ascontiguousarray(cases.heating[i]),
    )
    warm = cases.alpha[i] != 0 or cases.heating[i].any() or cases.temperature[i].any()
    heats = basis.heat_tip.size if warm else 0
    raw = raw[: 2 * basis.tip.size + heats]
    alpha, modes = float(cases.alpha[i]), basis.tip.size
    tip = Tip(
        float(cases.e[i]),
        alpha,
        basis.mobility,
        basis.tip,
        basis.heat_tip,
        float(cases.gap[i] - cases.displacement[i, -1]),
        float(cases.velocity[i, -1]),
    )
    phases = 0 if books is None else PHASES
    while True:
        log = no_log() if books is None else books.log(alpha, raw.size, phases)
        ended = int(
            march(
                operator.free,
                held,
                load,
                tip,
                raw,
                record,
                watch(),
                basis.closing[:heats],
                Budget(options.events, options.steps),
                operator.thresholds,
                tables(modes, heats),
                tables(held.block.shape[1], held.first.shape[1] if heats else 0),
                log,
            )
        )
        if ended != FULL:
            break
        phases *= 8
    if books is not None and ended == DONE:
        residuals[:] = books.residuals(log, raw, load, alpha, float(record.histories[3, -1]))
    return ended


def _taylor_steps(regimes: tuple[Regime, ...], duration: float) -> float:
    """Return the Taylor steps that the stiffest explicit block takes over the duration, 0 for none.

    Explicit are overdamped blocks whose slow pole has moved by less than ``SLOW`` at the end. Their
    fast pole is split off unless a thermal rate lies as near as quasi-static responses allow.
    """
    most = 0.0
    for regime in regimes:
        half, omega = 0.5 * np.abs(regime.damping), np.sqrt(np.abs(regime.stiffness))
        root = np.sqrt(np.maximum(half**2 - regime.stiffness, 0.0))
        slow = np.where(root > 0, regime.stiffness / np.maximum(half + root, 1e-300), omega)
        near = regime.near > 0
        explicit = (slow * duration < SLOW) & (near | (regime.damping < 0))
        most = max(most, float(np.max(np.abs(regime.damping)[explicit], initial=0.0)) * duration / TAYLOR_SPAN)
    return most


def _finite_rows(values: Array) -> Array:
    """Return whether all values of each case are finite."""
    return np.asarray(np.isfinite(values).reshape(len(values), -1).all(axis=1))


def _times(matrix: Array, states: Array) -> Array:
    """Return matrix @ state of every case, summed in one order on every machine and for any number of cases."""
    with np.errstate(all="ignore"):
        return np.stack([(matrix * state).sum(axis=1) for state in states])


def _message(ended: int, options: Options, counts: Array, e: float) -> str:
    """Say what a case did when it stopped."""
    at = f"at t = {counts[6]:.6g} s"
    without_end = (
        ": with e = 1 impacts of a pressed tip follow each other ever faster without ever ending in contact; "
        "with e < 1 they do"
        if e == 1
        else ""
    )
    return {
        INPUT: "a value of the case is not a finite number",
        SPECTRUM: "the eigenvalues of the held tip with friction heat were not found",
        EVENTS: f"stopped {at} after {options.events} contact events, its budget; "
        f"the last of {counts[0]:.0f} impacts had a speed of {counts[1]:.3g} m/s{without_end}",
        STEPS: f"stopped {at} after {options.steps} steps between contact events, its budget",
        STIFF: "a mode is damped too fast and moves too slowly for its load to be followed within the budget of "
        f"{options.steps} steps; lower the damping, or use moreau",
        BEYOND: "the tip starts beyond the casing: x_n(0) > d",
        NOT_FINITE: f"the state left the finite numbers {at}",
    }[ended]
