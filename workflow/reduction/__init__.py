"""Bases: each public module of this directory is one, with ``mechanical`` and ``thermal``.

The module ``NAME`` is the basis ``reduction: NAME`` of a study, which reduces a structure to one of the same type. To
add a basis, add a file; entry points of the group ``workflow.reduction`` add those of other distributions. Others use
what is imported here: :func:`reduce_structure`, and the vectors of which a basis is made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from workflow.models import Array, Contacts, Structure, TooManyCoordinatesError, contacts_last
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
    with_friction_on_resolved_modes,
)
from workflow.registry import BrokenModuleError, Registry

DEFAULT = "craig_bampton"
"""The basis where a study names none."""

OF_AUTO = "krylov"
"""The basis where a study names none and leaves a count to a tolerance: the fewest vectors, of heat by far."""


@dataclass(frozen=True)
class Basis:
    """Interface of a basis."""

    mechanical: Callable[[Structure, int, float | None], Vectors]
    """``mechanical(structure, count, duration)``: ``count`` interior displacements, 0 at the tip and orthonormal in M,
    and the tip's own vector, for cases of a duration [s], ``None`` where there are no cases. Of a structure with
    several contacts the last ``structure.mechanical.boundary`` coordinates are theirs."""
    thermal: Callable[[Structure, int, float | None], Vectors]
    """The same for temperatures, orthonormal in C2."""
    carried: Callable[[Structure, Vectors, Vectors], Array] | None = None
    """``carried(structure, mechanical, thermal)``: static displacements per temperature, see
    :class:`~workflow.reduction._reduction.Reduction`. Optional."""
    CONTACTS: frozenset[str] = frozenset()
    """Kinds of contacts besides one with mass that it takes: ``several`` of them, or ``massless`` ones."""


def takes(basis: str, contacts: Contacts) -> bool:
    """Tell whether a basis takes the contacts of a structure."""
    return contacts.is_one_with_mass or ("massless" if contacts.is_massless else "several") in load(basis).CONTACTS


_BASES = Registry(__name__, ("mechanical", "thermal"))
names, fault = _BASES.names, _BASES.fault


def load(name: str) -> Basis:
    """Return the basis ``name``, see :meth:`~workflow.registry.Registry.load`."""
    module = _BASES.load(name)
    offered = {name: getattr(module, name) for name in ("carried", "CONTACTS") if hasattr(module, name)}
    return Basis(module.mechanical, module.thermal, **offered)


def reduce_structure(
    structure: Structure,
    mechanical_modes: int | None,
    thermal_modes: int | None,
    basis: str = DEFAULT,
    duration: float | None = None,
) -> Reduction:
    """Reduce the interior nodes to vectors of a basis, and retain the contacts, such as the tip (x_n, v_n, θ_n).

    Parameters
    ----------
    structure
        The full structure, or a reduced one.
    mechanical_modes, thermal_modes
        Vectors retained besides the tip's own, at most ``size - 1`` each; ``None`` leaves displacements or
        temperatures unreduced. A structure with a sliding direction gets one more vector. Several contacts have a
        vector of their own for each row that does not depend on others.
    basis
        Name of the basis, one of :func:`names`.
    duration
        Duration of the cases, s; ``None`` where there are no cases.

    Raises
    ------
    ValueError
        A count is negative or exceeds the number of interior vectors, or that of modes of a chain without matrices;
        the basis needs a duration and there is none, or does not take the contacts.
    """
    if not takes(basis, structure.contacts):
        raise ValueError(f"{basis} does not take several contacts, or contacts without mass")
    last = contacts_last(structure)
    if last is None:
        return _reduce(structure, mechanical_modes, thermal_modes, basis, duration)
    return _reduce(last.structure, mechanical_modes, thermal_modes, basis, duration).given_in(last)


def _reduce(
    structure: Structure, mechanical_modes: int | None, thermal_modes: int | None, basis: str, duration: float | None
) -> Reduction:
    """Reduce a structure whose contacts are its last coordinates."""
    counts = (mechanical_modes, structure.mechanical), (thermal_modes, structure.thermal)
    for count, pair in counts:
        if count is not None and not 0 <= count <= pair.size - pair.boundary:
            raise ValueError(f"{count} interior modes of a structure that has {pair.size - pair.boundary}")
        large = not structure.has_matrices and pair.size > pair.most_modes + 1
        if large and (count is None or count > pair.most_modes):
            raise TooManyCoordinatesError(pair.size, pair.most_modes)
    chosen, of_both = load(basis), []
    for (count, pair), vectors_of in zip(counts, (chosen.mechanical, chosen.thermal), strict=True):
        if count is None:
            of_both.append(unreduced(pair))
            continue
        vectors = vectors_of(structure, count, duration)
        if not isinstance(vectors, Vectors):
            raise BrokenModuleError(f"the basis {basis} returns {type(vectors).__name__}, not Vectors")
        given = vectors.shapes.shape[1] - (pair.boundary if vectors.residual is None else 0)
        if given != count:
            raise BrokenModuleError(f"the basis {basis} gives {given} vectors for {count}")
        of_both.append(vectors)
    mechanical, thermal = of_both
    carried, slides = None, structure.contacts.slides and mechanical_modes is not None and mechanical.residual is None
    if slides:
        mechanical = with_friction(structure, mechanical)
    if chosen.carried is not None and mechanical_modes is not None:
        carried = chosen.carried(structure, mechanical, thermal)
    reduction = galerkin(structure, mechanical, thermal, carried)
    several = structure.contacts.count > 1  # of one contact no basis was seen to flutter
    return with_friction_on_resolved_modes(structure, reduction) if slides and several else reduction


def reduced_model(
    structure: Structure, mechanical_modes: int, thermal_modes: int, basis: str, duration: float
) -> ReducedModel:
    """Return a structure with counts of vectors besides the tip's own, as :func:`reduce_structure` does.

    Counts of ``size - 1`` leave displacements or temperatures unreduced.
    """
    counts = (mechanical_modes, structure.mechanical_size), (thermal_modes, structure.thermal_size)
    kept = [None if count == size - 1 else count for count, size in counts]
    if kept == [None, None]:
        return ReducedModel(structure.matrices() if structure.is_sparse else structure, None)
    reduction = reduce_structure(structure, kept[0], kept[1], basis, duration)
    return ReducedModel(reduction.structure, reduction)
