"""Schemes: each public module here is one; the directory is the registry.

A module of a name without a leading underscore is the scheme ``method: NAME`` of a study; adding
one is adding the file. It offers

``Options``
    frozen dataclass of its options, declared with :func:`workflow.declare.quantity`.
``READS``
    which of the axes ``e``, ``h``, ``alpha`` change its results (everything else of the scene
    does, and so do its own options). Cases that differ in other axes are computed once.
``init(structure, h, options)``
    work that depends on the operator alone, done once per batch.
``compute(operator, cases, sampling)``
    the whole batch; a case's numbers do not depend on its neighbours, bit for bit.
``cost``, ``amplification``, ``thermal_amplification``
    what ``plan`` says before anything runs.

It may offer

``METRICS``
    metrics that it gives beside those of :class:`Results`, name to unit and meaning.
``contact_limit(structure, options)``
    the step, s, above which its motion grows while the tip is in contact.
``TOGETHER``
    cases of a batch that are stepped at once, and cost little more than one of them.
``is_swept(structure)``, ``operator_name(structure)``
    whether it steps a structure node by node instead of by its modes, each case by itself, and how ``plan`` says so.
``rigid(structure, h)``
    options with which it approaches a rigid casing as h → 0, where not all do.
"""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import cast

from workflow.models import Cases
from workflow.schemes._interface import (
    HISTORIES,
    Results,
    Sampling,
    Schedule,
    Scheme,
    Status,
    complete_periods,
    schedule,
)

SOLVER_VERSION = 2
"""Raised whenever a change of the physics floor changes results: archives do not mix versions."""


def names() -> tuple[str, ...]:
    """Return the names of all schemes, sorted."""
    return _names(tuple(__path__))


@cache
def _names(path: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted(m.name for m in pkgutil.iter_modules(path) if not m.name.startswith("_")))


def load(name: str) -> Scheme:
    """Return the scheme of a name from :func:`names`.

    Raises
    ------
    KeyError
        No scheme has this name.
    """
    if name not in names():
        raise KeyError(name)
    return cast(Scheme, import_module(f"{__name__}.{name}"))


def metrics(name: str) -> dict[str, tuple[str, str]]:
    """Return the metrics that a scheme gives beside the common ones: name to unit and meaning."""
    return dict(getattr(load(name), "METRICS", {}))


__all__ = [
    "HISTORIES",
    "SOLVER_VERSION",
    "Cases",
    "Results",
    "Sampling",
    "Schedule",
    "Scheme",
    "Status",
    "complete_periods",
    "load",
    "metrics",
    "names",
    "schedule",
]
