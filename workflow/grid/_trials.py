"""Trials of reduced models in time: corners of a study's scene, run exactly, and how far fewer vectors are from them.

A corner takes of each dimension the hardest or the mildest value: the largest or smallest heat coupling, the smallest
or largest gap, the load frequency at which the tip answers most or least, the largest or smallest magnitude of
everything else but phases; of axes that vary together alpha decides first, then the gap, then the frequency, then the
others by name, and of equals the first. Of more than 16 corners those are taken that have the fewest mild or the fewest
hard values. They are run by `event_driven` on the full structure; one of more than 300 coordinates is reduced to
100 + 100 vectors of the same basis, which confirm at most half as many. What `event_driven` refuses is run by `moreau`
with θ = 1 at the study's shortest step, full and reduced alike. A corner that does not end ok so is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from workflow import schemes
from workflow.grid._conditions import conditions
from workflow.grid._operators import compile_for, reduced, reduction_of, run_batch, structure_of, structure_on
from workflow.grid._reason import reason_of
from workflow.judges.distances import relative_distance
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models import MOST_ONE_BY_ONE, Array, Cases, Structure, mechanical_modes
from workflow.reduction import Reduction, reduce_structure
from workflow.reduction._transfer import Excitation, least_counts
from workflow.schemes import Results, Sampling, Status
from workflow.study import Cell, Dimension, SchemeChoice

EXACT = "event_driven"
"""The scheme that splits errors and runs trials: its solution of a reduced model has no error of a step."""

_FREQUENCY = "scene.load.frequency"
_ORDER = ("alpha", "scene.casing.gap", _FREQUENCY)
_WIDTH = 0.01
"""Damping ratio with which the answers of load frequencies are ranked, so that none is infinite."""

_EVENTS, _STEPS = 20_000, 200_000
"""Budget of an exact trial, seconds of a structure of 20 nodes: what needs more is not tried some twenty times."""

COMPARED = ("displacement", "temperature")
"""Histories that decide."""

_CORNERS = 16
"""Corners that are tried: those of four dimensions."""

_MOST_TRIALS = 8


@dataclass(frozen=True)
class Setting:
    """What trials depend on.

    Attributes
    ----------
    cell
        Settings that all cases share; scheme, step and counts of modes are those of the trials.
    inner
        Dimensions along which its cases differ.
    sampling
        Common sampling of all histories.
    shortest
        Shortest time that steps or samples resolve, s.
    """

    cell: Cell
    inner: tuple[Dimension, ...]
    sampling: Sampling
    shortest: float


class Trials:
    """Solutions of the corners of a study, and the errors of reduced models against them, each found once.

    Attributes
    ----------
    most
        Counts of vectors of the model that errors are measured against, n - 1 where that is the full one.
    confirmable
        Largest counts whose errors that model can tell: half of its own, all of them where it leaves nothing out.
    corners
        Values of the axes of each corner, by path; the first has the hardest value of each dimension.
    sound
        Corners that ended ok.
    lost
        Why the others did not, by corner.
    failure
        Why no corner did, empty where some did.
    """

    def __init__(self, setting: Setting) -> None:
        self._cell, self._sampling, self._shortest = exactly(setting), setting.sampling, setting.shortest
        structure = structure_of(setting.cell.scene.model, setting.cell.scene.parameters)
        self.most = _most(structure.mechanical_size), _most(structure.thermal_size)
        all_of_them = structure.mechanical_size - 1, structure.thermal_size - 1
        self.is_full = self.most == all_of_them
        halves = [most if most == every else most // 2 for most, every in zip(self.most, all_of_them, strict=True)]
        self.confirmable = halves[0], halves[1]
        self.corners = corners_of(setting.inner, structure_on(reduced(self._with(*self.most))))
        varying = {path: np.array([corner[path] for corner in self.corners]) for path in self.corners[0]}
        self._cases = conditions(setting.cell, structure, varying, len(self.corners))
        self._errors: dict[tuple[int, int, int], float] = {}
        every = range(len(self.corners))
        try:
            self._run(0, 0, (0,))
            truth: Results | None = self._run(*self.most, every)
        except (Exception, SystemExit):  # whatever refuses the scene or the basis
            self._cell = stepped(setting)
            truth, self.failure = self._tried(*self.most, every)
        self._truth = truth
        self.sound = () if truth is None else tuple(int(k) for k in np.flatnonzero(truth.status == Status.OK))
        self.lost = {} if truth is None else {k: _ended(truth, k) for k in every if k not in self.sound}
        if truth is not None:
            self.failure = "" if self.sound else self.lost[0]

    @property
    def by(self) -> str:
        """The scheme that runs the trials, in words."""
        method = self._cell.scheme.method
        return method if self._cell.h == 0 else f"{method} (theta = 1, h = {self._cell.h:g} s)"

    def begin(self, tolerance: float) -> tuple[int, int]:
        """Return the counts that the tip's transfer functions ask for."""
        by = reduced(self._with(*self.most))
        structure, richest = structure_on(by), reduction_of(by)
        cases = self._cases if richest is None else richest.project(self._cases)

        def reduce(mechanical: int, thermal: int) -> Reduction:
            return reduce_structure(structure, mechanical, thermal, by.basis, by.duration)

        return least_counts(structure, reduce, self._excitation(structure, cases), tolerance, self.most)

    def _excitation(self, structure: Structure, cases: Cases) -> Excitation:
        """Return what the first corner excites: the tip itself, and where they are not 0 its loads and start."""
        steady, heating, warmth = cases.steady[0], cases.heating[0], structure.thermal.inertia_of(cases.temperature[0])
        return Excitation(
            duration=self._sampling.duration,
            shortest=self._shortest,
            frequency=float(cases.frequency[0]),
            forces=np.column_stack([_tip(structure.mechanical_size), steady]),
            heats=np.column_stack([_tip(structure.thermal_size), heating, warmth]),
        )

    def errors(self, mechanical: int, thermal: int, corners: Sequence[int]) -> list[float]:
        """Return of each corner the larger relative L2 error of displacement and temperature; infinite without one."""
        counts = mechanical, thermal
        unknown = [k for k in corners if (*counts, k) not in self._errors]
        if unknown:
            errors = [0.0] * len(unknown) if counts == self.most else self._errors_at(mechanical, thermal, unknown)
            self._errors |= {(*counts, k): error for k, error in zip(unknown, errors, strict=True)}
        return [self._errors[*counts, k] for k in corners]

    def _errors_at(self, mechanical: int, thermal: int, corners: Sequence[int]) -> list[float]:
        results, _ = self._tried(mechanical, thermal, corners)
        if results is None or self._truth is None:
            return [float("inf")] * len(corners)
        largest = np.zeros(len(corners))
        for name in COMPARED:
            truth = self._truth.histories[name][list(corners)]
            largest = np.maximum(largest, relative_distance(results.histories[name], truth))
        lost = np.isnan(largest) | (results.status != Status.OK)
        return [float(error) for error in np.where(lost, np.inf, largest)]

    def _with(self, mechanical: int, thermal: int) -> Cell:
        return replace(self._cell, mechanical_modes=mechanical, thermal_modes=thermal)

    def _tried(self, mechanical: int, thermal: int, corners: Sequence[int]) -> tuple[Results | None, str]:
        """Return solutions with some counts, or ``None`` and why there are none."""
        try:
            return self._run(mechanical, thermal, corners), ""
        except (Exception, SystemExit) as error:  # whatever a model or basis raises
            return None, reason_of(error)

    def _run(self, mechanical: int, thermal: int, corners: Sequence[int]) -> Results:
        cell = self._with(mechanical, thermal)
        compile_for(cell, self._sampling.balances)
        with np.errstate(all="ignore"):
            return run_batch(cell, self._cases.take(np.asarray(corners)), self._sampling)


def _ended(results: Results, corner: int) -> str:
    """Return how a corner ended that is not ok."""
    status = Status(int(results.status[corner])).name.lower()
    return ": ".join(filter(None, [status, results.messages.get(corner, "")]))


def exactly(setting: Setting) -> Cell:
    """Return the settings with the exact scheme, within a budget."""
    scheme = SchemeChoice(EXACT, EXACT, schemes.load(EXACT).Options(events=_EVENTS, steps=_STEPS))
    return replace(setting.cell, scheme=scheme, h=0.0)


def stepped(setting: Setting) -> Cell:
    """Return the settings with implicit Euler at the shortest step, for what the exact scheme refuses."""
    scheme = SchemeChoice("moreau", "moreau", schemes.load("moreau").Options())
    return replace(setting.cell, scheme=scheme, h=setting.shortest)


@lru_cache(maxsize=_MOST_TRIALS)
def trials_of(setting: Setting) -> Trials:
    """Return the trials of a setting, which all tolerances share."""
    return Trials(setting)


def corners_of(inner: tuple[Dimension, ...], structure: Structure) -> list[dict[str, float]]:
    """Return the values of the axes of each corner, by path; see the module."""
    ends = [_ends(dimension, structure) for dimension in inner]
    places = sorted(product(*(range(len(end)) for end in ends)), key=lambda mild: _unlike(mild, len(ends)))
    return [_values(inner, [end[k] for end, k in zip(ends, place, strict=True)]) for place in places[:_CORNERS]]


def _unlike(mild: tuple[int, ...], count: int) -> tuple[int, tuple[int, ...]]:
    """Rank corners by how few values differ from all hard, or all mild."""
    return min(sum(mild), count - sum(mild)), mild


def _values(inner: tuple[Dimension, ...], places: Sequence[int]) -> dict[str, float]:
    pairs = zip(inner, places, strict=True)
    return {axis.path: float(axis.values[k]) for dimension, k in pairs for axis in dimension.axes}


def _ends(dimension: Dimension, structure: Structure) -> list[int]:
    """Return the places of the hardest and of the mildest value of a dimension."""
    axes = sorted(dimension.axes, key=lambda axis: (_rank(axis.path), axis.path))
    keys = [_severity(axis.path, np.asarray(axis.values, dtype=np.float64), structure) for axis in axes]
    order = np.lexsort([-key for key in reversed(keys)])
    return [int(order[0]), int(order[-1])] if order.size > 1 else [0]


def _rank(path: str) -> int:
    return _ORDER.index(path) if path in _ORDER else len(_ORDER)


def _severity(path: str, values: Array, structure: Structure) -> Array:
    """Return how hard each value of an axis makes a case; larger is harder."""
    if path == "scene.casing.gap":
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
    real, imaginary = square - w * w, 2 * _WIDTH * omega[elastic] * w
    size = real * real + imaginary * imaginary
    return np.sum(share * real / size) ** 2 + np.sum(share * imaginary / size) ** 2


def _most(size: int) -> int:
    """Return the largest count of vectors that is tried of a structure of some coordinates."""
    return size - 1 if size <= MOST_BY_JACOBI else MOST_ONE_BY_ONE


def _tip(size: int) -> Array:
    unit = np.zeros(size)
    unit[-1] = 1.0
    return unit
