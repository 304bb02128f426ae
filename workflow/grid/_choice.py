"""Counts of modes that a tolerance decides: the smallest reduced model whose tip meets it, confirmed in time.

What decides is the larger of the relative errors of the tip's displacement and temperature in the hardest corner of a
study's scene (:mod:`workflow.grid._trials`). Counts begin where the tip's transfer functions put them
(:mod:`workflow.reduction._transfer`). Then the fewest vectors of each kind beside the most of the other are sought, and
from there the smallest sum of both that meets the tolerance. Errors do not fall evenly with the count, so smaller
ones are tried until they are three times too large.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from math import isnan, nan
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from workflow.grid._trials import Setting, Trials, trials_of
from workflow.grid._waiting_for import TRIALS, waiting_for
from workflow.study import CHOSEN

Counts = tuple[int, int]
"""Mechanical and thermal vectors beside the tip's own."""

_REFERENCE = "reference "
"""What the key of a reference's choice begins with, before its outer index."""

_HOPELESS = 3.0
"""An error over the tolerance from which still smaller models are not tried: errors of neighbouring counts differ by
up to a factor of two (heavy chain of 100 nodes: 1.4e-3 with 8 mechanical modes, 9.8e-4 with 5)."""


_NAMED = 3
"""Corners left out that are named, at most."""


@dataclass(frozen=True)
class Choice:
    """Counts that a tolerance decides.

    Attributes
    ----------
    mechanical_modes, thermal_modes
        The counts.
    error
        Larger of the relative L2 errors of the tip's displacement and temperature in the hardest corner, 1; NaN
        where none ended ok, or where trials cannot confirm so many vectors.
    hardest
        Path and value of every axis of the corner with that error.
    against
        What the error was measured against, in words.
    untried
        Which corners were left out, and why, in words; empty for none.
    """

    mechanical_modes: int
    thermal_modes: int
    error: float
    hardest: tuple[tuple[str, float], ...]
    against: str
    untried: str = ""

    @property
    def is_confirmed(self) -> bool:
        """Whether an error was found."""
        return not isnan(self.error)

    @property
    def counts(self) -> dict[str, int]:
        """The counts by their path in a study."""
        return {"mechanical_modes": self.mechanical_modes, "thermal_modes": self.thermal_modes}


@lru_cache(maxsize=4096)
def choose(setting: Setting, requested: Counts, tolerance: float) -> Choice:
    """Return the counts of the smallest reduced model that meets a tolerance.

    Where a count that is given stands in its way, or rounding, the model that adds no more than the tolerance to what
    is then left; where no corner ends ok the counts that the transfer functions ask for. Where more vectors are needed
    than the trials can confirm, all that errors are measured against, without an error.

    Parameters
    ----------
    setting
        What the trials depend on.
    requested
        Counts of the study, :data:`CHOSEN` where the tolerance decides.
    tolerance
        Largest relative error.
    """
    with threadpool_limits(limits=1, user_api="blas"), waiting_for(TRIALS):
        trials = trials_of(replace(setting, cell=replace(setting.cell, mechanical_modes=CHOSEN, thermal_modes=CHOSEN)))
        least, richest = ends(requested, trials.most)
        _, most = ends(requested, trials.confirmable)
        first = _within(trials.begin(tolerance), least, richest if trials.failure else most)
        counts = first if trials.failure else _smallest_of(trials, first, least, most, richest, tolerance)
        is_confirmed = not trials.failure and all(np.less_equal(counts, trials.confirmable))
        errors = trials.errors(*counts, trials.sound) if is_confirmed else [nan]
        worst = errors.index(max(errors))
    hardest = trials.corners[trials.sound[worst] if is_confirmed else 0]
    untried = _untried(trials) if is_confirmed else ""
    return Choice(*counts, errors[worst], tuple(hardest.items()), _against(trials, is_confirmed), untried)


def _smallest_of(
    trials: Trials, first: Counts, least: Counts, most: Counts, richest: Counts, tolerance: float
) -> Counts:
    """Return the smallest counts up to ``most`` that meet a tolerance in all corners, ``richest`` if only these do.

    They are decided by few corners, and by what then misses the tolerance.
    """
    floor = max(trials.errors(*most, trials.sound))
    if floor > tolerance and most != richest and max(trials.errors(*richest, trials.sound)) <= tolerance:
        return richest
    allowed = tolerance if floor <= tolerance else tolerance + floor
    deciding = [trials.sound[0]]
    while True:

        def error(mechanical: int, thermal: int) -> float:
            return max(trials.errors(mechanical, thermal, deciding))

        first = _smallest(error, first, least, most, allowed)
        errors = trials.errors(*first, trials.sound)
        worst = trials.sound[errors.index(max(errors))]
        if max(errors) <= allowed or worst in deciding:
            return first
        deciding.append(worst)


class Decided(NamedTuple):
    """Counts of modes that tolerances decide, of cases and of references, by the first outer index they belong to."""

    cases: Mapping[int, Choice] = MappingProxyType({})
    references: Mapping[int, Choice] = MappingProxyType({})


def choices_text(decided: Decided) -> str:
    """Return choices by outer index as JSON; an error that is NaN as null."""
    every = {str(outer): choice for outer, choice in decided.cases.items()}
    every |= {f"{_REFERENCE}{outer}": choice for outer, choice in decided.references.items()}
    entries = {key: asdict(choice) | {"hardest": dict(choice.hardest)} for key, choice in every.items()}
    for entry in entries.values():
        entry["error"] = None if isnan(entry["error"]) else entry["error"]
    return json.dumps(entries, sort_keys=True, allow_nan=False)


def read_choices(text: str) -> Decided:
    """Return choices from what :func:`choices_text` has made of them."""
    choices = {
        key: Choice(
            entry["mechanical_modes"],
            entry["thermal_modes"],
            nan if entry["error"] is None else entry["error"],
            tuple(entry["hardest"].items()),
            entry["against"],
            entry.get("untried", ""),
        )
        for key, entry in json.loads(text).items()
    }
    of_references = {key for key in choices if key.startswith(_REFERENCE)}
    return Decided(
        {int(key): choice for key, choice in choices.items() if key not in of_references},
        {int(key.removeprefix(_REFERENCE)): choice for key, choice in choices.items() if key in of_references},
    )


def ends(requested: Counts, most: Counts) -> tuple[Counts, Counts]:
    """Return the smallest and the largest counts that may be chosen: of a given one itself."""
    least = 0 if requested[0] == CHOSEN else requested[0], 0 if requested[1] == CHOSEN else requested[1]
    largest = most[0] if requested[0] == CHOSEN else requested[0], most[1] if requested[1] == CHOSEN else requested[1]
    return least, largest


def _within(counts: Counts, least: Counts, most: Counts) -> Counts:
    return min(max(counts[0], least[0]), most[0]), min(max(counts[1], least[1]), most[1])


def _against(trials: Trials, is_confirmed: bool) -> str:
    if trials.failure:
        why = f"no corner of the scene ended ok by {trials.by}: {trials.failure}"
        return f"as transfer functions ask for, not confirmed: {why}"
    model = "the full model" if trials.is_full else f"the model of {trials.most[0]} + {trials.most[1]} vectors"
    if not is_confirmed:
        confirmable = f"{trials.confirmable[0]} + {trials.confirmable[1]}"
        return f"not confirmed: {model}, which trials measure against, confirms no more than {confirmable}"
    return f"confirmed by {trials.by} against {model}"


def _untried(trials: Trials) -> str:
    lost = [f"{corner_text(trials.corners[k].items())} ({why})" for k, why in trials.lost.items()]
    named = "; ".join(lost[:_NAMED]) + (f"; and {len(lost) - _NAMED} more" if len(lost) > _NAMED else "")
    return f"without {len(lost)} of {len(trials.corners)} corners of the scene: {named}" if lost else ""


def corner_text(corner: Iterable[tuple[str, float]]) -> str:
    """Return the values of a corner by their path."""
    return ", ".join(f"{path.removeprefix('scene.')} = {value:.6g}" for path, value in corner)


def _smallest(error: Callable[[int, int], float], first: Counts, least: Counts, most: Counts, allowed: float) -> Counts:
    """Return the counts of the smallest sum whose error is allowed, begun at ``first``."""
    mechanical = _fewest(lambda count: error(count, most[1]), first[0], least[0], most[0], allowed)
    thermal = _fewest(lambda count: error(most[0], count), first[1], least[1], most[1], allowed)
    best = most
    for count in range(mechanical, most[0] + 1):
        if count + thermal >= sum(best):
            break
        beside = _first(lambda other, count=count: error(count, other) <= allowed, thermal, thermal, most[1])  # type: ignore[misc]
        if beside is not None and count + beside < sum(best):
            best = count, beside
    return best


def _fewest(error: Callable[[int], float], first: int, least: int, most: int, allowed: float) -> int:
    """Return the smallest count that meets a tolerance, among those above which the error is not hopeless."""
    passing = _first(lambda count: error(count) <= allowed, first, least, most)
    best = count = most if passing is None else passing
    while count > least and error(count) <= _HOPELESS * allowed:
        count -= 1
        best = count if error(count) <= allowed else best
    return best


def _first(meets: Callable[[int], bool], first: int, least: int, most: int) -> int | None:
    """Return a count from ``first`` on that meets something and whose predecessor does not, ``None`` if none does."""
    below, count, stride = first - 1, first, 1
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
