"""What the page of truth is made of: numbers beside those that are known of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import xarray as xr

from workflow import read_study, run_study, write_matrices

TRUTH = Path(__file__).parent
ROOT = TRUTH.parents[1]
SCENES = {
    "truth": TRUTH,
    "studies": TRUTH.parent,
    "hard": ROOT / "studies" / "hard",
    "audit": ROOT / "tests" / "truth" / "audit",
    "free": ROOT / "tests" / "truth" / "free",
    "contacts": ROOT / "tests" / "contacts" / "scenes",
}
"""Directories of the studies that are compared."""


@dataclass(frozen=True)
class Row:
    """A number of this program beside what is known of it.

    Attributes
    ----------
    what
        The quantity, with its unit.
    known, here
        The number published or made by others, and that of this program.
    allowed
        Largest difference with which they agree.
    decides
        What makes the difference: how the allowed one is decided.
    """

    what: str
    known: float
    here: float
    allowed: float
    decides: str

    @property
    def agrees(self) -> bool:
        """Tell whether the difference is allowed."""
        return abs(self.here - self.known) <= self.allowed


@dataclass(frozen=True)
class Comparison:
    """A scene, or several of one source, with the function that computes its rows; a topic is a key of ``TOPICS``."""

    topic: str
    title: str
    source: str
    text: str
    studies: tuple[str, ...]
    rows: Callable[[], list[Row]]


TOPICS = {
    "impacts": "Impacts",
    "bars": "Bars and beams",
    "heat": "Heat",
    "contacts": "Contacts",
    "speed": "Speed",
    "steady": "Steady rubs",
    "programs": "Other programs",
}
"""Parts of the page, in its order, with their titles."""

COMPARISONS: list[Comparison] = []
"""All that the page shows, within each topic in this order."""

Scene = Callable[[], list[Row]]


def scene(topic: str, title: str, source: str, *studies: str) -> Callable[[Scene], Scene]:
    """Register a function that computes rows; its docstring is what the page says of them."""

    def registered(rows: Scene) -> Scene:
        COMPARISONS.append(Comparison(topic, title, source, " ".join((rows.__doc__ or "").split()), studies, rows))
        return rows

    return registered


def relative(what: str, known: float, here: float, share: float, decides: str) -> Row:
    """Return a row whose difference is allowed up to a share of what is known."""
    return Row(what, known, here, abs(share * known), decides)


def solved(study: str, entries: Mapping[str, Any] | None = None, **settings: Any) -> xr.Dataset:
    """Return the results of a study, ``truth/NAME``, with some of its values replaced.

    ``entries`` are those of its file of matrices, instead of what the file holds.

    Raises
    ------
    ValueError
        A case is not ok.
    """
    place, _, name = study.partition("/")
    with TemporaryDirectory() as directory:
        if entries is not None:
            settings["scene.matrices.file"] = str(write_matrices(Path(directory) / f"{name}.npz", **entries))
        requested = read_study(SCENES[place] / f"{name}.yaml", settings)
        outcome = run_study(requested, Path(directory) / f"{name}.nc", threads=1)
        results = outcome.dataset.load()
        outcome.dataset.close()
    if not outcome.ok:
        raise ValueError(f"{study}: {outcome.counts}")
    return results
