"""What differs between cases on one structure: contact law, clearance, loads, initial state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array


@dataclass(frozen=True, eq=False)
class Cases:
    """What differs from case to case of a batch, in the coordinates of its structure.

    Attributes
    ----------
    e, alpha, gap
        Restitution coefficient [1], heat coupling [W/N], clearance d [m]; shape ``(case,)``.
    mean, amplitude, frequency, phase
        Tip load F0 + F1 sin(2π f t + φ): N, N, Hz, rad; shape ``(case,)``.
    steady
        Constant load of each mechanical coordinate, N, shape ``(case, mechanical)``.
    heating
        Constant heat load of each thermal coordinate, W, shape ``(case, thermal)``.
    displacement, velocity
        Initial state, m and m/s, shape ``(case, mechanical)``; the tip is last.
    temperature
        Initial temperature rises, K, shape ``(case, thermal)``; the tip is last.
    """

    e: Array
    alpha: Array
    gap: Array
    mean: Array
    amplitude: Array
    frequency: Array
    phase: Array
    steady: Array
    heating: Array
    displacement: Array
    velocity: Array
    temperature: Array

    @property
    def count(self) -> int:
        """Number of cases."""
        return self.e.size

    def take(self, which: NDArray[Any] | slice) -> Cases:
        """Return the cases selected along the first axis."""
        return Cases(**{name: getattr(self, name)[which] for name in self.__dataclass_fields__})

    @property
    def heated(self) -> NDArray[np.bool_]:
        """Cases whose thermal states can act: α, heating or an initial temperature is not zero."""
        warm = np.any(self.heating != 0, axis=1) | np.any(self.temperature != 0, axis=1)
        return np.asarray((self.alpha != 0) | warm)


def project(matrix: Array, states: Array) -> Array:
    """Return ``matrix @ state`` for every case, the same bits whatever cases stand beside it.

    A matrix product over the case axis would not do: its sums change order with the batch size.
    Coordinates that are 0 in all cases are passed over: they would add zeros, and most batches
    start at rest and cold.
    """
    result = np.zeros((states.shape[0], matrix.shape[0]))
    for column in np.flatnonzero(states.any(axis=0)):
        result += matrix[:, column] * states[:, column, None]
    return result
