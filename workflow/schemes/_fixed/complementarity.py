"""Contact of a tip without mass in a step of the θ-method: complementarity of place and impulse at the step's end.

Nothing is thrown back that has no mass: there is no impact, and the restitution coefficient is not read. The impulse is
the least that keeps the tip from passing the casing,

    0 <= d - x_n,k+1  ⊥  p >= 0:   p = max(0, (x_free - d)/(hθW)),   x_free = x_n,k + h (θ v_free + (1-θ) v_n,k),

and a tip in contact is on the casing to the bit. Its contact takes energy, never gives any: the work -(p/h) (x_n,k+1 -
x_n,k) is not positive from a start outside the casing, so that the energy of unloaded cold motion does not grow for
θ >= 1/2. Newton's law at velocity level does not have this property without a mass at the tip.

Source: Monjaraz Tec, Gross, Krack, Computers & Structures 2022 (arXiv 2111.07693), whose step is explicit.
"""

from __future__ import annotations

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
from workflow.models import Array
from workflow.schemes._fixed.balance import Audit
from workflow.schemes._fixed.contact import (
    CASE_ALPHA,
    CASE_HEAT,
    CASE_IMPULSE,
    CASE_PRESSED,
    End,
    Free,
    TipStep,
    contact_gain,
    meet,
)
from workflow.schemes._fixed.dense_balance import Account
from workflow.schemes._fixed.dense_march import DenseState, FreeStep, march_dense
from workflow.schemes._fixed.march import march
from workflow.schemes._fixed.marks import TIP_DISPLACEMENT, TIP_VELOCITY, Block
from workflow.schemes._fixed.modal_lanes import Coefficients, State


class Complementarity(NamedTuple):
    """What a tip is answered by that would end a step beyond the casing, per depth."""

    impulse: Array | float
    """1/(hθW), N s/m, ``(case,)`` or one for all; NaN where W <= 0, so that contact ends the case."""
    velocity: float
    """1/(hθ), 1/s."""


def complementarity(h: float, theta: float, delassus: Array) -> Complementarity:
    """Return the law of cases with the Delassus operator W, 1/kg, ``(case,)``; θ > 0."""
    reach = h * theta * delassus
    return Complementarity(np.where(reach <= 0, np.nan, 1 / np.where(reach <= 0, 1.0, reach)), 1 / (h * theta))


@defines(meet, Complementarity)
def meet_by_place(law: Complementarity, step: TipStep, free: Free, own: Array, tip: Array, lane: Lane) -> End:
    """Return the tip at the step's end."""
    x, v, p = pack(tip, (TIP_DISPLACEMENT, lane)), pack(tip, (TIP_VELOCITY, lane)), spread(0.0, lane)
    after, temperature = free.velocity + step.inverse_mass * free.impulse, free.temperature
    moved = step.h * weighed(step.theta, after, step.rest, v)
    place, depth = x + moved, x - free.gap + moved
    place = where(place > free.gap, free.gap, place)
    engaged = some(depth > 0.0) or raised(own, (CASE_PRESSED, lane))
    if engaged:
        meets = depth > 0.0
        p = where(meets, depth * of_lane(law.impulse, lane), 0.0)
        after = where(meets, after - law.velocity * depth, after)
        heat = pack(own, (CASE_ALPHA, lane)) * p
        store(own, (CASE_HEAT, lane), heat)
        flag(own, (CASE_PRESSED, lane), some_nonzero(p))
        temperature += step.warming * heat
    store(own, (CASE_IMPULSE, lane), free.impulse - p)
    return End(engaged, place, after, temperature, p)


@defines(contact_gain, Complementarity)
def _static_gain(
    law: Complementarity, step: TipStep, end: End, change: Pack, free: Free, own: Array, tip: Array, lane: Lane
) -> Pack:
    """Return -(θ - 1/2) S Δv: without mass no impact changes the velocity, impulses work at v_θ as they act."""
    return (0.5 - step.theta) * (pack(own, (CASE_IMPULSE, lane)) * change)


@uncounted
def march_without_mass(
    operator: Coefficients, law: Complementarity, state: State, block: Block, audit: Audit | None
) -> None:
    """Step a block of cases."""
    align_stack()
    march(operator, law, state, block, audit)


@uncounted
def march_dense_without_mass(
    free: FreeStep, law: Complementarity, state: DenseState, block: Block, account: Account, loads: Array, first: int
) -> None:
    """Step a block of cases by a dense matrix."""
    align_stack()
    march_dense(free, law, state, block, account, loads, first)
