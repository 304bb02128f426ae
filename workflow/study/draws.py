"""Zips whose values are drawn: designs of experiments, and the matrices of Sobol' indices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workflow.study.mistakes import wrong
from workflow.study.ranges import MOST_VALUES, Range

INDICES = "sobol_indices"
SAMPLES = ("latin_hypercube", "random", INDICES)

POINT, MATRIX = "sample_point", "sample_matrix"
"""Coordinates of an archive along a drawn zip."""


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


def drawn(sample: str, points: int, of: Mapping[str, Range], seed: int = 0) -> Drawn:
    """Return a drawn zip.

    Raises
    ------
    WrongValueError
        There is nothing to draw, too much, or Sobol' indices have one number or points that are no power of two.
    """
    if len(of) < (least := 2 if sample == INDICES else 1):
        raise wrong(f"has {len(of)} numbers", f"write at least {least}, as `path: [low, high]`", "of")
    if sample == INDICES and points & (points - 1):
        below = 2 ** (points.bit_length() - 1)
        raise wrong(f"{points} is no power of two", f"write {below} or {2 * below}", "points")
    zipped = Drawn(sample, points, seed, of)
    if zipped.count > MOST_VALUES:
        most = MOST_VALUES // len(zipped.matrices)
        raise wrong(f"come to {zipped.count} cases", f"write at most {most}", "points")
    return zipped
