"""Values for every node or spring from what a study gives: a scalar, or one value each."""

from __future__ import annotations

import numpy as np

from workflow.declare import Values
from workflow.kernels import Array


def per_item(value: Values, count: int) -> Array:
    """Spread a scalar over ``count`` nodes or springs, or take one value per item as it is."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (count,)).copy()
