"""Energy that a scheme created, by the energy balances of its cases, and the step up to which a contact spring holds.

``energy_residual`` is what a scheme gave (+) or took (-) from t = 0 on, over the largest energy. Above
:data:`CREATED` a case has diverged, whatever its scheme. A contact spring beyond the step up to which it holds gives
or takes some energy each time contact begins or ends, in no order: a tip that one contact has thrown off is slowed
down by another, and where nothing dissipates a motion with N times the energy that it should have leaves 1 - 1/N,
which is never above 1. Such a case is judged by :data:`CREATED_FREE` or :data:`CREATED_HELD`, at its end and, run once
more as far as that, at the samples at which its tip is fastest and farthest away; where its study has no balances it is
run once more with them to its end, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import schemes
from workflow.grid._arrangement import Indices
from workflow.grid._operators import Reduced, compile_for, reduced, run_batch, statics_of, structure_on
from workflow.models import Array, Cases
from workflow.schemes import Results, Sampling
from workflow.study import Cell

CREATED = 1.0
"""Energy residual above which a case has diverged: more energy than it ever held came from nowhere."""

CREATED_FREE = 0.75
"""The same for a contact spring beyond its limit on a structure with a free root: a motion with four times the energy
that it should have, twice as fast and, under a constant load, four times as far.

``python tests/grid/test_created_energy.py 100 free`` measures 100 random scenes at up to ten times the limit: of 3554
cases that are off by more than ten times 13 stay ok, of 1199 that are off by less than 0.3 38 have diverged, all beyond
three times the limit. With θ = 1/2 (``100 free 0.5``) at up to a hundred times the limit 42 of 1267 stay ok."""

CREATED_HELD = 0.99
"""The same where the root is held: a motion with a hundred times the energy, of ten times the amplitude. Energy of
fast modes leaves the displacement nearly as it is. In such scenes (``100 held``) 21 of 3481 stay ok and 10 of 1723 that
are off by less than 0.3 have diverged, with θ = 1/2 44 of 991 and none of 1377."""


@dataclass(frozen=True, eq=False)
class Created:
    """What the balances of cases tell, each ``(case,)``.

    Attributes
    ----------
    residual
        Energy residual, 1; NaN where it is not known.
    until
        From t = 0 to when, s; NaN where to the end.
    most
        Residual above which a case has diverged, 1.
    """

    residual: Array
    until: Array
    most: Array

    @property
    def is_too_much(self) -> NDArray[np.bool_]:
        """Cases that have diverged."""
        return np.asarray(self.residual > self.most)

    def text(self, case: int) -> str:
        """Return what happened to a case."""
        until = "" if np.isnan(self.until[case]) else f" up to t = {self.until[case]:.4g} s"
        return (
            f"energy was created: its balance{until} has a residual of {self.residual[case]:+.3g} times the largest "
            f"energy, above {self.most[case]:+g}"
        )


def created_energy(
    cell: Cell, cases: Cases, results: Results, judged: NDArray[np.bool_], sampling: Sampling
) -> Created:
    """Return what the balances of some cases tell.

    Parameters
    ----------
    cell
        The settings that the cases share.
    cases
        Their conditions on the nodes of the full structure.
    results
        What the scheme gave for them.
    judged
        Cases that may be run once more, ``(case,)``.
    sampling
        What the scheme was called with.
    """
    residual = results.metrics["energy_residual"] if sampling.balances else np.full(cases.count, np.nan)
    created = Created(residual.copy(), np.full(cases.count, np.nan), np.full(cases.count, CREATED))
    beyond = _beyond_limit(cell, cases, np.flatnonzero(judged & (results.metrics["impacts"] > 0)))
    if not beyond.size:
        return created
    last = sampling.count - 1
    if not sampling.balances:
        compile_for(cell, balances=True)
        created.residual[beyond] = _residual(cell, cases.take(beyond), sampling, last)
    rest = beyond[~created.is_too_much[beyond]]
    if not rest.size:
        return created
    flexibility, _ = statics_of(cell.scene.model, cell.scene.parameters)
    created.most[rest] = CREATED_FREE if np.isinf(flexibility) else CREATED_HELD
    for history in ("velocity", "displacement"):
        rest = rest[~created.is_too_much[rest]]
        largest = np.argmax(np.abs(results.histories[history][rest]), axis=1)
        for sample in np.unique(largest[(largest > 0) & (largest < last)]).tolist():
            these = rest[largest == sample]
            there = _residual(cell, cases.take(these), sampling, sample)
            more = there > created.most[these]
            created.residual[these[more]] = there[more]
            created.until[these[more]] = sampling.times[sample]
    return created


def _beyond_limit(cell: Cell, cases: Cases, which: Indices) -> Indices:
    """Return those of some cases that have a contact spring beyond the step up to which it holds."""
    frictions = cases.friction[which].tolist()
    limits = {friction: contact_limit(cell, friction) for friction in set(frictions)}
    return which[[cell.h > limits[friction] for friction in frictions]]


def _residual(cell: Cell, cases: Cases, sampling: Sampling, sample: int) -> Array:
    """Return the energy residual of cases from t = 0 to a sample, ``(case,)``."""
    duration = float(sampling.times[sample])
    until = replace(sampling, duration=duration, count=sample + 1, balances=True)
    return run_batch(cell, cases, until).metrics["energy_residual"]


def contact_limit(cell: Cell, friction: float) -> float:
    """Return the step up to which a scheme holds while contact comes and goes, s; infinite where it has no limit."""
    return _limit(reduced(cell), cell.scheme.method, cell.scheme.options, friction)


@lru_cache(maxsize=256)
def _limit(by: Reduced, method: str, options: Any, friction: float) -> float:
    scheme = schemes.load(method)
    return math.inf if scheme.contact_limit is None else scheme.contact_limit(structure_on(by), options, friction)


def advice(cell: Cell, friction: float) -> str:
    """Return up to which step a scheme with a contact spring holds, where it has a limit."""
    limit = contact_limit(cell, friction)
    said = f"; with contact that comes and goes the scheme holds up to h = {schemes.limit_text(limit, 4)} s"
    return "" if np.isinf(limit) else said
