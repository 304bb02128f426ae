"""Modes that a tolerance decides: counts by trials of reduced models in the corners of a study's scene.

A corner takes of each dimension the hardest or the mildest value: the largest or smallest heat coupling, the smallest
or largest gap, the load frequency at which the tip answers most or least, the largest or smallest magnitude of
everything else but phases; of axes that vary together alpha decides first, then the gap, then the frequency, then the
others by name, and of equals the first. Of more than 16 corners those are taken that have the fewest mild or the fewest
hard values.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import product
from math import isnan, nan

import numpy as np

from workflow.cases._conditions import conditions
from workflow.cases._structures import full_structure, model_on, reduced
from workflow.cases._waiting_for import TRIALS, waiting_for
from workflow.judges import trials
from workflow.models import Array, Structure, mechanical_modes, one_thread
from workflow.schemes import Sampling
from workflow.study import CHOSEN, GAP, CaseSettings, Dimension

_FREQUENCY = "scene.load.frequency"
_RANKS = ("alpha", "scene.casing.gap", _FREQUENCY)

_RANKING_DAMPING = 0.01
"""Damping ratio with which the answers of load frequencies are ranked, so that none is infinite."""

_MOST_CORNERS = 16
"""Corners that are tried: those of four dimensions."""

Corner = tuple[tuple[str, float], ...]
"""Path and value of every axis."""


def corners_of(inner: Sequence[Dimension], structure: Structure) -> list[Corner]:
    """Return the corners of some dimensions; the first has the hardest value of each."""
    ends = [_ends(dimension, structure) for dimension in inner]
    places = sorted(product(*(range(len(end)) for end in ends)), key=lambda mild: _unlike(mild, len(ends)))
    return [
        _corner_values(inner, [end[k] for end, k in zip(ends, place, strict=True)]) for place in places[:_MOST_CORNERS]
    ]


def corner_text(corner: Iterable[tuple[str, float]]) -> str:
    """Return the values of a corner by their path."""
    return ", ".join(f"{path.removeprefix('scene.')} = {value:.6g}" for path, value in corner)


def _unlike(mild: tuple[int, ...], count: int) -> tuple[int, tuple[int, ...]]:
    """Rank corners by how few values differ from all hard, or all mild."""
    return min(sum(mild), count - sum(mild)), mild


def _corner_values(inner: Sequence[Dimension], places: Sequence[int]) -> Corner:
    pairs = zip(inner, places, strict=True)
    return tuple({axis.path: float(axis.values[k]) for dimension, k in pairs for axis in dimension.axes}.items())


def _ends(dimension: Dimension, structure: Structure) -> list[int]:
    """Return the places of the hardest and of the mildest value of a dimension."""
    axes = sorted(dimension.axes, key=lambda axis: (_rank(axis.path), axis.path))
    keys = [_severity(axis.path, np.asarray(axis.values, dtype=np.float64), structure) for axis in axes]
    order = np.lexsort([-key for key in reversed(keys)])
    return [int(order[0]), int(order[-1])] if order.size > 1 else [0]


def _rank(path: str) -> int:
    return _RANKS.index(path) if path in _RANKS else len(_RANKS)


def _severity(path: str, values: Array, structure: Structure) -> Array:
    """Return how hard each value of an axis makes a case; larger is harder."""
    if path.startswith(GAP):
        return -values
    if path.endswith(".phase"):
        return np.zeros_like(values)
    if path == _FREQUENCY:
        modes, omega = mechanical_modes(structure), 2 * np.pi * values
        return np.array([_answer(modes.values, modes.tip, float(w)) for w in omega])
    return np.abs(values)


def _answer(omega: Array, tip: Array, w: float) -> float:
    """Return the squared tip displacement by a unit force of angular frequency ``w``, m²/N²; rigid modes left out."""
    elastic = omega > 0
    square, share = omega[elastic] ** 2, tip[elastic] ** 2
    real, imaginary = square - w * w, 2 * _RANKING_DAMPING * omega[elastic] * w
    size = real * real + imaginary * imaginary
    return np.sum(share * real / size) ** 2 + np.sum(share * imaginary / size) ** 2


OF_REFERENCE = "reference "
"""Beginning of the name of a reference's choice, before its outer index."""

_CORNERS_NAMED = 3
"""Corners left out that are named, at most."""


@dataclass(frozen=True)
class ChosenModes:
    """Counts that a tolerance decides."""

    mechanical_modes: int
    thermal_modes: int
    """``mechanical_modes``, ``thermal_modes``: the counts."""
    error: float
    """Larger of the relative L2 errors of the tip's displacement and temperature in the hardest corner, 1; NaN where
    none ended ok, or where trials cannot confirm so many vectors."""
    hardest: Corner
    """Path and value of every axis of the corner with that error."""
    against: str
    """What the error was measured against, in words."""
    untried: str = ""
    """Which corners were left out, and why, in words; empty for none."""

    @property
    def is_confirmed(self) -> bool:
        """Whether an error was found."""
        return not isnan(self.error)

    @property
    def counts(self) -> dict[str, int]:
        """The counts by their path in a study."""
        return {"mechanical_modes": self.mechanical_modes, "thermal_modes": self.thermal_modes}


@dataclass(frozen=True)
class Setting:
    """What trials depend on: settings that all cases share, dimensions along which they differ, sampling.

    ``shortest`` is the shortest time that steps or samples resolve, s. Of the settings scheme and step count for
    nothing, and the counts of modes are those that are requested.
    """

    settings: CaseSettings
    inner: tuple[Dimension, ...]
    sampling: Sampling
    shortest: float

    @property
    def requested(self) -> trials.Counts:
        """Counts that are given, :data:`CHOSEN` where the tolerance decides."""
        return self.settings.mechanical_modes, self.settings.thermal_modes

    def with_counts(self, counts: trials.Counts) -> Setting:
        """Return the setting with other counts of modes."""
        return replace(self, settings=replace(self.settings, mechanical_modes=counts[0], thermal_modes=counts[1]))


@lru_cache(maxsize=4096)
def choose(setting: Setting, tolerance: float) -> ChosenModes:
    """Return the counts of the smallest reduced model that meets a tolerance in all corners."""
    with one_thread(), waiting_for(TRIALS):
        corners, full = _full_trials(setting.with_counts((CHOSEN, CHOSEN)))
        return _choice(trials.least_vectors(full, setting.requested, tolerance), corners)


@lru_cache(maxsize=256)
def refine(setting: Setting, tolerance: float) -> ChosenModes:
    """Return the counts of the basis of a reference: of a large structure those whose refinement changes little."""
    structure = full_structure(setting.settings)
    if not trials.is_refined(structure):
        return choose(setting, tolerance)
    with one_thread(), waiting_for(TRIALS):
        corners, problem = _problem(setting, trials.coarsest(structure, setting.requested))
        return _choice(trials.refined_vectors(problem, setting.requested, tolerance), corners)


@lru_cache(maxsize=8)
def _full_trials(setting: Setting) -> tuple[list[Corner], trials.FullTrials]:
    """Return the corners of a setting and the trials in them, which all tolerances share."""
    corners, problem = _problem(setting, trials.richest(full_structure(setting.settings)))
    return corners, trials.FullTrials(problem)


def _problem(setting: Setting, counts: trials.Counts) -> tuple[list[Corner], trials.Problem]:
    """Return the corners of a setting, as they are ranked with so many vectors, and their cases."""
    settings = setting.settings
    structure = full_structure(settings)
    corners = corners_of(setting.inner, model_on(reduced(setting.with_counts(counts).settings)).structure)
    values = np.array([[value for _, value in corner] for corner in corners])
    varying = {path: values[:, k] for k, (path, _) in enumerate(corners[0])}
    cases = conditions(settings, structure, varying, len(corners))
    is_static = settings.scene.initial == "static"
    return corners, trials.Problem(structure, cases, is_static, settings.reduction, setting.sampling, setting.shortest)


def _choice(least: trials.LeastVectors, corners: list[Corner]) -> ChosenModes:
    lost = [f"{corner_text(corners[k])} ({why})" for k, why in least.untried.items()]
    named = "; ".join(lost[:_CORNERS_NAMED]) + (
        f"; and {len(lost) - _CORNERS_NAMED} more" if len(lost) > _CORNERS_NAMED else ""
    )
    untried = f"without {len(lost)} of {len(corners)} corners of the scene: {named}" if lost else ""
    return ChosenModes(*least.counts, least.error, corners[least.worst], least.against, untried)


Choices = Mapping[str, ChosenModes]
"""Counts of modes that tolerances decide, by the first outer index they belong to, which for those of references
:data:`OF_REFERENCE` precedes."""


def choices_text(choices: Choices) -> str:
    """Return choices as JSON; an error that is NaN as null."""
    entries = {name: asdict(choice) | {"hardest": dict(choice.hardest)} for name, choice in choices.items()}
    for entry in entries.values():
        entry["error"] = None if isnan(entry["error"]) else entry["error"]
    return json.dumps(entries, sort_keys=True, allow_nan=False)


def read_choices(text: str) -> Choices:
    """Return choices from what :func:`choices_text` has made of them; none, they are made anew, where it is damaged."""
    choices: dict[str, ChosenModes] = {}
    with suppress(ValueError, LookupError, TypeError, AttributeError):
        for name, entry in json.loads(text).items():
            error, hardest = nan if entry["error"] is None else entry["error"], tuple(entry["hardest"].items())
            choices[name] = ChosenModes(**{**entry, "error": error, "hardest": hardest})
    return choices
