"""The scheme, step and reduced model that meet a tolerance at about the least cost, and by what evidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import case_dims, coordinate_units, exact, is_auto, labels_of
from workflow.schemes import Status
from workflow.study import MATRIX, MODES, POINT
from workflow.variables import COMPARED

if TYPE_CHECKING:
    import xarray as xr

NUMERICAL = ("scheme", "h", "mechanical_modes", "thermal_modes", "reduction", "tolerance")
"""Coordinates that change the computation, not the scene; so do options of schemes (``schemes.LABEL.OPTION``)."""

DEFAULT = 0.01
"""Tolerance where neither the caller nor the study states one."""

USUAL_TOLERANCES = (0.1, 0.01, 0.001)
"""Tolerances that tables answer beside the one that is asked for."""

DECIDABLE = 0.1
"""Share of the tolerance that a case's predictability must not exceed for its error to be a scheme's own."""

SPREAD = 0.25
"""Share of the least cost by which a more accurate choice may cost more: neighbours near the cost of a call differ by 1
to 17 % on an idle machine (``data/work_precision_blade.nc``), by a factor of 2.3 on a busy one."""


class NoReferenceError(ValueError):
    """An archive holds no errors: its study has no reference."""


@dataclass(frozen=True)
class Worst:
    """The worst case of a choice: one without an error, else the one with the largest."""

    case: dict[str, Any]
    """Value of every coordinate of the scene that varies, by name."""
    error: float
    """Largest of its errors, 1; NaN where it has none."""
    variable: str
    """Which history that is the error of."""
    scheme_error: float
    model_error: float
    """``scheme_error``, ``model_error``: the two parts of that error, 1; NaN where the archive does not hold them."""
    status: str
    message: str
    """``status``, ``message``: how the case ended and what it says."""

    @property
    def limited_by(self) -> str:
        """What makes the error: ``step``, ``basis``, ``nothing``, ``unknown``; or lacks: ``status``, ``reference``."""
        if self.status != "ok":
            return "status"
        if np.isnan(self.error):
            return "reference"
        if self.error == 0:
            return "nothing"
        if np.isnan([self.scheme_error, self.model_error]).any():
            return "unknown"
        return "step" if self.scheme_error >= self.model_error else "basis"


@dataclass(frozen=True)
class Choice:
    """One scheme with one step, one reduced model and one set of options."""

    settings: dict[str, Any]
    """Value of every numerical coordinate, by name."""
    cost: float
    """Mean processor time of its cases, s."""
    cost_per_second: float
    """The same per simulated second; NaN where the archive does not hold its duration."""
    share: float
    """Share of its cases whose error is within the tolerance."""
    worst: Worst
    number: int
    """``worst``, ``number``: its worst case, and the number of that; cases are counted along the archive's dimensions,
    the last fastest."""
    step_matters: bool
    """Whether its cases differ along ``h`` at all; the exact scheme's do not."""
    used: dict[str, int] = field(default_factory=dict)
    """Counts of modes that its tolerance decided, by the name of their setting; the largest of the scene's cases."""
    tied: dict[str, Any] = field(default_factory=dict)
    """Settings of the scene that a zip ties to it."""


@dataclass(frozen=True)
class Recommendation:
    """The answer of an archive for one tolerance."""

    tolerance: float
    """Largest admissible error of any history in any case of the scene, 1."""
    choice: Choice | None
    """The most accurate of those within it whose cost exceeds the least of theirs by at most :data:`SPREAD`; ``None``
    where none is within it."""
    next: Choice | None
    """The dearest that is cheaper, with an error in all cases if one has; without a choice the nearest."""
    cases: int
    """Number of cases of the scene."""
    undecidable: tuple[dict[str, Any], ...]
    """Cases of the scene whose predictability exceeds a tenth of the tolerance, by their coordinates."""
    units: dict[str, str] = field(default_factory=dict)
    """Units of coordinates that have one, as they are written by hand, by name."""
    missing: tuple[dict[str, Any], ...] = ()
    """Cases of the scene in which no choice has an error, as where the reference failed, by their coordinates."""
    leave_out: str = ""
    """What leaves them out of an archive, ``drop_sel(e=[1])``; empty where that leaves nothing."""
    rest: Recommendation | None = None
    """The answer without them, where there is no choice with them."""

    def __str__(self) -> str:
        """Return the answer as a text that can be quoted, as ``workflow recommend`` prints it."""
        from workflow.analysis._recommend_words import sentence

        return sentence(self)

    def _repr_html_(self) -> str:
        """Return the same for a notebook."""
        return f"<p>{escape(str(self))}</p>"


def recommend(dataset: xr.Dataset, tolerance: float | str | None = None) -> Recommendation:
    """Return the most accurate of the choices that meet a tolerance in all cases of the scene at about the least cost.

    The error of a case is the largest of its displacement, temperature and impulse error; a case that is not ok or
    has no error misses. Cost is the mean processor time over the cases of the scene.

    Parameters
    ----------
    dataset
        An archive whose study has a reference.
    tolerance
        A share or a text such as ``"1%"``; the study's own where left out, else :data:`DEFAULT`.

    Raises
    ------
    NoReferenceError
        The archive holds no errors.
    ValueError
        The tolerance is no positive number.
    """
    share = stated_tolerance(dataset) if tolerance is None else as_tolerance(tolerance)
    return _recommended(Table(dataset), share)


def _recommended(table: Table, share: float) -> Recommendation:
    within = table.error <= share
    rank = np.argsort(table.cost, kind="stable")
    good = [int(k) for k in rank if within[k].all()]
    least = table.cost[good[0]] if good else np.inf
    affordable = (k for k in good if table.cost[k] <= (1 + SPREAD) * least)
    best = min(affordable, key=lambda k: _largest(table.error[k]), default=None)
    known = ~np.isnan(table.error).any(axis=1)
    cheaper = (int(k) for k in rank if table.cost[k] < least)
    nearest = max(cheaper, key=lambda k: (known[k], table.cost[k]), default=None)
    if not good:
        nearest = max(range(len(rank)), key=lambda k: (within[k].mean(), -_largest(table.error[k])), default=None)
    missing = np.isnan(table.error).all(axis=0) & (table.status != Status.NOT_RUN).all(axis=0)
    without = table.without(missing) if missing.any() and not good else None
    return Recommendation(
        share,
        None if best is None else table.choice(best, within[best]),
        None if nearest is None else table.choice(nearest, within[nearest]),
        table.error.shape[1],
        table.unpredictable(DECIDABLE * share),
        coordinate_units(table.dataset),
        table.cases(missing),
        "" if without is None else without[0],
        None if without is None else _recommended(Table(without[1]), share),
    )


def usual_recommendations(dataset: xr.Dataset, asked: Recommendation) -> list[Recommendation]:
    """Return the recommendations at :data:`USUAL_TOLERANCES` and the one that was asked for, the loosest first."""
    table, shares = Table(dataset), sorted({*USUAL_TOLERANCES, asked.tolerance}, reverse=True)
    return [asked if share == asked.tolerance else _recommended(table, share) for share in shares]


def most_accurate(dataset: xr.Dataset, dims: Sequence[str]) -> list[Choice]:
    """Return for each place along some numerical dimensions the choice whose largest error is the least, in C order.

    Shares are those of cases within the tolerance of the archive's study.
    """
    table, tolerance = Table(dataset), stated_tolerance(dataset)
    sizes, first = [dataset.sizes[dim] for dim in table.rows], [table.rows.index(dim) for dim in dims]
    numbers = np.moveaxis(np.arange(math.prod(sizes)).reshape(sizes), first, range(len(first)))
    largest = np.array([_largest(errors) for errors in table.error])
    rows = [some[largest[some].argmin()] for some in numbers.reshape(math.prod(numbers.shape[: len(first)]), -1)]
    return [table.choice(int(row), table.error[row] <= tolerance) for row in rows]


def _largest(errors: NDArray[np.float64]) -> float:
    """Return the largest error of a choice, infinity where a case has none."""
    return float(np.max(np.where(np.isnan(errors), np.inf, errors)))


def as_tolerance(written: float | str) -> float:
    """Return a tolerance from a number or a text such as ``1%``; raises :class:`ValueError` if it is not positive."""
    text = str(written).strip()
    try:
        value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        value = float("nan")
    if not 0 < value < np.inf:
        raise ValueError(f"the tolerance `{text}` is no positive number or percentage, such as 0.01 or 1%")
    return value


def stated_tolerance(dataset: xr.Dataset) -> float:
    """Return the scalar tolerance of an archive's study, :data:`DEFAULT` where it has none."""
    if "tolerance" in dataset.coords and dataset["tolerance"].ndim == 0:
        return float(dataset["tolerance"])
    return DEFAULT


def is_numerical(dataset: xr.Dataset, name: str) -> bool:
    """Tell whether a coordinate changes the computation, not the scene."""
    return name in NUMERICAL or str(dataset[name].attrs.get("study_path", "")).startswith("schemes.")


def numerical_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the dimensions with a numerical coordinate, in the archive's order."""
    return tuple(
        dim
        for dim in case_dims(dataset)
        if any(dim in dataset[name].dims and is_numerical(dataset, str(name)) for name in dataset.coords)
    )


class Table:
    """Errors and statuses of each choice in each case of the scene, ``(choice, case)``, and costs ``(choice,)``.

    The error of an ok case is the largest of those that are named, of all histories where none is; NaN of others.
    """

    def __init__(self, dataset: xr.Dataset, *errors: str) -> None:
        if not all(f"{name}_error" in dataset for name in COMPARED):
            raise NoReferenceError("the archive holds no errors: its study has no `reference`")
        if unknown := [name for name in errors if name not in dataset]:
            known = ", ".join(f"{name}_error" for name in COMPARED)
            raise ValueError(f"the dataset has no `{unknown[0]}`; give one of {known}")
        self.dataset = dataset
        self.rows = numerical_dims(dataset)
        self.columns = tuple(dim for dim in case_dims(dataset) if dim not in self.rows)
        self.status = self._array("status").astype(np.int8)
        of_all = np.stack([self._array(name) for name in errors or [f"{name}_error" for name in COMPARED]])
        self.errors = np.where(self.status == Status.OK, of_all, np.nan)
        self.error = np.max(self.errors, axis=0)
        seconds = self._array("processor_time")
        run = np.isfinite(seconds)
        total = np.where(run, seconds, 0.0).sum(axis=1)
        self.cost = np.where(run.any(axis=1), total / np.maximum(run.sum(axis=1), 1), np.inf)

    def _array(self, name: str) -> NDArray[np.float64]:
        """Return a variable as ``(choice, case)``; NaN where the archive has no such variable."""
        sizes = [int(np.prod([self.dataset.sizes[dim] for dim in dims])) for dims in (self.rows, self.columns)]
        if name not in self.dataset:
            return np.full(sizes, np.nan)
        ordered = self.dataset[name].transpose(*self.rows, *self.columns)
        return np.asarray(ordered.values, dtype=np.float64).reshape(sizes)

    def choice(self, row: int, within: NDArray[np.bool_]) -> Choice:
        """Return a choice with its evidence."""
        error, dims = self.error[row], case_dims(self.dataset)
        case = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
        at = self._place(row, case)
        settings = self._values(self.rows, at, fixed=True)
        auto = [name for name in MODES if name in settings and is_auto(self.dataset[name], settings[name])]
        cost = float(self.cost[row])
        return Choice(
            settings=settings,
            cost=cost,
            cost_per_second=cost / simulated_seconds(self.dataset),
            share=float(within.mean()),
            worst=self._worst(row, case, at),
            number=int(np.ravel_multi_index([at[dim] for dim in dims], self.dataset["status"].shape)),
            step_matters=self._step_matters(row, at),
            used={name: int(np.nanmax(self._array(f"{name}_used")[row])) for name in auto},
            tied={name: value for name, value in settings.items() if not is_numerical(self.dataset, name)},
        )

    def _place(self, row: int, case: int) -> dict[str, int]:
        """Return where a case of a choice lies along the dimensions."""
        dims = (*self.rows, *self.columns)
        sizes = [self.dataset.sizes[dim] for dim in dims]
        place = np.unravel_index(row * self.error.shape[1] + case, sizes)
        return dict(zip(dims, map(int, place), strict=True))

    def _values(self, dims: Sequence[str], at: Mapping[str, int], fixed: bool = False) -> dict[str, Any]:
        """Return the coordinates along some dimensions at a place, and the numerical ones that are fixed if asked."""
        values: dict[str, Any] = {}
        for name, coordinate in self.dataset.coords.items():
            if coordinate.ndim == 1 and coordinate.dims[0] in dims and name not in (POINT, MATRIX):
                values[str(name)] = coordinate[at[str(coordinate.dims[0])]].values.item()
            elif coordinate.ndim == 0 and fixed and is_numerical(self.dataset, str(name)):
                values[str(name)] = coordinate.values.item()
        return values

    def _worst(self, row: int, case: int, at: Mapping[str, int]) -> Worst:
        several = self.errors[:, row, case]
        name = COMPARED[0 if np.isnan(several).all() else int(np.nanargmax(several))]
        one = self.dataset.isel(at)  # only what is asked of it is read
        return Worst(
            case=self._values(self.columns, at),
            error=float(self.error[row, case]),
            variable=name,
            scheme_error=float(one.get(f"{name}_scheme_error", np.nan)),
            model_error=float(one.get(f"{name}_model_error", np.nan)),
            status=Status(int(self.status[row, case])).name.lower(),
            message=str(one["message"].values) if "message" in one else "",
        )

    def _step_matters(self, row: int, at: Mapping[str, int]) -> bool:
        """Tell whether a choice differs from its neighbours along ``h``."""
        if "h" not in self.rows or np.isnan(self.error[row]).all():
            return True
        errors = self.error.reshape(*(self.dataset.sizes[dim] for dim in self.rows), -1)
        steps = errors[tuple(slice(None) if dim == "h" else at[dim] for dim in self.rows)]
        return len(steps) < 2 or not np.array_equal(steps, np.broadcast_to(steps[:1], steps.shape), equal_nan=True)

    def unpredictable(self, most: float) -> tuple[dict[str, Any], ...]:
        """Return the cases of the scene whose predictability exceeds a share."""
        return self.cases(np.any(self._array("predictability") > most, axis=0))

    def cases(self, which: NDArray[np.bool_]) -> tuple[dict[str, Any], ...]:
        """Return the coordinates of some cases of the scene."""
        return tuple(self._values(self.columns, self._place(0, int(case))) for case in np.flatnonzero(which))

    def without(self, which: NDArray[np.bool_]) -> tuple[str, xr.Dataset] | None:
        """Return what leaves out some cases of the scene and the fewest others, and the archive without them.

        It leaves out values of one dimension; ``None`` where each of every dimension has such a case.
        """
        sizes = [self.dataset.sizes[dim] for dim in self.columns]
        held = map(np.unique, np.unravel_index(np.flatnonzero(which), sizes) if sizes else ())
        of_dims = [(out.size / size, dim, out) for size, dim, out in zip(sizes, self.columns, held, strict=True)]
        share, dim, out = min(of_dims, default=(1.0, "", which), key=lambda one: one[0])
        if share == 1:
            return None
        by_label, values = dim in self.dataset.indexes, self.dataset[dim].values[out].tolist()
        listed = ", ".join(map(repr, values) if isinstance(values[0], str) else map(exact, values if by_label else out))
        return f"drop_{'' if by_label else 'i'}sel({dim}=[{listed}])", self.dataset.drop_isel({dim: out})


def simulated_seconds(dataset: xr.Dataset) -> float:
    """Return the duration of an archive's cases, s; NaN where the archive does not hold it."""
    return float(dataset.attrs.get("duration", np.nan))


def work_precision(dataset: xr.Dataset, error: str | None = None) -> xr.Dataset:
    """Return cost and error of every choice of scheme, step, modes and options of schemes.

    Error and cost are those that :func:`recommend` weighs: its answer is, of ``work_precision(dataset)`` with
    ``error`` up to a tolerance and ``cost`` at most 25 % above the least, where ``error`` is least.

    Parameters
    ----------
    dataset
        An archive whose study has a reference.
    error
        The error that counts, such as ``impulse_error``; the largest of displacement, temperature and impulse error
        where left out.

    Returns
    -------
    xarray.Dataset
        Over the dimensions that change the computation (scheme, h, modes, options), not the scene: ``error``, the
        largest over all cases of the scene, NaN where one is not ok or has none; ``cost``, the mean processor time of a
        case in s; ``cost_per_second``, the same per simulated second; ``efficient``, whether no other choice has at
        most this error at less cost.

    Raises
    ------
    NoReferenceError
        The archive holds no errors.
    ValueError
        It has no such error.
    """
    import xarray as xr

    table = Table(dataset) if error is None else Table(dataset, error)
    worst = np.max(table.error, axis=1)
    variables = {
        "error": (worst, "1", f"largest {'error of any history' if error is None else error.replace('_', ' ')}"),
        "cost": (table.cost, "s", "mean processor time of a case"),
        "cost_per_second": (table.cost / simulated_seconds(dataset), "1", "mean processor time per simulated time"),
        "efficient": (_efficient(worst, table.cost), "1", "whether no other choice is as accurate at less cost"),
    }
    sizes = [dataset.sizes[dim] for dim in table.rows]
    coords = {name: dataset[name] for name in dataset.coords if {*dataset[name].dims} <= {*table.rows}}
    return xr.Dataset(
        {
            name: (table.rows, values.reshape(sizes), {"units": unit, "long_name": about})
            for name, (values, unit, about) in variables.items()
        },
        coords,
    )


def _efficient(error: NDArray[np.float64], cost: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which choices have an error that no cheaper one reaches, ``(choice,)``."""
    efficient = np.zeros(error.size, dtype=bool)
    least = np.inf
    for k in np.lexsort((error, cost)):
        if error[k] < least:
            efficient[k], least = True, error[k]
    return efficient


_VARIABLES = ("mechanical_modes_used", "thermal_modes_used", "basis_error")


@dataclass(frozen=True)
class AutoModel:
    """A reduced model whose counts of modes a tolerance decided."""

    where: str
    """Values of the dimensions along which counts differ, or along which numerics and errors do."""
    mechanical_modes: int
    thermal_modes: int
    """``mechanical_modes``, ``thermal_modes``: vectors beside the tip's own."""
    error: float
    """Largest known error: in the worst corner of the scene, or in a condition that misses the tolerance, 1."""
    met: int
    conditions: int
    """``met``, ``conditions``: number of its conditions that are not known to miss the tolerance, and of all."""

    @property
    def text(self) -> str:
        """Counts and error in words."""
        modes = f"{self.mechanical_modes} + {self.thermal_modes} modes for {self.where}"
        met = "" if self.met == self.conditions else f", met in {self.met} of {self.conditions} conditions"
        return f"{modes}, basis error {self.error:.2g}{met}"


def decided(dataset: xr.Dataset) -> list[AutoModel]:
    """Return the reduced models that tolerances decided, in the archive's order; none where no tolerance did."""
    if not all(name in dataset for name in _VARIABLES):
        return []
    *counts, basis_error = (dataset[name] for name in _VARIABLES)
    numerical = numerical_dims(dataset)
    dims = [
        dim
        for dim in case_dims(dataset)
        if any(_varies(count.transpose(dim, ...)) for count in counts)
        or (dim in numerical and _varies(basis_error.transpose(dim, ...)))
    ]
    idle = dict.fromkeys(set(numerical) - set(dims), 0)
    inside = [dim for dim in case_dims(dataset) if dim not in (*dims, *idle)]
    misses = (basis_error > dataset["tolerance"]).isel(idle).sum(inside).transpose(*dims)
    used = [count.isel(idle | dict.fromkeys(inside, 0)).transpose(*dims) for count in counts]
    worst = basis_error.isel(idle).max(inside).transpose(*dims)
    conditions = math.prod(dataset.sizes[dim] for dim in inside)
    labels = {dim: labels_of(dataset, dim, rounded=True) for dim in dims}
    models = []
    for place in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        error = float(worst.values[place])
        if np.isfinite(error):
            where = ", ".join(labels[dim][k] for dim, k in zip(dims, place, strict=True))
            mechanical, thermal = (int(count.values[place]) for count in used)
            met = conditions - int(misses.values[place])
            models.append(AutoModel(where or "all cases", mechanical, thermal, error, met, conditions))
    return models


def _varies(variable: xr.DataArray) -> bool:
    """Tell whether a variable differs along its first dimension."""
    values: NDArray[np.float64] = np.asarray(variable.values)
    return not np.array_equal(values, np.broadcast_to(values[:1], values.shape), equal_nan=True)
