"""Cost model of a run, in processor seconds: it cuts tasks."""

from __future__ import annotations

from workflow import schemes
from workflow.judges.trials import EXACT
from workflow.models import Structure, needs_matrices
from workflow.schemes import Sampling
from workflow.study import CaseSettings, Study

_UNMEASURED = 1e-7
"""Seconds of a step over the blocks of a structure, of a scheme that nobody has measured."""

_ALWAYS, _EACH_PERIOD = 250, 30
"""Steps of a scheme that finds its own: to set an α up, and in each period of the fastest load or casing."""

_TIP = 10
"""States that take as long as the tip and its contact."""

_RUB = 5e-5
"""Seconds of a steady rub for each of its states squared."""

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
    return steps * blocks * (scheme.STEP_SECONDS or _UNMEASURED) * audit


def steady_seconds(study: Study, settings: CaseSettings, structure: Structure) -> float:
    """Return what the steady rubs of a case cost, 0 where they are not asked for."""
    if study.output.steady is None or settings.scheme.method != EXACT:
        return 0.0
    return (study.branch.points if study.branch else 1) * _RUB * _states(structure) ** 2


def setup_seconds(structure: Structure) -> float:
    """Return what an operator of a scheme costs to set up."""
    states = _states(structure)
    return 6e-4 + (1.2e-7 * states**2 if structure.damper is None else 3.5e-9 * states**3)


def modes_seconds(structure: Structure) -> float:
    """Return what modes and the reduction of a full structure cost, of a large one those of few modes."""
    return 5e-3 + 1.2e-7 * min(_states(structure), _DENSE) ** 2 + _few_modes_seconds(structure)


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
