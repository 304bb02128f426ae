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
    """Critical coupling and growth rate of the structure on which cases are run, kept for each pair of α and µ."""

    def __init__(self, structure: Structure) -> None:
        with threadpool_limits(limits=1, user_api="blas"):
            self._contact = in_contact(structure)
        self._critical = cache(lambda friction: critical_alpha(structure, friction))
        self._known: dict[tuple[float, float], tuple[float, float, float]] = {}

    def of(self, alpha: Array, friction: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return critical coupling [m/s], growth rate [1/s] and whether it grows, ``(case,)`` each.

        Above the critical coupling a real eigenvalue is certainly positive, however small beside the largest one:
        1 - α G(s) is negative at 0 and 1 at infinity.
        """
        distinct, where = np.unique(alpha + 1j * friction, return_inverse=True)
        pairs = list(zip(distinct.real.tolist(), distinct.imag.tolist(), strict=True))
        if new := [pair for pair in pairs if pair not in self._known]:
            self._known.update(zip(new, self._computed(*np.transpose(new)), strict=True))
        critical, rate, grows = np.transpose([self._known[pair] for pair in pairs])[:, where]
        return critical, rate, grows != 0

    def _computed(self, alpha: Array, friction: Array) -> list[tuple[float, float, float]]:
        """Return critical coupling, growth rate and whether it grows of each pair of α and µ."""
        critical = np.array([self._critical(each) for each in friction.tolist()])
        rates, acts = growth(self._contact, alpha, friction), (alpha > 0) | (friction > 0)
        grows = acts & (rates.is_positive | (alpha > critical * (1 + _AT_CRITICAL)))
        return list(zip(critical.tolist(), rates.rate.tolist(), grows.tolist(), strict=True))
