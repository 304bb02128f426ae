"""Trials of reduced models: some cases run exactly with few vectors and with more, and how far their motions differ.

They are run by `event_driven`; what it refuses is run by `moreau` with θ = 1 at the shortest step, full and reduced
alike. A case that does not end ok tells nothing.
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
"""The scheme whose solution of a reduced model has no error of a step."""

DECIDING = ("displacement", "temperature")
"""Histories of the tip by which reduced models are judged."""

_BUDGET = {"events": 20_000, "steps": 200_000}
"""Of an exact trial: seconds of a structure of 20 nodes."""

Counts = tuple[int, int]
"""Mechanical and thermal vectors beside the tip's own."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Cases that reduced models of a structure are tried with.

    Attributes
    ----------
    structure, cases
        The full structure, and the cases on it.
    is_static
        Whether they start in equilibrium, whatever initial state the cases hold.
    basis
        Of the reduced models.
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
        """Return the structure with so many vectors."""
        return reduced_model(self.structure, *counts, self.basis, self.sampling.duration)

    @property
    def every(self) -> range:
        """Places of all cases."""
        return range(self.cases.count)


class Trials:
    """Motions of the cases of a problem with counts of vectors.

    Parameters
    ----------
    problem
        The cases and their structure.
    probes
        Counts and places of cases that decide whether the exact scheme takes the problem, run one after the other.

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
        """Return the motions of some cases with so many vectors."""
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
    """Return by how much motions differ from those ``which`` of others: the larger relative L2 distance of DECIDING.

    Infinite where one of both did not end ok.
    """
    places = np.asarray(which)
    changes = [relative_distance(motions.histories[name], than.histories[name][places]) for name in DECIDING]
    change = np.max(changes, axis=0)
    lost = np.isnan(change) | (motions.status != Status.OK) | (than.status[places] != Status.OK)
    return [float(value) for value in np.where(lost, inf, change)]
