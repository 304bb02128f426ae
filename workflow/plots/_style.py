"""What all pictures share: colours, panels, and how they are saved."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import commit

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure
    from matplotlib.text import Text

# Okabe and Ito's palette: told apart by colour-blind readers and in print. Yellow last, grey for what is beside.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#B8A800")
MADE_BY = "rotor-stator-workflow"
"""What figures and pages say of their origin: only such are written over unasked."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
GREY = "#8a8a8a"


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of so many inches, which no window shows, but a notebook where a cell ends with it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    figure._repr_png_ = partial(_png, figure)  # type: ignore[attr-defined]
    return figure


def _png(figure: Figure) -> bytes:
    file = io.BytesIO()
    write_figure(figure, file, 100)
    return file.getvalue()


def look(k: int) -> dict[str, Any]:
    """Return colour and marker of the curve of a number."""
    return {"color": COLOURS[k % len(COLOURS)], "marker": MARKERS[k % len(MARKERS)]}


def head(figure: Figure, text: str) -> None:
    """Write a text above all panels, where there is any."""
    if text:
        figure.suptitle(text, fontsize=10)


def legend_below(figure: Figure, named: tuple[list[Any], list[str]], columns: int) -> None:
    """Name curves below all panels, where there are any; ``named`` holds them and their names."""
    handles, labels = named
    if labels:
        figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=9)


def label_lowest(panels: Any, used: int, columns: int, label: str) -> None:
    """Remove panels of a grid beyond those used; name and number the horizontal axis where nothing is drawn below."""
    for panel in panels[used:]:
        panel.remove()
    for panel in panels[max(used - columns, 0) : used]:
        panel.set_xlabel(label)
        panel.tick_params(labelbottom=True)


def cell_edges(middles: NDArray[Any]) -> NDArray[np.float64]:
    """Return the edges of cells about their middles, ``(cell + 1,)``; one alone is as wide as its distance from 0."""
    half = np.diff(middles) / 2 if len(middles) > 1 else np.array([abs(middles[0]) / 2 or 0.5])
    return np.concatenate([middles[:1] - half[:1], middles[:-1] + half[: len(middles) - 1], middles[-1:] + half[-1:]])


def trim(panel: Any, grid: str = "both") -> None:
    """Leave a panel its left and lower edge and a faint grid."""
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(axis=grid, alpha=0.25, lw=0.5)


def write_figure(figure: Figure, file: IO[bytes], dpi: int, form: str = "png") -> None:
    """Write a figure as PNG, SVG or PDF; texts come from files, and a dollar sign in them begins no formula."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    for text in _texts(figure):
        text.set_parse_math(False)
    with warnings.catch_warnings(), rc_context({"pdf.fonttype": 42}):  # journals refuse fonts of type 3
        warnings.filterwarnings("ignore", message="Glyph", category=UserWarning)  # a box is drawn in its place
        if form == "png":  # savefig draws twice
            figure.dpi = dpi
            canvas: Any = FigureCanvasAgg(figure)
            canvas.print_png(file, metadata={"Source": MADE_BY})
        else:
            figure.savefig(file, dpi=dpi, format=form)


def _texts(artist: Artist) -> Iterator[Text]:
    """Yield all texts of an artist but those that Matplotlib writes at ticks, whose exponents are formulas."""
    from matplotlib.axis import Axis
    from matplotlib.text import Text
    from matplotlib.ticker import FixedFormatter

    for child in artist.get_children():
        if isinstance(child, Axis) and not isinstance(child.get_major_formatter(), FixedFormatter):
            yield child.label
        elif isinstance(child, Text):
            yield child
        else:
            yield from _texts(child)


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, SVG or PDF, as the path ends, and return the path."""
    buffer = io.BytesIO()
    write_figure(figure, buffer, 150, path.suffix[1:].lower())
    commit(path, buffer.getvalue())
    return path
