"""Residuals of energy and heat, from the sums of a march.

With the energy E, dissipation D less the work of loads and contact, heat content H, losses L, friction heat αJ and
heating Q = ∫pᵀq of a whole march, all in pᵀ (1b) with the uniform rise p = ``Structure.uniform_rise``,

    energy residual = (E_end - E_0 + D) / max E
    heat residual = (H_end - H_0 - αJ - Q + L) / (αJ + |Q| + ∫|dL| + Σ|c T_0|)

and 0 where the denominator is 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.models import Cases, Structure
from workflow.schemes._fixed.rows import Totals


class Content(NamedTuple):
    """Heat content of cases [J], ``(case,)``."""

    gained: Array
    """H_end - H_0."""
    initial: Array
    """Σ|c T_0|."""
    heating: Array
    """Q = ∫pᵀq."""


def row_totals(terms: Array) -> Array:
    """Return the sum of each row, ``(row,)``, with the same bits for a case alone and among others."""
    return np.asarray(np.ascontiguousarray(terms).sum(axis=1))


def content_of(structure: Structure, cases: Cases, last: Array, elapsed: float) -> Content:
    """Return the heat content of cases with the temperatures ``last`` after ``elapsed`` seconds, K."""
    content, heating = structure.content, structure.uniform_rise * cases.heating
    initial = content * cases.temperature
    return Content(row_totals(content * last - initial), row_totals(np.abs(initial)), elapsed * row_totals(heating))


class Balance(NamedTuple):
    """Balances of cases after their march."""

    totals: Totals
    content: Content
    rest: Array | float = 0.0
    """Energy below which all is rounding, J: the least value of max E."""

    def residuals(self) -> dict[str, Array]:
        """Return ``energy_residual`` and ``heat_residual``, ``(case,)``."""
        totals, content = self.totals, self.content
        change = totals.last_energy - totals.first_energy + totals.dissipated
        friction, heating = totals.friction_heat, content.heating
        gained = content.gained - friction - heating + totals.lost
        turned = friction + np.abs(heating) + totals.turned_over + content.initial
        largest = np.maximum(totals.largest_energy, self.rest)
        return {"energy_residual": ratio(change, largest), "heat_residual": ratio(gained, turned)}


def ratio(part: Array, whole: Array) -> Array:
    """Return part/whole, 0 where the whole is 0."""
    nothing = whole == 0
    return np.where(nothing, 0.0, part / np.where(nothing, 1.0, whole))
