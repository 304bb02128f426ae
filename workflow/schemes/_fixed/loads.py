"""The load, F0 and harmonics, and a casing that moves, in the lanes of a block.

In most batches a harmonic has one frequency and phase in all lanes: these share its sine and cosine, in the first lane.
Where the casing rests there is no :class:`Drive`, and the kernel is compiled without it at no cost.

A scheme with a fixed step sees the casing d(t) = d + Σ a_m sin(ω_m t + φ_m) through a discrete velocity

    V(t) = Σ Im[g_m a_m e^{i(ω_m t + φ_m)}],   g_m = (e^{iω_m h} - 1) / (h (1 - θ + θ e^{iω_m h})),

for which h (θ V_{k+1} + (1-θ) V_k) = d_{k+1} - d_k exactly; each contact has its own φ_m. It is stepped relative to the
casing, r = x - d and u = v - V, with r_{k+1} = r_k + h (θ u_{k+1} + (1-θ) u_k): one that is pressed, u = 0, follows the
casing without drift.
Central differences take θ = 0: V_k = (d_{k+1} - d_k)/h, the casing's velocity from t_k to t_{k+1}.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from workflow.kernels import elementary, elementwise
from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import PACK, Rows, named_rows, rows_in
from workflow.kernels.packs import Lane, Pack, narrow, pack, spread, store
from workflow.models import Array, Cases, Harmonics, Structure, compliant_places, project
from workflow.schemes._fixed.rows import Acting
from workflow.schemes._interface import AT_REST

EXACT_EVERY = 64
"""Steps between evaluations of sin and cos of a load; in between both are rotated by the angle of a step, with a
rounding below 64 eps = 1.4e-14 of the amplitude."""


class Wave(Rows):
    """A harmonic of the load or of the casing."""

    sine_before: Array
    sine: Array
    cosine: Array
    """Sine at the beginning of the step, sine and cosine at its end."""
    weighed: Array
    """Sine at both, weighted by 1 - θ and θ."""
    turn_sine: Array
    turn_cosine: Array
    """Sine and cosine of the angle of a step."""
    amplitude: Array
    """N or m."""
    frequency: Array
    phase: Array
    """Hz and rad."""
    common: Array
    """A flag in the first lane: raised where its sine, to the bit, is that of all lanes."""


class Loads(NamedTuple):
    """The load of a block of cases."""

    mean: Array
    """F0, N."""
    waves: Sequence[Wave]
    """One at least."""


@part
def start_waves(waves: Sequence[Wave], lanes: int) -> None:
    """Find the harmonics that lanes share; one without an amplitude, as in idle lanes, is no hindrance."""
    for k in range(len(waves)):
        wave, leader, common = waves[k], 0, True
        for lane in range(lanes):
            if wave.amplitude[lane] != 0.0 and wave.amplitude[leader] == 0.0:
                leader = lane
        for lane in range(lanes):
            alike = wave.frequency[lane] == wave.frequency[leader] and wave.phase[lane] == wave.phase[leader]
            common &= alike or wave.amplitude[lane] == 0.0
        if common:
            wave.frequency[0], wave.phase[0] = wave.frequency[leader], wave.phase[leader]
            wave.turn_sine[0], wave.turn_cosine[0] = wave.turn_sine[leader], wave.turn_cosine[leader]
        wave.common[0] = 1.0 if common else 0.0


@inlined
def turn_waves(waves: Sequence[Wave], step: int, h: float, theta: float, lanes: int) -> None:
    """Advance harmonics to the end of a step, t = step h; find those that lanes share at the first."""
    if step == 0:
        start_waves(waves, lanes)
    for k in range(len(waves)):
        wave, last = waves[k], 1 if waves[k].common[0] != 0.0 else lanes
        for lane in range(last):
            s, c = wave.sine[lane], wave.cosine[lane]
            wave.sine_before[lane] = s
            wave.sine[lane] = s * wave.turn_cosine[lane] + c * wave.turn_sine[lane]
            wave.cosine[lane] = c * wave.turn_cosine[lane] - s * wave.turn_sine[lane]
        if step % EXACT_EVERY == 0:
            _place_wave(wave, step * h, last)
        for lane in range(last):
            wave.weighed[lane] = (1.0 - theta) * wave.sine_before[lane] + theta * wave.sine[lane]


@part
def _place_wave(wave: Wave, t: float, lanes: int) -> None:
    """Set sine and cosine of a harmonic to their values at time t."""
    for lane in range(lanes):
        angle = 2.0 * np.pi * (wave.frequency[lane] * t) + wave.phase[lane]
        wave.sine[lane], wave.cosine[lane] = elementary.sine_cosine(angle)


@inlined
def _of_lanes(wave: Wave, row: Array, lane: Lane) -> Pack:
    """Return a row of a harmonic in some lanes."""
    return spread(row[0], lane) if wave.common[0] != 0.0 else pack(row, lane)


@inlined
def load_in_step(load: Loads, at_end: bool, lane: Lane) -> Pack:
    """Return the load in a step, weighted by 1 - θ and θ, or that at its end, N."""
    force = pack(load.mean, lane)
    for k in range(len(load.waves)):
        wave = load.waves[k]
        force += pack(wave.amplitude, lane) * _of_lanes(wave, wave.sine if at_end else wave.weighed, lane)
    return force


class Seen(Rows):
    """A harmonic of the casing at a contact."""

    place_sine: Array
    place_cosine: Array
    speed_sine: Array
    speed_cosine: Array
    """d and V per sine and per cosine of the wave, m and m/s."""


class Drive(NamedTuple):
    """A moving casing of a block of cases."""

    waves: Sequence[Wave]
    seen: Any
    """:class:`Seen` of each wave and contact, ``(wave, contact)``."""


class DriveRows(NamedTuple):
    """The rows of a drive, of all cases or in lanes, ``(…, row, case)`` or ``(…, row, lane)``."""

    casing_waves: Array
    seen: Array

    @property
    def named(self) -> Drive:
        """The rows by names, as kernels take them."""
        return Drive(cast(Sequence[Wave], named_rows(Wave, self.casing_waves)), named_rows(Seen, self.seen))


class Start(NamedTuple):
    """The contacts of cases at t = 0, ``(case, contact)``, and how they move."""

    displacement: Array
    velocity: Array
    """What they show: x_i and its rate, m and m/s; on the casing where it is there up to rounding."""
    gap: Array
    """d_i, m."""
    place: Array
    speed: Array
    """x_i of the modes and its rate relative to the origin, m and m/s: see :class:`.rows.Acting`."""
    origin: Array
    origin_speed: Array
    """The origin, m, and its discrete velocity a step before, V(-h), m/s."""
    coordinate_velocity: Array
    """Velocity of all coordinates, m/s, ``(case, mechanical)``, with that of its casing at each contact that starts on
    it and moves with it."""


def start_of(
    structure: Structure, cases: Cases, h: float, theta: float, duration: float, spring_flexibility: float = 0.0
) -> tuple[DriveRows | None, Start]:
    """Return the drive of cases that are stepped with h and θ, ``(…, case)``, and how their contacts start.

    A spring of the flexibility ``spring_flexibility`` [m/N] stands between contacts without mass and their casing.

    A contact that starts on its casing and moves with it, both up to rounding (:data:`AT_REST`), has r = u = 0 and the
    velocity V(0): its own is ḋ(0), or V(0) where it ended pressed.
    """
    rows, casing = structure.contacts.normal, cases.casing_harmonics
    place, moves = cases.casing_of_contacts(0.0)
    x, v = project(rows, cases.displacement), project(rows, cases.velocity)
    lengths, speeds = (each[:, None] for each in casing.rounding_scales(duration))
    lengths = lengths + project(np.abs(rows), np.abs(cases.displacement)) + np.abs(cases.clearances)
    touches = np.abs(x - place) <= AT_REST * lengths
    x = np.where(touches, place, x)
    compliant = structure.contacts.is_compliant
    shown = compliant_places(structure, cases, spring_flexibility) if compliant else x
    rest = np.zeros_like(x)
    if casing.width == 0:
        return None, Start(shown, v, place, x, v, rest, rest, cases.velocity)
    seen, moved, velocity, before = _seen(cases, x.shape[1], h, theta)
    speeds = speeds + project(np.abs(rows), np.abs(cases.velocity)) + lengths / h
    held = touches & (not compliant) & (np.fmin(np.abs(v - velocity), np.abs(v - moves)) <= AT_REST * speeds)
    follows = cases.velocity.copy()
    for i in np.flatnonzero(held.any(axis=1)):
        follows[i] += np.linalg.pinv(rows[held[i]]) @ (velocity - v)[i, held[i]]
    relative = np.where(held, 0.0, v - velocity)
    own = np.where(touches, cases.clearances, x - moved)
    drive = DriveRows(rows_of_waves(casing, h), seen)
    return drive, Start(shown, v, place, own, relative, moved, before, follows)


def _seen(cases: Cases, contacts: int, h: float, theta: float) -> tuple[Array, Array, Array, Array]:
    """Return the rows :class:`Seen`, ``(wave, contact, row, case)``, d(0) without its mean, and V at t = 0 and -h.

    The last three ``(case, contact)``.
    """
    own = cases.casing_harmonics
    sin, cos = (each.reshape(cases.turns.shape) for each in elementwise.sine_cosine(cases.turns.ravel()))
    real, imaginary = (g[:, None] for g in discrete_gains(own.amplitude, own.angular, h, theta))
    amplitude = own.amplitude[:, None]
    parts = [amplitude * cos, amplitude * sin, real * cos - imaginary * sin, real * sin + imaginary * cos]
    seen = np.stack(parts, axis=0).transpose(3, 2, 0, 1)
    moved, begins, before = np.zeros((3, cases.count, contacts))
    for t, first, total in ((0.0, 0, moved), (0.0, 2, begins), (-h, 2, before)):
        for k in range(own.width):
            s, c = own.sine_cosine(k, t)
            total += parts[first][:, :, k] * s[:, None] + parts[first + 1][:, :, k] * c[:, None]
    return np.ascontiguousarray(seen), moved, begins, before


def discrete_gains(amplitude: Array | float, angular: Array, h: float, theta: float) -> tuple[Array, Array]:
    """Return a Re g and a Im g of harmonics of the casing, ``(case, harmonic)``: V per sine and per cosine.

    With s, c = sin, cos(ωh/2): g = (2/h) s (i c + (2θ-1) s) / (c² + (2θ-1)² s²).
    """
    s, c = elementwise.sine_cosine(0.5 * angular * h)
    lean = (2 * theta - 1) * s
    factor = amplitude * (2 / h) * s / (c * c + lean * lean)
    return factor * lean, factor * c


def rows_of_waves(harmonics: Harmonics, h: float, least: int = 0) -> Array:
    """Return the rows of harmonics, ``(harmonic, row, case)``, ``least`` at least."""
    count = harmonics.width
    rows = np.zeros((max(count, least), rows_in(Wave), harmonics.amplitude.shape[0]))
    waves: Any = named_rows(Wave, rows)
    turn_sine, turn_cosine = elementwise.sine_cosine(harmonics.angular * h)
    waves["turn_sine"][:count], waves["turn_cosine"][:count] = turn_sine.T, turn_cosine.T
    for name, values in zip(("amplitude", "frequency", "phase"), harmonics.rows, strict=True):
        waves[name][:count] = values.T
    return rows


@inlined
def turn_casing(drive: Drive | None, step: int, h: float, theta: float, acts: Sequence[Acting], lanes: int) -> None:
    """Advance casings to the end of a step, t = step h: these are the origins of contacts."""
    if drive is None:
        return
    waves = drive.waves
    turn_waves(waves, step, h, theta, lanes)
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        for i in range(len(acts)):
            place, speed = spread(0.0, lane), spread(0.0, lane)
            for k in range(len(waves)):
                s, c = _of_lanes(waves[k], waves[k].sine, lane), _of_lanes(waves[k], waves[k].cosine, lane)
                seen = drive.seen[k, i]
                place += pack(seen.place_sine, lane) * s + pack(seen.place_cosine, lane) * c
                speed += pack(seen.speed_sine, lane) * s + pack(seen.speed_cosine, lane) * c
            store(acts[i].origin, lane, place)
            store(acts[i].origin_speed_begin, lane, pack(acts[i].origin_speed, lane))
            store(acts[i].origin_speed, lane, speed)
