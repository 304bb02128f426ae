"""One case of the event-driven scheme in one kernel: its march and, where they are asked for, its balances.

Both call mostly the same functions, which one kernel compiles once.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels.compiled import rolled, uncounted
from workflow.schemes._exact import outcome
from workflow.schemes._exact.energy_balance import Regimes, residuals
from workflow.schemes._exact.impacts import Case
from workflow.schemes._exact.layout import Layout, Memory
from workflow.schemes._exact.march import march
from workflow.schemes._exact.phase_log import Log
from workflow.schemes._exact.record import Record


@uncounted
@rolled
def march_and_balance(
    free: Layout,
    held: Layout,
    balanced: Regimes,
    case: Case,
    record: Record,
    memories: tuple[Memory, Memory],
    log: Log,
) -> tuple[int, float, float]:
    """Return how a case ended, see :mod:`workflow.schemes._exact.outcome`, and its residuals of energy and heat.

    They are NaN where the case did not complete, or ``log`` has no room for phases; never raises.
    """
    ended = march(free, held, case, record, memories, log)
    if ended != outcome.COMPLETED or log.held.size == 0:
        return ended, np.nan, np.nan
    energy, warmth = residuals(balanced, case, memories, log, record.tally)
    return ended, energy, warmth
