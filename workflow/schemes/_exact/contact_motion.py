"""The motion of a case in a set of closed contacts.

The motion of a set is that of :mod:`workflow.schemes._exact.motion`: blocks and first-order states less the particular
solution of the loads, with a signal and a temperature of each contact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array, elementary
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import part
from workflow.kernels.lemke import Complementarity, problem
from workflow.kernels.packs import view
from workflow.models import ContactBasis
from workflow.schemes._exact.closed_sets import LINKED, ClosedSet
from workflow.schemes._exact.expansion import SUM_ROUNDING
from workflow.schemes._exact.layout import Budget
from workflow.schemes._exact.motion import (
    ORDER,
    OUTPUTS,
    PLACE,
    SIGNAL,
    Expansion,
    LoadedTables,
    Motion,
    add_load_outputs,
    copy_tables,
    fastest_of,
    fill_force,
    fill_wave_force,
    from_coordinates,
    loaded_size,
    loaded_tables,
    place_of,
    subtract_loads,
    to_coordinates,
)
from workflow.schemes._exact.tables import expansion, first, padded, seen, seen_wave, state, wave


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
    operator, tangential = _products(basis.normal, basis.normal), _products(basis.normal, basis.tangent)
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


def _products(rows: Array, others: Array) -> Array:
    """Return rows · othersᵀ, ``(contact, contact)``, 0 where it is the rounding of its terms."""
    products, sizes = rows @ others.T, np.linalg.norm(rows, axis=1)[:, None] * np.linalg.norm(others, axis=1)
    return np.where(np.abs(products) <= SUM_ROUNDING * sizes, 0.0, products)


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
    modes: Array
    """[z, z', τ] of a set; scratch."""
    modal: Array
    """X = [y, y', τ] at the last event, ``(N,)``."""
    inputs: Array
    """Sources and signals by constant loads, and by cos ψ and sin ψ of each wave, ``(1 + 2 wave, N + m)``; scratch."""
    wanted: NDArray[np.bool_]
    """Contacts that are closed from the last event on, ``(contact,)``."""
    zeros: NDArray[np.int64]
    """Order of the zero of each signal at the last event, see :mod:`.step`; -1 where a force may begin at 0."""
    certified: Array
    """Time until which each signal has certainly no zero, s; -1 where it is not known."""
    still: NDArray[np.bool_]
    """Open contacts that touch their casing and that nothing moves in the present set, ``(contact,)``."""
    speed: Array
    """Rate of the signal there, where an impact gives it; else -1, ``(contact,)``."""
    bounces: Array
    """Time of the bounces after the last event that are not followed, s, ``(contact,)``."""
    approach: Array
    """u = w y' - d', m/s, ``(contact,)``."""
    distance: Array
    """d - w y, m, ``(contact,)``."""
    casing: Array
    """d and its first three derivatives, ``(4, contact)``."""
    push: Array
    """w (g - c y' - ω² y - G τ) - d'' and its rate, ``(2, contact)``."""
    rounding: Array
    """Up to which these are 0, ``(2, contact)``."""
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
    tables = loaded_size(columns, wide, waves, m) + 2
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
        modes=np.zeros(N),
        modal=np.zeros(N),
        inputs=np.zeros((1 + 2 * waves, padded(N + m))),
        wanted=np.zeros(m, dtype=np.bool_),
        zeros=np.zeros(m, dtype=np.int64),
        certified=np.zeros(m),
        still=np.zeros(m, dtype=np.bool_),
        speed=np.zeros(m),
        bounces=np.zeros(m),
        approach=np.zeros(m),
        distance=np.zeros(m),
        casing=np.zeros((4, m)),
        push=np.zeros((2, m)),
        rounding=np.zeros((2, m)),
        impulse=np.zeros(m),
        taken=np.zeros((2, m)),
        force=np.zeros(m),
        acceleration=np.zeros((2, n)),
        members=np.zeros(m, dtype=np.int64),
        kinds=np.zeros(m, dtype=np.int64),
        problem=problem(m),
    )


@part
def motion_in(s: ClosedSet, case: ContactCase, own: Memory, slot: int) -> Motion:
    """Return the motion of a case in the set of a slot, its tables filled, as the first contact sees it."""
    columns, wide, waves, contacts = s.block.shape[1], s.first.shape[1], case.acting, s.place.shape[0]
    numbers = own.tables[slot]
    loaded, at = loaded_tables(numbers, columns, wide, waves, contacts)
    counts = numbers[at : at + 2]
    if not own.filled[slot]:
        for i in range(at + 2):
            numbers[i] = 0.0
        _fill(s, case, own, loaded, counts)
        own.filled[slot] = True
    most = max(columns, wide)
    size, (rows, slow, across) = state.ROWS * most, place_of(waves, 0)
    between = view(own.states, 2 * size, (state.ROWS, most))
    sums, terms = view(own.sums, 0, (expansion.ROWS, s.blocks + 1)), view(own.terms, 0, (expansion.ROWS, columns))
    return Motion(
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
        view(own.states, 0, (state.ROWS, most)),
        view(own.states, size, (state.ROWS, most)),
        between,
        between,
        own.coordinates,
        own.coordinates,
        True,
        s.inward,
        s.outward,
        s.growth,
        fastest_of(s.fastest, loaded.waves),
        s.inward.shape[0] > 2 * s.null.shape[1],
        s.link != LINKED and s.growth <= 0.0,
        0,
        rows,
        slow,
        across,
    )


@part
def _fill(s: ClosedSet, case: ContactCase, own: Memory, loaded: LoadedTables, counts: Array) -> None:
    """Fill the tables of a motion, which are 0."""
    b, f, _, waves = loaded
    n, inputs = s.blocks, own.inputs
    copy_tables(s.block, s.first, case.waves, loaded)
    _constant_sources(s, case.constant, inputs[0])
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
        add_load_outputs(loaded, n, s.firsts, explicits, c)


@part
def _fill_outputs(s: ClosedSet, case: ContactCase, inputs: Array, loaded: LoadedTables, c: int) -> None:
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
def _constant_sources(s: ClosedSet, inputs: Array, out: Array) -> None:
    """Fill out = inputs · source."""
    for r in range(s.source.shape[1]):
        out[r] = 0.0
    for i in range(inputs.size):
        if inputs[i] != 0.0:
            for r in range(s.source.shape[1]):
                out[r] += inputs[i] * s.source[i, r]


@part
def _wave_sources(s: ClosedSet, case: ContactCase, i: int, by_cos: Array, by_sin: Array) -> None:
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
def fill_casing(case: ContactCase, t: float, own: Memory) -> None:
    """Fill d and its derivatives of each contact."""
    contacts = own.wanted.size
    at = case.constant.size - 3 * contacts
    for c in range(contacts):
        own.casing[0, c] = case.constant[at + c]
        own.casing[1, c] = own.casing[2, c] = own.casing[3, c] = 0.0
    for i in range(case.acting):
        omega = case.waves[i, wave.OMEGA]
        sin, cos = elementary.sine_cosine(omega * t + case.waves[i, wave.PHASE])
        for c in range(contacts):
            a, b = case.casing[i, 0, c], case.casing[i, 1, c]
            value, turn = a * cos + b * sin, omega * (b * cos - a * sin)
            own.casing[0, c] += value
            own.casing[1, c] += turn
            own.casing[2, c] -= omega * omega * value
            own.casing[3, c] -= omega * omega * turn


@part
def load_at(case: ContactCase, t: float) -> tuple[float, float]:
    """Return the sinusoids of the load F at t, and their rate."""
    load, rate = 0.0, 0.0
    for i in range(case.acting):
        omega = case.waves[i, wave.OMEGA]
        sin, cos = elementary.sine_cosine(omega * t + case.waves[i, wave.PHASE])
        load += case.waves[i, wave.LOAD] * sin
        rate += omega * case.waves[i, wave.LOAD] * cos
    return load, rate


@part
def damped(structure: Contacting, v: Array, k: int) -> float:
    """Return the damping of mode k, c v."""
    if structure.damping.shape[0] == 1:
        return float(structure.damping[0, k] * v[k])
    total = 0.0
    for i in range(v.size):
        total += structure.damping[k, i] * v[i]
    return total


@part
def leave(m: Motion, s: ClosedSet, own: Memory, y: Array, t: float) -> None:
    """Fill X = [y, y', τ] of the contacts open from a state of the motion; ``own.casing`` is that of t."""
    Z, X, (n, k) = own.modes, own.modal, s.null.shape
    to_coordinates(m, y, t, own.coordinates)
    _change(s.link, s.outward, own.coordinates, Z, 2 * k)
    for j in range(s.inward.shape[0] - 2 * k):
        X[2 * n + j] = Z[2 * k + j]
    for i in range(2 * n):
        X[i] = Z[i] if s.is_open else 0.0
    for j in range(0 if s.is_open else k):
        for i in range(n):
            X[i] += Z[j] * s.spread[j, i]
            X[n + i] += Z[k + j] * s.spread[j, i]
    for c in range(own.wanted.size):
        if own.wanted[c]:
            for i in range(n):
                X[i] += own.casing[0, c] * s.place[c, i]
                X[n + i] += own.casing[1, c] * s.place[c, i]


@part
def enter(m: Motion, s: ClosedSet, own: Memory, t: float) -> None:
    """Set the present state from X = [y, y', τ]."""
    Z, X, (n, k) = own.modes, own.modal, s.null.shape
    for i in range(2 * k):
        Z[i] = X[i] if s.is_open else 0.0
    for j in range(0 if s.is_open else n):
        for i in range(k):
            Z[i] += X[j] * s.null[j, i]
            Z[k + i] += X[n + j] * s.null[j, i]
    for j in range(s.inward.shape[0] - 2 * k):
        Z[2 * k + j] = X[2 * n + j]
    _change(s.link, s.inward, Z, own.coordinates, 2 * k)
    for row in range(state.ROWS):
        for i in range(m.now.shape[1]):
            m.now[row, i] = 0.0
    from_coordinates(m, own.coordinates, t, m.now)


@part
def _change(link: int, matrix: Array, source: Array, target: Array, mechanical: int) -> None:
    """Fill target = source · matrix; of coordinates that are not linked only the rows of heat differ from 1."""
    N = matrix.shape[0]
    for i in range(N):
        target[i] = 0.0 if link == LINKED else source[i]
    if link == LINKED:
        for j in range(N):
            for i in range(N):
                target[i] += source[j] * matrix[j, i]
    else:
        for j in range(mechanical, N):
            for i in range(mechanical):
                target[i] += source[j] * matrix[j, i]
