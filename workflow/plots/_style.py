"""What all pictures share: colours, panels, and how they are saved."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's palette: told apart by colour-blind readers and in print. Yellow last, grey for what is beside.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#B8A800")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
GREY = "#8a8a8a"


def trim(panel: Any, grid: str = "both") -> None:
    """Leave a panel its left and lower edge and a faint grid."""
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(axis=grid, alpha=0.25, lw=0.5)


def write_figure(figure: Figure, file: IO[bytes], dpi: int, form: str = "png") -> None:
    """Write a figure as PNG, SVG or PDF; texts come from files, and a dollar sign in them begins no formula."""
    from matplotlib import rc_context
    from matplotlib.text import Text
    from matplotlib.ticker import FixedFormatter

    ticks: set[Any] = set()
    for panel in figure.axes:
        for axis in (panel.xaxis, panel.yaxis):
            if not isinstance(axis.get_major_formatter(), FixedFormatter):
                ticks.update([axis.get_offset_text(), *axis.get_ticklabels(which="both")])
    for text in figure.findobj(Text):
        if text not in ticks:  # those that Matplotlib writes have exponents
            text.set_parse_math(False)
    with warnings.catch_warnings(), rc_context({"pdf.fonttype": 42}):  # journals refuse fonts of type 3
        warnings.filterwarnings("ignore", message="Glyph", category=UserWarning)  # a box is drawn in its place
        figure.savefig(file, dpi=dpi, format=form)


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, SVG or PDF, as the path ends, and return the path."""
    with open(path, "wb") as file:
        write_figure(figure, file, 150, path.suffix[1:].lower())
    return path
