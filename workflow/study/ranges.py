"""Values of axes: single, listed, spread between two ends; or drawn there, as designs and for Sobol' indices."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic_core import core_schema

from workflow.declare import Quantity
from workflow.study.forms import Entry, Kind, Number, either, many, no_mapping, number, record
from workflow.study.mistakes import quoted, wrong

Value = float | int | str
Law = Literal["lin", "log", "branch", "sweep", "boundary"]
LAWS: tuple[Law, ...] = ("lin", "log", "branch", "sweep", "boundary")
FOLLOWED = ("branch", "boundary")
MOST_VALUES = 10**6
MOST_POINTS = 10_000
"""Of a branch or a boundary."""


@dataclass(frozen=True)
class Range:
    """Values between two ends, at equal or drawn distances or ratios, or those that are followed."""

    law: Law
    low: float
    high: float

    def values(self, shares: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the values at shares of the range, rounded to 12 significant digits."""
        ends = np.array([self.low, self.high])
        first, last = np.log10(ends) if self.law == "log" else ends
        values = first * (1 - shares) + last * shares
        return tuple(float(f"{value:.12g}") for value in (10.0**values if self.law == "log" else values))

    def spread(self, count: int) -> tuple[float, ...]:
        """Return so many values at equal distances or ratios."""
        return self.values(np.arange(count) / (count - 1))


@dataclass(frozen=True)
class Followed(Range):
    """A range along which branches, or their boundaries, are followed, of at most so many points."""

    points: int


@dataclass(frozen=True)
class Swept:
    """Values of an axis each of which starts from the state in which the one before ended."""

    values: tuple[float, ...]


Content = Value | tuple[Value, ...] | Followed | Swept
"""Of an axis: one value, which makes no dimension, several, or a range that is followed or swept."""


def axis_values(kind: Kind, zipped: bool = False) -> Kind:
    """Return the kind of an axis: a scalar, a list, or ``{LAW: [first, last, count]}``, one of LAWS."""

    def choose(value: Any) -> int:
        if isinstance(value, dict):
            if not isinstance(kind, Number):
                raise wrong("has words for values, which cannot be spread", "write a list")
            return 1
        if isinstance(value, list):
            if not value:
                raise wrong("is empty", "write at least one value, or leave the axis out")
            return 0
        if zipped:
            raise wrong(f"{quoted(value)} is not a list", "write a list as long as the others of this zip")
        return len(kinds)

    one = kind.checked(_single)
    kinds = [many(one, minItems=1)]
    if isinstance(kind, Number):
        laws = LAWS[:2] if zipped or kind.whole else LAWS
        own = "write a list or lin: what is followed, or swept, is a real-valued axis of its own"
        kinds.append(_under({law: _spread(law, kind) for law in laws}, _SPREAD, dict.fromkeys(LAWS[2:], own)))
    return either(choose, *kinds, *([] if zipped else [one]))


def _single(value: Any) -> Any:
    if isinstance(value, list | dict):
        raise wrong(f"{quoted(value)} is not a single value", "an axis has single values")
    return value


_SPREAD = "write a list, {lin: [first, last, count]} or {log: [first, last, count]}"


def _spread(law: Law, kind: Number) -> Kind:
    """Return the kind of ``[first, last, count]``."""

    def build(entries: tuple[float, float, int]) -> Content:
        first, last, size = entries
        if first == last:
            raise wrong("begins and ends with the same value", "write a list of one value")
        if law == "log" and not min(first, last) > 0:
            raise wrong("a logarithmic axis needs positive ends", "write above 0, or use lin")
        if law in FOLLOWED:
            return Followed(law, first, last, size)
        values = Range(law, first, last).spread(size)
        if law == "sweep":
            return Swept(values)
        if not kind.whole:
            return values
        if any(each != int(each) for each in values):
            raise wrong("has values that are not whole numbers", "write a list")
        return tuple(map(int, values))

    count = Quantity("1", "number of values", at_least=2, at_most=MOST_POINTS if law in FOLLOWED else MOST_VALUES)
    kinds = (kind.single, kind.single, number(count, whole=True))
    return _some(kinds, "not first, last and count", _SPREAD, build)


def between(kind: Number) -> Kind:
    """Return the kind of the range of a number that is drawn: ``[low, high]``, or ``{log: [low, high]}``."""

    def build(law: Law, ends: tuple[float, float]) -> Range:
        low, high = ends
        if not low < high:
            raise wrong("is not from low to high", "write the lower end first")
        if law == "log" and not low > 0:
            raise wrong("is logarithmic and needs positive ends", "write above 0, or [low, high]")
        return Range(law, low, high)

    remedy = "write [low, high] or {log: [low, high]}"
    lin, log = (_some((kind, kind), "no range", remedy, partial(build, law)) for law in LAWS[:2])
    others: dict[str, str] = {"lin": "write [low, high]", **dict.fromkeys(LAWS[2:], remedy)}
    return either(no_mapping, _under({"log": log}, remedy, others), lin)


def _some(kinds: tuple[Kind, ...], otherwise: str, remedy: str, build: Callable[[Any], Any]) -> Kind:
    """Return the kind of a list of some entries, each of its own kind, of which something is built."""

    def check(value: Any) -> list[Any]:
        if not isinstance(value, list) or len(value) != len(kinds):
            raise wrong(f"{quoted(value)} is {otherwise}", remedy)
        return value

    length = {"minItems": len(kinds), "maxItems": len(kinds)}
    schema = {"type": "array", "prefixItems": [kind.schema for kind in kinds], **length}
    return Kind(core_schema.tuple_schema([kind.core for kind in kinds]), schema).checked(check).built(build)


def _under(kinds: Mapping[Law, Kind], remedy: str, others: Mapping[str, str]) -> Kind:
    """Return the kind of ``{LAW: ...}``, read as what stands there; ``others`` says what to write for other laws."""

    def build(given: dict[str, Any]) -> Any:
        if len(given) != 1:
            raise wrong(f"has {len(given)} keys where it takes one", remedy)
        return next(iter(given.values()))

    entries: dict[str, Entry] = {law: Entry(kind, f"values whose law is {law}") for law, kind in kinds.items()}
    form = record("Values between two ends.", entries, build, others)
    return replace(form, schema=form.schema | {"minProperties": 1, "maxProperties": 1})


INDICES = "sobol_indices"
SAMPLES = ("latin_hypercube", "random", INDICES)

SWEEP = "sweep"
"""Attribute of the coordinate of a sweep in an archive."""

POINT, MATRIX = "sample_point", "sample_matrix"
"""Coordinates of an archive along a drawn zip."""


@dataclass(frozen=True)
class Drawn:
    """A zip whose numbers are drawn from ranges, point by point."""

    sample: str
    """``random``; ``latin_hypercube``, each number once in each of as many equal parts as there are points; or
    ``sobol_indices``, matrices A and B of a scrambled Sobol' sequence and, for each number, A with that of B."""
    points: int
    seed: int
    """``points``, ``seed``: number of points, and what the generator starts from."""
    ranges: Mapping[str, Range]
    """By path, in the order of the study."""

    @property
    def matrices(self) -> tuple[str, ...]:
        """Matrices that give a case to each point: ``A``, ``B``, or the path of the number that A has from B."""
        return ("A", "B", *self.ranges) if self.sample == INDICES else ("A",)

    @property
    def count(self) -> int:
        """Number of cases."""
        return self.points * len(self.matrices)

    def columns(self) -> dict[str, tuple[float, ...]]:
        """Return the values of every number, point by point and for each point matrix by matrix."""
        columns = self._shares().reshape(self.count, len(self.ranges)).T
        return {path: span.values(shares) for (path, span), shares in zip(self.ranges.items(), columns, strict=True)}

    def _shares(self) -> NDArray[np.float64]:
        """Return shares of the ranges, ``(point, matrix, number)``; but for hypercubes more points keep the first."""
        from scipy.stats import qmc

        size = len(self.ranges)
        if self.sample == "random":
            return np.random.default_rng(self.seed).random((self.points, 1, size))
        if self.sample != INDICES:
            return np.asarray(qmc.LatinHypercube(size, seed=self.seed).random(self.points))[:, None]
        both = np.asarray(qmc.Sobol(2 * size, bits=64, seed=self.seed).random(self.points))
        a, b = both[:, None, :size], both[:, None, size:]
        return np.concatenate([a, b, np.where(np.eye(size, dtype=bool), b, a)], axis=1)


def drawn(sample: str, points: int, of: Mapping[str, Range], seed: int = 0) -> Drawn:
    """Return a drawn zip.

    Refuses nothing to draw, too much, Sobol' indices of one number, and points that are no power of two.
    """
    if len(of) < (least := 2 if sample == INDICES else 1):
        raise wrong(f"has {len(of)} numbers", f"write at least {least}, as `path: [low, high]`", "of")
    if sample == INDICES and points & (points - 1):
        below = 2 ** (points.bit_length() - 1)
        raise wrong(f"{points} is no power of two", f"write {below} or {2 * below}", "points")
    zipped = Drawn(sample, points, seed, of)
    if zipped.count > MOST_VALUES:
        most = MOST_VALUES // len(zipped.matrices)
        raise wrong(f"make {zipped.count} cases", f"write at most {most}", "points")
    return zipped
