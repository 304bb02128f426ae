"""Who stays stable and who is accurate: errors over steps, observed orders and the standing of every scheme."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import case_dims, finest, labels_of, most_loaded
from workflow.analysis._recommend import USUAL_TOLERANCES, Choice, NoReferenceError, most_accurate, simulated_seconds
from workflow.analysis._recommend_words import percent
from workflow.analysis._scene import gap_of
from workflow.schemes import Status

if TYPE_CHECKING:
    import xarray as xr

ERRORS = {"impulse_error": "impulse", "temperature_error": "temperature", "displacement_error": "displacement"}
"""Errors of an archive and what they are of; the impulse first, as displacement flatters."""

ASYMPTOTIC = 0.1
"""Errors above are no longer of the order of a scheme: a tenth of the solution itself."""

SENSELESS = 3.0
"""Errors above have left the solution by more than its own size and sign: an unstable contact, though ok by
the theory of the free step."""

UNPREDICTABLE = 10.0
"""Errors count as a scheme's own above so many times what a gap opened by 1e-12 changes."""

LEAST_STEPS = 3
"""Steps that an order is fitted to at least: two always lie on a line."""

Array = NDArray[np.float64]


def observed_order(dataset: xr.Dataset, error: str = "impulse_scheme_error") -> xr.Dataset:
    """Return the observed order of convergence of every case: the slope of log error over log h by least squares.

    Steps count whose case is ok and whose error is below a tenth of the solution (:data:`ASYMPTOTIC`) and above ten
    times (:data:`UNPREDICTABLE`) what a change of the gap by 1e-12 makes of the reference.

    Parameters
    ----------
    dataset
        An archive whose study has a reference and several steps ``h``.
    error
        Which error: the scheme's part of ``displacement``, ``temperature`` or ``impulse``, which a reduced model does
        not hide, or without ``_scheme`` in its name the whole.

    Returns
    -------
    xarray.Dataset
        ``order`` and ``scatter``, the root mean square of log10 error about the line, over all dimensions of the cases
        but that of ``h``; NaN where fewer than three steps count, and where no step changes the error.

    Raises
    ------
    ValueError
        The dataset has no such error, or one step only.
    """
    import xarray as xr

    if error not in dataset:
        raise ValueError(f"the dataset has no `{error}`; errors need a `reference` in the study")
    if "h" not in dataset.coords or dataset["h"].ndim != 1:
        raise ValueError("the dataset has one step h; an order needs three")
    dim = str(dataset["h"].dims[0])
    errors = dataset[error].where(dataset["status"] == Status.OK)
    if "predictability" in dataset:
        errors = errors.where(errors > UNPREDICTABLE * dataset["predictability"].fillna(0.0))
    errors = errors.transpose(..., dim)
    order, scatter = _fitted(np.asarray(dataset["h"].values, dtype=float), np.asarray(errors.values, dtype=float))
    dims, what = errors.dims[:-1], error.replace("_", " ")
    about = {"units": "1", "long_name": f"observed order of the {what} in h"}
    about_scatter = {"units": "1", "long_name": f"root mean square of log10 of the {what} about the line of the order"}
    variables = {"order": (dims, order, about), "scatter": (dims, scatter, about_scatter)}
    return xr.Dataset(variables, errors.isel({dim: 0}, drop=True).coords)


def _fitted(h: Array, errors: Array) -> tuple[Array, Array]:
    """Return slope and scatter of log10 error over log10 h by least squares, of errors ``(…, h)``."""
    with np.errstate(invalid="ignore", divide="ignore"):
        used = (errors > 0) & (errors < ASYMPTOTIC)
        count = used.sum(axis=-1)
        x, y = (
            np.where(used, value - (np.where(used, value, 0.0).sum(axis=-1) / count)[..., None], 0.0)
            for value in (np.log10(h), np.log10(np.where(used, errors, 1.0)))
        )
        slope = (x * y).sum(axis=-1) / (x * x).sum(axis=-1)
        scatter = np.sqrt(((y - slope[..., None] * x) ** 2).sum(axis=-1) / count)
    is_line = (count >= LEAST_STEPS) & np.any(errors != errors[..., :1], axis=-1)
    return np.where(is_line, slope, np.nan), np.where(is_line, scatter, np.nan)


@dataclass(frozen=True, eq=False)
class Line:
    """One scheme through its steps, all other axes fixed."""

    scheme: str
    """Its label."""
    h: Array
    """Steps in ascending order, s, shape ``(h,)``."""
    errors: dict[str, Array]
    """By name, each ``(h,)``; NaN where the case is not ok."""
    seconds: Array
    """Processor seconds per simulated second, ``(h,)``."""
    penetration: Array
    residual: Array
    """``penetration``, ``residual``: largest penetration, m, and energy residual (NaN without balances), ``(h,)``."""
    ok: NDArray[np.bool_]
    """Whether the case ended ok, ``(h,)``."""
    orders: dict[str, tuple[float, float]]
    """Observed order of each error and its scatter, see :func:`observed_order`."""

    @property
    def exact(self) -> bool:
        """Whether the scheme is its own reference: one cost, no error, whatever h."""
        return all(bool(np.all(errors == 0.0)) for errors in self.errors.values())

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Whether a step is beyond the scheme's limit: not ok, or an impulse error above :data:`SENSELESS`."""
        return np.asarray(~self.ok | (self.errors["impulse_error"] > SENSELESS))

    def sane(self, values: Array) -> Array:
        """Return values at the steps whose impulse error is not :data:`SENSELESS`, NaN at others."""
        return np.where(self.errors["impulse_error"] < SENSELESS, values, np.nan)


def lines(dataset: xr.Dataset) -> list[Line]:
    """Return a line per scheme through all steps, in the case that :func:`finest` shows of all other dimensions.

    Raises :class:`ValueError` for a dataset without errors or with one step only.
    """
    if "impulse_error" not in dataset or dataset.sizes.get("h", 1) < 2:
        raise ValueError("errors over steps need a `reference` in the study and several steps `h` in the dataset")
    place = {dim: k for dim, k in finest(dataset).items() if dim not in ("scheme", "h")}
    chosen = most_loaded(dataset).isel(place).sortby("h")
    if "scheme" not in chosen.dims:
        chosen = chosen.assign_coords(scheme=chosen.coords.get("scheme", "scheme")).expand_dims("scheme")
    fits = {error: observed_order(chosen, error) for error in ERRORS}
    orders = [
        {error: (float(fit["order"][k]), float(fit["scatter"][k])) for error, fit in fits.items()}
        for k in range(chosen.sizes["scheme"])
    ]
    return [_line(chosen.isel(scheme=k), one) for k, one in enumerate(orders)]


def _line(cut: xr.Dataset, orders: dict[str, tuple[float, float]]) -> Line:
    ok = np.asarray(cut["status"].values) == Status.OK

    def of_ok(name: str) -> Array:
        return np.where(ok, np.asarray(cut[name].values, dtype=float) if name in cut else np.nan, np.nan)

    return Line(
        scheme=str(cut["scheme"].values),
        h=np.asarray(cut["h"].values, dtype=float),
        errors={error: of_ok(error) for error in ERRORS},
        seconds=np.asarray(cut["processor_time"].values, dtype=float) / simulated_seconds(cut),
        penetration=of_ok("max_penetration"),
        residual=of_ok("energy_residual"),
        ok=ok,
        orders=orders,
    )


GAINS = 0.01
"""Energy from nowhere, as a share of the largest energy, above which a scheme is said to gain energy."""

RULE = (
    "The verdict is the first that applies: the status of the worst case, if one is not ok; “gains energy”, if the "
    f"energy residual exceeds +{GAINS:.0%} of the largest energy; “stable”, if a case has no error; the tightest of "
    f"the usual tolerances ({', '.join(map(percent, USUAL_TOLERANCES))}) that the most accurate reduced model meets in "
    "all cases, judged as by `workflow recommend`."
)


@dataclass(frozen=True)
class Standing:
    """What became of the cases of one scheme at one step."""

    scheme: str
    step: str
    """``scheme``, ``step``: labels; ``step`` is empty where the study has one step only."""
    h: float
    """The step, s; NaN where the archive has none."""
    counts: dict[str, int]
    """Number of cases by name of their status."""
    choice: Choice | None
    """The most accurate of its choices, as :func:`workflow.recommend` weighs them; ``None`` without a reference."""
    residual: float
    """Energy residual of the largest magnitude, with its sign; NaN without balances."""
    penetration: float
    """Largest penetration of ok cases over the gap; over 1 m where the gap is 0."""
    restitution: float
    """Median effective restitution of ok cases; NaN of schemes that read e."""
    verdict: str
    """By :data:`RULE`."""

    @property
    def error(self) -> float:
        """Largest error of that choice, 1; NaN where a case is not ok or has none."""
        return math.nan if self.choice is None else self.choice.worst.error

    @property
    def ok(self) -> bool:
        """Whether every case is ok."""
        return set(self.counts) == {"ok"}


def standings(dataset: xr.Dataset) -> list[Standing]:
    """Return the standing of every scheme at every step, in the archive's order, at the most loaded contact."""
    dataset = most_loaded(dataset)
    rows = [dim for dim in ("scheme", "h") if dim in case_dims(dataset)]
    shape = [dataset.sizes[dim] for dim in rows]

    def table(values: xr.DataArray) -> Array:
        return np.asarray(values.transpose(*rows, ...).values, dtype=float).reshape(math.prod(shape), -1)

    def of_ok(part: xr.Dataset, name: str) -> Array:
        return table(part.get(name, np.nan * part["status"]).where(part["status"] == Status.OK))

    gap = abs(gap_of(dataset).astype(float))
    residuals, restitutions = of_ok(dataset, "energy_residual"), of_ok(dataset, "effective_restitution")
    in_gaps = dataset.assign(share=dataset["max_penetration"] / gap.where(gap > 0, 1.0))
    penetrations = _extremes(of_ok(in_gaps, "share"))
    try:
        choices: list[Choice | None] = [*most_accurate(dataset, rows)]
    except NoReferenceError:
        choices = [None] * math.prod(shape)
    schemes = [str(one) for one in np.atleast_1d(dataset["scheme"].values)]
    steps = labels_of(dataset, "h", named=False, rounded=True) if "h" in rows else [""]
    h = np.atleast_1d(dataset["h"].values) if "h" in dataset.coords else [np.nan]
    found = []
    for k, place in enumerate(np.ndindex(*shape)):
        at = dict(zip(rows, place, strict=True))
        codes, numbers = np.unique(table(dataset["status"])[k], return_counts=True)
        counts = {Status(int(code)).name.lower(): int(n) for code, n in zip(codes, numbers, strict=True)}
        known = restitutions[k][~np.isnan(restitutions[k])]
        found.append(
            Standing(
                schemes[at.get("scheme", 0)] if "scheme" in rows or len(schemes) == 1 else "the scheme",
                steps[at.get("h", 0)],
                h=float(h[at.get("h", 0)]) if "h" in rows or len(h) == 1 else np.nan,
                counts=counts,
                choice=choices[k],
                residual=float(_extremes(residuals)[k]),
                penetration=float(penetrations[k]),
                restitution=float(np.median(known)) if known.size else np.nan,
                verdict=_verdict(counts, choices[k], bool((residuals[k] > GAINS).any())),
            )
        )
    return found


def _extremes(values: Array) -> Array:
    """Return the value of the largest magnitude of each row, with its sign; NaN where there is none."""
    sizes = np.where(np.isnan(values), -1.0, np.abs(values))
    return np.take_along_axis(values, sizes.argmax(axis=1)[:, None], axis=1)[:, 0]


def _verdict(counts: dict[str, int], choice: Choice | None, gains: bool) -> str:
    bad = {name: n for name, n in counts.items() if name != "ok"}
    if bad:
        name = max(bad, key=lambda key: bad[key]).replace("_", "-")
        return name if "ok" not in counts else f"{name} in part"
    if gains:
        return "gains energy"
    if choice is None or np.isnan(choice.worst.error):
        return "stable"
    kept = [share for share in USUAL_TOLERANCES if choice.worst.error <= share]
    return f"within {percent(min(kept))}" if kept else f"beyond {percent(max(USUAL_TOLERANCES))}"


@dataclass(frozen=True)
class StepRange:
    """Up to which step one scheme is stable and accurate in a study."""

    scheme: str
    """Its label."""
    cases: int
    ok: int
    """``cases``, ``ok``: number of cases, and of those that are ok."""
    stable: str
    accurate: str
    """``stable``, ``accurate``: ``every h``, ``no h``, or the largest step up to which all cases are ok, and within the
    tolerance of the study as well; ``accurate`` is empty without a reference."""
    finest: float
    coarsest: float
    """``finest``, ``coarsest``: largest error at the smallest step and at the largest at which all cases have one; NaN
    without a reference."""
    residual: float
    penetration: float
    """``residual``, ``penetration``: of all ok cases, as in :class:`Standing`."""
    verdicts: tuple[str, ...]
    """Verdicts from the smallest step to the largest, repetitions left out."""


def ranges(dataset: xr.Dataset) -> list[StepRange]:
    """Return, for every scheme of a study, up to which step it is stable and accurate."""
    by_scheme: dict[str, list[Standing]] = {}
    for standing in standings(dataset):
        by_scheme.setdefault(standing.scheme, []).append(standing)
    return [_range(scheme, sorted(rows, key=lambda row: row.h)) for scheme, rows in by_scheme.items()]


def _range(scheme: str, rows: list[Standing]) -> StepRange:
    measured = [row for row in rows if not np.isnan(row.error)]
    return StepRange(
        scheme,
        cases=sum(sum(row.counts.values()) for row in rows),
        ok=sum(row.counts.get("ok", 0) for row in rows),
        stable=_up_to(rows, [row.ok for row in rows]),
        accurate=_up_to(rows, [row.choice is not None and row.choice.share == 1 for row in rows]) if measured else "",
        finest=measured[0].error if measured else np.nan,
        coarsest=measured[-1].error if measured else np.nan,
        residual=_extreme([row.residual for row in rows]),
        penetration=_extreme([row.penetration for row in rows]),
        verdicts=tuple(verdict for verdict, _ in groupby(row.verdict for row in rows)),
    )


def _extreme(values: list[float]) -> float:
    return float(_extremes(np.array([values]))[0])


def _up_to(rows: list[Standing], good: list[bool]) -> str:
    """Tell up to which step a property holds for it and every smaller one."""
    if all(good):
        return "every h"
    first_bad = good.index(False)
    return rows[first_bad - 1].step if first_bad else "no h"
