"""Moreau–Jean θ-method with Newton's law at velocity level and implicitly coupled heat.

DESIGN section 2, "Discrete contact"; Acary & Brogliato (2008), chapters 8 and 10. θ = 1 is the
implicit Euler scheme of Thorin, Guérin and Legrand. A structure is stepped in its modes
(:mod:`workflow.schemes._modal_march`); a chain of so many nodes that its modes take longer to
find than they save is swept node by node instead (:mod:`workflow.schemes._sweeps`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from workflow.declare import quantity
from workflow.models import Array, Cases, Chain, Structure, poles
from workflow.schemes._balance import balance_cost
from workflow.schemes._decoupled import Decoupled, decouple, start
from workflow.schemes._interface import Results, Sampling, Status, merge, schedule
from workflow.schemes._lanes import WIDE
from workflow.schemes._marks import DISPLACEMENT, TEMPERATURE
from workflow.schemes._modal_march import march
from workflow.schemes._prox import contact_rows
from workflow.schemes._stepping import collect, watch
from workflow.schemes._sweep_march import sweep
from workflow.schemes._sweeps import Swept

READS = frozenset({"e", "h", "alpha"})

TOGETHER = WIDE

_ROUNDING = 16 * np.finfo(float).eps
"""A free step grows only above 1 by more than the few operations that compute its factor can err."""


_FINDING_MODES, _SWEEP, _MODE = 5e-9, 4.6e-9, 0.6e-9
"""Seconds to find the modes of a chain of n nodes, over n³, and of a step of one case per node in
sweeps and per pair of modes in a batch, when sweeps were new. The choice shows in the last digits of
results: it stays within a version of the solver, whatever has become faster since."""

_TYPICAL_STEPS = 1e6
"""Steps of all cases of a batch together for which an operator is chosen: ten cases of 1e5 steps."""


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    theta: float = quantity("1", "weight of the step's end, 1: implicit Euler", default=1.0, at_least=0, at_most=1)


@dataclass(frozen=True, eq=False)
class Operator:
    """What a batch shares: structure, step and options, and what follows from them."""

    structure: Structure
    h: float
    theta: float
    motion: Decoupled | Swept


def is_swept(structure: Structure) -> TypeGuard[Chain]:
    """Tell whether a structure is stepped node by node: where its modes cost more than they save."""
    if not isinstance(structure, Chain):
        return False
    n = structure.mechanical_size
    return not structure.has_matrices or _FINDING_MODES * n**3 > (_SWEEP - _MODE) * n * _TYPICAL_STEPS


def operator_name(structure: Structure) -> str:
    """Return what a structure is stepped by, as ``plan`` says it."""
    if is_swept(structure):
        return f"sweeps along {structure.mechanical_size} nodes"
    return f"{structure.mechanical_size} + {structure.thermal_size} modes"


def init(structure: Structure, h: float, options: Options) -> Operator:
    """Diagonalise the structure once for a batch, or leave a long chain as it is."""
    motion = Swept(structure) if is_swept(structure) else decouple(structure)
    return Operator(structure, float(h), float(options.theta), motion)


def delassus(motion: Decoupled | Swept, h: float, theta: float, alpha: Array) -> Array:
    """Return the Delassus operator W = e_nᵀ Ŵ⁻¹ (e_n + α hθ K12 T̂⁻¹ e_n), 1/kg, ``(case,)``."""
    mobility, heat = motion.compliance(h, theta)
    return np.asarray(mobility + alpha * heat)


def largest_admissible_step(motion: Decoupled | Swept, h: float, theta: float, alpha: float) -> float:
    """Return the largest step below ``h`` up to which W > 0 for every smaller step."""
    from scipy.optimize import brentq  # a sixth of a second to load, for steps that no case may take

    steps = h * np.logspace(-12, 0, 481)
    positive = np.array([float(delassus(motion, s, theta, np.array(alpha))) > 0 for s in steps])
    if not positive[0]:
        return 0.0
    first_bad = int(np.argmin(positive))
    return float(
        brentq(lambda s: float(delassus(motion, s, theta, np.array(alpha))), steps[first_bad - 1], steps[first_bad])
    )


def amplification(frequency: Array, damping: Array, h: float, options: Options) -> Any:
    """Return the eigenvalues (1 + (1-θ)hλ)/(1 - θhλ) of the free step of each mode."""
    lam = poles(frequency, damping)
    return (1 + (1 - options.theta) * h * lam) / (1 - options.theta * h * lam)


def thermal_amplification(rate: Array, h: float, options: Options) -> Array:
    """Return (1 - (1-θ)hμ)/(1 + θhμ) of each thermal mode."""
    return np.asarray((1 - (1 - options.theta) * h * rate) / (1 + options.theta * h * rate))


def cost(structure: Structure, h: float, options: Options, sampling: Sampling) -> float:
    """Return estimated seconds per heated case: a fixed model of steps, modes and samples.

    Its numbers lie between what a batch of eight and what a batch of a thousand cases took on one
    core of a server processor of 2024 (Zen 5, vectors of eight, 3 to 4 GHz), heated, full with 20
    nodes and reduced to 3 + 12 modes: 0.6 ns a step for the tip, 0.09 ns for each mechanical and 0.05 ns
    for each thermal mode, 15 ns a sample, 1.5 us to set a case up. A processor with vectors of four takes about
    twice as long; fewer than eight cases cost together what eight do. Balances come on top of that,
    see :func:`~workflow.schemes._balance.balance_cost`. A long chain counts 3.4 ns for each node, 5.4 ns with balances.
    """
    if is_swept(structure):
        step = 3e-8 + (5.4e-9 if sampling.balances else 3.4e-9) * structure.mechanical_size
        return sampling.steps(h) * step + sampling.count * 1.5e-8 + 1e-7 * structure.mechanical_size
    step = 0.6e-9 + 0.9e-10 * structure.mechanical_size + 0.5e-10 * structure.thermal_size
    if sampling.balances:
        step += balance_cost(structure)
    return sampling.steps(h) * step + sampling.count * 1.5e-8 + 1.5e-6


def _growth(motion: Decoupled | Swept, h: float, theta: float) -> float:
    """Return the largest factor of a free step; none is above 1 where θ >= 1/2."""
    if theta >= 0.5:
        return 1.0
    free = np.abs(amplification(motion.frequency, motion.damping, h, Options(theta))).max(initial=0.0)
    heat = np.abs(thermal_amplification(motion.rate, h, Options(theta))).max(initial=0.0)
    return float(max(free, heat))


def _largest_stable_step(motion: Decoupled | Swept, theta: float) -> float:
    """Return the step up to which no free mode grows: 2 Re λ + (1-2θ) h |λ|² <= 0 for every λ."""
    if theta >= 0.5:
        return float("inf")
    lam = np.concatenate([poles(motion.frequency, motion.damping).ravel(), -motion.rate + 0j])
    lam = lam[np.abs(lam) > 0]
    return float(np.min(-2 * lam.real / ((1 - 2 * theta) * np.abs(lam) ** 2), initial=np.inf))


def _run(operator: Operator, cases: Cases, sampling: Sampling, heated: bool) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    h, theta, motion = operator.h, operator.theta, operator.motion
    plan = schedule(sampling, h)
    w = delassus(motion, h, theta, cases.alpha)
    rows = contact_rows(cases, w)
    if isinstance(motion, Swept):
        watched = watch(cases, cases.mean, sampling, plan, h)
        closing, balances = sweep(motion, h, theta, rows, cases, watched, sampling, heated)
    else:
        modal = motion if heated else motion.without_heat()
        begun = start(modal, cases)
        watched = watch(cases, cases.mean + begun.tip_force, sampling, plan, h)
        closing, balances = march(operator.structure, modal, begun, h, theta, rows, cases, watched, sampling)
    finite = np.asarray(np.isfinite(watched.tip[[DISPLACEMENT, TEMPERATURE]]).all(axis=0))
    status, messages = judge(operator, cases, w <= 0, finite)
    return collect(watched, closing, status, messages, balances)


def judge(
    operator: Operator, cases: Cases, ill_posed: NDArray[np.bool_], finite: NDArray[np.bool_]
) -> tuple[NDArray[np.int8], dict[int, str]]:
    """Decide what became of each case: by theory where it can be, else by its last state."""
    h, theta, motion = operator.h, operator.theta, operator.motion
    growth = _growth(motion, h, theta)
    status = np.full(cases.count, Status.OK, dtype=np.int8)
    messages: dict[int, str] = {}
    for case in np.flatnonzero(~finite if growth <= 1 + _ROUNDING else np.ones(cases.count, dtype=bool)):
        if ill_posed[case] and not finite[case]:
            limit = largest_admissible_step(motion, h, theta, float(cases.alpha[case]))
            status[case] = Status.ILL_POSED
            messages[int(case)] = (
                f"contact has no unique solution at h = {h:.6g} s (W <= 0 at alpha = {cases.alpha[case]:.6g}); "
                f"the largest admissible h is {limit:.6g} s"
            )
        elif growth > 1 + _ROUNDING:
            limit = _largest_stable_step(motion, theta)
            status[case] = Status.DIVERGED
            messages[int(case)] = f"the free step grows {growth:.6g}-fold at theta = {theta:g} and h = {h:.6g} s; " + (
                f"it is stable up to h = {limit:.6g} s" if limit > 0 else "it is stable at no h"
            )
        else:
            status[case] = Status.DIVERGED
            messages[int(case)] = f"the state left the finite numbers at h = {h:.6g} s"
    return status, messages


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    heated = cases.heated
    groups = [(np.flatnonzero(heated), True), (np.flatnonzero(~heated), False)]
    with np.errstate(over="ignore", invalid="ignore"):  # a case that is lost says so by its status
        return merge([(w, _run(operator, cases.take(w), sampling, hot)) for w, hot in groups if w.size])
