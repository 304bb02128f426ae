"""A batch of the event-driven scheme for several contacts, or contacts without mass, and the sets that it asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import elementwise
from workflow.kernels.lemke import complementarity
from workflow.models import Array, Cases, ContactBasis, Sensors, Structure, analyse_contacts, distinct_rows, project
from workflow.schemes._exact.batch import (
    events_of,
    failure_text,
    loads_of,
    metrics_of,
    record_of,
    results_of,
    run_away_text,
    state_of,
    status_of,
)
from workflow.schemes._exact.closed_sets import SetAnyAlpha, row_length
from workflow.schemes._exact.contact_loop import PROGRESS, Outcome, Sets, run_contacts
from workflow.schemes._exact.contact_motion import ContactCase, Contacting, Memory, contacting, memory
from workflow.schemes._exact.event_loop import (
    COMPLETED,
    INSEPARABLE,
    INSIDE_CASING,
    INVALID,
    NO_IMPACT_LAW,
    OUT_OF_EVENTS,
)
from workflow.schemes._exact.layout import Budget
from workflow.schemes._exact.record import Record
from workflow.schemes._exact.tables import wave
from workflow.schemes._interface import Results, Sampling, complete_periods

TOO_MANY_SETS = -2
"""How a case ended that meets more sets of closed contacts than are kept."""

UNLIMITED = Budget(2**62, 2**62)
"""For steps of a fixed size, which have no events."""

MOST_SETS, MOST_BYTES = 2000, 2**29
"""Sets of closed contacts that are kept of a structure at one α and µ; and of all α, if each has :data:`_ROOM`."""

_ROOM = 4
"""Sets for which a table has room at first."""

T = TypeVar("T")


class SharedSets:
    """What the sets of closed contacts of a structure at one µ and duration have at all α."""

    def __init__(self, basis: ContactBasis, friction: float, duration: float):
        self.basis, self._conditions = basis, (friction, duration)
        self._sets: dict[bytes, SetAnyAlpha] = {}

    def fill(self, row: Array, closed: NDArray[np.bool_], alpha: float) -> bool:
        """Store a set at one α in a row; whether its poles can be separated."""
        key = closed.tobytes()
        if key not in self._sets:
            self._sets[key] = SetAnyAlpha(self.basis, closed, *self._conditions)
        return self._sets[key].fill(row, alpha)


class SetTable:
    """The sets of closed contacts that are known of a structure at one α, µ and duration; threads add in turns."""

    def __init__(self, shared: SharedSets, alpha: float):
        self._shared, self._alpha, length = shared, alpha, row_length(shared.basis)
        self.most = max(1, min(MOST_SETS, MOST_BYTES // (8 * length)))
        room = min(_ROOM, self.most)
        self._rows = np.empty((room, length))
        self._closed = np.zeros((room, shared.basis.contacts.count), dtype=np.bool_)
        self.count, self._lock = 0, Lock()

    def known(self) -> Sets:
        """Return all sets; they do not change."""
        return Sets(self._rows[: self.count], self._closed[: self.count])

    def add(self, closed: NDArray[np.bool_]) -> int:
        """Add a set, if it is not there; return how a case ends that cannot have it, 0 else."""
        with self._lock:
            if (self._closed[: self.count] == closed).all(axis=1).any():
                return 0
            if self.count == self.most:
                return TOO_MANY_SETS
            if self.count == len(self._rows):
                self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
                self._closed = np.concatenate([self._closed, np.zeros_like(self._closed)])
            if not self._shared.fill(self._rows[self.count], closed, self._alpha):
                return INSEPARABLE
            self._closed[self.count] = closed
            self.count += 1
            return 0


@dataclass(frozen=True, eq=False)
class ContactOperator:
    """Common data of the cases of a batch; ``budget`` limits events and steps of one case."""

    basis: ContactBasis
    budget: Budget
    sensors: Sensors | None = None
    _shared: dict[tuple[float, ...], SharedSets] = field(default_factory=dict)
    _tables: dict[tuple[float, ...], SetTable] = field(default_factory=dict)

    @cached_property
    def bases(self) -> tuple[ContactBasis, ContactBasis]:
        """The basis without and with thermal modes."""
        return self.basis.unheated, self.basis

    @cached_property
    def structures(self) -> tuple[Contacting, Contacting]:
        """The same as kernels take them."""
        cold, warm = self.bases
        return contacting(cold), contacting(warm)

    def sets(self, heated: bool, alpha: float, *conditions: float) -> SetTable:
        """Return the table of sets at one α, µ and duration; one is made where there is none, the oldest may go."""
        basis = self.bases[heated]
        most = MOST_BYTES // (8 * _ROOM * row_length(basis))
        shared = _kept(self._shared, (heated, *conditions), lambda: SharedSets(basis, *conditions), most)
        return _kept(self._tables, (heated, alpha, *conditions), lambda: SetTable(shared, alpha), most)


def _kept(known: dict[tuple[float, ...], T], key: tuple[float, ...], make: Callable[[], T], most: int) -> T:
    """Return what is known at a key; it is made where there is none, and the oldest go beyond ``most``."""
    found = known.get(key)
    if found is None:
        for oldest in list(known)[: max(0, len(known) + 1 - max(1, most))]:
            known.pop(oldest, None)
        found = known.setdefault(key, make())
    return found


def make_contact_operator(structure: Structure, budget: Budget) -> ContactOperator:
    """Return the modes of a structure with several contacts, or contacts without mass."""
    return ContactOperator(analyse_contacts(structure), budget, structure.sensors)


def run_contact_batch(operator: ContactOperator, cases: Cases, sampling: Sampling) -> Results:
    """Run all cases that are finite, those of one α and µ after each other, as they share sets."""
    periods = complete_periods(cases.period_frequency, sampling)
    basis, record = operator.basis, record_of(cases, sampling, periods, operator.basis.sensors)
    record.tally["next_sample"] = 1
    fill_first_sample(record, basis, cases)
    progress, ended = np.zeros(cases.count, dtype=PROGRESS), np.full(cases.count, INVALID)
    modal = np.full((cases.count, basis.size), np.nan)
    finite = np.flatnonzero(cases.finite)
    first, variant = distinct_rows(*(row[finite, None] for row in (cases.alpha, cases.friction, cases.heated)))
    outcome = Outcome(with_contacts(record, basis), progress, ended)
    order, heats = np.argsort(variant, kind="stable"), cases.heated[finite[first]]
    groups = np.split(finite[order], np.searchsorted(variant[order], np.arange(1, first.size)))
    for heated in np.unique(heats).tolist():
        conditions = conditions_of(operator.bases[heated], cases, sampling.duration, operator.budget)
        own = memory(operator.bases[heated], conditions.waves.shape[1], _ROOM)
        for which in (groups[k] for k in np.flatnonzero(heats == heated)):
            i = which[0]
            table = operator.sets(heated, float(cases.alpha[i]), float(cases.friction[i]), sampling.duration)
            own = _march(table, operator.structures[heated], conditions, which, outcome, own)
            reached = conditions.modal[which]
            modal[which, : reached.shape[1]] = reached
            modal[which, reached.shape[1] :] = 0.0
    completed, steps = ended == COMPLETED, progress["steps"]
    displacement = record.histories[:, 0].reshape(cases.count, basis.contacts.count, -1)
    depth = _penetration(basis, cases, displacement, sampling)
    closing = project(static_growth(basis), modal[:, 2 * basis.frequency.size :]).max(axis=1)
    return results_of(
        record,
        cases,
        periods,
        operator.sensors,
        events=events_of(record, np.where(completed, progress["listed"], np.nan)),
        metrics=metrics_of(record, sampling, completed, steps, depth, closing),
        status=status_of(ended),
        end=state_of(basis.shapes, basis.heat_shapes, modal),
        messages={
            int(i): _failure(int(ended[i]), progress[i], operator, np.abs(record.histories[i, 2, ..., 0]).max())
            for i in np.flatnonzero(~completed)
        },
    )


def _march(
    table: SetTable,
    structure: Contacting,
    conditions: ContactCase,
    which: NDArray[np.int64],
    outcome: Outcome,
    own: Memory,
) -> Memory:
    """March cases of one α and µ; the kernel stops at each set that is not known yet, which is made."""
    sets, at = table.known(), 0
    while True:
        own = _with_room(own, len(sets.closed))
        at = run_contacts(sets, structure, conditions, which, at, outcome, own)
        if at == which.size:
            return own
        fault = table.add(own.wanted)
        if fault:
            outcome.ended[which[at]] = fault
            at += 1
        sets = table.known()


def with_contacts(record: Record, basis: ContactBasis) -> Record:
    """Return views of the arrays of results with an axis of contacts, of one contact too."""
    contacts = basis.contacts.count
    return Record(
        record.times,
        record.period_ends,
        record.histories.reshape(*record.histories.shape[:2], contacts, -1),
        record.periods.reshape(*record.periods.shape[:2], contacts, record.periods.shape[-1]),
        record.tally.reshape(-1, contacts),
        record.asked,
    )


def _with_room(own: Memory, sets: int) -> Memory:
    """Return memory for the motions in so many sets; those that are there stay."""
    if sets <= len(own.filled):
        return own
    more = max(sets, 2 * len(own.filled)) - len(own.filled)
    tables = np.concatenate([own.tables, np.zeros((more, own.tables.shape[1]))])
    return own._replace(tables=tables, filled=np.concatenate([own.filled, np.zeros(more, dtype=np.bool_)]))


def fill_first_sample(record: Record, basis: ContactBasis, cases: Cases) -> None:
    """Write the initial state."""
    rows = basis.contacts.normal, basis.contacts.normal, basis.contacts.heat
    for k, (row, states) in enumerate(zip(rows, (cases.displacement, cases.velocity, cases.temperature), strict=True)):
        record.histories[:, k, ..., 0] = project(row, states).reshape(record.tally.shape)
    record.histories[:, 3, ..., 0] = 0.0
    modal = [project(basis.to_modes, cases.displacement), project(basis.to_thermal, cases.temperature)]
    record.asked.sensed[:, :, 0] = project(basis.sensors, np.hstack(modal))
    if basis.contacts.is_compliant:
        record.histories[:, 0, ..., 0] = _compliant_places(basis, cases).reshape(record.tally.shape)


def _compliant_places(basis: ContactBasis, cases: Cases) -> Array:
    """Return x_i of compliant contacts at t = 0, m, ``(case, contact)``: d + c λ where they touch; NaN without a λ."""
    contacts, (place, _) = basis.contacts, cases.casing_of_contacts(0.0)
    tau = project(basis.to_thermal, cases.temperature)
    free = project(contacts.normal, cases.displacement) - project(basis.residual_coupling, tau)
    free += cases.load_at(0.0)[:, None] * basis.residual_load
    for i in np.flatnonzero((free > place).any(axis=1)):
        friction, c = float(cases.friction[i]), contacts.casing_flexibility
        force = complementarity(contacts.compliance(friction), place[i] - free[i])
        yields = np.nan if force is None else free[i] - contacts.flexibility(friction) @ force
        free[i] = yields if force is None else np.where(force > 0, place[i] + c * force, yields)
    return free


@np.errstate(over="ignore", invalid="ignore")  # of a case that is not finite
def conditions_of(basis: ContactBasis, cases: Cases, duration: float, budget: Budget = UNLIMITED) -> ContactCase:
    """Return the conditions of cases over a time [s]: a sinusoid of frequency 0 is a constant."""
    own, m, turns = cases.casing_harmonics, basis.contacts.count, cases.turns
    mean, _, waves, acting, which = loads_of(cases, own)
    phase = turns + own.phase[:, None]
    still = np.where(own.frequency == 0, own.amplitude, 0.0)[:, None] * _sine_cosine(phase)[0]
    ahead = np.concatenate([np.zeros((cases.count, m, cases.load_harmonics.width)), turns], axis=2)
    sin, cos = _sine_cosine(np.take_along_axis(ahead, which[:, None], axis=2).swapaxes(1, 2))
    casing = waves[:, :, wave.CASING, None, None] * np.stack([sin, cos], axis=2)
    states = [project(basis.to_modes, cases.displacement), project(basis.to_modes, cases.velocity)]
    loads = [project(basis.shapes.T, cases.steady), project(basis.heat_shapes.T, cases.heating), mean[:, None]]
    return ContactCase(
        e=np.array(cases.e),
        alpha=np.array(cases.alpha),
        friction=np.array(cases.friction),
        constant=np.hstack([*loads, cases.clearances + still.sum(axis=2), np.zeros((cases.count, 2 * m))]),
        waves=waves,
        acting=acting,
        casing=casing,
        modal=np.hstack([*states, project(basis.to_thermal, cases.temperature)]),
        reach=np.abs(cases.clearances).max(axis=1) + own.reach,
        duration=duration,
        budget=budget,
        flexibility=np.full(cases.count, basis.contacts.casing_flexibility),
    )


def _sine_cosine(angle: Array) -> tuple[Array, Array]:
    """Return sine and cosine of angles of any shape."""
    sin, cos = elementwise.sine_cosine(angle.ravel())
    return sin.reshape(angle.shape), cos.reshape(angle.shape)


def _failure(ended: int, progress: Any, operator: ContactOperator, warmest: float) -> str:
    """Return the message of a case that did not complete; the warmest contact has this temperature at the start."""
    at, names = f"at t = {progress['time']:.6g} s", ", ".join(operator.basis.contacts.labels)
    own = {
        TOO_MANY_SETS: f"stopped {at}: it meets more than {MOST_SETS} sets of closed contacts, or more than "
        f"{MOST_BYTES // 2**20} MB of them; take contacts without mass, fewer contacts, or moreau",
        NO_IMPACT_LAW: f"contact has no unique solution {at}, contacts {names}: lower the friction coefficient",
        INSIDE_CASING: f"a contact starts beyond its casing, of contacts {names}{run_away_text(warmest)}",
        OUT_OF_EVENTS: f"stopped {at} after {operator.budget.events} contact events, its budget: contacts with mass "
        "open each other again and again; take contacts without mass, or raise the scheme's option `events`",
    }
    if ended in own:
        return own[ended]
    tally = {"time": progress["time"], "speed": 0.0, "impacts": 0, "max_temperature": warmest}
    return failure_text(ended, tally, operator.budget, 0.0)


def static_growth(basis: ContactBasis) -> Array:
    """Return the quasi-static motion of each contact per τ, m, ``(contact, thermal mode)``, of modes that are held."""
    held = basis.frequency > 0
    flexible = basis.normal[:, held] / basis.frequency[held] ** 2
    return np.asarray(-flexible @ basis.coupling[held] - basis.residual_coupling)


def _penetration(basis: ContactBasis, cases: Cases, displacement: Array, sampling: Sampling) -> Array:
    """Return the largest penetration of the samples of each contact, m, ``(case, contact)``."""
    conditions = conditions_of(basis, cases, sampling.duration)
    m = basis.contacts.count
    place = np.repeat(conditions.constant[:, -3 * m : -2 * m, None], sampling.count, axis=2)
    for i in range(conditions.waves.shape[1]):
        omega, phase = conditions.waves[:, i, :2].T[:, :, None]
        sin, cos = elementwise.sine_cosine(omega * sampling.times + phase)
        a, b = conditions.casing[:, i, :, :, None].swapaxes(0, 1)
        place += a * cos[:, None] + b * sin[:, None]
    with np.errstate(invalid="ignore"):
        return np.asarray(np.maximum(0.0, np.max(displacement - place, axis=2)))
