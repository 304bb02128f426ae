"""Sections of a report: cases, effects of axes, errors, standings, speed against error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from workflow.analysis import (
    ERRORS,
    RULE,
    Line,
    case_dims,
    decided,
    effect,
    exact_place,
    failures,
    finest,
    hidden,
    labels_of,
    lines,
    modes_along,
    place_text,
    runaways,
    standings,
)
from workflow.plots import convergence, map_dims, metric_by_axis, middle, scene_map, single_maps, work_precision
from workflow.report._html import image, note, paragraph, short, table, tag
from workflow.run import status_counts
from workflow.schemes import Status
from workflow.study import MODES
from workflow.variables import COMPARED

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

METRICS = ("contact_impulse", "impacts", "max_temperature", "max_penetration")
_DECIDED_SHOWN = 40
_FAILURES_SHOWN = 20
_LABELS_SHOWN = 8


@dataclass(frozen=True)
class Section:
    """A section of a page and its main figure, ``None`` where there is nothing to draw."""

    body: Sequence[str]
    figure: Figure | None


TERMS = (
    "Energy residual: energy that the scheme itself creates (+) or takes (−), what loads, damping, heat and impacts do "
    "aside, as a share of the largest energy of the case. Effective e: speed after over speed before an impact, "
    "median, of schemes that read no restitution coefficient; 1 keeps the energy of an impact, 0 takes it. "
    "Penetration / gap: how far the tip passes the casing, in gaps; in metres where the gap is 0."
)
"""What the columns of the standings are."""

_STANDINGS_SHOWN = 150


def any_ok(dataset: xr.Dataset) -> bool:
    """Tell whether any case is ok."""
    return bool((dataset["status"] == Status.OK).any())


def cases(dataset: xr.Dataset) -> list[str]:
    """Tell how the cases ended and along which dimensions they lie."""
    counts = status_counts(dataset)
    body: list[str] = [tag("h2", "Cases"), table(["status", "cases"], [[name, str(n)] for name, n in counts.items()])]
    above, flutter = runaways(dataset)
    if above:
        limits = dataset["critical_alpha"].where(dataset["status"] == Status.OK)
        critical = np.unique(limits.where(dataset["alpha"] > limits).values.round(12))
        text = ", ".join(f"{value:.4g}" for value in critical[np.isfinite(critical)][:5])
        body.append(
            paragraph(
                f"{above} of the ok cases lie above the critical heat coupling ({text} W/N): in permanent contact "
                "their tip would run away thermally. That is physics, not a failure."
            )
        )
    if flutter:
        body.append(
            paragraph(
                f"{flutter} of the ok cases would flutter in permanent contact below the critical heat coupling: an "
                "oscillation grows, at the growth_rate. That is physics, not a failure."
            )
        )
    entries = failures(dataset)
    if entries:
        rows = [[f.status, str(f.cases), f.first, f.message] for f in entries[:_FAILURES_SHOWN]]
        body.append(table(["status", "cases", "the first of them", "what it did"], rows))
        if len(entries) > _FAILURES_SHOWN:
            body.append(paragraph(f"… and {len(entries) - _FAILURES_SHOWN} more messages."))
    body += _decided(dataset)
    dims = [[dim, str(dataset.sizes[dim]), _listed(labels_of(dataset, dim, False, True))] for dim in case_dims(dataset)]
    if dims:
        body.append(table(["dimension", "size", "values"], dims))
    return body


def _listed(labels: list[str]) -> str:
    """Return labels side by side, of many the first and the last."""
    return "; ".join(labels if len(labels) <= _LABELS_SHOWN else [*labels[: _LABELS_SHOWN - 2], "…", labels[-1]])


def _decided(dataset: xr.Dataset) -> list[str]:
    """Tell which counts of modes tolerances decided, and the errors found with them."""
    rows = [
        [one.where, f"{one.mechanical_modes} + {one.thermal_modes}", _percent(one.error)]
        for one in decided(dataset)[:_DECIDED_SHOWN]
    ]
    return [table(["modes that the tolerance decided for", "modes", "largest known error"], rows)] if rows else []


def maps(dataset: xr.Dataset) -> Section:
    """Draw maps of a scene over two axes, of archives that hold load periods and no errors."""
    dims = map_dims(dataset)
    if dims is None or "impulse_error" in dataset or not any_ok(dataset):
        return Section([], None)
    place = middle(dataset, dims)
    pictures = [image(one, "map of the scene over two axes") for one in single_maps(dataset, dims, place)]
    if not pictures:
        return Section([], None)
    where = place_text(dataset, place)
    about = (
        f"In the middle of all other axes{f' ({where})' if where else ''}; the map below moves through all of them. "
        "Grey: the tip never touches its casing (growth: not in the first load period), or the case is not ok. Dashed: "
        "the critical coupling, above which a tip in permanent contact runs away."
    )
    body = [tag("h2", "Maps"), note(about), tag("div", *pictures, kind="panels")]
    return Section(body, scene_map(dataset, *dims))


def effects(archive: xr.Dataset, methods: Mapping[str, str]) -> list[str]:
    """Tell what each axis does, to the exact solutions where there are any, and which do less than the schemes err."""
    exact = exact_place(archive, methods) or {}
    dataset = archive.isel(exact)
    of_exact = place_text(archive, {dim: k for dim, k in exact.items() if dim != "h"})
    dims = [dim for dim in case_dims(dataset) if dataset.sizes[dim] > 1]
    if not dims or not any_ok(dataset):
        return []
    names = [name for name in METRICS if name in dataset]
    rows = [[dim, *(_percent(effect(dataset, name, dim)) for name in names)] for dim in dims]
    shown = place_text(dataset, finest(dataset))
    return [
        tag("h2", "What the axes do"),
        paragraph(
            "Largest change along each axis, all others fixed, as a share of the largest value of all cases"
            + (f": the exact solutions, {of_exact}." if of_exact else ".")
        ),
        table(["axis", *(name.replace("_", " ") for name in names)], rows),
        *_hidden(archive),
        paragraph(f"Grey: from the least to the largest ok case. The line changes one axis of {shown}."),
        image(metric_by_axis(dataset, "contact_impulse"), "contact impulse along each axis"),
        image(metric_by_axis(dataset, "max_temperature"), "largest temperature along each axis"),
    ]


def _hidden(dataset: xr.Dataset) -> list[str]:
    entries = []
    for one in hidden(dataset):
        who = "; ".join(f"{scheme} at {steps}" for scheme, steps in one.within.items())
        entries.append(
            tag(
                "li",
                f"{one.dim} changes the {one.metric.replace('_', ' ')} by {_percent(one.effect)} in the most accurate "
                f"computation, no more than the median error of {who}.",
            )
        )
    return [paragraph("Axes whose effect lies below the error:"), tag("ul", *entries)] if entries else []


def standing(dataset: xr.Dataset) -> list[str]:
    """Tell who stays stable and who is accurate, by scheme and step."""
    rows = standings(dataset)
    body = [
        [
            row.scheme,
            row.step,
            ", ".join(f"{n} {name}" for name, n in row.counts.items()),
            short(row.error),
            short(row.residual, "+.1e"),
            short(row.penetration),
            short(row.restitution, ".2g"),
            row.verdict,
        ]
        for row in rows[:_STANDINGS_SHOWN]
    ]
    head = [
        "scheme", "h", "cases", "scheme's impulse error", "energy residual", "penetration / gap", "effective e",
        "verdict",
    ]  # fmt: skip
    new = [k > 0 and row.scheme != rows[k - 1].scheme for k, row in enumerate(rows)]
    more = [paragraph(f"… and {len(rows) - len(body)} more.")] if len(rows) > len(body) else []
    return [tag("h2", "Who stays stable, who is accurate"), note(RULE), note(TERMS), table(head, body, new), *more]


def errors(dataset: xr.Dataset) -> list[str]:
    """Tell the errors against the reference by scheme and step, median and largest of all other cases."""
    if "impulse_error" not in dataset or not any_ok(dataset):
        return []
    dims, names = [dim for dim in ("scheme", "h") if dim in case_dims(dataset)], [f"{name}_error" for name in COMPARED]
    labels = {dim: labels_of(dataset, dim, named=False, rounded=True) for dim in dims}
    of_ok = dataset[names].where(dataset["status"] == Status.OK)
    others = [dim for dim in case_dims(dataset) if dim not in dims]
    medians, largest = of_ok.median(others), of_ok.max(others)
    rows = []
    for place in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        at = dict(zip(dims, place, strict=True))
        pairs = [(float(medians[name].isel(at)), float(largest[name].isel(at))) for name in names]
        rows.append([labels[dim][k] for dim, k in at.items()] + [f"{short(a)} / {short(b)}" for a, b in pairs])
    about = paragraph(
        "Relative L2 distance from the reference, median / largest of the ok cases over all other axes; reduced models "
        f"carry their own error. Predictability of the references: {float(dataset['predictability'].max()):.1e}, the "
        "change of a reference when its gap changes by 1e-12."
    )
    head = [*dims, *(name.replace("_", " ") for name in names)]
    return [tag("h2", "Errors"), about, table(head, rows)]


def precision(dataset: xr.Dataset) -> Section:
    """Draw speed against error where an archive has both, and name the observed orders."""
    if "impulse_error" not in dataset or dataset.sizes.get("h", 1) < 3 or not any_ok(dataset):
        return Section([], None)
    fewest = _fewest_modes(dataset)
    shown = place_text(dataset, {dim: k for dim, k in finest(dataset).items() if dim not in ("scheme", "h")})
    orders = [
        [line.scheme, *(" / ".join(short(one, "z.2f") for one in line.orders[name]) for name in ERRORS), _limit(line)]
        for line in lines(dataset)
        if not line.exact
    ]
    figure = work_precision(dataset, dataset.isel(fewest) if fewest else None)
    body = [
        tag("h2", "Speed against error"),
        paragraph(
            f"{shown or 'The only scene'}. Times are those of this run on its machine, with whatever else ran there; "
            "the share of a case in its batch."
        ),
        image(figure, "relative error against processor seconds per simulated second"),
        image(convergence(dataset), "relative error, penetration and energy residual against the step"),
        paragraph("Observed orders: slopes of log error over log h of three errors or more below 0.1; rms about them:"),
        table(["scheme", *(f"{one}: order / scatter" for one in ERRORS.values()), "last stable step [s]"], orders),
    ]
    return Section(body, figure)


def _limit(line: Line) -> str:
    steps = line.stable_steps()
    return "every h" if not line.lost.any() else f"{steps[0]:.6g}" if steps else "none"


def _fewest_modes(dataset: xr.Dataset) -> dict[str, int]:
    """Return where the reduced model with the fewest modes lies along the dimensions of the counts of modes."""
    dims = {
        str(dim) for name in MODES if name in dataset.coords for dim in dataset[name].dims if dataset.sizes[dim] > 1
    }
    return {dim: int(np.argmin(modes_along(dataset, dim))) for dim in dims}


def _percent(share: float) -> str:
    if not np.isfinite(share):
        return "–"
    if share < 1e-12:  # rounding
        return "0"
    return f"{100 * share:.0f} %" if share > 0.095 else f"{100 * share:.2g} %"
