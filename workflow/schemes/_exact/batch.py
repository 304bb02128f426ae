"""A batch of the event-driven scheme: its cases as rows, and the sets of closed contacts that they ask for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import elementwise
from workflow.models import (
    Array,
    Cases,
    Coating,
    ContactBasis,
    EndState,
    Sensors,
    Structure,
    analyse_contacts,
    compliant_places,
    distinct_rows,
    project,
)
from workflow.schemes._exact.closed_sets import row_length
from workflow.schemes._exact.event_loop import PROGRESS, Outcome, run_cases
from workflow.schemes._exact.events import (
    COMPLETED,
    INSEPARABLE,
    INSIDE_CASING,
    INVALID,
    LOWEST_BOUNCE,
    NO_IMPACT_LAW,
    NO_ROOM,
    NOT_FINITE,
    OUT_OF_EVENTS,
    OUT_OF_STEPS,
)
from workflow.schemes._exact.record import EVENT, TALLY, Asked, Record
from workflow.schemes._exact.set_motion import Budget, Case, Coat, Thresholds, memory, with_room
from workflow.schemes._exact.set_tables import FULL, MOST_BYTES, ROOM, SetTable, SharedSets
from workflow.schemes._exact.tables import wave
from workflow.schemes._interface import (
    EXTRAPOLATED,
    HISTORIES,
    LINEAR,
    RefusedStructureError,
    Results,
    Sampling,
    Status,
    Worn,
    complete_periods,
    sections_of,
    wear_results,
    worn_of,
)

THRESHOLDS = Thresholds(height=1e-10, speed=1e-3, force=64.0)
"""Those of one contact. Of several, bounces are summed below a tenth of that height: the others amplify the sum's error
(a chain of four masses with 1 500 impacts: 5e-10 of its displacement, 2e-11 with a tenth)."""

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

    basis: ContactBasis
    budget: Budget
    structure: Structure
    thresholds: Thresholds = THRESHOLDS
    _tables: dict[tuple[float, ...], SetTable] = field(default_factory=dict)

    @cached_property
    def bases(self) -> tuple[ContactBasis, ContactBasis]:
        """The basis without and with thermal modes."""
        return self.basis.unheated, self.basis

    def sets(self, heated: bool, *conditions: float) -> SetTable:
        """Return the table of sets at one µ, duration and, of a coating, hardening; the oldest may go for a new one."""
        basis, key = self.bases[heated], (heated, *conditions)
        most = MOST_BYTES // (8 * ROOM * row_length(basis))
        found, known = self._tables.get(key), self._tables
        if found is None:
            for oldest in list(known)[: max(0, len(known) + 1 - max(1, most))]:
                known.pop(oldest, None)
            found = known.setdefault(key, SetTable(SharedSets(basis, *conditions)))
        return found


def make_operator(structure: Structure, budget: Budget) -> ExactOperator:
    """Return the modes of a structure."""
    basis = analyse_contacts(structure)
    low = THRESHOLDS if basis.contacts.count == 1 else THRESHOLDS._replace(height=LOWEST_BOUNCE)
    return ExactOperator(basis, budget, structure, low)


def run_batch(operator: ExactOperator, cases: Cases, sampling: Sampling) -> Results:
    """Run all cases that are finite, those of one µ after each other and in the order of α, as they share sets."""
    periods = complete_periods(cases.period_frequency, sampling)
    basis, record = operator.basis, record_of(cases, sampling, periods, operator.basis.sensors)
    contacts, n, size = basis.contacts.count, basis.frequency.size, basis.size
    record.tally["next_sample"] = 1
    _fill_first_sample(record, basis, operator.structure, cases)
    progress, ended = np.zeros(cases.count, dtype=PROGRESS), np.full(cases.count, INVALID)
    outcome, finite = Outcome(with_contacts(record, contacts), progress, ended), np.flatnonzero(cases.finite)
    modal, conditions = np.full((cases.count, size), np.nan), conditions_of(operator, cases, sampling.duration)
    worn, coat = worn_of(cases, contacts, sampling), cases.coating
    conditions = conditions._replace(coat=None if coat is None else coat_of(basis, cases, coat, worn))
    hardening = np.zeros(cases.count) if coat is None else coat.hardening
    first, variant = distinct_rows(*(row[finite, None] for row in (cases.friction, cases.heated, hardening)))
    for k, i in enumerate(finite[first].tolist()):
        heated, friction, which = bool(cases.heated[i]), float(cases.friction[i]), finite[variant == k]
        which = which[np.argsort(cases.alpha[which], kind="stable")]
        own = conditions if heated else unheated(conditions, n, basis.rate.size)
        march(operator.sets(heated, friction, sampling.duration, float(hardening[i])), own, which, outcome)
        modal[which, : 2 * n], modal[which, 2 * n :] = own.modal[which, : 2 * n], 0.0
        if heated:
            modal[which] = own.modal[which]
    completed = ended == COMPLETED
    displacement = record.histories[:, 0].reshape(cases.count, contacts, -1)
    depth = _penetration(conditions, displacement, sampling.times)
    closing = (basis.contacts.growth_at_once + project(basis.growth, modal[:, 2 * n :])).max(axis=1)
    metrics = {}
    if conditions.coat is not None:
        depth = np.fmax(depth, conditions.coat.deepest)
        metrics["border_work"] = conditions.coat.border_work.reshape(record.tally.shape)
    return results_of(
        record,
        cases,
        periods,
        operator.structure.sensors,
        metrics=metrics | metrics_of(record, sampling, completed, progress["steps"], depth, closing),
        status=status_of(ended),
        messages=dict(_messages(operator, cases, outcome)),
        end=state_of(basis.shapes, basis.heat_shapes, modal),
        events=events_of(record, np.where(completed, progress["listed"], np.nan)),
        wear=wear_results(cases, worn, ~completed),
    )


def march(table: SetTable, conditions: Case, which: NDArray[np.int64], outcome: Outcome) -> None:
    """March cases of one µ; the kernel stops at each set that is not known yet, which is made."""
    shared, at = table.shared, 0
    conditions.variant[which] = shared.variants(conditions.alpha[which])
    own, known = memory(shared.basis, conditions.waves.shape[1], 2, conditions.coat is not None), table.known()
    while (at := run_cases(known, shared.between, conditions, which, at, outcome, own)) < which.size:
        if outcome.ended[which[at]] == NO_ROOM:
            own = with_room(own, 2 * own.slots.size)
            continue
        fault = table.add(own.contacts["wanted"], conditions.alpha[which[at:]])
        if fault == FULL:
            table = SetTable(shared)
            own.slots[:] = -1
        elif fault:
            outcome.ended[which[at]] = fault
            at += 1
        known = table.known()


def with_contacts(record: Record, contacts: int) -> Record:
    """Return views of the arrays of results with an axis of contacts, of one contact too."""
    return Record(
        record.times,
        record.period_ends,
        record.histories.reshape(*record.histories.shape[:2], contacts, -1),
        record.periods.reshape(*record.periods.shape[:2], contacts, record.periods.shape[-1]),
        record.tally.reshape(-1, contacts),
        record.asked,
    )


def _fill_first_sample(record: Record, basis: ContactBasis, structure: Structure, cases: Cases) -> None:
    """Write the initial state."""
    modal = [project(basis.to_modes, cases.displacement), project(basis.to_thermal, cases.temperature)]
    normal = basis.contacts.normal
    seen = project(normal, cases.displacement), project(normal, cases.velocity), project(basis.recorded, modal[1])
    for k, values in enumerate(seen):
        record.histories[:, k, ..., 0] = values.reshape(record.tally.shape)
    record.histories[:, 3, ..., 0] = 0.0
    record.asked.sensed[:, :, 0] = project(basis.sensors, np.hstack(modal))
    if basis.contacts.is_compliant:
        record.histories[:, 0, ..., 0] = compliant_places(structure, cases, 0.0).reshape(record.tally.shape)


@np.errstate(over="ignore", invalid="ignore")  # of a case that is not finite
def conditions_of(operator: ExactOperator, cases: Cases, duration: float) -> Case:
    """Return the conditions of cases over a time [s]: a sinusoid of frequency 0 is a constant."""
    basis = operator.basis
    mean, waves, acting, which = loads_of(cases)
    own, m, turns = cases.casing_harmonics, basis.contacts.count, cases.turns
    phase = turns + own.phase[:, None]
    still = np.where(own.frequency == 0, own.amplitude, 0.0)[:, None] * _sine_cosine(phase)[0]
    ahead = np.concatenate([np.zeros((cases.count, m, cases.load_harmonics.width)), turns], axis=2)
    sin, cos = _sine_cosine(np.take_along_axis(ahead, which[:, None], axis=2).swapaxes(1, 2))
    casing = waves[:, :, wave.CASING, None, None] * np.stack([sin, cos], axis=2)
    states = [project(basis.to_modes, cases.displacement), project(basis.to_modes, cases.velocity)]
    loads = [project(basis.shapes.T, cases.steady), project(basis.heat_shapes.T, cases.heating), mean[:, None]]
    return Case(
        variant=np.zeros(cases.count, dtype=np.int64),
        e=np.array(cases.e),
        alpha=np.array(cases.alpha),
        constant=np.hstack([*loads, cases.clearances + still.sum(axis=2), np.zeros((cases.count, 2 * m))]),
        waves=waves,
        acting=acting,
        casing=casing,
        modal=np.hstack([*states, project(basis.to_thermal, cases.temperature)]),
        reach=np.abs(cases.clearances).max(axis=1) + own.reach,
        duration=duration,
        budget=operator.budget,
        thresholds=operator.thresholds,
        flexibility=np.full(cases.count, basis.contacts.casing_flexibility),
    )


def coat_of(basis: ContactBasis, cases: Cases, own: Coating, worn: Worn) -> Coat:
    """Return the coating of cases, whose sectors ``worn`` holds."""
    contacts, m, n = basis.contacts, basis.contacts.count, basis.frequency.size
    push, mu = np.zeros((cases.count, m, basis.inputs)), cases.friction[:, None, None]
    push[:, :, :n] = mu * basis.tangent - basis.normal
    push[:, :, n : n + basis.rate.size] = cases.alpha[:, None, None] * basis.heat
    still, slides = contacts.flexibility(0.0).T, (contacts.flexibility(0.0) - contacts.flexibility(1.0)).T
    push[:, :, -3 * m : -2 * m] = still - mu * slides
    each = np.full((cases.count, 2), [contacts.casing_flexibility, worn.every])
    law = np.column_stack([own.yield_force, own.hardening, own.sectors, own.speed, each])
    return Coat(law, own.turns, push, worn.depth, worn.map, *np.zeros((2, cases.count, m)))


def _sine_cosine(angle: Array) -> tuple[Array, Array]:
    """Return sine and cosine of angles of any shape."""
    sin, cos = elementwise.sine_cosine(angle.ravel())
    return sin.reshape(angle.shape), cos.reshape(angle.shape)


def unheated(conditions: Case, modes: int, heats: int) -> Case:
    """Return the conditions without thermal modes."""
    constant = np.delete(conditions.constant, np.s_[modes : modes + heats], axis=1)
    coat = conditions.coat
    if coat is not None:
        coat = coat._replace(push=np.delete(coat.push, np.s_[modes : modes + heats], axis=2))
    modal = np.ascontiguousarray(conditions.modal[:, : 2 * modes])
    return conditions._replace(constant=constant, modal=modal, coat=coat)


def _penetration(conditions: Case, displacement: Array, times: Array) -> Array:
    """Return the largest penetration of the samples of each contact, m, ``(case, contact)``."""
    m = displacement.shape[1]
    place = np.repeat(conditions.constant[:, -3 * m : -2 * m, None], times.size, axis=2)
    for i in range(conditions.waves.shape[1]):
        omega, phase = conditions.waves[:, i, :2].T[:, :, None]
        sin, cos = elementwise.sine_cosine(omega * times + phase)
        a, b = conditions.casing[:, i, :, :, None].swapaxes(0, 1)
        place += a * cos[:, None] + b * sin[:, None]
    with np.errstate(invalid="ignore"):
        return np.asarray(np.maximum(0.0, np.max(displacement - place, axis=2)))


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
def loads_of(cases: Cases) -> tuple[Array, Array, NDArray[np.int64], NDArray[np.int64]]:
    """Return F0, waves, their number, and which harmonic of load and casing each wave is.

    A sinusoid of frequency 0 is a constant, one of amplitude 0 left out.
    """
    amplitude, frequency, phase = cases.load_harmonics.joined(cases.casing_harmonics).rows
    moves = np.arange(amplitude.shape[1]) >= cases.load_harmonics.width  # the casing
    constants = np.where((amplitude != 0) & (frequency == 0), amplitude * elementwise.sine_cosine(phase)[0], 0.0)
    acts = (amplitude != 0) & (frequency != 0)
    forces, places = np.where(moves, 0.0, amplitude), np.where(moves, amplitude, 0.0)
    waves = np.stack([2 * np.pi * frequency, phase, forces, places], axis=2)
    first = np.argsort(~acts, axis=1, kind="stable")[:, : int(acts.sum(axis=1).max(initial=0))]
    waves = np.take_along_axis(np.where(acts[:, :, None], waves, 0.0), first[:, :, None], axis=1)
    return _added(cases.mean, constants[:, ~moves]), waves, acts.sum(axis=1), first


def _added(constant: Array, terms: Array) -> Array:
    """Return a constant plus the terms ``(case, term)`` in their order, ``(case,)``: bits of a case are its own."""
    total = np.array(constant, dtype=np.float64)
    for k in range(terms.shape[1]):
        total += terms[:, k]
    return total


def failure_text(operator: ExactOperator, ended: int, progress: Any, tally: Any, e: float, warmest: float) -> str:
    """Return the message of a case that did not complete, from its progress and the tally of its contacts.

    The warmest contact has the temperature ``warmest`` at the start, K.
    """
    at = f"at t = {progress['time']:.6g} s" if np.isfinite(progress["time"]) else "in its first steps"
    budget, last, run_away = operator.budget, tally["speed"].max() if tally["impacts"].any() else 0.0, ""
    if abs(warmest) > LINEAR:
        run_away = f"; it starts at {warmest:.3g} K: in the sweep before it the rub has run away thermally"
    texts = {
        INVALID: "a value of the case is not a finite number",
        OUT_OF_EVENTS: f"stopped {at} after {budget.events} contact events, its budget; "
        f"the last of {tally['impacts'].sum()} impacts had a speed of {last:.3g} m/s; {_more_events(e)}",
        OUT_OF_STEPS: f"stopped {at} after {budget.steps} steps between contact events, its budget; "
        "raise the scheme's option `steps`",
        NO_IMPACT_LAW: f"contact has no unique solution {at} (W <= 0 as the step vanishes): friction pushes the "
        "tip into the casing more than the contact force pushes it out; lower the friction coefficient",
        INSEPARABLE: _INSEPARABLE,
        INSIDE_CASING: f"the tip starts beyond the casing: x_n(0) > d{run_away}",
        NOT_FINITE: f"the state left the finite numbers {at}",
    }
    if operator.basis.contacts.count > 1 or operator.basis.contacts.is_compliant:
        names = ", ".join(operator.basis.contacts.labels)
        texts |= {
            OUT_OF_EVENTS: f"stopped {at} after {budget.events} contact events, its budget: contacts with mass open "
            "each other again and again; take contacts without mass, or raise the scheme's option `events`",
            NO_IMPACT_LAW: f"contact has no unique solution {at}, contacts {names}: lower the friction coefficient",
            INSIDE_CASING: f"a contact starts beyond its casing, of contacts {names}{run_away}",
        }
    return texts[ended]


def _messages(operator: ExactOperator, cases: Cases, outcome: Outcome) -> Iterator[tuple[int, str]]:
    """Yield the cases that did not complete, or whose chattering was summed, and why."""
    for i, ended in enumerate(outcome.ended.tolist()):
        tally, progress = outcome.record.tally[i], outcome.progress[i]
        if ended != COMPLETED:
            first = outcome.record.histories[i, 2, :, 0]
            yield i, failure_text(operator, ended, progress, tally, float(cases.e[i]), float(np.abs(first).max()))
        elif (tally["summed_speed"] > 0).any():
            yield i, _extrapolation_text(tally[tally["summed_speed"].argmax()], operator.budget)


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
