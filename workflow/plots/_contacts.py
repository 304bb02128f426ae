"""Where blade and casing rub: the force of each contact over time, and the worn depth of a coating over the angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import case_dims, contact_text, is_of_contacts, most_loaded, place_text, shown_place
from workflow.plots._style import COLOURS, head, new_figure, trim
from workflow.plots._units import in_units, scaled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_ROW = 0.24
"""Height of a contact, inches, where there are many."""


def by_load(case: xr.Dataset) -> xr.Dataset:
    """Return a case with its contacts in the order of their impulse, the largest first."""
    impulse = np.nan_to_num(case["contact_impulse"].values)
    return case.isel(contact=np.argsort(-impulse, kind="stable"))


def shown_case(dataset: xr.Dataset) -> tuple[xr.Dataset, str]:
    """Return the one case that is drawn of an archive, and where it lies; a case alone lies nowhere."""
    place = shown_place(dataset) if case_dims(dataset) else {}
    return dataset.isel(place), place_text(dataset, place) if place else ""


def contacts(dataset: xr.Dataset) -> Figure:
    """Draw the contact force of each contact over time, the most loaded contact first; white is no contact.

    The force of an interval between samples is its mean, the impulse over the interval. The title names the contact
    with the largest impulse.

    Parameters
    ----------
    dataset
        One case of an archive with several contacts; of an archive that case is shown which
        :func:`~workflow.plots.histories` shows.

    Raises
    ------
    ValueError
        There is one contact, or no history of the contact force or the impulse.
    """
    if not is_of_contacts(dataset):
        raise ValueError("the dataset has one contact; `histories` shows its force")
    if not {"contact_force", "impulse"} & set(dataset.data_vars):
        raise ValueError(
            "the dataset keeps no contact force; name `contact_force` under `output.histories` of the study"
        )
    shown, rest = shown_case(dataset)
    case = by_load(shown)
    force, label = in_units(_force(case))
    times, names = case["t"].values, [str(name) for name in case["contact"].values]
    figure = new_figure(7.0, 1.5 + max(1.2, _ROW * len(names)))
    panel: Any = figure.subplots()
    edges = np.append(times[0], times[1:])
    drawn = panel.pcolormesh(
        edges, np.arange(len(names) + 1) - 0.5, np.where(force[:, 1:] > 0, force[:, 1:], np.nan),
        cmap="cividis_r", vmin=0.0, rasterized=True,
    )  # fmt: skip
    panel.set_yticks(range(len(names)), names)
    panel.set(ylim=(len(names) - 0.5, -0.5), xlim=(times[0], times[-1]), xlabel="t [s]", ylabel="contact")
    panel.spines[["top", "right"]].set_visible(False)
    figure.colorbar(drawn, ax=panel, label=label, pad=0.02)
    head(figure, "; ".join(filter(None, (f"most loaded: contact {names[0]}", rest))))
    return figure


def _force(case: xr.Dataset) -> xr.DataArray:
    """Return the mean force of each interval between samples at its end, N, ``(contact, t)``."""
    if "contact_force" in case:
        return case["contact_force"].transpose("contact", "t")
    impulse = case["impulse"].transpose("contact", "t")
    mean = np.diff(impulse.values, axis=1, prepend=0.0) / np.diff(case["t"].values, prepend=np.nan)
    return impulse.copy(data=mean).rename("contact_force").assign_attrs(units="N")


def wear_map(dataset: xr.Dataset) -> Figure:
    """Draw the worn depth of a coating: the angle of the casing across, its revolutions up; white is not worn.

    Without ``output.wear`` it is the depth at the end over the angle. Of several contacts the most loaded one is shown.

    Parameters
    ----------
    dataset
        One case of an archive with a coating; of an archive that case is shown which
        :func:`~workflow.plots.histories` shows.

    Raises
    ------
    ValueError
        The casing has no coating, or no case is ok.
    """
    if "worn_depth" not in dataset:
        raise ValueError("the casing has no coating; write `scene.casing.coating` in the study")
    (case, rest), figure = shown_case(most_loaded(dataset)), new_figure(7.0, 3.6)
    edges = np.linspace(0.0, 360.0, int(np.isfinite(case["sector_angle"].values).sum()) + 1)
    panel: Any = figure.subplots()
    unit, factor = scaled("m", case["worn_depth"].values)
    label = f"worn depth [{unit}]"
    if "wear_map" in case:
        rows = factor * case["wear_map"].transpose("revolution", "sector").values[:, : edges.size - 1]
        ended = np.isfinite(rows).all(axis=1)
        revolutions = np.append(0, case["revolution"].values[ended])
        worn = np.where(rows[ended] > 0, rows[ended], np.nan)
        most = np.nanmax(rows[ended], initial=0.0) or 1.0
        drawn = panel.pcolormesh(edges, revolutions, worn, cmap="cividis_r", vmin=0.0, vmax=most, rasterized=True)
        figure.colorbar(drawn, ax=panel, label=label, pad=0.02)
        panel.set(ylabel="revolution", ylim=(0, revolutions[-1]))
        panel.spines[["top", "right"]].set_visible(False)
    else:
        panel.stairs(factor * case["worn_depth"].values[: edges.size - 1], edges, color=COLOURS[0])
        panel.set(ylabel=label, ylim=(0, None))
        trim(panel)
    panel.set(xlabel="angle of the casing [°]", xlim=(0, 360), xticks=range(0, 361, 45))
    head(figure, "; ".join(filter(None, (contact_text(dataset), rest))))
    return figure
