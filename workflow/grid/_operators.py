"""Structures, reductions and operators of a study, each made once and kept while it is in use."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from threadpoolctl import threadpool_limits

from workflow import models, schemes
from workflow.grid._conditions import at_rest
from workflow.grid._turns import waiting
from workflow.models import MOST_NODES_WITH_MATRICES, Cases, Chain, Structure, critical_alpha, growth_rate
from workflow.reduction import Reduction, reduce_structure
from workflow.schemes import Results, Sampling
from workflow.schemes._compile import Wanted, compile_scheme
from workflow.study import Cell

_OPERATORS_KEPT = 16
"""Operators kept per process; tasks run through them in order, so few are alive at a time."""

_LARGE = 300
"""States above which the growth rate is taken from a reduced structure: the dense eigenvalue
problem of a few hundred states takes tens of milliseconds and grows with the cube."""

_ENOUGH_MODES, _ENOUGH_OF_A_LONG_CHAIN = 80, 12
"""Modes of that reduced structure; 3 + 12 modes already give the rate to 0.2 % on the blade, and those
of a chain without matrices are found one by one."""


@lru_cache(maxsize=_OPERATORS_KEPT)
def structure_of(model: str, parameters: Any) -> Structure:
    """Return the full structure of a model, made by one thread of BLAS wherever it is made."""
    with threadpool_limits(limits=1, user_api="blas"):
        return models.load(model).assemble(parameters)


@lru_cache(maxsize=_OPERATORS_KEPT)
def reduction_of(model: str, parameters: Any, mechanical_modes: int, thermal_modes: int) -> Reduction | None:
    """Return the reduction of a model, ``None`` where all modes are kept and nothing is to be done."""
    structure = structure_of(model, parameters)
    if mechanical_modes == structure.mechanical_size - 1 and thermal_modes == structure.thermal_size - 1:
        return None
    with threadpool_limits(limits=1, user_api="blas"):
        return reduce_structure(structure, mechanical_modes, thermal_modes)


def reduced_structure(cell: Cell) -> Structure:
    """Return the structure that a case is run on."""
    scene = cell.scene
    reduction = reduction_of(scene.model, scene.parameters, cell.mechanical_modes, cell.thermal_modes)
    return structure_of(scene.model, scene.parameters) if reduction is None else reduction.structure


@lru_cache(maxsize=_OPERATORS_KEPT)
def _operator(model: str, parameters: Any, modes: tuple[int, int], method: str, options: Any, h: float) -> Any:
    reduction = reduction_of(model, parameters, *modes)
    structure = structure_of(model, parameters) if reduction is None else reduction.structure
    return schemes.load(method).init(structure, h, options)


@lru_cache(maxsize=_OPERATORS_KEPT)
def _slow_structure(model: str, parameters: Any, modes: tuple[int, int]) -> Structure:
    """Return a structure whose growth rate is that of the given one and costs little."""
    reduction = reduction_of(model, parameters, *modes)
    structure = structure_of(model, parameters) if reduction is None else reduction.structure
    if 2 * structure.mechanical_size + structure.thermal_size <= _LARGE:
        return structure
    long = isinstance(structure, Chain) and not structure.has_matrices
    most = _ENOUGH_OF_A_LONG_CHAIN if long else _ENOUGH_MODES
    kept = (min(most, structure.mechanical_size - 1), min(most, structure.thermal_size - 1))
    return reduce_structure(structure, *kept).structure


@lru_cache(maxsize=4096)
def _growth_rate(model: str, parameters: Any, modes: tuple[int, int], alpha: float) -> float:
    return growth_rate(_slow_structure(model, parameters, modes), alpha)


@lru_cache(maxsize=_OPERATORS_KEPT)
def _critical_alpha(model: str, parameters: Any, modes: tuple[int, int]) -> float:
    reduction = reduction_of(model, parameters, *modes)
    return critical_alpha(structure_of(model, parameters) if reduction is None else reduction.structure)


def kernels_of(cell: Cell) -> Wanted:
    """Return what of its scheme must be compiled for a cell."""
    scheme = schemes.load(cell.scheme.method)
    swept = hasattr(scheme, "is_swept") and scheme.is_swept(reduced_structure(cell))
    return Wanted(cell.scheme.method, cell.scheme.options, MOST_NODES_WITH_MATRICES + 1 if swept else 1)


def compile_for(cell: Cell) -> None:
    """Have the kernels of a cell compiled, so that no case's wall time holds that."""
    compile_scheme(kernels_of(cell), waiting)


def runaway_of(cell: Cell, alpha: float) -> tuple[float, float]:
    """Return the critical coupling of the structure a cell is run on, and the growth rate at ``alpha``."""
    key = (cell.scene.model, cell.scene.parameters, (cell.mechanical_modes, cell.thermal_modes))
    return _critical_alpha(*key), _growth_rate(*key, alpha)


def run_batch(cell: Cell, cases: Cases, sampling: Sampling) -> Results:
    """Run cases, given on the nodes, on the structure and with the scheme of a cell."""
    scene, method = cell.scene, cell.scheme.method
    modes = (cell.mechanical_modes, cell.thermal_modes)
    reduction = reduction_of(scene.model, scene.parameters, *modes)
    operator = _operator(scene.model, scene.parameters, modes, method, cell.scheme.options, cell.h)
    projected = cases if reduction is None else reduction.project(cases)
    if scene.initial == "static":
        projected = at_rest(reduced_structure(cell), projected)
    return schemes.load(method).compute(operator, projected, sampling)
