"""One batch through models, reduction and scheme: every variable of the archive for its cases."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import variables
from workflow.cases import (
    TOLERANCE,
    Grid,
    Indices,
    Perturbation,
    Start,
    cases_of,
    exact_settings,
    reference_settings,
    tells_basis_error,
)
from workflow.judges.load_periods import contact_force, largest_per_period, sections, widened
from workflow.judges.trials import DECIDING, EXACT, reason_of
from workflow.kernels.compiled import CompilerError
from workflow.models import Array, Cases, Sensor, Structure
from workflow.schemes import Results, Status
from workflow.solve._compile import KernelVariant
from workflow.solve._operators import (
    as_run,
    compile_for,
    end_of,
    judged,
    kernel_variant,
    permanent_contact,
    projection_residual_of,
    run_batch,
)
from workflow.solve._solutions import Solutions, against_reference, solutions_for, texts_of
from workflow.solve._tasks import Batch
from workflow.solve._variables import Values, blank, lengths
from workflow.study import CaseSettings, Study


def _sensors_of(study: Study) -> tuple[Sensor, ...]:
    return tuple(study.output.sensors.values())


def steady_values(grid: Grid, settings: CaseSettings, cases: Cases) -> tuple[Values, dict[int, str]]:
    """Return the steady rubs of cases given on the nodes, and what is said of some; nothing where none is asked for."""
    asked = grid.study.output.steady
    if asked is None or settings.scheme.method != EXACT:
        return {}, {}
    from workflow.orbits import Options, steady_rubs

    structure, projected = as_run(settings, cases, _sensors_of(grid.study))
    options = Options(asked.periods, asked.samples)
    values, messages = steady_rubs(structure, projected, options)
    return values, {k: text for k, text in enumerate(messages) if text}


def branch_values(grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None) -> tuple[Values, str]:
    """Return the branch of one case, ``(1, point, …)``, and why it has no point, where it has none."""
    from workflow.orbits import Number, Options, bifurcation_shifts, boundaries, follow, tabulate

    study, first = grid.study, grid.settings(outer)
    sensors, asked = _sensors_of(study), study.output.steady
    assert study.branch is not None
    assert asked is not None
    axis = study.branch.axis

    def problem(path: str, value: float, other: float) -> tuple[Structure, Cases]:
        """Return structure and case at a value of the axis and of another number."""
        numbers, varying = {axis.path: value, path: other}, dict(grid.inner_values(inner))
        varying |= {path: np.full(inner.size, other)} if path in varying else {}
        return as_run(*cases_of(grid.settings(outer, numbers), varying, inner.size, perturbation), sensors)

    def number(path: str, change: float) -> Number:
        """Return an uncertain number."""
        varying = grid.inner_values(inner)
        value = float(varying[path][0]) if path in varying else study.number_at(path, first)
        assert value is not None
        return Number(partial(problem, path), value, change)

    (start, stop), options = map(float, axis.values), Options(asked.periods, asked.samples)
    numbers = [number(path, change.value) for path, change in study.uncertain.items()]
    beside = [each.problem(start, each.value + each.change) for each in numbers]
    if study.boundary is not None:
        over, (low, high) = study.boundary.axis, map(float, study.boundary.axis.values)
        beside += [problem(over.path, start, low), problem(over.path, start, high)]
    heated = any(bool(cases.heated.any()) for _, cases in beside)
    followed = follow(lambda value: problem(axis.path, value, value), start, stop, options, heated=heated)
    along, message = tabulate(followed, study.branch.points, options)
    values: Values = along
    values[axis.name] = values.pop("value")
    if numbers:
        values["bifurcation_shift"] = bifurcation_shifts(followed, study.branch.points, numbers).T
    if study.boundary is not None:
        last = follow(lambda value: problem(over.path, value, high), start, stop, options, heated=heated)
        found, left = boundaries(partial(problem, over.path), followed, last, low, high, study.boundary.points)
        values |= {"boundary_kind": found.kind, "boundary_end": found.end}
        values |= {"boundary_angle": found.angle, "boundary_other": found.other}
        values |= {f"boundary_{axis.name}": found.branched, f"boundary_{over.name}": found.other_parameter}
        none = "" if found.kind.any() else "boundary: no branch has a bifurcation, at either end of the range"
        message = "; ".join(filter(None, [message, left, none]))
    for about in variables.select(None, None, "steady", *(("steady sensors",) if sensors else ())):
        if about.is_of_sensor or (study.contacts and about.is_of_contact):  # before points
            values[about.name] = values[about.name].swapaxes(0, 1)
    return {name: array[None] for name, array in values.items()}, message


SHORT, REPEATS = 2e-3, 3
"""A batch that took less processor time, in seconds, is run up to so many times in all and the least time counts."""


@dataclass(frozen=True, eq=False)
class Solved:
    """All variables of a batch, by name, each ``(case, …)``.

    ``messages`` holds, by position, what a case did that is not ok, and which errors of an ok one cannot be formed.
    ``following`` is how the next points of a sweep start, NaN after a case that raised.
    """

    values: dict[str, NDArray[Any]]
    messages: dict[int, str]
    following: Start | None = None


def solve(
    grid: Grid,
    outer: int,
    inner: Indices,
    perturbation: Perturbation | None = None,
    solutions: Solutions | None = None,
) -> Solved:
    """Run the cases ``inner`` of one outer index, as :func:`solve_in_parts`, and return all of them."""
    places, parts = zip(*solve_in_parts(grid, outer, inner, perturbation, solutions), strict=True)
    rows, every = np.argsort(np.concatenate(places)), joined(parts)
    values = {name: array[rows] for name, array in every.values.items()}
    return Solved(values, texts_of(every.messages, rows))


def solve_in_parts(
    grid: Grid,
    outer: int,
    inner: Indices,
    perturbation: Perturbation | None = None,
    solutions: Solutions | None = None,
) -> Iterator[tuple[Indices, Solved]]:
    """Run the cases ``inner`` of one outer index and yield them as they end, with their places in ``inner``.

    They end together, those of a sweep point by point: lines are run from their first point on. Cases that differ only
    in axes their scheme does not read are run once; the reference may read them, so each has its own errors. If a batch
    raises, its cases run one by one, and those that raise have the status ``failed``. ``perturbation`` changes the data
    of the cases, not those of their reference; ``solutions`` are those that errors are measured against, which are
    computed here if they are not given.
    """
    first = grid.inner_alike(inner, grid.is_read(grid.settings(outer).scheme))
    if solutions is None:
        solutions = solutions_for(grid, Batch(outer, inner))
    choice, left = grid.choice(outer), inner.size
    for number, solved in _ended(grid, outer, np.unique(first), perturbation):
        places = np.flatnonzero(np.isin(first, number))
        where, count = np.searchsorted(number, first[places]), places.size
        values = {name: array[where] for name, array in solved.values.items()}
        with np.errstate(all="ignore"):
            errors, remarks = against_reference(grid, outer, inner[places], values, solutions)
            values |= _basis(grid, outer, count, errors)
        unconfirmed = dict[int, str]()
        if choice is not None and not choice.is_confirmed:
            unconfirmed = dict.fromkeys(range(count), f"basis_error: {choice.against}")
        if count:  # else they are stored: a line begins before the points that are asked for
            messages = _said(remarks, texts_of(solved.messages, where), unconfirmed)
            yield places, Solved({**values, **errors}, messages)
            left -= count
    if left:
        raise RuntimeError(f"of the cases {inner.tolist()} {left} did not end")


def _said(*every: Mapping[int, str]) -> dict[int, str]:
    """Return what several say of cases, by position, of those of which any says something."""
    return {k: "; ".join(texts[k] for texts in every if k in texts) for k in set().union(*every)}


def _basis(grid: Grid, outer: int, count: int, errors: Mapping[str, Array]) -> dict[str, Array]:
    """Return counts of vectors and their error, ``(case,)`` each, where a tolerance decides some of a study.

    The error is that of the trials, but of a case that misses the tolerance its own where the reference tells it.
    """
    if not grid.study.is_auto:
        return {}
    settings, choice = grid.settings(outer), grid.choice(outer)
    used = {f"{path}_used": getattr(settings, path) for path in ("mechanical_modes", "thermal_modes")}
    columns = {**used, "basis_error": np.nan if choice is None else choice.error}
    basis = {name: np.full(count, float(value)) for name, value in columns.items()}
    if choice is not None and tells_basis_error(grid, outer):
        largest = np.max([errors[f"{name}_model_error"] for name in DECIDING], axis=0)
        basis["basis_error"] = np.where(largest > float(grid.value(outer, TOLERANCE)), largest, basis["basis_error"])
    return basis


def _ended(
    grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None
) -> Iterator[tuple[Indices, Solved]]:
    """Yield distinct cases as they end, with their inner indices, ascending: those of a line as far as asked for.

    Each point of a sweep starts from the state in which the one before ended. After a point that is not ok its line
    cannot go on: the points that follow are ``failed``.
    """
    points, last, swept, start = grid.points, int((inner % grid.points).max()), grid.study.swept, None
    lines = np.unique(inner // points)
    for point in range(last + 1):
        solved = _solve_or_tell(grid, outer, lines * points + point, perturbation, start)
        yield lines * points + point, solved
        if swept is None:
            return
        ended = solved.values["status"] == Status.OK
        for k in np.flatnonzero(~ended).tolist():
            how = Status(int(solved.values["status"][k])).name.lower()
            text = f"not run: the sweep ended at {swept.name} = {swept.values[point]!r}, which is {how}"
            for following in range(point + 1, last + 1):
                yield lines[[k]] * points + following, failed(grid, 1, text)
        lines = lines[ended]
        if not lines.size:
            return
        assert solved.following is not None
        start = solved.following.take(ended)


def _solve_or_tell(
    grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None, start: Start | None = None
) -> Solved:
    """Run distinct cases; if a batch raises, each case runs alone and the one that raises is ``failed``."""
    try:
        with np.errstate(all="ignore"):  # a case that leaves the numbers says so by its status
            return _solve_distinct(grid, outer, inner, perturbation, start)
    except CompilerError:
        raise
    except (Exception, SystemExit) as error:  # whatever a model or scheme raises is that case's result
        if inner.size == 1:
            return failed(grid, 1, reason_of(error))
        each = [slice(k, k + 1) for k in range(inner.size)]
        parts = [_solve_or_tell(grid, outer, inner[k], perturbation, start and start.take(k)) for k in each]
        return replace(joined(parts), following=_following([part.following for part in parts]))


def joined(parts: Sequence[Solved]) -> Solved:
    """Put batches together, with the variables that all have: a branch that raised has more."""
    shared = [name for name in parts[0].values if all(name in part.values for part in parts)]
    values = {name: np.concatenate([part.values[name] for part in parts]) for name in shared}
    first = np.cumsum([0, *(part.values["status"].size for part in parts)]).tolist()
    messages = {at + k: text for at, part in zip(first, parts, strict=False) for k, text in part.messages.items()}
    return Solved(values, messages)


def failed(grid: Grid, count: int, text: str) -> Solved:
    """Return so many cases that failed: without results, with a text that says why."""
    status = {"status": np.full(count, Status.FAILED, dtype=np.int8)}
    return Solved({**blank(grid, count), **status}, dict.fromkeys(range(count), text))


def _following(each: list[Start | None]) -> Start | None:
    """Return how the next points of some cases start, one by one, NaN after one that raised; ``None`` if all did."""
    known = next((one for one in each if one is not None), None)
    if known is None:
        return None
    blank = Start(*(np.full_like(rows[:1], np.nan) for rows in known))
    return Start(*map(np.concatenate, zip(*(one or blank for one in each), strict=True)))


def _solve_distinct(
    grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None, start: Start | None
) -> Solved:
    settings = grid.at_point(outer, int(inner[0]) % grid.points)
    if grid.study.branch is not None:
        compile_for(settings, grid.sampling.balances)
        return joined([_followed(grid, outer, inner[k : k + 1], perturbation) for k in range(inner.size)])
    settings, cases = cases_of(settings, grid.inner_values(inner), inner.size, perturbation, start)
    if cases.contact_shape != grid.study.contact_shape:
        raise ValueError("its structure has another number of contacts than the archive; give it a study of its own")
    compile_for(settings, grid.sampling.balances)
    results, seconds = _timed(grid, settings, cases)
    results = judged(settings, cases, results, grid.sampling.duration)
    steady, remarks = steady_values(grid, settings, cases)
    contact = permanent_contact(settings, cases.alpha, cases.friction)._asdict()
    values: dict[str, NDArray[Any]] = {
        **blank(grid, inner.size),
        **results.histories,
        **results.metrics,
        **_contact(results, cases, grid),
        **_of_sensors(results, cases, grid),
        **_events(results.events, cases.count),
        **_worn(results, cases, grid),
        **_over_depth(grid, settings, cases),
        **steady,
        **{name: value for name, value in contact.items() if name in variables.BY_NAME},
        "projection_residual": projection_residual_of(settings, cases),
        "processor_time": np.full(inner.size, seconds / inner.size),
        "batch_width": np.full(inner.size, float(inner.size)),
        "status": results.status,
        "runaway": contact["runaway"].astype(np.int8),
    }
    messages = _said(results.messages, remarks)
    if grid.points == 1:
        return Solved(values, messages)
    own, unworn = cases.coating, np.zeros((cases.count, 0, 0))
    worn = unworn if own is None else results.wear["worn_depth"].reshape(own.worn.shape)
    return Solved(values, messages, Start.after(end_of(settings, results), worn, cases, start, grid.sampling.duration))


def _followed(grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None) -> Solved:
    """Return the branch of one case, which failed where it has no point."""
    values, message = branch_values(grid, outer, inner, perturbation)
    status = Status.FAILED if np.isnan(values["steady_periods"]).all() else Status.OK
    return Solved({**values, "status": np.full(1, status, dtype=np.int8)}, {0: message} if message else {})


def _timed(grid: Grid, settings: CaseSettings, cases: Cases) -> tuple[Results, float]:
    """Run a batch and return this thread's processor time, s; with a reference the least of some short runs."""
    seconds: list[float] = []
    while True:
        begun = time.thread_time()
        results = run_batch(settings, cases, grid.sampling, sensors=_sensors_of(grid.study))
        seconds.append(time.thread_time() - begun)
        if grid.study.reference is None or sum(seconds) > SHORT or len(seconds) == REPEATS:
            return results, min(seconds)


def _over_depth(grid: Grid, settings: CaseSettings, cases: Cases) -> dict[str, Array]:
    """Return the mean temperature over the depth that a study asks for: the same motion, run once more."""
    depth = grid.study.output.temperature_depth
    if depth is None:
        return {}
    results = run_batch(settings, cases, grid.sampling, depth)
    means = {"depth_temperature": results.histories["temperature"]}
    return means | {"max_depth_temperature": results.metrics["max_temperature"]}


def _contact(results: Results, cases: Cases, grid: Grid) -> dict[str, Array]:
    """Return contact force and impulses, all from the sampled running sum of the impulse."""
    sampling, periods, impulse = grid.sampling, grid.longest_period_count, results.histories["impulse"]
    force = contact_force(impulse, sampling.interval)
    return {
        "contact_force": force,
        "contact_impulse": impulse[..., -1].copy(),
        "period_impulse": widened(results.period_impulse, periods),
        "period_force": largest_per_period(force[..., 1:], cases.period_frequency, sampling, periods),
        "period_temperature": widened(results.period_temperature, periods),
        "period_contact": widened(results.period_contact, periods),
        **(sections(results, cases, sampling, periods) if grid.study.output.sections else {}),
    }


def _of_sensors(results: Results, cases: Cases, grid: Grid) -> dict[str, Array]:
    """Return extremes and root mean square of sensors in the last half, and the largest value in each load period."""
    if not grid.study.output.sensors:
        return {}
    values, by = results.histories["sensor_value"], (cases.period_frequency, grid.sampling, grid.longest_period_count)
    last = values[..., grid.sampling.count // 2 :]
    return {
        "sensor_max": last.max(axis=-1),
        "sensor_min": last.min(axis=-1),
        "sensor_rms": np.sqrt(np.mean(last**2, axis=-1)),
        "period_sensor_max": largest_per_period(values[..., 1:], *by),
    }


def _worn(results: Results, cases: Cases, grid: Grid) -> dict[str, Array]:
    """Return worn depths, NaN beyond the sectors of a case, their largest, and the work that crushed the coating."""
    if cases.coating is None:
        return {}
    worn, mapped, sizes = results.wear["worn_depth"], results.wear["wear_map"], lengths(grid)
    wide = np.full((*worn.shape[:-1], sizes.get("revolution", 0), sizes["sector"]), np.nan)
    wide[..., : mapped.shape[-2], : mapped.shape[-1]] = mapped
    largest = np.fmax.reduce(worn, axis=-1)
    work = cases.coating.crushing_work(worn.reshape(cases.coating.worn.shape)).reshape(largest.shape)
    values = {"max_worn_depth": largest, "crushing_work": np.where(np.isnan(largest), np.nan, work)}
    return values | {"worn_depth": widened(worn, sizes["sector"]), "wear_map": wide}


def _events(given: Mapping[str, Array], count: int) -> dict[str, NDArray[Any]]:
    """Return the list of events, whose words are numbers; of a scheme without one its length is 0."""
    words = {name: given[name] for name in ("event_kind", "event_contact") if name in given}
    numbers = {name: np.where(np.isnan(values), -1, values).astype(np.int8) for name, values in words.items()}
    return {"event_count": np.zeros(count), **given, **numbers}


def kernel_variants(grid: Grid) -> list[KernelVariant]:
    """Return what the first case of each scheme needs, and its references; what others need is compiled for them.

    A case that cannot even be set up needs nothing: it will say so itself.
    """
    every: list[tuple[Callable[[], CaseSettings], bool]] = [
        (partial(grid.settings, outer), grid.sampling.balances) for outer in grid.kinds(lambda path: path == "scheme")
    ]
    if grid.study.reference is not None:
        every += [(partial(reference_settings, grid, 0), False), (partial(exact_settings, grid, 0), False)]
    variants: dict[object, KernelVariant] = {}
    for settings, balances in every:
        with suppress(Exception):
            variant = kernel_variant(settings(), balances)
            if variant is not None:
                variants.setdefault(variant.words, variant)
    return list(variants.values())
