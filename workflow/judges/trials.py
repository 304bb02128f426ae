"""The smallest reduced model whose tip meets a tolerance in all given cases, by trials: simulations in time.

Trials are run by `event_driven` or, where it refuses a structure or case, by `moreau` with θ = 1 at the shortest step,
with all counts of vectors alike. A case that does not end ok is not compared. The criterion is the larger of the
relative errors of the tip's displacement and temperature in the worst case against the full structure; for one of more
than 300 coordinates, against 100 + 100 vectors of the same basis, which confirm at most half as many. The search finds
the fewest vectors of each kind with the most of the other, and from there the smallest sum of both.

A reference of such a large structure has no full solution to be compared with. Its error is estimated by the change of
the exact solution with m mechanical and t thermal vectors when one of both is doubled, in the worst of some cases,

    |x(2m, t) - x(m, t)| / |x(2m, t)| + |x(m, 2t) - x(m, t)| / |x(m, 2t)|,

of the tip's displacement or temperature, whichever changes more. The count whose doubling changes more is doubled until
the sum meets the tolerance.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from workflow import schemes
from workflow.judges.distances import relative_distance
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models import MOST_ONE_BY_ONE, MOST_REDUCED, Cases, Structure, at_rest
from workflow.reduction import ReducedModel, reduced_model
from workflow.schemes import RefusedStructureError, Results, Sampling, Status

EXACT = "event_driven"
"""The scheme without a time-stepping error."""

DECIDING = ("displacement", "temperature")
"""Histories of the tip by which reduced models are judged."""

_BUDGET = {"events": 20_000, "steps": 200_000}
"""Limits of an exact trial: seconds for a structure of 20 nodes."""

ANY = -1
"""A count that the tolerance decides."""

_HOPELESS = 3.0
"""Error over tolerance above which fewer vectors are not tried: it differs by up to 2 between neighbouring counts."""

_FIRST = (12, 6)
"""First counts of vectors: fewer have an error of 1e-4 and more for a finite element blade."""

Counts = tuple[int, int]
"""Mechanical and thermal vectors besides the tip's own."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Cases for the trials of reduced models of a structure."""

    structure: Structure
    cases: Cases
    """``structure``, ``cases``: the full structure, and the cases on it."""
    is_static: bool
    """Whether they start in equilibrium instead of their initial state."""
    basis: str
    """Basis of the reduced models."""
    sampling: Sampling
    """Common sampling of all histories."""
    shortest: float
    """Shortest time that steps or samples resolve, s."""

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
    """Return the largest relative L2 distance in DECIDING, of each contact, of motions from those ``which`` of others.

    It is infinite where one of both did not end ok.
    """
    places = np.asarray(which)
    pairs = [(motions.histories[name], than.histories[name][places]) for name in DECIDING]
    rows = [(own.reshape(-1, own.shape[-1]), other.reshape(-1, own.shape[-1])) for own, other in pairs]
    change = np.max([relative_distance(*each).reshape(places.size, -1).max(axis=1) for each in rows], axis=0)
    lost = np.isnan(change) | (motions.status != Status.OK) | (than.status[places] != Status.OK)
    return [float(value) for value in np.where(lost, inf, change)]


def reason_of(error: BaseException) -> str:
    """Return the text of a refusal, or of any other error, a defect of a model, basis or scheme, with its type."""
    by_compiler = type(error).__module__.startswith("numba.")  # by name: numba is imported where kernels run
    text = _innermost(str(error)) if by_compiler else str(error)
    return text if isinstance(error, RefusedStructureError) else f"{type(error).__name__}: {text}"


def _innermost(text: str) -> str:
    """Return the innermost fault and its line from numba's message, which lists all callers and may have colours."""
    lines = [line.strip() for line in re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines() if line.strip()]
    begins = [k + 1 for k, line in enumerate(lines) if "Failed in " in line]
    first = begins[-1] if begins else 0
    return " ".join(lines[first : first + 2]).rstrip(":")


class LeastVectors(NamedTuple):
    """Counts of vectors that are determined by a tolerance."""

    counts: Counts
    """Mechanical and thermal vectors."""
    error: float
    """Larger of the relative L2 errors of the tip's displacement and temperature in the worst case, 1; NaN where no
    case ended ok, or where trials cannot confirm so many vectors."""
    worst: int
    """Index of the case with that error."""
    against: str
    """The reference of the error, in words."""
    untried: Mapping[int, str]
    """Why cases were left out, by their index."""


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
        against = f"not confirmed: {model}, the reference of the trials, confirms {confirmable} at most"
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

    Parameters are those of :func:`least_vectors`. Where the largest basis does not meet
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
