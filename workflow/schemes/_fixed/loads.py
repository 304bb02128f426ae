"""The load at the tip, F0 and harmonics, and a casing that moves, in the lanes of a block.

Most scenes have one harmonic, F1 sin(2π f t + φ), and its f and φ are those of all lanes: these share its sine. Further
harmonics, of load or casing, are the :class:`Drive` of a kernel, with a sine of each lane, which takes longer. Where
there are none it is ``None``, and the kernel is compiled without it at no cost.

A scheme with a fixed step sees the casing d(t) = d + Σ a_m sin(ω_m t + φ_m) through a discrete velocity

    V(t) = Σ Im[g_m a_m e^{i(ω_m t + φ_m)}],   g_m = (e^{iω_m h} - 1) / (h (1 - θ + θ e^{iω_m h})),

for which h (θ V_{k+1} + (1-θ) V_k) = d_{k+1} - d_k exactly. The tip is stepped relative to the casing, r = x_n - d and
u = v_n - V, with r_{k+1} = r_k + h (θ u_{k+1} + (1-θ) u_k): a pressed tip, u = 0, follows the casing without drift.
Central differences take θ = 0: V_k = (d_{k+1} - d_k)/h, the casing's velocity from t_k to t_{k+1}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np

from workflow.kernels import elementary, elementwise
from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import LANES, PACK, Rows, named_rows, rows_in
from workflow.kernels.packs import Lane, Pack, narrow, pack, spread, store
from workflow.models import Array, Cases, Harmonics
from workflow.schemes._fixed.rows import Tips
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
    """Set the load to t = 0 and its rotation to one step; return the leader.

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
    turn_load(0, h, leader, load, lanes)
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
    """Return the load at the tip in a step, N, for the ``sine`` that :func:`weigh_load` returned."""
    mean, amplitude = pack(load.mean, lane), pack(load.amplitude, lane)
    first = mean + (amplitude * sine if leader >= 0 else amplitude * pack(load.weighed_sine, lane))
    return first if drive is None else first + pack(drive.state.load, lane)


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
    speed_sine: Array
    speed_cosine: Array
    """V of the casing per sine and per cosine, m/s."""


class Moving(Rows):
    """Loads and casing by :class:`Wave` in a step."""

    load: Array
    load_end: Array
    """Their load, N, weighted by 1 - θ and θ and at the step's end."""
    mean_gap: Array
    gap_before: Array
    """d without harmonics, and at the step's beginning, m."""
    speed_before: Array
    speed: Array
    """V at the step's beginning and end, m/s."""
    apart: Array
    parting: Array
    """r and u at the last step's end."""


class Drive(NamedTuple):
    """Harmonics of the load after the first, and a moving casing, of a block of cases."""

    load: Sequence[Wave]
    casing: Sequence[Wave]
    state: Moving


class DriveRows(NamedTuple):
    """The rows of a drive, of all cases or in lanes, ``(harmonic, row, …)`` and ``(row, …)``."""

    load_waves: Array
    casing_waves: Array
    moving: Array

    @property
    def named(self) -> Drive:
        """The rows by names, as kernels take them."""
        load, casing = (cast(Sequence[Wave], named_rows(Wave, rows)) for rows in (self.load_waves, self.casing_waves))
        return Drive(load, casing, named_rows(Moving, self.moving))


def placed(cases: Cases, duration: float) -> Cases:
    """Return cases whose tips are on the casing where they start there up to rounding."""
    place, (lengths, _) = cases.casing_at(0.0), cases.casing_harmonics.rounding_scales(duration)
    displacement = cases.displacement.copy()
    touches = np.abs(displacement[:, -1] - place) <= AT_REST * (lengths + np.abs(cases.gap))
    displacement[touches, -1] = place[touches]
    return replace(cases, displacement=displacement)


def drive_of(cases: Cases, h: float, theta: float, duration: float) -> tuple[DriveRows | None, Cases]:
    """Return the drive of cases that are stepped with h and θ, ``(…, case)``, and the cases with their first velocity.

    A tip that starts on the casing, see :func:`placed`, and moves with it up to rounding, has r = u = 0 and the
    velocity V(0): its own is ḋ(0), or V(0) where it ended pressed.
    """
    load, casing = cases.load_harmonics[:, 1:], cases.casing_harmonics
    if load.width + casing.width == 0:
        return None, cases
    gains = discrete_gains(casing.amplitude, casing.angular, h, theta)
    rows = DriveRows(_waves(load, h), _waves(casing, h), np.zeros((rows_in(Moving), cases.count)))
    drive, state = rows.named, rows.named.state
    begins = _discrete_velocity(casing, gains, 0.0)
    apart, parting = cases.displacement[:, -1] - cases.casing_at(0.0), cases.velocity[:, -1] - begins
    lengths, speeds = casing.rounding_scales(duration)
    speeds = speeds + np.abs(cases.velocity[:, -1]) + (lengths + np.abs(cases.gap)) / h
    beside = np.fmin(np.abs(parting), np.abs(cases.velocity[:, -1] - cases.casing_velocity_at(0.0)))
    held = (apart == 0) & (beside <= AT_REST * speeds)
    state.mean_gap = cases.gap
    state.speed = _discrete_velocity(casing, gains, -h)
    state.apart, state.parting = np.where(held, 0.0, apart), np.where(held, 0.0, parting)
    velocity = cases.velocity.copy()
    velocity[held, -1] = begins[held]
    for k, wave in enumerate(drive.casing):
        wave.speed_sine, wave.speed_cosine = gains[0][:, k], gains[1][:, k]
    return rows, replace(cases, velocity=velocity)


def discrete_gains(amplitude: Array | float, angular: Array, h: float, theta: float) -> tuple[Array, Array]:
    """Return a Re g and a Im g of harmonics of the casing, ``(case, harmonic)``: V per sine and per cosine.

    With s, c = sin, cos(ωh/2): g = (2/h) s (i c + (2θ-1) s) / (c² + (2θ-1)² s²).
    """
    s, c = elementwise.sine_cosine(0.5 * angular * h)
    lean = (2 * theta - 1) * s
    factor = amplitude * (2 / h) * s / (c * c + lean * lean)
    return factor * lean, factor * c


def _discrete_velocity(casing: Harmonics, gains: tuple[Array, Array], t: float) -> Array:
    """Return V(t), ``(case,)``."""
    total = np.zeros(casing.amplitude.shape[0])
    for k in range(casing.width):
        s, c = casing.sine_cosine(k, t)
        total += gains[0][:, k] * s + gains[1][:, k] * c
    return total


def _waves(harmonics: Harmonics, h: float) -> Array:
    """Return the rows of harmonics, ``(harmonic, row, case)``."""
    rows = np.zeros((harmonics.width, rows_in(Wave), harmonics.amplitude.shape[0]))
    waves: Any = named_rows(Wave, rows)
    turn_sine, turn_cosine = elementwise.sine_cosine(harmonics.angular * h)
    waves["turn_sine"], waves["turn_cosine"] = turn_sine.T, turn_cosine.T
    waves["amplitude"], waves["frequency"], waves["phase"] = (values.T for values in harmonics.rows)
    return rows


@inlined
def keep_apart(drive: Drive | None, lanes: int) -> None:
    """Take the tips of idle lanes, from ``lanes`` on, off a casing at rest."""
    if drive is not None:
        for lane in range(lanes, LANES):
            drive.state.apart[lane] = -1.0


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
def turn_drive(drive: Drive | None, step: int, h: float, theta: float, tip: Tips, lanes: int) -> None:
    """Advance loads and casing to the end of a step, t = step h, and store the casing's position there in ``tip``."""
    if drive is None:
        return
    load, casing, state = drive.load, drive.casing, drive.state
    placed = step % EXACT_EVERY == 0
    if placed:
        _place_waves(load, step * h, lanes)
        _place_waves(casing, step * h, lanes)
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        if not placed:
            _turn_waves(load, lane)
            _turn_waves(casing, lane)
        force, place, speed = spread(0.0, lane), pack(state.mean_gap, lane), spread(0.0, lane)
        for k in range(len(load)):
            force += pack(load[k].amplitude, lane) * pack(load[k].sine, lane)
        for k in range(len(casing)):
            s, c = pack(casing[k].sine, lane), pack(casing[k].cosine, lane)
            place += pack(casing[k].amplitude, lane) * s
            speed += pack(casing[k].speed_sine, lane) * s + pack(casing[k].speed_cosine, lane) * c
        before = pack(state.load_end, lane)
        store(state.load, lane, theta * force + (1.0 - theta) * before)
        store(state.load_end, lane, force)
        store(state.gap_before, lane, pack(tip.gap, lane))
        store(state.speed_before, lane, pack(state.speed, lane))
        store(state.speed, lane, speed)
        store(tip.gap, lane, place)


@inlined
def tip_before(drive: Drive | None, tip: Tips, gap: Pack, lane: Lane) -> tuple[Pack, Pack, Pack]:
    """Return position and velocity of the tip at the beginning, and the position of the casing: r, u, 0 if it moves."""
    if drive is None:
        return pack(tip.displacement, lane), pack(tip.velocity, lane), gap
    return pack(drive.state.apart, lane), pack(drive.state.parting, lane), spread(0.0, lane)


@inlined
def relative(drive: Drive | None, velocity: Pack, lane: Lane) -> Pack:
    """Return a velocity at the step's end, relative to the casing where that moves."""
    return velocity if drive is None else velocity - pack(drive.state.speed, lane)


@inlined
def onto_casing(drive: Drive | None, velocity: Pack, lane: Lane) -> Pack:
    """Return the absolute velocity at the step's end of one that is relative to the casing."""
    return velocity if drive is None else velocity + pack(drive.state.speed, lane)


@inlined
def relative_before(drive: Drive | None, velocity: Pack, lane: Lane) -> Pack:
    """Return a velocity at the step's beginning, relative to the casing where that moves."""
    return velocity if drive is None else velocity - pack(drive.state.speed_before, lane)


@inlined
def tip_after(drive: Drive | None, place: Pack, velocity: Pack, gap: Pack, lane: Lane) -> tuple[Pack, Pack]:
    """Store position and velocity of the tip at the step's end relative to the casing; return the absolute ones."""
    if drive is None:
        return place, velocity
    store(drive.state.apart, lane, place)
    store(drive.state.parting, lane, velocity)
    return gap + place, pack(drive.state.speed, lane) + velocity


@inlined
def gap_before(drive: Drive | None, gap: Pack, lane: Lane) -> Pack:
    """Return the casing's position at the step's beginning."""
    return gap if drive is None else pack(drive.state.gap_before, lane)


@inlined
def gap_ahead(drive: Drive | None, gap: Pack, h: float, lane: Lane) -> Pack:
    """Return the casing's position a step after ``gap``, for central differences."""
    return gap if drive is None else gap + h * pack(drive.state.speed, lane)


@inlined
def cut_gap(drive: Drive | None, share: float, tip: Tips, lanes: int) -> None:
    """Set the casing back to a fraction of the last step, by linear interpolation."""
    if drive is not None:
        for lane in range(lanes):
            before = drive.state.gap_before[lane]
            tip.gap[lane] = before + share * (tip.gap[lane] - before)
