"""A metric along axes and branches: all axes of a study, bifurcations, branches of steady rubs, Sobol' indices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow import analysis
from workflow.plots._style import COLOURS, GREY, head, legend_below, new_figure, trim
from workflow.plots._units import axis_of, in_units, scaled
from workflow.study import POINT

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

MOST_PANELS = 6
"""Axes that a picture of a metric shows, those with the largest effect."""

_LETTER = 0.075
"""Width of a letter of a tick label, inches: 0.62 of its 8 points, and some room."""

_FREE = 0.8
"""Share of a panel's width that ticks span."""


def metric_by_axis(archive: xr.Dataset, metric: str) -> Figure:
    """Draw a metric along every dimension through the finest case, the range of all cases behind it.

    Of several contacts the most loaded one is shown.
    """
    archive = analysis.most_loaded(archive)
    place = analysis.finest(archive)
    varied = [dim for dim in place if archive.sizes[dim] > 1]
    strongest = sorted(varied, key=lambda dim: -np.nan_to_num(analysis.effect(archive, metric, dim)))[:MOST_PANELS]
    axes = {dim: axis_of(archive, dim) for dim in varied if dim in strongest}
    width = min(3.0, 11.4 / max(len(axes), 1))
    upright = {dim: len(axis["texts"]) * _room(axis["texts"]) > _FREE * width for dim, axis in axes.items()}
    height = 2.9 + max((_room(axis["texts"]) for dim, axis in axes.items() if upright[dim]), default=0.0)
    figure = new_figure(max(width * len(axes), 3.0) + 0.6, height)
    panels: Any = np.atleast_1d(figure.subplots(1, max(len(axes), 1), sharey=True))
    values = archive[metric].where(archive["status"] == 0)
    for panel, (dim, axis) in zip(panels, axes.items(), strict=True):
        others = [name for name in place if name != dim]
        at = np.arange(archive.sizes[dim])
        low, high = values.min(others).values, values.max(others).values
        panel.fill_between(at, low, high, color=GREY, alpha=0.2, lw=0, label="all ok cases")
        line = values.isel({name: place[name] for name in others}).values
        form = "o" if POINT in archive.coords and archive[POINT].dims == (dim,) else "o-"  # what is drawn has no order
        panel.plot(at, line, form, color=COLOURS[0], ms=4, lw=1.2, label="one axis varied, the others fixed")
        every = int(np.ceil(len(at) * _room([""] if upright[dim] else axis["texts"]) / (_FREE * width)))
        panel.set_xticks(at[::every], axis["texts"][::every], fontsize=8, rotation=90 if upright[dim] else 0)
        title = axis["title"] + (f" [{axis['unit']}]" if axis["unit"] else "")
        panel.set_xlabel(fill(title, int(width / _LETTER)), fontsize=9)
        trim(panel)
    panels[0].set_ylabel(f"{metric.replace('_', ' ')} [{analysis.unit_of(archive[metric]) or 1}]")
    legend_below(figure, panels[0].get_legend_handles_labels(), min(len(axes), 2))
    head(figure, analysis.contact_text(archive))
    return figure


def _room(texts: Sequence[str]) -> float:
    """Return what the longest of some tick labels takes beside the others, inches."""
    return _LETTER * (2 + max(map(len, texts)))


def bifurcation(dataset: xr.Dataset, along: str, variable: str = "section_displacement") -> Figure:
    """Draw a value of each load period along an axis, in the later half of the periods: one point where a rub settles.

    Of all other dimensions the smallest step, the most modes and the largest α are shown: select what else is shown
    before.

    Parameters
    ----------
    dataset
        An archive with ``output: {sections: true}``, or a selection of its cases.
    along
        Dimension across the picture, with numbers.
    variable
        What is drawn of each load period.

    Raises
    ------
    ValueError
        There is no such dimension with numbers, or no such variable of load periods.
    """
    analysis.require_numbers(dataset, along)
    if variable not in dataset or "period" not in dataset[variable].dims:
        raise ValueError(f"`{variable}` is not given per load period; write `output: {{sections: true}}` in the study")
    dataset = analysis.most_loaded(dataset)
    place = {dim: k for dim, k in analysis.finest(dataset).items() if dim != along}
    cut = dataset.isel(place).where(dataset["status"].isel(place) == 0).transpose(along, "period", ...)
    values = np.asarray(cut[variable].values, dtype=float)
    complete = np.isfinite(values).sum(axis=1, keepdims=True)
    values = np.where(np.arange(values.shape[1]) >= complete // 2, values, np.nan)
    figure = new_figure(7.0, 4.2)
    panel = figure.subplots()
    (x, x_label), (y, y_label) = in_units(dataset[along]), in_units(cut[variable].copy(data=values))
    panel.plot(np.repeat(x, values.shape[1]), y.ravel(), ".", color=COLOURS[0], ms=2)
    panel.set(xlabel=x_label, ylabel=y_label)
    trim(panel)
    head(figure, analysis.contact_text(dataset))
    return figure


MARKS = {"fold": "o", "period_doubling": "s", "torus": "D", "grazing": "x", "branch_point": "+"}
"""Of bifurcations."""


def branches(dataset: xr.Dataset, variable: str = "steady_max_temperature") -> Figure:
    """Draw a variable along all branches of an archive: stable rubs solid, unstable ones dashed, bifurcations marked.

    Raises
    ------
    ValueError
        The archive has no branches, or no such variable along them.
    """
    along = analysis.followed_axis(dataset)
    if along is None or variable not in dataset or dataset[variable].dims != dataset[along].dims:
        raise ValueError(f"there are no branches of `{variable}`; write an axis as `{{branch: [from, to, points]}}`")
    (x, x_label), (y, y_label) = (in_units(dataset[name]) for name in (along, variable))
    flags = analysis.labels(dataset["bifurcation"]).values
    stable = (analysis.labels(dataset["steady_state"]).values != "unstable") | (
        flags != "none"
    )  # lines reach their end
    dims = [dim for dim in analysis.case_dims(dataset) if dataset.sizes[dim] > 1]
    texts = {dim: analysis.labels_of(dataset, dim, rounded=True) for dim in dims}
    figure = new_figure(7.0, 4.2)
    panel = figure.subplots()
    for k, place in enumerate(np.ndindex(dataset["status"].shape)):
        where = dict(zip(analysis.case_dims(dataset), place, strict=True))
        colour, label = COLOURS[k % len(COLOURS)], ", ".join(texts[dim][where[dim]] for dim in dims)
        panel.plot(x[place], y[place], "--", color=colour, lw=1.2)
        panel.plot(x[place], np.where(stable[place], y[place], np.nan), color=colour, lw=1.8, label=label)
    for name, mark in MARKS.items():
        at = (flags == name) & np.isfinite(x)
        if at.any():
            panel.plot(x[at], y[at], mark, color="black", mfc="white", ms=6, label=name.replace("_", " "), zorder=3)
    panel.set(xlabel=x_label, ylabel=y_label)
    if panel.get_legend_handles_labels()[1]:
        panel.legend(fontsize=8, frameon=False)
    trim(panel)
    return figure


def boundary(dataset: xr.Dataset) -> Figure:
    """Draw the boundaries of an archive, those of stability solid, and shade where the rub of its branch settles.

    Each arm of the branch at ``from`` is shaded along the other number, as far as the boundaries at its ends go on to
    be of stability without a turn, and of those that only ``to`` has none but a fold comes between; darker where two
    arms settle. Of all other dimensions the smallest step, the most modes and the largest α are shown: select what else
    is shown before.

    Parameters
    ----------
    dataset
        An archive with boundaries, or a selection of its cases.

    Raises
    ------
    ValueError
        The archive has no boundaries.
    """
    names = analysis.boundary_axes(dataset)
    if names is None:
        raise ValueError("there are no boundaries; write an axis as `{boundary: [from, to, points]}` beside a branch")
    place = analysis.finest(dataset)
    case = dataset.isel(place)
    axes = (case[name.removeprefix("boundary_")] for name in names)
    drawn = (case[name].rename(axis.name).assign_attrs(axis.attrs) for name, axis in zip(names, axes, strict=True))
    (y, y_label), (x, x_label) = map(in_units, drawn)
    kinds, stable = analysis.labels(case["boundary_kind"]).values, ~(case["boundary_other"].values >= 1)
    figure = new_figure(6.0, 4.2)
    panel: Any = figure.subplots()
    for k, kind in enumerate(dict.fromkeys(kinds[kinds != "none"].tolist())):
        own, colour = kinds == kind, COLOURS[k]
        panel.plot(x[own].T, y[own].T, "--", color=colour, lw=1.2)
        solid = panel.plot(x[own].T, np.where(stable[own], y[own], np.nan).T, color=colour, lw=2.0)
        solid[0].set_label(kind.replace("_", " "))
    for settling in _settling(case, names):
        scales = zip(settling, (x, y, y), (names[1], names[0], names[0]), strict=True)
        ends = (own * np.nanmax(np.abs(new)) / np.nanmax(np.abs(case[name].values)) for own, new, name in scales)
        panel.fill_between(*ends, color=GREY, alpha=0.25, lw=0)
    panel.set(xlabel=x_label, ylabel=y_label)
    legend_below(figure, panel.get_legend_handles_labels(), 4)
    head(figure, fill(analysis.place_text(dataset, place), 60))
    trim(panel)
    return figure


def _settling(case: xr.Dataset, names: tuple[str, str]) -> Iterator[tuple[Array, Array, Array]]:
    """Yield of each arm of the branch values of the other number, and its lower and upper end there."""
    begin, stable = float(case[names[1].removeprefix("boundary_")]), case["boundary_other"].values < 1
    up, across = (np.where(stable, case[name].values, np.nan) for name in names)
    if not stable.any():
        return
    end = float(across.flat[np.nanargmax(np.abs(across - begin))])
    way, near = np.sign(end - begin), 1e-6 * np.array([abs(end - begin), np.nanmax(np.abs(up))])
    begins = np.nanmin(np.abs(across - begin), axis=1, initial=np.inf) <= near[0]
    new = ~begins & (analysis.labels(case["boundary_kind"]).values != "fold")  # behind a fold another arm settles
    beside = across[new]
    sides = [(x[::turn], y[::turn]) for x, y in zip(across, up, strict=True) for turn in (1, -1)]
    for arm in analysis.limits(case).each:
        edges = []
        for value, word in ((arm.start, arm.begun_by), (arm.stop, arm.limited_by)):
            ends = [(x, y) for x, y in sides if np.all(np.abs([x[0] - begin, y[0] - (value or 0.0)]) <= near)]
            for x, y in ends[:1] if word is not None else [(np.array([begin, end]), np.full(2, value))]:
                count = 1 + int(np.argmin(np.append(way * np.diff(x) > 0, False)))  # before it turns or is unstable
                edges.append((x[:count], y[:count]))
        if len(edges) < 2:
            continue
        x = np.unique(way * np.concatenate([x for x, _ in edges]))
        low, high = np.sort([np.interp(way * beside, way * own, y) for own, y in edges], axis=0)
        inside = beside[(low < up[new]) & (up[new] < high)]
        x = np.unique(np.minimum(x, min(*(way * x[-1] for x, _ in edges), *(way * inside))))
        low, high = np.sort([np.interp(x, way * own, y) for own, y in edges], axis=0)
        yield way * x, low, high


STEADY = {
    "period_displacement": "steady_max_displacement",
    "period_displacement_min": "steady_min_displacement",
    "period_temperature": "steady_max_temperature",
}
"""Variables of the steady rub whose load periods have others; those of other variables begin with ``steady_``."""


_LAST_PERIODS = 12
"""Load periods of a point of a sweep that are drawn: whole repetitions of a rub over two, three, four or six."""


def sweep(up: xr.Dataset, variable: str, down: xr.Dataset | None = None, branch: xr.Dataset | None = None) -> Figure:
    """Draw a variable along a sweep, and a branch behind it.

    Of a variable of load periods the last twelve of each point are dots, and their mean is the line. Of all other
    dimensions the smallest step, the most modes and the largest α are shown: select what else is shown before. Of the
    branch its stable rubs are solid, unstable ones dashed.

    Parameters
    ----------
    up, down
        Archives with a sweep, of the same axis in both directions, or selections of their cases.
    variable
        One number for each case, as ``max_temperature``, or for each of its load periods, as ``period_impulse``.
    branch
        An archive of a branch along the same axis.

    Raises
    ------
    ValueError
        An archive has no sweep or no branch of that axis, or no such variable.
    """
    along = analysis.swept_axis(up)
    if along is None:
        raise ValueError("there is no sweep; write an axis as `{sweep: [from, to, count]}`")
    if variable not in up or set(up[variable].dims) - {*analysis.case_dims(up), "contact", "period"}:
        remedy = "; select one with `.sel(sensor=…)`" if variable in up and "sensor" in up[variable].dims else ""
        raise ValueError(f"`{variable}` is no number of a case or of its load periods{remedy}")
    drawn = [_swept(dataset, along, variable) for dataset in (up, down) if dataset is not None]
    unit, factor = scaled(str(up[variable].attrs.get("units", "1")), np.concatenate([y.ravel() for _, y in drawn]))
    figure = new_figure(5.4, 3.9)
    panel = figure.subplots()
    if branch is not None:
        name = _steady_name(branch, variable)
        if analysis.followed_axis(branch) != along:
            raise ValueError(f"there is no branch along `{along}`")
        at = {dim: k for dim, k in analysis.finest(branch).items() if dim in branch["status"].dims}
        x, y = in_units(branch[along].isel(at))[0], np.asarray(branch[name].isel(at).values) * factor
        stable = analysis.labels(branch["steady_state"]).isel(at).values != "unstable"
        for shown, form, width, what in ((stable, "-", 4.0, "stable"), (~stable, "--", 1.6, "unstable")):
            if shown.any():
                label = f"branch, {what}"
                panel.plot(x, np.where(shown, y, np.nan), form, color=GREY, alpha=0.7, lw=width, label=label)
    for k, (x, y) in enumerate(drawn):
        way, form = ("up", "^") if x[-1] > x[0] else ("down", "v")
        counted = np.isfinite(y).sum(axis=1)
        mean = np.where(counted > 0, np.nansum(y, axis=1), np.nan) / np.maximum(counted, 1)
        panel.plot(x, y * factor, ".", color=COLOURS[k], ms=2, alpha=0.5)
        panel.plot(x, mean * factor, f"{form}-", color=COLOURS[k], ms=4, lw=0.8, label=f"sweep {way}")
    of_periods = f"mean and each of the last {_LAST_PERIODS} load periods at each point"
    which = of_periods if "period" in up[variable].dims else "at each point"
    sensor = f" of {up['sensor'].item()}" if variable.startswith("sensor") and "sensor" in up.coords else ""
    name = f"{variable}{sensor}".replace("_", " ")
    panel.set(xlabel=in_units(up[along])[1], ylabel=fill(f"{name} [{unit or 1}]", 44))
    trim(panel)
    legend_below(figure, panel.get_legend_handles_labels(), 2)
    shown = analysis.place_text(
        up, {dim: k for dim, k in analysis.finest(analysis.most_loaded(up)).items() if dim != along}
    )
    head(figure, fill(", ".join(filter(None, (f"{name}, {which}", shown))), 70))
    return figure


def _swept(dataset: xr.Dataset, along: str, variable: str) -> tuple[Any, Any]:
    """Return the points of a sweep and a variable at them, ``(point, value)``: of load periods the last ones."""
    if analysis.swept_axis(dataset) != along or variable not in dataset:
        raise ValueError(f"there is no sweep of `{variable}` along `{along}`")
    dataset = analysis.most_loaded(dataset)
    at = {dim: k for dim, k in analysis.finest(dataset).items() if dim != along}
    values = np.asarray(dataset[variable].where(dataset["status"] == 0).isel(at).transpose(along, ...).values)
    if values.ndim == 1:
        return in_units(dataset[along])[0], values[:, None]
    last = np.isfinite(values).sum(axis=1, keepdims=True) - 1 - np.arange(_LAST_PERIODS)
    taken = np.take_along_axis(values, np.maximum(last, 0), axis=1)
    return in_units(dataset[along])[0], np.where(last >= 0, taken, np.nan)


def _steady_name(branch: xr.Dataset, variable: str) -> str:
    """Return the variable of a branch that a variable of load periods, or of a case, settles to."""
    own = STEADY.get(variable, f"steady_{variable.removeprefix('period_')}")
    if own not in branch:
        raise ValueError(f"`{variable}` has no steady value; these have: {', '.join([*STEADY, 'period_impulse'])}")
    return own


def sobol_indices(dataset: xr.Dataset, *metrics: str) -> Figure:
    """Draw the Sobol' indices of metrics with their intervals: what each number does alone, and with the others.

    Of all other dimensions the smallest step, the most modes and the first value are shown: select what else is shown
    before.

    Parameters
    ----------
    dataset
        An archive of a study that draws ``sample: sobol_indices``, or a selection of its cases.
    metrics
        One number for each case; ``contact_impulse`` and ``max_temperature`` where none is named.

    Raises
    ------
    ValueError
        Nothing is drawn for Sobol' indices, or there is no such metric.
    """
    dataset = analysis.most_loaded(dataset)
    metrics = metrics or ("contact_impulse", "max_temperature")
    place = {dim: k for dim, k in analysis.finest(dataset).items() if dim != analysis.drawn_dim(dataset)}
    indices = {metric: analysis.sobol(dataset.isel(place), metric) for metric in metrics}
    figure = new_figure(3.4 * len(metrics) + 0.6, 3.6)
    panels: Any = np.atleast_1d(figure.subplots(1, len(metrics), sharey=True))
    for panel, (metric, index) in zip(panels, indices.items(), strict=True):
        at = np.arange(index.sizes["number"])
        for k, name in enumerate(("first", "total")):
            low, high = index[f"{name}_interval"].values.T
            values, x = index[name].values, at + 0.24 * (k - 0.5)
            panel.vlines(x, low, high, color=COLOURS[k], lw=1.4)
            label = ("first-order index: the number alone", "total index: with the others")[k]
            panel.plot(x, values, ("o", "s")[k], color=COLOURS[k], ms=5, label=label)
        panel.axhline(0, color="black", lw=0.8)
        names = [str(name).replace("_", " ") for name in index["number"].values]
        turned = sum(map(len, names)) > 30
        panel.set_xticks(at, names, fontsize=9, rotation=30 if turned else 0, ha="right" if turned else "center")
        panel.set_xlim(-0.5, len(at) - 0.5)
        panel.set_title(metric.replace("_", " "), fontsize=10)
        trim(panel, "y")
    panels[0].set_ylabel("share of the variance")
    legend_below(figure, panels[0].get_legend_handles_labels(), 2)
    head(figure, analysis.contact_text(dataset))
    return figure
