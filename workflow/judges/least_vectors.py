"""The smallest reduced model whose tip meets a tolerance in all given cases, confirmed by simulations in time.

The criterion is the larger of the relative errors of the tip's displacement and temperature in the worst case against
the full structure; for one of more than 300 coordinates, against 100 + 100 vectors of the same basis, which confirm at
most half as many. The search finds the fewest vectors of each kind with the most of the other, and from there the
smallest sum of both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, nan
from typing import NamedTuple

import numpy as np

from workflow.judges.trials import Counts, Problem, Trials, largest_change
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models import MOST_ONE_BY_ONE, Structure
from workflow.schemes import Results, Status

ANY = -1
"""A count that the tolerance decides."""

_HOPELESS = 3.0
"""Error over tolerance above which fewer vectors are not tried: it differs by up to 2 between neighbouring counts."""


class LeastVectors(NamedTuple):
    """Counts of vectors that are determined by a tolerance.

    Attributes
    ----------
    counts
        Mechanical and thermal vectors.
    error
        Larger of the relative L2 errors of the tip's displacement and temperature in the worst case, 1; NaN where no
        case ended ok, or where trials cannot confirm so many vectors.
    worst
        Index of the case with that error.
    against
        The reference of the error, in words.
    untried
        Why cases were left out, by their index.
    """

    counts: Counts
    error: float
    worst: int
    against: str
    untried: Mapping[int, str]


class FullTrials:
    """Trials against the full structure, or the largest model that serves as reference; errors are cached.

    Attributes
    ----------
    most
        Counts of vectors of the reference model, n - 1 where it is the full one.
    confirmable
        Largest counts whose errors it can measure: half of its own, or all of them where it is complete.
    sound
        Indices of the cases that ended ok.
    untried
        Why the others did not, by their index.
    failure
        Why no case did, empty where some did.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        sizes = problem.structure.mechanical_size, problem.structure.thermal_size
        self.most = richest(problem.structure)
        self.is_full = self.most == _each(lambda size: size - 1, sizes)
        self.confirmable = _each(lambda k: self.most[k] // (1 if self.most[k] == sizes[k] - 1 else 2), (0, 1))
        self._trials = Trials(problem, [((0, 0), [0]), (self.most, problem.every)])
        self.by, self.failure = self._trials.by, self._trials.failure
        self._errors: dict[tuple[Counts, int], float] = {}
        self.sound: list[int] = []
        self.untried: dict[int, str] = {}
        full = self._trials.first
        if full is not None:
            self.sound = np.flatnonzero(full.status == Status.OK).tolist()
            self.untried = {k: _ending(full, k) for k in problem.every if k not in self.sound}
            self.failure = "" if self.sound else self.untried[0]

    def errors(self, counts: Counts, which: Sequence[int]) -> list[float]:
        """Return the errors of some cases with counts of vectors; infinite where they do not end ok."""
        unknown = [k for k in which if (counts, k) not in self._errors]
        if unknown:
            self._errors |= {(counts, k): e for k, e in zip(unknown, self._found(counts, unknown), strict=True)}
        return [self._errors[counts, k] for k in which]

    def _found(self, counts: Counts, which: Sequence[int]) -> list[float]:
        if counts == self.most:
            return [0.0] * len(which)
        assert self._trials.first is not None
        try:
            motions = self._trials.motions(counts, which)
        except (Exception, SystemExit):  # whatever a basis or scheme raises
            return [inf] * len(which)
        return largest_change(motions, self._trials.first, which)


def richest(structure: Structure) -> Counts:
    """Return the counts of vectors of the reference model."""
    sizes = structure.mechanical_size, structure.thermal_size
    return _each(lambda size: size - 1 if size <= MOST_BY_JACOBI else MOST_ONE_BY_ONE, sizes)


def least_vectors(trials: FullTrials, requested: Counts, tolerance: float) -> LeastVectors:
    """Return the counts of the smallest reduced model that meets a tolerance.

    Where a requested count, or rounding, leaves a larger error, it is the model that adds no more than the tolerance to
    that error. Where no case ends ok, or more vectors are needed than the trials can confirm, it is the reference model
    without an error.

    Parameters
    ----------
    trials
        Trials of the cases.
    requested
        Counts, :data:`ANY` where the tolerance decides.
    tolerance
        Largest relative error.
    """
    least, every = ends(requested, trials.most)
    _, most = ends(requested, trials.confirmable)
    if trials.failure:
        why = f"no corner of the scene ended ok by {trials.by}: {trials.failure}"
        return LeastVectors(every, nan, 0, f"not confirmed: {why}", {})
    counts = _smallest_of(trials, least, most, every, tolerance)
    model = "the full model" if trials.is_full else f"the model of {trials.most[0]} + {trials.most[1]} vectors"
    if not all(np.less_equal(counts, trials.confirmable)):
        confirmable = f"{trials.confirmable[0]} + {trials.confirmable[1]}"
        against = f"not confirmed: {model}, which trials measure against, confirms no more than {confirmable}"
        return LeastVectors(counts, nan, 0, against, {})
    errors = trials.errors(counts, trials.sound)
    worst = errors.index(max(errors))
    against = f"confirmed by {trials.by} against {model}"
    return LeastVectors(counts, errors[worst], trials.sound[worst], against, trials.untried)


def ends(requested: Counts, most: Counts) -> tuple[Counts, Counts]:
    """Return the smallest and the largest counts that may be chosen: both are the requested one where there is one."""
    least = _each(lambda k: 0 if requested[k] == ANY else requested[k], (0, 1))
    return least, _each(lambda k: most[k] if requested[k] == ANY else requested[k], (0, 1))


def _smallest_of(trials: FullTrials, least: Counts, most: Counts, every: Counts, tolerance: float) -> Counts:
    """Return the smallest counts up to ``most`` that meet a tolerance in all cases, ``every`` if only these do.

    The search uses one case at first, and adds the worst one as long as it misses the tolerance.
    """
    floor = max(trials.errors(most, trials.sound))
    if floor > tolerance and most != every and max(trials.errors(every, trials.sound)) <= tolerance:
        return every
    allowed = tolerance if floor <= tolerance else tolerance + floor
    deciding = [trials.sound[0]]
    while True:

        def error(mechanical: int, thermal: int) -> float:
            return max(trials.errors((mechanical, thermal), deciding))

        counts = smallest(error, least, most, allowed)
        errors = trials.errors(counts, trials.sound)
        worst = trials.sound[errors.index(max(errors))]
        if max(errors) <= allowed or worst in deciding:
            return counts
        deciding.append(worst)


def smallest(error: Callable[[int, int], float], least: Counts, most: Counts, allowed: float) -> Counts:
    """Return the counts of the smallest sum with an allowed error."""
    mechanical = fewest(lambda count: error(count, most[1]), least[0], most[0], allowed)
    thermal = fewest(lambda count: error(most[0], count), least[1], most[1], allowed)
    best = most
    for count in range(mechanical, most[0] + 1):
        if count + thermal >= sum(best):
            break
        beside = _first(lambda other, count=count: error(count, other) <= allowed, thermal, most[1])  # type: ignore[misc]
        if beside is not None and count + beside < sum(best):
            best = count, beside
    return best


def fewest(error: Callable[[int], float], least: int, most: int, allowed: float) -> int:
    """Return the smallest count that meets a tolerance, searched down to a hopeless error.

    Errors do not fall monotonically with the count.
    """
    passing = _first(lambda count: error(count) <= allowed, least, most)
    best = count = most if passing is None else passing
    while count > least and error(count) <= _HOPELESS * allowed:
        count -= 1
        best = count if error(count) <= allowed else best
    return best


def _first(meets: Callable[[int], bool], least: int, most: int) -> int | None:
    """Return a count from ``least`` on that meets a condition while its predecessor does not; ``None`` if none does."""
    below, count, stride = least - 1, least, 1
    while not meets(count):
        if count == most:
            return None
        below, count, stride = count, min(count + stride, most), 2 * stride
    while count - below > 1:
        middle = (below + count) // 2
        if meets(middle):
            count = middle
        else:
            below = middle
    return count


def _each(of: Callable[[int], int], pair: tuple[int, int]) -> Counts:
    return of(pair[0]), of(pair[1])


def _ending(results: Results, case: int) -> str:
    """Return status and message of a case that did not end ok."""
    status = Status(int(results.status[case])).name.lower()
    return ": ".join(filter(None, [status, results.messages.get(case, "")]))
