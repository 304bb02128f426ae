"""Models: each public module here is one, with ``Parameters`` and ``assemble(parameters)``.

The directory is the registry. A module of a name without a leading underscore is the model of
that name in ``scene:`` of a study; adding one is adding the file.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Protocol, cast

from workflow import registry
from workflow.kernels import Array
from workflow.models._bounds import free_reach
from workflow.models._cases import Cases, distinct_rows, project
from workflow.models._chain import Chain
from workflow.models._chain_pair import MOST_ONE_BY_ONE
from workflow.models._damping import (
    coupled_damping,
    couples_free_modes,
    held_damping,
    is_rayleigh,
    modal_damping,
    needs_matrices,
)
from workflow.models._equilibrium import NoEquilibriumError, at_rest, static_equilibrium
from workflow.models._factors import FACTORISING, MOST_BY_SUPERLU, has_cholmod
from workflow.models._fill import Fill, LargeFactorsWarning, expected_fill
from workflow.models._from_matrices import GivenMatrices, structure_from_matrices
from workflow.models._growth import Growth, InContact, growth, growth_rate, in_contact
from workflow.models._harmonics import NO_HARMONICS, Harmonics
from workflow.models._modes import mechanical_modes, modal_coupling, poles, thermal_modes
from workflow.models._pair import MOST_FULL, DensePair, Modes, Pair, TooManyCoordinatesError
from workflow.models._runaway import critical_alpha, static_tip_growth, tip_flexibility
from workflow.models._semidefinite import UnusableMatricesError
from workflow.models._sliding import CriticalFriction, critical_friction, directions
from workflow.models._sparse import Sparse
from workflow.models._sparse_from_matrices import structure_from_sparse
from workflow.models._sparse_pair import MOST_REDUCED
from workflow.models._static import frequencies, growth_at_once, rates, rounding_of_flexibility
from workflow.models._structure import Coordinates, Matrices, Rayleigh, Structure
from workflow.models._write_matrices import write_matrices


class Model(Protocol):
    """What a module of this directory offers."""

    Parameters: type[Any]

    def assemble(self, parameters: Any) -> Structure:
        """Return the structure of a set of parameters."""
        ...


_REQUIRED = ("Parameters", "assemble")


def names() -> tuple[str, ...]:
    """Return the names of all models, sorted."""
    return registry.names(__name__)


@lru_cache(maxsize=1024)
def sizes(name: str, parameters: Any) -> tuple[int, int]:
    """Return the numbers of mechanical and thermal coordinates of a model's structure, the tip's included."""
    structure = load(name).assemble(parameters)
    return structure.mechanical_size, structure.thermal_size


def most_modes(name: str, parameters: Any) -> int | None:
    """Return the most modes of each kind of a structure that is too large to be kept full, ``None`` of any other."""
    structure = load(name).assemble(parameters)
    return None if structure.has_matrices else structure.mechanical.most_modes


def fault(name: str) -> str | None:
    """Return why the model of a name cannot be used, ``None`` if it can."""
    return registry.fault(__name__, name, _REQUIRED)


def load(name: str) -> Model:
    """Return the model of a name from :func:`names`.

    Raises
    ------
    KeyError
        No model has this name.
    BrokenModuleError
        Its module cannot be used.
    """
    return cast(Model, registry.load(__name__, name, _REQUIRED))


__all__ = [
    "FACTORISING",
    "MOST_BY_SUPERLU",
    "MOST_FULL",
    "MOST_ONE_BY_ONE",
    "MOST_REDUCED",
    "NO_HARMONICS",
    "Array",
    "Cases",
    "Chain",
    "Coordinates",
    "CriticalFriction",
    "DensePair",
    "Fill",
    "GivenMatrices",
    "Growth",
    "Harmonics",
    "InContact",
    "LargeFactorsWarning",
    "Matrices",
    "Model",
    "Modes",
    "NoEquilibriumError",
    "Pair",
    "Rayleigh",
    "Sparse",
    "Structure",
    "TooManyCoordinatesError",
    "UnusableMatricesError",
    "at_rest",
    "coupled_damping",
    "couples_free_modes",
    "critical_alpha",
    "critical_friction",
    "directions",
    "distinct_rows",
    "expected_fill",
    "fault",
    "free_reach",
    "frequencies",
    "growth",
    "growth_at_once",
    "growth_rate",
    "has_cholmod",
    "held_damping",
    "in_contact",
    "is_rayleigh",
    "load",
    "mechanical_modes",
    "modal_coupling",
    "modal_damping",
    "most_modes",
    "names",
    "needs_matrices",
    "poles",
    "project",
    "rates",
    "rounding_of_flexibility",
    "sizes",
    "static_equilibrium",
    "static_tip_growth",
    "structure_from_matrices",
    "structure_from_sparse",
    "thermal_modes",
    "tip_flexibility",
    "write_matrices",
]
