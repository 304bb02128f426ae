"""Structures, reductions and operators of a study, each made once and kept while it is in use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from workflow import models, schemes
from workflow.grid._compile import KernelVariant, compile_scheme
from workflow.grid._conditions import at_rest
from workflow.grid._costs import batch_part, growth_part, measured, setup_part
from workflow.grid._turns import waiting
from workflow.judges.blow_ups import mark_blown_up
from workflow.models import (
    Array,
    Cases,
    Chain,
    InContact,
    Sparse,
    Structure,
    critical_alpha,
    growth,
    growth_at_once,
    in_contact,
    needs_matrices,
    static_tip_growth,
    tip_flexibility,
)
from workflow.reduction import DEFAULT, Reduction, projection_residual, reduce_structure
from workflow.schemes import Results, Sampling
from workflow.study import Cell

_AT_CRITICAL = 1e-9
"""Share of the critical coupling within which its own rounding, about 1e-14, decides nothing."""

_MOST_OPERATORS = 16
"""Operators kept per process; tasks run through them in order, so few are alive at a time."""


@lru_cache(maxsize=_MOST_OPERATORS)
def structure_of(model: str, parameters: Any) -> Structure:
    """Return the full structure of a model, made by one thread of BLAS wherever it is made."""
    with threadpool_limits(limits=1, user_api="blas"):
        return models.load(model).assemble(parameters)


@lru_cache(maxsize=_MOST_OPERATORS)
def statics_of(model: str, parameters: Any) -> tuple[float, Array]:
    """Return S [m/N], infinite where the root is free, and the row -e_nᵀ K1⁻¹ K12 [m/K] of a full structure."""
    structure = structure_of(model, parameters)
    return tip_flexibility(structure), static_tip_growth(structure)


@dataclass(frozen=True)
class Reduced:
    """What decides the structure that a case is run on: model, basis, counts of modes, duration."""

    model: str
    parameters: Any
    basis: str
    modes: tuple[int, int]
    duration: float | None


def reduced(cell: Cell) -> Reduced:
    """Return what decides the structure that a case is run on."""
    scene = cell.scene
    modes = cell.mechanical_modes, cell.thermal_modes
    return Reduced(scene.model, scene.parameters, cell.reduction, modes, scene.duration)


@lru_cache(maxsize=_MOST_OPERATORS)
def reduction_of(by: Reduced) -> Reduction | None:
    """Return the reduction of a model, ``None`` where all modes are kept and nothing is to be done."""
    structure, modes = structure_of(by.model, by.parameters), _modes_kept(by)
    if modes == (None, None):
        return None
    with threadpool_limits(limits=1, user_api="blas"):
        return reduce_structure(structure, *modes, by.basis, by.duration)


def _modes_kept(by: Reduced) -> tuple[int | None, int | None]:
    """Return the counts of mechanical and thermal modes, ``None`` for all."""
    structure = structure_of(by.model, by.parameters)
    mechanical, thermal = by.modes
    return (
        None if mechanical == structure.mechanical_size - 1 else mechanical,
        None if thermal == structure.thermal_size - 1 else thermal,
    )


def _structure_for_kernels(by: Reduced) -> Structure:
    """Return a structure that needs the kernels of the one a case is run on.

    Where fixed-interface modes reduce a chain the chain itself tells what they need, so that kernels can be compiled
    while the modes are being computed.
    """
    full = structure_of(by.model, by.parameters)
    if by.basis == DEFAULT and isinstance(full, Chain) and _modes_kept(by) != (None, None):
        return full
    return structure_on(by)


def structure_on(by: Reduced) -> Structure:
    """Return the structure of a model as its basis leaves it."""
    reduction = reduction_of(by)
    if reduction is not None:
        return reduction.structure
    structure = structure_of(by.model, by.parameters)
    return structure.matrices() if isinstance(structure, Sparse) else structure


def reduced_structure(cell: Cell) -> Structure:
    """Return the structure that a case is run on."""
    return structure_on(reduced(cell))


@lru_cache(maxsize=_MOST_OPERATORS)
def _operator(by: Reduced, method: str, options: Any, h: float) -> Any:
    structure = structure_on(by)
    with measured(setup_part(method, structure)):
        return schemes.load(method).init(structure, h, options)


@lru_cache(maxsize=_MOST_OPERATORS)
def _in_contact(by: Reduced) -> InContact:
    structure = structure_on(by)
    with threadpool_limits(limits=1, user_api="blas"):
        return in_contact(structure)


@lru_cache(maxsize=_MOST_OPERATORS)
def _runaway(by: Reduced) -> Callable[[float, float], tuple[float, float, bool]]:
    """Return what :func:`runaways_of` says at one α and µ, as a function that remembers: a structure is a large key."""

    @lru_cache(maxsize=4096)
    def at(alpha: float, friction: float) -> tuple[float, float, bool]:
        with measured(growth_part(structure_on(by))):
            rate = growth(_in_contact(by), alpha, friction)
        critical, acts = _critical_alpha(by, friction), alpha > 0 or friction > 0
        return critical, rate.rate, acts and (rate.is_positive or alpha > critical * (1 + _AT_CRITICAL))

    return at


@lru_cache(maxsize=_MOST_OPERATORS)
def _critical_alpha(by: Reduced, friction: float) -> float:
    return critical_alpha(structure_on(by), friction)


def kernel_variant(cell: Cell, balances: bool) -> KernelVariant | None:
    """Return what of its scheme must be compiled for a cell, with balances or without; ``None`` if it is refused."""
    scheme, structure = schemes.load(cell.scheme.method), _structure_for_kernels(reduced(cell))
    if scheme.refusal(structure, cell.scheme.options) is not None:
        return None
    coupled, driven = needs_matrices(structure), bool(cell.scene.casing.harmonics or cell.scene.load.harmonics)
    slides = structure.tangent is not None and cell.scene.friction is not None
    kind = {"massless_tip": structure.has_massless_tip, "harmonics": driven, "slides": slides, "coupled": coupled}
    return KernelVariant(cell.scheme.method, cell.scheme.options, balances, **kind)


def compile_for(cell: Cell, balances: bool) -> None:
    """Have the kernels of a cell compiled, so that no case's processor time holds that."""
    variant = kernel_variant(cell, balances)
    if variant is not None:
        compile_scheme(variant, waiting)


def runaways_of(cell: Cell, alpha: Array, friction: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return critical coupling and growth rate of the structure a cell is run on, and whether it grows, ``(case,)``.

    Above the critical coupling a real eigenvalue is positive for certain, however small it is beside the largest
    (1 - α G(s) is negative at 0 and 1 at infinity).
    """
    distinct, where = np.unique(np.stack([alpha, friction]), axis=1, return_inverse=True)
    at = _runaway(reduced(cell))
    critical, rate, grows = np.transpose([at(*map(float, pair)) for pair in distinct.T])[:, where.ravel()]
    return critical, rate, grows != 0


def projection_residual_of(cell: Cell, cases: Cases) -> Array:
    """Return what the bases of a cell cannot hold of cases given on the nodes, 1, ``(case,)``; 0 where it is full."""
    reduction = reduction_of(reduced(cell))
    if reduction is None:
        return np.zeros(cases.count)
    return projection_residual(structure_of(cell.scene.model, cell.scene.parameters), reduction, cases)


def on_basis(cell: Cell, cases: Cases) -> tuple[Structure, Cases]:
    """Return the structure that a cell is run on, and cases given on the nodes in its coordinates."""
    reduction = reduction_of(reduced(cell))
    return reduced_structure(cell), cases if reduction is None else reduction.project(cases)


def judged(cell: Cell, cases: Cases, results: Results, duration: float) -> Results:
    """Return what :func:`run_batch` has made of cases, with those marked that blew up."""
    model, parameters = cell.scene.model, cell.scene.parameters
    return mark_blown_up(
        structure_of(model, parameters),
        lambda: statics_of(model, parameters),
        lambda some: runaways_of(cell, some.alpha, some.friction)[1],
        cases,
        results,
        duration,
        is_stepped="h" in schemes.load(cell.scheme.method).READS,
    )


def as_run(cell: Cell, cases: Cases) -> tuple[Structure, Cases]:
    """Return the structure that a cell is run on, and cases given on the nodes as they start on it."""
    structure, projected = on_basis(cell, cases)
    return structure, at_rest(structure, projected) if cell.scene.initial == "static" else projected


def run_batch(cell: Cell, cases: Cases, sampling: Sampling) -> Results:
    """Run cases, given on the nodes, on the structure and with the scheme of a cell."""
    scene, method = cell.scene, cell.scheme.method
    schemes.refuse(schemes.load(method), cases)
    operator = _operator(reduced(cell), method, cell.scheme.options, cell.h)
    structure, projected = as_run(cell, cases)
    periods = float(cases.fastest_frequency.max()) * sampling.duration
    part = batch_part(cell, structure, sampling, cases.count, periods)
    with measured(part):
        results = schemes.load(method).compute(operator, projected, sampling)
    results.metrics["thermal_closing"] += growth_at_once(structure_of(scene.model, scene.parameters))
    return schemes.checked(results, projected, sampling)
