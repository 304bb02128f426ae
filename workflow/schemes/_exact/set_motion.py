"""The motion of a case in a set of closed contacts.

The motion of a set is that of :mod:`workflow.schemes._exact.motion`: blocks and first-order states less the particular
solution of the loads, with a signal and a temperature of each contact. An impulse is a jump in its coordinates; the
state X = [y, y', τ] of the contacts open is made where another set is entered, or where it is asked for.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import inlined, part
from workflow.kernels.lemke import Complementarity, problem
from workflow.kernels.packs import view
from workflow.models import ContactBasis
from workflow.schemes._exact.closed_sets import ClosedSet, closed_set_in
from workflow.schemes._exact.motion import (
    ORDER,
    OUTPUTS,
    PLACE,
    SIGNAL,
    Expansion,
    LoadedTables,
    Motion,
    add_load_outputs,
    casing_at,
    copy_tables,
    fastest_of,
    fill_force,
    fill_wave_force,
    from_coordinates,
    loaded_size,
    loaded_tables,
    place_of,
    seen_by,
    subtract_loads,
    to_coordinates,
)
from workflow.schemes._exact.tables import block, expansion, first, padded, seen, seen_wave, state, wave


class Budget(NamedTuple):
    """Largest number of events and of certified steps of a case."""

    events: int
    steps: int


class Thresholds(NamedTuple):
    """Internal tolerances of chattering, varied by tests only."""

    height: float
    """Height of flights v²/(2|a|), over the displacement scale, below which chattering is summed: its error is of this
    size."""
    speed: float
    """Impact speed, over the largest one, below which chattering is summed: at 5e-3 the error of the heavy
    chain was 4e-10, and it falls about quadratically."""
    force: float
    """Contact force, over the rounding of its terms, below which it is zero."""


YIELD_FORCE, HARDENING, SECTORS, SPEED, FLEXIBILITY, EVERY = range(6)
"""Numbers of :attr:`Coat.law`."""


class Coat(NamedTuple):
    """The coating of the casing in one case, or those of a batch, where arrays have one more axis before."""

    law: Array
    """F_y [N], H [N/m], N, Ω/2π [1/s], c [m/N], and the revolutions from one row of the map to the next."""
    turns: Array
    """ϑ/2π of each contact at t = 0, ``(contact,)``."""
    push: Array
    """Change of the constant inputs of a set by a constant force at a contact, per N, ``(contact, input)``."""
    worn: Array
    """w of the sectors, m, ``(contact, sector)``; those that a contact crushes grow."""
    map: Array
    """w at the ends of revolutions, m, ``(contact, revolution, sector)``."""
    border_work: Array
    """What borders have given so far, J, ``(contact,)``."""
    deepest: Array
    """Largest x - d of a contact that crushes, m, ``(contact,)``."""


class Case(NamedTuple):
    """Conditions of one case with m contacts, or those of a batch, where arrays have one more axis before."""

    variant: Any
    """Number of its α among the sets."""
    e: Any
    alpha: Any
    """α, W/N."""
    constant: Array
    """Constant inputs [g, q, F, d, d', d''] of a set, ``(input,)``; g and d include the mean load and the gaps."""
    waves: Array
    """Ω, φ, A and 0 of each wave, ``(wave, GIVEN)``, with the columns of ``tables.wave``."""
    acting: Any
    """Number of waves: the rows after them are 0."""
    casing: Array
    """Coefficients of cos ψ and sin ψ of d_i by each wave, m, ``(wave, 2, contact)``."""
    modal: Array
    """X = [y, y', τ] at the beginning; the march leaves there the state at the end, ``(N,)``."""
    reach: Any
    """Largest |d_i| plus the amplitudes of the casing, m."""
    duration: float
    """End of the case, s."""
    budget: Budget
    thresholds: Thresholds
    flexibility: Any
    """c of an elastic casing, m/N; 0 for a rigid one."""
    coat: Any = None
    """:class:`Coat`; ``None`` without a coating."""


CONTACT = np.dtype(
    [
        ("signal", "f8"),  # at the present time: gap, m, or force, N, …
        ("rate", "f8"),
        ("temperature", "f8"),  # … and K
        ("approach", "f8"),  # u = w y' - d' in an event, m/s, …
        ("before", "f8"),  # … and before it
        ("impulse", "f8"),  # of a step or an impact, N s
        ("taken", "f8"),  # impulse in the last event, N s
        ("force", "f8"),  # λ after an event, N
        ("bounces", "f8"),  # time of the bounces after it that are not followed, s
        ("shift", "f8"),  # by which d is moved in its signal: w where its coating is elastic, m
        ("pressed", "f8"),  # constant force that acts besides its signal, N
        ("worn", "f8"),  # w of the sector of the coating that it is in, m
        ("until", "f8"),  # time of the next border at which another w counts, s …
        ("sector", "i8"),  # number of the sector that it is in, N more after each revolution …
        ("ahead", "i8"),  # … and of the one behind that border
        ("crushes", "?"),  # whether it crushes its coating
        ("kind", "i8"),  # what becomes of the contact in an event
        ("member", "i8"),  # contact of this place in a complementarity problem
        ("closed", "i1"),  # how it is closed in the present set, or in the one that is entered next, …
        ("wanted", "i1"),  # … and in a set that the march waits for, or decides for: see :attr:`.events.Sets.closed`
    ],
    align=True,
)
"""What a march keeps of each contact."""

WATCHED = np.dtype(
    [
        ("certified", "f8"),  # time until which it has certainly no zero, s; -1 where it is not known
        ("speed", "f8"),  # its rate at the last event, where an impact gives it; else -1
        ("zeros", "i8"),  # order of its zero there, see :mod:`.step`; -1 where a force may begin at 0
        ("still", "?"),  # gap of a contact that touches its casing, and nothing moves it in the present set
    ],
    align=True,
)
"""What a march keeps of each signal that is searched for a zero."""

AT_LEVEL = 256.0 * 2.220446049250313e-16
"""Force above F_y + H w, over it, from which a coating yields: 64 times the rounding of a sum."""

HELD, SIZE, PUSH, ROUNDING = range(0, 8, 2)
"""Rows of :attr:`Memory.signals`; each has that of the rate below it."""


class Memory(NamedTuple):
    """Working memory of the case that is marched."""

    tables: Array
    """Tables of the motion in each set that the case has met, ``(place, number)``."""
    slots: NDArray[np.int64]
    """Row of the set of each place; -1 where there is none, less where its tables are to be filled, ``(place,)``."""
    states: Array
    """Now, after and between of the present set and of a set on trial, ``(2, number)``; as ``sums`` and ``terms``, they
    differ in size from set to set."""
    sums: Array
    terms: Array
    derivatives: Array
    explicit: Array
    differences: Complex
    coordinates: Array
    modes: Array
    """[z, z', τ] of a set; scratch."""
    modal: Array
    """X = [y, y', τ] where a set was left, ``(N,)``."""
    inputs: Array
    """Sources and signals by constant loads, and by cos ψ and sin ψ of each wave, ``(1 + 2 wave, N + m)``; scratch."""
    contacts: Any
    """:data:`CONTACT`, ``(contact,)``."""
    watched: Any
    """:data:`WATCHED`, ``(signal,)``: the signals of the contacts in their order and, with a coating, the second ones:
    F_y + H w - λ where it is elastic, w' where it is crushed."""
    constant: Array
    """Constant inputs with what contacts add to them, ``(input,)``; scratch."""
    signals: Array
    """In a decision: forces in the present set, and the sum of the magnitudes of their terms; w (g - c y' - ω² y - G τ)
    - d'', of compliant contacts d - x without forces, and up to which it is 0; with their rates, ``(8, contact)``."""
    problem: Complementarity


def memory(basis: ContactBasis, waves: int, places: int, coated: bool = False) -> Memory:
    """Return memory for a case with up to so many waves, and motions in so many sets."""
    N, m = basis.size, basis.contacts.count
    columns, wide, signals = padded(N // 2), padded(N), 2 * m if coated else m
    return Memory(
        tables=np.zeros((places, loaded_size(columns, wide, waves, signals) + 2)),
        slots=np.full(places, -1),
        states=np.zeros((2, 3 * state.ROWS * max(columns, wide))),
        sums=np.zeros(expansion.ROWS * (columns + 1)),
        terms=np.zeros(expansion.ROWS * columns),
        derivatives=np.zeros(ORDER + 1),
        explicit=np.zeros(ORDER + 2),
        differences=np.zeros((9, 4), dtype=np.complex128),
        coordinates=np.zeros(N),
        modes=np.zeros(N),
        modal=np.zeros(N),
        inputs=np.zeros((1 + 2 * waves, padded(N + m))),
        contacts=np.zeros(m, dtype=CONTACT),
        watched=np.zeros(signals, dtype=WATCHED),
        constant=np.zeros(basis.inputs),
        signals=np.zeros((8, m)),
        problem=problem(signals),
    )


def with_room(own: Memory, places: int) -> Memory:
    """Return memory for motions in so many sets; those that are there stay."""
    more = places - own.slots.size
    tables = np.concatenate([own.tables, np.zeros((more, own.tables.shape[1]))])
    return own._replace(tables=tables, slots=np.concatenate([own.slots, np.full(more, -1)]))


class SetMotion(NamedTuple):
    """The motion of a case in a set, as the first contact sees it, and what relates its coordinates to X."""

    m: Motion
    is_linked: bool
    is_open: bool
    null: Array
    place: Array
    inward: Array
    outward: Array
    jump: Array
    """As in :class:`~workflow.schemes._exact.closed_sets.ClosedSet`."""


@part
def tables_of(own: Memory, slot: int) -> int:
    """Return the place of the motion in a set, a new one if there is room; -1 else."""
    for k in range(own.slots.size):
        if own.slots[k] == slot or own.slots[k] == -2 - slot:
            return k
        if own.slots[k] == -1:
            own.slots[k] = -2 - slot  # its tables are to be filled
            return k
    return -1


@part
def motion_in(row: Array, case: Case, own: Memory, place: int, bank: int) -> SetMotion:
    """Return the motion of a case in a set, its tables filled; states are those of a bank, 1 for a set on trial."""
    s = closed_set_in(row)
    columns, wide, waves, signals = s.block.shape[1], s.first.shape[1], case.acting, own.watched.size
    numbers, states = own.tables[place], own.states[bank]
    loaded, at = loaded_tables(numbers, columns, wide, waves, signals)
    counts = numbers[at : at + 2]
    if own.slots[place] < -1:
        own.slots[place] = -2 - own.slots[place]
        for i in range(at + 2):
            numbers[i] = 0.0
        _fill(s, case, own, loaded, counts)
    most = max(columns, wide)
    size, (rows, slow, across) = state.ROWS * most, place_of(waves, 0)
    sums, terms = view(own.sums, 0, (expansion.ROWS, s.blocks + 1)), view(own.terms, 0, (expansion.ROWS, columns))
    m = Motion(
        s.blocks,
        s.firsts,
        int(counts[0]),
        int(counts[1]),
        loaded.block,
        loaded.first,
        loaded.outputs,
        loaded.waves,
        own.differences,
        Expansion(sums, terms, own.derivatives, own.explicit),
        view(states, 0, (state.ROWS, most)),
        view(states, size, (state.ROWS, most)),
        view(states, 2 * size, (state.ROWS, most)),
        s.growth,
        fastest_of(s.fastest, loaded.waves),
        s.inward.shape[0] > 2 * s.null.shape[1],
        not s.is_linked and s.growth <= 0.0,
        0,
        rows,
        slow,
        across,
    )
    return SetMotion(m, s.is_linked, s.is_open, s.null, s.place, s.inward, s.outward, s.jump)


@part
def _fill(s: ClosedSet, case: Case, own: Memory, loaded: LoadedTables, counts: Array) -> None:
    """Fill the tables of a motion, which are 0."""
    b, f, _, waves = loaded
    n, inputs = s.blocks, own.inputs
    copy_tables(s.block, s.first, case.waves, loaded)
    _fill_constant(case.coat, case, own)
    _constant_sources(s, own.constant, inputs[0])
    for k in range(n):
        fill_force(b, k, inputs[0, k], inputs[0, n + k])
    for j in range(s.firsts):
        f[first.SOURCE, j] = inputs[0, 2 * n + j]
    for i in range(waves.shape[0]):
        cos, sin, row = inputs[1 + 2 * i], inputs[2 + 2 * i], i * first.WAVE
        _wave_sources(s, case, i, cos, sin)
        for k in range(n):
            fill_wave_force(b, k, i, waves[i, wave.OMEGA], (cos[k], sin[k]), (cos[n + k], sin[n + k]))
        for j in range(s.firsts):
            f[first.HARMONIC_COS + row, j], f[first.HARMONIC_SIN + row, j] = cos[2 * n + j], sin[2 * n + j]
    explicits, aperiodics = subtract_loads(loaded, n, s.firsts, case.duration)
    counts[0], counts[1] = explicits, aperiodics
    for c in range(s.place.shape[0]):
        _fill_outputs(s, case, inputs, loaded, c)
        loaded.outputs[OUTPUTS * c + PLACE] += own.contacts[c].shift
        add_load_outputs(loaded, n, s.firsts, explicits, c)
        _watch_coat(case.coat, s, own, loaded, explicits, c)


@part
def _fill_outputs(s: ClosedSet, case: Case, inputs: Array, loaded: LoadedTables, c: int) -> None:
    """Fill the signal, the temperature and the casing of a contact."""
    b, f, outputs, waves = loaded
    rows, slow, columns = place_of(waves.shape[0], c)
    size = 2 * s.blocks + s.firsts
    outputs[OUTPUTS * c + SIGNAL] = inputs[0, size + c]
    outputs[OUTPUTS * c + PLACE] = case.constant[case.constant.size - 3 * s.place.shape[0] + c]
    for o in range(4):
        for k in range(b.shape[1]):
            b[rows + seen.SIGNAL_VALUE + o, k] = s.outputs[c, o, k]
    for o in range(2):
        for j in range(f.shape[1]):
            f[slow + o, j] = s.slow_outputs[c, o, j]
    for i in range(waves.shape[0]):
        row, cos, sin = waves[i, columns : columns + seen_wave.COLUMNS], inputs[1 + 2 * i], inputs[2 + 2 * i]
        row[seen_wave.SIGNAL_COS], row[seen_wave.SIGNAL_SIN] = cos[size + c], sin[size + c]
        row[seen_wave.CASING_COS], row[seen_wave.CASING_SIN] = case.casing[i, 0, c], case.casing[i, 1, c]


@part
def _fill_constant(coat: Coat | None, case: Case, own: Memory) -> None:
    """Fill the constant inputs, with what contacts with a coating add to them."""
    out, contacts = own.constant, own.contacts.size
    for i in range(case.constant.size):
        out[i] = case.constant[i]
    if coat is not None:
        for c in range(contacts):
            out[out.size - 3 * contacts + c] += own.contacts[c].shift
            for i in range(out.size if own.contacts[c].crushes else 0):
                out[i] += own.contacts[c].pressed * coat.push[c, i]


@part
def _watch_coat(coat: Coat | None, s: ClosedSet, own: Memory, loaded: LoadedTables, explicits: int, c: int) -> None:
    """Fill the second signal of a contact: F_y + H w - λ, or w' where it crushes: the rate of its first per x - d."""
    if coat is None:
        return
    b, f, outputs, waves = loaded
    each, second = own.contacts[c], own.contacts.size + c
    (rows, slow, columns), (level, after, across) = place_of(waves.shape[0], c), place_of(waves.shape[0], second)
    if each.crushes:
        per = travel(coat) / (1.0 + coat.law[FLEXIBILITY] * coat.law[HARDENING])
        for k in range(s.blocks):
            value, slope = b[rows + seen.SIGNAL_VALUE, k], b[rows + seen.SIGNAL_SLOPE, k]
            b[level + seen.SIGNAL_VALUE, k] = -per * b[block.STIFFNESS, k] * slope
            b[level + seen.SIGNAL_SLOPE, k] = per * (value - b[block.DAMPING, k] * slope)
        for j in range(s.firsts):
            f[after, j] = -per * f[first.RATE, j] * f[slow, j]
            outputs[OUTPUTS * second] += per * f[first.SOURCE, j] * f[slow, j]
        for i in range(waves.shape[0]):
            omega = per * waves[i, wave.OMEGA]
            waves[i, across + seen_wave.SIGNAL_COS] = omega * waves[i, columns + seen_wave.SIGNAL_SIN]
            waves[i, across + seen_wave.SIGNAL_SIN] = -omega * waves[i, columns + seen_wave.SIGNAL_COS]
        for e in range(explicits):  # their η'' has the force
            k = int(b[block.EXPLICIT_COLUMNS, e])
            slope = per * b[rows + seen.SIGNAL_SLOPE, k]
            outputs[OUTPUTS * second] += slope * b[block.FORCE, k]
            for i in range(waves.shape[0]):
                waves[i, across + seen_wave.SIGNAL_COS] += slope * b[block.FORCE_COS + i * block.WAVE, k]
                waves[i, across + seen_wave.SIGNAL_SIN] += slope * b[block.FORCE_SIN + i * block.WAVE, k]
    elif each.closed != 0:
        for row in (seen.SIGNAL_VALUE, seen.SIGNAL_SLOPE):
            for k in range(s.blocks):
                b[level + row, k] = -b[rows + row, k]
        for j in range(s.firsts):
            f[after, j] = -f[slow, j]
        outputs[OUTPUTS * second] = yield_level(coat, each.worn, True) - outputs[OUTPUTS * c]
        for i in range(waves.shape[0]):
            for column in (seen_wave.SIGNAL_COS, seen_wave.SIGNAL_SIN):
                waves[i, across + column] = -waves[i, columns + column]


@inlined
def travel(coat: Coat) -> float:
    """Return x - d per signal of a contact that crushes: its force less the constant one; d - x without hardening."""
    hardening = coat.law[HARDENING]
    return float(coat.law[FLEXIBILITY] + 1.0 / hardening) if hardening > 0.0 else -1.0


@inlined
def yield_level(coat: Coat, worn: float, beyond: bool) -> float:
    """Return F_y + H w; ``beyond`` its rounding, so that a contact at rest on it stays."""
    level = float(coat.law[YIELD_FORCE] + coat.law[HARDENING] * worn)
    return level * (1.0 + AT_LEVEL) if beyond else level


@part
def _constant_sources(s: ClosedSet, inputs: Array, out: Array) -> None:
    """Fill out = inputs · source."""
    for r in range(s.source.shape[1]):
        out[r] = 0.0
    for i in range(inputs.size):
        if inputs[i] != 0.0:
            for r in range(s.source.shape[1]):
                out[r] += inputs[i] * s.source[i, r]


@part
def _wave_sources(s: ClosedSet, case: Case, i: int, by_cos: Array, by_sin: Array) -> None:
    """Fill the sources and signals by cos ψ and sin ψ of wave ``i``."""
    contacts, omega = s.place.shape[0], case.waves[i, wave.OMEGA]
    at, width = s.source.shape[0] - 3 * contacts, s.source.shape[1]
    for r in range(width):
        by_cos[r], by_sin[r] = 0.0, case.waves[i, wave.LOAD] * s.source[at - 1, r]
    for c in range(contacts):
        cos, sin = case.casing[i, 0, c], case.casing[i, 1, c]
        if cos != 0.0 or sin != 0.0:
            d, rate, bend = at + c, at + contacts + c, at + 2 * contacts + c
            for r in range(width):
                still = s.source[d, r] - omega * omega * s.source[bend, r]
                turning = omega * s.source[rate, r]
                by_cos[r] += cos * still + sin * turning
                by_sin[r] += sin * still - cos * turning


@part
def leave(motion: SetMotion, own: Memory, y: Array, t: float) -> None:
    """Fill X = [y, y', τ] of the contacts open from a state of the motion."""
    m, null, Z, X = motion.m, motion.null, own.modes, own.modal
    n, k = null.shape
    to_coordinates(m, y, t, own.coordinates)
    _change(motion.is_linked, motion.outward, own.coordinates, Z, 2 * k)
    for j in range(motion.inward.shape[0] - 2 * k):
        X[2 * n + j] = Z[2 * k + j]
    for i in range(n):
        X[i], X[n + i] = (Z[i], Z[n + i]) if motion.is_open else (0.0, 0.0)
        for j in range(0 if motion.is_open else k):
            X[i] += Z[j] * null[i, j]
            X[n + i] += Z[k + j] * null[i, j]
    for c in range(0 if motion.is_open else motion.place.shape[0]):
        place, speed = casing_at(seen_by(m, c), t)
        for i in range(n):
            X[i] += place * motion.place[c, i]
            X[n + i] += speed * motion.place[c, i]


@part
def enter(motion: SetMotion, own: Memory, t: float) -> None:
    """Set the present state from X = [y, y', τ]."""
    m, null, Z, X = motion.m, motion.null, own.modes, own.modal
    n, k = null.shape
    for i in range(2 * k):
        Z[i] = X[i] if motion.is_open else 0.0
    for j in range(0 if motion.is_open else n):
        for i in range(k):
            Z[i] += X[j] * null[j, i]
            Z[k + i] += X[n + j] * null[j, i]
    for j in range(motion.inward.shape[0] - 2 * k):
        Z[2 * k + j] = X[2 * n + j]
    _change(motion.is_linked, motion.inward, Z, own.coordinates, 2 * k)
    for row in range(state.ROWS):
        for i in range(m.now.shape[1]):
            m.now[row, i] = 0.0
    from_coordinates(m, own.coordinates, t, m.now)


@part
def strike(motion: SetMotion, case: Case, c: int, p: float) -> None:
    """Apply an impulse p [N s] at a contact with its heat: a jump in the coordinates of the set, which stays."""
    m, jump, y = motion.m, motion.jump[c], motion.m.now
    k, heat = m.blocks, p * case.alpha
    for i in range(k):
        y[state.VALUE, i] += p * jump[0, i] + heat * jump[1, i]
        y[state.SLOPE, i] += p * jump[0, k + i] + heat * jump[1, k + i]
    for j in range(m.firsts):
        xi = p * jump[0, 2 * k + j] + heat * jump[1, 2 * k + j]
        y[state.FIRST, j] += xi
        y[state.FIRST_SLOPE, j] -= m.first[first.RATE, j] * xi


@part
def _change(is_linked: bool, matrix: Array, source: Array, target: Array, mechanical: int) -> None:
    """Fill target = source · matrix; of coordinates that are not linked only the rows of heat differ from 1."""
    N = matrix.shape[0]
    for i in range(N):
        target[i] = 0.0 if is_linked else source[i]
    if is_linked:
        for j in range(N):
            for i in range(N):
                target[i] += source[j] * matrix[j, i]
    else:
        for j in range(mechanical, N):
            for i in range(mechanical):
                target[i] += source[j] * matrix[j, i]
