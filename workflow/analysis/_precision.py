"""Error against processor time and step: lines and observed orders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import finest
from workflow.analysis._recommend import simulated_seconds
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
    """One scheme through its steps, all other axes fixed.

    Attributes
    ----------
    scheme
        Its label.
    h
        Steps in ascending order, s, shape ``(h,)``.
    errors
        By name, each ``(h,)``; NaN where the case is not ok.
    seconds
        Processor seconds per simulated second, ``(h,)``.
    penetration, residual
        Largest penetration, m, and energy residual (NaN without balances), ``(h,)``.
    ok
        Whether the case ended ok, ``(h,)``.
    orders
        Observed order of each error and its scatter, see :func:`observed_order`.
    """

    scheme: str
    h: Array
    errors: dict[str, Array]
    seconds: Array
    penetration: Array
    residual: Array
    ok: NDArray[np.bool_]
    orders: dict[str, tuple[float, float]]

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

    def stable_steps(self) -> tuple[float, float] | None:
        """Return the largest step before the first that is lost, and that one, where there are both."""
        bad = np.flatnonzero(self.lost)
        if not bad.size or bad[0] == 0:
            return None
        return float(self.h[bad[0] - 1]), float(self.h[bad[0]])


def lines(dataset: xr.Dataset) -> list[Line]:
    """Return a line per scheme through all steps, in the case that :func:`finest` shows of all other dimensions.

    Raises
    ------
    ValueError
        The dataset has no errors or one step only.
    """
    if "impulse_error" not in dataset or dataset.sizes.get("h", 1) < 2:
        raise ValueError("errors over steps need a `reference` in the study and several steps `h` in the dataset")
    chosen = dataset.isel({dim: k for dim, k in finest(dataset).items() if dim not in ("scheme", "h")}).sortby("h")
    if "scheme" not in chosen.dims:
        chosen = chosen.assign_coords(scheme=chosen.coords.get("scheme", "scheme")).expand_dims("scheme")
    fits = {error: observed_order(chosen, error) for error in ERRORS}
    orders = [
        {error: (float(fit["order"][k]), float(fit["scatter"][k])) for error, fit in fits.items()}
        for k in range(chosen.sizes["scheme"])
    ]
    return [_line(chosen.isel(scheme=k), one) for k, one in enumerate(orders)]


def _line(cut: xr.Dataset, orders: dict[str, tuple[float, float]]) -> Line:
    """Return the line through the steps of one scheme."""
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
