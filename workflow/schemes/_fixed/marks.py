"""Samples and load periods of a block of cases, and the steps in which they are due."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import PACK
from workflow.kernels.packs import narrow, pack, store
from workflow.models import Array
from workflow.schemes._fixed.drive import Drive
from workflow.schemes._fixed.rows import Tips
from workflow.schemes._fixed.tip_load import TipLoads

NEVER = np.iinfo(np.int64).max

WAITING = 8
"""Samples that are buffered until they fill a cache line, which is then written whole."""


class Marks(NamedTuple):
    """Steps in which a sample or the end of a load period is due, and the fraction of the step at which it lies."""

    sample_due: NDArray[np.int64]
    sample_weight: Array
    period_due: NDArray[np.int64]
    period_weight: Array
    """``(case, period)``."""
    next_mark: NDArray[np.int64]
    """The next step in which anything is due, the next sample, the next step that ends a load period, ``(3,)``; of a
    batch ``(block, 3)``."""
    next_period: NDArray[np.int64]
    """``(case,)``."""


class BlockRecord(NamedTuple):
    """Output arrays of samples and of load periods that have ended."""

    histories: Array
    """Displacement, velocity, temperature and impulse, ``(case, 4, t)``: any range of cases is contiguous,
    so that kernels are compiled for one kind of array."""
    samples: Array
    """Buffered samples, a row for each quantity and sample, ``(4 * WAITING, lane)``."""
    periods: Array
    """Impulse, largest temperature, contact time, displacement, velocity and temperature at the end, and impacts,
    ``(case, 7, period)``."""


class Block(NamedTuple):
    """Up to ``LANES`` consecutive cases that a kernel steps at once."""

    load: TipLoads
    tip: Tips
    marks: Marks
    record: BlockRecord
    drive: Drive | None
    lanes: int
    """Lanes in use, whole packs; the cases come first, idle lanes last."""
    steps: int
    h: float


@inlined
def _between(before: Any, after: Any, share: float) -> Any:
    """Interpolate a number or a pack linearly at a fraction of a step; the step's end itself is exact."""
    return after if share == 1.0 else before + share * (after - before)


@part
def _close_periods(step: int, block: Block) -> None:
    """Write the load periods that end within this step, and find the step in which the next one ends."""
    tip, h, periods = block.tip, block.h, block.record.periods
    period_due, period_weight, next_period = block.marks.period_due, block.marks.period_weight, block.marks.next_period
    first = NEVER
    for lane in range(period_due.shape[0]):
        while next_period[lane] < period_due.shape[1] and period_due[lane, next_period[lane]] == step:
            k = next_period[lane]
            share = period_weight[lane, k]
            p = tip.step_impulse[lane]
            impulse = _between(tip.impulse[lane], tip.impulse[lane] + p, share)
            reached = _between(tip.temperature[lane], tip.new_temperature[lane], share)
            contact = tip.contact_time[lane] + (share * h if p > 0.0 else 0.0)
            periods[lane, 0, k] = impulse - tip.period_impulse[lane]
            periods[lane, 1, k] = max(tip.period_hottest[lane], reached)
            periods[lane, 2, k] = contact - tip.period_contact[lane]
            periods[lane, 3, k] = _between(tip.displacement[lane], tip.new_displacement[lane], share)
            periods[lane, 4, k] = _between(tip.velocity[lane], tip.new_velocity[lane], share)
            periods[lane, 5, k] = reached
            strikes = 1.0 if p > 0.0 and tip.touching[lane] == 0.0 else 0.0
            periods[lane, 6, k] = tip.impacts[lane] + strikes - tip.period_impacts[lane]
            tip.period_impacts[lane] = tip.impacts[lane] + strikes
            tip.hottest[lane] = max(tip.hottest[lane], periods[lane, 1, k])
            tip.period_impulse[lane] = impulse
            tip.period_contact[lane] = contact
            tip.period_hottest[lane] = reached
            next_period[lane] = k + 1
        if next_period[lane] < period_due.shape[1]:
            first = min(first, period_due[lane, next_period[lane]])
    block.marks.next_mark[2] = first


@part
def _sample(k: int, share: float, block: Block) -> None:
    """Interpolate sample k at a fraction ``share`` of the step; write ``WAITING`` samples at a time."""
    tip, waiting, histories = block.tip, block.record.samples, block.record.histories
    slot = (k - 1) % WAITING
    for first in range(0, block.lanes, PACK):
        lane = narrow(first)
        impulse = pack(tip.impulse, lane)
        for j, begun, ended in (
            (0, pack(tip.displacement, lane), pack(tip.new_displacement, lane)),
            (1, pack(tip.velocity, lane), pack(tip.new_velocity, lane)),
            (2, pack(tip.temperature, lane), pack(tip.new_temperature, lane)),
            (3, impulse, impulse + pack(tip.step_impulse, lane)),
        ):
            store(waiting, (j * WAITING + slot, lane), _between(begun, ended, share))
    if slot == WAITING - 1 or k == histories.shape[2] - 1:
        for case in range(histories.shape[0]):
            for j in range(histories.shape[1]):
                for i in range(slot + 1):
                    histories[case, j, k - slot + i] = waiting[j * WAITING + i, case]


@part
def take_marks(step: int, block: Block) -> float:
    """Write the samples and load periods that are due within this step; return the part of the step that counts, s.

    All steps but the last count whole, the last up to the duration, where the last sample lies; the tip's new values
    are interpolated there.
    """
    tip, lanes, h, steps = block.tip, block.lanes, block.h, block.steps
    next_mark = block.marks.next_mark
    due, weight = block.marks.sample_due, block.marks.sample_weight
    mark = steps
    while next_mark[1] < due.size and due[next_mark[1]] == step:
        _sample(next_mark[1], weight[next_mark[1]], block)
        next_mark[1] += 1
    if next_mark[1] < due.size:
        mark = due[next_mark[1]]
    if step == next_mark[2]:
        _close_periods(step, block)
    next_mark[0] = min(mark, next_mark[2])
    share = weight[-1] if step == steps else 1.0
    if share != 1.0:
        for lane in range(lanes):
            tip.new_displacement[lane] = _between(tip.displacement[lane], tip.new_displacement[lane], share)
            tip.new_velocity[lane] = _between(tip.velocity[lane], tip.new_velocity[lane], share)
            tip.new_temperature[lane] = _between(tip.temperature[lane], tip.new_temperature[lane], share)
            tip.step_impulse[lane] *= share
    return share * h
