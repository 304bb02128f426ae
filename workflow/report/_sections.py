"""What the sections of a report say, in plain values for ``page.html``; ``None`` where an archive has nothing to say.

A section with pictures has one that is its main ``figure`` too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow import analysis, plots
from workflow.archive import json_in, provenance
from workflow.report._html import picture, short
from workflow.run import status_counts
from workflow.schemes import Status
from workflow.study import MODES

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

Section = dict[str, Any]

METRICS = ("contact_impulse", "impacts", "max_temperature", "max_penetration", "max_worn_depth")
_ALONG_BRANCHES = ("steady_max_temperature", "steady_impulse", "floquet_multiplier")
_DECIDED_SHOWN = 40
_FAILURES_SHOWN = 20
_LABELS_SHOWN = 8
_STANDINGS_SHOWN = 150
_SENSORS_SHOWN = 3
_FACTS = ("processor", "platform", "solver_version", "code_revision", "content_hash")


def any_ok(dataset: xr.Dataset) -> bool:
    """Tell whether any case is ok."""
    return bool((dataset["status"] == Status.OK).any())


def answered(dataset: xr.Dataset, methods: Mapping[str, str]) -> tuple[Section, analysis.Choice | None]:
    """Return what an archive recommends at its study's tolerance, or why it holds no answer, and the choice.

    The choice is what comes nearest where nothing meets the tolerance, and ``None`` without a reference. ``methods``
    holds the method of each scheme.
    """
    try:
        recommendation = analysis.recommend(dataset)
    except (analysis.NoReferenceError, ValueError) as error:
        explanation = (
            "Every case is the exact solution of its model (event_driven): there is no step to choose. "
            "The study has no `reference`, so the error of the model is not known."
            if analysis.is_exact(dataset, methods)
            else "A sweep has no errors: its points start from each other. Run the study with a list in the place of "
            "the sweep and `reference: {scheme: event_driven}` to another archive, with -o."
            if analysis.swept_axis(dataset)
            else f"No recommendation: {error}. Run the study with `reference: {{scheme: event_driven}}` to "
            "another archive, with -o."
        )
        return {"explanation": explanation}, None
    usual = analysis.usual_recommendations(dataset, recommendation)
    answer = {
        "lines": analysis.answer_lines(recommendation),
        "cautions": analysis.recommendation_cautions(dataset),
        "undecidable": list(dict.fromkeys(analysis.undecidable(one) for one in usual if one.undecidable)),
        "columns": analysis.RECOMMENDATION_COLUMNS,
        "rows": [analysis.recommendation_row(one) for one in usual],
    }
    return answer, recommendation.choice or recommendation.next


def where_it_settles(dataset: xr.Dataset) -> Section | None:
    """Say in which range of each axis every steady rub settles, as ``workflow limits`` without bounds."""
    try:
        return (
            {"sentences": analysis.limit_lines(analysis.limits(dataset), dataset, {})}
            if "steady_state" in dataset
            else None
        )
    except analysis.NothingSteadyError:
        return None


def varied_along_branches(dataset: xr.Dataset) -> list[str]:
    """Return the variables that are drawn along branches, of an archive with any; heat only where some acts."""
    if analysis.followed_axis(dataset) is None or not any_ok(dataset):
        return []
    return [name for name in _ALONG_BRANCHES if np.nanmax(dataset[name].values) > 0]


def along_branches(dataset: xr.Dataset) -> Section | None:
    """Draw the branches of an archive."""
    names = varied_along_branches(dataset)
    return _drawn({f"{name.replace('_', ' ')} along the branches": plots.branches(dataset, name) for name in names})


def _drawn(figures: Mapping[str, Figure]) -> Section | None:
    """Return a section of figures by what each shows, the first of which is the main one."""
    if not figures:
        return None
    pictures = [picture(figure, about) for about, figure in figures.items()]
    return {"pictures": pictures, "figure": next(iter(figures.values()))}


def over_speed(dataset: xr.Dataset) -> Section | None:
    """Draw what changes over the rotation speed and along a sweep, as far as an archive has the numbers for it."""
    if not any_ok(dataset):
        return None
    figures, swept = dict[str, Any](), analysis.swept_axis(dataset)
    if swept is not None:
        figures[f"contact impulse along the sweep of {swept}"] = plots.sweep(dataset, "contact_impulse")
    if "speed" in analysis.case_dims(dataset) and dataset.sizes["speed"] >= plots.LEAST_VALUES:
        sensors = [str(name) for name in dataset["sensor"].values] if "sensor_value" in dataset else []
        kept = [*sensors, *({"displacement"} & set(dataset.data_vars))] if "t" in dataset.dims else []
        for name in kept[:_SENSORS_SHOWN]:
            figures[f"spectrum of {name.replace('_', ' ')} over the speed"] = plots.interaction_map(dataset, name)
        figures["closing of the clearance over the speed"] = plots.clearance(dataset)
    return _drawn(figures)


def sweeps(datasets: Sequence[xr.Dataset]) -> Section | None:
    """Draw two sweeps along one axis over each other, and a branch along it behind them, of several archives."""
    swept = [one for one in datasets if analysis.swept_axis(one) is not None and any_ok(one)]
    axis = analysis.swept_axis(swept[0]) if swept else None
    if axis is None or len(swept) != 2 or analysis.swept_axis(swept[1]) != axis:
        return None
    branch = next((one for one in datasets if analysis.followed_axis(one) == axis and any_ok(one)), None)
    up, down = sorted(swept, key=lambda one: float(one[axis][0]))
    return _drawn({f"impulse of the load periods along {axis}": plots.sweep(up, "period_impulse", down, branch)})


def maps(dataset: xr.Dataset) -> Section | None:
    """Draw maps of a scene over two axes, of archives that hold load periods and no errors."""
    dims = plots.map_dims(dataset)
    if dims is None or "impulse_error" in dataset or not any_ok(dataset):
        return None
    place = plots.middle(dataset, dims)
    pictures = [picture(one, "map of the scene over two axes") for one in plots.single_maps(dataset, dims, place)]
    if not pictures:
        return None
    return {
        "pictures": pictures,
        "where": analysis.place_text(dataset, place),
        "figure": plots.scene_map(dataset, *dims),
    }


def cases(dataset: xr.Dataset) -> Section:
    """Tell how the cases ended and along which dimensions they lie."""
    groups = analysis.failures(dataset, rounded=True)
    return {
        "counts": [[name, str(number)] for name, number in status_counts(dataset).items()],
        **analysis.runaways(dataset)._asdict(),
        "failures": [[f.status, str(f.cases), f.first, f.message] for f in groups[:_FAILURES_SHOWN]],
        "more_failures": max(len(groups) - _FAILURES_SHOWN, 0),
        "decided": [
            [one.where, f"{one.mechanical_modes} + {one.thermal_modes}", _percent(one.error)]
            for one in analysis.decided(dataset)[:_DECIDED_SHOWN]
        ],
        "dims": [
            [dim, str(dataset.sizes[dim]), _listed(analysis.labels_of(dataset, dim, named=False, rounded=True))]
            for dim in analysis.case_dims(dataset)
        ],
    }


def _listed(labels: list[str]) -> str:
    """Return labels side by side, of many the first and the last."""
    return "; ".join(labels if len(labels) <= _LABELS_SHOWN else [*labels[: _LABELS_SHOWN - 2], "…", labels[-1]])


def effects(archive: xr.Dataset, methods: Mapping[str, str]) -> Section | None:
    """Tell what each axis does, to the exact solutions where there are any, and which do less than the schemes err."""
    exact = analysis.exact_place(archive, methods) or {}
    dataset = archive.isel(exact)
    dims = [dim for dim in analysis.case_dims(dataset) if dataset.sizes[dim] > 1]
    if not dims or not any_ok(dataset):
        return None
    names = [name for name in METRICS if name in dataset]
    return {
        "of_exact": analysis.place_text(archive, {dim: k for dim, k in exact.items() if dim != "h"}),
        "head": ["axis", *(name.replace("_", " ") for name in names)],
        "rows": [[dim, *(_percent(analysis.effect(dataset, name, dim)) for name in names)] for dim in dims],
        "hidden": [
            f"{one.dim} changes the {one.metric.replace('_', ' ')} by {_percent(one.effect)} in the most accurate "
            "computation, no more than the median error of "
            + "; ".join(f"{scheme} at {steps}" for scheme, steps in one.within.items())
            + "."
            for one in analysis.hidden(archive)
        ],
        "shown": analysis.place_text(dataset, analysis.finest(dataset)),
        "pictures": [
            picture(plots.metric_by_axis(dataset, "contact_impulse"), "contact impulse along each axis"),
            picture(plots.metric_by_axis(dataset, "max_temperature"), "largest temperature along each axis"),
        ],
    }


def standing(dataset: xr.Dataset) -> Section:
    """Tell who stays stable and who is accurate, by scheme and step."""
    found = analysis.standings(dataset)
    rows = [
        [
            row.scheme,
            row.step,
            ", ".join(f"{n} {name}" for name, n in row.counts.items()),
            short(row.error),
            "" if row.choice is None else analysis.LIMITS[row.choice.worst.limited_by],
            short(row.residual, "+.1e"),
            short(row.penetration),
            short(row.restitution, ".2g"),
            (row.verdict,),
        ]
        for row in found[:_STANDINGS_SHOWN]
    ]
    new = [k for k in range(1, len(rows)) if rows[k][0] != rows[k - 1][0]]
    return {"rows": rows, "new": new, "more": len(found) - len(rows)}


def precision(dataset: xr.Dataset) -> Section | None:
    """Draw speed against error where an archive has both, and name the observed orders."""
    if "impulse_error" not in dataset or dataset.sizes.get("h", 1) < 3 or not any_ok(dataset):
        return None
    fewest = _fewest_modes(dataset)
    figure = plots.work_precision(dataset, dataset.isel(fewest) if fewest else None)
    return {
        "shown": analysis.place_text(
            dataset, {dim: k for dim, k in analysis.finest(dataset).items() if dim not in ("scheme", "h")}
        ),
        "pictures": [
            picture(figure, "relative error against processor seconds per simulated second"),
            picture(plots.convergence(dataset), "relative error, penetration and energy residual against the step"),
        ],
        "head": ["scheme", *(f"{one}: order / scatter" for one in analysis.ERRORS.values()), "last stable step [s]"],
        "orders": [
            [
                line.scheme,
                *(" / ".join(short(one, "z.2f") for one in line.orders[n]) for n in analysis.ERRORS),
                _limit(line),
            ]
            for line in analysis.lines(dataset)
            if not line.exact
        ],
        "figure": figure,
    }


def _limit(line: analysis.Line) -> str:
    lost = np.flatnonzero(line.lost)
    return "every h" if not lost.size else f"{line.h[lost[0] - 1]:.6g}" if lost[0] else "none"


def _fewest_modes(dataset: xr.Dataset) -> dict[str, int]:
    """Return where the reduced model with the fewest modes lies along the dimensions of the counts of modes."""
    dims = {
        str(dim) for name in MODES if name in dataset.coords for dim in dataset[name].dims if dataset.sizes[dim] > 1
    }
    return {dim: int(np.argmin(analysis.modes_along(dataset, dim))) for dim in dims}


def shares(dataset: xr.Dataset) -> Section | None:
    """Draw the Sobol' indices of metrics that the drawn numbers change, of an archive with the matrices for it."""
    design = analysis.drawn_dim(dataset)
    if design is None:
        return None
    changing = [name for name in METRICS if name in dataset and analysis.effect(dataset, name, design) > 0]
    figure = plots.sobol_indices(dataset, *changing) if changing else None
    return {
        "where": analysis.place_text(dataset, {dim: k for dim, k in analysis.finest(dataset).items() if dim != design}),
        "pictures": [] if figure is None else [picture(figure, "Sobol' indices of the drawn numbers")],
        "figure": figure,
    }


def study_of(archive: Path) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the method of each scheme of an archive's study by its label, and the scene as resolved.

    Both are empty where provenance does not hold them.
    """
    resolved = json_in(provenance(archive), "resolved")
    schemes, scene = ({} if not isinstance(part, dict) else part for part in map(resolved.get, ("schemes", "scene")))
    methods = {
        str(k): str(form["method"]) for k, form in schemes.items() if isinstance(form, dict) and "method" in form
    }
    return methods, scene


def origin(dataset: xr.Dataset, archive: Path) -> Section:
    """Tell where an archive comes from: its study, when and where it was run, and by what software."""
    stored = provenance(archive)
    facts = {
        "written": str(dataset.attrs.get("history", "")).split(": ", 1)[0],
        "processor time": _computing(dataset),
        "run": _run(json_in(stored, "run")),
        **{name.replace("_", " "): stored.get(name, "") for name in _FACTS},
        "versions": ", ".join(f"{name} {version}" for name, version in json_in(stored, "versions").items()),
    }
    return {"facts": [fact for fact in facts.items() if fact[1]], "study": stored.get("study", "")}


def _computing(dataset: xr.Dataset) -> str:
    """Return the sum of the cases' times."""
    seconds = np.asarray(dataset["processor_time"].values, dtype=float) if "processor_time" in dataset else np.zeros(0)
    finite = seconds[np.isfinite(seconds)]
    return f"{finite.sum():.3g} s, the sum over {finite.size} cases, without references" if finite.size else ""


def _run(run: Mapping[str, Any]) -> str:
    """Return seconds, cases and machine of the last run of an archive, as it stored them."""
    try:
        return f"{float(run['seconds']):.3g} s for {int(run['cases'])} cases on {run['where']}"
    except (ValueError, KeyError, TypeError):
        return ""


def _percent(share: float) -> str:
    if not np.isfinite(share):
        return "–"
    if share < 1e-12:  # rounding
        return "0"
    return f"{100 * share:.0f} %" if share > 0.095 else f"{100 * share:.2g} %"
