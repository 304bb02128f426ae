"""How the cases of a batch ended: what schemes with a fixed step share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workflow.kernels import Array
from workflow.models import Cases
from workflow.schemes._fixed.contact import CASE_APPROACHED, CASE_SEPARATED
from workflow.schemes._interface import Results, merge

ROUNDING = 16 * np.finfo(float).eps
"""A free step grows only above 1 by more than the few operations that compute its factor can err."""

METRICS = {
    "effective_restitution": (
        "1",
        "speed of separation over speed of approach, least squares over all contacts that ended",
    )
}
"""What schemes without a restitution coefficient give beside the common metrics: unit and meaning."""


def effective_restitution(own: Array) -> dict[str, Array]:
    """Return -Σ v⁺v⁻ / Σ (v⁻)² of each case; NaN where no contact has ended or a sum has left the finite numbers."""
    approached, separated = own[CASE_APPROACHED], own[CASE_SEPARATED]
    met = (approached > 0) & np.isfinite(approached) & np.isfinite(separated)
    return {"effective_restitution": np.where(met, separated / np.where(met, approached, 1.0), np.nan)}


def by_heat(cases: Cases, run: Callable[[Cases, bool], Results]) -> Results:
    """Run the cases whose thermal states can act, and those without: ``run(cases, heated)``."""
    heated = cases.heated
    groups = [(np.flatnonzero(heated), True), (np.flatnonzero(~heated), False)]
    with np.errstate(over="ignore", invalid="ignore"):  # the status of a case that left the finite numbers says so
        return merge([(which, run(cases.take(which), hot)) for which, hot in groups if which.size])
