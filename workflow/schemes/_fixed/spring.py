"""Contact by a spring and a damper in a step of the θ-method, with an implicit force at the step's end.

The impulse of a step is p = h (θ λ' + (1-θ) λ), both forces by the law λ = max(0, κ (x_n - d) + c v_n) where
x_n > d. With the tip at (x_a, v_a) for λ' = 0 there are two branches:

    apart      λ' = 0,                                            consistent where x_a <= d or λ' below is not > 0
    in contact λ' = (κ (x_a - d) + c v_a) / (1 + hθW (hθκ + c)),  consistent where then x_n' > d

The force jumps by c v_n at the casing: where neither is consistent (the damper alone would push the
tip out again) λ' is what puts the tip on the casing, between the two.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from workflow.kernels.compiled import defines, uncounted
from workflow.kernels.packs import (
    Lane,
    Pack,
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
from workflow.models import Array, Cases, Structure
from workflow.schemes._fixed import dense
from workflow.schemes._fixed.balance import Audit
from workflow.schemes._fixed.contact import (
    CASE_ALPHA,
    CASE_HEAT,
    CASE_IMPULSE,
    CASE_LAST,
    CASE_PRESSED,
    End,
    Free,
    TipStep,
    contact_gain,
    count_rebounds,
    meet,
)
from workflow.schemes._fixed.decoupled import Decoupled
from workflow.schemes._fixed.dense import DenseContact, DenseOperator
from workflow.schemes._fixed.dense_balance import Account
from workflow.schemes._fixed.dense_march import DenseState, FreeStep, march_dense
from workflow.schemes._fixed.drive import began, gap_before, relative, relative_before, settled, wall
from workflow.schemes._fixed.march import march
from workflow.schemes._fixed.marks import TIP_DISPLACEMENT, TIP_VELOCITY, Block
from workflow.schemes._fixed.modal_lanes import Coefficients, State
from workflow.schemes._fixed.outcome import by_heat, effective_restitution
from workflow.schemes._fixed.stepping import collect
from workflow.schemes._fixed.theta_method import Contact, Operator, delassus, judge, step_modes
from workflow.schemes._interface import Results, Sampling


class Spring(NamedTuple):
    """A contact spring κ [N/m] and damper c [N s/m] in a step; each number may be one of each case, ``(case,)``."""

    stiffness: Array | float
    damping: Array | float
    delassus: Array | float
    """W, 1/kg."""
    share: Array | float
    """1 / (1 + hθW (hθκ + c)), NaN where that is not > 0."""
    reach: Array | float
    """Force per depth that puts the tip on the casing, 1/(h²θ²W), N/m, infinite where no force does."""


@defines(meet, Spring)
def meet_spring(law: Spring, step: TipStep, free: Free, own: Array, tip: Array, lane: Lane) -> End:
    """Return the tip at the step's end."""
    h, theta = step.h, step.theta
    x, v = began(free.drive, tip, lane)
    w, held = of_lane(law.delassus, lane), pack(own, (CASE_LAST, lane))
    begun = h * (1.0 - theta) * held
    apart = relative(free.drive, free.velocity + step.inverse_mass * free.impulse - w * begun, lane)
    depth = x + h * weighed(theta, apart, step.rest, v) - wall(free.drive, free.gap, lane)
    force = (of_lane(law.stiffness, lane) * depth + of_lane(law.damping, lane) * apart) * of_lane(law.share, lane)
    most = depth * of_lane(law.reach, lane)
    force = where(force > most, most, force)
    force = where(depth > 0.0, force, 0.0)
    force = where(force <= 0.0, 0.0, force)  # a NaN passes
    p = begun + h * theta * force
    after = apart - w * (h * theta * force)
    store(own, (CASE_IMPULSE, lane), free.impulse - p)
    pressed = some_nonzero(p) or some_nonzero(force)  # with θ = 0 a force acts from the next step on
    engaged = pressed or raised(own, (CASE_PRESSED, lane))
    if engaged:
        touches, touched = force > 0.0, held > 0.0
        store(own, (CASE_LAST, lane), force)
        flag(own, (CASE_PRESSED, lane), pressed)
        store(own, (CASE_HEAT, lane), pack(own, (CASE_ALPHA, lane)) * p)
        count_rebounds(touches & ~touched, touched & ~touches, v, after, own, lane)
    temperature = free.temperature + step.warming * pack(own, (CASE_HEAT, lane))
    x, v = settled(free.drive, x + h * weighed(theta, after, step.rest, v), after, free.gap, lane)
    return End(engaged, x, v, temperature, p)


@defines(contact_gain, Spring)
def _spring_gain(
    law: Spring, step: TipStep, end: End, change: Pack, free: Free, own: Array, tip: Array, lane: Lane
) -> Pack:
    """Return Δ(κ δ²/2) - h κ δ_θ (v + v')/2 with the depths δ, 0 where the tip is not beyond the casing.

    Velocities are relative to the casing where that moves.
    """
    drive = free.drive
    begins = pack(tip, (TIP_DISPLACEMENT, lane)) - gap_before(drive, free.gap, lane)
    ended = end.displacement - free.gap
    if not (some(begins > 0.0) or some(ended > 0.0)):
        return spread(0.0, lane)
    before, after = where(begins > 0.0, begins, 0.0), where(ended > 0.0, ended, 0.0)
    speeds = relative_before(drive, pack(tip, (TIP_VELOCITY, lane)), lane) + relative(drive, end.velocity, lane)
    worked = (step.theta * after + (1.0 - step.theta) * before) * (0.5 * step.h * speeds)
    return of_lane(law.stiffness, lane) * (0.5 * (after * after - before * before) - worked)


@uncounted
def _march(operator: Coefficients, law: Spring, state: State, block: Block, audit: Audit | None) -> None:
    """Step a block of cases."""
    align_stack()
    march(operator, law, state, block, audit)


@uncounted
def _march_dense(
    free: FreeStep, law: Spring, state: DenseState, block: Block, account: Account, loads: Array, first: int
) -> None:
    """Step a block of cases by a dense matrix."""
    align_stack()
    march_dense(free, law, state, block, account, loads, first)


_YIELDS = "1 + hθW (hθκ + c)"
"""What contact divides by, as messages write it."""


@dataclass(frozen=True, eq=False)
class SpringOperator:
    """What a batch shares: structure, step [s], θ, modes, contact stiffness [N/m] and damping [N s/m]."""

    structure: Structure
    h: float
    theta: float
    modal: Decoupled
    stiffness: float
    damping: float

    def without_heat(self) -> SpringOperator:
        """Return the same without thermal states, for cases where none can act."""
        return replace(self, modal=self.modal.without_heat())

    def yielding(self, h: float, alpha: Array, friction: Array | float = 0.0) -> Array:
        """Return 1 + hθW (hθκ + c), ``(case,)``: contact has one solution where it is positive."""
        w = delassus(self.modal, h, self.theta, alpha, friction)
        return yields(h, self.theta, self.stiffness, self.damping, w)

    def law(self, alpha: Array, friction: Array) -> Spring:
        """Return the contact law of cases, ``(case,)``."""
        w = delassus(self.modal, self.h, self.theta, alpha, friction)
        return law_of(self.h, self.theta, self.stiffness, self.damping, w)


def yields(h: float, theta: float, stiffness: float, damping: float, w: Array) -> Array:
    """Return 1 + hθW (hθκ + c), ``(case,)``: contact has one solution where it is positive."""
    return np.asarray(1 + h * theta * w * (h * theta * stiffness + damping))


def law_of(h: float, theta: float, stiffness: float, damping: float, w: Array) -> Spring:
    """Return the contact law of cases with the Delassus operator W, 1/kg, ``(case,)``."""
    yielding = yields(h, theta, stiffness, damping, w)
    share = np.where(yielding <= 0, np.nan, 1 / np.where(yielding <= 0, 1.0, yielding))
    reach = h * h * theta * theta * w
    reach = np.where(reach > 0, 1 / np.where(reach > 0, reach, 1.0), np.inf)
    return Spring(stiffness, damping, w, share, reach)


def in_matrices(structure: Structure, h: float, theta: float, stiffness: float, damping: float) -> DenseOperator:
    """Return the operator of a structure that modes do not separate."""
    contact = DenseContact(
        _march_dense,
        lambda cases, w: law_of(h, theta, stiffness, damping, w),
        lambda w: yields(h, theta, stiffness, damping, w),
        _YIELDS,
        rebounds=True,
    )
    return dense.init(structure, h, theta, contact)


def _run(operator: SpringOperator, cases: Cases, sampling: Sampling) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    modal, law = operator.modal, operator.law(cases.alpha, cases.friction)
    free = Operator(operator.structure, operator.h, operator.theta, modal)
    ended = step_modes(_march, free, modal, law, cases, sampling)
    contact = Contact(operator.yielding, _YIELDS)
    status, messages = judge(free, contact, cases, sampling.duration, ended.finite)
    balances = {**effective_restitution(ended.own), **ended.balances}
    return collect(ended.watched, ended.closing, status, messages, balances)


def compute(operator: SpringOperator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    return by_heat(cases, lambda some, hot: _run(operator if hot else operator.without_heat(), some, sampling))
