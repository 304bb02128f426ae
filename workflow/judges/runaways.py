"""Runaway of a tip in lasting contact, at given heat couplings and friction coefficients."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from workflow.models import Array, Structure, critical_alpha, growth, in_contact

_AT_CRITICAL = 1e-9
"""Relative excess over the critical coupling up to which there is no runaway: far above its rounding, about 1e-14."""


class Runaways:
    """Critical coupling and growth rate of the structure on which cases are run, cached for each pair of α and µ."""

    def __init__(self, structure: Structure) -> None:
        with threadpool_limits(limits=1, user_api="blas"):
            contact = in_contact(structure)

        critical = cache(lambda friction: critical_alpha(structure, friction))

        @cache
        def at(alpha: float, friction: float) -> tuple[float, float, bool]:
            rate, acts = growth(contact, alpha, friction), alpha > 0 or friction > 0
            grows = rate.is_positive or alpha > critical(friction) * (1 + _AT_CRITICAL)
            return critical(friction), rate.rate, acts and grows

        self._at = at

    def of(self, alpha: Array, friction: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return critical coupling [m/s], growth rate [1/s] and whether it grows, ``(case,)`` each.

        Above the critical coupling a real eigenvalue is certainly positive, however small beside the largest one:
        1 - α G(s) is negative at 0 and 1 at infinity.
        """
        distinct, where = np.unique(np.stack([alpha, friction]), axis=1, return_inverse=True)
        critical, rate, grows = np.transpose([self._at(*map(float, pair)) for pair in distinct.T])[:, where.ravel()]
        return critical, rate, grows != 0
