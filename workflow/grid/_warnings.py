"""What to beware of in a study, before anything runs: of its axes, its scene, and each scheme at each step."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from random import Random
from typing import NamedTuple

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid
from workflow.grid._choice_words import choice_cautions
from workflow.grid._conditions import friction_of
from workflow.grid._frequencies import fastest
from workflow.grid._mesh_cautions import fast_samples
from workflow.grid._operators import Reduced, model_on, reduced, reduced_structure
from workflow.grid._scene_cautions import basis_text, cautions_of_scene
from workflow.judges.cautions import FEW, FreeModes, SchemeStep, StepCaution, free_modes, listed, step_cautions
from workflow.judges.trials import EXACT, reason_of
from workflow.models import one_thread
from workflow.study import CaseSettings

_REPEATED = 10
"""Lines of warnings that a run prints and its archive keeps, at most."""

_FEWEST_SAMPLES = 20
"""Samples of a load period of whose extremes a plan says nothing: of a sine they miss 1 %."""

_LOOKED_AT = 5000
"""Settings of the operators that are judged for what to beware of, at about 0.2 ms each."""


def warnings(grid: Grid) -> tuple[str, ...]:
    """Return what to beware of, one sentence each, none twice."""
    choices = [grid.settings(outer).scheme for outer in grid.kinds(lambda path: path == "scheme")]
    idle = (
        f"{dimension.name} changes nothing: no scheme of this study reads it, its cases are the same"
        for dimension in (*grid.outer, *grid.inner)
        if not any(grid.matters(one)(axis.path) for one in choices for axis in dimension.axes)
    )
    every = [grid.settings(outer) for outer in looked_at(grid.computed.tolist())]
    cautions = [caution for settings in every for caution in _cautions(grid, settings)]
    steps = _sentences(cautions, len(set(map(basis_text, every))))
    lacks_exact = grid.study.output.steady is not None and all(choice.method != EXACT for choice in choices)
    steady = (f"no scheme of this study is {EXACT}, which alone has steady rubs",) if lacks_exact else ()
    samples = (*_coarse_sections(grid), *fast_samples(grid))
    sentences = (*idle, *steady, *samples, *choice_cautions(grid), *cautions_of_scene(grid), *steps)
    return tuple(dict.fromkeys(sentences))


def _coarse_sections(grid: Grid) -> Iterator[str]:
    """Yield that extremes of load periods are taken of few samples."""
    samples = 1 / max(fastest(grid) * grid.sampling.interval, 1e-300)
    if grid.study.output.sections and samples < _FEWEST_SAMPLES:
        yield f"period_displacement is taken of {samples:.2g} samples a load period: give a smaller `output.interval`"


def warning_lines(grid: Grid) -> tuple[str, ...]:
    """Return what a run repeats of :func:`warnings`: the first of them, and how many more ``workflow plan`` names."""
    with one_thread():  # matrices are small
        try:
            sentences = warnings(grid)
        except (Exception, SystemExit) as error:  # of a foreign scheme's amplification, say: no run fails by it
            sentences = (f"what to beware of could not be found: {reason_of(error)}",)
    if len(sentences) <= _REPEATED:
        return sentences
    return (*sentences[: _REPEATED - 1], f"… and {len(sentences) - _REPEATED + 1} more, which `workflow plan` names")


def looked_at(outer: list[int]) -> list[int]:
    """Return outer indices to judge: all of them, or of very many a fixed random choice."""
    return outer if len(outer) <= _LOOKED_AT else sorted(Random(0).sample(outer, _LOOKED_AT))


@lru_cache(maxsize=64)
def _free_modes(by: Reduced) -> FreeModes:
    return free_modes(model_on(by).structure)


class _Caution(NamedTuple):
    """A caution about a scheme at a step on a structure, with the name of its reduced model."""

    basis: str
    scheme: str
    h: float
    said: StepCaution


def _cautions(grid: Grid, settings: CaseSettings) -> Iterator[_Caution]:
    """Yield the cautions about one scheme at one step on one structure."""
    scheme, options, structure = (
        schemes.load(settings.scheme.method),
        settings.scheme.options,
        reduced_structure(settings),
    )
    refusal = scheme.refusal(structure, options)
    if refusal is None:
        friction = friction_of(settings, structure, grid.inner_values(np.arange(grid.inner_count)), grid.inner_count)
        ends = float(friction.min()), float(friction.max())
        modes = _free_modes(reduced(settings))
        step = SchemeStep(scheme, options, settings.h, structure, modes, settings.reduction, ends, fastest(grid))
        said = list(step_cautions(step))
    else:
        basis = f" with {settings.reduction}" if structure.has_massless_tip else ""
        said = [StepCaution(f"fails{basis}, as {refusal}", "", 0.0)]
    yield from (_Caution(basis_text(settings), settings.scheme.label, settings.h, one) for one in said)


def _sentences(cautions: list[_Caution], bases: int) -> tuple[str, ...]:
    """Return one sentence per scheme and kind, with the largest amount at each step.

    What holds for some of the study's ``bases`` only is said with the one, or the worst, of them.
    """
    concerned: dict[tuple[str, str, float], set[str]] = {}
    worst: dict[tuple[str, str], dict[float, _Caution]] = {}
    for caution in cautions:
        kind = caution.said.what.split(" (")[0]  # the same first mode differs by a hair between reductions
        at = worst.setdefault((caution.scheme, kind), {})
        concerned.setdefault((caution.scheme, kind, caution.h), set()).add(caution.basis)
        if caution.h not in at or caution.said.size > at[caution.h].said.size:
            at[caution.h] = caution

    def amount(kind: tuple[str, str], caution: _Caution) -> str:
        some = len(concerned[*kind, caution.h])
        basis = caution.basis if some == 1 else f"worst with {caution.basis}"
        return f"{caution.said.amount} at h = {caution.h:g} s" + (f" ({basis})" if some < bases else "")

    def sentence(kind: tuple[str, str], at: dict[float, _Caution]) -> str:
        amounts = [amount(kind, caution) for _, caution in sorted(at.items()) if caution.said.amount]
        more = f" ({len(amounts)} steps)" if len(amounts) > FEW else ""
        return f"{kind[0]} {max(at.values(), key=lambda one: one.said.size).said.what} {listed(amounts)}{more}"

    return tuple(sentence(kind, at).rstrip() for kind, at in worst.items())
