"""What constant loads deform and warm in the end; a part that nothing holds is accelerated or warmed evenly.

On such a part loads are balanced by its inertia first, f - M r with r its rigid motion, so that a
deformation is left that the loads alone do not determine up to a rigid motion (inertia relief).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._cases import distinct_rows, project
from workflow.models._chain import Chain
from workflow.models._factors import Answer
from workflow.models._long_chain import mechanical_path, thermal_path
from workflow.models._modes import Modes, mechanical_modes, thermal_modes
from workflow.models._path import Path
from workflow.models._sparse import Sparse
from workflow.models._structure import Structure


def static_displacements(structure: Structure, loads: Array) -> Array:
    """Return K1⁻¹ f for every case, m, ``(case, mechanical)``, up to rigid motions; ``loads`` in N, alike."""
    if isinstance(structure, Chain):
        return _along(mechanical_path(structure), structure.masses, loads)
    if isinstance(structure, Sparse):
        return _each(structure.mechanical.answer_balanced, loads)
    modes = mechanical_modes(structure)
    return _by_modes(modes, modes.values**2, loads)


def static_temperatures(structure: Structure, heating: Array) -> Array:
    """Return K2⁻¹ q for every case, K, ``(case, thermal)``, up to even warming of adiabatic parts; ``heating`` in W."""
    if isinstance(structure, Chain):
        return _along(thermal_path(structure), structure.heat_capacities, heating)
    if isinstance(structure, Sparse):
        return _each(structure.thermal.answer_balanced, heating)
    modes = thermal_modes(structure)
    return _by_modes(modes, modes.values, heating)


def growth_at_once(structure: Structure) -> float:
    """Return the quasi-static tip growth by temperatures without heat capacity that heat loads raise at once, m."""
    given = structure.coordinates
    if given is None or not given.expansive.any():
        return 0.0
    return float(static_displacements(structure, (given.displacement_basis.T @ given.expansive)[None])[0, -1])


def rounding_of_flexibility(structure: Structure) -> float:
    """Return about by which share the roundings of the entries of K1 change S = e_nᵀ K1⁻¹ e_n, 1.

    With u = K1⁻¹ e_n a change of the entries changes S by -uᵀ δK1 u; half a unit in the last place of each, added as
    independent ones: ε/2 √(Σ (u_i K_ij u_j)²)/S. It is large where an entry is far larger than what it must hold of S.
    """
    tip = np.zeros((1, structure.mechanical_size))
    tip[0, -1] = 1.0
    answer = static_displacements(structure, tip)[0]
    stiffness = structure.mechanical.stiffness if isinstance(structure, Sparse) else structure.stiffness_matrix
    entries = scipy.sparse.coo_array(stiffness)
    row, column = entries.coords
    energies = answer[row] * entries.data * answer[column]
    return float(np.finfo(float).eps / 2 * np.linalg.norm(energies) / abs(answer[-1]))


def _by_modes(modes: Modes, stiffness: Array, loads: Array) -> Array:
    """Return the sum of the modal answers; modes of stiffness 0 take no part."""
    held = stiffness > 0
    shapes = np.ascontiguousarray(modes.shapes[:, held])
    return project(shapes, project(shapes.T, loads) / stiffness[held])


def _each(answer: Answer, loads: Array) -> Array:
    """Return the answers to loads, each distinct one that is not 0 solved once."""
    solved: dict[bytes, Array] = {}
    answers = np.zeros_like(loads)
    for case in np.flatnonzero(loads.any(axis=1)):
        name = loads[case].tobytes()
        if name not in solved:
            solved[name] = answer(loads[case])
        answers[case] = solved[name]
    return answers


def _along(path: Path, inertia: Array, loads: Array) -> Array:
    """Return the answers of a chain, each distinct load solved once."""
    first, which = distinct_rows(loads)
    answers = np.zeros_like(loads[first])
    for row, load in enumerate(loads[first]):
        if np.any(load):
            answer = path.solve(_balanced(path, inertia, load))
            assert answer is not None, "a balanced load moves no part for ever"
            answers[row] = answer
    return np.asarray(answers[which])


def _balanced(path: Path, inertia: Array, load: Array) -> Array:
    """Return a load without what moves loose parts as a whole, f_i - m_i Σ f / Σ m."""
    balanced = load.copy()
    for first, stop in pairwise([*np.flatnonzero(path.joint == 0).tolist(), path.size]):
        if not np.any(path.ground[first:stop]):
            share = np.cumsum(load[first:stop])[-1] / np.cumsum(inertia[first:stop])[-1]
            balanced[first:stop] -= share * inertia[first:stop]
    return balanced
