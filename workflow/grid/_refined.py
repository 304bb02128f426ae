"""Counts of modes of a reference by a tolerance: its basis is refined until that changes it less than the tolerance.

A large structure has no full solution to measure against. What is shown is a change instead: of the exact solution with
m mechanical and t thermal vectors, when one of both is doubled, in the worst corner of the scene
(:mod:`workflow.grid._trials`),

    |x(2m, t) - x(m, t)| / |x(2m, t)| + |x(m, 2t) - x(m, t)| / |x(m, 2t)|,

of the tip's displacement or temperature, whichever changes more. The count whose doubling changes more is doubled until
the sum meets the tolerance. Small structures are compared with the full one (:mod:`workflow.grid._choice`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import inf, isfinite, nan

import numpy as np
from threadpoolctl import threadpool_limits

from workflow.grid._choice import Choice, Counts, choose, ends
from workflow.grid._conditions import conditions
from workflow.grid._operators import compile_for, reduced, run_batch, structure_of, structure_on
from workflow.grid._reason import reason_of
from workflow.grid._trials import COMPARED, Setting, corners_of, exactly, stepped
from workflow.grid._waiting_for import TRIALS, waiting_for
from workflow.judges.distances import relative_distance
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.schemes import Results, Status

_FIRST = (12, 6)
"""Vectors to begin with: fewer leave 1e-4 and more of a finite element blade."""


@lru_cache(maxsize=256)
def refine(setting: Setting, requested: Counts, tolerance: float) -> Choice:
    """Return the counts of the basis of a reference, with the change that its refinement makes as its error.

    Parameters are those of :func:`~workflow.grid._choice.choose`. Where the largest basis does not meet the tolerance,
    the error is the change of the last refinement that led to it.
    """
    structure = structure_of(setting.cell.scene.model, setting.cell.scene.parameters)
    sizes = structure.mechanical_size, structure.thermal_size
    if max(sizes) <= MOST_BY_JACOBI:
        return choose(setting, requested, tolerance)
    least, most = ends(requested, tuple(min(size - 1, structure.mechanical.most_modes) for size in sizes))  # type: ignore[arg-type]
    first = tuple(min(max(a, b), c) for a, b, c in zip(_FIRST, least, most, strict=True))
    with threadpool_limits(limits=1, user_api="blas"), waiting_for(TRIALS):
        return _refined(_Solutions(setting, first), first, most, tolerance)  # type: ignore[arg-type]


def _refined(solutions: _Solutions, counts: Counts, most: Counts, tolerance: float) -> Choice:
    changes = [0.0 if counts[kind] == most[kind] else inf for kind in (0, 1)]
    hardest, finer = 0, counts
    while not solutions.failure:
        below = [kind for kind in (0, 1) if counts[kind] < most[kind]]
        for kind in below:
            errors = solutions.changes(counts, _doubled(counts, kind, most))
            changes[kind], hardest = max(errors), errors.index(max(errors))
        finer = _doubled(counts, 0, most)[0], _doubled(counts, 1, most)[1]
        worth = [kind for kind in below if changes[kind] > tolerance / 2]
        if sum(changes) <= tolerance or not worth:
            break
        counts = _doubled(counts, max(worth, key=changes.__getitem__), most)
    error = sum(changes)
    against = solutions.failure or f"by its refinement to {finer[0]} and {finer[1]} vectors, {solutions.by}"
    corner = tuple(solutions.corners[hardest].items())
    return Choice(*counts, error if isfinite(error) and not solutions.failure else nan, corner, against)


def _doubled(counts: Counts, kind: int, most: Counts) -> Counts:
    """Return counts with twice as many vectors of a kind, at most ``most``."""
    twice = min(2 * counts[kind], most[kind])
    return (twice, counts[1]) if kind == 0 else (counts[0], twice)


class _Solutions:
    """Solutions of the corners of a study by counts of vectors, each found once.

    Attributes
    ----------
    corners
        Values of the axes of each corner, by path.
    by
        The scheme that finds them, in words.
    failure
        Why nothing can be found, empty where it can.
    """

    def __init__(self, setting: Setting, first: Counts) -> None:
        self._sampling, self._results, self.failure = setting.sampling, dict[Counts, Results](), ""
        self._cell = replace(exactly(setting), mechanical_modes=first[0], thermal_modes=first[1])
        self.corners = corners_of(setting.inner, structure_on(reduced(self._cell)))
        varying = {path: np.array([corner[path] for corner in self.corners]) for path in self.corners[0]}
        structure = structure_of(setting.cell.scene.model, setting.cell.scene.parameters)
        self._cases = conditions(setting.cell, structure, varying, len(self.corners))
        try:
            self._of(first)
        except (Exception, SystemExit):  # whatever refuses the scene or the basis
            self._cell = stepped(setting)
            try:
                self._of(first)
            except (Exception, SystemExit) as error:
                self.failure = f"not confirmed: {reason_of(error)}"
        method = self._cell.scheme.method
        self.by = method if self._cell.h == 0 else f"{method} (theta = 1, h = {self._cell.h:g} s)"

    def _of(self, counts: Counts) -> Results:
        if counts not in self._results:
            cell = replace(self._cell, mechanical_modes=counts[0], thermal_modes=counts[1])
            compile_for(cell, self._sampling.balances)
            with np.errstate(all="ignore"):
                self._results[counts] = run_batch(cell, self._cases, self._sampling)
        return self._results[counts]

    def changes(self, counts: Counts, finer: Counts) -> list[float]:
        """Return of each corner by how much more vectors change its motion, relative; infinite where one has none."""
        old, new = self._of(counts), self._of(finer)
        change = np.max([relative_distance(old.histories[name], new.histories[name]) for name in COMPARED], axis=0)
        lost = np.isnan(change) | (old.status != Status.OK) | (new.status != Status.OK)
        return [float(value) for value in np.where(lost, inf, change)]
