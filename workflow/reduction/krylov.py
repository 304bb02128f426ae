"""Krylov: vectors that match the tip's answer to forces and heat; fewest for a given error.

Mechanical: moments of the answer to a tip force at s = 0, K1⁻¹ e_n, K1⁻¹ M K1⁻¹ e_n, … With the tip held they span the
same as the constraint mode ψ ∝ K1⁻¹ e_n and, in the interior (i, i),

    w_1 = K1⁻¹ M ψ,   w_{k+1} = K1⁻¹ M w_k,

which exist for a free root too. At most six with ψ: further ones all turn to the lowest mode. Then follow
fixed-interface modes. Thermal: rational Krylov vectors (K2 + s C2)⁻¹ e_n, which with ψ ∝ K2⁻¹ e_n span the same as

    w_s = (K2 + s C2)⁻¹ C2 ψ   in the interior,

at shifts s from 1/duration to the larger of 10/duration and the largest eigenvalue with the tip held, log-spaced, as
many as vectors are asked for. What depends on others is dropped; the slowest modes with the tip held come instead.
All vectors are made orthonormal in M or C2 one after another, each twice. α_c is exact: S and K2⁻¹ e_n need ψ only.

Source: Grimme, Krylov projection methods for model reduction (thesis, Urbana 1997); Antoulas, Approximation of
large-scale dynamical systems (SIAM 2005), chapter 11.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workflow.kernels.elementwise import exp, log
from workflow.models import Structure
from workflow.models._spectrum import fastest_rate
from workflow.models._tip_held import (
    held_displacements,
    held_modes,
    held_temperatures,
    held_thermal_modes,
    mechanical_constraint,
    thermal_constraint,
)
from workflow.reduction._bases import Orthonormal
from workflow.reduction._reduction import Known, Vectors, mechanical_vectors, thermal_vectors

MOST_MOMENTS = 6
"""Moments at s = 0, the constraint mode counted."""


def mechanical(structure: Structure, count: int, known: Known) -> Vectors:
    """Return up to five moments relative to the tip, then fixed-interface modes, and the constraint mode."""
    constraint, _ = mechanical_constraint(structure)
    answer = held_displacements(structure)
    span = Orthonormal(structure.mechanical_size, count, structure.inertia_forces)
    vector = span.add(answer(structure.inertia_forces(constraint)))
    for _ in range(MOST_MOMENTS - 2):
        if vector is not None:
            vector = span.add(answer(structure.inertia_forces(vector)))
    if not span.is_full:
        span.add_each(held_modes(structure, count).shapes)
    return mechanical_vectors(structure, span.all())


def thermal(structure: Structure, count: int, known: Known) -> Vectors:
    """Return vectors at log-spaced shifts relative to the tip, and the constraint mode.

    Raises
    ------
    ValueError
        The duration is not known.
    """
    if known.duration is None:
        raise ValueError("krylov needs the duration of the cases for its shifts")
    constraint, _ = thermal_constraint(structure)
    answer, heat = held_temperatures(structure), structure.heat_contents(constraint)
    span = Orthonormal(structure.thermal_size, count, structure.heat_contents)
    for shift in _shifts(count, 1 / known.duration, fastest_rate(structure)):
        span.add(answer(heat, shift))
    if not span.is_full:
        span.add_each(held_thermal_modes(structure, count).shapes)
    return thermal_vectors(structure, span.all())


def _shifts(count: int, slowest: float, fastest: float) -> Iterator[float]:
    """Yield shifts, 1/s, ascending: from ``slowest`` to ``fastest``, at least a decade."""
    ends = log(np.array([slowest, max(fastest, 10 * slowest)]))
    for k in range(count):
        share = k / max(count - 1, 1)
        yield float(exp(np.array([ends[0] * (1 - share) + ends[1] * share]))[0])
