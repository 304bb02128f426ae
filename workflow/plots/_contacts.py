"""The contact force of several contacts over time: where along a chord a blade rubs, and when."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import case_dims, is_of_contacts, place_text, shown_place
from workflow.plots._style import head, new_figure
from workflow.plots._units import in_units

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
