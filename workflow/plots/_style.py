"""What all pictures share: colours, panels, and how they are saved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

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


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG and return its path."""
    figure.savefig(path, dpi=150)
    return path
