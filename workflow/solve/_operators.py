"""Structures, reductions and operators of a study, each made once and kept while in use; figures of structures."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from workflow import models, schemes
from workflow.cases import Reduced, full_structure, model_on, reduced, reduced_structure
from workflow.judges.blow_ups import PermanentContact, Runaways, mark_blown_up
from workflow.reduction import projection_residual
from workflow.schemes import Results, Sampling
from workflow.solve._compile import KernelVariant, compile_scheme
from workflow.study import CaseSettings

Watched = tuple[models.Sensor, ...]

_MOST_OPERATORS = 16
"""Operators kept per process; tasks run through them in order, so few are alive at a time."""


@lru_cache(maxsize=_MOST_OPERATORS)
def statics_of(model: str, parameters: Any) -> tuple[models.Array, models.Array]:
    """Return what :func:`~workflow.models.statics` says of a full structure."""
    return models.statics(models.structure_of(model, parameters))


@lru_cache(maxsize=_MOST_OPERATORS)
def _operator(by: Reduced, method: str, options: Any, h: float, depth: float | None, sensors: Watched) -> Any:
    return schemes.load(method).init(observed_structure(by, depth, sensors), h, options)


@lru_cache(maxsize=_MOST_OPERATORS)
def observed_structure(by: Reduced, depth: float | None, sensors: Watched = ()) -> models.Structure:
    """Return the structure that cases are run on, with the depth, if any, and the sensors that schemes record."""
    model, full = model_on(by), models.structure_of(by.model, by.parameters)
    if sensors:
        rows = models.sensors_of(by.model, by.parameters, sensors)
        own = rows if model.reduction is None else model.reduction.sensors(rows, full)
        model = model._replace(structure=replace(model.structure, sensors=own))
    if depth is None:
        return model.structure
    assert isinstance(full, models.Chain), "a study is refused otherwise"
    assert isinstance(model.structure, models.Chain | models.Matrices)
    basis = 1.0 if model.reduction is None else model.reduction.temperature_basis
    observed = np.dot(full.mean_over(depth)[None], basis)
    return replace(model.structure, contacts=replace(model.structure.contacts, observed=observed))


@lru_cache(maxsize=_MOST_OPERATORS)
def _runaways(by: Reduced) -> Runaways:
    return Runaways(model_on(by).structure)


def kernel_variant(settings: CaseSettings, balances: bool) -> KernelVariant | None:
    """Return what must be compiled for settings, with balances or without; ``None`` if their scheme refuses them."""
    scheme, structure = schemes.load(settings.scheme.method), reduced_structure(settings)
    if scheme.refusal(structure, settings.scheme.options) is not None:
        return None
    coupled, driven = (
        models.needs_matrices(structure),
        bool(settings.scene.casing.harmonics or settings.scene.load.harmonics),
    )
    slides = structure.contacts.slides and settings.scene.friction is not None
    kind = {"harmonics": driven, "slides": slides, "coupled": coupled}
    contacts, coated = structure.contacts, settings.scene.casing.coating is not None
    kind |= {"contacts": contacts.count > 1, "compliant": contacts.is_compliant, "coated": coated}
    return KernelVariant(settings.scheme.method, settings.scheme.options, balances, **kind)


def compile_for(settings: CaseSettings, balances: bool) -> None:
    """Have the kernels of settings compiled, so that no case's processor time holds that."""
    variant = kernel_variant(settings, balances)
    if variant is not None:
        compile_scheme(variant)


def permanent_contact(settings: CaseSettings, alpha: models.Array, friction: models.Array) -> PermanentContact:
    """Return what becomes of cases of settings in permanent contact."""
    return _runaways(reduced(settings)).of(alpha, friction)


def projection_residual_of(settings: CaseSettings, cases: models.Cases) -> models.Array:
    """Return what the basis of settings loses of cases given on the nodes, 1, ``(case,)``; 0 where it is full."""
    reduction = model_on(reduced(settings)).reduction
    if reduction is None:
        return np.zeros(cases.count)
    return projection_residual(full_structure(settings), reduction, cases)


def judged(settings: CaseSettings, cases: models.Cases, results: Results, duration: float) -> Results:
    """Return what :func:`run_batch` has made of cases, with those marked that blew up."""
    return mark_blown_up(
        full_structure(settings),
        lambda: statics_of(settings.scene.model, settings.scene.parameters),
        lambda some: permanent_contact(settings, some.alpha, some.friction).growth_rate,
        cases,
        results,
        duration,
        is_stepped="h" in schemes.load(settings.scheme.method).READS,
    )


def as_run(settings: CaseSettings, cases: models.Cases, sensors: Watched = ()) -> tuple[models.Structure, models.Cases]:
    """Return the structure that cases are run on, with sensors, and cases given on the nodes as they start on it."""
    by = reduced(settings)
    structure, projected = observed_structure(by, None, sensors), model_on(by).project(cases)
    return structure, models.at_rest(structure, projected) if settings.scene.initial == "static" else projected


def end_of(settings: CaseSettings, results: Results) -> models.EndState:
    """Return the states in which cases ended, in the coordinates in which their initial states are given.

    One contact with mass ends where its last sample is, to the bit. Refuses a scheme that gives none.
    """
    if results.end is None:
        raise schemes.ContractError("the scheme gives no `end`, the state from which the next point of a sweep starts")
    model, full = model_on(reduced(settings)), full_structure(settings)
    if model.structure.contacts.is_one_with_mass:
        for name, rows in results.end._asdict().items():
            rows[:, -1] = results.histories[name][:, -1]
    own = model.expanded(results.end)
    return own if full.coordinates is None else full.coordinates.given(own)


def run_batch(
    settings: CaseSettings, cases: models.Cases, sampling: Sampling, depth: float | None = None, sensors: Watched = ()
) -> Results:
    """Run cases, given on the nodes, on the structure and with the scheme of settings, which records sensors.

    With a ``depth`` [m] all temperatures of the results are the mean over it, not that of the tip.
    """
    method = settings.scheme.method
    schemes.refuse(schemes.load(method), cases)
    operator = _operator(reduced(settings), method, settings.scheme.options, settings.h, depth, sensors)
    _, projected = as_run(settings, cases)
    results = schemes.load(method).compute(operator, projected, sampling)
    return schemes.checked(results, projected, sampling, len(sensors))
