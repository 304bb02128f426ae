"""What drives a block beside the sinusoid of its load: harmonics of the load, and a casing that moves.

A scheme with a fixed step sees the casing d(t) = d + Σ a_m sin(ω_m t + φ_m) through a discrete velocity

    V(t) = Σ Im[g_m a_m e^{i(ω_m t + φ_m)}],   g_m = (e^{iω_m h} - 1) / (h (1 - θ + θ e^{iω_m h})),

for which h (θ V_{k+1} + (1-θ) V_k) = d_{k+1} - d_k exactly. The tip is stepped relative to the casing, r = x_n - d and
u = v_n - V, with r_{k+1} = r_k + h (θ u_{k+1} + (1-θ) u_k): a pressed tip, u = 0, follows the casing without drift.
Central differences take θ = 0: V_k = (d_{k+1} - d_k)/h, the casing's velocity from t_k to t_{k+1}.

Kernels are given ``None`` in the place of a :class:`Drive` where a scene has no harmonics, and are then compiled
without it: what a scene does not have costs it nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import elementary, elementwise
from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import PACK, ROW, fill_lanes, lane_rows
from workflow.kernels.packs import Lane, Pack, narrow, pack, spread, store
from workflow.models import Array, Cases, Harmonics
from workflow.schemes._fixed import tip_row
from workflow.schemes._fixed.tip_load import EXACT_EVERY

WAVE_SINE, WAVE_COSINE, WAVE_TURN_SINE, WAVE_TURN_COSINE = range(4)
"""Rows of a harmonic ``(harmonic, row, lane)``: its sine and cosine, and those of the angle of a step."""

WAVE_AMPLITUDE, WAVE_FREQUENCY, WAVE_PHASE, WAVE_SPEED_SINE, WAVE_SPEED_COSINE = range(4, 9)
"""Its amplitude [N or m], frequency [Hz] and phase; of the casing also V per sine and cosine [m/s]."""

WAVE_ROWS = WAVE_SPEED_COSINE + 1

DRIVE_LOAD, DRIVE_LOAD_END = range(2)
"""Rows of a block's drive ``(row, lane)``: harmonics of the load, N, weighed by 1 - θ and θ and at the step's end."""

DRIVE_MEAN_GAP, DRIVE_GAP_BEFORE, DRIVE_SPEED_BEFORE, DRIVE_SPEED = range(2, 6)
"""d without harmonics and at the step's beginning, m; V at its beginning and end, m/s."""

DRIVE_APART, DRIVE_PARTING = range(6, 8)
"""r and u at the last step's end."""

DRIVE_ROWS = DRIVE_PARTING + 1

_ROUNDING = 8 * np.finfo(float).eps
"""Share of the lengths and velocities in r and u up to which they are rounding at t = 0."""


class Drive(NamedTuple):
    """Harmonics of the load and a casing that moves, of all cases or a block.

    Kernels are given ``None`` in its place where a scene has neither.
    """

    load: Array
    """Harmonics of the load, ``(harmonic, row, lane)``."""
    casing: Array
    """Harmonics of the casing, ``(harmonic, row, lane)``."""
    state: Array
    """What they do in a step, ``(row, lane)``."""


def drive_of(cases: Cases, h: float, theta: float) -> tuple[Drive | None, Cases]:
    """Return what drives cases that are stepped with h and θ, ``(…, case)``, and the cases as they are stepped.

    A tip that starts on the casing and moves with it, both up to rounding, has r = u = 0 and the velocity V(0).
    """
    load, casing = cases.load_harmonics, cases.casing_harmonics
    if load.width + casing.width == 0:
        return None, cases
    gains = _gains(casing, h, theta)
    state = np.zeros((DRIVE_ROWS, cases.count))
    begins = _discrete_velocity(casing, gains, 0.0)
    apart, parting = cases.displacement[:, -1] - cases.casing_at(0.0), cases.velocity[:, -1] - begins
    held = _moves_along(cases, apart)
    state[DRIVE_MEAN_GAP] = cases.gap
    state[DRIVE_SPEED] = _discrete_velocity(casing, gains, -h)
    state[DRIVE_APART], state[DRIVE_PARTING] = np.where(held, 0.0, apart), np.where(held, 0.0, parting)
    velocity = cases.velocity.copy()
    velocity[held, -1] = begins[held]
    swings = _waves(casing, h)
    swings[:, WAVE_SPEED_SINE], swings[:, WAVE_SPEED_COSINE] = gains[0].T, gains[1].T
    return Drive(_waves(load, h), swings, state), replace(cases, velocity=velocity)


def _moves_along(cases: Cases, apart: Array) -> NDArray[np.bool_]:
    """Tell which tips begin on the casing with its velocity ḋ(0), up to rounding, ``(case,)``."""
    casing, x, v = cases.casing_harmonics, cases.displacement[:, -1], cases.velocity[:, -1]
    lengths = np.abs(x) + np.abs(cases.gap) + casing.reach
    speeds = np.abs(v) + np.abs(casing.amplitude * casing.angular).sum(axis=1)
    beside = np.abs(v - cases.casing_velocity_at(0.0))
    return np.asarray((np.abs(apart) <= _ROUNDING * lengths) & (beside <= _ROUNDING * speeds))


def _gains(casing: Harmonics, h: float, theta: float) -> tuple[Array, Array]:
    """Return a Re g and a Im g of the casing's harmonics, ``(case, harmonic)``: V per sine and per cosine.

    With s, c = sin, cos(ωh/2): g = (2/h) s (i c + (2θ-1) s) / (c² + (2θ-1)² s²).
    """
    s, c = elementwise.sine_cosine(0.5 * casing.angular * h)
    lean = (2 * theta - 1) * s
    factor = casing.amplitude * (2 / h) * s / (c * c + lean * lean)
    return factor * lean, factor * c


def _discrete_velocity(casing: Harmonics, gains: tuple[Array, Array], t: float) -> Array:
    """Return V(t), ``(case,)``."""
    total = np.zeros(casing.amplitude.shape[0])
    for k in range(casing.width):
        s, c = casing.sine_cosine(k, t)
        total += gains[0][:, k] * s + gains[1][:, k] * c
    return total


def _waves(harmonics: Harmonics, h: float) -> Array:
    """Return the rows ``WAVE_…`` of harmonics, ``(harmonic, row, case)``."""
    waves = np.zeros((harmonics.width, WAVE_ROWS, harmonics.amplitude.shape[0]))
    turn = elementwise.sine_cosine(harmonics.angular * h)
    rows = (*(values.T for values in turn), *(values.T for values in harmonics.rows))
    for row, values in zip(range(WAVE_TURN_SINE, WAVE_PHASE + 1), rows, strict=True):
        waves[:, row] = values
    return waves


def drive_lanes(drive: Drive | None) -> Drive | None:
    """Return rows of lanes for a drive, which :func:`fill_drive` fills."""
    return None if drive is None else Drive(*(lane_rows(*rows.shape[:-1]) for rows in drive))


def fill_drive(lanes: Drive | None, drive: Drive | None, part: slice) -> None:
    """Put some cases of a drive in the lanes; idle lanes are apart from a casing at rest."""
    if lanes is None or drive is None:
        return
    for rows, values in zip(lanes, drive, strict=True):
        fill_lanes(rows, values[..., part])
    lanes.state[DRIVE_APART, part.stop - part.start :] = -1.0


@part
def _place_waves(waves: Array, t: float, lanes: int) -> None:
    """Set sine and cosine of harmonics to a time."""
    for k in range(waves.shape[0]):
        for lane in range(lanes):
            angle = 2.0 * np.pi * (waves[k, WAVE_FREQUENCY, lane] * t) + waves[k, WAVE_PHASE, lane]
            waves[k, WAVE_SINE, lane], waves[k, WAVE_COSINE, lane] = elementary.sine_cosine(angle)


@inlined
def _turn_waves(waves: Array, lane: Lane) -> None:
    """Turn harmonics by the angle of a step."""
    for k in range(waves.shape[0]):
        s, c = pack(waves, (k, WAVE_SINE, lane)), pack(waves, (k, WAVE_COSINE, lane))
        turn_s, turn_c = pack(waves, (k, WAVE_TURN_SINE, lane)), pack(waves, (k, WAVE_TURN_COSINE, lane))
        store(waves, (k, WAVE_SINE, lane), s * turn_c + c * turn_s)
        store(waves, (k, WAVE_COSINE, lane), c * turn_c - s * turn_s)


@inlined
def turn_drive(drive: Drive | None, step: int, h: float, theta: float, tip: Array, lanes: int) -> None:
    """Move loads and casing to the end of a step, t = step h; ``tip`` is given the casing's place there."""
    if drive is None:
        return
    load, casing, state = drive.load, drive.casing, drive.state
    assert load.shape[1] == WAVE_ROWS
    assert load.shape[2] == ROW
    assert casing.shape[1] == WAVE_ROWS
    assert casing.shape[2] == ROW
    assert state.shape[1] == ROW
    placed = step % EXACT_EVERY == 0
    if placed:
        _place_waves(load, step * h, lanes)
        _place_waves(casing, step * h, lanes)
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        if not placed:
            _turn_waves(load, lane)
            _turn_waves(casing, lane)
        force, place, speed = spread(0.0, lane), pack(state, (DRIVE_MEAN_GAP, lane)), spread(0.0, lane)
        for k in range(load.shape[0]):
            force += pack(load, (k, WAVE_AMPLITUDE, lane)) * pack(load, (k, WAVE_SINE, lane))
        for k in range(casing.shape[0]):
            s, c = pack(casing, (k, WAVE_SINE, lane)), pack(casing, (k, WAVE_COSINE, lane))
            place += pack(casing, (k, WAVE_AMPLITUDE, lane)) * s
            speed += pack(casing, (k, WAVE_SPEED_SINE, lane)) * s + pack(casing, (k, WAVE_SPEED_COSINE, lane)) * c
        before = pack(state, (DRIVE_LOAD_END, lane))
        store(state, (DRIVE_LOAD, lane), theta * force + (1.0 - theta) * before)
        store(state, (DRIVE_LOAD_END, lane), force)
        store(state, (DRIVE_GAP_BEFORE, lane), pack(tip, (tip_row.GAP, lane)))
        store(state, (DRIVE_SPEED_BEFORE, lane), pack(state, (DRIVE_SPEED, lane)))
        store(state, (DRIVE_SPEED, lane), speed)
        store(tip, (tip_row.GAP, lane), place)


@inlined
def with_harmonics(drive: Drive | None, load: Pack, lane: Lane) -> Pack:
    """Return the load at the tip in a step with its harmonics, N."""
    return load if drive is None else load + pack(drive.state, (DRIVE_LOAD, lane))


@inlined
def tip_before(drive: Drive | None, tip: Array, lane: Lane) -> tuple[Pack, Pack]:
    """Return place and velocity of the tip at the step's beginning: r and u where the casing moves."""
    if drive is None:
        return pack(tip, (tip_row.DISPLACEMENT, lane)), pack(tip, (tip_row.VELOCITY, lane))
    return pack(drive.state, (DRIVE_APART, lane)), pack(drive.state, (DRIVE_PARTING, lane))


@inlined
def casing_place(drive: Drive | None, gap: Pack, lane: Lane) -> Pack:
    """Return where the casing is for what :func:`tip_before` returns."""
    return gap if drive is None else spread(0.0, lane)


@inlined
def relative(drive: Drive | None, velocity: Pack, lane: Lane) -> Pack:
    """Return a velocity at the step's end, relative to the casing where that moves."""
    return velocity if drive is None else velocity - pack(drive.state, (DRIVE_SPEED, lane))


@inlined
def onto_casing(drive: Drive | None, velocity: Pack, lane: Lane) -> Pack:
    """Return a velocity at the step's end from that relative to the casing."""
    return velocity if drive is None else velocity + pack(drive.state, (DRIVE_SPEED, lane))


@inlined
def relative_before(drive: Drive | None, velocity: Pack, lane: Lane) -> Pack:
    """Return a velocity at the step's beginning, relative to the casing where that moves."""
    return velocity if drive is None else velocity - pack(drive.state, (DRIVE_SPEED_BEFORE, lane))


@inlined
def tip_after(drive: Drive | None, place: Pack, velocity: Pack, gap: Pack, lane: Lane) -> tuple[Pack, Pack]:
    """Return place and velocity of the tip at the step's end from those relative to the casing, which are kept."""
    if drive is None:
        return place, velocity
    store(drive.state, (DRIVE_APART, lane), place)
    store(drive.state, (DRIVE_PARTING, lane), velocity)
    return gap + place, pack(drive.state, (DRIVE_SPEED, lane)) + velocity


@inlined
def gap_before(drive: Drive | None, gap: Pack, lane: Lane) -> Pack:
    """Return the casing's place at the step's beginning."""
    return gap if drive is None else pack(drive.state, (DRIVE_GAP_BEFORE, lane))


@inlined
def gap_ahead(drive: Drive | None, gap: Pack, h: float, lane: Lane) -> Pack:
    """Return the casing's place a step after ``gap``, for central differences."""
    return gap if drive is None else gap + h * pack(drive.state, (DRIVE_SPEED, lane))


@inlined
def cut_gap(drive: Drive | None, share: float, tip: Array, lanes: int) -> None:
    """Take the casing back to a share of the last step."""
    if drive is not None:
        for lane in range(lanes):
            before = drive.state[DRIVE_GAP_BEFORE, lane]
            tip[tip_row.GAP, lane] = before + share * (tip[tip_row.GAP, lane] - before)
