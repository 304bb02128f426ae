"""The load, F0 and harmonics, and a casing that moves, in the lanes of a block.

Most scenes have one harmonic, F1 sin(2π f t + φ), and its f and φ are those of all lanes: these share its sine. Further
harmonics, of load or casing, are the :class:`Drive` of a kernel, with a sine of each lane, which takes longer. Where
there are none it is ``None``, and the kernel is compiled without it at no cost.

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
from workflow.kernels.compiled import by_type, defines, inlined, part
from workflow.kernels.lanes import PACK, Rows, named_rows, rows_in
from workflow.kernels.packs import Lane, Pack, narrow, pack, spread, store
from workflow.models import Array, Cases, Harmonics, Structure, coated_forces, project
from workflow.schemes._fixed.law import TipStep, YieldingStep
from workflow.schemes._fixed.rows import Acting
from workflow.schemes._interface import AT_REST

EXACT_EVERY = 64
"""Steps between evaluations of sin and cos of a load; in between both are rotated by the angle of a step, with a
rounding below 64 eps = 1.4e-14 of the amplitude."""


class TipLoads(Rows):
    """F0 and the first harmonic, F1 sin(2π f t + φ), of the loads of a block."""

    mean: Array
    amplitude: Array
    """F0 and F1, N."""
    frequency: Array
    phase: Array
    """f [Hz] and φ [rad]."""
    sine_before: Array
    sine: Array
    cosine: Array
    """Sine at the beginning of the step, sine and cosine at its end."""
    turn_sine: Array
    turn_cosine: Array
    """Sine and cosine of the angle of a step."""
    weighed_sine: Array
    """Weighted sine, where lanes differ in frequency or phase."""


def tip_loads(cases: Cases) -> Array:
    """Return the rows of :class:`TipLoads` of all cases, ``(row, case)``."""
    rows = np.zeros((rows_in(TipLoads), cases.count))
    load = named_rows(TipLoads, rows)
    load.mean = cases.mean
    if cases.load_harmonics.width:
        load.amplitude, load.frequency, load.phase = (row[:, 0] for row in cases.load_harmonics.rows)
    return rows


@part
def start_load(h: float, load: TipLoads, lanes: int) -> int:
    """Set the rotation of the load to one step; return the leader.

    That is a lane whose sine, to the bit, is that of all lanes, as most batches share frequency and phase; -1 where
    lanes differ in them.
    """
    leader = 0
    for lane in range(lanes):
        if load.amplitude[lane] != 0.0 and load.amplitude[leader] == 0.0:
            leader = lane
    frequency, phase, shared_by_all = load.frequency[leader], load.phase[leader], True
    for lane in range(lanes):
        still = load.amplitude[lane] == 0.0 and np.isfinite(load.frequency[lane] + load.phase[lane])
        shared_by_all &= still or (load.frequency[lane] == frequency and load.phase[lane] == phase)
    for lane in range(lanes):
        turn = 2.0 * np.pi * load.frequency[lane] * h
        load.turn_sine[lane], load.turn_cosine[lane] = elementary.sine_cosine(turn)
    leader = leader if shared_by_all else -1
    return leader


@inlined
def turn_load(step: int, h: float, leader: int, load: TipLoads, lanes: int) -> None:
    """Advance the load to the end of a step, t = step h."""
    first, last = (leader, leader + 1) if leader >= 0 else (0, lanes)
    for lane in range(first, last):
        s, c = load.sine[lane], load.cosine[lane]
        load.sine_before[lane] = s
        load.sine[lane] = s * load.turn_cosine[lane] + c * load.turn_sine[lane]
        load.cosine[lane] = c * load.turn_cosine[lane] - s * load.turn_sine[lane]
    if step % EXACT_EVERY == 0:
        for lane in range(first, last):
            angle = 2.0 * np.pi * (load.frequency[lane] * (step * h)) + load.phase[lane]
            load.sine[lane], load.cosine[lane] = elementary.sine_cosine(angle)


@inlined
def weigh_load(before: float, after: float, leader: int, load: TipLoads, lanes: int) -> float:
    """Return the weighted mean of the sine at the step's beginning and end, common to all lanes.

    Without a ``leader`` it returns 0 and stores the mean of each lane in ``weighed_sine``.
    """
    if leader >= 0:
        return float(before * load.sine_before[leader] + after * load.sine[leader])
    for lane in range(lanes):
        load.weighed_sine[lane] = before * load.sine_before[lane] + after * load.sine[lane]
    return 0.0


@inlined
def tip_load(sine: float, leader: int, load: TipLoads, drive: Drive | None, lane: Lane) -> Pack:
    """Return the load in a step, N, for the ``sine`` that :func:`weigh_load` returned."""
    mean, amplitude = pack(load.mean, lane), pack(load.amplitude, lane)
    first = mean + (amplitude * sine if leader >= 0 else amplitude * pack(load.weighed_sine, lane))
    return first if drive is None else first + pack(drive.other.load, lane)


@by_type
def load_at_end(step: TipStep, leader: int, load: TipLoads, drive: Drive | None, lane: Lane) -> Pack:
    """Return the load at the step's end, N; 0 where no contact without mass asks for it."""
    return spread(0.0, lane)


@defines(load_at_end, YieldingStep)
def _load_at_end(step: TipStep, leader: int, load: TipLoads, drive: Drive | None, lane: Lane) -> Pack:
    sine = spread(load.sine[leader], lane) if leader >= 0 else pack(load.sine, lane)
    first = pack(load.mean, lane) + pack(load.amplitude, lane) * sine
    return first if drive is None else first + pack(drive.other.load_end, lane)


class Wave(Rows):
    """A harmonic of the casing, or of the load after the first."""

    sine: Array
    cosine: Array
    turn_sine: Array
    turn_cosine: Array
    """Sine and cosine of its angle, and of the angle of a step."""
    amplitude: Array
    """N or m."""
    frequency: Array
    phase: Array
    """Hz and rad."""


class Seen(Rows):
    """A harmonic of the casing at a contact."""

    place_sine: Array
    place_cosine: Array
    speed_sine: Array
    speed_cosine: Array
    """d and V per sine and per cosine of the wave, m and m/s."""


class OtherLoad(Rows):
    """The load of the harmonics after the first in a step."""

    load: Array
    load_end: Array
    """N, weighted by 1 - θ and θ, and at the step's end."""


class Drive(NamedTuple):
    """Harmonics of the load after the first, and a moving casing, of a block of cases."""

    load_waves: Sequence[Wave]
    casing_waves: Sequence[Wave]
    other: OtherLoad
    seen: Any
    """:class:`Seen` of each wave of the casing and contact, ``(wave, contact)``."""


class DriveRows(NamedTuple):
    """The rows of a drive, of all cases or in lanes, ``(…, row, case)`` or ``(…, row, lane)``."""

    load_waves: Array
    casing_waves: Array
    other: Array
    seen: Array

    @property
    def named(self) -> Drive:
        """The rows by names, as kernels take them."""
        load, casing = (cast(Sequence[Wave], named_rows(Wave, rows)) for rows in (self.load_waves, self.casing_waves))
        return Drive(load, casing, named_rows(OtherLoad, self.other), named_rows(Seen, self.seen))


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
    structure: Structure, cases: Cases, h: float, theta: float, duration: float, yields: float = 0.0
) -> tuple[DriveRows | None, Start]:
    """Return the drive of cases that are stepped with h and θ, ``(…, case)``, and how their contacts start.

    A spring of the flexibility ``yields`` [m/N] stands between contacts without mass and their casing.

    A contact that starts on its casing and moves with it, both up to rounding (:data:`AT_REST`), has r = u = 0 and the
    velocity V(0): its own is ḋ(0), or V(0) where it ended pressed.
    """
    rows, load, casing = structure.contacts.normal, cases.load_harmonics[:, 1:], cases.casing_harmonics
    place, moves = cases.casing_of_contacts(0.0)
    x, v = project(rows, cases.displacement), project(rows, cases.velocity)
    lengths, speeds = (each[:, None] for each in casing.rounding_scales(duration))
    lengths = lengths + project(np.abs(rows), np.abs(cases.displacement)) + np.abs(cases.clearances)
    touches = np.abs(x - place) <= AT_REST * lengths
    x = np.where(touches, place, x)
    compliant = structure.contacts.is_compliant
    shown = compliant_places(structure, cases, yields) if compliant else x
    rest = np.zeros_like(x)
    if casing.width == 0:
        begins, velocity = Start(shown, v, place, x, v, rest, rest, cases.velocity), rest
        if load.width == 0:
            return None, begins
        seen = np.zeros((0, x.shape[1], rows_in(Seen), cases.count))
    else:
        seen, moved, velocity, before = _seen(cases, x.shape[1], h, theta)
        speeds = speeds + project(np.abs(rows), np.abs(cases.velocity)) + lengths / h
        held = touches & (not compliant) & (np.fmin(np.abs(v - velocity), np.abs(v - moves)) <= AT_REST * speeds)
        follows = cases.velocity.copy()
        for i in np.flatnonzero(held.any(axis=1)):
            follows[i] += np.linalg.pinv(rows[held[i]]) @ (velocity - v)[i, held[i]]
        relative = np.where(held, 0.0, v - velocity)
        own = np.where(touches, cases.clearances, x - moved)
        begins = Start(shown, v, place, own, relative, moved, before, follows)
    other = np.zeros((rows_in(OtherLoad), cases.count))
    return DriveRows(_waves(load, h), _waves(casing, h), other, seen), begins


def compliant_places(structure: Structure, cases: Cases, yields: float) -> Array:
    """Return x_i of compliant contacts at t = 0, m, ``(case, contact)``: d + w + c λ if they touch; NaN without a λ."""
    contacts, (surface, _), own = structure.contacts, cases.casing_of_contacts(0.0), cases.coating
    c, level, hardening = contacts.casing_flexibility + yields, np.full_like(surface, np.inf), np.zeros(cases.count)
    if own is not None:
        surface, level, hardening = surface + own.worn_at_start(), own.level_at_start(), own.hardening
    free = project(contacts.normal, cases.displacement) + cases.load_at(0.0)[:, None] * contacts.residual_load_or_zero
    if contacts.residual_coupling is not None:
        free -= project(contacts.residual_coupling, cases.temperature)
    for i in np.flatnonzero((free > surface).any(axis=1)):
        flexibility = contacts.flexibility(float(cases.friction[i]))
        compliance = flexibility + c * np.eye(contacts.count)
        pressed = coated_forces(compliance, surface[i] - free[i], c, level[i], hardening[i])
        force, grown = (np.full(contacts.count, np.nan),) * 2 if pressed is None else pressed
        free[i] = np.where(force > 0, surface[i] + (grown + c * force), free[i] - flexibility @ force)
    return free


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


def _waves(harmonics: Harmonics, h: float) -> Array:
    """Return the rows of harmonics, ``(harmonic, row, case)``."""
    rows = np.zeros((harmonics.width, rows_in(Wave), harmonics.amplitude.shape[0]))
    waves: Any = named_rows(Wave, rows)
    turn_sine, turn_cosine = elementwise.sine_cosine(harmonics.angular * h)
    waves["turn_sine"], waves["turn_cosine"] = turn_sine.T, turn_cosine.T
    waves["amplitude"], waves["frequency"], waves["phase"] = (values.T for values in harmonics.rows)
    return rows


@part
def _place_waves(waves: Sequence[Wave], t: float, lanes: int) -> None:
    """Set sine and cosine of harmonics to their values at time t."""
    for k in range(len(waves)):
        for lane in range(lanes):
            angle = 2.0 * np.pi * (waves[k].frequency[lane] * t) + waves[k].phase[lane]
            waves[k].sine[lane], waves[k].cosine[lane] = elementary.sine_cosine(angle)


@inlined
def _turn_waves(waves: Sequence[Wave], lane: Lane) -> None:
    """Rotate harmonics by the angle of a step."""
    for k in range(len(waves)):
        s, c = pack(waves[k].sine, lane), pack(waves[k].cosine, lane)
        turn_s, turn_c = pack(waves[k].turn_sine, lane), pack(waves[k].turn_cosine, lane)
        store(waves[k].sine, lane, s * turn_c + c * turn_s)
        store(waves[k].cosine, lane, c * turn_c - s * turn_s)


@inlined
def turn_drive(drive: Drive | None, step: int, h: float, theta: float, acts: Sequence[Acting], lanes: int) -> None:
    """Advance loads and casings to the end of a step, t = step h: these are the origins of contacts."""
    if drive is None:
        return
    loads, waves, other = drive.load_waves, drive.casing_waves, drive.other
    placed = step % EXACT_EVERY == 0
    if placed:
        _place_waves(loads, step * h, lanes)
        _place_waves(waves, step * h, lanes)
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        if not placed:
            _turn_waves(loads, lane)
            _turn_waves(waves, lane)
        force = spread(0.0, lane)
        for k in range(len(loads)):
            force += pack(loads[k].amplitude, lane) * pack(loads[k].sine, lane)
        before = pack(other.load_end, lane)
        store(other.load, lane, theta * force + (1.0 - theta) * before)
        store(other.load_end, lane, force)
        for i in range(len(acts) if len(waves) > 0 else 0):
            place, speed = spread(0.0, lane), spread(0.0, lane)
            for k in range(len(waves)):
                s, c, seen = pack(waves[k].sine, lane), pack(waves[k].cosine, lane), drive.seen[k, i]
                place += pack(seen.place_sine, lane) * s + pack(seen.place_cosine, lane) * c
                speed += pack(seen.speed_sine, lane) * s + pack(seen.speed_cosine, lane) * c
            store(acts[i].origin, lane, place)
            store(acts[i].origin_speed_begin, lane, pack(acts[i].origin_speed, lane))
            store(acts[i].origin_speed, lane, speed)
