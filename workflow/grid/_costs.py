"""What parts of a run cost by a fixed model, and under which names their measured time is kept."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace

from workflow import schemes
from workflow.grid._speed import SLOWEST, timed
from workflow.kernels.lanes import PACK
from workflow.models import MOST_BY_SUPERLU, Sparse, Structure, expected_fill, has_cholmod, needs_matrices
from workflow.schemes import Sampling
from workflow.study import Cell, SchemeChoice, Study

STEP_SECONDS = 1e-6
"""Seconds of a step of a scheme that nobody has measured."""

_CASE = 5e-6
"""Seconds of a case beside its steps and samples."""

_SAMPLE = 1.5e-8
"""Seconds of a sample."""

_ALWAYS, _EACH_PERIOD = 400, 30
"""Steps of a scheme that finds its own: to set an α up, and in each period of the fastest load or casing."""

_TIP = 10
"""States that take as long as the tip and its contact."""

_RUB = 5e-5
"""Seconds of a steady rub for each of its states squared."""

_DENSE = 600
"""States of a structure up to which its growth rate comes from all of them."""

COMPILING = {"event_driven": 18.0}
"""Seconds that compiling the kernels of a scheme takes; :data:`COMPILING_OTHERS` for the others."""

COMPILING_OTHERS = 7.0

BESIDE_TASKS = 0.4
"""Seconds of a run beside its tasks: libraries loaded, archive gathered and read back."""


@dataclass(frozen=True)
class Part:
    """A part of a run: its seconds by the fixed model, and its names, the most specific first."""

    seconds: float
    keys: tuple[str, ...]
    is_guess: bool = False
    """Whether the model knows nothing of the part: it is measured however far from the model it is."""


def case_seconds(cell: Cell, structure: Structure, sampling: Sampling, periods: float) -> float:
    """Return what a case costs by the fixed model: steps × blocks × one measured figure of its scheme.

    Blocks are its states and the tip; where modes are coupled a balance has as many as products of two. ``periods``
    are those of the fastest sinusoid of load and casing within the duration.
    """
    scheme = schemes.load(cell.scheme.method)
    own = sampling.count / 2 + _ALWAYS + _EACH_PERIOD * (1 + periods)
    steps = sampling.steps(cell.h) if "h" in scheme.READS else own
    if not scheme.STEP_SECONDS:
        return STEP_SECONDS * (steps + sampling.count)
    blocks = float(2 * structure.mechanical_size + structure.thermal_size + _TIP)
    if "h" in scheme.READS and needs_matrices(structure):
        blocks *= 1 + (blocks if sampling.balances else 1)
    audit = 1.5 if sampling.balances and "h" in scheme.READS else 1.0
    return steps * blocks * scheme.STEP_SECONDS * audit + sampling.count * _SAMPLE + _CASE


def batch_part(cell: Cell, structure: Structure, sampling: Sampling, count: int, periods: float) -> Part:
    """Return what a batch of so many cases costs on the structure it is run on, whole packs where it has any."""
    scheme, choice = schemes.load(cell.scheme.method), cell.scheme
    general = f"{choice.method} {_kind(choice)}{' balances' if sampling.balances else ''}"
    sized = f"{general}/{structure.mechanical_size}+{structure.thermal_size}"
    padded = -(-count // PACK) * PACK if scheme.TOGETHER > 1 else count
    seconds = padded * case_seconds(cell, structure, sampling, periods)
    return Part(seconds, (sized, general), is_guess=not scheme.STEP_SECONDS)


def steady_part(study: Study, cell: Cell, structure: Structure, count: int) -> Part:
    """Return what the steady rubs of so many cases cost, nothing where they are not asked for."""
    steady, branch = study.output.steady, study.branch
    rubs = 0 if steady is None or cell.scheme.method != "event_driven" else count * (branch.points if branch else 1)
    states = 2 * structure.mechanical_size + structure.thermal_size
    return Part(rubs * _RUB * states**2, ("steady rubs",), is_guess=True)


def _kind(choice: SchemeChoice) -> str:
    """Return the options of a scheme that are words: they choose other kernels."""
    words = (getattr(choice.options, name) for name in type(choice.options).__dataclass_fields__)
    return " ".join(word for word in words if isinstance(word, str))


def setup_part(method: str, structure: Structure) -> Part:
    """Return what an operator of a scheme costs to set up."""
    states = 2 * structure.mechanical_size + structure.thermal_size
    if structure.damper is not None:
        return Part(6e-4 + 3.5e-9 * states**3, (f"set up {method} with a damping matrix",))
    return Part(6e-4 + 1.2e-7 * states**2, (f"set up {method}",))


def compiling_part(method: str, kernels: int = 1) -> Part:
    """Return what compiling some kernels of a scheme costs."""
    return Part(kernels * COMPILING.get(method, COMPILING_OTHERS), (f"compiling {method}",), is_guess=True)


def compiling_parts(method: str) -> dict[str, Part]:
    """Return what each of a scheme's ``KERNEL_CALLS`` costs, by name: as much as the others, before it is measured."""
    calls, whole = schemes.load(method).KERNEL_CALLS, compiling_part(method)
    (general,) = whole.keys
    return {
        call: replace(whole, seconds=whole.seconds / len(calls), keys=(f"{general}/{call}", general)) for call in calls
    }


def factor_lines(structure: Structure) -> Iterator[str]:
    """Yield what each factorisation of a large structure takes, in words."""
    if not isinstance(structure, Sparse):
        return
    for pair, kind in ((structure.mechanical, "displacements"), (structure.thermal, "temperatures")):
        if pair.size > MOST_BY_SUPERLU:
            by = "CHOLMOD" if has_cholmod() else "SuperLU"
            yield f"{pair.size} {kind}: {expected_fill(pair.stiffness, has_cholmod())} each factorisation by {by}"


def growth_part(structure: Structure) -> Part:
    """Return what the growth rate at one α costs: the eigenvalues of a structure, of a large one those of few modes."""
    states = 2 * structure.mechanical_size + structure.thermal_size
    large = 1e-6 * states if states > _DENSE else 0.0
    size = "of large structures" if large else "of structures"
    return Part(
        1e-4 + 1.5e-9 * min(states, _DENSE) ** 3 + large, (f"growth rates {size}/{states}", f"growth rates {size}")
    )


def handling_part(cases: int, segments: int, samples: int, histories: int) -> Part:
    """Return what the cases of a task cost beside their schemes: conditions, metrics, compression, one file."""
    stored = "histories" if histories else "metrics"
    seconds = 3e-3 * segments + cases * (5e-6 + samples * (3e-8 + 8e-8 * histories))
    return Part(seconds, (f"handling/{stored}", "handling"))


def beside_part(cases: int, size: int) -> Part:
    """Return what a run costs beside its tasks, for so many cases and bytes of results."""
    return Part(BESIDE_TASKS + 3e-6 * cases + 8e-9 * size, ("beside",))


@contextmanager
def measured(part: Part) -> Iterator[None]:
    """Measure a part of a run."""
    slowest = math.inf if part.is_guess else SLOWEST
    with timed(part.seconds, *part.keys, slowest=slowest) if part.seconds > 0 else nullcontext():
        yield
