"""Cases of an archive: their labels, how they ended, and which of them to show."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.archive import boxes, lengths
from workflow.judges.trials import EXACT
from workflow.run import status_name
from workflow.schemes import Status
from workflow.study import AUTO, CHOSEN, MATRIX, MODES, POINT, SWEEP, readable

if TYPE_CHECKING:
    import xarray as xr


def case_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the dimensions along which the cases of an archive differ."""
    return tuple(str(name) for name in dataset["status"].dims)


def swept_axis(dataset: xr.Dataset) -> str | None:
    """Return the axis that is swept in an archive, ``None`` where none is."""
    return next((dim for dim in case_dims(dataset) if dim in dataset.coords and SWEEP in dataset[dim].attrs), None)


def require_numbers(dataset: xr.Dataset, dim: str) -> None:
    """Refuse by a :class:`ValueError` what is no dimension of the cases with numbers along it."""
    if dim not in case_dims(dataset) or dim not in dataset.coords or dataset[dim].dtype.kind not in "if":
        raise ValueError(f"`{dim}` is no dimension with numbers; the cases lie along {', '.join(case_dims(dataset))}")


def is_of_contacts(dataset: xr.Dataset) -> bool:
    """Tell whether an archive has several contacts."""
    return "contact" in dataset.dims and "contact" not in case_dims(dataset)  # an axis may have that name


def most_loaded(dataset: xr.Dataset) -> xr.Dataset:
    """Return an archive at that of several contacts which takes the largest impulse in any ok case; else as it is."""
    if not is_of_contacts(dataset):
        return dataset
    impulse = dataset["contact_impulse" if "contact_impulse" in dataset else "steady_impulse"]
    largest = impulse.where(dataset["status"] == Status.OK).fillna(0.0).max(set(impulse.dims) - {"contact"})
    return dataset.isel(contact=int(np.argmax(largest.values)))


def added_dim(values: xr.Dataset | xr.DataArray, name: str, other: str) -> str:
    """Return the name of a dimension that a function adds: another one where an axis of the study has the name."""
    return other if name in values.dims or name in values.coords else name


def contact_text(dataset: xr.Dataset) -> str:
    """Return the name of the one of several contacts at which an archive was taken; empty of others."""
    named = dataset.coords.get("contact")
    return "" if named is None or named.ndim or "study_path" in named.attrs else f"contact {named.item()}"


def labels(flags: xr.DataArray) -> xr.DataArray:
    """Return the words of flags (``status``, ``event_kind``, ``steady_state`` …); an empty text where there is none.

    None is where a list of events is not full, and in what :meth:`xarray.DataArray.where` has masked.

    Raises
    ------
    ValueError
        The array has none: its ``flag_values`` and ``flag_meanings`` were lost on the way from the archive.
    """
    import xarray as xr

    if "flag_meanings" not in flags.attrs:
        raise ValueError(f"{flags.name or 'the array'} has no flag_meanings; give a variable as the archive holds it")
    words = dict(zip(np.ravel(flags.attrs["flag_values"]).tolist(), flags.attrs["flag_meanings"].split(), strict=True))
    worded: xr.DataArray = xr.apply_ufunc(np.vectorize(lambda flag: words.get(flag, ""), otypes=[str]), flags)
    return worded


class RunawayCases(NamedTuple):
    """Ok cases that grow in permanent contact: above their critical coupling, or below it, where they flutter.

    An oscillation of these grows, however slowly, as that of any undamped structure may.
    """

    above: int = 0
    flutter: int = 0
    critical: str = ""
    """Critical couplings of the cases above, W/N, the first five; of several contacts with those that are closed."""
    flutter_sets: str = ""
    """Of several contacts those that are closed in the cases that flutter, the first five sets."""


def runaways(dataset: xr.Dataset) -> RunawayCases:
    """Return how many ok cases grow in permanent contact, and where."""
    if "runaway" not in dataset or "critical_alpha" not in dataset or "alpha" not in dataset.coords:
        return RunawayCases()
    critical, grows = dataset["critical_alpha"], (dataset["runaway"] == 1) & (dataset["status"] == Status.OK)
    above = grows & (dataset["alpha"] > critical)
    flutter, blank = (grows & ~above).values, np.full(grows.shape, "")
    sets = (dataset[name].values if name in dataset else blank for name in ("critical_set", "growth_set"))
    least, fastest = (each[where].tolist() for each, where in zip(sets, (above.values, flutter), strict=True))
    limits = sorted({*zip(least, critical.values[above.values].round(12).tolist(), strict=True)})
    texts = [f"{closed}: {value:.4g}" if closed else f"{value:.4g}" for closed, value in limits][:5]
    fluttering = sorted({*fastest} - {""})[:5]
    return RunawayCases(int(above.sum()), int(flutter.sum()), ", ".join(texts), ", ".join(fluttering))


_ROUNDED = 1e-14
"""Relative difference of a number from its text: of sums, as in 3.0000000000000004."""


def exact(value: object) -> str:
    """Return a value of a coordinate in the digits by which an opened archive finds it, ``30`` and ``1e-06``."""
    if not isinstance(value, float | np.floating):
        return str(value)
    number = float(value)
    texts = (f"{number:.{digits}g}" for digits in range(4, 17))
    return next((text for text in texts if abs(float(text) - number) <= _ROUNDED * abs(number)), repr(number))


def unit_of(values: xr.DataArray) -> str:
    """Return the unit of values as it is written by hand, ``W/N``; an empty text of pure numbers."""
    return readable(str(values.attrs.get("units", "1")))


def coordinate_units(dataset: xr.Dataset) -> dict[str, str]:
    """Return the units of coordinates by name, see :func:`unit_of`."""
    return {str(name): unit_of(values) for name, values in dataset.coords.items()}


RPM = 60.0
"""Revolutions per minute in one per second."""


def is_speed(coordinate: xr.DataArray) -> bool:
    """Tell whether a coordinate is a speed of rotation, which is read in rpm."""
    return coordinate.attrs.get("study_path") == "scene.speed"


def is_auto(coordinate: xr.DataArray, value: object) -> bool:
    """Tell whether a count of modes is `auto`, left to the tolerance."""
    return str(coordinate.name) in MODES and value == CHOSEN


def value_text(coordinate: xr.DataArray, value: object) -> str:
    """Return a value of a coordinate as a study writes it, see :func:`exact`."""
    return AUTO if is_auto(coordinate, value) else exact(value)


def mode_counts(dataset: xr.Dataset, name: str) -> NDArray[np.float64]:
    """Return the counts of modes along their dimension, of `auto` the largest that was used."""
    coordinate = dataset[name]
    counts = np.asarray(coordinate.values, dtype=np.float64).copy()
    for place in map(tuple, np.argwhere(counts == CHOSEN).tolist()):
        used = dataset[f"{name}_used"].isel(dict(zip(coordinate.dims, place, strict=True)))
        counts[place] = float(used.max())
    return counts


def modes_along(dataset: xr.Dataset, dim: str) -> NDArray[np.float64]:
    """Return the modes of both kinds at each place along a dimension, 0 where no count lies along it."""
    names = [name for name in MODES if name in dataset.coords and dataset[name].dims == (dim,)]
    return sum((mode_counts(dataset, name) for name in names), np.zeros(dataset.sizes[dim]))


def naming(dataset: xr.Dataset, dim: str) -> list[str]:
    """Return the coordinates that name the values of a dimension; points and matrices of a drawn zip do not."""
    return [str(name) for name in dataset.coords if dataset[name].dims == (dim,) and name not in (POINT, MATRIX)]


def rounded_texts(values: Iterable[float]) -> list[str]:
    """Return numbers in the fewest digits, four at least, that tell different ones apart."""
    values = list(values)
    different = len(set(values))
    for digits in range(4, 18):
        texts = [f"{value:.{digits}g}" for value in values]
        if len(set(texts)) == different:
            break
    return texts


def labels_of(dataset: xr.Dataset, dim: str, named: bool = True, rounded: bool = False) -> list[str]:
    """Return a label for each value of a dimension, zipped coordinates side by side.

    ``named`` labels begin with the coordinate's name, ``alpha 30 W/N``; ``rounded`` ones have as many digits as tell
    the values apart, four at least, as fit in a picture or a table.
    """
    names = naming(dataset, dim)
    if not names:
        return [str(k) for k in range(dataset.sizes[dim])]
    columns = [_labels(dataset[name], named or len(names) > 1, rounded) for name in names]
    return [", ".join(parts) for parts in zip(*columns, strict=True)]


def place_text(dataset: xr.Dataset, place: Mapping[str, int]) -> str:
    """Return where places along some dimensions lie, ``h 1e-06 s; e 0.5``, and the contact of :func:`contact_text`.

    A dimension of one value says nothing.
    """
    varied = {dim: k for dim, k in place.items() if dataset.sizes[dim] > 1}
    texts = [labels_of(dataset, dim, rounded=True)[k] for dim, k in varied.items()]
    return "; ".join(filter(None, [*texts, contact_text(dataset)]))


def _labels(coordinate: xr.DataArray, named: bool, rounded: bool) -> list[str]:
    unit, values = unit_of(coordinate), coordinate.values
    if is_speed(coordinate):
        unit, values = "rpm", RPM * values
    if unit == "m" and 0 < np.abs(values).max(initial=0.0) < 1e-3:
        unit, values = "µm", 1e6 * values
    before = f"{coordinate.name} ".replace("_", " ") if named else ""
    after = f" {unit}" if unit else ""
    few = rounded and np.issubdtype(coordinate.dtype, np.floating)
    texts = rounded_texts(values) if few else [value_text(coordinate, value) for value in values]
    return [before + text + after for text in texts]


_MOST_GROUPS = 1000
"""Largest number of different messages that are counted one by one."""

_BLOCK = 4096
"""Cases whose messages are read at a time: of the longest messages 64 MB, four bytes a character."""


@dataclass(frozen=True)
class Failures:
    """Cases with one status and one message: their number, and the labels of the first."""

    status: str
    message: str
    cases: int
    first: str


def failures(dataset: xr.Dataset, rounded: bool = False) -> list[Failures]:
    """Return pairs of status and message of cases that ran, the most frequent first; ok ones need a message.

    ``rounded`` labels are those of :func:`labels_of`.
    """
    dims = case_dims(dataset)
    status = np.asarray(dataset["status"].values)
    groups: dict[tuple[int, str], tuple[tuple[int, ...], int]] = {}
    for index, message in _messages(dataset, status):
        key = (int(status[index]), message)
        if key not in groups and len(groups) >= _MOST_GROUPS:
            key = (key[0], "… another message")
        first, number = groups.get(key, (index, 0))
        groups[key] = (first, number + 1)
    labels = {dim: labels_of(dataset, dim, rounded=rounded) for dim in dims} if groups else {}
    listed = [
        Failures(
            status_name(state),
            message,
            number,
            ", ".join(labels[dim][k] for dim, k in zip(dims, first, strict=True)) or "the only case",
        )
        for (state, message), (first, number) in groups.items()
    ]
    return sorted(listed, key=lambda group: -group.cases)


def _messages(dataset: xr.Dataset, status: NDArray[np.int8]) -> Iterator[tuple[tuple[int, ...], str]]:
    """Yield index and message of cases that are not ok or have a message; a bounded number is read at a time."""
    for block in boxes(status.shape, lengths(status.shape, (1,) * status.ndim, _BLOCK)):
        states = status[block]
        texts = np.asarray(dataset["message"].isel(dict(zip(dataset["status"].dims, block, strict=True))).values)
        speaks = (states != Status.NOT_RUN.value) & ((states != Status.OK.value) | (texts != ""))
        for place in np.argwhere(speaks).tolist():
            yield tuple(b.start + k for b, k in zip(block, place, strict=True)), str(texts[tuple(place)])


def finest(dataset: xr.Dataset) -> dict[str, int]:
    """Return the position of the most accurate case: exact scheme, smallest step, most modes; largest α, first rest.

    Where no scheme is labelled as the exact one, the first is taken.
    """
    place = dict.fromkeys(case_dims(dataset), 0)
    if (
        "scheme" in dataset.coords
        and dataset["scheme"].ndim == 1
        and EXACT in (names := dataset["scheme"].values.tolist())
    ):
        place[str(dataset["scheme"].dims[0])] = names.index(EXACT)
    for name, largest in (("h", False), ("thermal_modes", True), ("mechanical_modes", True), ("alpha", True)):
        if name in dataset.coords and dataset[name].ndim == 1:
            values = mode_counts(dataset, name) if name in MODES else np.asarray(dataset[name].values)
            place[str(dataset[name].dims[0])] = int(np.argmax(values) if largest else np.argmin(values))
    return place


def shown_dim(dataset: xr.Dataset, most: int = 8) -> str | None:
    """Return the dimension whose values one picture compares: α if it varies, then the scheme, else the largest."""
    dims = case_dims(dataset)
    fitting = [dim for dim in dims if 1 < dataset.sizes[dim] <= most]
    for first in ("alpha", "scheme"):
        if first in fitting:
            return first
    return max(fitting, key=lambda dim: dataset.sizes[dim]) if fitting else None
