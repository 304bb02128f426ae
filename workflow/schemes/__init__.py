"""Schemes: each public module of this directory is one, and the directory is their registry.

The module ``NAME`` is the scheme ``method: NAME`` of a study; to add a scheme, add a file. Entry points of the group
``workflow.schemes`` add those of other distributions. The fields of :class:`Scheme` say what a module must define.
"""

from __future__ import annotations

from workflow.models import Cases
from workflow.registry import Registry
from workflow.schemes._contract import ContractError, checked, refuse
from workflow.schemes._fixed.central import Differences as CentralDifferences
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.law import Response, Tip
from workflow.schemes._fixed.march import contact_law
from workflow.schemes._fixed.operator import compute as step_central  # the operator of its `init` knows how it steps
from workflow.schemes._fixed.operator import compute as step_theta
from workflow.schemes._fixed.operator import init as init_central
from workflow.schemes._fixed.recorder import Recorder
from workflow.schemes._fixed.step_limits import limit_text
from workflow.schemes._fixed.theta_method import init as init_theta
from workflow.schemes._interface import (
    HISTORIES,
    LINEAR,
    SECTIONS,
    RefusedStructureError,
    Results,
    Sampling,
    Schedule,
    Scheme,
    Status,
    complete_periods,
    schedule,
)
from workflow.variables import Variable, of_scheme

SOLVER_VERSION = 19
"""Version of the physics, one more with each change of results: archives do not mix versions."""


_SCHEMES = Registry(__name__, Scheme.required())
names, fault = _SCHEMES.names, _SCHEMES.fault


def load(name: str) -> Scheme:
    """Return the scheme ``name``, see :meth:`~workflow.registry.Registry.load`."""
    module = _SCHEMES.load(name)
    return Scheme.of(module, frozenset({"contacts"} if module.compute is step_theta else ()))


def metrics(name: str) -> tuple[Variable, ...]:
    """Return the metrics that a scheme declares besides the common ones."""
    return tuple(of_scheme(metric, unit, meaning) for metric, (unit, meaning) in load(name).METRICS.items())
