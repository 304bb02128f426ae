"""Kernels: compilation and cache, arithmetic on lanes, small linear algebra; no physics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
