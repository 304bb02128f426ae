"""Structures that cases are given and run on, each made once and kept while in use."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from workflow.cases._kept_models import kept_model
from workflow.cases._waiting_for import preparing
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models import Structure, one_thread, structure_of
from workflow.reduction import ReducedModel, reduced_model
from workflow.study import CaseSettings

_MOST_STRUCTURES = 16
"""Reduced models kept per process; tasks run through them in order, so few are alive at a time."""


def full_structure(settings: CaseSettings) -> Structure:
    """Return the full structure of a case with the flexibility of its casing; conditions are given on its nodes."""
    scene = settings.scene
    return _full(scene.model, scene.parameters, scene.casing.flexibility)


@lru_cache(maxsize=_MOST_STRUCTURES)
def _full(model: str, parameters: Any, casing_flexibility: float) -> Structure:
    return structure_of(model, parameters).on_casing(casing_flexibility)


@dataclass(frozen=True)
class Reduced:
    """What decides the structure that a case is run on: model, basis, counts of modes, duration, casing."""

    model: str
    parameters: Any
    basis: str
    modes: tuple[int, int]
    duration: float
    casing_flexibility: float


def reduced(settings: CaseSettings) -> Reduced:
    """Return what decides the structure that a case is run on."""
    scene = settings.scene
    modes = settings.mechanical_modes, settings.thermal_modes
    casing = scene.casing.flexibility
    return Reduced(scene.model, scene.parameters, settings.reduction, modes, scene.duration, casing)


@lru_cache(maxsize=_MOST_STRUCTURES)
def model_on(by: Reduced) -> ReducedModel:
    """Return the structure of a model as its basis leaves it, and its reduction."""
    full = structure_of(by.model, by.parameters)

    def made() -> ReducedModel:
        with one_thread(), preparing():
            return reduced_model(full, *by.modes, by.basis, by.duration)

    model = kept_model(replace(by, casing_flexibility=0.0), made) if full.mechanical_size > MOST_BY_JACOBI else made()
    return model._replace(structure=model.structure.on_casing(by.casing_flexibility))


def reduced_structure(settings: CaseSettings) -> Structure:
    """Return the structure that a case is run on."""
    return model_on(reduced(settings)).structure
