"""Units and values as they are read: µm where lengths are small, m/s instead of m s-1."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis import RPM, exact, is_speed, naming, rounded_texts, value_text
from workflow.study import POINT, readable

if TYPE_CHECKING:
    import xarray as xr

_SCALES = {
    "m": ((1.0, "m", 1.0), (1e-3, "mm", 1e3), (0.0, "µm", 1e6)),
    "s": ((0.1, "s", 1.0), (1e-4, "ms", 1e3), (0.0, "µs", 1e6)),
}
"""From which usual magnitude on which unit serves, and the factor to it."""

_UNSCALED = ("h", "t")
"""Coordinates that stay in SI, as studies and commands write them."""


def scaled(unit: str, values: NDArray[Any]) -> tuple[str, float]:
    """Return a readable unit for values and the factor to it; the median of the magnitudes decides."""
    sizes = np.abs(np.asarray(values, dtype=float))
    sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    if unit not in _SCALES or not sizes.size:
        return readable(unit), 1.0
    usual = float(np.median(sizes))
    return next((name, factor) for least, name, factor in _SCALES[unit] if usual >= least)


def in_units(values: xr.DataArray) -> tuple[NDArray[Any], str]:
    """Return values in a readable unit, and their label."""
    unit, factor = ("rpm", RPM) if is_speed(values) else scaled(str(values.attrs.get("units", "1")), values.values)
    return np.asarray(values.values) * factor, str(values.name).replace("_", " ") + (f" [{unit}]" if unit else "")


def coordinate_texts(coordinate: xr.DataArray) -> tuple[str, list[str]]:
    """Return the unit and the values of a coordinate as texts, numbers of four digits or as many as tell them apart."""
    values = np.atleast_1d(coordinate.values)
    if values.dtype.kind != "f":
        return "", [value_text(coordinate, value) for value in values]
    unit = str(coordinate.attrs.get("units", "1"))
    name, factor = (readable(unit), 1.0) if coordinate.name in _UNSCALED else scaled(unit, values)
    name, factor = ("rpm", RPM) if is_speed(coordinate) else (name, factor)
    return name, rounded_texts(values * factor)


def selector(coordinate: xr.DataArray, k: int) -> str:
    """Return what selects a value of an indexed coordinate with ``.sel``: ``e=0.5``."""
    value = coordinate.values[k]
    return f"{coordinate.name}={exact(float(value)) if coordinate.dtype.kind == 'f' else repr(value.item())}"


def axis_of(part: xr.Dataset, dim: str) -> dict[str, Any]:
    """Describe a dimension: title, unit, texts of its values, what selects them, and the numbers drawn along it."""
    names = naming(part, dim)
    size, has_labels = part.sizes[dim], dim in part.coords and part[dim].dims == (dim,)
    if not names:
        texts, title, unit = [str(k) for k in range(size)], dim, ""
    else:
        units, columns = zip(*(coordinate_texts(part[name]) for name in names), strict=True)
        texts = [" + ".join(row) for row in zip(*columns, strict=True)]
        unit = units[0] if len(names) == 1 else ""
        title = _joint([n + (f" [{u}]" if u and len(names) > 1 else "") for n, u in zip(names, units, strict=True)])
    drawn = map(in_units, (part[n] for n in names)) if POINT in part.coords and part[POINT].dims == (dim,) else ()
    selected = [selector(part[dim], k) if has_labels else f"{dim}={k}" for k in range(size)]
    return {
        "name": dim,
        "title": title.replace("_", " "),
        "unit": unit,
        "texts": texts if len(set(texts)) == size else [f"{text} ({k})" for k, text in enumerate(texts)],
        "selectors": selected,
        "by_label": has_labels,
        "numbers": [{"values": values.tolist(), "title": title} for values, title in drawn],
    }


def _joint(names: Sequence[str]) -> str:
    """Return names side by side, a last word that all share once: ``mechanical + thermal modes``."""
    first, last = zip(*(name.rpartition("_")[::2] for name in names), strict=True)
    if len(names) > 1 and len(set(last)) == 1 and all(first):
        return f"{' + '.join(first)} {last[0]}"
    return " + ".join(names)
