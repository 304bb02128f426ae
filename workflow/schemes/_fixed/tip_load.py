"""The load at the tip, F0 + F1 sin(2π f t + φ), in a fixed step; one sine for lanes of the same frequency and phase.

It is not one of the harmonics of :mod:`~workflow.schemes._fixed.drive`, where each lane has a sine of its own, which
takes longer.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import elementary
from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import Rows
from workflow.kernels.packs import Lane, Pack, pack
from workflow.models import Array

EXACT_EVERY = 64
"""Steps between evaluations of sin and cos of a load; in between both are rotated by the angle of a step, with a
rounding below 64 eps = 1.4e-14 of the amplitude."""


class TipLoads(Rows):
    """The loads of a block, F0 + F1 sin(2π f t + φ)."""

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
def tip_load(sine: float, leader: int, load: TipLoads, lane: Lane) -> Pack:
    """Return the load at the tip, N, for the ``sine`` that :func:`weigh_load` returned."""
    mean, amplitude = pack(load.mean, lane), pack(load.amplitude, lane)
    return mean + (amplitude * sine if leader >= 0 else amplitude * pack(load.weighed_sine, lane))
