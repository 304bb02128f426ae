"""Bases: each public module here is one, with ``mechanical`` and ``thermal``; the directory is the registry.

A module of a name without a leading underscore is the basis ``reduction: NAME`` of a study: full structure in,
structure of the same type out. Adding one is adding the file; entry points of the group ``workflow.reduction`` add
bases from outside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from workflow.models import Array, Sparse, Structure, TooManyCoordinatesError
from workflow.reduction._bases import fixed_interface_modes, relative_thermal_modes
from workflow.reduction._friction import with_friction
from workflow.reduction._reduction import (
    ReducedModel,
    Reduction,
    Vectors,
    galerkin,
    mechanical_vectors,
    thermal_vectors,
    unreduced,
)
from workflow.reduction._residual import projection_residual
from workflow.registry import BrokenModuleError, Registry

DEFAULT = "craig_bampton"
"""The basis where a study names none."""


@dataclass(frozen=True)
class Basis:
    """What a module of this directory offers.

    Attributes
    ----------
    mechanical
        From a structure, a count and the duration of every case [s], ``None`` where there are no cases: so many
        interior displacements, 0 at the tip and orthonormal in M, and the tip's own vector.
    thermal
        The same for temperatures, orthonormal in C2.
    carried
        From a structure and both bases: displacements that temperatures carry with them, see
        :class:`~workflow.reduction._reduction.Reduction`. May be left out.
    """

    mechanical: Callable[[Structure, int, float | None], Vectors]
    thermal: Callable[[Structure, int, float | None], Vectors]
    carried: Callable[[Structure, Vectors, Vectors], Array] | None = None


_BASES = Registry(__name__, ("mechanical", "thermal"))
names, fault = _BASES.names, _BASES.fault


def load(name: str) -> Basis:
    """Return the basis of a name, see :meth:`~workflow.registry.Registry.load`."""
    module = _BASES.load(name)
    return Basis(module.mechanical, module.thermal, getattr(module, "carried", None))


def reduce_structure(
    structure: Structure,
    mechanical_modes: int | None,
    thermal_modes: int | None,
    basis: str = DEFAULT,
    duration: float | None = None,
) -> Reduction:
    """Replace interior nodes by vectors of a basis, keep the tip (x_n, v_n, θ_n) as it is.

    Parameters
    ----------
    structure
        The full structure, or a reduced one.
    mechanical_modes, thermal_modes
        Vectors kept beside the tip's own, at most ``size - 1`` each; ``None`` leaves displacements or
        temperatures as they are. Of a structure with a direction of friction a vector of its own is added.
    basis
        Name of the basis, one of :func:`names`.
    duration
        Of every case, s; ``None`` where there are no cases.

    Raises
    ------
    ValueError
        A count is negative or exceeds the number of interior vectors, or that of modes of a chain without matrices;
        or the basis takes a duration and there is none.
    """
    for count, pair in ((mechanical_modes, structure.mechanical), (thermal_modes, structure.thermal)):
        if count is not None and not 0 <= count <= pair.size - 1:
            raise ValueError(f"{count} interior modes of a structure that has {pair.size - 1}")
        large = not structure.has_matrices and pair.size > pair.most_modes + 1
        if large and (count is None or count > pair.most_modes):
            raise TooManyCoordinatesError(pair.size, pair.most_modes)
    chosen = load(basis)
    if mechanical_modes is None:
        mechanical = unreduced(structure.mechanical)
    else:
        mechanical = _counted(chosen.mechanical(structure, mechanical_modes, duration), mechanical_modes, basis)
    if thermal_modes is None:
        thermal = unreduced(structure.thermal)
    else:
        thermal = _counted(chosen.thermal(structure, thermal_modes, duration), thermal_modes, basis)
    carried = None
    if structure.tangent is not None and mechanical_modes is not None:
        mechanical = with_friction(structure, structure.tangent, mechanical)
    if chosen.carried is not None and mechanical_modes is not None:
        carried = chosen.carried(structure, mechanical, thermal)
    return galerkin(structure, mechanical, thermal, carried)


def _counted(vectors: Vectors, count: int, basis: str) -> Vectors:
    """Return what a basis gives, if that is so many vectors and the tip's own."""
    if not isinstance(vectors, Vectors):
        raise BrokenModuleError(f"the basis {basis} returns {type(vectors).__name__}, not Vectors")
    if vectors.shapes.shape[1] != count + 1:
        raise BrokenModuleError(f"the basis {basis} gives {vectors.shapes.shape[1] - 1} vectors for {count}")
    return vectors


def reduced_model(
    structure: Structure, mechanical_modes: int, thermal_modes: int, basis: str, duration: float
) -> ReducedModel:
    """Return a structure with so many vectors beside the tip's own; parameters are those of :func:`reduce_structure`.

    Counts of ``size - 1`` leave displacements or temperatures as they are.
    """
    counts = (mechanical_modes, structure.mechanical_size), (thermal_modes, structure.thermal_size)
    kept = [None if count == size - 1 else count for count, size in counts]
    if kept == [None, None]:
        return ReducedModel(structure.matrices() if isinstance(structure, Sparse) else structure, None)
    reduction = reduce_structure(structure, kept[0], kept[1], basis, duration)
    return ReducedModel(reduction.structure, reduction)
