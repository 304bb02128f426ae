"""Quantities and pictures of single scenes, for the notebooks beside this file."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from workflow.analysis import casing_motion
from workflow.plots import Curve, tip_response
from workflow.plots._style import COLOURS, GREY, label_lowest, legend_below, look, new_figure, trim

_OFF_THE_PANEL = 10.0
"""Growth by so many factors of e leaves the panel: it would flatten all else."""

_COLUMNS = 3
"""Panels beside each other that are read on a page."""


def energy_kept(case: xr.Dataset, energy: float) -> float:
    """Return the share of its initial energy that an unloaded, undamped case has in the end.

    The energy residual (what the scheme gives or takes) and what the contact has taken, Σ p (v_n before + v_n after)/2,
    together; while the energy never passes its initial value, which the residual is then relative to.

    Parameters
    ----------
    case
        One case with balances and the histories ``velocity`` and ``impulse``, sampled at every step: the output
        interval is h.
    energy
        Energy at t = 0, J.
    """
    velocity = np.asarray(case["velocity"].values, dtype=float)
    impulses = np.diff(np.asarray(case["impulse"].values, dtype=float))
    taken = float(np.sum(impulses * (velocity[1:] + velocity[:-1]) / 2))
    return 1.0 + float(case["energy_residual"]) - taken / energy


def impact_speeds(case: xr.Dataset) -> np.ndarray:
    """Return the speeds at which the tip meets its casing, relative to it, m/s, one for each contact phase.

    From the last sample before a contact: its velocity, carried on to the casing with the
    acceleration of the interval before. The error is of second order in the output interval.

    Parameters
    ----------
    case
        One case with the histories ``displacement``, ``velocity`` and ``contact_force``.
    """
    x, v = (np.asarray(case[name].values, dtype=float) for name in ("displacement", "velocity"))
    motion = casing_motion(case)
    place = np.full(x.shape, float(case["gap"])) if motion is None else motion[0]
    v = v if motion is None else v - motion[1]
    interval = float(case["t"][1] - case["t"][0])
    touched = np.asarray(case["contact_force"].values) > 0
    first = np.flatnonzero(touched[2:] & ~touched[1:-1] & ~touched[:-2]) + 2
    before = first - 1
    acceleration = (v[before] - v[before - 1]) / interval
    room = np.maximum(place[before] - x[before], 0.0)
    squared = v[before] ** 2 + 2 * acceleration * room
    speeds = np.sqrt(np.maximum(squared, 0.0))
    return np.asarray(speeds[speeds > 0])


def growth_against_prediction(archive: xr.Dataset) -> Figure:
    """Draw the contact force over time for each α, and dashed what theory predicts.

    That is F/(1 - α/α_c) + C exp(rate t), with the force F of α = 0 and C from the last sample: the
    slowest part of the contact-closed system, decaying below α_c and growing above.

    Parameters
    ----------
    archive
        Cases in permanent contact along ``alpha`` alone, from static equilibrium, with the history
        ``contact_force``.
    """
    figure = new_figure(8.0, 4.6)
    panel = figure.subplots()
    t = np.asarray(archive["t"].values)[1:]
    top = static = float(archive["contact_force"].isel(alpha=0).values[1])
    for k in range(archive.sizes["alpha"]):
        case = archive.isel(alpha=k)
        force = np.asarray(case["contact_force"].values)[1:]
        share, rate = float(case["alpha"]) / float(case["critical_alpha"]), float(case["growth_rate"])
        label = f"α/α_c = {share:.3g}, rate {rate:+.3g} 1/s"
        panel.plot(t, force, color=COLOURS[k % len(COLOURS)], lw=2.2, label=label)
        if share > 0 and share != 1:
            limit = static / (1 - share)
            panel.plot(t, limit + (force[-1] - limit) * np.exp(rate * (t - t[-1])), "--", color="black", lw=1.0)
        top = max(top, float(force[-1]) if rate * t[-1] < _OFF_THE_PANEL else 0.0)
    panel.set_ylim(0.5 * static, 1e2 * top)
    panel.set(yscale="log", xlabel="time [s]", ylabel="contact force [N]")
    panel.plot([], [], "--", color="black", lw=1.0, label="predicted")
    panel.margins(x=0)
    panel.legend(frameon=False, fontsize=9, loc="upper right")
    trim(panel)
    return figure


def impact_speed_map(archive: xr.Dataset, quantile: float = 0.9) -> Figure:
    """Draw impact speeds against load frequency, a panel for each gap, a colour for each e.

    Parameters
    ----------
    archive
        Dimensions ``frequency``, ``gap`` and ``e``; histories ``displacement``, ``velocity`` and
        ``contact_force``.
    quantile
        Of the impact speeds of a case that is drawn, in the second half of its time; cases without
        contact then have none.
    """
    gaps = np.atleast_1d(archive["gap"].values)
    columns, rows = min(len(gaps), _COLUMNS), -(-len(gaps) // _COLUMNS)
    figure = new_figure(3.6 * columns + 0.8, 3.6 * rows + 0.8)
    grid: Any = np.ravel(figure.subplots(rows, columns, sharex=True, sharey=True))
    frequency = np.asarray(archive["frequency"].values)
    half = archive.isel(t=slice(archive.sizes["t"] // 2, None))
    for place, (panel, gap) in enumerate(zip(grid, gaps, strict=False)):
        for k, e in enumerate(archive["e"].values):
            chosen = half.sel(gap=gap, e=e) if "gap" in half.dims else half.sel(e=e)
            speeds = [impact_speeds(chosen.sel(frequency=f)) for f in frequency]
            quantiles = np.array([np.quantile(one, quantile) if one.size else np.nan for one in speeds])
            panel.plot(frequency, quantiles, **look(k), ms=4, lw=1.3, label=f"e = {e:g}")
        panel.set_title(f"gap {gap * 1e6:.3g} µm")
        if place % columns == 0:
            panel.set_ylabel("impact speed [m/s]")
        trim(panel)
    label_lowest(grid, len(gaps), columns, "load frequency [Hz]")
    legend_below(figure, grid[0].get_legend_handles_labels(), 2 * columns)
    return figure


def abstract_figure(archive: xr.Dataset) -> Figure:
    """Draw the extended abstract's figure beside the exact solution: reduced dashed, without contact heat grey.

    Parameters
    ----------
    archive
        Of ``studies/abstract_figure.yaml``: dimensions ``scheme`` (exact first), ``alpha`` (0 first) and ``model``
        (full first).
    """
    exact, stepped = archive.isel(scheme=0, model=0), archive.isel(scheme=-1)
    cold, hot = exact.isel(alpha=0), stepped.isel(alpha=-1)
    modes = f"{int(hot['mechanical_modes'][-1])} + {int(hot['thermal_modes'][-1])} modes"
    return tip_response(
        [
            Curve(cold, "α = 0, exact", GREY, "-", 1.0),
            Curve(exact.isel(alpha=-1), f"α = {float(hot['alpha']):g} m/s, exact", COLOURS[5], "-", 3.2),
            Curve(hot.isel(model=0), f"h = {float(hot['h']):g} s, full", COLOURS[6], "-", 0.8),
            Curve(hot.isel(model=-1), f"h = {float(hot['h']):g} s, {modes}", COLOURS[1], "--", 1.1),
        ],
        phases_of=1,
    )
