"""The load at the tip, F0 + F1 sin(2π f t + φ), in a fixed step; one sine for lanes of the same frequency and phase."""

from __future__ import annotations

import numpy as np

from workflow.kernels import elementary
from workflow.kernels.compiled import inlined, part
from workflow.kernels.packs import Lane, Pack, pack
from workflow.models import Array

EXACT_EVERY = 64
"""Steps between exact evaluations of sin and cos of a load; in between a rotation continues it,
whose rounding stays below 64 eps = 1.4e-14 of the amplitude."""

LOAD_MEAN, LOAD_AMPLITUDE, LOAD_FREQUENCY, LOAD_PHASE = range(4)
"""Rows of a block's load F0 + F1 sin(2π f t + φ) ``(row, lane)``: N, N, Hz, rad."""

LOAD_SINE_BEFORE, LOAD_SINE, LOAD_COSINE, LOAD_TURN_SINE, LOAD_TURN_COSINE = range(4, 9)
"""Its sine at the beginning of the step, sine and cosine at its end, sine and cosine of the angle of a step."""

LOAD_WEIGHED_SINE = 9
"""The weighed sine where lanes differ in frequency or phase."""

LOAD_ROWS = LOAD_WEIGHED_SINE + 1


@part
def start_load(h: float, load: Array, lanes: int) -> int:
    """Set the load to t = 0 and its rotation to one step; return its leader.

    That is the lane whose sine holds for all lanes, with the same bits, as most batches share frequency and phase; -1
    where lanes differ in them.
    """
    leader = 0
    for lane in range(lanes):
        if load[LOAD_AMPLITUDE, lane] != 0.0 and load[LOAD_AMPLITUDE, leader] == 0.0:
            leader = lane
    frequency, phase, shared_by_all = load[LOAD_FREQUENCY, leader], load[LOAD_PHASE, leader], True
    for lane in range(lanes):
        still = load[LOAD_AMPLITUDE, lane] == 0.0 and np.isfinite(load[LOAD_FREQUENCY, lane] + load[LOAD_PHASE, lane])
        shared_by_all &= still or (load[LOAD_FREQUENCY, lane] == frequency and load[LOAD_PHASE, lane] == phase)
    for lane in range(lanes):
        turn = 2.0 * np.pi * load[LOAD_FREQUENCY, lane] * h
        load[LOAD_TURN_SINE, lane], load[LOAD_TURN_COSINE, lane] = elementary.sine_cosine(turn)
    leader = leader if shared_by_all else -1
    turn_load(0, h, leader, load, lanes)
    return leader


@inlined
def turn_load(step: int, h: float, leader: int, load: Array, lanes: int) -> None:
    """Move the load to the end of a step, t = step h."""
    first, last = (leader, leader + 1) if leader >= 0 else (0, lanes)
    for lane in range(first, last):
        s, c = load[LOAD_SINE, lane], load[LOAD_COSINE, lane]
        load[LOAD_SINE_BEFORE, lane] = s
        load[LOAD_SINE, lane] = s * load[LOAD_TURN_COSINE, lane] + c * load[LOAD_TURN_SINE, lane]
        load[LOAD_COSINE, lane] = c * load[LOAD_TURN_COSINE, lane] - s * load[LOAD_TURN_SINE, lane]
    if step % EXACT_EVERY == 0:
        for lane in range(first, last):
            angle = 2.0 * np.pi * (load[LOAD_FREQUENCY, lane] * (step * h)) + load[LOAD_PHASE, lane]
            load[LOAD_SINE, lane], load[LOAD_COSINE, lane] = elementary.sine_cosine(angle)


@inlined
def weigh_load(before: float, after: float, leader: int, load: Array, lanes: int) -> float:
    """Weigh the sine at the step's beginning and end.

    Returns that of all lanes where they have a ``leader``; else 0, and each lane has its own in ``LOAD_WEIGHED_SINE``.
    """
    if leader >= 0:
        return float(before * load[LOAD_SINE_BEFORE, leader] + after * load[LOAD_SINE, leader])
    for lane in range(lanes):
        load[LOAD_WEIGHED_SINE, lane] = before * load[LOAD_SINE_BEFORE, lane] + after * load[LOAD_SINE, lane]
    return 0.0


@inlined
def tip_load(sine: float, leader: int, load: Array, lane: Lane) -> Pack:
    """Return the load at the tip, N, for what :func:`weigh_load` returned, ``sine``."""
    mean, amplitude = pack(load, (LOAD_MEAN, lane)), pack(load, (LOAD_AMPLITUDE, lane))
    return mean + (amplitude * sine if leader >= 0 else amplitude * pack(load, (LOAD_WEIGHED_SINE, lane)))
