"""Order of the archive's dimensions: what fixes the operators outermost, then what varies in a batch."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import schemes
from workflow.cases._choice import OF_REFERENCE, Choices, ChosenModes, Setting, choose, refine
from workflow.cases._conditions import FRICTION, sinusoids_of
from workflow.judges.trials import EXACT
from workflow.models import AT_BORDER, Harmonics, period_frequency
from workflow.schemes import Sampling, complete_periods
from workflow.study import CHOSEN, GAP_OF, Axis, CaseSettings, Dimension, SchemeChoice, Study

Indices = NDArray[np.int64]

_MOST_SETTINGS = 256
"""Outer indices whose settings a grid keeps: several tasks of each thread."""

TOLERANCE = "tolerance"

_OPERATOR_AXES = frozenset(
    {"scheme", "h", "reduction", "mechanical_modes", "thermal_modes", "scene.casing.flexibility", TOLERANCE}
)


def fixes_operator(path: str, study: Study) -> bool:
    """Tell whether cases that differ along this axis differ in operators, not only in conditions."""
    model = study.scene.model
    of_model = path.startswith(f"scene.{model}.") and path != f"scene.{model}.heating"
    turns = path == "scene.speed" and study.depends_on_speed
    return path in _OPERATOR_AXES or path.startswith("schemes.") or of_model or turns


def reads(method: str, label: str, path: str) -> bool:
    """Tell whether a scheme's results depend on an axis."""
    if path in ("e", "h", "alpha"):
        return path in schemes.load(method).READS
    if path.startswith(FRICTION):
        return "alpha" in schemes.load(method).READS or path.endswith("coefficient")  # µ acts beside α
    return not path.startswith("schemes.") or path.startswith(f"schemes.{label}.")


@dataclass(frozen=True, eq=False)
class Grid:
    """The cases of a study in archive order; nothing is expanded.

    A case is numbered ``outer * inner_count + inner``, in C order over ``dims``. Cases of one
    ``outer`` share their operators: structure, scheme, step, basis and mode counts.
    """

    study: Study
    outer: tuple[Dimension, ...]
    inner: tuple[Dimension, ...]
    decided: Choices = field(default_factory=dict)
    """Counts of modes that were decided elsewhere, as :attr:`choices` has them."""

    @property
    def dims(self) -> tuple[tuple[str, int], ...]:
        """Names and sizes of the dimensions, outermost first."""
        return tuple((d.name, d.size) for d in (*self.outer, *self.inner))

    @property
    def outer_shape(self) -> tuple[int, ...]:
        """Sizes of the dimensions that fix operators."""
        return tuple(d.size for d in self.outer)

    @property
    def inner_shape(self) -> tuple[int, ...]:
        """Sizes of the dimensions that vary within a batch."""
        return tuple(d.size for d in self.inner)

    @property
    def outer_count(self) -> int:
        """Number of distinct settings of the outer dimensions."""
        return math.prod(self.outer_shape)

    @property
    def inner_count(self) -> int:
        """Number of cases for each of them."""
        return math.prod(self.inner_shape)

    @property
    def points(self) -> int:
        """Number of points of a line, which are the innermost cases that follow each other; 1 without a sweep."""
        return 1 if self.study.swept is None else len(self.study.swept.values)

    def lines(self, inner: Indices) -> Indices:
        """Return the inner indices of all points of the lines that some inner indices are of, ascending."""
        return np.asarray((np.unique(inner // self.points)[:, None] * self.points + np.arange(self.points)).ravel())

    def at_point(self, outer: int, point: int) -> CaseSettings:
        """Return the settings of the cases of an outer index at a point of their sweep, by which operators are made."""
        swept = self.study.swept
        if swept is None or not fixes_operator(swept.path, self.study):
            return self.settings(outer)
        return self.settings(outer, {swept.path: swept.values[point]})

    @cached_property
    def sampling(self) -> Sampling:
        """Common sampling of all histories."""
        duration, interval = self.study.scene.duration, self.study.output.interval
        count = round(duration / interval) + 1
        output, ends = self.study.output, self.study.swept is not None
        wear_every = 0 if output.wear is None else output.wear.every
        return Sampling(duration, interval, count, output.balances, output.events or 0, ends, wear_every)

    @cached_property
    def most_sectors(self) -> int:
        """Size of the dimension ``sector``: the most sectors of a coating; 0 without one."""
        coating = self.study.scene.casing.coating
        return 0 if coating is None else max(map(int, self.study.each("scene.casing.coating.sectors")))

    @cached_property
    def revolutions(self) -> Indices:
        """Revolutions at whose ends worn depths are mapped in some case, ``(revolution,)``; none if not asked for."""
        if self.study.output.wear is None:
            return np.zeros(0, dtype=np.int64)
        every, fastest = self.study.output.wear.every, max(map(float, self.study.each("scene.speed")))
        return every * np.arange(1, int(self.study.scene.duration * fastest / every + AT_BORDER) + 1)

    @cached_property
    def longest_period_count(self) -> int:
        """Size of the dimension ``period``: the most complete load periods any case has."""
        every = (complete_periods(period_frequency(*sinusoids), self.sampling) for sinusoids in self._sinusoids())
        return max(int(periods.max()) for periods in every)

    @cached_property
    def fastest(self) -> float:
        """Largest frequency of load and casing in any case, Hz."""
        return max(float(load.joined(casing).frequency.max()) for load, casing in self._sinusoids())

    def _sinusoids(self) -> Iterator[tuple[Harmonics, Harmonics]]:
        """Yield harmonics of load and casing of one case for each combination of what decides frequencies."""
        inner = self.inner_distinct(_decides_frequencies)
        varying = self.inner_values(inner)
        for outer in np.unique(self.alike(np.arange(self.outer_count, dtype=np.int64), _decides_frequencies)).tolist():
            yield sinusoids_of(self.settings(outer).scene, varying, inner.size)

    @cached_property
    def base(self) -> dict[str, Any]:
        """Values of the scalars, and the first ones of every axis."""
        return {axis.path: axis.values[0] for axis in (*self.study.scalars, *self._varied)}

    @property
    def _varied(self) -> tuple[Axis, ...]:
        """Axes of all dimensions, and the continuation parameter of a branch."""
        followed = () if self.study.branch is None else (self.study.branch.axis,)
        return (*(axis for dimension in (*self.outer, *self.inner) for axis in dimension.axes), *followed)

    def settings(self, outer: int, replaced: Mapping[str, Any] | None = None) -> CaseSettings:
        """Return the settings of the first case of an outer index, some of them replaced."""
        return self._settings(outer, replaced) if replaced else self._cached_settings(outer)

    @cached_property
    def _cached_settings(self) -> Callable[[int], CaseSettings]:
        """Settings of recent outer indices: a task reads those of one outer index about five times."""
        return lru_cache(maxsize=_MOST_SETTINGS)(lambda outer: self._settings(outer, {}))

    def _settings(self, outer: int, replaced: Mapping[str, Any]) -> CaseSettings:
        values = self._values(outer)
        chosen = self.choice(outer)
        counts = {} if chosen is None else chosen.counts
        return self.study.cell({**values, **counts, **replaced})

    def _values(self, outer: int) -> dict[str, Any]:
        """Return the values of the first case of an outer index, by path."""
        values = dict(self.base)
        for dimension, index in zip(self.outer, _unravelled(outer, self.outer_shape), strict=True):
            values.update({axis.path: axis.values[int(index)] for axis in dimension.axes})
        return values

    def value(self, outer: int, path: str) -> Any:
        """Return the value of a setting for the first case of an outer index."""
        return self._values(outer)[path]

    def choice(self, outer: int) -> ChosenModes | None:
        """Return the counts of modes that the tolerance of an outer index decides, ``None`` where the study does."""
        if not self.study.is_auto:
            return None
        values = self._values(outer)
        if CHOSEN not in (values["mechanical_modes"], values["thermal_modes"]):
            return None
        first = int(self.alike(np.array([outer]), decides_structure)[0])
        return self.decided.get(str(first)) or choose(self._setting(first, {}), float(values[TOLERANCE]))

    def reference_choice(self, outer: int) -> ChosenModes | None:
        """Return the counts of modes of an outer index's reference that its tolerance decides, ``None`` without one."""
        reference = self.study.reference
        if reference is None or not reference.is_auto:
            return None
        first = int(self.alike(np.array([outer]), self._decides_reference)[0])
        setting, tolerance = self._setting(first, reference.values), float(reference.values[TOLERANCE])
        return self.decided.get(f"{OF_REFERENCE}{first}") or refine(setting, tolerance)

    def _decides_reference(self, path: str) -> bool:
        assert self.study.reference is not None
        return decides_structure(path) and path not in self.study.reference.values

    def _setting(self, outer: int, replaced: Mapping[str, Any]) -> Setting:
        """Return what trials for an outer index depend on, some values replaced.

        An axis that is followed has corners too, its ends.
        """
        dimensions = list(self.inner)
        for followed in (self.study.branch, self.study.boundary):
            if followed is not None and not fixes_operator(followed.axis.path, self.study):
                dimensions.append(Dimension(followed.axis.name, (followed.axis,)))
        left = [replace(d, axes=tuple(axis for axis in d.axes if axis.path not in replaced)) for d in dimensions]
        settings = self.study.cell({**self._values(outer), **replaced})
        sampling = replace(self.sampling, balances=False)
        return Setting(settings, tuple(dimension for dimension in left if dimension.axes), sampling, self.shortest)

    @cached_property
    def choices(self) -> Choices:
        """All counts of modes that tolerances decide."""
        every, reference = np.arange(self.outer_count, dtype=np.int64), self.study.reference
        chosen: dict[str, ChosenModes | None] = {}
        if self.study.is_auto:
            chosen |= {str(k): self.choice(k) for k in np.unique(self.alike(every, decides_structure)).tolist()}
        if reference is not None and reference.is_auto:
            first = np.unique(self.alike(every, self._decides_reference)).tolist()
            chosen |= {f"{OF_REFERENCE}{k}": self.reference_choice(k) for k in first}
        return {name: choice for name, choice in chosen.items() if choice is not None}

    @cached_property
    def shortest(self) -> float:
        """Shortest time that steps resolve, s; the samples where no scheme of the study has steps."""
        stepping = any("h" in schemes.load(choice.method).READS for choice in self.study.schemes.values())
        return min(map(float, self.study.each("h"))) if stepping else self.sampling.interval

    def inner_values(self, inner: Indices) -> Mapping[str, NDArray[np.float64]]:
        """Return the values of the axes that vary within a batch, each ``(case,)``, by path."""
        values: dict[str, NDArray[np.float64]] = {}
        for dimension, index in zip(self.inner, _unravelled(inner, self.inner_shape), strict=True):
            for axis in dimension.axes:
                values[axis.path] = np.asarray(axis.values, dtype=np.float64)[index]
        return values

    def is_read(self, scheme: SchemeChoice) -> Callable[[str], bool]:
        """Return what tells whether a scheme's results depend on an axis of this study."""
        swept = self.study.swept

        def is_read(path: str) -> bool:
            follows = swept is not None and path == swept.path  # a point has the state of those before
            return follows or (self._acts(path) and reads(scheme.method, scheme.label, path))

        return is_read

    def _acts(self, path: str) -> bool:
        """Tell whether an axis can change results: not a tolerance that decides no count."""
        return path != TOLERANCE or self.study.is_auto

    def matters(self, scheme: SchemeChoice) -> Callable[[str], bool]:
        """Return what tells whether a scheme's results depend on an axis, or what their errors are measured against.

        That is the reference, where there is one, and the exact solution that splits the errors.
        """
        is_read, reference = self.is_read(scheme), self.study.reference
        if reference is None:
            return is_read
        truth = self.study.schemes[str(reference.values.get("scheme", scheme.label))]

        def is_compared(path: str) -> bool:
            read = any(reads(method, truth.label, path) for method in (truth.method, EXACT))
            return read and path not in reference.values and self._acts(path)

        return lambda path: is_read(path) or is_compared(path)

    @cached_property
    def computed(self) -> Indices:
        """Outer indices that are computed, in order."""
        return np.flatnonzero(self.sharing)

    @cached_property
    def sharing(self) -> Indices:
        """For each outer index the number of outer indices that its results are for, ``(outer,)``.

        Of those that differ in nothing that their scheme reads the first is computed; of the others the number is 0.
        """
        first = np.arange(self.outer_count, dtype=np.int64)
        of_scheme = self.alike(first, lambda path: path == "scheme")
        for one in np.unique(of_scheme).tolist():
            same = np.flatnonzero(of_scheme == one)
            first[same] = self.alike(same, self.matters(self.study.schemes[str(self.value(one, "scheme"))]))
        return np.bincount(first, minlength=first.size)

    def inner_computed(self, outer: int) -> Indices:
        """Return the inner indices that are computed of an outer one; the others have results of these."""
        return self._inner_computed(str(self.value(outer, "scheme")))

    def times(self, outer: int) -> int:
        """Return how many cases have the results of each case that is computed of an outer index."""
        return int(self.sharing[outer]) * (self.inner_count // self.inner_computed(outer).size)

    @cached_property
    def _inner_computed(self) -> Callable[[str], Indices]:
        return cache(lambda label: self.inner_distinct(self.matters(self.study.schemes[label])))

    def kinds(self, matters: Callable[[str], bool]) -> list[int]:
        """Return the first of the computed outer indices that differ along axes that matter."""
        return [int(outer) for outer in np.unique(self.alike(self.computed, matters))]

    def alike(self, outer: Indices, matters: Callable[[str], bool]) -> Indices:
        """Return for each outer index the first one that differs only along axes that do not matter."""
        return _alike(self.outer, outer, matters)

    def inner_alike(self, inner: Indices, matters: Callable[[str], bool]) -> Indices:
        """Return for each inner index the first one that differs only along axes that do not matter."""
        return _alike(self.inner, inner, matters)

    def inner_distinct(self, matters: Callable[[str], bool]) -> Indices:
        """Return the first inner index of each combination of values along the axes that matter."""
        if not self.inner:
            return np.zeros(1, dtype=np.int64)
        places = np.ix_(*(np.arange(d.size if _any(d, matters) else 1) for d in self.inner))
        return np.asarray(np.ravel_multi_index(places, self.inner_shape), dtype=np.int64).ravel()

    def inner_distinct_count(self, matters: Callable[[str], bool]) -> int:
        """Return how many combinations of values the inner indices have along the axes that matter."""
        return math.prod(d.size for d in self.inner if _any(d, matters))


def _any(dimension: Dimension, matters: Callable[[str], bool]) -> bool:
    return any(matters(axis.path) for axis in dimension.axes)


def _alike(dimensions: tuple[Dimension, ...], index: Indices, matters: Callable[[str], bool]) -> Indices:
    """Return for each index over some dimensions the first one that differs only along axes that do not matter."""
    if not dimensions:
        return index
    shape = tuple(dimension.size for dimension in dimensions)
    places = zip(dimensions, np.unravel_index(index, shape), strict=True)
    first = [place if _any(dimension, matters) else np.zeros_like(place) for dimension, place in places]
    return np.asarray(np.ravel_multi_index(first, shape), dtype=np.int64)


def _unravelled(index: Any, shape: tuple[int, ...]) -> tuple[Any, ...]:
    """Return :func:`numpy.unravel_index`, which does not take an array for a shape without dimensions."""
    return np.unravel_index(index, shape) if shape else ()


def _decides_frequencies(path: str) -> bool:
    """Tell whether frequencies of load and casing, or which of them counts periods, may differ so."""
    names = ("scene.speed", "scene.load.amplitude", "scene.load.frequency")
    return path in names or path.startswith(("scene.load.harmonics.", "scene.casing.harmonics."))


def decides_structure(path: str) -> bool:
    """Tell whether the structure that a case is run on, and the counts that a tolerance decides, may differ so."""
    return path not in ("scheme", "h") and not path.startswith("schemes.")


def arrange(study: Study, decided: Choices | None = None) -> Grid:
    """Order a study's dimensions: operators outermost, then conditions; ``decided`` as :attr:`Grid.choices`.

    The order depends on what varies, neither on how many values it has nor on its place in the file: an axis that
    grows leaves the archive's dimensions as they are. Conditions that are mostly varied finely lie innermost, and
    within them the points of a sweep, whatever it varies.
    """
    outer = [d for d in study.dimensions if not d.swept and any(fixes_operator(a.path, study) for a in d.axes)]
    inner = [d for d in study.dimensions if d not in outer]
    outer.sort(key=lambda d: (min(_outermost_first(axis.path) for axis in d.axes), d.name))
    inner.sort(key=lambda d: (d.swept, max(_innermost_last(axis.path) for axis in d.axes), d.name))
    return Grid(study, tuple(outer), tuple(inner), decided or {})


def _outermost_first(path: str) -> int:
    """Rank scheme before structure before its basis before its modes before the step."""
    order = {"scheme": 0, "reduction": 2, "mechanical_modes": 3, "thermal_modes": 3, TOLERANCE: 3, "h": 4}
    return order.get(path, 1)


def _innermost_last(path: str) -> int:
    """Rank conditions by how finely they are mostly varied: the load frequency is swept, the start has a few values."""
    order = {"e": 1, "scene.casing.gap": 2, "alpha": 3, "scene.load.frequency": 4, "scene.speed": 4}
    return 3 if path.startswith(FRICTION) else 2 if path.startswith(GAP_OF) else order.get(path, 0)
