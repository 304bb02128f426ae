"""Harmonics of the load besides its first sinusoid, and of the casing's motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array, elementwise


@dataclass(frozen=True, eq=False)
class Harmonics:
    """A sum Σ a_k sin(2π f_k t + φ_k) for each case.

    Attributes
    ----------
    amplitude, frequency, phase
        a_k [N or m], f_k [Hz] and φ_k [rad]; shape ``(case, harmonic)``, the same number for all cases.
    """

    amplitude: Array
    frequency: Array
    phase: Array

    @property
    def width(self) -> int:
        """Number of harmonics."""
        return int(self.amplitude.shape[1])

    @property
    def rows(self) -> tuple[Array, Array, Array]:
        """Amplitude, frequency and phase."""
        return self.amplitude, self.frequency, self.phase

    @property
    def acting(self) -> NDArray[np.bool_]:
        """Whether a case has a nonzero amplitude, ``(case,)``."""
        return np.asarray(np.any(self.amplitude != 0, axis=1))

    @property
    def angular(self) -> Array:
        """Angular frequencies 2π f_k, rad/s, ``(case, harmonic)``."""
        return 2 * np.pi * self.frequency

    @property
    def reach(self) -> Array:
        """Bound Σ |a_k| of the sum, ``(case,)``."""
        return np.asarray(np.abs(self.amplitude).sum(axis=1))

    def __getitem__(self, which: Any) -> Harmonics:
        """Return the harmonics of some cases."""
        return Harmonics(*(row[which] for row in self.rows))

    def spread(self, count: int) -> Harmonics:
        """Return the harmonics of one case, or none, repeated for ``count`` cases."""
        return Harmonics(*(np.array(np.broadcast_to(row, (count, self.width))) for row in self.rows))

    def scaled(self, factor: float) -> Harmonics:
        """Return the harmonics with all amplitudes multiplied by a factor."""
        return replace(self, amplitude=self.amplitude * factor)

    def added(self, constant: Array, t: float | Array) -> Array:
        """Return a constant plus the sum at time t, added in the order of the harmonics, ``(case,)``.

        For times ``(time, 1)`` the constant and the result are ``(time, case)``.
        """
        total = np.array(constant)
        for k in range(self.width):
            total += self.amplitude[:, k] * self.sine_cosine(k, t)[0]
        return total

    def rate_at(self, t: float) -> Array:
        """Return the time derivative Σ a_k 2π f_k cos(2π f_k t + φ_k) of the sum, ``(case,)``."""
        total = np.zeros(self.amplitude.shape[0])
        for k in range(self.width):
            total += self.amplitude[:, k] * self.angular[:, k] * self.sine_cosine(k, t)[1]
        return total

    def sine_cosine(self, k: int, t: float | Array) -> tuple[Array, Array]:
        """Return sine and cosine of 2π f_k t + φ_k, the same bits on every processor."""
        return elementwise.sine_cosine(2 * np.pi * (self.frequency[:, k] * t) + self.phase[:, k])


NO_HARMONICS = Harmonics(*np.zeros((3, 1, 0)))
"""No sinusoid at all."""
