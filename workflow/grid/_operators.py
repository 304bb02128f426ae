"""Structures, reductions and operators of a study, each made once and kept while in use; figures of structures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import models, schemes
from workflow.grid._compile import KernelVariant, compile_scheme
from workflow.judges.blow_ups import Runaways, mark_blown_up, statics
from workflow.models import (
    Array,
    Cases,
    Chain,
    Matrices,
    Structure,
    at_rest,
    critical_alpha,
    frequencies,
    instantaneous_growth,
    needs_matrices,
    one_thread,
    rates,
    structure_of,
)
from workflow.reduction import ReducedModel, projection_residual, reduced_model
from workflow.schemes import Results, Sampling
from workflow.study import CaseSettings

_MOST_OPERATORS = 16
"""Operators kept per process; tasks run through them in order, so few are alive at a time."""


def full_structure(settings: CaseSettings) -> Structure:
    """Return the full structure of a case, on whose nodes its conditions are given."""
    return structure_of(settings.scene.model, settings.scene.parameters)


@lru_cache(maxsize=_MOST_OPERATORS)
def statics_of(model: str, parameters: Any) -> tuple[float, Array]:
    """Return what :func:`~workflow.judges.blow_ups.statics` says of a full structure."""
    return statics(structure_of(model, parameters))


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


@lru_cache(maxsize=_MOST_OPERATORS)
def model_on(by: Reduced) -> ReducedModel:
    """Return the structure of a model as its basis leaves it, and its reduction."""
    with one_thread():
        return reduced_model(structure_of(by.model, by.parameters), *by.modes, by.basis, by.duration)


def reduced_structure(settings: CaseSettings) -> Structure:
    """Return the structure that a case is run on."""
    return model_on(reduced(settings)).structure


@lru_cache(maxsize=_MOST_OPERATORS)
def _operator(by: Reduced, method: str, options: Any, h: float, depth: float | None) -> Any:
    return schemes.load(method).init(_observed(by, depth), h, options)


def _observed(by: Reduced, depth: float | None) -> Structure:
    """Return the structure that cases are run on, whose schemes record the mean temperature over a depth, if any."""
    model, full = model_on(by), structure_of(by.model, by.parameters)
    if depth is None:
        return model.structure
    assert isinstance(full, Chain), "a study is refused otherwise"
    assert isinstance(model.structure, Chain | Matrices)
    basis = 1.0 if model.reduction is None else model.reduction.temperature_basis
    return replace(model.structure, observed=np.dot(full.mean_over(depth), basis))


@lru_cache(maxsize=_MOST_OPERATORS)
def _runaways(by: Reduced) -> Runaways:
    return Runaways(model_on(by).structure)


def kernel_variant(settings: CaseSettings, balances: bool) -> KernelVariant | None:
    """Return what must be compiled for settings, with balances or without; ``None`` if their scheme refuses them."""
    scheme, structure = schemes.load(settings.scheme.method), reduced_structure(settings)
    if scheme.refusal(structure, settings.scheme.options) is not None:
        return None
    coupled, driven = needs_matrices(structure), bool(settings.scene.casing.harmonics or settings.scene.load.harmonics)
    slides = structure.slides and settings.scene.friction is not None
    kind = {"massless_tip": structure.has_massless_tip, "harmonics": driven, "slides": slides, "coupled": coupled}
    return KernelVariant(settings.scheme.method, settings.scheme.options, balances, **kind)


def compile_for(settings: CaseSettings, balances: bool) -> None:
    """Have the kernels of settings compiled, so that no case's processor time holds that."""
    variant = kernel_variant(settings, balances)
    if variant is not None:
        compile_scheme(variant)


def runaways_of(settings: CaseSettings, alpha: Array, friction: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return critical coupling, growth rate and whether a tip in contact runs away: see :class:`Runaways`."""
    return _runaways(reduced(settings)).of(alpha, friction)


def projection_residual_of(settings: CaseSettings, cases: Cases) -> Array:
    """Return what the basis of settings loses of cases given on the nodes, 1, ``(case,)``; 0 where it is full."""
    reduction = model_on(reduced(settings)).reduction
    if reduction is None:
        return np.zeros(cases.count)
    return projection_residual(full_structure(settings), reduction, cases)


def judged(settings: CaseSettings, cases: Cases, results: Results, duration: float) -> Results:
    """Return what :func:`run_batch` has made of cases, with those marked that blew up."""
    return mark_blown_up(
        full_structure(settings),
        lambda: statics_of(settings.scene.model, settings.scene.parameters),
        lambda some: runaways_of(settings, some.alpha, some.friction)[1],
        cases,
        results,
        duration,
        is_stepped="h" in schemes.load(settings.scheme.method).READS,
    )


def as_run(settings: CaseSettings, cases: Cases) -> tuple[Structure, Cases]:
    """Return the structure that cases are run on, and cases given on the nodes as they start on it."""
    model = model_on(reduced(settings))
    structure, projected = model.structure, model.project(cases)
    return structure, at_rest(structure, projected) if settings.scene.initial == "static" else projected


def run_batch(settings: CaseSettings, cases: Cases, sampling: Sampling, depth: float | None = None) -> Results:
    """Run cases, given on the nodes, on the structure and with the scheme of settings.

    With a ``depth`` [m] all temperatures of the results are the mean over it, not that of the tip.
    """
    method = settings.scheme.method
    schemes.refuse(schemes.load(method), cases)
    operator = _operator(reduced(settings), method, settings.scheme.options, settings.h, depth)
    _, projected = as_run(settings, cases)
    results = schemes.load(method).compute(operator, projected, sampling)
    results.metrics["thermal_closing"] += instantaneous_growth(full_structure(settings))
    return schemes.checked(results, projected, sampling)


@dataclass(frozen=True)
class Figures:
    """Frequencies, stiffness, thermal times and critical coupling of a structure.

    Attributes
    ----------
    label
        Which structure.
    first_frequency
        f1, Hz; 0 for a free body.
    tip_stiffness
        1/S, N/m; 0 for a free body.
    stiffness_by
        Parameter that gives it, of a model that takes one of several; else empty.
    slowest, fastest
        Longest and shortest thermal time 1/μ, s; ``inf`` for an adiabatic mode.
    critical_alpha
        α_c, W/N.
    """

    label: str
    first_frequency: float
    tip_stiffness: float
    stiffness_by: str
    slowest: float
    fastest: float
    critical_alpha: float


def figures(settings: CaseSettings) -> Figures:
    """Return the figures of the full structure of a case."""
    structure = full_structure(settings)
    with np.errstate(divide="ignore"):
        times = 1.0 / rates(structure)
    flexibility, _ = statics(structure)
    return Figures(
        label=f"{settings.scene.model}, {size_text(settings)}{_condensed(settings)}",
        first_frequency=float(frequencies(structure)[0] / (2 * np.pi)),
        tip_stiffness=0.0 if np.isinf(flexibility) else 1.0 / flexibility,
        stiffness_by=_stiffness_by(settings),
        slowest=float(times.max()),
        fastest=float(times.min()),
        critical_alpha=critical_alpha(structure),
    )


def _stiffness_by(settings: CaseSettings) -> str:
    names = getattr(models.load(settings.scene.model), "EITHER", ())
    return next((name for name in names if getattr(settings.scene.parameters, name) is not None), "")


def size_text(settings: CaseSettings) -> str:
    """Return the size of a case's structure: nodes of a chain, coordinates of displacement and heat of others."""
    mechanical, thermal = models.sizes(settings.scene.model, settings.scene.parameters)
    is_chain = isinstance(full_structure(settings), Chain)
    return f"{mechanical} nodes" if is_chain else f"{mechanical} + {thermal} coordinates"


def _condensed(settings: CaseSettings) -> str:
    """Return how many degrees of freedom are condensed statically, or held by their file; empty for none."""
    coordinates = full_structure(settings).coordinates
    if coordinates is None:
        return ""
    kinds = ("without mass, condensed", "without heat capacity, condensed", "held", "held at temperature 0")
    counts = zip((*coordinates.condensed, *coordinates.held), kinds, strict=True)
    return "".join(f" + {count} {kind}" for count, kind in counts if count)


def distinct_lines(lines: Iterable[str], most: int) -> tuple[str, ...]:
    """Return distinct lines in their order, at most so many, and how many more there are."""
    distinct = tuple(dict.fromkeys(lines))
    more = len(distinct) - most
    return distinct if more <= 0 else (*distinct[:most], f"… and {more} more")
