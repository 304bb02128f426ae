"""In which range of each axis every rub settles within given bounds, and what ends the range."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import case_dims, coordinate_units, labels, naming, swept_axis, unit_of
from workflow.analysis._recommend import is_numerical
from workflow.declare import measure
from workflow.judges.load_periods import FEWEST, SETTLED, change_of_impulse
from workflow.schemes import Status
from workflow.study import readable
from workflow.variables import BY_NAME

if TYPE_CHECKING:
    import xarray as xr

BOUNDED = {
    "temperature": "steady_max_temperature",
    "displacement": "steady_max_displacement",
    "impulse": "steady_impulse",
}
"""Variables of steady rubs that bounds may be given for."""

_UNITS = {"temperature": "K", "displacement": "m", "impulse": "N s"}

_WITHIN = {
    "settles": "the rub settles",
    "no_contact": "nothing is touched",
    "permanent_contact": "contact is permanent",
}

_WORDS = {
    "fold": "a fold ends it",
    "period_doubling": "the period doubles",
    "torus": "the rub becomes quasi-periodic",
    "grazing": "an impact begins or ends",
    "branch_point": "branches cross",
    "end": "its points end",
    "unstable": "the rub is unstable",
    "runs_away": "the rub runs away",
    "not_found": "no steady rub is found",
    "unsettled": "the rub has not settled",
    "failed": "the case failed",
}

_ARM = "Ranges are of the arms of this branch: another start may lead to another rub."

_AT_END = 1e-9
"""Distance from an end of a branch's range, over the range, within which a point lies at it: rounding."""


def _mild(name: str) -> int | None:
    """Return the direction from the mild end at which ranges of α and of gaps begin; ``None`` of other axes."""
    is_gap = re.fullmatch(r"(casing_)?(gap(_\w+)?|clearance)", name)
    return 1 if name == "alpha" else -1 if is_gap else None


class NothingSteadyError(ValueError):
    """The archive has neither steady rubs nor branches, nor load periods or what bounds are for; or it has a sweep."""


@dataclass(frozen=True)
class Limit:
    """The largest range of an axis in which every case keeps within the bounds, or an arm of a branch; in SI."""

    axis: str
    start: float | None
    stop: float | None
    """``start``, ``stop``: its ends, ``None`` where no value is within; first the mild one of an axis that has one, of
    an arm that on the side of ``from``."""
    next: float | None
    """The first value beyond, ``None`` where the axis ends; ``stop`` where the arm ends at a bifurcation."""
    limited_by: str | None
    """What is there: a state, a bifurcation, or a bound that is exceeded."""
    at: Mapping[str, Any]
    """Coordinates of the case where it is."""
    previous: float | None = None
    begun_by: str | None = None
    """``previous``, ``begun_by``: as ``next`` and ``limited_by``, before the start of an arm."""
    state: str = ""
    """The one state that an arm has, empty where it has several."""


@dataclass(frozen=True)
class Limits:
    """Limits of all numerical axes, the cases (of branches the points) that were asked for, and those within.

    ``each`` has the arms of every branch along the axis that is followed, or the limit of every combination of the
    other axes along the first that has a mild end; of an archive of branches ``limits`` has what their first arms have
    in common alone. ``beyond`` counts those that are not within by what they are; ``remarks`` say what was not judged.
    """

    limits: tuple[Limit, ...]
    each: tuple[Limit, ...]
    cases: int
    within: int
    beyond: Mapping[str, int]
    remarks: tuple[str, ...] = ()


def followed_axis(dataset: xr.Dataset) -> str | None:
    """Return the axis that the branches of an archive follow, ``None`` of an archive without branches."""
    along = (str(name) for name, values in dataset.data_vars.items() if values.dims[-1:] == ("point",))
    return next((name for name in along if name not in BY_NAME), None)


def limits(dataset: xr.Dataset, **bounds: float | None) -> Limits:
    """Return in which range of each axis rubs settle, touch nothing or stay in contact, and keep within bounds.

    Without steady rubs a case has to end ok, and has settled where no contact changes by more than
    :data:`workflow.judges.load_periods.SETTLED`.

    Parameters
    ----------
    dataset
        An archive.
    bounds
        Largest ``temperature`` [K], ``displacement`` [m] and ``impulse`` [N s]: of steady rubs see :data:`BOUNDED`; of
        cases without ``max_temperature``, the largest magnitude of the samples of displacements and sensors, and
        ``period_impulse`` of the last period. Of several contacts the largest counts.

    Raises
    ------
    NothingSteadyError
        Nothing in it can be judged, or it has not what a bound is for.
    """
    if swept_axis(dataset) is not None:
        raise NothingSteadyError("holds a sweep, whose points are no cases of their own; run its study with a list")
    if "worn_depth" in dataset:
        raise NothingSteadyError("holds rubs in a coating, which settle as it wears; look at its `worn_depth`")
    given = {name: most for name, most in bounds.items() if most is not None}
    faults, asked, remarks = (_faults if "steady_state" in dataset else _faults_of_transients)(dataset, given)
    if not asked.any():
        raise NothingSteadyError("holds no case of event_driven, and only that scheme has steady rubs")
    beyond = Counter(faults[faults != ""].tolist())
    counts = int(asked.sum()), int(np.sum(asked & (faults == ""))), dict(beyond), remarks
    if "point" in dataset.dims:
        arms = list(_arms(dataset, faults, asked))
        return Limits((_common([first for first, *_ in arms]),), tuple(one for own in arms for one in own), *counts)
    names = [d for d in case_dims(dataset) if d in dataset.coords and dataset[d].dtype.kind in "if"]
    axes = [name for name in names if not is_numerical(dataset, name)]
    mild = [name for name in sorted(axes) if _mild(name) is not None][:1]  # α before gaps
    single = [limit for dim in mild for limit in _each_along(dataset, dim, faults, asked)]
    return Limits(tuple(_along_dimension(dataset, dim, faults) for dim in axes), tuple(single), *counts)


_Judged = tuple[NDArray[Any], NDArray[np.bool_], tuple[str, ...]]
"""The fault of each case or point, empty for none, and whether it was asked for, ``(…[, point])``; remarks."""


def _faults(dataset: xr.Dataset, bounds: Mapping[str, float]) -> _Judged:
    state = labels(dataset["steady_state"]).values
    faults = np.where(np.isin(state, [*_WITHIN]), "", state).astype(object)
    _tell_exceeded(faults, dataset, bounds)
    status = np.asarray(dataset["status"].values)
    asked = state != "not_asked"
    if "point" in dataset.dims:
        present = np.isfinite(dataset["steady_periods"].values) & (dataset["steady_periods"].values > 0)
        asked = present | ((status == Status.FAILED)[..., None] & (np.arange(present.shape[-1]) == 0))
        status = np.broadcast_to(status[..., None], state.shape)
    faults[asked & (status != Status.OK)] = "failed"
    return np.where(asked, faults, ""), asked, (_ARM if "point" in dataset.dims else _from_start(dataset),)


def _faults_of_transients(dataset: xr.Dataset, bounds: Mapping[str, float]) -> _Judged:
    ok = np.asarray(dataset["status"].values == Status.OK)
    faults = np.where(ok, "", "failed").astype(object)
    _tell_exceeded(faults, dataset, bounds)
    change = np.full(ok.shape, np.nan)
    if "period_impulse" in dataset:
        impulse = dataset["period_impulse"].transpose(*case_dims(dataset), ..., "period").values
        change = np.fmax.reduce(change_of_impulse(impulse).reshape(*ok.shape, -1), axis=-1)
    unjudged = int(np.sum(ok & np.isnan(change)))
    if unjudged and unjudged == np.sum(ok) and not bounds:
        wanted = f"holds no steady rubs, and no {FEWEST} load periods by which rubs have settled"
        raise NothingSteadyError(f"{wanted}; run its study with `output: {{steady: true}}` or longer, or give a bound")
    grows = dataset["runaway"].transpose(*case_dims(dataset)).values == 1
    faults[(faults == "") & ((change > SETTLED) | (np.isnan(change) & grows))] = "unsettled"
    few = (
        f"{unjudged} of {ok.size} cases have fewer than {FEWEST} load periods: whether they have settled is not judged."
    )
    return faults, np.ones_like(ok), (_from_start(dataset), few) if unjudged else (_from_start(dataset),)


def _tell_exceeded(faults: NDArray[Any], dataset: xr.Dataset, bounds: Mapping[str, float]) -> None:
    """Put the names of the bounds that are exceeded where there is no other fault."""
    dims = case_dims(dataset)
    for name, most in bounds.items():
        bounded = [*_bounded(dataset, name)]
        if not bounded:
            wanted = "histories or sensors of displacements" if name == "displacement" else "load periods"
            raise NothingSteadyError(f"holds no {wanted}, by which the bound of the {name} is judged")
        for values in bounded:
            largest = values.max([dim for dim in values.dims if dim not in (*dims, "point")])
            faults[(faults == "") & ~(largest.transpose(*dims, ...).values <= most)] = name


def _bounded(dataset: xr.Dataset, name: str) -> Iterator[xr.DataArray]:
    """Yield what a bound is for, along contacts, sensors and times too."""
    if "steady_state" in dataset:
        yield dataset[BOUNDED[name]]
    elif name == "temperature":
        yield dataset["max_temperature"]
    elif name == "impulse" and "period_impulse" in dataset:
        impulse = dataset["period_impulse"]
        yield impulse.isel(period=(impulse.notnull().sum("period") - 1).clip(0))
    elif name == "displacement":
        of_sensors = ["sensor_value"] if "sensor_value" in dataset else ["sensor_max", "sensor_min"]
        for each in (dataset[name] for name in ("displacement", *of_sensors) if name in dataset):
            values = each.isel(sensor=dataset["sensor_unit"].values == "m") if "sensor" in each.dims else each
            if values.size:
                yield abs(values.reset_coords(drop=True).chunk("auto"))  # read in parts


def _along_dimension(dataset: xr.Dataset, dim: str, faults: NDArray[Any]) -> Limit:
    """Return the limit of a dimension in all cases, each of its values with the first fault of any."""
    values, dims = np.asarray(dataset[dim].values, dtype=float), case_dims(dataset)
    order, others = np.argsort((_mild(dim) or 1) * values), [other for other in dims if other != dim]
    of_value = np.moveaxis(faults, dims.index(dim), 0)[order]
    rows, shape = of_value.reshape(values.size, -1), of_value.shape[1:]
    first = np.argmax(rows != "", axis=1)
    words = [str(row[k]) for row, k in zip(rows, first, strict=True)]
    places = [np.unravel_index(k, shape) if word else () for k, word in zip(first, words, strict=True)]
    return _limit(dataset, dim, values[order], words, others, places)


def _each_along(dataset: xr.Dataset, dim: str, faults: NDArray[Any], asked: NDArray[np.bool_]) -> Iterator[Limit]:
    """Yield the limit along a dimension of every combination of the others."""
    values, dims = np.asarray(dataset[dim].values, dtype=float), case_dims(dataset)
    order, others = np.argsort((_mild(dim) or 1) * values), [other for other in dims if other != dim]
    words, there = (np.moveaxis(array, dims.index(dim), -1) for array in (faults, asked))
    for place in np.ndindex(words.shape[:-1]):
        if there[place].any():
            yield _limit(dataset, dim, values[order], words[place][order].tolist(), others, [place] * values.size)


_Trace = list[tuple[float, str, str]]
"""Value, fault and bifurcation of the points of a branch in order of arclength, from the side of ``from`` on."""


def _arms(dataset: xr.Dataset, faults: NDArray[Any], asked: NDArray[np.bool_]) -> Iterator[list[Limit]]:
    """Yield the arms within the bounds of each branch, in order of arclength; where there is none what its start is."""
    name = followed_axis(dataset)
    assert name is not None
    states, flags = (labels(dataset[each]).values for each in ("steady_state", "bifurcation"))
    sign = _mild(name) or 1
    ends = dataset[name].attrs.get("branch", (-sign * np.inf, sign * np.inf))
    sign = 1 if ends[1] > ends[0] else -1
    for place in np.ndindex(asked.shape[:-1]):
        values, at = dataset[name].values[place], _labels(dataset, case_dims(dataset), place)
        along = np.flatnonzero(asked[place])
        first, last = ((sign * values[k], faults[place][k] != "") for k in along[[0, -1]])
        along = along[::-1] if last < first else along
        trace = [(float(values[k]), str(faults[place][k]), str(flags[place][k])) for k in along]
        edges = np.flatnonzero(np.diff(np.concatenate([[1], [fault != "" for _, fault, _ in trace], [1]])))
        arms = []
        for begin, stop in edges.reshape(-1, 2).tolist():
            both = [_end(trace, begin, begin - 1, ends), _end(trace, stop - 1, stop, ends)]
            (start, previous, begun_by), (end, after, limited_by) = sorted(both, key=lambda end: sign * end[0])
            state = {*states[place][along[begin:stop]].tolist()}
            only = state.pop() if len(state) == 1 else ""
            arms.append(Limit(name, start, end, after, limited_by, at, previous, begun_by, only))
        yield arms or [Limit(name, None, None, trace[0][0], trace[0][1], at)]


def _end(trace: _Trace, last: int, beyond: int, ends: Sequence[float]) -> tuple[float, float | None, str | None]:
    """Return the value at which an arm ends, the first one beyond its last point, and what is there."""
    value, _, flag = trace[last]
    there, fault, flag_there = trace[beyond] if 0 <= beyond < len(trace) else (value, "end", "none")
    if fault not in BOUNDED and flag != "none":
        return value, value, flag
    if fault == "unstable" and flag_there != "none":
        return there, there, flag_there
    if fault == "end" and min(abs(value - end) for end in ends) <= _AT_END * abs(ends[1] - ends[0]):
        return value, None, None
    return value, there, fault


def _common(each: Sequence[Limit]) -> Limit:
    """Return the range that is within the limits of all branches."""
    for one in each:
        if one.start is None or one.stop is None:
            return one
    sign = -1 if any(float(one.start or 0) > float(one.stop or 0) for one in each) else 1
    first = max(each, key=lambda one: sign * float(one.start or 0))
    last = min(each, key=lambda one: sign * float(one.stop or 0))
    if sign * float(first.start or 0) > sign * float(last.stop or 0):
        return replace(last, start=None, stop=None)
    at, state = (first if last.limited_by is None else last).at, first.state if first.state == last.state else ""
    return replace(last, start=first.start, previous=first.previous, begun_by=first.begun_by, at=at, state=state)


def _limit(
    dataset: xr.Dataset,
    name: str,
    values: NDArray[np.float64],
    words: Sequence[str],
    dims: Sequence[str],
    places: Sequence[tuple[int, ...]],
) -> Limit:
    """Return the longest range of neighbouring values without fault; of axes with a mild end it begins at the first.

    ``words`` are the faults of the values, empty where there is none, ``places`` the indices along ``dims`` of the case
    that has each.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[1], [word != "" for word in words], [1]])))
    runs = [(int(first), int(stop) - 1) for first, stop in edges.reshape(-1, 2) if first == 0 or _mild(name) is None]
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


def boundary_axes(dataset: xr.Dataset) -> tuple[str, str] | None:
    """Return the variables of the branched and of the other number along boundaries, ``None`` where there are none."""
    own = f"boundary_{followed_axis(dataset)}"
    names = [str(name) for name in dataset.data_vars if str(name).startswith("boundary_") and name not in BY_NAME]
    return next(((own, name) for name in names if name != own and own in names), None)


_ROWS = 5
"""Points of a boundary that are named."""


def _boundary_lines(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the boundaries of an archive and some points of each."""
    names = boundary_axes(dataset)
    if names is None:
        return
    kinds, ends = (labels(dataset[f"boundary_{name}"]).str.replace("_", " ").values for name in ("kind", "end"))
    other, (first, second) = dataset["boundary_other"].values, (dataset[name] for name in names)

    def written(values: xr.DataArray, at: tuple[int, ...]) -> str:
        name = str(values.name).removeprefix("boundary_").replace("_", " ")
        return f"{name} {values.values[at]:.6g} {unit_of(values)}".rstrip()

    for place in map(tuple, np.argwhere(kinds != "none").tolist()):
        at = "".join(f"{name} = {value}, " for name, value in _labels(dataset, case_dims(dataset), place).items())
        yield f"{at}boundary {place[-1] + 1}: {kinds[place]}, its end: {ends[place]}"
        points = np.flatnonzero(np.isfinite(first.values[place]))
        for k in sorted({*points[np.linspace(0, points.size - 1, _ROWS).astype(int)].tolist()}):
            beside = f", multiplier {other[place][k]:.4g} besides" if other[place][k] >= 1 else ""
            yield f"  {written(first, (*place, k))} at {written(second, (*place, k))}{beside}"


def _shift_lines(limit: Limit, dataset: xr.Dataset) -> Iterator[str]:
    """Yield by how much the ends of an arm move with uncertain numbers."""
    if "bifurcation_shift" not in dataset or limit.start is None or limit.stop is None:
        return
    axis, shifts = dataset[limit.axis], abs(dataset["bifurcation_shift"])
    named = [dataset[f"uncertain{part}"].values.tolist() for part in ("", "_value", "_unit")]
    changes = [
        f"{path.split('.', 2)[-1]} ± {measure(value, readable(unit))}" for path, value, unit in zip(*named, strict=True)
    ]
    for value, other in ((limit.start, limit.stop), (limit.stop, limit.start)):
        at = (axis == value) & (dataset["bifurcation"] > 0)
        largest = shifts.where(at).max([dim for dim in shifts.dims if dim != "uncertain"]).values
        moves = [
            f"± {f'{shift:.2g} {unit_of(axis)}' if shift >= 0 else 'unknown'} ({of})"
            for shift, of in zip(largest, changes, strict=True)
        ]
        if at.any():
            side = "up" if value > other else "down"
            yield f"{limit.axis.replace('_', ' ')} {side} to {value:.6g} {', '.join(moves)}, to first order."


_NAMED = 12
"""Limits of single branches or combinations of axes that are named."""


def limit_lines(found: Limits, dataset: xr.Dataset, bounds: Mapping[str, float | None]) -> list[str]:
    """Return limits as sentences, the first of single branches and combinations too, counts and remarks."""
    is_one = all(limit.at == found.each[0].at for limit in found.each)  # arms of one branch, whose first is named
    each = found.each[1:] if is_one else found.each
    more = [f"… and {len(each) - _NAMED} more, which --json lists"] if len(each) > _NAMED else []
    arms = found.each if followed_axis(dataset) else ()
    return [
        *(limit_sentence(limit, dataset, bounds) for limit in found.limits),
        *(limit_sentence(limit, dataset, bounds, of_one=True) for limit in each[:_NAMED]),
        *(*more, *(line for limit in arms[:_NAMED] for line in _shift_lines(limit, dataset))),
        *(*_boundary_lines(dataset), count_sentence(found), *found.remarks),
    ]


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
    units, is_arm = coordinate_units(dataset), limit.axis == followed_axis(dataset)
    units |= {limit.axis: unit_of(dataset[limit.axis])}

    def valued(name: str, value: Any, unit: bool = True) -> str:
        written = f"{value:.6g}" if isinstance(value, float) else str(value)
        return f"{written} {units.get(name, '') if unit else ''}".strip()

    def cause(word: str) -> str:
        most = bounds.get(word)
        return _WORDS.get(word) or f"the {word} exceeds {most:g} {_UNITS[word]}"

    at = ", ".join(f"{other.replace('_', ' ')} = {valued(other, value)}" for other, value in limit.at.items())
    text, after = limit.axis.replace("_", " "), f" ({at})" if at and not of_one else ""
    text = f"{at}: {text}" if at and of_one else text
    begins, ends = (limit.start, limit.previous, limit.begun_by), (limit.stop, limit.next, limit.limited_by)
    if limit.limited_by is None and limit.begun_by is not None:  # where it ends is said last
        begins, ends = ends, begins
    if limit.start is None:
        text += ": no value" + ("" if of_one else " at which all cases are within")
    else:
        text += f" from {valued(limit.axis, begins[0], unit=False)} to {valued(limit.axis, ends[0])}"
        within = _WITHIN.get(limit.state, "it keeps within") if of_one or not after else "all branches keep within"
        text += f" {within}" if is_arm else "" if of_one else ": all cases are within"
    causes = [
        f"{'there' if value == beyond and begins[2] is None else f'at {valued(limit.axis, beyond)}'} {cause(word)}"
        for value, beyond, word in (begins, ends)
        if word is not None
    ]
    return f"{text}; {' and '.join(causes)}{after}." if causes else f"{text}, as far as it was varied."


def _from_start(dataset: xr.Dataset) -> str:
    """Return that ranges are of the starts of the cases."""
    varied = (one.size > 1 and "scene.initial." in str(one.attrs.get("study_path")) for one in dataset.coords.values())
    return f"Ranges are from {'these starts' if any(varied) else 'this start'}: another one may lead to another rub."
