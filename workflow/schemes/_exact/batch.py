"""A batch of the event-driven scheme: its cases as rows, held regimes by distinct α, and one kernel for all."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import elementwise
from workflow.models import Array, Cases, EndState, Harmonics, Sensors, Structure, distinct_rows, project
from workflow.schemes._exact.event_loop import (
    COMPLETED,
    INSEPARABLE,
    INSIDE_CASING,
    INVALID,
    NO_IMPACT_LAW,
    NOT_FINITE,
    OUT_OF_EVENTS,
    OUT_OF_STEPS,
    run_cases,
)
from workflow.schemes._exact.layout import Budget, Case, Thresholds, row_length
from workflow.schemes._exact.modal_system import ModalBasis, analyse, signal_inputs
from workflow.schemes._exact.motion import scratch
from workflow.schemes._exact.record import EVENT, TALLY, Asked, Record
from workflow.schemes._exact.regimes import HeldRegimes, Regimes, fill_row
from workflow.schemes._exact.tables import wave
from workflow.schemes._interface import (
    AT_REST,
    EXTRAPOLATED,
    HISTORIES,
    LINEAR,
    RefusedStructureError,
    Results,
    Sampling,
    Status,
    complete_periods,
    sections_of,
)

THRESHOLDS = Thresholds(height=1e-10, speed=1e-3, force=64.0)

_REGIME_BYTES = 2**24
"""Memory of the held regimes that are known at a time."""

_NEARLY_ELASTIC = 0.99
"""Restitution above which the message on the budget of events states how many impacts it takes to come to rest."""

_INSEPARABLE = (
    "the structure has poles that coincide and share an eigenvector, or nearly so, which event_driven cannot separate "
    "to seven digits over the duration; change its damping slightly, or take a scheme with a fixed step"
)


class InseparablePolesError(RefusedStructureError):
    """Poles of a structure with coupled modes are too near each other to be separated."""

    def __init__(self) -> None:
        super().__init__(_INSEPARABLE)


@dataclass(frozen=True, eq=False)
class ExactOperator:
    """Common data of the cases of a batch; ``budget`` limits events and steps of one case."""

    basis: ModalBasis
    held: HeldRegimes
    length: int
    """Numbers of the row of a regime, see :func:`~workflow.schemes._exact.layout.unpacked`."""
    budget: Budget
    sensors: Sensors | None = None
    thresholds: Thresholds = THRESHOLDS
    _free: dict[float, Regimes] = field(default_factory=dict)

    def free(self, duration: float) -> Regimes:
        """Return the regimes of a free tip without and with thermal modes, for cases of a duration [s]."""
        if duration not in self._free:
            rows, free = np.empty((2, self.length)), self.basis.free
            found = [
                fill_row(row, system, 0.0, duration) for row, system in zip(rows, (free.unheated, free), strict=True)
            ]
            self._free[duration] = Regimes(rows, np.array(found))
        return self._free[duration]


def make_operator(structure: Structure, budget: Budget) -> ExactOperator:
    """Diagonalise the structure with its tip free and held."""
    basis = analyse(structure)
    size, inputs = 2 * basis.tip.size + basis.free.rate.size, signal_inputs(basis.free).size
    length = row_length(size, basis.tip.size, inputs)
    inside = basis.held.shapes.shape[0]
    sensors = np.zeros((0, inside)) if structure.sensors is None else structure.sensors.displacement[:, :inside]
    return ExactOperator(basis, HeldRegimes(basis.held, length, sensors), length, budget, structure.sensors)


def run_batch(operator: ExactOperator, cases: Cases, sampling: Sampling) -> Results:
    """Run all cases that are finite; held regimes are made for as many α at a time as memory is bounded for."""
    conditions, ended = conditions_of(operator, cases, sampling.duration), np.full(cases.count, INVALID)
    periods = complete_periods(cases.period_frequency, sampling)
    record = record_of(cases, sampling, periods, operator.basis.sensors)
    memory = scratch(conditions.modal.shape[1], conditions.waves.shape[1])
    free, finite = operator.free(sampling.duration), np.flatnonzero(cases.finite)
    alpha, friction, heated = cases.alpha[finite], cases.friction[finite], cases.heated[finite]
    first, regime = distinct_rows(alpha[:, None], friction[:, None], heated[:, None])
    order, most = np.argsort(regime, kind="stable"), max(1, _REGIME_BYTES // (8 * operator.length))
    for begin in range(0, first.size, most):
        some = first[begin : begin + most]
        held = operator.held.at(alpha[some], friction[some], heated[some], sampling.duration)
        those = order[slice(*np.searchsorted(regime[order], (begin, begin + most)))]
        which, own = finite[those], regime[those] - begin
        conditions.held[which] = own
        separable = held.separable[own] & free.separable[conditions.free[which]]
        ended[which[~separable]] = INSEPARABLE
        run_cases(free.rows, held.rows, conditions, which[separable], record, memory, ended)
    completed, tally, basis, modal = ended == COMPLETED, record.tally, operator.basis, conditions.modal
    depth = penetration(conditions, record.histories[:, 0], sampling.times)
    closing = project(basis.closing, modal[:, 2 * basis.tip.size :])
    messages = {}
    for i in np.flatnonzero(~completed | (tally["summed_speed"] > 0)).tolist():
        if completed[i]:
            messages[i] = _extrapolation_text(tally[i], operator.budget)
        else:
            messages[i] = failure_text(int(ended[i]), tally[i], operator.budget, float(cases.e[i]))
    return results_of(
        record,
        cases,
        periods,
        operator.sensors,
        metrics=metrics_of(record, sampling, completed, tally["steps"], depth, closing),
        status=status_of(ended),
        messages=messages,
        end=state_of(basis.free.shapes, basis.free.heat_shapes, modal),
        events=events_of(record, np.where(completed, tally["events"], np.nan)),
    )


def record_of(cases: Cases, sampling: Sampling, periods: NDArray[np.int64], sensors: Array) -> Record:
    """Return the arrays of results of a batch, with an axis of contacts where they are several.

    ``sensors`` are the rows of sensors, ``(sensor, mode + thermal mode)``.
    """
    numbers, each = np.arange(1, int(periods.max(initial=0)) + 1), cases.contact_shape
    with np.errstate(divide="ignore", invalid="ignore"):  # of constant loads
        ends = np.where(numbers <= periods[:, None], numbers / cases.period_frequency[:, None], np.inf)
    return Record(
        sampling.times,
        ends,
        histories=np.full((cases.count, len(HISTORIES), *each, sampling.count), np.nan),
        periods=np.full((cases.count, 7, *each, numbers.size), np.nan),
        tally=np.zeros((cases.count, *each), dtype=TALLY),
        asked=Asked(
            np.ascontiguousarray(sensors),
            np.full((cases.count, len(sensors), sampling.count), np.nan),
            np.full((cases.count, sampling.events, len(EVENT)), np.nan),
            np.zeros((cases.count, 0, 0)),
        ),
    )


def status_of(ended: NDArray[np.int64]) -> NDArray[np.int8]:
    """Return the status of cases by how they ended."""
    status = np.where(ended == COMPLETED, Status.OK, Status.FAILED).astype(np.int8)
    status[ended == NO_IMPACT_LAW] = Status.ILL_POSED
    status[ended == NOT_FINITE] = Status.DIVERGED
    return status


def state_of(shapes: Array, heat_shapes: Array, modal: Array) -> EndState:
    """Return the states of cases by those of their modes [y, y', τ], ``(case, number)``."""
    n = shapes.shape[1]
    y, v, tau = np.split(modal, [n, 2 * n], axis=1)
    return EndState(project(shapes, y), project(shapes, v), project(heat_shapes, tau))


def events_of(record: Record, count: Array) -> dict[str, Array]:
    """Return :attr:`Results.events` of a record with ``count`` events, ``(case,)``; none where none are asked for."""
    events = record.asked.events
    if not events.shape[1]:
        return {}
    return {**{f"event_{name}": events[:, :, k].copy() for k, name in enumerate(EVENT)}, "event_count": count}


def results_of(
    record: Record, cases: Cases, counted: NDArray[np.int64], sensors: Sensors | None, **others: Any
) -> Results:
    """Return the results of a record, its load periods ``counted``, and what it does not hold."""
    periods, frequency = record.periods, cases.period_frequency
    if cases.offset.any():  # the casing was seen from there
        for displacement in (record.histories[:, 0], periods[:, 3]):
            displacement += cases.offset.reshape(*record.tally.shape, 1)
    histories = {name: record.histories[:, k].copy() for k, name in enumerate(HISTORIES)}
    if sensors is not None:
        places = histories["displacement"].reshape(cases.count, -1, record.times.size)
        histories["sensor_value"] = sensors.with_contacts(record.asked.sensed, places)
    return Results(
        histories=histories,
        period_impulse=periods[:, 0].copy(),
        period_temperature=periods[:, 1].copy(),
        period_contact=periods[:, 2] * frequency.reshape(-1, *(1,) * (periods.ndim - 2)),
        sections=sections_of(periods[:, 3:], counted, record.histories[:, :3, ..., 0]),
        **others,
    )


def metrics_of(
    record: Record, sampling: Sampling, completed: NDArray[np.bool_], steps: Array, depth: Array, closing: Array
) -> dict[str, Array]:
    """Return the metrics, with ``depth`` the largest penetration; of cases that did not complete the others are NaN.

    Certified ``steps`` are not, and residuals, which are those of steps in time, always.
    """
    tally, count = record.tally, completed.size
    each = completed.reshape(-1, *(1,) * (tally.ndim - 1))
    metrics = {name: np.where(each, tally[name], np.nan) for name in ("impacts", "contact_time", "max_temperature")}
    metrics["max_penetration"] = depth.reshape(tally.shape)
    metrics["releases"] = np.where(completed, tally["releases"].reshape(count, -1).sum(axis=1), np.nan)
    metrics["steps"] = np.where(steps > 0, steps, np.nan)
    for name in ("energy_residual", "heat_residual") if sampling.balances else ():
        metrics[name] = np.full(count, np.nan)
    return metrics | {"thermal_closing": np.where(completed, closing, np.nan)}


@np.errstate(over="ignore", invalid="ignore")  # of a case that is not finite
def loads_of(cases: Cases, casing: Harmonics) -> tuple[Array, Array, Array, NDArray[np.int64], NDArray[np.int64]]:
    """Return F0, d0 of one contact, waves, their number, and which harmonic of load and ``casing`` each wave is.

    A sinusoid of frequency 0 is a constant, one of amplitude 0 left out.
    """
    amplitude, frequency, phase = cases.load_harmonics.joined(casing).rows
    moves = np.arange(amplitude.shape[1]) >= cases.load_harmonics.width  # the casing
    constants = np.where((amplitude != 0) & (frequency == 0), amplitude * elementwise.sine_cosine(phase)[0], 0.0)
    acts = (amplitude != 0) & (frequency != 0)
    forces, places = np.where(moves, 0.0, amplitude), np.where(moves, amplitude, 0.0)
    waves = np.stack([2 * np.pi * frequency, phase, forces, places], axis=2)
    first = np.argsort(~acts, axis=1, kind="stable")[:, : int(acts.sum(axis=1).max(initial=0))]
    waves = np.take_along_axis(np.where(acts[:, :, None], waves, 0.0), first[:, :, None], axis=1)
    both = cases.mean, cases.gaps[:, 0]
    mean, gap = (_added(own, constants[:, moves == is_casing]) for is_casing, own in enumerate(both))
    return mean, gap, waves, acts.sum(axis=1), first


def _added(constant: Array, terms: Array) -> Array:
    """Return a constant plus the terms ``(case, term)`` in their order, ``(case,)``: bits of a case are its own."""
    total = np.array(constant, dtype=np.float64)
    for k in range(terms.shape[1]):
        total += terms[:, k]
    return total


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # not finite; a tip without impact law
def conditions_of(operator: ExactOperator, cases: Cases, duration: float) -> Case:
    """Return the conditions of cases over a time [s], without held regimes: an impulse moves modes by φᵀ(e_n - µ t)."""
    basis, alpha, friction = operator.basis, cases.alpha[:, None], cases.friction[:, None]
    mean, gap, waves, acting, _ = loads_of(cases, cases.casing_seen_by(0))
    struck, casing = basis.tip - friction * basis.tangent, waves[:, :, wave.CASING]
    sin, cos = elementwise.sine_cosine(waves[:, :, wave.PHASE])
    turning = waves[:, :, wave.OMEGA] * (casing * cos)
    speed = cases.velocity[:, -1] - _added(np.zeros(cases.count), turning)
    distance = _added(gap, casing * sin) - cases.displacement[:, -1]
    states = [project(basis.to_modes, cases.displacement), project(basis.to_modes, cases.velocity)]
    lengths, speeds = cases.casing_harmonics.rounding_scales(duration)
    lengths = lengths + np.abs(gap)
    touches = np.abs(distance) <= AT_REST * lengths
    speeds = speeds + project(np.abs(basis.tip), np.abs(states[1])) + lengths * basis.free.frequency.max(initial=0.0)
    return Case(
        free=np.where(cases.heated, 1, 0),
        held=np.zeros(cases.count, dtype=np.int64),
        e=np.array(cases.e),
        alpha=np.array(cases.alpha),
        mean=mean,
        gap=gap,
        waves=waves,
        acting=acting,
        steady=np.array(cases.steady, order="C"),
        heating=np.array(cases.heating, order="C"),
        mobility=basis.mobility - cases.friction * basis.tangential,
        drag=project(basis.damped_tip, struck) / project(basis.tip, struck),
        jump=np.hstack([np.zeros_like(struck), -struck, alpha * basis.free.heat_tip]),
        distance=np.where(touches, 0.0, distance),
        speed=np.where(touches & (np.abs(speed) <= AT_REST * speeds), 0.0, speed),
        reach=_added(np.abs(gap), np.abs(casing)),
        modal=np.hstack([*states, project(basis.to_thermal, cases.temperature)]),
        heat_jump=basis.heat_jump,
        duration=duration,
        budget=operator.budget,
        thresholds=operator.thresholds,
    )


def penetration(loads: Case, displacement: Array, times: Array) -> Array:
    """Return the largest penetration of the samples of each case ``(case, t)``, m, summed in the event loop's order."""
    place = loads.gap[:, None]
    for omega, phase, _, amplitude in loads.waves.transpose(1, 2, 0)[..., None]:
        if amplitude.any():
            place = place + amplitude * elementwise.sine_cosine(omega * times + phase)[0]
    with np.errstate(invalid="ignore"):
        return np.asarray(np.maximum(0.0, np.max(displacement - place, axis=1)))


def run_away_text(temperature: float) -> str:
    """Return why a case starts beyond its casing at a temperature [K] that rubs of an earlier point have left."""
    if not abs(temperature) > LINEAR:
        return ""
    return f"; it starts at {temperature:.3g} K: in the sweep before it the rub has run away thermally"


def failure_text(ended: int, tally: Any, budget: Budget, e: float) -> str:
    """Return the message of a case that did not complete, from its :data:`~workflow.schemes._exact.record.TALLY`."""
    at = f"at t = {tally['time']:.6g} s" if np.isfinite(tally["time"]) else "in its first steps"
    speed = tally["speed"] if tally["impacts"] else 0.0
    return {
        INVALID: "a value of the case is not a finite number",
        OUT_OF_EVENTS: f"stopped {at} after {budget.events} contact events, its budget; "
        f"the last of {tally['impacts']} impacts had a speed of {speed:.3g} m/s; {_more_events(e)}",
        OUT_OF_STEPS: f"stopped {at} after {budget.steps} steps between contact events, its budget; "
        "raise the scheme's option `steps`",
        NO_IMPACT_LAW: f"contact has no unique solution {at} (W <= 0 as the step vanishes): friction pushes the "
        "tip into the casing more than the contact force pushes it out; lower the friction coefficient",
        INSEPARABLE: _INSEPARABLE,
        INSIDE_CASING: f"the tip starts beyond the casing: x_n(0) > d{run_away_text(tally['max_temperature'])}",
        NOT_FINITE: f"the state left the finite numbers {at}",
    }[ended]


def _extrapolation_text(tally: Any, budget: Budget) -> str:
    """Return the message of a case whose chattering was summed because it exceeds the budget of events."""
    leaves = (
        f"; while it does not rest it is in no contact, and it leaves with at most {tally['leaving_speed']:.3g} m/s"
    )
    return (
        f"{EXTRAPOLATED}impacts below {tally['summed_speed']:.3g} m/s, which lift the tip by at most "
        f"{tally['summed_height']:.3g} m, were summed up: there are more of them than the option `events`, "
        f"{budget.events}, leaves" + (f"{leaves}, taken as 0" if tally["leaving_speed"] > 0 else "")
    )


def _more_events(e: float) -> str:
    """Return the advice for a case that has exhausted its budget of contact events."""
    if e == 1:
        return (
            "with e = 1 impacts of a pressed, damped tip follow each other ever faster without ever ending in contact: "
            "the scheme's option `events` does not help, lower e"
        )
    if e > _NEARLY_ELASTIC:
        return (
            f"with e = {e:.9g} the speed of a bouncing tip falls to 37 % in about {1 / (1 - e):.2g} impacts, and to "
            "rest it takes ten times as many and more: raise the scheme's option `events`, or lower e"
        )
    return "raise the scheme's option `events`"
