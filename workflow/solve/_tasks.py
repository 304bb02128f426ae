"""Cutting the grid in tasks: batches of cases bundled to a fair length of work."""

from __future__ import annotations

import math
import re
import resource
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow import schemes
from workflow.cases import FRICTION, Grid, Indices, expect_structures, full_structure, reduced_structure
from workflow.judges.trials import EXACT
from workflow.kernels.lanes import PACK
from workflow.models import Chain, Structure, needs_matrices, one_thread
from workflow.schemes import Sampling
from workflow.solve._variables import dims_of, lengths, unset, variables_of
from workflow.study import CaseSettings, Study

_UNMEASURED = 1e-7
"""Seconds of a step over the blocks of a structure, of a scheme that nobody has measured."""

_ALWAYS, _EACH_PERIOD = 250, 30
"""Steps of a scheme that finds its own: to set an α up, and in each period of the fastest load or casing."""

_TIP = 10
"""States that take as long as the tip and its contact."""

_CONTACT_STEP = 2e-8
"""Seconds of a step with several contacts, or without mass, for each state and contact: 1 to 5 of it were measured, for
5 to 100 modes and 1 to 16 contacts."""

_RUB = 5e-5
"""Seconds of a steady rub for each of its states squared."""

_PREPARED = 1e-4
"""Seconds for each state of a structure that is reduced: 0.25 s were measured for 3 024, 22 s for 229 000."""

_DENSE = 600
"""States of a structure up to which its growth rate comes from all of them."""


def case_seconds(settings: CaseSettings, structure: Structure, sampling: Sampling, periods: float) -> float:
    """Return what the scheme takes for a case: steps × blocks × one measured figure of its scheme.

    Blocks are its states and the tip; where modes are coupled a balance has as many as products of two. ``periods``
    are those of the fastest sinusoid of load and casing within the duration.
    """
    scheme = schemes.load(settings.scheme.method)
    has_steps = "h" in scheme.READS
    steps = sampling.steps(settings.h) if has_steps else sampling.count / 2 + _ALWAYS + _EACH_PERIOD * (1 + periods)
    blocks = float(_states(structure) + _TIP)
    if has_steps and needs_matrices(structure):
        blocks *= 1 + (blocks if sampling.balances else 1)
    audit = 1.5 if sampling.balances and has_steps else 1.0
    if has_steps and not structure.contacts.is_one_with_mass:
        return steps * _CONTACT_STEP * (_states(structure) + structure.contacts.count) * audit
    return steps * blocks * (scheme.STEP_SECONDS or _UNMEASURED) * audit


def steady_seconds(study: Study, settings: CaseSettings, structure: Structure) -> float:
    """Return what the steady rubs of a case cost, 0 where they are not asked for."""
    if study.output.steady is None or settings.scheme.method != EXACT:
        return 0.0
    return (study.branch.points if study.branch else 1) * _RUB * _states(structure) ** 2


def preparing_seconds(full: Structure) -> float:
    """Return in what time a full structure is assembled and reduced; a small one is part of :func:`setup_seconds`."""
    states = _states(full)
    return _PREPARED * states if states > _DENSE and not isinstance(full, Chain) else 0.0


def setup_seconds(full: Structure, structure: Structure) -> float:
    """Return what comes before the first case: modes of a full structure, the operator of a scheme on its reduction."""
    states, modes = _states(structure), min(_states(full), _DENSE)
    operator = 1.2e-7 * states**2 if structure.damper is None else 3.5e-9 * states**3
    return 5e-3 + 1.2e-7 * modes**2 + operator + _few_modes_seconds(full)


def growth_seconds(structure: Structure) -> float:
    """Return what the growth rate at one α costs: the eigenvalues of a structure, of a large one those of few modes."""
    return 5e-5 + 1.5e-9 * min(_states(structure), _DENSE) ** 3 + _few_modes_seconds(structure)


def _few_modes_seconds(structure: Structure) -> float:
    states = _states(structure)
    return 1e-6 * states if states > _DENSE else 0.0


def handling_seconds(samples: int, histories: int) -> float:
    """Return what a case costs beside its scheme: conditions, metrics, compression."""
    return 1e-5 + samples * (4.5e-8 + 8e-8 * histories)


def _states(structure: Structure) -> int:
    return 2 * structure.mechanical_size + structure.thermal_size


SHORTEST, LONGEST = 0.03, 5.0
"""Seconds of work of a task: below, the cost of dask and of a shard on the disk would show; above, much is lost where a
run is stopped."""

TASKS_PER_THREAD = 8
"""Where there are cases enough, so that threads end together."""

UNBROKEN = 60.0
"""Seconds up to which cases that are stepped together stay together: fewer of them cost as much, but a task that is
lost is lost as a whole."""

TASK_BYTES = 32 * 2**20
"""Results a task holds in memory before they are written."""


class Batch(NamedTuple):
    """Cases that share their operators: those of one outer index, with their inner indices, ``(case,)``."""

    outer: int
    inner: Indices


@dataclass(frozen=True, eq=False)
class Task:
    """Batches that are computed and stored together: what one dask task does.

    ``seconds`` are those of the cost model, without references.
    """

    number: int
    batches: tuple[Batch, ...]
    seconds: float


class Costs(NamedTuple):
    """What the outer indices that are computed cost, ``(outer,)`` each.

    ``setup`` are seconds before the first case, ``each`` those of a case that is computed; ``together`` is the number
    of cases that the scheme steps at once. ``preparing`` are the seconds in which structures are reduced, before all.
    """

    setup: NDArray[np.float64]
    each: NDArray[np.float64]
    together: NDArray[np.int64]
    preparing: float


def seconds_per_case(grid: Grid, outer: int) -> float:
    """Return the seconds of one case by the cost model."""
    settings = grid.settings(outer)
    structure, periods = reduced_structure(settings), grid.fastest * grid.sampling.duration
    runs = 1 if grid.study.output.temperature_depth is None else 2
    each = case_seconds(settings, structure, grid.sampling, periods)
    return steady_seconds(grid.study, settings, structure) + runs * each


@lru_cache(maxsize=4)
def costs(grid: Grid) -> Costs:
    """Return the costs of a grid: the cost model knows scheme, step and sizes.

    Structures are made for it, and kept for the run, so that one thread of BLAS makes them here as in a task: their
    last bits depend on the number of threads.
    """
    model = grid.study.scene.model
    kinds, kind = np.unique(grid.alike(grid.computed, lambda path: decides_cost(path, model)), return_inverse=True)
    made = {"reduction", "mechanical_modes", "thermal_modes", "scene.speed", "scene.casing.flexibility"}
    count = len(grid.kinds(lambda path: path in made or path.startswith(f"scene.{model}.")))
    expect_structures(count)
    with one_thread():
        every = [_costs(grid, outer) for outer in kinds.tolist()]
        preparing = np.mean([preparing_seconds(full_structure(grid.settings(outer))) for outer in kinds.tolist()])
    setup, each, together = (np.array(column)[kind] for column in zip(*every, strict=True))
    return Costs(setup, each, together, count * float(preparing))


def _costs(grid: Grid, outer: int) -> tuple[float, float, int]:
    """Return the costs of an outer index.

    Those of a case are the mean over the cases that are computed: distinct ones are stepped, where a scheme has packs
    whole ones, and growth rates are found at distinct α.
    """
    settings, count = grid.settings(outer), grid.inner_computed(outer).size
    full, structure = full_structure(settings), reduced_structure(settings)
    together = schemes.load(settings.scheme.method).TOGETHER
    stepped, couplings = map(grid.inner_distinct_count, (grid.is_read(settings.scheme), _decides_coupling))
    lines = stepped // grid.points
    packed = -(-lines // PACK) * PACK * grid.points if together > 1 else stepped
    each = packed * seconds_per_case(grid, outer) + couplings * growth_seconds(structure)
    handling = handling_seconds(grid.sampling.count, len(grid.study.output.sampled))
    return setup_seconds(full, structure), each / count + handling, together


def _decides_coupling(path: str) -> bool:
    """Tell whether α may differ along an axis."""
    return path == "alpha" or path.startswith(FRICTION)


def decides_cost(path: str, model: str) -> bool:
    """Tell whether the cost model knows of an axis: of options, and of what else varies in a structure, it does not."""
    return path == f"scene.{model}.nodes" or not path.startswith((f"scene.{model}.", "scene.speed", "schemes."))


def stored_bytes(grid: Grid) -> int:
    """Return the bytes of a case in the archive, before compression."""
    sizes, histories = lengths(grid), np.dtype(grid.study.output.precision).itemsize
    return sum(
        math.prod(sizes[dim] for dim in dims_of(about, sizes))
        * (histories if about.shape == "history" else unset(about).dtype.itemsize)
        for about in variables_of(grid)
    )


def bytes_per_case(grid: Grid) -> int:
    """Return the bytes of a case in memory: conditions, what a scheme gives, results and the copy that is stored."""
    return 8 * (6 * grid.sampling.count + 120) * math.prod(grid.study.contact_shape) + 2 * stored_bytes(grid)


def together_in_memory(grid: Grid) -> int:
    """Return how many cases, of a sweep lines with a point each, a task has in memory at once."""
    return max(1, TASK_BYTES // bytes_per_case(grid))


def memory_needed(grid: Grid, threads: int) -> int:
    """Return the bytes of all cases that so many threads hold at once, of sweeps a point of each line."""
    lines = grid.outer_count * grid.inner_count // grid.points
    return min(threads * together_in_memory(grid), lines) * bytes_per_case(grid)


def _memory_there_is() -> float:
    """Return the bytes that this process may still take: what is free, within limits of its shell and container."""
    limits = [float(re.findall(r"MemAvailable:\s*(\d+)", Path("/proc/meminfo").read_text(encoding="ascii"))[0]) * 1024]
    with suppress(OSError, ValueError):  # "max" where there is none
        limits.append(float(int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii"))))
    address_space = resource.getrlimit(resource.RLIMIT_AS)[0]
    if address_space != resource.RLIM_INFINITY:
        used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        limits.append(float(address_space - used))
    return min(limits)


def require_memory(grid: Grid, threads: int) -> None:
    """Raise :class:`MemoryError` where the cases that are held at once do not fit in the memory that there is."""
    needed, there = memory_needed(grid, threads), _memory_there_is()
    if needed > there:
        raise MemoryError(
            f"{threads} at once need {needed / 1e9:.3g} GB for {grid.sampling.count} samples of each case, and "
            f"{there / 1e9:.3g} GB are free"
        )


def model_seconds(grid: Grid, missing: NDArray[np.bool_] | None = None) -> float:
    """Return what a study's cases, or those ``missing``, cost by the model, without references."""
    setup, each, *_ = costs(grid)
    counts = _counts(grid, missing)
    return float(np.sum(setup * (counts > 0) + each * counts))


def _counts(grid: Grid, missing: NDArray[np.bool_] | None) -> NDArray[np.int64]:
    """Return how many cases are computed of each outer index that is computed, of sweeps in whole lines."""
    inner = map(grid.inner_computed, grid.computed.tolist())
    if missing is None:
        return np.array([every.size for every in inner])
    due = (missing[k, every].reshape(-1, grid.points) for k, every in zip(grid.computed, inner, strict=True))
    return np.array([np.count_nonzero(lines.any(axis=1)) * grid.points for lines in due])


def tasks(grid: Grid, missing: NDArray[np.bool_] | None = None, threads: int = 1) -> Iterator[Task]:
    """Yield the tasks of a study in archive order, one at a time; only distinct results are computed.

    They cost the same, as far as cases that are stepped together allow: a pack of them is not split, a part of it
    would cost as much. Of a sweep they are those of whole lines, which cost as much whatever is stored of them.

    Parameters
    ----------
    missing
        Whether each case is to be computed, ``(outer, inner)``; all of them where not given.
    threads
        Those that share the tasks.
    """
    outer, (setup, each, together, _) = grid.computed.tolist(), costs(grid)
    each, counts, most = each * grid.points, _counts(grid, missing) // grid.points, together_in_memory(grid)
    left, lines_left = model_seconds(grid, missing), int(counts.sum())
    units = [min(most, unit(grid, *of_scheme)) for of_scheme in zip(each.tolist(), together.tolist(), strict=True)]
    usual = fair_seconds(left, threads)
    number, batches, seconds, lines = 0, list[Batch](), 0.0, 0
    for k, once, one, least in zip(outer, setup.tolist(), each.tolist(), units, strict=True):
        due = grid.inner_computed(k)
        due = due if missing is None else due[missing[k, due]]
        begins = np.flatnonzero(np.diff(due // grid.points, prepend=-1))  # where a line begins, or each case
        while begins.size:
            fair = left / max(1, round(left / usual), -(-lines_left // most))
            if batches and (seconds + once + least * one / 2 > fair or lines + least > most):
                yield Task(number, tuple(batches), seconds)
                number, left, lines_left = number + 1, left - seconds, lines_left - lines
                batches, seconds, lines = [], 0.0, 0
                continue
            count = least * max(1, min(round((fair - seconds - once) / (least * one)), (most - lines) // least))
            count = begins.size if 2 * (begins.size - count) < least else count  # less than a pack costs as much as one
            count = min(count, begins.size)
            stop = begins[count] if count < begins.size else due.size
            batches.append(Batch(k, due[begins[0] : stop]))
            seconds, lines, once, begins = seconds + once + count * one, lines + count, 0.0, begins[count:]
    if batches:
        yield Task(number, tuple(batches), seconds)


def fair_seconds(every: float, threads: int) -> float:
    """Return the seconds of a task where all of them take ``every`` seconds and threads share them."""
    return min(max(every / (TASKS_PER_THREAD * threads), SHORTEST), LONGEST)


def unit(grid: Grid, each: float, together: int) -> int:
    """Return how many cases that take ``each`` seconds stay in one task: those that are stepped ``together``."""
    return 1 if grid.study.branch is not None else max(1, min(together, int(UNBROKEN / each)))
