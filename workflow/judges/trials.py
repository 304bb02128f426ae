"""Trials of reduced models: the difference between motions with few and with more vectors, in some cases.

They are run by `event_driven` or, where it refuses a structure or case, by `moreau` with θ = 1 at the shortest step,
with all counts of vectors alike. A case that does not end ok is not compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from workflow import schemes
from workflow.judges.distances import relative_distance
from workflow.judges.reasons import reason_of
from workflow.models import Cases, Structure, at_rest
from workflow.reduction import ReducedModel, reduced_model
from workflow.schemes import Results, Sampling, Status

EXACT = "event_driven"
"""The scheme without a time-stepping error."""

DECIDING = ("displacement", "temperature")
"""Histories of the tip by which reduced models are judged."""

_BUDGET = {"events": 20_000, "steps": 200_000}
"""Limits of an exact trial: seconds for a structure of 20 nodes."""

Counts = tuple[int, int]
"""Mechanical and thermal vectors besides the tip's own."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Cases for the trials of reduced models of a structure.

    Attributes
    ----------
    structure, cases
        The full structure, and the cases on it.
    is_static
        Whether they start in equilibrium instead of their initial state.
    basis
        Basis of the reduced models.
    sampling
        Common sampling of all histories.
    shortest
        Shortest time that steps or samples resolve, s.
    """

    structure: Structure
    cases: Cases
    is_static: bool
    basis: str
    sampling: Sampling
    shortest: float

    def model(self, counts: Counts) -> ReducedModel:
        """Return the reduced model with counts of vectors."""
        return reduced_model(self.structure, *counts, self.basis, self.sampling.duration)

    @property
    def every(self) -> range:
        """Indices of all cases."""
        return range(self.cases.count)


class Trials:
    """Motions of the cases of a problem with counts of vectors.

    Parameters
    ----------
    problem
        The cases and their structure.
    probes
        Counts and indices of cases that decide whether the exact scheme takes the problem, run in this order.

    Attributes
    ----------
    by
        The scheme that runs them, in words.
    first
        Motions of the last probe; ``None`` where neither scheme takes the problem.
    failure
        Why neither does; empty where one does.
    """

    def __init__(self, problem: Problem, probes: Sequence[tuple[Counts, Sequence[int]]]) -> None:
        self._problem, self._h, self.by, self.failure = problem, 0.0, EXACT, ""
        self.first: Results | None = None
        try:
            self.first = [self.motions(counts, which) for counts, which in probes][-1]
        except (Exception, SystemExit):  # whatever a model, basis or scheme raises
            self._h = problem.shortest
            self.by = f"moreau (theta = 1, h = {self._h:g} s)"
            try:
                self.first = self.motions(*probes[-1])
            except (Exception, SystemExit) as error:
                self.failure = reason_of(error)

    def motions(self, counts: Counts, which: Sequence[int]) -> Results:
        """Return the motions of some cases with counts of vectors."""
        problem = self._problem
        cases = problem.cases.take(np.asarray(which))
        scheme = schemes.load("moreau" if self._h else EXACT)
        options = scheme.Options() if self._h else scheme.Options(**_BUDGET)
        schemes.refuse(scheme, cases)
        model = problem.model(counts)
        with np.errstate(all="ignore"):
            operator = scheme.init(model.structure, self._h, options)
            projected = model.project(cases)
            projected = at_rest(model.structure, projected) if problem.is_static else projected
            results = scheme.compute(operator, projected, problem.sampling)
            return schemes.checked(results, projected, problem.sampling)


def largest_change(motions: Results, than: Results, which: Sequence[int]) -> list[float]:
    """Return the larger relative L2 distance in DECIDING of motions from those ``which`` of others.

    It is infinite where one of both did not end ok.
    """
    places = np.asarray(which)
    changes = [relative_distance(motions.histories[name], than.histories[name][places]) for name in DECIDING]
    change = np.max(changes, axis=0)
    lost = np.isnan(change) | (motions.status != Status.OK) | (than.status[places] != Status.OK)
    return [float(value) for value in np.where(lost, inf, change)]
