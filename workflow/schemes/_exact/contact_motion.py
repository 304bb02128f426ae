"""The motion of a case in a set of closed contacts, as one of several contacts sees it.

The motion of a set is that of :mod:`workflow.schemes._exact.motion`: blocks and first-order states less the particular
solution of the loads. The tables of a motion have one signal and one temperature; :func:`select` puts those of one
contact there, so that expansion, bounds, search, propagation and record are those of one contact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import inlined, part
from workflow.kernels.lemke import Complementarity, problem
from workflow.models import ContactBasis
from workflow.schemes._exact.closed_sets import ClosedSet
from workflow.schemes._exact.layout import Budget
from workflow.schemes._exact.motion import (
    ORDER,
    PLACE,
    SIGNAL,
    TEMPERATURE,
    Expansion,
    LoadedTables,
    Motion,
    add_harmonic_outputs,
    add_particular_outputs,
    fill_unforced,
    from_coordinates,
    is_explicit,
    subtract_harmonics,
    subtract_particular,
    table,
    to_coordinates,
)
from workflow.schemes._exact.tables import block, expansion, first, padded, state, wave

_SHOWN = block.SIGNAL_INTEGRAL + 1 - block.SIGNAL_VALUE
"""Rows of the table of blocks that depend on the contact, from ``SIGNAL_VALUE`` on."""

_WAVE_SHOWN = wave.CASING_COS + 1 - wave.SIGNAL_COS
"""Columns of the table of waves that depend on the contact, from ``SIGNAL_COS`` on; and ``CASING``."""


class ContactCase(NamedTuple):
    """Conditions of one case with m contacts, or those of a batch, where arrays have one more axis before."""

    e: Any
    alpha: Any
    friction: Any
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
    budget: Budget
    flexibility: Any
    """c of an elastic casing, m/N; 0 for a rigid one."""


class Contacting(NamedTuple):
    """A structure with its contacts open, in modes, as kernels take it."""

    frequency: Array
    damping: Array
    """c, ``(1, mode)``, or ``(mode, mode)`` where damping couples modes."""
    coupling: Array
    rate: Array
    normal: Array
    tangent: Array
    heat: Array
    load: Array
    """φᵀ b, ``(mode,)``."""
    delassus: Array
    """w wᵀ, or R + c of compliant contacts, ``(contact, contact)`` …"""
    tangential: Array
    """… and their decrease per friction coefficient."""
    residual_load: Array
    residual_coupling: Array
    compliant: bool


def contacting(basis: ContactBasis) -> Contacting:
    """Return the arrays of a basis for kernels."""
    own, compliant = basis.contacts, basis.contacts.is_compliant
    operator, tangential = basis.delassus(0.0), basis.normal @ basis.tangent.T
    if compliant:
        operator, tangential = own.compliance(0.0), own.flexibility(0.0) - own.flexibility(1.0)
    return Contacting(
        basis.frequency,
        np.atleast_2d(basis.damping),
        np.ascontiguousarray(basis.coupling),
        basis.rate,
        np.ascontiguousarray(basis.normal),
        np.ascontiguousarray(basis.tangent),
        np.ascontiguousarray(basis.heat),
        basis.load,
        np.ascontiguousarray(operator),
        np.ascontiguousarray(tangential),
        basis.residual_load,
        np.ascontiguousarray(basis.residual_coupling),
        compliant,
    )


class Memory(NamedTuple):
    """Working memory of the case that is marched."""

    tables: Array
    """Tables of the motion in each set, ``(set, number)``."""
    filled: NDArray[np.bool_]
    """Whether they are those of this case, ``(set,)``."""
    states: Array
    """Now, after and between, one after the other; as ``sums`` and ``terms``, they differ in size from set to set."""
    sums: Array
    terms: Array
    derivatives: Array
    explicit: Array
    differences: Complex
    coordinates: Array
    modal: Array
    """X = [y, y', τ] at the last event, ``(N,)``."""
    inputs: Array
    """Sources and signals by constant loads, cos ψ and sin ψ of a wave, ``(3, N + m)``; scratch."""
    wanted: NDArray[np.bool_]
    """Contacts that are closed from the last event on, ``(contact,)``."""
    zeros: NDArray[np.int64]
    """Order of the zero of each signal at the last event, see :mod:`.step`; -1 where a force may begin at 0."""
    speed: Array
    """Rate of the signal there, where an impact gives it; else -1, ``(contact,)``."""
    approach: Array
    """u = w y' - d', m/s, ``(contact,)``."""
    distance: Array
    """d - w y, m, ``(contact,)``."""
    casing: Array
    """d and its first three derivatives, ``(4, contact)``."""
    push: Array
    """w (g - c y' - ω² y - G τ) - d'' and its rate, ``(2, contact)``."""
    rounding: Array
    """Of the first of these, ``(contact,)``."""
    impulse: Array
    """p, N s, ``(contact,)``."""
    taken: Array
    """u before the last event, m/s, and the impulse in it, N s, ``(2, contact)``."""
    force: Array
    """λ, N, ``(contact,)``."""
    acceleration: Array
    """g - c y' - ω² y - G τ, ``(2, mode)``; the second row is scratch."""
    members: NDArray[np.int64]
    """Contacts of a complementarity problem; scratch."""
    kinds: NDArray[np.int64]
    """What becomes of each contact at an event; scratch."""
    problem: Complementarity


def memory(basis: ContactBasis, waves: int, sets: int) -> Memory:
    """Return memory for a case with up to so many waves, and motions in so many sets."""
    N, n, m = basis.size, basis.frequency.size, basis.contacts.count
    columns, wide = padded(N // 2), padded(N)
    tables = (block.ROWS + block.WAVE * waves) * columns + (first.ROWS + first.WAVE * waves) * wide
    tables += wave.COLUMNS * waves + m * (_SHOWN * columns + 2 * wide + (_WAVE_SHOWN + 1) * waves + 3) + 5
    return Memory(
        tables=np.zeros((sets, tables)),
        filled=np.zeros(sets, dtype=np.bool_),
        states=np.zeros(3 * state.ROWS * max(columns, wide)),
        sums=np.zeros(expansion.ROWS * (columns + 1)),
        terms=np.zeros(expansion.ROWS * columns),
        derivatives=np.zeros(ORDER + 1),
        explicit=np.zeros(ORDER + 2),
        differences=np.zeros((9, 4), dtype=np.complex128),
        coordinates=np.zeros(N),
        modal=np.zeros(N),
        inputs=np.zeros((3, padded(N + m))),
        wanted=np.zeros(m, dtype=np.bool_),
        zeros=np.zeros(m, dtype=np.int64),
        speed=np.zeros(m),
        approach=np.zeros(m),
        distance=np.zeros(m),
        casing=np.zeros((4, m)),
        push=np.zeros((2, m)),
        rounding=np.zeros(m),
        impulse=np.zeros(m),
        taken=np.zeros((2, m)),
        force=np.zeros(m),
        acceleration=np.zeros((2, n)),
        members=np.zeros(m, dtype=np.int64),
        kinds=np.zeros(m, dtype=np.int64),
        problem=problem(m),
    )


class SetMotion(NamedTuple):
    """The motion of a case in a set."""

    m: Motion
    views: Array
    """What :func:`select` copies, ``(contact, number)``."""


@part
def motion_in(s: ClosedSet, case: ContactCase, own: Memory, slot: int) -> SetMotion:
    """Return the motion of a case in the set of a slot, its tables filled."""
    columns, wide, waves, contacts = s.block.shape[1], s.first.shape[1], case.acting, s.place.shape[0]
    numbers = own.tables[slot]
    b, at = table(numbers, 0, block.ROWS + block.WAVE * waves, columns)
    f, at = table(numbers, at, first.ROWS + first.WAVE * waves, wide)
    rows, at = table(numbers, at, waves, wave.COLUMNS)
    views, at = table(numbers, at, contacts, _SHOWN * columns + 2 * wide + (_WAVE_SHOWN + 1) * waves + 3)
    outputs, counts = numbers[at : at + 3], numbers[at + 3 : at + 5]
    if not own.filled[slot]:
        for i in range(numbers.size):
            numbers[i] = 0.0
        _fill(s, case, own, LoadedTables(b, f, outputs, rows), views, counts)
        own.filled[slot] = True
    fastest, most = s.fastest, max(columns, wide)
    for i in range(waves):
        fastest = max(fastest, rows[i, wave.OMEGA])
    sums, _ = table(own.sums, 0, expansion.ROWS, s.blocks + 1)
    terms, _ = table(own.terms, 0, expansion.ROWS, columns)
    now, at = table(own.states, 0, state.ROWS, most)
    after, at = table(own.states, at, state.ROWS, most)
    between, at = table(own.states, at, state.ROWS, most)
    m = Motion(
        s.blocks,
        s.firsts,
        int(counts[0]),
        int(counts[1]),
        b,
        f,
        outputs,
        rows,
        own.differences,
        Expansion(sums, terms, own.derivatives, own.explicit),
        now,
        after,
        between,
        between,
        own.coordinates,
        own.coordinates,
        True,
        s.entry,
        s.exit,
        s.growth,
        fastest,
        2 * s.place.shape[1] < s.entry.shape[0],
        False,
    )
    return SetMotion(m, views)


@part
def _fill(s: ClosedSet, case: ContactCase, own: Memory, loaded: LoadedTables, views: Array, counts: Array) -> None:
    """Fill the tables of a motion, which are 0, and what each contact sees."""
    b, f, outputs, rows = loaded
    for row in range(block.ROWS):
        for k in range(b.shape[1]):
            b[row, k] = s.block[row, k]
    for row in range(first.ROWS):
        for j in range(f.shape[1]):
            f[row, j] = s.first[row, j]
    size, waves = 2 * s.blocks + s.firsts, rows.shape[0]
    _constant_sources(s, case.constant, own.inputs[0])
    _fill_constants(s, own.inputs[0], b, f)
    for i in range(waves):
        for column in range(wave.GIVEN):
            rows[i, column] = case.waves[i, column]
        rows[i, wave.TIME] = rows[i, wave.TIME_BEFORE] = np.nan
        _wave_sources(s, case, i, own.inputs)
        _fill_wave(s, own.inputs, i, rows[i, wave.OMEGA], b, f)
        for c in range(views.shape[0]):
            at = _waves_at(s, c, i)
            views[c, at], views[c, at + 1] = own.inputs[1, size + c], own.inputs[2, size + c]
            views[c, at + _WAVE_SHOWN - 1], views[c, at + _WAVE_SHOWN] = case.casing[i, 0, c], case.casing[i, 1, c]
    for k in range(s.blocks):
        if is_explicit(b, k, rows, case.duration):
            b[block.EXPLICIT_COLUMNS, int(counts[0])] = k
            counts[0] += 1.0
        else:
            if b[block.STIFFNESS, k] <= 0.25 * b[block.DAMPING, k] * b[block.DAMPING, k]:
                b[block.APERIODIC_COLUMNS, int(counts[1])] = k
                counts[1] += 1.0
            subtract_particular(b, k, rows)
    for j in range(s.firsts):
        subtract_harmonics(f, j, rows)
    for c in range(views.shape[0]):
        outputs[SIGNAL], outputs[TEMPERATURE] = own.inputs[0, size + c], 0.0
        outputs[PLACE] = case.constant[case.constant.size - 3 * views.shape[0] + c]
        _fill_view(s, c, b, f, rows, views[c], outputs, int(counts[0]))


@inlined
def _waves_at(s: ClosedSet, c: int, i: int) -> int:
    """Return where what contact ``c`` sees of wave i begins in its view."""
    return int(3 + _SHOWN * s.block.shape[1] + 2 * s.first.shape[1] + (_WAVE_SHOWN + 1) * i)


@part
def _fill_view(
    s: ClosedSet, c: int, b: Array, f: Array, rows: Array, view: Array, outputs: Array, explicits: int
) -> None:
    """Fill what contact ``c`` sees; its signal by each wave alone is there."""
    for o in range(4):
        for k in range(b.shape[1]):
            b[block.SIGNAL_VALUE + o, k] = s.outputs[c, o, k]
    for o in range(2):
        for j in range(f.shape[1]):
            f[first.SIGNAL + o, j] = s.slow_outputs[c, o, j]
    for i in range(rows.shape[0]):
        at = _waves_at(s, c, i)
        rows[i, wave.SIGNAL_COS], rows[i, wave.SIGNAL_SIN] = view[at], view[at + 1]
        rows[i, wave.TEMPERATURE_COS] = rows[i, wave.TEMPERATURE_SIN] = 0.0
    for k in range(s.blocks):
        fill_unforced(b, k)
        add_particular_outputs(b, k, rows, outputs)
    for i in range(explicits):
        k = int(b[block.EXPLICIT_COLUMNS, i])
        for row in range(block.UNFORCED_VALUE, block.SIGNAL_INTEGRAL + 1):
            b[row, k] = 0.0
    for j in range(s.firsts):
        add_harmonic_outputs(f, j, rows)
    view[0], view[1], view[2] = outputs[0], outputs[1], outputs[2]
    at = 3
    for row in range(block.SIGNAL_VALUE, block.SIGNAL_INTEGRAL + 1):
        for k in range(b.shape[1]):
            view[at + k] = b[row, k]
        at += b.shape[1]
    for row in range(first.SIGNAL, first.TEMPERATURE + 1):
        for j in range(f.shape[1]):
            view[at + j] = f[row, j]
        at += f.shape[1]
    for i in range(rows.shape[0]):
        for column in range(_WAVE_SHOWN - 1):
            view[at + column] = rows[i, wave.SIGNAL_COS + column]
        at += _WAVE_SHOWN + 1


@part
def select(motion: SetMotion, c: int) -> None:
    """Let the motion's signal and temperature be those of contact ``c``."""
    m, view, at = motion.m, motion.views[c], 3
    m.outputs[0], m.outputs[1], m.outputs[2] = view[0], view[1], view[2]
    for row in range(block.SIGNAL_VALUE, block.SIGNAL_INTEGRAL + 1):
        for k in range(m.block.shape[1]):
            m.block[row, k] = view[at + k]
        at += m.block.shape[1]
    for row in range(first.SIGNAL, first.TEMPERATURE + 1):
        for j in range(m.first.shape[1]):
            m.first[row, j] = view[at + j]
        at += m.first.shape[1]
    for i in range(m.waves.shape[0]):
        for column in range(_WAVE_SHOWN):
            m.waves[i, wave.SIGNAL_COS + column] = view[at + column]
        m.waves[i, wave.CASING] = view[at + _WAVE_SHOWN]
        at += _WAVE_SHOWN + 1


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
def _wave_sources(s: ClosedSet, case: ContactCase, i: int, out: Array) -> None:
    """Fill the sources and signals by cos ψ and sin ψ of wave ``i`` in rows 1 and 2."""
    contacts, omega = s.place.shape[0], case.waves[i, wave.OMEGA]
    at, width = s.source.shape[0] - 3 * contacts, s.source.shape[1]
    for r in range(width):
        out[1, r], out[2, r] = 0.0, case.waves[i, wave.LOAD] * s.source[at - 1, r]
    for c in range(contacts):
        cos, sin = case.casing[i, 0, c], case.casing[i, 1, c]
        if cos != 0.0 or sin != 0.0:
            d, rate, bend = at + c, at + contacts + c, at + 2 * contacts + c
            for r in range(width):
                still = s.source[d, r] - omega * omega * s.source[bend, r]
                turning = omega * s.source[rate, r]
                out[1, r] += cos * still + sin * turning
                out[2, r] += sin * still - cos * turning


@part
def _fill_constants(s: ClosedSet, source: Array, b: Array, f: Array) -> None:
    """Fill the constant forces on blocks and sources of first-order states."""
    for k in range(s.blocks):
        beta, gamma = source[k], source[s.blocks + k]
        b[block.PARTICULAR_SLOPE, k], b[block.FORCE, k] = -beta, gamma + b[block.DAMPING, k] * beta
    for j in range(s.firsts):
        f[first.SOURCE, j] = source[2 * s.blocks + j]


@part
def _fill_wave(s: ClosedSet, source: Array, i: int, omega: float, b: Array, f: Array) -> None:
    """Fill the forces on blocks and sources of first-order states by wave ``i``."""
    row = i * block.WAVE
    for k in range(s.blocks):
        c = b[block.DAMPING, k]
        beta_cos, beta_sin, at = source[1, k], source[2, k], s.blocks + k
        b[block.PARTICULAR_SLOPE_COS + row, k], b[block.PARTICULAR_SLOPE_SIN + row, k] = -beta_cos, -beta_sin
        b[block.FORCE_COS + row, k] = omega * beta_sin + source[1, at] + c * beta_cos
        b[block.FORCE_SIN + row, k] = source[2, at] + c * beta_sin - omega * beta_cos
    for j in range(s.firsts):
        at = 2 * s.blocks + j
        f[first.HARMONIC_COS + i * first.WAVE, j] = source[1, at]
        f[first.HARMONIC_SIN + i * first.WAVE, j] = source[2, at]


@part
def leave(motion: SetMotion, s: ClosedSet, own: Memory, y: Array, t: float) -> None:
    """Fill X = [y, y', τ] of the contacts open from a state of the motion; ``own.casing`` is that of t."""
    to_coordinates(motion.m, y, t, own.coordinates)
    n = s.place.shape[1]
    for i in range(own.modal.size):
        own.modal[i] = 0.0
    for r in range(s.exit.shape[0]):
        for i in range(own.modal.size):
            own.modal[i] += own.coordinates[r] * s.exit[r, i]
    for c in range(s.place.shape[0]):
        for k in range(n):
            own.modal[k] += own.casing[0, c] * s.place[c, k]
            own.modal[n + k] += own.casing[1, c] * s.place[c, k]


@part
def enter(motion: SetMotion, s: ClosedSet, own: Memory, t: float) -> None:
    """Set the present state from X = [y, y', τ]."""
    now, size = motion.m.now, s.entry.shape[1]
    for r in range(size):
        own.coordinates[r] = 0.0
    for i in range(own.modal.size):
        if own.modal[i] != 0.0:
            for r in range(size):
                own.coordinates[r] += own.modal[i] * s.entry[i, r]
    for row in range(state.ROWS):
        for k in range(now.shape[1]):
            now[row, k] = 0.0
    from_coordinates(motion.m, own.coordinates, t, now)
