"""The basis of a reference of a large structure, refined until the motion changes less than a tolerance.

A large structure has no full solution as a reference. Its error is estimated by the change of the exact solution with
m mechanical and t thermal vectors when one of both is doubled, in the worst of some cases,

    |x(2m, t) - x(m, t)| / |x(2m, t)| + |x(m, 2t) - x(m, t)| / |x(m, 2t)|,

of the tip's displacement or temperature, whichever changes more. The count whose doubling changes more is doubled until
the sum meets the tolerance.
"""

from __future__ import annotations

from math import inf, isfinite, nan

from workflow.judges.least_vectors import LeastVectors, ends
from workflow.judges.trials import Counts, Problem, Trials, largest_change
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models import MOST_REDUCED, Structure
from workflow.schemes import Results

_FIRST = (12, 6)
"""First counts of vectors: fewer have an error of 1e-4 and more for a finite element blade."""


def is_refined(structure: Structure) -> bool:
    """Tell whether a structure is too large for trials against its full solution."""
    return max(structure.mechanical_size, structure.thermal_size) > MOST_BY_JACOBI


def coarsest(structure: Structure, requested: Counts) -> Counts:
    """Return the first counts of vectors of a refinement."""
    least, most = _range(structure, requested)
    return min(max(_FIRST[0], least[0]), most[0]), min(max(_FIRST[1], least[1]), most[1])


def _range(structure: Structure, requested: Counts) -> tuple[Counts, Counts]:
    """Return the smallest and the largest counts of vectors of a large structure."""
    limit = MOST_REDUCED if structure.has_matrices else structure.mechanical.most_modes
    return ends(requested, (min(structure.mechanical_size - 1, limit), min(structure.thermal_size - 1, limit)))


def refined_vectors(problem: Problem, requested: Counts, tolerance: float) -> LeastVectors:
    """Return the counts of vectors whose refinement changes the motion by less than a tolerance, and that change.

    Parameters are those of :func:`~workflow.judges.least_vectors.least_vectors`. Where the largest basis does not meet
    the tolerance, the error is the change by the last refinement.
    """
    counts, (_, most) = coarsest(problem.structure, requested), _range(problem.structure, requested)
    trials = Trials(problem, [(counts, problem.every)])
    if trials.first is None:
        return LeastVectors(counts, nan, 0, f"not confirmed: {trials.failure}", {})
    motions: dict[Counts, Results] = {counts: trials.first}
    changes, worst, finer = [0.0 if counts[kind] == most[kind] else inf for kind in (0, 1)], 0, counts
    while True:
        below = [kind for kind in (0, 1) if counts[kind] < most[kind]]
        for kind in below:
            doubled = _doubled(counts, kind, most)
            for missing in {counts, doubled} - set(motions):
                motions[missing] = trials.motions(missing, problem.every)
            each = largest_change(motions[counts], motions[doubled], problem.every)
            changes[kind], worst = max(each), each.index(max(each))
        finer = _doubled(_doubled(counts, 0, most), 1, most)
        worth = [kind for kind in below if changes[kind] > tolerance / 2]
        if sum(changes) <= tolerance or not worth:
            break
        counts = _doubled(counts, max(worth, key=changes.__getitem__), most)
    error, against = sum(changes), f"by its refinement to {finer[0]} and {finer[1]} vectors, {trials.by}"
    return LeastVectors(counts, error if isfinite(error) else nan, worst, against, {})


def _doubled(counts: Counts, kind: int, most: Counts) -> Counts:
    """Return counts with twice the vectors of a kind, at most ``most``."""
    twice = min(2 * counts[kind], most[kind])
    return (twice, counts[1]) if kind == 0 else (counts[0], twice)
