"""A structure as cases are run on it: reduced, or as it is."""

from __future__ import annotations

from typing import NamedTuple

from workflow.models import Cases, Sparse, Structure
from workflow.reduction._reduction import Reduction


class ReducedModel(NamedTuple):
    """The structure that cases are run on, and the reduction that made it; ``None`` where all vectors are kept."""

    structure: Structure
    reduction: Reduction | None

    def project(self, cases: Cases) -> Cases:
        """Return cases given on the full structure in the coordinates of this one."""
        return cases if self.reduction is None else self.reduction.project(cases)


def unreduced_model(structure: Structure) -> ReducedModel:
    """Return a structure with all its vectors, by its matrices where it is sparse."""
    return ReducedModel(structure.matrices() if isinstance(structure, Sparse) else structure, None)
