"""Structures that cases are given and run on, each made once and kept while in use."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from workflow.models import Structure, one_thread, structure_of
from workflow.reduction import ReducedModel, reduced_model
from workflow.study import CaseSettings

_MOST_STRUCTURES = 16
"""Reduced models kept per process; tasks run through them in order, so few are alive at a time."""


def full_structure(settings: CaseSettings) -> Structure:
    """Return the full structure of a case, on whose nodes its conditions are given."""
    return structure_of(settings.scene.model, settings.scene.parameters)


@dataclass(frozen=True)
class Reduced:
    """What decides the structure that a case is run on: model, basis, counts of modes, duration."""

    model: str
    parameters: Any
    basis: str
    modes: tuple[int, int]
    duration: float


def reduced(settings: CaseSettings) -> Reduced:
    """Return what decides the structure that a case is run on."""
    scene = settings.scene
    modes = settings.mechanical_modes, settings.thermal_modes
    return Reduced(scene.model, scene.parameters, settings.reduction, modes, scene.duration)


@lru_cache(maxsize=_MOST_STRUCTURES)
def model_on(by: Reduced) -> ReducedModel:
    """Return the structure of a model as its basis leaves it, and its reduction."""
    with one_thread():
        return reduced_model(structure_of(by.model, by.parameters), *by.modes, by.basis, by.duration)


def reduced_structure(settings: CaseSettings) -> Structure:
    """Return the structure that a case is run on."""
    return model_on(reduced(settings)).structure
