"""The load at the tip, F0 + F1 sin(2π f t + φ), in a fixed-step scheme: one sine for all lanes where it can be."""

from __future__ import annotations

import numpy as np

from workflow.models import Array
from workflow.schemes._kernel import inlined, part
from workflow.schemes._packs import Lane, Pack, pack

RESYNC = 64
"""Steps between exact evaluations of sin and cos of a load; in between a rotation continues it,
whose rounding stays below 64 eps = 1.4e-14 of the amplitude."""

MEAN, AMPLITUDE, FREQUENCY, PHASE, SINE_BEFORE, SINE, COSINE, TURN_SINE, TURN_COSINE = range(9)
"""Rows of a block's load F0 + F1 sin(2π f t + φ): what it is, its sine at the beginning of the step,
sine and cosine at its end, and their turn in one step."""

OWN_SINE, BALANCE_SINE = range(TURN_COSINE + 1, TURN_COSINE + 3)
"""Rows of the weighed sines of lanes that swing apart: the one that acts, and one of the balances."""

LOAD_ROWS = BALANCE_SINE + 1


@part
def start_load(h: float, load: Array, lanes: int) -> int:
    """Set the load to t = 0 and its rotation to one step; return its leader.

    That is the lane whose sine serves all lanes, as most batches share frequency and phase, with the bits of
    their own; or -1 where they swing apart.
    """
    leader = 0
    for lane in range(lanes):
        if load[AMPLITUDE, lane] != 0.0 and load[AMPLITUDE, leader] == 0.0:
            leader = lane
    frequency, phase, shared_by_all = load[FREQUENCY, leader], load[PHASE, leader], True
    for lane in range(lanes):
        still = load[AMPLITUDE, lane] == 0.0 and np.isfinite(load[FREQUENCY, lane] + load[PHASE, lane])
        shared_by_all &= still or (load[FREQUENCY, lane] == frequency and load[PHASE, lane] == phase)
    for lane in range(lanes):
        turn = 2.0 * np.pi * load[FREQUENCY, lane] * h
        load[TURN_SINE, lane] = np.sin(turn)
        load[TURN_COSINE, lane] = np.cos(turn)
    leader = leader if shared_by_all else -1
    turn_load(0, h, leader, load, lanes)
    return leader


@inlined
def turn_load(step: int, h: float, leader: int, load: Array, lanes: int) -> None:
    """Move the load to the end of a step, t = step h."""
    first, last = (leader, leader + 1) if leader >= 0 else (0, lanes)
    for lane in range(first, last):
        s, c = load[SINE, lane], load[COSINE, lane]
        load[SINE_BEFORE, lane] = s
        load[SINE, lane] = s * load[TURN_COSINE, lane] + c * load[TURN_SINE, lane]
        load[COSINE, lane] = c * load[TURN_COSINE, lane] - s * load[TURN_SINE, lane]
    if step % RESYNC == 0:
        for lane in range(first, last):
            angle = 2.0 * np.pi * (load[FREQUENCY, lane] * (step * h)) + load[PHASE, lane]
            load[SINE, lane] = np.sin(angle)
            load[COSINE, lane] = np.cos(angle)


@inlined
def weigh_load(before: float, after: float, row: int, leader: int, load: Array, lanes: int) -> float:
    """Weigh the sine at the step's beginning and end.

    Returns that of all lanes where one serves them; else it is 0 and each lane is given its own in ``row``.
    """
    if leader >= 0:
        return float(before * load[SINE_BEFORE, leader] + after * load[SINE, leader])
    for lane in range(lanes):
        load[row, lane] = before * load[SINE_BEFORE, lane] + after * load[SINE, lane]
    return 0.0


@inlined
def tip_load(sine: float, leader: int, load: Array, lane: Lane) -> Pack:
    """Return the load's force at the tip, N, as :func:`weigh_load` left its own sine, which returned ``sine``."""
    mean, amplitude = pack(load, (MEAN, lane)), pack(load, (AMPLITUDE, lane))
    return mean + (amplitude * sine if leader >= 0 else amplitude * pack(load, (OWN_SINE, lane)))
