"""Krylov: moment matching of the tip's response to forces and heat; fewest vectors for a given error.

Mechanical: moments of the response to a tip force at s = 0, K1⁻¹ e_n, K1⁻¹ M K1⁻¹ e_n, … With the tip held they span
the same space as the constraint mode ψ ∝ K1⁻¹ e_n and, in the interior (i, i),

    w_1 = K1⁻¹ M ψ,   w_{k+1} = K1⁻¹ M w_k,

which exist for a free root too. At most six with ψ, as later ones converge to the lowest mode. Then follow
fixed-interface modes. Thermal: rational Krylov vectors (K2 + s C2)⁻¹ e_n, which with ψ ∝ K2⁻¹ e_n span the same as

    w_s = (K2 + s C2)⁻¹ C2 ψ   in the interior,

at as many log-spaced shifts s as vectors of a contact, from 1/duration to the larger of 10/duration and the largest
eigenvalue with the tip held. Dependent vectors are replaced by the slowest modes with the tip held. All vectors are
orthonormalised in M or C2 one after another, each twice. α_c is exact: S and K2⁻¹ e_n need ψ only.

The new part of a moment or a shift falls to 1e-8 of it and below, and rounding of LAPACK and SuperLU then turns the
last vectors by tenths. Above 300 coordinates, where these find solutions and modes, each vector is therefore computed
from the orthogonalised one before: its new part is a tenth of it, and spaces agree to 1e-11 from processor to
processor. Modes come first; as moments of modes stay in their span, moments of the part of ψ orthogonal to them span
the same space with them. There are six shifts, each for a sixth of the vectors: six factorisations, with about the
accuracy of a shift for each vector.

Source: Grimme, Krylov projection methods for model reduction (thesis, Urbana 1997); Antoulas, Approximation of
large-scale dynamical systems (SIAM 2005), chapter 11; Ruhe, Linear Algebra Appl. 58 (1984) 391-405, for the recurrence.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models import Array, Pair, Structure
from workflow.reduction._reduction import Orthonormal, Vectors, mechanical_vectors, thermal_vectors

CONTACTS = frozenset({"several"})

MOST_MOMENTS = 6
"""Moments of a contact at s = 0, the constraint mode included."""

MOST_SHIFTS = 6
"""Different shifts where each vector is computed from the one before: on the chains of ``studies/scaling.yaml`` fewer
have a markedly larger error, twice as many a hardly smaller one."""


def mechanical(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return up to five moments of each contact relative to it and fixed-interface modes, and the constraint modes."""
    pair = structure.mechanical
    begin, span = list(pair.constraint.T), Orthonormal(pair.size, count, pair.inertia_of)
    if not _is_small(structure):
        span.add_each(pair.modes(max(count - (MOST_MOMENTS - 1) * len(begin), 0), held=True).shapes)
        begin = [span.apart(constraint) for constraint in begin]
    _add_moments(pair, span, begin)
    if not span.is_full:
        span.add_each(pair.modes(count, held=True).shapes)
    return mechanical_vectors(structure, span.all())


def thermal(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return vectors at log-spaced shifts relative to the tip, and the constraint mode.

    Raises
    ------
    ValueError
        ``duration`` is ``None``.
    """
    if duration is None:
        raise ValueError("krylov needs the duration of the cases for its shifts")
    pair = structure.thermal
    solve, heat = pair.shifted_solver(), [pair.inertia_of(each) for each in pair.constraint.T]
    span, contacts = Orthonormal(pair.size, count, pair.inertia_of), pair.boundary
    each_alone, rounds = _is_small(structure), -(-count // contacts)
    different = rounds if each_alone else min(rounds, MOST_SHIFTS)
    spaced = np.geomspace(1 / duration, max(pair.largest(), 10 / duration), different)
    shifts = [float(f"{shift:.12g}") for shift in spaced]  # digits in which all C libraries agree
    for k in range(count):
        turn, contact = divmod(k, contacts)
        vector = span.add(solve(heat[contact], shifts[turn * different // rounds]))
        if vector is not None and not each_alone:
            heat[contact] = pair.inertia_of(vector)
    if not span.is_full:
        span.add_each(pair.modes(count, held=True).shapes)
    return thermal_vectors(structure, span.all())


def _is_small(structure: Structure) -> bool:
    """Tell whether solutions and modes of a structure have the same bits on every processor."""
    return max(structure.mechanical_size, structure.thermal_size) <= MOST_BY_JACOBI


def _add_moments(pair: Pair, span: Orthonormal, begin: list[Array]) -> None:
    """Add up to five Krylov vectors (K⁻¹ M)^k of each that ``begin`` with the tip held; stop at a dependent one."""
    vectors: list[Array | None] = [*begin]
    for _ in range(MOST_MOMENTS - 1):
        for k, vector in enumerate(vectors):
            if vector is not None:
                vectors[k] = span.add(pair.solve(pair.inertia_of(vector), held=True))
