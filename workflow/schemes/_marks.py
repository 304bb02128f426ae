"""Marks: steps in which samples fall due or load periods end, and the block of cases they belong to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.schemes._kernel import inlined, part
from workflow.schemes._lanes import PACK
from workflow.schemes._packs import Pack, fetch, narrow, pack, store

DISPLACEMENT, VELOCITY, TEMPERATURE, IMPULSE, GAP = range(5)
"""Rows of a block's tip: its state at the last step end and the clearance."""

TOUCHING, IMPACTS, CONTACT_TIME, PENETRATION, HOTTEST, PERIOD_IMPULSE, PERIOD_CONTACT, PERIOD_HOTTEST = range(5, 13)
"""What has been counted so far, the highest temperature of the load periods that are closed and of the
present one, and where sums stood when that began."""

NEW_DISPLACEMENT, NEW_VELOCITY, NEW_TEMPERATURE, STEP_IMPULSE = range(13, 17)
"""What a scheme hands to :func:`observe`: the tip at the end of the step, the impulse in it."""

TIP_ROWS = STEP_IMPULSE + 1

NEVER = np.iinfo(np.int64).max

WAITING = 8
"""Samples that wait until they fill a line of the cache, which is then written whole."""


class Marks(NamedTuple):
    """Steps in which a sample or the end of a load period falls due, and at which share."""

    sample_due: NDArray[np.int64]
    sample_weight: Array
    period_due: NDArray[np.int64]
    period_weight: Array
    """``(case, period)``."""
    next_mark: NDArray[np.int64]
    """The next step in which something falls due, the next sample, the next step that ends a load period, ``(3,)``."""
    next_period: NDArray[np.int64]
    """``(case,)``."""


class Record(NamedTuple):
    """Where samples and closed load periods are written."""

    histories: Array
    """Displacement, velocity, temperature and impulse, ``(case, 4, t)``: any range of cases lies in one piece,
    so that kernels are compiled for one kind of array."""
    samples: Array
    """Samples that wait, a row for each and quantity, ``(4 * WAITING, lane)``."""
    periods: Array
    """Impulse, largest temperature and contact time, ``(case, 3, period)``."""


class Block(NamedTuple):
    """Up to ``LANES`` consecutive cases that a kernel steps at once; its view of them."""

    load: Array
    tip: Array
    marks: Marks
    record: Record
    lanes: int
    """Lanes in use, whole packs; the cases come first, idle lanes last."""
    steps: int
    h: float


@inlined
def _between(before: float, after: float, share: float) -> float:
    """Linear between step ends; a step end itself is taken exactly."""
    return after if share == 1.0 else before + share * (after - before)


@part
def _close_periods(step: int, block: Block) -> None:
    """Close the load periods that end within this step, and note when the next one does."""
    tip, h, periods = block.tip, block.h, block.record.periods
    period_due, period_weight, next_period = block.marks.period_due, block.marks.period_weight, block.marks.next_period
    first = NEVER
    for lane in range(period_due.shape[0]):
        while next_period[lane] < period_due.shape[1] and period_due[lane, next_period[lane]] == step:
            k = next_period[lane]
            share = period_weight[lane, k]
            p = tip[STEP_IMPULSE, lane]
            impulse = _between(tip[IMPULSE, lane], tip[IMPULSE, lane] + p, share)
            reached = _between(tip[TEMPERATURE, lane], tip[NEW_TEMPERATURE, lane], share)
            contact = tip[CONTACT_TIME, lane] + (share * h if p > 0.0 else 0.0)
            periods[lane, 0, k] = impulse - tip[PERIOD_IMPULSE, lane]
            periods[lane, 1, k] = max(tip[PERIOD_HOTTEST, lane], reached)
            periods[lane, 2, k] = contact - tip[PERIOD_CONTACT, lane]
            tip[HOTTEST, lane] = max(tip[HOTTEST, lane], periods[lane, 1, k])
            tip[PERIOD_IMPULSE, lane] = impulse
            tip[PERIOD_CONTACT, lane] = contact
            tip[PERIOD_HOTTEST, lane] = reached
            next_period[lane] = k + 1
        if next_period[lane] < period_due.shape[1]:
            first = min(first, period_due[lane, next_period[lane]])
    block.marks.next_mark[2] = first


@inlined
def _sampled(before: Pack, after: Pack, share: float) -> Pack:
    """Return :func:`_between` of each lane."""
    return after if share == 1.0 else before + share * (after - before)


@part
def _sample(k: int, share: float, block: Block) -> None:
    """Take sample k, which lies at a ``share`` of the step; write those that wait when they are enough.

    Some of the lines they will be written to are fetched with each sample: all at once they would be waited for.
    """
    tip, waiting, histories = block.tip, block.record.samples, block.record.histories
    slot = (k - 1) % WAITING
    last = min(k - slot + WAITING, histories.shape[2]) - 1
    for case in range(slot, histories.shape[0], WAITING):
        for j in range(histories.shape[1]):
            fetch(histories, (case, j, last))
    for first in range(0, block.lanes, PACK):
        lane = narrow(first)
        for j in range(IMPULSE):
            x = _sampled(pack(tip, (j, lane)), pack(tip, (NEW_DISPLACEMENT + j, lane)), share)
            store(waiting, (j * WAITING + slot, lane), x)
        impulse = pack(tip, (IMPULSE, lane))
        after = impulse + pack(tip, (STEP_IMPULSE, lane))
        store(waiting, (IMPULSE * WAITING + slot, lane), _sampled(impulse, after, share))
    if slot == WAITING - 1 or k == histories.shape[2] - 1:
        for case in range(histories.shape[0]):
            for j in range(histories.shape[1]):
                for i in range(slot + 1):
                    histories[case, j, k - slot + i] = waiting[j * WAITING + i, case]


@part
def take_marks(step: int, block: Block) -> float:
    """Write the samples and close the load periods that end within this step.

    Returns the part of the step that counts, s: all but the last one count whole, the last up to
    the duration, where the last sample lies; there the tip's new values are cut back to it.
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
            tip[NEW_DISPLACEMENT, lane] = _between(tip[DISPLACEMENT, lane], tip[NEW_DISPLACEMENT, lane], share)
            tip[NEW_VELOCITY, lane] = _between(tip[VELOCITY, lane], tip[NEW_VELOCITY, lane], share)
            tip[NEW_TEMPERATURE, lane] = _between(tip[TEMPERATURE, lane], tip[NEW_TEMPERATURE, lane], share)
            tip[STEP_IMPULSE, lane] *= share
    return share * h
