"""Moreau–Jean θ-method with Newton's law at velocity level and implicitly coupled heat.

    Ŵ (v_free - v_k) = h (f_θ - C1 v_k - K1 (x_k + hθ v_k) - K12 (θ_k + θ δθ)),   Ŵ = M + hθC1 + h²θ²K1
    T̂ δθ = h (q - K2 θ_k) + α p e_n,   T̂ = C2 + hθK2
    p = max(0, (v_free,n + e v_n,k) / W)  where x_n,k + h/2 v_n,k >= d,  else 0
    W = e_nᵀ Ŵ⁻¹ (e_n - µ t + α hθ K12 T̂⁻¹ e_n)
    v_k+1 = v_free - Ŵ⁻¹ (e_n - µ t) p,   x_k+1 = x_k + h (θ v_k+1 + (1-θ) v_k)

with v_free,n the tip's velocity without contact. Acary & Brogliato (2008), chapters 8 and 10; θ = 1 is the implicit
Euler scheme of Thorin, Guérin and Legrand. A tip that its reduction leaves without mass has no impacts: contact is a
complementarity of place and impulse (:mod:`workflow.schemes._fixed.complementarity`), and e is not read. A structure is
stepped in its modes (:mod:`workflow.schemes._fixed`); a chain of so many nodes that its modes take longer to find than
they save is swept node by node (:mod:`workflow.schemes._sweep.sweeps`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from workflow.declare import quantity
from workflow.kernels.compiled import defines, uncounted
from workflow.kernels.lanes import WIDE
from workflow.kernels.packs import (
    Lane,
    align_stack,
    flag,
    of_lane,
    pack,
    raised,
    some,
    some_nonzero,
    spread,
    store,
    weighed,
    where,
)
from workflow.models import Array, Cases, Structure, needs_matrices
from workflow.schemes._fixed import dense, dense_balance, theta_method
from workflow.schemes._fixed.balance import Audit
from workflow.schemes._fixed.complementarity import (
    complementarity,
    march_dense_without_mass,
    march_without_mass,
)
from workflow.schemes._fixed.contact import (
    CASE_ALPHA,
    CASE_HEAT,
    CASE_IMPULSE,
    CASE_PRESSED,
    End,
    Free,
    TipStep,
    meet,
)
from workflow.schemes._fixed.costs import sweep_cost, theta_cost
from workflow.schemes._fixed.decoupled import decouple
from workflow.schemes._fixed.dense_march import DenseState, FreeStep, march_dense
from workflow.schemes._fixed.drive import began, relative, settled, wall
from workflow.schemes._fixed.march import march
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.modal_lanes import Coefficients, State
from workflow.schemes._fixed.outcome import by_heat
from workflow.schemes._fixed.stepping import collect
from workflow.schemes._fixed.theta_method import NEEDS_IMPLICIT, Contact, Operator, delassus, judge, step_modes
from workflow.schemes._interface import Results, Sampling
from workflow.schemes._sweep import sweeps
from workflow.schemes._sweep.balance import Account
from workflow.schemes._sweep.march import march_nodes, sweep

READS = frozenset({"e", "h", "alpha"})
GENERAL = frozenset({"damping", "friction", "load"})

HARMONICS = frozenset({"load", "casing"})
TOGETHER = WIDE
is_swept = sweeps.is_swept


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    theta: float = quantity("1", "weight of the step's end, 1: implicit Euler", default=1.0, at_least=0, at_most=1)


class Prox(NamedTuple):
    """Newton's law: e [1] and 1/W [kg], ``(case,)`` or one for all; NaN where W <= 0, so that contact ends the case."""

    restitution: Array | float
    inverse_delassus: Array | float


@defines(meet, Prox)
def meet_by_prox(law: Prox, step: TipStep, free: Free, own: Array, tip: Array, lane: Lane) -> End:
    """Return the tip at the step's end.

    After an impulse the velocity is -e v_n,k to the bit, not to the rounding of v_free - W p: a tip
    at rest on its casing keeps its place and stays active for any number of steps.
    """
    x, v = began(free.drive, tip, lane)
    p, temperature = spread(0.0, lane), free.temperature
    after = relative(free.drive, free.velocity + step.inverse_mass * free.impulse, lane)
    active = x + 0.5 * step.h * v >= wall(free.drive, free.gap, lane)
    engaged = some(active) or raised(own, (CASE_PRESSED, lane))
    if engaged:
        rebound = of_lane(law.restitution, lane) * v
        closing = (after + rebound) * of_lane(law.inverse_delassus, lane)
        meets = active & ~(closing <= 0.0)  # a NaN meets
        p = where(meets, closing, 0.0)
        after = where(meets, -rebound, after)
        heat = pack(own, (CASE_ALPHA, lane)) * p
        store(own, (CASE_HEAT, lane), heat)
        flag(own, (CASE_PRESSED, lane), some_nonzero(p))
        temperature += step.warming * heat
    store(own, (CASE_IMPULSE, lane), free.impulse - p)
    x += step.h * weighed(step.theta, after, step.rest, v)
    x, v = settled(free.drive, x, after, free.gap, lane)
    return End(engaged, x, v, temperature, p)


@uncounted
def _march(operator: Coefficients, law: Prox, state: State, block: Block, audit: Audit | None) -> None:
    """Step a block of cases."""
    align_stack()
    march(operator, law, state, block, audit)


@uncounted
def _march_nodes(nodes: sweeps.Nodes, law: Prox, own: Array, block: Block, account: Account) -> None:
    """Step a case along the nodes of a long chain."""
    march_nodes(nodes, law, own, block, account)


@uncounted
def _march_dense(
    free: FreeStep, law: Prox, state: DenseState, block: Block, account: dense_balance.Account, loads: Array, first: int
) -> None:
    """Step a block of cases by a dense matrix."""
    align_stack()
    march_dense(free, law, state, block, account, loads, first)


def in_matrices(structure: Structure, h: float, theta: float) -> dense.DenseOperator:
    """Return the operator of a structure that modes do not separate."""
    if structure.has_massless_tip:
        by_place = dense.DenseContact(
            march_dense_without_mass, lambda cases, w: complementarity(h, theta, w), np.asarray, "W"
        )
        return dense.init(structure, h, theta, by_place)
    return dense.init(structure, h, theta, dense.DenseContact(_march_dense, _prox, np.asarray, "W"))


def _prox(cases: Cases, w: Array) -> Prox:
    """Return Newton's law of cases with the Delassus operator W, 1/kg, ``(case,)``."""
    return Prox(cases.e, np.where(w <= 0, np.nan, 1 / np.where(w <= 0, 1.0, w)))


def operator_name(structure: Structure) -> str:
    """Return what a structure is stepped by, as ``plan`` says it."""
    return dense.operator_name(structure) if needs_matrices(structure) else sweeps.operator_name(structure)


def init(structure: Structure, h: float, options: Options) -> Operator | dense.DenseOperator:
    """Diagonalise the structure once for a batch; a long chain and coupled modes are left as they are."""
    if needs_matrices(structure):
        return in_matrices(structure, float(h), float(options.theta))
    motion = sweeps.Swept(structure) if is_swept(structure) else decouple(structure)
    return Operator(structure, float(h), float(options.theta), motion)


def _run(operator: Operator, cases: Cases, sampling: Sampling, heated: bool) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    h, theta, motion = operator.h, operator.theta, operator.motion
    w = delassus(motion, h, theta, cases.alpha, cases.friction)
    law = _prox(cases, w)
    if isinstance(motion, sweeps.Swept):
        ended = sweep(_march_nodes, operator, law, cases, sampling, heated)
    elif operator.structure.has_massless_tip:
        by_place, modal = complementarity(h, theta, w), motion if heated else motion.without_heat()
        ended = step_modes(march_without_mass, operator, modal, by_place, cases, sampling)
    else:
        ended = step_modes(_march, operator, motion if heated else motion.without_heat(), law, cases, sampling)
    contact = Contact(lambda step, alpha, slid: delassus(motion, step, theta, alpha, slid), "W")
    status, messages = judge(operator, contact, cases, sampling.duration, ended.finite)
    return collect(ended.watched, ended.closing, status, messages, ended.balances)


def compute(operator: Operator | dense.DenseOperator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    if isinstance(operator, dense.DenseOperator):
        return dense.compute(operator, cases, sampling)
    return by_heat(cases, lambda some, heated: _run(operator, some, sampling, heated))


def massless_tip(options: Options) -> str | None:
    """Return why a tip without mass cannot be stepped: it takes an implicit step."""
    return None if options.theta > 0 else NEEDS_IMPLICIT


def amplification(frequency: Array, damping: Array, h: float, options: Options) -> Any:
    """Return the eigenvalues (1 + (1-θ)hλ)/(1 - θhλ) of the free step of each mode."""
    return theta_method.amplification(frequency, damping, h, options.theta)


def thermal_amplification(rate: Array, h: float, options: Options) -> Array:
    """Return (1 - (1-θ)hμ)/(1 + θhμ) of each thermal mode."""
    return theta_method.thermal_amplification(rate, h, options.theta)


def cost(structure: Structure, h: float, options: Options, sampling: Sampling) -> float:
    """Return estimated seconds per heated case, see :mod:`workflow.schemes._fixed.costs`."""
    if needs_matrices(structure):
        return dense.cost(structure, h, sampling)
    return (sweep_cost if is_swept(structure) else theta_cost)(structure, h, sampling)
