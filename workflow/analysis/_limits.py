"""In which range of each axis every rub settles within given bounds, and what ends the range."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import case_dims, coordinate_units, labels, naming, swept_axis, unit_of
from workflow.analysis._recommend import is_numerical
from workflow.schemes import Status
from workflow.variables import BY_NAME

if TYPE_CHECKING:
    import xarray as xr

BOUNDED = {
    "temperature": "steady_max_temperature",
    "displacement": "steady_max_displacement",
    "impulse": "steady_impulse",
}
"""Variables that bounds may be given for."""

_UNITS = {"temperature": "K", "displacement": "m", "impulse": "N s"}

_WITHIN = ("settles", "no_contact", "permanent_contact")
_MILD = {"alpha": 1, "gap": -1}
"""Axes whose ranges begin at their mild end, and the direction away from it."""

_MARGINAL = ("fold", "period_doubling", "torus")
"""Bifurcations at which a rub is no longer stable."""

_WORDS = {
    "fold": "a fold ends the branch",
    "period_doubling": "the period doubles",
    "torus": "the rub becomes quasi-periodic",
    "grazing": "an impact begins or ends",
    "unstable": "the rub is unstable",
    "runs_away": "the rub runs away",
    "not_found": "no steady rub is found",
    "failed": "the case failed",
}


class NothingSteadyError(ValueError):
    """The archive has neither steady rubs nor branches, or a sweep."""


@dataclass(frozen=True)
class Limit:
    """The largest range of an axis in which every case keeps within the bounds, in SI; ``None`` where no value does."""

    axis: str
    start: float | None
    stop: float | None
    """``start``, ``stop``: its ends, of an axis with a mild end that first."""
    next: float | None
    """The first value beyond, ``None`` where the range ends with the axis."""
    limited_by: str | None
    """What is there: a state, a bifurcation, or a bound that is exceeded."""
    at: Mapping[str, Any]
    """Coordinates of the case where it is."""


@dataclass(frozen=True)
class Limits:
    """Limits of all numerical axes, the cases (of branches the points) that were asked for, and those within.

    ``each`` has that of every branch along the axis that is followed, or of every combination of the other axes along
    the first that has a mild end; of an archive of branches ``limits`` has that over all branches alone.
    ``beyond`` counts those that are not within by what they are.
    """

    limits: tuple[Limit, ...]
    each: tuple[Limit, ...]
    cases: int
    within: int
    beyond: Mapping[str, int]


def followed_axis(dataset: xr.Dataset) -> str | None:
    """Return the axis that the branches of an archive follow, ``None`` of an archive without branches."""
    along = (str(name) for name, values in dataset.data_vars.items() if values.dims[-1:] == ("point",))
    return next((name for name in along if name not in BY_NAME), None)


def limits(dataset: xr.Dataset, **bounds: float | None) -> Limits:
    """Return in which range of each axis rubs settle, touch nothing or stay in contact, and keep within bounds.

    Parameters
    ----------
    dataset
        An archive with steady rubs or branches.
    bounds
        Largest ``temperature`` [K], ``displacement`` [m] and ``impulse`` [N s], see :data:`BOUNDED`.

    Raises
    ------
    NothingSteadyError
        It has neither.
    """
    if swept_axis(dataset) is not None:
        raise NothingSteadyError("holds a sweep, whose points are no cases of their own; run its study with a list")
    if "steady_state" not in dataset:
        raise NothingSteadyError("holds no steady rubs; run its study with `output: {steady: true}`")
    faults, asked = _faults(dataset, bounds)
    if not asked.any():
        raise NothingSteadyError("holds no case of event_driven, and only that scheme has steady rubs")
    beyond = Counter(faults[faults != ""].tolist())
    counts = int(asked.sum()), int(np.sum(asked & (faults == ""))), dict(beyond)
    if "point" in dataset.dims:
        each = tuple(_along_branches(dataset, faults, asked))
        return Limits((_common(each),), each, *counts)
    names = [d for d in case_dims(dataset) if d in dataset.coords and dataset[d].dtype.kind in "if"]
    axes = [name for name in names if not is_numerical(dataset, name)]
    mild = sorted(set(axes) & set(_MILD))[:1]  # α before the gap
    single = [limit for dim in mild for limit in _each_along(dataset, dim, faults, asked)]
    return Limits(tuple(_along_dimension(dataset, dim, faults) for dim in axes), tuple(single), *counts)


def _faults(dataset: xr.Dataset, bounds: Mapping[str, float | None]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the fault of each case or point, empty for none, and whether it was asked for, ``(…[, point])``."""
    state = labels(dataset["steady_state"]).values
    faults = np.where(np.isin(state, _WITHIN), "", state).astype(object)
    for name, most in bounds.items():
        if most is not None:
            exceeded = np.asarray(dataset[BOUNDED[name]].values) > most
            faults[(faults == "") & exceeded] = name
    status = np.asarray(dataset["status"].values)
    asked = state != "not_asked"
    if "point" in dataset.dims:
        present = np.isfinite(dataset["steady_periods"].values) & (dataset["steady_periods"].values > 0)
        asked = present | ((status == Status.FAILED)[..., None] & (np.arange(present.shape[-1]) == 0))
        status = np.broadcast_to(status[..., None], state.shape)
    faults[asked & (status != Status.OK)] = "failed"
    if "bifurcation" in dataset:  # a multiplier of modulus 1
        faults[(faults == "") & np.isin(labels(dataset["bifurcation"]).values, _MARGINAL)] = "unstable"
    return np.where(asked, faults, ""), asked


def _along_dimension(dataset: xr.Dataset, dim: str, faults: NDArray[Any]) -> Limit:
    """Return the limit of a dimension in all cases, each of its values with the first fault of any."""
    values, dims = np.asarray(dataset[dim].values, dtype=float), case_dims(dataset)
    order, others = np.argsort(_MILD.get(dim, 1) * values), [other for other in dims if other != dim]
    of_value = np.moveaxis(faults, dims.index(dim), 0)[order]
    rows, shape = of_value.reshape(values.size, -1), of_value.shape[1:]
    first = np.argmax(rows != "", axis=1)
    words = [str(row[k]) for row, k in zip(rows, first, strict=True)]
    places = [np.unravel_index(k, shape) if word else () for k, word in zip(first, words, strict=True)]
    return _limit(dataset, dim, values[order], words, others, places)


def _each_along(dataset: xr.Dataset, dim: str, faults: NDArray[Any], asked: NDArray[np.bool_]) -> Iterator[Limit]:
    """Yield the limit along a dimension of every combination of the others."""
    values, dims = np.asarray(dataset[dim].values, dtype=float), case_dims(dataset)
    order, others = np.argsort(_MILD[dim] * values), [other for other in dims if other != dim]
    words, there = (np.moveaxis(array, dims.index(dim), -1) for array in (faults, asked))
    for place in np.ndindex(words.shape[:-1]):
        if there[place].any():
            yield _limit(dataset, dim, values[order], words[place][order].tolist(), others, [place] * values.size)


def _along_branches(dataset: xr.Dataset, faults: NDArray[Any], asked: NDArray[np.bool_]) -> Iterator[Limit]:
    """Yield the limit of each branch along the axis that is followed, before the first point that is not within."""
    name = followed_axis(dataset)
    assert name is not None
    values, flags = np.asarray(dataset[name].values), labels(dataset["bifurcation"]).values
    for place in np.ndindex(asked.shape[:-1]):
        along = np.flatnonzero(asked[place])
        ends = [(_MILD.get(name, 1) * values[place][k], faults[place][k] != "") for k in along[[0, -1]]]
        along = along[::-1] if ends[1] < ends[0] else along
        words = [
            _cause(faults[place], flags[place], int(k), int(before))
            for before, k in zip([along[0], *along], along, strict=False)
        ]
        reached = values[place][along]
        ended = [i for i, k in enumerate(along) if flags[place][k] == "grazing" and words[i] == ""]
        for i in reversed(ended):  # at its own value a grazing ends a range beyond which nothing is within
            for there, beside in ((i + 1, i + 1), (i, i - 1)):
                if not 0 <= beside < len(words) or words[beside]:
                    reached, words = np.insert(reached, there, reached[i]), [*words[:there], "grazing", *words[there:]]
        yield _limit(dataset, name, reached, words, case_dims(dataset), [place] * len(words))


def _common(each: Sequence[Limit]) -> Limit:
    """Return the range that is within the limits of all branches."""
    sign = _MILD.get(each[0].axis, 1)
    for one in each:
        if one.start is None:
            return one
    ranges = [(sign * float(one.start or 0), sign * float(one.stop or 0), one) for one in each]
    start, _, first = max(ranges, key=lambda one: one[0])
    _, stop, last = min(ranges, key=lambda one: one[1])
    if start > stop:
        return replace(last, start=None, stop=None)
    return replace(first if last.next is None and first.next is not None else last, start=first.start, stop=last.stop)


def _cause(faults: NDArray[Any], flags: NDArray[Any], k: int, before: int) -> str:
    """Return why a point is not within: the bifurcation there or just before, where it has lost its stability."""
    flag = next((flags[j] for j in (k, before) if flags[j] != "none"), "none")
    return str(flag if flag != "none" and faults[k] == "unstable" else faults[k])


def _limit(
    dataset: xr.Dataset,
    name: str,
    values: NDArray[np.float64],
    words: Sequence[str],
    dims: Sequence[str],
    places: Sequence[tuple[int, ...]],
) -> Limit:
    """Return the longest range of neighbouring values without fault; of the axes of ``_MILD`` it begins at the first.

    ``words`` are the faults of the values, empty where there is none, ``places`` the indices along ``dims`` of the case
    that has each.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[1], [word != "" for word in words], [1]])))
    runs = [(int(first), int(stop) - 1) for first, stop in edges.reshape(-1, 2) if first == 0 or name not in _MILD]
    if not runs:
        beyond = next(k for k, word in enumerate(words) if word)
        return Limit(name, None, None, float(values[beyond]), words[beyond], _labels(dataset, dims, places[beyond]))
    first, last = max(runs, key=lambda run: abs(values[run[1]] - values[run[0]]))
    beyond = last + 1 if last + 1 < len(words) else first - 1  # -1, without fault, where the range is the whole axis
    after = float(values[beyond]) if words[beyond] else None
    at = _labels(dataset, dims, places[beyond])
    return Limit(name, float(values[first]), float(values[last]), after, words[beyond] or None, at)


def _labels(dataset: xr.Dataset, dims: Sequence[str], place: Sequence[int]) -> dict[str, Any]:
    places = zip(dims, place, strict=False)  # of a branch the point is no label
    return {name: dataset[name].values[k].item() for dim, k in places for name in naming(dataset, dim)}


def count_sentence(found: Limits) -> str:
    """Return how many cases are within, and what the others are."""
    others = [
        f"{count} {'above the ' + fault if fault in BOUNDED else fault}"
        + (" (their `message` says why)" if fault == "not_found" else "")
        for fault, count in found.beyond.items()
    ]
    return f"{found.within} of {found.cases} within{'; ' if others else ''}{', '.join(others)}."


def limit_sentence(
    limit: Limit, dataset: xr.Dataset, bounds: Mapping[str, float | None], *, of_one: bool = False
) -> str:
    """Return a limit as a sentence: of all cases, or of the one branch or combination that it names."""
    units = coordinate_units(dataset) | {limit.axis: unit_of(dataset[limit.axis])}

    def written(name: str, value: Any) -> str:
        return f"{value:.6g}" if isinstance(value, float) else str(value)

    def valued(name: str, value: Any) -> str:
        return f"{written(name, value)} {units.get(name, '')}".strip()

    name = limit.axis.replace("_", " ")
    at = ", ".join(f"{other.replace('_', ' ')} = {valued(other, value)}" for other, value in limit.at.items())
    if limit.start is None:
        text, all_within = f"{name}: no value", " at which all cases are within"
    else:
        text = f"{name} from {written(limit.axis, limit.start)} to {valued(limit.axis, limit.stop)}"
        all_within = ": all cases are within"
    text = f"{at}: {text}" if of_one else text + all_within
    if limit.limited_by is None:
        return f"{text}, as far as it was varied."
    most = bounds.get(limit.limited_by)
    why = _WORDS.get(limit.limited_by) or f"the {limit.limited_by} exceeds {most:g} {_UNITS[limit.limited_by]}"
    return f"{text}; at {valued(limit.axis, limit.next)} {why}{f' ({at})' if at and not of_one else ''}."
