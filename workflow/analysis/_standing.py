"""Who stays stable and who is accurate: the standing of every scheme in a study."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from workflow.analysis._cases import case_dims, finest, labels_of
from workflow.schemes import Status
from workflow.study import MODES

if TYPE_CHECKING:
    import xarray as xr

ACCURATE, ROUGH = 0.01, 0.1
"""Largest relative error of the impulse of cases that are called accurate, and rough; beyond: wrong."""

GAINS = 0.01
"""Energy from nowhere, as a share of the largest energy, above which a scheme is said to gain energy."""

RULE = (
    "Verdicts: the status of the worst case where one is not ok; else “gains energy” where the energy balance leaves "
    f"more than +{GAINS:.0%} of the largest energy; else “accurate” up to a largest impulse error of {ACCURATE:.0%}, "
    f"“rough” up to {ROUGH:.0%}, “wrong” beyond; “stable” where there is no reference. The error is the scheme's own, "
    "against the exact solution of the same reduced model; where an archive does not hold that part, the whole error "
    "with the most modes."
)


@dataclass(frozen=True)
class Standing:
    """What became of the cases of one scheme at one step.

    Attributes
    ----------
    scheme, step
        Labels; ``step`` is empty where the study has one step only.
    h
        The step, s; NaN where the archive has none.
    counts
        Number of cases by name of their status.
    error
        Largest relative error of the impulse among ok cases, without the reduced model's own; NaN without a reference.
    residual
        Energy residual of the largest magnitude, with its sign; NaN without balances.
    penetration
        Largest penetration of ok cases over the gap; over 1 m where the gap is 0.
    restitution
        Median effective restitution of ok cases; NaN of schemes that read e.
    verdict
        By :data:`RULE`.
    """

    scheme: str
    step: str
    h: float
    counts: dict[str, int]
    error: float
    residual: float
    penetration: float
    restitution: float
    verdict: str

    @property
    def ok(self) -> bool:
        """Whether every case is ok."""
        return set(self.counts) == {"ok"}


def standings(dataset: xr.Dataset) -> list[Standing]:
    """Return the standing of every scheme at every step, in the archive's order."""
    sizes = {dim: dataset.sizes[dim] for dim in ("scheme", "h") if dim in case_dims(dataset)}
    steps = labels_of(dataset, "h", named=False, rounded=True) if "h" in sizes else [""]
    return [
        _standing(dataset.isel(dict(zip(sizes, place, strict=True))), steps[place[-1] if "h" in sizes else 0])
        for place in np.ndindex(*sizes.values())
    ]


def _standing(chosen: xr.Dataset, step: str) -> Standing:
    codes, numbers = np.unique(chosen["status"].values, return_counts=True)
    counts = {Status(int(code)).name.lower(): int(n) for code, n in zip(codes, numbers, strict=True)}
    gap = abs(chosen["gap"].astype(float))
    residuals = _of_ok(chosen, chosen.get("energy_residual"))
    restitutions = _of_ok(chosen, chosen.get("effective_restitution"))
    error = _own_error(chosen)
    return Standing(
        str(chosen["scheme"].values) if chosen["scheme"].ndim == 0 else "the scheme",
        step,
        h=float(chosen["h"]) if "h" in chosen.coords and chosen["h"].ndim == 0 else np.nan,
        counts=counts,
        error=error,
        residual=_extreme(residuals),
        penetration=_extreme(_of_ok(chosen, chosen["max_penetration"] / gap.where(gap > 0, 1.0))),
        restitution=float(np.median(restitutions)) if restitutions else np.nan,
        verdict=_verdict(counts, error, any(residual > GAINS for residual in residuals)),
    )


def _own_error(chosen: xr.Dataset) -> float:
    """Return the largest error of the scheme itself: its part, or without parts the whole with the most modes."""
    parts = _of_ok(chosen, chosen.get("impulse_scheme_error"))
    if not parts and "impulse_error" in chosen:
        place = finest(chosen)
        at = {dim: place[dim] for dim in place if any(chosen[n].dims == (dim,) for n in MODES if n in chosen.coords)}
        full = chosen.isel(at)
        parts = _of_ok(full, full["impulse_error"])
    return max(parts, default=np.nan)


def _of_ok(chosen: xr.Dataset, values: xr.DataArray | None) -> list[float]:
    """Return the values that are not NaN, of the cases that ended ok."""
    if values is None:
        return []
    of_ok = np.asarray(values.where(chosen["status"] == Status.OK).values, dtype=float)
    return [float(value) for value in of_ok[~np.isnan(of_ok)]]


def _verdict(counts: dict[str, int], error: float, gains: bool) -> str:
    bad = {name: n for name, n in counts.items() if name != "ok"}
    if bad:
        name = max(bad, key=lambda key: bad[key]).replace("_", "-")
        return name if "ok" not in counts else f"{name} in part"
    if gains:
        return "gains energy"
    if np.isnan(error):
        return "stable"
    return "accurate" if error <= ACCURATE else "rough" if error <= ROUGH else "wrong"


@dataclass(frozen=True)
class StepRange:
    """Up to which step one scheme is stable and accurate in a study.

    Attributes
    ----------
    scheme
        Its label.
    cases, ok
        Number of cases, and of those that are ok.
    stable, accurate
        ``every h``, ``no h``, or the largest step up to which all cases are ok, and accurate as well;
        ``accurate`` is empty without a reference.
    finest, coarsest
        Largest impulse error at the smallest step and at the largest that is stable; NaN without a reference.
    residual, penetration
        Of all ok cases, as in :class:`Standing`.
    verdicts
        Verdicts from the smallest step to the largest, repetitions left out.
    """

    scheme: str
    cases: int
    ok: int
    stable: str
    accurate: str
    finest: float
    coarsest: float
    residual: float
    penetration: float
    verdicts: tuple[str, ...]


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
        accurate=_up_to(rows, [row.ok and row.error <= ACCURATE for row in rows]) if measured else "",
        finest=measured[0].error if measured else np.nan,
        coarsest=measured[-1].error if measured else np.nan,
        residual=_extreme(row.residual for row in rows),
        penetration=_extreme(row.penetration for row in rows),
        verdicts=tuple(verdict for verdict, _ in groupby(row.verdict for row in rows)),
    )


def _extreme(values: Iterable[float]) -> float:
    """Return the value of the largest magnitude, with its sign; NaN where there is none."""
    return max((value for value in values if not np.isnan(value)), key=abs, default=np.nan)


def _up_to(rows: list[Standing], good: list[bool]) -> str:
    """Tell up to which step a property holds for it and every smaller one."""
    if all(good):
        return "every h"
    first_bad = good.index(False)
    return rows[first_bad - 1].step if first_bad else "no h"
