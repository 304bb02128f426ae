"""Cases of one structure: contact parameters, casing, loads with their harmonics, and initial states."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array, elementwise
from workflow.kernels.compiled import kernel
from workflow.models._coating import Coating


class EndState(NamedTuple):
    """States in which cases end: m, m/s and K, ``(case, coordinate)`` each."""

    displacement: Array
    velocity: Array
    temperature: Array


@dataclass(frozen=True, eq=False)
class Harmonics:
    """A sum Σ a_k sin(2π f_k t + φ_k) for each case."""

    amplitude: Array
    frequency: Array
    phase: Array
    """``amplitude``, ``frequency``, ``phase``: a_k [N or m], f_k [Hz] and φ_k [rad]; shape ``(case, harmonic)``, the
    same number for all cases."""

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

    def rounding_scales(self, duration: float) -> tuple[Array, Array]:
        """Return Σ |a_k| (1 + |ω_k| T) and Σ |a_k ω_k| (1 + |ω_k| T), ``(case,)``.

        Rounding of the sum and of its rate within a time T is relative to these.
        """
        size = np.abs(self.amplitude) * (1 + np.abs(self.angular) * duration)
        return size.sum(axis=1), (size * np.abs(self.angular)).sum(axis=1)

    def turned(self, turns: Array) -> Harmonics:
        """Return the harmonics ahead by so many turns, 1, ``(case, harmonic)``."""
        return replace(self, phase=self.phase + 2 * np.pi * turns)

    def __getitem__(self, which: Any) -> Harmonics:
        """Return the harmonics of some cases."""
        return Harmonics(*(row[which] for row in self.rows))

    def joined(self, others: Harmonics) -> Harmonics:
        """Return these harmonics, then others of the same cases."""
        return Harmonics(*map(np.hstack, zip(self.rows, others.rows, strict=True)))

    def spread(self, count: int) -> Harmonics:
        """Return the harmonics of one case, or none, repeated for ``count`` cases."""
        return Harmonics(*(np.array(np.broadcast_to(row, (count, self.width))) for row in self.rows))

    def scaled(self, factor: float) -> Harmonics:
        """Return the harmonics with all amplitudes multiplied by a factor."""
        return replace(self, amplitude=self.amplitude * factor)

    def added(self, constant: Array, t: float | Array) -> Array:
        """Return a constant plus the sum at time t, added in the order of the harmonics, ``(case,)``.

        For times ``(time, 1)`` it is ``(time, case)``.
        """
        total = constant + np.zeros(np.shape(t))
        for k in range(self.width):
            total += self.amplitude[:, k] * self.sine_cosine(k, t)[0]
        return total

    def sine_cosine(self, k: int, t: float | Array) -> tuple[Array, Array]:
        """Return sine and cosine of 2π f_k t + φ_k, the same bits on every processor."""
        return elementwise.sine_cosine(2 * np.pi * (self.frequency[:, k] * t) + self.phase[:, k])


NO_HARMONICS = Harmonics(*np.zeros((3, 1, 0)))
"""No sinusoid at all."""


@dataclass(frozen=True, eq=False)
class Cases:
    """Parameters and initial states of the cases of a batch, in the coordinates of its structure."""

    e: Array
    alpha: Array
    """``e``, ``alpha``: restitution coefficient [1] and heat coupling [W/N], ``(case,)``."""
    gaps: Array
    """Clearances d_i of the contacts, m, ``(case, contact)``."""
    mean: Array
    """Tip load F0 besides its harmonics, N, shape ``(case,)``."""
    steady: Array
    """Constant load of each mechanical coordinate, N, shape ``(case, mechanical)``."""
    heating: Array
    """Constant heat load of each thermal coordinate, W, shape ``(case, thermal)``."""
    displacement: Array
    velocity: Array
    """``displacement``, ``velocity``: initial state, m and m/s, shape ``(case, mechanical)``; the tip is last."""
    temperature: Array
    """Initial temperature rises, K, shape ``(case, thermal)``; the tip is last."""
    load_harmonics: Harmonics = NO_HARMONICS
    casing_harmonics: Harmonics = NO_HARMONICS
    """``load_harmonics``, ``casing_harmonics``: harmonics of the tip load, N, and of the casing's position besides d,
    m; none by default."""
    friction: Array = field(default_factory=lambda: np.zeros(0))
    """Friction coefficient µ of a structure with a sliding direction t: the contact force acts along n - µt. 1, shape
    ``(case,)``; 0 by default."""
    turns: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    """Phases k ψ_i by which contact i sees harmonics of the casing of order k ahead, rad, ``(case, contact,
    harmonic)``; 0 for those given by a frequency, and by default."""
    offset: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """Displacement of contacts without mass by constant loads beside that of the modes, m, ``(case, contact)``; 0 by
    default."""
    coating: Coating | None = None
    """That of the casing, ``None`` where it has none."""

    def __post_init__(self) -> None:
        """Fill what is left out with a row for each case."""
        contacts = self.gaps.shape[1]
        for name, shape in {
            "friction": (),
            "offset": (contacts,),
            "turns": (contacts, self.casing_harmonics.width),
        }.items():
            if getattr(self, name).size == 0:
                object.__setattr__(self, name, np.zeros((self.count, *shape)))
        for name in ("load_harmonics", "casing_harmonics"):
            if getattr(self, name).width == 0:
                object.__setattr__(self, name, NO_HARMONICS.spread(self.count))

    @property
    def count(self) -> int:
        """Number of cases."""
        return self.e.size

    @property
    def clearances(self) -> Array:
        """Clearances of all contacts less their offset, m, ``(case, contact)``."""
        return self.gaps - self.offset

    @property
    def contact_shape(self) -> tuple[int, ...]:
        """Shape of what each of several contacts has: their number; none for one contact."""
        return self.gaps.shape[1:] if self.gaps.shape[1] > 1 else ()

    def take(self, which: NDArray[Any] | slice) -> Cases:
        """Return the cases selected along the first axis."""
        rows = {name: getattr(self, name)[which] for name in self.__dataclass_fields__ if name != "coating"}
        return Cases(**rows, coating=None if self.coating is None else self.coating.take(which))

    def load_at(self, t: float | Array) -> Array:
        """Return the tip load f(t) = F0 + Σ A_k sin(2π f_k t + φ_k), N, ``(case,)``.

        For times ``(time, 1)`` it is ``(time, case)``.
        """
        return self.load_harmonics.added(self.mean, t)

    def casing_of_contacts(self, t: float) -> tuple[Array, Array]:
        """Return d_i(t) = d_i + Σ a_k sin(2π f_k t + φ_k + k ψ_i) and its rate, m and m/s, ``(case, contact)``."""
        own, places = self.casing_harmonics, self.clearances
        rates = np.zeros_like(places)
        for k in range(own.width):
            phase = own.phase[:, k, None] + self.turns[:, :, k]
            sine, cosine = elementwise.sine_cosine(2 * np.pi * (own.frequency[:, k, None] * t) + phase)
            places += own.amplitude[:, k, None] * sine
            rates += (own.amplitude * own.angular)[:, k, None] * cosine
        return places, rates

    @cached_property
    def period_frequency(self) -> Array:
        """Frequency of the load periods that are counted, Hz, ``(case,)``; 0 where there are none."""
        return period_frequency(self.load_harmonics, self.casing_harmonics)

    @property
    def finite(self) -> NDArray[np.bool_]:
        """Cases whose numbers are all finite."""
        values = [getattr(self, name) for name in self.__dataclass_fields__ if name != "coating"]
        rows = [row for value in values for row in (value.rows if isinstance(value, Harmonics) else (value,))]
        fine = np.ones(self.count, dtype=bool)
        for row in rows:
            fine &= np.isfinite(row.reshape(self.count, -1)).all(axis=1)
        return fine

    @property
    def heated(self) -> NDArray[np.bool_]:
        """Cases whose thermal states can act: α, heating or an initial temperature is not zero."""
        warm = np.any(self.heating != 0, axis=1) | np.any(self.temperature != 0, axis=1)
        return np.asarray((self.alpha != 0) | warm)


def period_frequency(load: Harmonics, casing: Harmonics) -> Array:
    """Return the frequency of load periods, Hz, ``(case,)``; 0 without harmonics.

    That of the first harmonic of load and then casing, or of the second where there is one and the first is 0.
    """
    both = load.joined(casing)
    if both.width == 0:
        return np.zeros(len(both.amplitude))
    return np.where(both.amplitude[:, 0] != 0, both.frequency[:, 0], both.frequency[:, :2][:, -1])


def distinct_rows(*tables: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first index of each distinct row of tables side by side, and the distinct row that each row equals.

    Tables are ``(row, …)``. Constant columns, in most studies all, are skipped.
    """
    table = np.column_stack([each[:, (each != each[:1]).any(axis=0)] for each in tables])
    if table.size == 0:
        return np.zeros(min(len(table), 1), dtype=np.intp), np.zeros(len(table), dtype=np.intp)
    order = np.lexsort(table.T)
    is_new = np.append(True, (np.diff(table[order], axis=0) != 0).any(axis=1))
    which = np.empty(len(table), dtype=np.intp)
    which[order] = np.cumsum(is_new) - 1
    return order[is_new], which


def project(matrix: Array, states: Array) -> Array:
    """Return ``matrix @ state`` for every case, ``(case, row)``, or for one row ``row @ state``, ``(case,)``.

    The bits of a case do not depend on the others, unlike those of a matrix product, which sums in an order that
    changes with the batch size. Coordinates that are 0 are skipped: most batches start at rest and cold.
    """
    columns = np.ascontiguousarray(np.atleast_2d(matrix).T, dtype=np.float64)
    result = np.zeros((states.shape[0], columns.shape[1]))
    _add_products(columns, np.ascontiguousarray(states, dtype=np.float64), result)
    return result if matrix.ndim == 2 else result[:, 0]


def row_totals(terms: Array) -> Array:
    """Return the sum of each row ``(row, …)``, with the same bits for a row alone and among others."""
    return project(np.ones(terms.shape[1]), terms)


@kernel
def _add_products(columns: Array, states: Array, result: Array) -> None:
    """Add to each row of the result the columns of a matrix times the entries of a state, one after another."""
    for case in range(states.shape[0]):
        for k in range(columns.shape[0]):
            entry = states[case, k]
            if entry != 0.0:
                for row in range(columns.shape[1]):
                    result[case, row] += columns[k, row] * entry
