"""The interactive part of a report: what its script reads of the cases or branches of an archive.

Numbers stand in the page as JSON, rounded to what a screen shows; so many that a page stays one that goes through the
mail, about 6 MB.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow import analysis
from workflow.plots import COLOURS, HISTORIES
from workflow.plots._units import axis_of, coordinate_texts, scaled
from workflow.report._figures import MARKS, ORBIT, branch_figures, case_figures, drawn
from workflow.report._html import block
from workflow.schemes import Status
from workflow.study import MODES

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

MOST_VALUES = 2000
"""Values of an axis that a page holds; of a longer one evenly spread ones."""

MOST_CASES = 250_000

MOST_NUMBERS = 2_000_000
"""Metrics of all cases that a page holds, each about half a character."""

MOST_SAMPLES = 1_500_000
"""Samples of histories, load periods and orbits that a page holds, each one to two characters."""

MOST_KEPT = 1500
"""Cases whose histories a page holds at most: beyond, reading them takes longer than anybody looks."""

BUCKETS, MOST_BUCKETS = 300, 2400
"""Pieces of the duration of each of which a thinned history keeps the least and the largest value: of many cases, and
of few."""

MOST_READ = 64 * 2**20
"""Bytes of a variable up to which it is read whole; scattered reads take longer."""

ALIKE = 1e-3
"""Share of the largest by which impulses of periods differ at least for their axis to span their range only."""

_OF_CONTACTS, _CONTACT = "all_contacts", "of_contact"
"""Impulses or forces of all contacts in an archive at one of them, and their dimension."""

_LONGEST_MESSAGE = 300
"""Characters of a message that a page repeats."""

_DERIVED: dict[str, Callable[[xr.Dataset], NDArray[Any] | None]] = {
    "error": analysis.total_error,
    "scheme_error": partial(analysis.total_error, part="scheme_"),
    "model_error": partial(analysis.total_error, part="model_"),
    "impulse_growth": analysis.impulse_growth,
}
"""What a page derives from the variables of an archive; ``None`` where it lacks them."""

_FIRST = (*_DERIVED, "processor_time", "runaway", "steady_state")
"""Metrics that come first where not all fit."""

_EXPLAINED = {
    "error": "largest relative L2 distance of displacement, temperature and impulse from the reference",
    "scheme_error": "largest part of the scheme in the errors: against the exact solution of the same reduced model",
    "model_error": "largest part of the reduced model in the errors: its exact solution against the reference",
    "impulse_growth": "impulse of the last complete load period over that of the first",
    "runaway": "1: in permanent contact the tip grows without bound; it need not touch",
    "energy_residual": "energy that the scheme itself creates (+) or takes (−), as a share of the largest energy",
    "effective_restitution": "speed after over speed before an impact, which a scheme without e gives by itself",
}
"""Short meanings for a reader of the page, in place of the archive's definitions."""


def explored_cases(
    dataset: xr.Dataset,
    archive: str,
    choice: analysis.Choice | None,
    methods: Mapping[str, str],
    scene: Mapping[str, Any],
) -> dict[str, Any]:
    """Return what the page's template and script need of the cases of the archive in a file of that name.

    ``choice`` is what it recommends or comes nearest to it; ``methods`` and ``scene`` are those of
    :func:`workflow.report._sections.study_of`.
    """
    notable = analysis.notable_cases(dataset, choice)
    shown = shown_part(dataset, notable)
    about = described(shown.dataset, shown.cases, methods, scene)
    about |= {"archive": repr(archive), "chosen_modes": _chosen_modes(dataset, choice)}
    figures = case_figures(about)
    unfit = ["metrics that do not fit: " + ", ".join(about["left_out"])] if about["left_out"] else []
    return {
        "figures": list(figures),
        "contact": analysis.contact_text(dataset),
        "omitted": [*shown.left_out, *unfit],
        "metrics": [metric["name"] for metric in about["metrics"]],
        "is_auto": "auto" in (about["chosen_modes"] or ()),
        "worth_a_look": list(_worth_a_look(notable.values(), shown.cases, about["dims"])),
        "data": block({"about": about, **drawn(figures)}),
    }


def with_contacts(dataset: xr.Dataset, archive: xr.Dataset) -> xr.Dataset:
    """Return an archive at one of its contacts with the impulses, or else the forces, of all that it keeps."""
    kept = next((archive[name] for name in ("impulse", "contact_force") if name in archive), None)
    if kept is None or not analysis.is_of_contacts(archive):
        return dataset
    return dataset.assign({_OF_CONTACTS: kept.rename(contact=_CONTACT)})


def explored_branches(dataset: xr.Dataset, variable: str) -> dict[str, Any]:
    """Return what the page's template and script need of an archive's branches."""
    figures, orbits = branch_figures(dataset, variable)
    curves = orbits[..., :: -(-orbits.size // MOST_SAMPLES)]
    about = {"orbits": [[closed(curve) for curve in orbit] for orbit in curves]}
    return {"figures": list(figures), "data": block({"about": about, **drawn(figures)})}


def _chosen_modes(dataset: xr.Dataset, choice: analysis.Choice | None) -> list[str] | None:
    """Return the mode counts of the study's own choice, as the page writes them: ``auto``, else what is recommended."""
    values = [dataset[name].values.ravel() for name in MODES if name in dataset.coords]
    if len(values) == 2 and any((one == -1).any() for one in values):
        return ["auto" if (one == -1).any() else str(one[-1]) for one in values]
    if choice is None or not all(name in choice.settings for name in MODES):
        return None
    return [str(choice.settings[name]) for name in MODES]


def _worth_a_look(
    reasons: Iterable[str], cases: Sequence[int], dims: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[str, str, int]]:
    """Yield why each notable case is worth a look, where it lies and its number."""
    shape = [len(dim["texts"]) for dim in dims]
    for why, case in zip(reasons, cases, strict=True):
        place = np.unravel_index(case, shape) if shape else ()
        named = [f"{d['title']} {d['texts'][k]} {d['unit']}".strip() for d, k in zip(dims, place, strict=True)]
        varied = [text for text, size in zip(named, shape, strict=True) if size > 1]
        yield why, ", ".join(varied) or "the only case", case


class Shown(NamedTuple):
    """The part of an archive that a page holds, the numbers of its notable cases, and a remark on each axis cut."""

    dataset: xr.Dataset
    cases: tuple[int, ...]
    left_out: tuple[str, ...]


def shown_part(dataset: xr.Dataset, notable: Iterable[int]) -> Shown:
    """Return the cases that a page holds: all, or evenly spread values of the longest axes and the notable cases."""
    dims, shape = analysis.case_dims(dataset), dataset["status"].shape
    places = [np.unravel_index(case, shape) if shape else () for case in notable]
    most = dict.fromkeys(dims, MOST_VALUES)
    while np.prod([min(n, most[dim]) for dim, n in zip(dims, shape, strict=True)]) > MOST_CASES:
        longest = max(dims, key=lambda dim: min(dataset.sizes[dim], most[dim]))
        most[longest] = 7 * min(dataset.sizes[longest], most[longest]) // 8
    kept, remarks, first = [np.arange(size) for size in shape], [], analysis.finest(dataset)
    for k, (dim, size) in enumerate(zip(dims, shape, strict=True)):
        if size > most[dim]:
            even = np.linspace(0, size - 1, most[dim]).round().astype(int)
            kept[k] = np.unique([*even, first[dim], *(int(place[k]) for place in places)])
            remarks.append(f"{dim.replace('_', ' ')}: {len(kept[k])} of its {size} values")
    part = _part(dataset, dict(zip(dims, kept, strict=True))) if remarks else dataset
    moved = [tuple(map(np.searchsorted, kept, place)) for place in places]
    cases = tuple(int(np.ravel_multi_index(place, part["status"].shape)) if place else 0 for place in moved)
    return Shown(part, cases, tuple(remarks))


def _part(dataset: xr.Dataset, kept: Mapping[str, NDArray[np.int64]]) -> xr.Dataset:
    """Return the kept places of an archive; variables that are small are read whole."""
    small = [name for name, array in dataset.data_vars.items() if array.dtype.kind != "O" and array.nbytes <= MOST_READ]
    return dataset.isel(kept).assign({name: dataset[name].compute().isel(kept) for name in small})


def described(
    part: xr.Dataset, first: Sequence[int], methods: Mapping[str, str], scene: Mapping[str, Any]
) -> dict[str, Any]:
    """Return what the page's script reads of the cases of :func:`shown_part`, by name.

    The histories of the cases ``first`` come first, and the first of all is the one shown; ``methods`` and ``scene``
    are those of :func:`workflow.report._sections.study_of`.
    """
    status = np.asarray(part["status"].values).ravel()
    partners = analysis.exact_partners(part, methods)
    metrics, left_out = _metrics(part, status == Status.OK)
    of_cost = next((metric["factor"] for metric in metrics if metric["name"] == "processor_time"), 1.0)
    schemes = np.atleast_1d(part["scheme"].values).tolist() if "scheme" in part.coords else ["the scheme"]
    return {
        "statuses": [status.name.lower().replace("_", "-") for status in Status],
        "colours": COLOURS,
        "markers": MARKS,
        "dims": [axis_of(part, dim) for dim in analysis.case_dims(part)],
        "scheme_dim": (scheme_dim := _place_of(part, "scheme")),
        "schemes": schemes if scheme_dim is None else axis_of(part, analysis.case_dims(part)[scheme_dim])["texts"],
        "h_dim": _place_of(part, "h"),
        "numerical": [analysis.case_dims(part).index(dim) for dim in analysis.numerical_dims(part)],
        "h": np.atleast_1d(part["h"].values) if "h" in part.coords else np.zeros(0),
        "cost_unit": of_cost * float(part.attrs.get("duration", 1.0)),
        "start": first[0],
        "status": status,
        "exact": partners,
        "metrics": metrics,
        "left_out": left_out,
        "order": _orders(part),
        "modes": _modes(part),
        "cases": _cases(part, _order(part, first, partners), scene),
    }


def _place_of(part: xr.Dataset, name: str) -> int | None:
    """Return the position among the dimensions of the one along which a coordinate lies."""
    dims, along = analysis.case_dims(part), part[name].dims if name in part.coords else ()
    return dims.index(str(along[0])) if len(along) == 1 and along[0] in dims else None


def three_digits(values: Array) -> Array:
    """Return numbers with the three digits that a page shows; what is not finite is NaN."""
    values = np.where(np.isfinite(values), values, np.nan)
    sizes = np.clip(np.abs(values), 1e-300, 1e300)
    places = 2 - np.floor(np.log10(sizes))
    up, down = 10.0 ** np.maximum(places, 0), 10.0 ** np.maximum(-places, 0)
    return np.asarray(np.rint(values * up / down) / up * down)


def _metrics(part: xr.Dataset, ok: NDArray[np.bool_]) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the metrics of all cases, the most useful first, and the names of those for which there is no room."""
    dims = part["status"].dims
    there = [str(name) for name in part.data_vars if part[name].dims == dims and part[name].dtype.kind == "f"]
    there = [name for name in there if name != "batch_width"]  # it explains costs, see processor_time
    there += [name for name in ("runaway", "steady_state") if name in part and part[name].dims == dims]
    ranked = [name for name in _FIRST if name in there or name in _DERIVED]
    entries: list[dict[str, Any]] = []
    left = []
    for name in [*ranked, *(name for name in there if name not in ranked)]:
        derived = name in _DERIVED
        values = _DERIVED[name](part) if derived else np.asarray(part[name].values, dtype=float)
        if values is None or not np.isfinite(values).any():
            continue
        if (len(entries) + 1) * ok.size > MOST_NUMBERS and entries:
            left.append(name.replace("_", " "))
            continue
        values = np.where(ok, values.ravel(), np.nan)
        unit, factor = scaled("1" if derived else str(part[name].attrs.get("units", "1")), values)
        shown = three_digits(factor * values)
        entries.append(
            {
                "name": name,
                "title": name.replace("_", " "),
                "unit": unit,
                "factor": factor,
                "about": _EXPLAINED.get(name) or str(part[name].attrs.get("long_name", "")),
                "varies": np.unique(shown[np.isfinite(shown)]).size > 1,
                "words": str(part[name].attrs["flag_meanings"]).split() if name == "steady_state" else None,
                "values": shown,
            }
        )
    return entries, left


def _orders(part: xr.Dataset) -> Array | None:
    """Return the observed order of the scheme in the scene of each case, of its part of the largest error."""
    error = analysis.total_error(part, "scheme_")
    error = analysis.total_error(part) if error is None else error
    if error is None or _place_of(part, "h") is None:
        return None
    status = part["status"]
    orders = analysis.observed_order(part.assign(error=(status.dims, error)), "error")["order"]
    return np.asarray(orders.broadcast_like(status).transpose(*status.dims).values).ravel().round(2) + 0.0  # no -0.00


def _modes(part: xr.Dataset) -> dict[str, Any] | None:
    """Describe the reduced models of an archive: the mode counts of every place along the dimensions they lie on."""
    if not all(name in part.coords for name in MODES) or not any(
        part[name].ndim and part[name].size > 1 for name in MODES
    ):
        return None
    return {name: {"dim": _place_of(part, name), "texts": coordinate_texts(part[name])[1]} for name in MODES}


def _order(part: xr.Dataset, first: Sequence[int], partners: NDArray[np.int64]) -> list[int]:
    """Return every case once: notable ones, neighbours of the first along every axis, then the largest errors.

    Before each comes its exact partner. Without errors the cases of the rest are spread evenly, by a fixed shuffle.
    """
    shape, size = part["status"].shape, part["status"].size
    numbers, place = np.arange(size).reshape(shape), list[Any](np.unravel_index(first[0], shape) if shape else ())
    neighbours = [numbers[(*place[:axis], slice(None), *place[axis + 1 :])] for axis in range(len(shape))]
    rest = np.random.default_rng(0).permutation(size)
    error = analysis.total_error(part)
    if error is not None:
        rank = np.where(np.isfinite(error), error, -1.0).ravel()[rest]
        rest = rest[np.argsort(-rank, kind="stable")]
    ranked = np.concatenate([first, *neighbours, rest])
    pairs = np.stack([partners[ranked], ranked], axis=1).ravel()
    return list(dict.fromkeys(pairs[pairs >= 0].tolist()))


def _cases(part: xr.Dataset, order: Sequence[int], scene: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return histories, load periods and orbits of the first cases of an order, as many as a page holds.

    ``None`` where the archive keeps none of these.
    """
    if "growth_rate" in part:  # nothing is to be extrapolated where contact does not heat
        part = part.assign(growth_rate=part["growth_rate"].where(part["alpha"] > 0))
    names = [name for name in HISTORIES if name in part] if "t" in part.coords and part.sizes["t"] > 1 else []
    orbits = ORBIT if ORBIT[0] in part and "point" not in part.dims else ()
    contacts = part.sizes.get(_CONTACT, 0)
    others = [*orbits, *(name for name in ("period_impulse", "growth_rate") if name in part)]
    has_worn = "worn_depth" in part
    if not names and not orbits and "period_impulse" not in part and not has_worn:
        return None
    dims, samples = analysis.case_dims(part), part.sizes.get("t", 0)
    rows = len(names) + contacts
    size = rows * min(samples, 2 * BUCKETS) + sum(part[name][dict.fromkeys(dims, 0)].size for name in others)
    kept = order[: min(MOST_KEPT, max(1, MOST_SAMPLES // size))]
    buckets = int(np.clip(MOST_SAMPLES // (2 * len(kept) * max(rows, 1)), BUCKETS, MOST_BUCKETS))
    others += [_OF_CONTACTS] if contacts else []
    others += ["worn_depth"] if has_worn else []
    has_gap = "displacement" in names and "gap" in part.coords
    units = {name: _unit(part, name) for name in [*names, *orbits[:1]]}
    worn_unit = scaled("m", part["worn_depth"].values) if has_worn else ("", 1.0)
    is_small = sum(part[name].nbytes for name in [*names, *others]) <= MOST_READ
    read = {name: part[name].values if is_small else part.variables[name] for name in [*names, *others]}
    of_scene, status = _of_scene(part), np.asarray(part["status"].values)
    changing = [dim for dim in dims if dim in of_scene.dims]

    @cache
    def frequency_and_gap(*at: int) -> tuple[float, Array | None]:
        """Return the gap as two equal numbers, or the motion of the casing at the times of the histories."""
        here = of_scene.isel(dict(zip(changing, at, strict=True)))
        frequency = analysis.period_frequency(here, scene)
        if not has_gap:
            return frequency, None
        motion, factor = analysis.casing_motion(here), units["displacement"][1]
        if motion is None:
            return frequency, np.full(2, factor * float(analysis.gap_of(here)))
        return frequency, on_screen(factor * thinned(motion[0], buckets))

    t = thinned_times(np.asarray(part["t"].values, dtype=float), buckets) if names else np.zeros(0)
    entries = {}
    for case in kept:
        place = tuple(map(int, np.unravel_index(case, status.shape))) if status.shape else ()
        frequency, gap = frequency_and_gap(*(place[dims.index(dim)] for dim in changing))
        values = {
            name: np.asarray(array[place], dtype=float) * units.get(name, ("", 1.0))[1] for name, array in read.items()
        }
        curves = {name: on_screen(thinned(values[name], buckets)) for name in names}
        entry: dict[str, Any] = {"curves": curves, "window": _window(t, frequency), "gap": gap}
        if contacts:
            entry["contacts"] = _contacts(part, values[_OF_CONTACTS], 2 * buckets)
        if "period_impulse" in values:
            entry["periods"] = per_period(values["period_impulse"], float(values.get("growth_rate", np.nan)), frequency)
        if has_worn:
            entry["worn"] = _worn(values["worn_depth"], worn_unit)
        if orbits and np.isfinite(values[ORBIT[0]]).all():
            entry["orbit"] = [closed(values[name]) for name in orbits]
        if status[place] != Status.OK and "message" in part:
            entry["message"] = str(part.variables["message"][place].values)[:_LONGEST_MESSAGE]
        entries[str(case)] = entry
    return {
        "histories": names,
        "contacts": contacts,
        "titles": [f"{HISTORIES[name]} [{units[name][0]}]" for name in names],
        "t": t,
        "worn_unit": worn_unit[0],
        "orbit_unit": units[orbits[0]][0] if orbits else None,
        "thinned": samples > 2 * buckets and bool(names),
        "entries": entries,
    }


def _worn(depth: Array, unit: tuple[str, float]) -> dict[str, Any]:
    """Return the worn depth of a case over the angle [°], a level for each sector or of many their extremes."""
    depth = depth[np.isfinite(depth)] * unit[1]
    edges = np.linspace(0.0, 360.0, depth.size + 1)
    angle, level = np.repeat(edges, 2)[1:-1], np.repeat(depth, 2)
    if depth.size > 2 * BUCKETS:
        angle, level = thinned_times(edges[:-1], BUCKETS), thinned(depth, BUCKETS)
    largest, mean = (f"{of(depth):.3g} {unit[0]}" if depth.size else "unknown" for of in (np.max, np.mean))
    return {"angle": angle, "depth": on_screen(level), "text": f"At the end; largest {largest}, mean {mean}."}


def _contacts(part: xr.Dataset, history: Array, most: int) -> dict[str, Any]:
    """Return names and mean forces of contacts in pieces of the duration, N, of the largest impulse first.

    The history holds the impulses of the contacts or their mean forces, ``(contact, t)``.
    """
    t, names = part["t"].values, part[_CONTACT].values
    is_force = str(part[_OF_CONTACTS].attrs["units"]) == "N"
    impulse = np.cumsum(history * np.diff(t, prepend=0.0), axis=1) if is_force else history
    edges = np.linspace(0, t.size - 1, min(t.size - 1, most) + 1).round().astype(int)
    order = np.argsort(-impulse[:, -1], kind="stable")
    force = np.diff(impulse[order][:, edges]) / np.diff(t[edges])
    return {"names": [str(name) for name in names[order]], "force": on_screen(force)}


def _of_scene(part: xr.Dataset) -> xr.Dataset:
    """Return the coordinates on which the motion of load and casing depends."""
    paths = {name: str(coordinate.attrs.get("study_path", "")) for name, coordinate in part.coords.items()}
    named = {"gap", "t", "contact_angle"}
    return part.coords.to_dataset()[[n for n, path in paths.items() if n in named or path.startswith("scene.")]]


def _unit(part: xr.Dataset, name: str) -> tuple[str, float]:
    """Return the unit of a history and the factor to it; it fits the gap or, without one, the usual case."""
    if name == ORBIT[0]:
        return scaled("m", part[name].values)
    size: Any = part["gap"].values if name == "displacement" and "gap" in part.coords else 1.0
    if not np.any(size):
        size = part[name].isel(dict.fromkeys(analysis.case_dims(part), 0)).values
    return scaled(str(part[name].attrs.get("units", "1")), size)


def _window(t: Array, frequency: float) -> dict[str, Any] | None:
    """Return from when on histories of many load periods are shown, the last of them, and a remark."""
    periods, shown = frequency * np.ptp(t) if t.size else 0.0, 20
    if not (periods > 40 and t.size > 6 * periods):
        return None
    text = f"The last {shown} of {periods:.0f} load periods; the reset tool shows all."
    return {"start": t[-1] - shown / frequency, "text": text}


def per_period(impulse: Array, growth: float, frequency: float) -> dict[str, Any]:
    """Return the impulse of the load periods, what the growth rate of permanent contact predicts, and a remark."""
    impulse = impulse[np.isfinite(impulse)]
    count = impulse.size
    if not count:
        return {"text": "This case has no impulses of load periods."}
    low, high, largest, text = impulse.min(), impulse.max(), np.abs(impulse).max(), f"{count} load periods."
    predicted = np.full(count, np.nan)
    if low < high < low + ALIKE * largest:
        text += f" They differ by {(high - low) / largest:.1e} of the largest."
    if count > 1 and np.isfinite(growth) and frequency > 0:
        with np.errstate(over="ignore", invalid="ignore"):
            factor, k = np.exp(growth / frequency), np.arange(1.0 - count, 1.0)
            powers = k if factor == 1 else factor * (factor**k - 1) / (factor - 1)  # Σ factor^j, j = 1 … k
            predicted = impulse[-1] + (impulse[-1] - impulse[-2]) * powers
        margin = 0.3 * (high - low or abs(high))
        predicted[~((predicted >= max(0.0, low - margin)) & (predicted < high + margin))] = np.nan
        text += (
            " Dashed: the last two periods extrapolated as if contact were permanent (changes grow "
            f"{factor:.3g}-fold per period)."
        )
    least, most = np.nanmin([*impulse, *predicted]), np.nanmax([*impulse, *predicted])
    margin = max(0.06 * (most - least), 0.5 * (ALIKE * largest - (most - least))) or 1.0  # alike: a level line
    return {"impulse": impulse, "predicted": predicted, "range": [least - margin, most + margin], "text": text}


def thinned_times(t: Array, buckets: int) -> Array:
    """Return the times at which :func:`thinned` values are drawn."""
    if t.size <= 2 * buckets:
        return t
    edges = np.linspace(t[0], t[-1], buckets, endpoint=False)
    return np.asarray(np.repeat(edges, 2) + np.tile([0.25, 0.75], buckets) * (t[-1] - t[0]) / buckets)


def thinned(values: Array, buckets: int) -> Array:
    """Return the least and the largest value of every piece of a history, in the order in which they occur.

    A history of at most two samples a piece stays as it is. A piece with a sample that is not finite is NaN.
    """
    if values.size <= 2 * buckets:
        return values
    edges = np.linspace(0, values.size, buckets + 1).round().astype(int)
    inside = edges[:-1, None] + np.arange(np.diff(edges).max())
    pieces = np.where(np.isfinite(values), values, np.nan)[np.minimum(inside, edges[1:, None] - 1)]
    extremes = np.sort(np.stack([pieces.argmin(axis=1), pieces.argmax(axis=1)], axis=1), axis=1)
    return np.take_along_axis(pieces, extremes, axis=1).ravel()


def on_screen(values: Array) -> Array:
    """Return a curve rounded to 1/500 of its range or finer: half of that is a fifth of a pixel of a panel's height."""
    finite = values[np.isfinite(values)]
    span = float(np.max(finite) / 2 - np.min(finite) / 2) if finite.size else 0.0
    if span == 0 or abs(np.log10(span)) > 290:  # a power of ten beyond would overflow
        return values
    return np.round(values, int(np.ceil(np.log10(250 / span))))


def closed(curve: Array) -> Array:
    """Return a curve of a period on a screen, back to its first sample."""
    return on_screen(np.append(curve, curve[:1]))
