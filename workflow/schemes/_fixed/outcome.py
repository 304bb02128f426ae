"""Status and messages of the cases of a batch, for schemes with a fixed step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.models import Cases
from workflow.schemes._interface import Results, Sampling, Status, merge

Outcome = tuple[NDArray[np.int8], dict[int, str]]
"""Status of each case, and the message of each that is not ok."""

ROUNDING = 16 * np.finfo(float).eps
"""Excess of a spectral radius over 1 up to which it is the rounding of the few operations that compute it."""


def effective_restitution(approached: Array, separated: Array) -> dict[str, Array]:
    """Return -Σ v⁺v⁻ / Σ (v⁻)² of each case; NaN where no contact has ended or a sum is not finite."""
    met = (approached > 0) & np.isfinite(approached) & np.isfinite(separated)
    return {"effective_restitution": np.where(met, separated / np.where(met, approached, 1.0), np.nan)}


class Operator(Protocol):
    """Common data of a batch."""

    def run(self, cases: Cases, sampling: Sampling, heated: bool) -> Results:
        """Step cases that all carry thermal states, or that all carry none."""


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    heated = cases.heated
    groups = [(np.flatnonzero(heated), True), (np.flatnonzero(~heated), False)]
    with np.errstate(over="ignore", invalid="ignore"):  # the status reports a case that is not finite
        return merge([(which, operator.run(cases.take(which), sampling, hot)) for which, hot in groups if which.size])


def judged(
    finite: NDArray[np.bool_], ill_posed: Any, explain: Callable[[int], str], grown: str | None, left: str
) -> Outcome:
    """Return status and message of each case: by theory where there is one, else by whether its last state is finite.

    Parameters
    ----------
    finite, ill_posed
        Whether a case ended with finite numbers; whether its contact has no unique solution, ``(case,)`` or one
        for all.
    explain
        ``explain(case)``: message of an ill-posed case that is not finite.
    grown
        Message of all others where the free step is unstable, ``None`` where it is stable.
    left
        Message of cases that are not finite for neither reason.
    """
    lost = ill_posed & ~finite
    status = np.where(lost, Status.ILL_POSED, np.where(finite & (grown is None), Status.OK, Status.DIVERGED))
    ended = map(int, np.flatnonzero(status != Status.OK))
    return status.astype(np.int8), {case: explain(case) if lost[case] else grown or left for case in ended}
