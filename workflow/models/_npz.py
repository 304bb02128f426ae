"""NPZ files: arrays of NumPy in a zip archive, read without pickles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np


def read(place: Path) -> dict[str, Any]:
    """Return the arrays of a file by name."""
    with np.load(place, allow_pickle=False) as arrays:
        return dict(arrays)
