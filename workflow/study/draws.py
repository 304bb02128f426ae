"""Zips whose values are drawn: designs of experiments, and the matrices of Sobol' indices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from workflow.study.field_types import MOST_VALUES, FieldType, Reading, Schema, at, read_each
from workflow.study.mistakes import quoted, wrong

INDICES = "sobol_indices"
SAMPLES = ("latin_hypercube", "random", INDICES)

POINT, MATRIX = "sample_point", "sample_matrix"
"""Coordinates of an archive along a drawn zip."""


@dataclass(frozen=True)
class Range:
    """Values between two ends, at equal or drawn distances or ratios, or those of a branch."""

    law: Literal["lin", "log", "branch"]
    low: float
    high: float

    def values(self, shares: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the values at shares of the range, rounded to 12 significant digits."""
        ends = np.array([self.low, self.high])
        first, last = np.log10(ends) if self.law == "log" else ends
        values = first * (1 - shares) + last * shares
        return tuple(float(f"{value:.12g}") for value in (10.0**values if self.law == "log" else values))


@dataclass(frozen=True)
class Drawn:
    """A zip whose numbers are drawn from ranges, point by point.

    Attributes
    ----------
    sample
        ``random``; ``latin_hypercube``, each number once in each of as many equal parts as there are points; or
        ``sobol_indices``, matrices A and B of a scrambled Sobol' sequence and, for each number, A with that of B.
    points, seed
        Number of points, and what the generator starts from.
    ranges
        By path, in the order of the study.
    """

    sample: str
    points: int
    seed: int
    ranges: Mapping[str, Range]

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


@dataclass(frozen=True)
class Between(FieldType):
    """The range of a number that is drawn: ``[low, high]``, or ``{log: [low, high]}``."""

    value: Reading

    def read(self, value: Any, context: Mapping[str, Any]) -> Range:
        """Return the range in SI."""
        law: Literal["lin", "log"] = "log" if isinstance(value, dict) and set(value) == {"log"} else "lin"
        ends = value["log"] if law == "log" else value
        if not isinstance(ends, list) or len(ends) != 2:
            raise wrong(f"{quoted(ends)} is no range", "write [low, high] or {log: [low, high]}")
        low, high = read_each(ends, self.value.scalar, *(["log"] if law == "log" else []))
        if not low < high:
            raise wrong("does not end above its begin", "write the lower end first")
        if law == "log" and not low > 0:
            raise wrong("has a logarithm and needs positive ends", "write above 0, or [low, high]")
        return Range(law, low, high)

    def schema(self) -> Schema:
        """Return the two forms of a range."""
        ends: Schema = {"type": "array", "items": self.value.schema(), "minItems": 2, "maxItems": 2}
        log: Schema = {"type": "object", "properties": {"log": ends}, "required": ["log"]}
        return {"anyOf": [ends, log | {"additionalProperties": False}]}


def drawn(sample: str, points: int, seed: int, ranges: Mapping[str, Range]) -> Drawn:
    """Return a drawn zip.

    Raises
    ------
    PydanticCustomError, ValidationError
        There is nothing to draw, too much, or Sobol' indices have one number or points that are no power of two.
    """
    if len(ranges) < (least := 2 if sample == INDICES else 1):
        raise at("of", wrong(f"has {len(ranges)} numbers", f"write at least {least}, as `path: [low, high]`"), ranges)
    if sample == INDICES and points & (points - 1):
        below = 2 ** (points.bit_length() - 1)
        raise at("points", wrong(f"{points} is no power of two", f"write {below} or {2 * below}"), points)
    zipped = Drawn(sample, points, seed, ranges)
    if zipped.count > MOST_VALUES:
        most = MOST_VALUES // len(zipped.matrices)
        raise at("points", wrong(f"come to {zipped.count} cases", f"write at most {most}"), points)
    return zipped
