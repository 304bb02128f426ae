"""Models: each public module of this directory is one, with ``Parameters`` and ``assemble(parameters)``.

The module ``NAME`` is the model ``NAME`` in ``scene:`` of a study; to add a model, add a file. It assembles a
:class:`Structure`, two pairs of stiffness and inertia with heat between them, which gives static answers, modes and
growth rates. Others use what is imported here.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any, Protocol, cast

from threadpoolctl import ThreadpoolController

from workflow.kernels import Array
from workflow.models._cases import Cases, EndState, Harmonics, distinct_rows, period_frequency, project, row_totals
from workflow.models._coating import AT_BORDER, MOST_SECTORS, Coating, coated_forces
from workflow.models._contact_basis import ContactBasis, analyse_contacts
from workflow.models._contact_coordinates import ContactsLast, contacts_last, independent_rows
from workflow.models._contact_system import ContactSystem, contact_system
from workflow.models._contacts import Contacts, closed_sets, set_text, stops_together, the_tip
from workflow.models._factors import FACTORISING, MOST_BY_SUPERLU, Fill, LargeFactorsWarning, expected_fill, has_cholmod
from workflow.models._from_matrices import GivenMatrices, structure_from_matrices, structure_from_sparse
from workflow.models._growth import Growth, growth_of_sets, growth_rate, poles_in_contact, worst
from workflow.models._matrix_files import discard_files, files_laid_out
from workflow.models._modes import (
    coupled_damping,
    couples_free_modes,
    frequencies,
    mechanical_modes,
    modal_coupling,
    modal_damping,
    needs_matrices,
    poles,
    rates,
    thermal_modes,
)
from workflow.models._pair import MOST_FULL, DensePair, Modes, Pair, TooManyCoordinatesError, UnusableMatricesError
from workflow.models._sensor_rows import given_sensors, node_rows
from workflow.models._sensors import Sensor, Sensors, sensed_values
from workflow.models._sparse_pair import MOST_REDUCED
from workflow.models._static import (
    CriticalFriction,
    NoEquilibriumError,
    at_rest,
    compliant_places,
    critical_alpha,
    critical_alphas,
    critical_friction,
    free_reach,
    rounding_of_flexibility,
    static_growth,
    static_reach,
    statics,
    steady_warmth,
)
from workflow.models._structure import Coordinates, Matrices, Rayleigh, Structure
from workflow.models._turning import casing_contacts, matrices_at_speeds
from workflow.models.chain import MOST_ONE_BY_ONE, Chain
from workflow.models.matrices import read_matrices, write_matrices
from workflow.registry import Registry


class Model(Protocol):
    """Interface of a model's module."""

    Parameters: type[Any]

    def assemble(self, parameters: Any) -> Structure:
        """Return the structure of a set of parameters."""
        ...


_MOST_STRUCTURES = 16
"""Structures kept per process; a large one from files takes seconds to assemble."""

_MODELS = Registry(__name__, ("Parameters", "assemble"))
names, fault = _MODELS.names, _MODELS.fault


def load(name: str) -> Model:
    """Return the model ``name``, see :meth:`~workflow.registry.Registry.load`."""
    return cast(Model, _MODELS.load(name))


@cache
def _libraries() -> ThreadpoolController:
    """Return the libraries whose threads are limited: to find them takes longer than a small structure."""
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread: results do not depend on their number."""
    return cast(AbstractContextManager[Any], _libraries().limit(limits=1, user_api="blas"))


@lru_cache(maxsize=_MOST_STRUCTURES)
def structure_of(name: str, parameters: Any) -> Structure:
    """Return the full structure of a model, made by one thread of BLAS wherever it is made.

    Its files are what was read of them, whatever lies at their places by now.
    """
    with one_thread(), files_laid_out(parameters) as own:
        return load(name).assemble(own)


@lru_cache(maxsize=_MOST_STRUCTURES)
def sensors_of(name: str, parameters: Any, sensors: tuple[Sensor, ...]) -> Sensors:
    """Return the rows of sensors of a model's full structure.

    A model may define ``sensor_rows(parameters, sensors, structure)``, their rows of the displacements or temperatures
    in which cases are given; of others a sensor is at a node, from 1 on.

    Raises
    ------
    UnusableMatricesError
        There is no such place.
    """
    structure, rows_of = structure_of(name, parameters), getattr(load(name), "sensor_rows", node_rows)
    with one_thread(), files_laid_out(parameters) as own:
        return given_sensors(sensors, rows_of(own, sensors, structure), structure)


@lru_cache(maxsize=_MOST_STRUCTURES)
def labels_of(name: str, parameters: Any, of_heat: bool) -> tuple[str, ...]:
    """Return the labels of the displacements, or temperatures, in which a model's cases are given: its ``labels``."""
    labels = getattr(load(name), "labels", lambda own, of_heat: ())
    with files_laid_out(parameters) as own:
        return tuple(labels(own, of_heat))


@lru_cache(maxsize=1024)
def depends_on_speed(name: str, parameters: Any) -> bool:
    """Tell whether a model's structure depends on the speed of its scene: its ``depends_on_speed`` says so."""
    depends = getattr(load(name), "depends_on_speed", None)
    if depends is None:
        return False
    with files_laid_out(parameters) as own:
        return bool(depends(own))


def at_speed(name: str, parameters: Any, speed: float) -> Any:
    """Return the parameters of a model with the speed of its scene, rev/s, where its structure depends on it."""
    return replace(parameters, speed=speed) if speed and depends_on_speed(name, parameters) else parameters


@lru_cache(maxsize=1024)
def sizes(name: str, parameters: Any) -> tuple[int, int]:
    """Return the numbers of mechanical and thermal coordinates of a model's structure, the tip's included."""
    structure = structure_of(name, parameters)
    return structure.mechanical_size, structure.thermal_size


def most_modes(name: str, parameters: Any) -> int | None:
    """Return the largest number of modes of each kind of a structure too large to be kept full, else ``None``."""
    structure = structure_of(name, parameters)
    return None if structure.has_matrices else structure.mechanical.most_modes
