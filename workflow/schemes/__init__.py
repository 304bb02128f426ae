"""Schemes: each public module here is one; the directory is the registry.

A module of a name without a leading underscore is the scheme ``method: NAME`` of a study; adding one is adding the
file. Entry points of the group ``workflow.schemes`` add schemes from outside. What a module offers, and what it may
leave out, are the fields of :class:`Scheme`.
"""

from __future__ import annotations

from workflow.models import Cases
from workflow.registry import Registry
from workflow.schemes._contract import ContractError, checked, refuse
from workflow.schemes._fixed.contact import Contact, Response, Tip
from workflow.schemes._fixed.march import contact_law
from workflow.schemes._fixed.recorder import Recorder
from workflow.schemes._fixed.stable_steps import limit_text
from workflow.schemes._fixed.theta_method import compute as step_theta
from workflow.schemes._fixed.theta_method import init as init_theta
from workflow.schemes._interface import (
    HISTORIES,
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

SOLVER_VERSION = 11
"""Raised whenever a change of the physics floor changes results: archives do not mix versions."""


_SCHEMES = Registry(__name__, Scheme.required())
names, fault = _SCHEMES.names, _SCHEMES.fault


def load(name: str) -> Scheme:
    """Return the scheme of a name, see :meth:`~workflow.registry.Registry.load`."""
    return Scheme.of(_SCHEMES.load(name))


def metrics(name: str) -> tuple[Variable, ...]:
    """Return the metrics that a scheme declares beside the common ones."""
    return tuple(of_scheme(metric, unit, meaning) for metric, (unit, meaning) in load(name).METRICS.items())
