"""Models: each public module here is one, with ``Parameters`` and ``assemble(parameters)``.

The directory is the registry. A module of a name without a leading underscore is the model of
that name in ``scene:`` of a study; adding one is adding the file.
"""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import Any, Protocol, cast

from workflow.models._cases import Cases, project
from workflow.models._chain import MOST_NODES_WITH_MATRICES, Chain, TooManyNodesError
from workflow.models._equilibrium import NoEquilibriumError, static_equilibrium
from workflow.models._long_chain import frequency_range, mechanical_path, rate_range, thermal_path
from workflow.models._modes import Modes, mechanical_modes, modal_coupling, poles, thermal_modes
from workflow.models._runaway import critical_alpha, growth_rate, static_tip_growth, tip_flexibility
from workflow.models._spectrum import frequencies, rates
from workflow.models._structure import Array, Matrices, Rayleigh, Structure


class Model(Protocol):
    """What a module of this directory offers."""

    Parameters: type[Any]

    def assemble(self, parameters: Any) -> Structure:
        """Return the structure of a set of parameters."""
        ...


def names() -> tuple[str, ...]:
    """Return the names of all models, sorted."""
    return _names(tuple(__path__))


@cache
def _names(path: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted(m.name for m in pkgutil.iter_modules(path) if not m.name.startswith("_")))


def load(name: str) -> Model:
    """Return the model of a name from :func:`names`.

    Raises
    ------
    KeyError
        No model has this name.
    """
    if name not in names():
        raise KeyError(name)
    return cast(Model, import_module(f"{__name__}.{name}"))


__all__ = [
    "MOST_NODES_WITH_MATRICES",
    "Array",
    "Cases",
    "Chain",
    "Matrices",
    "Model",
    "Modes",
    "NoEquilibriumError",
    "Rayleigh",
    "Structure",
    "TooManyNodesError",
    "critical_alpha",
    "frequencies",
    "frequency_range",
    "growth_rate",
    "load",
    "mechanical_modes",
    "mechanical_path",
    "modal_coupling",
    "names",
    "poles",
    "project",
    "rate_range",
    "rates",
    "static_equilibrium",
    "static_tip_growth",
    "thermal_modes",
    "thermal_path",
    "tip_flexibility",
]
