"""Bases: each public module of this directory is one, with ``mechanical`` and ``thermal``.

The module ``NAME`` is the basis ``reduction: NAME`` of a study, which reduces a structure to one of the same type. To
add a basis, add a file; entry points of the group ``workflow.reduction`` add those of other distributions. Others use
what is imported here: :func:`reduce_structure`, and the vectors of which a basis is made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from workflow.models import Array, Sparse, Structure, TooManyCoordinatesError
from workflow.reduction._reduction import (
    ReducedModel,
    Reduction,
    Vectors,
    fixed_interface_modes,
    galerkin,
    mechanical_vectors,
    projection_residual,
    relative_thermal_modes,
    thermal_vectors,
    unreduced,
    with_friction,
)
from workflow.registry import BrokenModuleError, Registry

DEFAULT = "craig_bampton"
"""The basis where a study names none."""


@dataclass(frozen=True)
class Basis:
    """Interface of a basis.

    Attributes
    ----------
    mechanical
        ``mechanical(structure, count, duration)``: ``count`` interior displacements, 0 at the tip and orthonormal in M,
        and the tip's own vector, for cases of a duration [s], ``None`` where there are no cases.
    thermal
        The same for temperatures, orthonormal in C2.
    carried
        ``carried(structure, mechanical, thermal)``: static displacements per temperature, see
        :class:`~workflow.reduction._reduction.Reduction`. Optional.
    """

    mechanical: Callable[[Structure, int, float | None], Vectors]
    thermal: Callable[[Structure, int, float | None], Vectors]
    carried: Callable[[Structure, Vectors, Vectors], Array] | None = None


_BASES = Registry(__name__, ("mechanical", "thermal"))
names, fault = _BASES.names, _BASES.fault


def load(name: str) -> Basis:
    """Return the basis ``name``, see :meth:`~workflow.registry.Registry.load`."""
    module = _BASES.load(name)
    return Basis(module.mechanical, module.thermal, getattr(module, "carried", None))


def reduce_structure(
    structure: Structure,
    mechanical_modes: int | None,
    thermal_modes: int | None,
    basis: str = DEFAULT,
    duration: float | None = None,
) -> Reduction:
    """Reduce the interior nodes to vectors of a basis, and retain the tip (x_n, v_n, θ_n).

    Parameters
    ----------
    structure
        The full structure, or a reduced one.
    mechanical_modes, thermal_modes
        Vectors retained besides the tip's own, at most ``size - 1`` each; ``None`` leaves displacements or
        temperatures unreduced. A structure with a sliding direction gets one more vector.
    basis
        Name of the basis, one of :func:`names`.
    duration
        Duration of the cases, s; ``None`` where there are no cases.

    Raises
    ------
    ValueError
        A count is negative or exceeds the number of interior vectors, or that of modes of a chain without matrices;
        or the basis needs a duration and there is none.
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
    """Return the vectors of a basis after a check that they are ``count`` and the tip's own."""
    if not isinstance(vectors, Vectors):
        raise BrokenModuleError(f"the basis {basis} returns {type(vectors).__name__}, not Vectors")
    if vectors.shapes.shape[1] != count + 1:
        raise BrokenModuleError(f"the basis {basis} gives {vectors.shapes.shape[1] - 1} vectors for {count}")
    return vectors


def reduced_model(
    structure: Structure, mechanical_modes: int, thermal_modes: int, basis: str, duration: float
) -> ReducedModel:
    """Return a structure with counts of vectors besides the tip's own, as :func:`reduce_structure` does.

    Counts of ``size - 1`` leave displacements or temperatures unreduced.
    """
    counts = (mechanical_modes, structure.mechanical_size), (thermal_modes, structure.thermal_size)
    kept = [None if count == size - 1 else count for count, size in counts]
    if kept == [None, None]:
        return ReducedModel(structure.matrices() if isinstance(structure, Sparse) else structure, None)
    reduction = reduce_structure(structure, kept[0], kept[1], basis, duration)
    return ReducedModel(reduction.structure, reduction)
