"""Data of a case changed by what rounding may change: how much of its results another machine can repeat."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

from workflow.declare import File
from workflow.grid._conditions import conditions
from workflow.grid._operators import full_structure
from workflow.judges.distances import perturbed
from workflow.models import Array, Cases
from workflow.study import CaseSettings

SHARE = 1e-12
"""Relative change of the data: ten thousand roundings, some of which other libraries make otherwise."""


@dataclass(frozen=True)
class Perturbation:
    """A change of all data of a case but its discretisation, in one of two directions.

    Attributes
    ----------
    direction
        1 or -1.
    reach
        Largest displacement of the tip, m: the gap changes by :data:`SHARE` of it, also where it is 0.
    """

    direction: int
    reach: float


def cases_of(
    settings: CaseSettings, varying: Mapping[str, Array], count: int, perturbation: Perturbation | None = None
) -> tuple[CaseSettings, Cases]:
    """Return settings, and their cases on the full structure, both with their data changed if asked.

    See :func:`workflow.grid._conditions.conditions`.
    """
    if perturbation is None:
        return settings, conditions(settings, full_structure(settings), varying, count)
    share, scene = perturbation.direction * SHARE, settings.scene
    settings = replace(settings, scene=replace(scene, parameters=_changed(scene.parameters, share)))
    cases = conditions(settings, full_structure(settings), varying, count)
    return settings, perturbed(cases, share, perturbation.reach)


def _changed(value: Any, share: float) -> Any:
    """Return numbers changed by a share of them, neighbours in opposite directions; counts and words as they are.

    Numbers in a file are changed by the model that reads them.
    """
    if isinstance(value, float):
        return value * (1 + share)
    if isinstance(value, tuple):
        return tuple(_changed(item, share if k % 2 == 0 else -share) for k, item in enumerate(value))
    if isinstance(value, File):
        return replace(value, shaken=share)
    if is_dataclass(value) and not isinstance(value, type):
        named = [field.name for field in fields(value) if field.init]
        changed = {
            name: _changed(getattr(value, name), share if k % 2 == 0 else -share) for k, name in enumerate(named)
        }
        return replace(value, **changed)
    return value
