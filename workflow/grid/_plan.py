"""What a study comes to before anything runs: numbers of cases, time, size, and what to beware of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices, arrange
from workflow.grid._choice_words import choice_cautions, choice_lines
from workflow.grid._conditions import friction_of
from workflow.grid._costs import factor_lines
from workflow.grid._estimate import Time, estimate, result_bytes
from workflow.grid._figures import Figures, distinct_lines, figures
from workflow.grid._frequencies import fastest
from workflow.grid._operators import Reduced, reduced, reduced_structure, structure_of, structure_on
from workflow.grid._reference import reference_cell, solution_counts
from workflow.grid._scene_cautions import scene_cautions
from workflow.grid._tasks import Units, tasks, units_of
from workflow.models import (
    MOST_NODES_WITH_MATRICES,
    Array,
    Chain,
    frequencies,
    mechanical_modes,
    modal_damping,
    rates,
)
from workflow.reduction import DEFAULT
from workflow.schemes import Scheme
from workflow.study import Cell, ResolvedValue, Study, resolved_values

_GROWS = 1e-12
"""Growth of a free step above which a warning is printed: below, a million steps grow by less than a millionth."""

_COARSE = 20
"""Steps per load period below which a plan says so: implicit Euler then errs by about a sixth."""

_RINGS = 0.9
"""What a step leaves of a disturbance of a tip without mass, from which on a plan says that it rings."""

_STRUCTURES_SHOWN = 8

_LOOKED_AT = 5000
"""Settings of the operators that are judged for what to beware of, at about 0.2 ms each."""


@dataclass(frozen=True)
class Plan:
    """What a study comes to; nothing has run.

    Attributes
    ----------
    study, title
        Its name and title.
    dims
        Names and sizes of the archive's dimensions, outermost first.
    scene
        Every value with its unit, and what was left to its default.
    cases, unique
        Cells of the archive, and cases that are computed.
    references, exact
        Reference solutions, and exact solutions of reduced models beside them, which split the errors.
    batches, tasks
        Runs of cases that share operators, and dask tasks.
    steps
        Steps of all cases together (0 for a scheme without steps).
    time
        How long it will take here.
    bytes
        Size of the results before compression.
    stored
        Names of the histories that are stored, without metrics; none for metrics alone.
    structures
        Figures of the first distinct structures.
    more_structures
        Number of the others.
    choices
        Counts of modes that a tolerance decides, for which structures, and the error found.
    operators
        What the schemes step the distinct structures by, where there is a choice, and how many more there are.
    warnings
        What to beware of, one sentence each.
    """

    study: str
    title: str
    dims: tuple[tuple[str, int], ...]
    scene: tuple[ResolvedValue, ...]
    cases: int
    unique: int
    references: int
    exact: int
    batches: int
    tasks: int
    steps: int
    time: Time
    bytes: int
    stored: tuple[str, ...]
    structures: tuple[Figures, ...]
    more_structures: int
    choices: tuple[str, ...]
    operators: tuple[str, ...]
    warnings: tuple[str, ...]


def plan_study(study: Study) -> Plan:
    """Return what a study comes to; runs nothing but the trials by which tolerances decide counts of modes."""
    grid = arrange(study)
    return plan(grid, units_of(grid))


def plan(grid: Grid, units: Units) -> Plan:
    """Return what a study comes to."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):  # matrices are small
        return _plan(grid, units)


def _plan(grid: Grid, units: Units) -> Plan:
    computed, model = grid.places.computed, grid.study.scene.model
    kinds, kind = np.unique(grid.alike(computed, lambda path: path in ("scheme", "h")), return_inverse=True)
    cells = [grid.settings(int(outer)) for outer in kinds]
    distinct = np.array([grid.distinct_inner(cell) for cell in cells])
    marching = np.array(
        [grid.sampling.steps(cell.h) if "h" in schemes.load(cell.scheme.method).READS else 0 for cell in cells]
    )
    structures = np.unique(grid.alike(computed, lambda path: path.startswith(f"scene.{model}.")))
    shown = [grid.settings(int(outer)) for outer in structures[:_STRUCTURES_SHOWN]]
    looked_at = [grid.settings(outer) for outer in _looked_at(computed)]
    bases = len(set(map(_basis, looked_at)))
    cautions = [caution for cell in looked_at for caution in _beware(grid, cell)]
    idle = tuple(
        f"{dimension.name} changes nothing: no scheme of this study reads it, its cases are the same"
        for dimension in (*grid.outer, *grid.inner)
        if all(grid.unread(dimension, cell.scheme) and grid.uncompared(dimension, cell.scheme) for cell in cells)
    )
    number = batches = 0
    for task in tasks(grid, units):
        number += 1
        batches += len(task.segments)
    cases = grid.outer_count * grid.inner_count
    references, exact = solution_counts(grid)
    return Plan(
        study=grid.study.name,
        title=grid.study.title,
        dims=grid.dims,
        scene=resolved_values(grid.study, grid.settings(0)),
        cases=cases,
        unique=int(np.sum(distinct[kind])),
        references=references,
        exact=exact,
        batches=batches,
        tasks=number,
        steps=sum(int(n) * int(d) * int(c) for n, d, c in zip(marching, distinct, np.bincount(kind), strict=True)),
        time=estimate(grid, units),
        bytes=result_bytes(grid),
        stored=tuple(grid.study.output.histories),
        structures=tuple(map(figures, shown)),
        more_structures=len(structures) - len(shown),
        choices=choice_lines(grid),
        operators=(*distinct_lines(_operators(grid, computed), _STRUCTURES_SHOWN), *_factors(shown)),
        warnings=idle + tuple(choice_cautions(grid)) + scene_cautions(grid) + _sentences(cautions, bases),
    )


def _operators(grid: Grid, computed: Indices) -> Iterator[str]:
    """Yield what structures and those of references are stepped by, where a scheme has a choice."""
    names, model = ("scheme", "reduction", "mechanical_modes", "thermal_modes"), grid.study.scene.model
    places = np.unique(grid.alike(computed, lambda path: path in names or path.startswith(f"scene.{model}.")))
    for outer in _looked_at(places):
        own, truth = grid.settings(outer), grid.study.reference is not None
        for cell in (own, reference_cell(grid, outer)) if truth else (own,):
            scheme = schemes.load(cell.scheme.method)
            name = "" if scheme.operator_name is None else scheme.operator_name(reduced_structure(cell))
            if name:
                yield f"{cell.scheme.method}: {name}"


def _factors(cells: list[Cell]) -> Iterator[str]:
    """Yield what factorising the first distinct structures takes."""
    for cell in cells:
        yield from factor_lines(structure_of(cell.scene.model, cell.scene.parameters))


def _looked_at(computed: Indices) -> list[int]:
    """Return outer indices to judge: all of them, or of very many a fixed random choice."""
    if computed.size > _LOOKED_AT:
        computed = np.sort(np.random.default_rng(0).choice(computed, _LOOKED_AT, replace=False))
    return [int(outer) for outer in computed]


@lru_cache(maxsize=64)
def _free_modes(by: Reduced) -> tuple[Array, Array, Array]:
    """Return ω, c and μ of a structure's modes, of a long chain those of the lowest and the highest.

    The last ω is infinite where the tip has no mass, and its c says nothing.
    """
    structure = structure_on(by)
    omega = frequencies(structure)
    damping = structure.damping.of_modes(np.where(np.isinf(omega), 0.0, omega))
    if structure.damper is not None:
        damping = modal_damping(structure, mechanical_modes(structure))
    return omega, damping, rates(structure)


@dataclass(frozen=True)
class _Caution:
    """One thing to beware of: ``what`` it is, for which scheme and step, and how much of it (empty for any step).

    ``basis`` names the reduced model of which it is said.
    """

    basis: str
    scheme: str
    what: str
    h: float
    amount: str
    size: float


def _beware(grid: Grid, cell: Cell) -> list[_Caution]:
    """Return the cautions about one scheme at one step on one structure."""
    scheme = schemes.load(cell.scheme.method)
    structure = reduced_structure(cell)
    if isinstance(structure, Chain) and not structure.has_matrices and scheme.is_swept is None:
        what = f"fails, as only moreau steps more than {MOST_NODES_WITH_MATRICES} nodes, with"
        return [_Caution(_basis(cell), cell.scheme.label, what, cell.h, f"{structure.mechanical_size} nodes", 0.0)]
    refusal = scheme.refusal(structure, cell.scheme.options)
    if refusal is not None:
        basis = f" with {cell.reduction}" if structure.has_massless_tip else ""
        return [_Caution(_basis(cell), cell.scheme.label, f"fails{basis}, as {refusal}", cell.h, "", 0.0)]
    if "h" not in scheme.READS or scheme.amplification is None or scheme.thermal_amplification is None:
        return []
    omega, damping, mu = _free_modes(reduced(cell))
    free = np.abs(scheme.amplification(omega, damping, cell.h, cell.scheme.options))
    heat = np.abs(scheme.thermal_amplification(mu, cell.h, cell.scheme.options))
    growth = float(max(free.max(initial=0.0), heat.max(initial=0.0)))

    def caution(what: str, amount: str, size: float) -> _Caution:
        return _Caution(_basis(cell), cell.scheme.label, what, cell.h, amount, size)

    if growth > 1 + _GROWS:
        return [caution("diverges, its free step grows", f"{growth:.6g}-fold", growth)]
    cautions = []
    ringing = free[np.isinf(omega)].max(initial=0.0)
    if ringing >= _RINGS:
        what = (
            f"makes the tip ring, which {cell.reduction} leaves without mass (theta = 1 is advised): each step turns a"
        )
        cautions.append(caution(f"{what} disturbance over and leaves", f"{ringing:.3g} of it", ringing))
    if scheme.contact_limit is not None:
        friction = friction_of(cell, structure, grid.inner_values(np.arange(grid.inner_count)), grid.inner_count)
        ends = {float(friction.min()), float(friction.max())}
        limit = min(scheme.contact_limit(structure, cell.scheme.options, coefficient) for coefficient in ends)
        if cell.h > limit:
            measured = f"{schemes.limit_text(limit)} s (measured with contact that comes and goes)"
            cautions.append(caution("grows in contact, which is stable only up to", measured, -limit))
    if 0 < omega[0] < np.inf and damping[0] < 2 * omega[0]:  # a mode that swings
        physical = float(damping[0] / (2 * omega[0]))
        numerical = _first_mode_damping(scheme, omega[:1], damping[:1], cell) - physical
        if numerical > physical + _GROWS:
            own = f"more than its own {physical:.2g} of critical" if physical else "which has no damping of its own"
            what = f"damps the first mode ({omega[0] / (2 * np.pi):.4g} Hz) {own}, numerically by"
            cautions.append(caution(what, f"{numerical:.2g}", numerical))
    frequency = fastest(grid)
    if frequency * cell.h * _COARSE > 1:
        per_period = 1 / (frequency * cell.h)
        cautions.append(caution("takes few steps per load period,", f"{per_period:.3g}", frequency * cell.h))
    return cautions


def _first_mode_damping(scheme: Scheme, omega: Array, damping: Array, cell: Cell) -> float:
    """Return the damping ratio -ln|z|/|arg z| that the free step gives the first mode."""
    assert scheme.amplification is not None
    z = complex(scheme.amplification(omega, damping, cell.h, cell.scheme.options)[0, 0])
    turn = abs(np.angle(z))
    return float(-np.log(abs(z)) / turn) if abs(z) > 0 and turn > 0 else float("inf")


def _listed(amounts: list[str]) -> str:
    """Join a few amounts, or the ends of many."""
    return ", ".join(amounts) if len(amounts) <= 6 else f"{amounts[0]} to {amounts[-1]} ({len(amounts)} steps)"


def _basis(cell: Cell) -> str:
    """Name the reduced model of a cell."""
    modes = f"{cell.mechanical_modes} + {cell.thermal_modes} modes"
    return modes if cell.reduction == DEFAULT else f"{modes} of {cell.reduction}"


def _sentences(cautions: list[_Caution], bases: int) -> tuple[str, ...]:
    """Return one sentence per scheme and kind, with the largest amount at each step.

    What holds for some of the study's ``bases`` only is said with the one, or the worst, of them.
    """
    concerned: dict[tuple[str, str, float], set[str]] = {}
    worst: dict[tuple[str, str], dict[float, _Caution]] = {}
    for caution in cautions:
        kind = caution.what.split(" (")[0]  # the same first mode differs by a hair between reductions
        at = worst.setdefault((caution.scheme, kind), {})
        concerned.setdefault((caution.scheme, kind, caution.h), set()).add(caution.basis)
        if caution.h not in at or caution.size > at[caution.h].size:
            at[caution.h] = caution

    def amount(kind: tuple[str, str], caution: _Caution) -> str:
        some = len(concerned[*kind, caution.h])
        basis = caution.basis if some == 1 else f"worst with {caution.basis}"
        return f"{caution.amount} at h = {caution.h:g} s" + (f" ({basis})" if some < bases else "")

    sentences = (
        f"{kind[0]} {max(at.values(), key=lambda c: c.size).what} "
        + _listed([amount(kind, caution) for _, caution in sorted(at.items()) if caution.amount])
        for kind, at in worst.items()
    )
    return tuple(sentence.rstrip() for sentence in sentences)
