"""An abradable coating: a law of three states between each contact and the sector of the casing that it is in.

    open      r < 0                     λ = 0                        r = x - d - w
    elastic   0 <= r/c <= F_y + H w     λ = r/c
    crushing  r/c = F_y + H w, growing  λ = F_y + H w,  w = (x - d - c F_y)/(1 + c H)

with the worn depth w >= 0 of the sector and the flexibility c of casing and coating. A contact at the angle ψ is at
ϑ = Ωt + ψ in the sector ⌊Nϑ/2π⌋ mod N. Legrand, Batailly, Pierre: J. Comput. Nonlinear Dyn. 7 (2012) 011010.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.lemke import complementarity

MOST_SECTORS = 36_000
"""Largest number of sectors: a hundredth of a degree each."""

AT_BORDER = 1e-9
"""Part of a sector before its border from which on a contact is in the next one: a step or a start at the border is
there up to rounding."""


@dataclass(frozen=True, eq=False)
class Coating:
    """The coating in each case of a batch."""

    yield_force: Array
    hardening: Array
    """``yield_force``, ``hardening``: F_y [N] and H [N/m], ``(case,)``."""
    sectors: Array
    """N, 1, ``(case,)``."""
    speed: Array
    """Ω/2π, revolutions per second, ``(case,)``."""
    turns: Array
    """ϑ/2π of each contact at t = 0, 1, ``(case, contact)``."""
    worn: Array
    """w of the sectors at t = 0, m, ``(case, contact, sector)``: as many as the most of a case; others do not count."""

    def take(self, which: Any) -> Coating:
        """Return the coating of some cases."""
        return Coating(*(getattr(self, field.name)[which] for field in fields(self)))

    def begins_in(self) -> NDArray[np.int64]:
        """Return the sector of each contact at t = 0, ``(case, contact)``."""
        sectors = self.sectors[:, None]
        return np.asarray(np.floor(sectors * (self.turns % 1.0) + AT_BORDER) % sectors, dtype=np.int64)

    def worn_at_start(self) -> Array:
        """Return w of the sector of each contact at t = 0, m, ``(case, contact)``."""
        return np.take_along_axis(self.worn, self.begins_in()[..., None], axis=2)[..., 0]

    def level_at_start(self) -> Array:
        """Return F_y + H w of the sector of each contact at t = 0, N, ``(case, contact)``."""
        return np.asarray(self.yield_force[:, None] + self.hardening[:, None] * self.worn_at_start())

    def pressed(self, depth: Array, flexibility: float) -> tuple[Array, Array]:
        """Return λ [N] and w [m] of contacts x - d = ``depth`` deep at t = 0, of the sectors they are in.

        ``(case, contact)`` each; the casing has the ``flexibility`` c [m/N].
        """
        first, hardening = self.yield_force[:, None], self.hardening[:, None]
        before = self.worn_at_start()
        crushed = (depth - flexibility * first) / (1 + flexibility * hardening)
        worn = np.fmax(before, crushed)
        return np.fmax(0.0, depth - worn) / flexibility, worn

    def crushing_work(self, worn: Array) -> Array:
        """Return ∫ (F_y + H w) dw from the start on, J, ``(case, contact)``, at worn depths ``(case, contact, …)``."""
        grown, mean = worn - self.worn, (worn + self.worn) / 2
        force = self.yield_force[:, None, None] + self.hardening[:, None, None] * mean
        return np.asarray(np.nancumsum(force * grown, axis=2)[..., -1])  # in an order that no other case changes


def coated_forces(
    compliance: Array, apart: Array, flexibility: float, level: Array, hardening: float
) -> tuple[Array, Array] | None:
    """Return λ [N] of contacts that are pressed at once, and by how much they wear their coatings [m].

    ``apart`` is d + w - x without contact [m], ``compliance`` what a unit force takes of x, with that of the casing, c
    on the diagonal, and ``level`` F_y + H w. ``None`` where there is no solution of the complementarity problem

        0 <= λ ⊥ compliance λ + Δw + apart >= 0,   0 <= Δw ⊥ level + H Δw - λ >= 0.
    """
    force = complementarity(compliance, apart)
    if force is None or (force <= level).all():
        return None if force is None else (force, np.zeros_like(force))
    one = np.eye(apart.size)  # of λ and Δw/c, both forces
    matrix = np.block([[compliance / flexibility, one], [-one, hardening * flexibility * one]])
    both = complementarity(matrix, np.concatenate([apart / flexibility, level]))
    return None if both is None else (both[: apart.size], flexibility * both[apart.size :])
