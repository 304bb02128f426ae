"""One self-contained HTML page of an archive, with the figure it is built around beside it."""

from __future__ import annotations

import base64
import html
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import case_dims, effect, failures, labels_of
from workflow.archive import ArchiveError, open_archive, provenance
from workflow.plots import metric_by_axis, overview, save
from workflow.run import status_counts

if TYPE_CHECKING:
    import xarray as xr

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
table { border-collapse: collapse; } th, td { padding: .25rem .8rem; text-align: left; border-bottom: 1px solid #ddd; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; } pre { background: #f6f6f6; padding: .8rem; overflow-x: auto; font-size: 12px; }
.muted { color: #666; }
"""

_METRICS = ("contact_impulse", "impacts", "max_temperature", "max_penetration")
_ERRORS = ("displacement_error", "temperature_error", "impulse_error")
_FAILURES_SHOWN = 20


@dataclass(frozen=True)
class Written:
    """Where a report and its figure are."""

    page: Path
    figure: Path | None


def write_report(archive: Path, page: Path | None = None) -> Written:
    """Write the report of an archive: ``ARCHIVE.html``, and its main figure as ``ARCHIVE.png``.

    Raises
    ------
    ArchiveError
        There is no such archive, or the report would overwrite it.
    OSError
        The page cannot be written.
    """
    page = page or archive.with_suffix(".html")
    if not page.name:
        raise ArchiveError(f"{page}: a directory, not a page; name a file, e.g. {archive.stem}.html")
    picture = page.with_suffix(".png")
    if len({archive.resolve(), page.resolve(), picture.resolve()}) < 3:
        raise ArchiveError(
            f"{page}: the archive {archive}, the page and the picture {picture} would be one file; "
            f"choose another page with -o, e.g. {archive.stem}-report.html"
        )
    with open_archive(archive) as dataset:
        figure_path = None
        body = [f"<h1>{html.escape(str(dataset.attrs.get('title', archive.name)))}</h1>"]
        body.append(f'<p class="muted">{html.escape(str(dataset.attrs.get("summary", "")))}</p>')
        body += _cases(dataset)
        if any(name in dataset for name in ("displacement", "temperature", "contact_force")) and _any_ok(dataset):
            figure = overview(dataset)
            figure_path = save(figure, picture)
            body += ["<h2>Tip response</h2>", _image(figure, "tip response")]
        if any(dataset.sizes[dim] > 1 for dim in case_dims(dataset)) and _any_ok(dataset):
            body += ["<h2>What the axes do</h2>", _effects(dataset)]
            body += [_image(metric_by_axis(dataset, name), name) for name in ("contact_impulse", "max_temperature")]
        if "impulse_error" in dataset and _any_ok(dataset):
            body += ["<h2>Errors</h2>", _errors(dataset)]
        body += _provenance(archive)
    page.write_text(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        f"<title>{html.escape(archive.name)}</title><style>{_STYLE}</style></head><body>"
        + "\n".join(body)
        + "</body></html>\n",
        encoding="utf-8",
    )
    return Written(page, figure_path)


def _any_ok(dataset: xr.Dataset) -> bool:
    return bool((dataset["status"] == 0).any())


def _image(figure: Any, about: str) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=130, format="png")
    data = base64.b64encode(buffer.getvalue()).decode()
    return f'<p><img alt="{html.escape(about)}" src="data:image/png;base64,{data}"></p>'


def _table(head: list[str], rows: list[list[str]]) -> str:
    def cell(text: str) -> str:
        number = text.replace(".", "").replace("e", "").replace("-", "").replace("+", "").rstrip(" %").isdigit()
        return f"<td{' class=number' if number else ''}>{html.escape(text)}</td>"

    top = "".join(f"<th>{html.escape(text)}</th>" for text in head)
    body = "".join(f"<tr>{''.join(cell(text) for text in row)}</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"


def _cases(dataset: xr.Dataset) -> list[str]:
    counts = status_counts(dataset)
    found = ["<h2>Cases</h2>", _table(["status", "cases"], [[name, str(n)] for name, n in counts.items()])]
    runaway = int(((dataset["runaway"] == 1) & (dataset["status"] == 0)).sum())
    if runaway:
        critical = np.unique(np.round(np.asarray(dataset["critical_alpha"].values, dtype=float), 12))
        text = ", ".join(f"{value:.4g}" for value in critical[np.isfinite(critical)][:5])
        found.append(
            f"<p>{runaway} of the ok cases lie above the critical heat coupling ({text} m/s): in permanent "
            "contact their tip would run away thermally. That is physics, not a failure.</p>"
        )
    told = failures(dataset)
    if told:
        rows = [[f.status, str(f.cases), f.first, f.message] for f in told[:_FAILURES_SHOWN]]
        found.append(_table(["status", "cases", "the first of them", "what it did"], rows))
        if len(told) > _FAILURES_SHOWN:
            found.append(f"<p>… and {len(told) - _FAILURES_SHOWN} more messages.</p>")
    dims = [
        [dim, str(dataset.sizes[dim]), "; ".join(labels_of(dataset, dim, named=False)[:8])]
        for dim in case_dims(dataset)
    ]
    if dims:
        found.append(_table(["dimension", "size", "values"], dims))
    return found


def _effects(dataset: xr.Dataset) -> str:
    dims = [dim for dim in case_dims(dataset) if dataset.sizes[dim] > 1]
    names = [name for name in _METRICS if name in dataset]
    rows = []
    for dim in dims:
        shares = [effect(dataset, name, dim) for name in names]
        rows.append([dim, *(_percent(share) for share in shares)])
    about = "<p>Largest change along each axis, all others fixed, as a share of the largest value of all cases.</p>"
    return about + _table(["axis", *(name.replace("_", " ") for name in names)], rows)


def _errors(dataset: xr.Dataset) -> str:
    """Tell the errors against the reference by scheme and step, median and largest of all other cases."""
    dims = [dim for dim in ("scheme", "h") if dim in case_dims(dataset)]
    labels = {dim: labels_of(dataset, dim, named=False) for dim in dims}
    rows = []
    for index in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        chosen = dataset.isel(dict(zip(dims, index, strict=True)))
        row = [labels[dim][k] for dim, k in zip(dims, index, strict=True)]
        for name in _ERRORS:
            values = np.asarray(chosen[name].values, dtype=float)
            values = values[np.isfinite(values)]
            row.append(f"{np.median(values):.1e} / {values.max():.1e}" if values.size else "–")
        rows.append(row)
    about = (
        "<p>Relative L2 distance from the reference, median / largest over all other axes; reduced models "
        f"carry their own error in it. Predictability of the references: {_largest(dataset, 'predictability'):.1e}.</p>"
    )
    return about + _table([*dims, *(name.replace("_", " ") for name in _ERRORS)], rows)


def _largest(dataset: xr.Dataset, name: str) -> float:
    values = np.asarray(dataset[name].values, dtype=float)
    return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")


def _percent(share: float) -> str:
    if not np.isfinite(share):
        return "–"
    if share < 1e-12:  # rounding
        return "0"
    return f"{100 * share:.0f} %" if share > 0.095 else f"{100 * share:.2g} %"


def _provenance(archive: Path) -> list[str]:
    told = provenance(archive)
    rows = [
        [name, told[name]] for name in ("content_hash", "solver_version", "code_revision", "platform") if name in told
    ]
    return [
        "<h2>Where this comes from</h2>",
        _table(["", ""], rows),
        f"<pre>{html.escape(told.get('study', ''))}</pre>",
    ]
