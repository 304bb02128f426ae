"""Free motion: coefficients of a step for kernels, and the initial states of a batch.

Load and contact of a step are added to u and η of a block when the next step begins: :func:`ended` returns both at the
step's end. Blocks that are modes are scaled by their component at the tip, whose velocity is then the sum of all u.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import inlined
from workflow.kernels.lanes import ROW
from workflow.kernels.packs import Lane, Pack, pack, shared
from workflow.models import Array, Cases, EndState, project
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.contact import Contact, TipStep
from workflow.schemes._fixed.rows import Own

SPEED, PLACE = range(2)
"""Rows of a block's motion, and of inputs to it: u and η."""

DECAY, SPRING, LOAD = range(3)
"""Coefficients of a block: u' per u and per η, u per unit impulse of the load."""

LOAD_PLACE, TIP_SPEED, TIP_PLACE = range(3)
"""Coefficients of a block that is no mode: η per unit impulse of the load, the tip's velocity per u and per η."""

HEAT_DECAY, HEAT_INPUT, HEAT_SPEED = range(3)
"""Coefficients of a thermal mode, scaled so that the tip's temperature is the sum of all τ: τ' per τ, τ per unit heat
at the tip, and the thermal velocity of the tip per τ."""


class FreeStep(NamedTuple):
    """Coefficients of a free step and of a unit impulse of the load, for kernels."""

    blocks: Array
    """``(block, coefficient)``."""
    coupled: Array | None
    """``(block, coefficient)``, where damping couples modes or the load acts elsewhere than on the tip."""
    heat_modes: Array
    """``(thermal mode, coefficient)``."""
    pair_block: NDArray[np.int64]
    pair_heat: NDArray[np.int64]
    pair_load: Array
    """u' and η' of a block, and the tip's velocity, per τ of a thermal mode near resonance with it, ``(pair, 3)``."""
    drifting: NDArray[np.int64]
    """Blocks of first order on which constant loads act."""
    tip: TipStep
    heat_counts: bool
    """Whether τ at a step's end includes the contact heat of that step; central differences add it in the next step."""
    observed: Array | None
    """Temperature that is recorded per τ, ``(thermal mode,)``; ``None`` for the tip's, the sum of all τ."""
    sensors: Array
    """Rows of sensors, see :func:`~workflow.schemes._fixed.sensing.sensing_of`."""


class State(NamedTuple):
    """States of a block of cases, and rows of its cases."""

    own: Own
    motion: Array
    """``(block, row, lane)``."""
    drives: Array
    """u and η per unit impulse of contact, with its friction and its heat, ``(block, row, lane)``."""
    steady: Array
    """Increment of u of drifting blocks in a step by constant loads, ``(drifting block, lane)``."""
    tau: Array
    """``(thermal mode, lane)``, without the contact heat of the last step, which the next step adds."""
    tau_before: Array
    """τ at the beginning of the last step."""
    tau_paired: Array
    """Either of the two: the τ that loads blocks near resonance."""
    sensing: Array
    """Of sensors by each case, ``(3, sensor, lane)``."""


@inlined
def lay_out(step: FreeStep, state: State) -> None:
    """Assert the strides of all rows once, before the first step, for the functions that are inlined after it.

    The compiler then takes them as constants, instead of reading them for each pack of lanes.
    """
    assert step.blocks.shape[1] == LOAD + 1
    assert step.heat_modes.shape[1] == HEAT_SPEED + 1
    assert state.motion.shape[1] == PLACE + 1
    assert state.motion.shape[2] == ROW
    assert state.drives.shape[1] == PLACE + 1
    assert state.drives.shape[2] == ROW
    assert state.tau.shape[1] == ROW


@inlined
def plus(numbers: Pack, weight: Pack, others: Pack | None) -> Pack:
    """Return ``numbers + weight * others``, or ``numbers`` where ``others`` is ``None``, decided at compile time."""
    return numbers if others is None else numbers + weight * others


@inlined
def ended(
    coupled: Array | None, step: FreeStep, state: State, j: int, load: Pack, contact: Pack | None, lane: Lane
) -> tuple[Pack, Pack]:
    """Return u and η of block j at the end of the last step; ``contact`` is the impulse in it, if any."""
    u = plus(pack(state.motion, (j, SPEED, lane)), pack(state.drives, (j, SPEED, lane)), contact)
    eta = plus(pack(state.motion, (j, PLACE, lane)), pack(state.drives, (j, PLACE, lane)), contact)
    u += shared(step.blocks, (j, LOAD), lane) * load
    return u, eta if coupled is None else eta + shared(coupled, (j, LOAD_PLACE), lane) * load


NO_DECAY = 1e-30
"""Replaces a thermal factor D of exactly 0, by which the contact heat is divided: negligible beside 1."""


@dataclass(frozen=True, eq=False)
class InitialState:
    """Initial states of a batch, split into the known response to constant loads and the rest.

    Blocks of second order and conducting modes have a static response; an adiabatic mode warms at a constant rate, with
    a mechanical response to that. So the known part of the tip has the velocity drift, to which blocks of second order
    contribute, and the temperature warmth + warming · t. Constant loads on blocks of first order, rigid modes among
    them, act in every step.
    """

    states: Array
    """Remaining u and η, ``(2, block, case)``."""
    heat: Array
    """Remaining τ, ``(thermal mode, case)``."""
    known: Array
    """The static response in the blocks, ``(2, block, case)``."""
    settled: Array
    warming_modes: Array
    """``settled``, ``warming_modes``: modal temperatures of the known part, and their rate [1/s], ``(thermal mode,
    case)``."""
    drift: Array
    warmth: Array
    warming: Array
    """``drift``, ``warmth``, ``warming``: m/s, K and K/s, ``(case,)``."""
    closing: Array
    closing_rate: Array
    """``closing``, ``closing_rate``: quasi-static tip growth of the known temperatures, m and m/s, ``(case,)``."""
    drifting: NDArray[np.int64]
    steady: Array
    """``drifting``, ``steady``: blocks of first order under constant loads, and the increment of u by these in a step,
    ``(block, case)``."""


def start(blocks: Blocks, cases: Cases, velocity: Array) -> InitialState:
    """Return the initial states of cases with a modal ``velocity`` ``(case, mode)``, at -h/2 in central differences."""
    modal, h, c, k = blocks.modal, blocks.step.tip.h, blocks.damping[:, None], blocks.stiffness[:, None]
    conducting, elastic = modal.rate > 0, modal.frequency > 0
    heating = project(modal.heat_shapes.T, cases.heating)
    settled = np.where(conducting, heating / np.where(conducting, modal.rate, 1.0), 0.0)
    warming = np.where(conducting, 0.0, heating)
    heat = project(modal.to_thermal, cases.temperature) - settled

    load = project(modal.shapes.T, cases.steady) - np.where(elastic, project(modal.coupling, settled), 0.0)
    constant = blocks.of_impulses(h * load.T) + blocks.of_heat(h * warming.T)
    u = -constant[1] / h
    known = np.where(k != 0, np.stack([u, (constant[0] / h - c * u) / np.where(k != 0, k, 1.0)]), 0.0)
    speed, place = blocks.tip
    drifting = np.flatnonzero((blocks.stiffness == 0) & (blocks.scale != 0) & constant[0].any(axis=1))

    places = project(modal.to_modes, cases.displacement) - blocks.step.lever * velocity
    states = blocks.of_modes(np.stack([velocity.T, places.T])) - blocks.thermal_response(heat.T) - known
    return InitialState(
        states=states,
        heat=heat.T,
        known=known,
        settled=settled.T,
        warming_modes=warming.T,
        drift=project(speed, known[0].T) + project(place, known[1].T),
        warmth=project(modal.recorded, settled),
        warming=project(modal.recorded, warming),
        closing=project(modal.static_growth, settled),
        closing_rate=project(modal.static_growth, warming),
        drifting=drifting,
        steady=constant[0, drifting],
    )


class LastStep(NamedTuple):
    """What kernels leave of the last step, which ends after t seconds, before its load and contact move the blocks."""

    t: float
    motion: Array
    drives: Array
    """u and η, and their changes by a unit impulse of contact, ``(2, block, case)``."""
    heat: Array
    """τ, ``(thermal mode, case)``."""
    load: Array
    contact: Array
    """Impulses, ``(case,)``."""
    place: Array
    """x_n, ``(case,)``."""


def end_state(blocks: Blocks, cases: Cases, begun: InitialState, last: LastStep) -> EndState:
    """Return the state after the last step; of central differences at t_k, with the velocity (w_k-½ + w_k+½)/2.

    Modes that do not move the tip are not stepped: they end at rest.
    """
    modal, step, h = blocks.modal, blocks.step, blocks.step.tip.h

    def in_modes(states: Array, heat: Array, t: float) -> Array:
        return blocks.in_modes(states + begun.known + blocks.thermal_response(heat + begun.warming_modes * t))

    heat, entered = last.heat, step.heat_gain[:, None] * (cases.alpha * last.contact)
    loaded = blocks.of_impulses((modal.tip if modal.load is None else modal.load)[:, None])
    ended = last.motion + last.drives * last.contact + loaded * last.load
    if step.heat_counts:
        velocity, places = in_modes(ended, heat, last.t)
        z = places + step.lever * velocity
    else:
        before, places = in_modes(_behind(blocks, begun, last), heat, last.t)
        after, _ = in_modes(ended, step.decay[:, None] * heat + entered, last.t + h)
        velocity, z, heat = (before + after) / 2, places + h * before, heat + entered / 2
    rigid = modal.frequency == 0
    if blocks.outward is not None and (at_tip := np.sum(modal.tip[rigid] ** 2)) > 0:  # blocks have no ξ of them
        z[rigid] += modal.tip[rigid, None] * ((last.place - project(modal.tip, z.T)) / at_tip)
    tau = heat + begun.settled + begun.warming_modes * last.t
    return EndState(project(modal.shapes, z.T), project(modal.shapes, velocity.T), project(modal.heat_shapes, tau.T))


def _behind(blocks: Blocks, begun: InitialState, last: LastStep) -> Array:
    """Return u and η at the beginning of the last step, with load and contact there: :meth:`Blocks.ahead` reversed."""
    h, c, k = blocks.step.tip.h, blocks.damping[:, None], blocks.stiffness[:, None]
    motion = last.motion.copy()
    motion[0, begun.drifting] -= begun.steady
    for block, mode in blocks.pairs:
        motion[:, block] -= blocks.thermal_load[:, block, mode, None] * last.heat[mode]
    u = (motion[0] + h * k * motion[1]) / (1 - h * c + h * h * k)
    return np.stack([u, motion[1] - h * u])


def first_free(blocks: Blocks, begun: InitialState) -> tuple[Array, Array, Array]:
    """Return u and η after the first step of central differences without load and contact, and the tip's velocity.

    The third value is the thermal part of that velocity, ``(case,)``.
    """
    states = blocks.ahead(begun.states)
    states[0, begun.drifting] += begun.steady
    for block, mode in blocks.pairs:
        states[:, block] += blocks.thermal_load[:, block, mode, None] * begun.heat[mode]
    thermal_velocity = project(blocks.heat_velocity, begun.heat.T) + begun.drift
    velocity = sum(project(row, values.T) for row, values in zip(blocks.tip, states, strict=True))
    return states, velocity + thermal_velocity, thermal_velocity


def contact_heat(blocks: Blocks, cases: Cases) -> Array:
    """Return the changes of u and η by heat and friction of a unit impulse of contact, ``(2, block, case)``."""
    along, warm = blocks.modal.tangent, blocks.of_heat(blocks.step.heat_gain[:, None]) * cases.alpha
    return warm if along is None else warm + blocks.of_impulses(along[:, None]) * cases.friction


def drives(blocks: Blocks, cases: Cases) -> Array:
    """Return the changes of u and η by a unit impulse of contact, ``(2, block, case)``."""
    return contact_heat(blocks, cases) - blocks.of_impulses(blocks.modal.tip[:, None])


def free_step(blocks: Blocks, contact: Contact, drifting: NDArray[np.int64], sensors: Array) -> FreeStep:
    """Return the coefficients of a step for kernels, with the rows of sensors for them."""
    modal, step, scale = blocks.modal, blocks.step, blocks.modal.heat_scale
    h, (speed, place), (j, k) = step.tip.h, blocks.tip, blocks.pairs.T
    load, load_place = blocks.of_impulses((modal.tip if modal.load is None else modal.load)[:, None])[..., 0]
    pull, decay = blocks.thermal_load[:, j, k] / scale[k], np.where(step.decay == 0, NO_DECAY, step.decay)
    mobility = np.sum(speed * load + place * load_place)
    tip = step.tip._replace(load_mobility=mobility, stiffness=contact.stiffness, holds=contact.holds)
    return FreeStep(
        blocks=np.stack([1 - h * blocks.damping, -h * blocks.stiffness, load * blocks.scale], axis=1),
        coupled=np.stack([load_place, speed, place], axis=1) if modal.is_coupled else None,
        heat_modes=np.stack(
            [decay, scale * step.heat_gain / (1.0 if step.heat_counts else decay), blocks.heat_velocity / scale], axis=1
        ),
        pair_block=j,
        pair_heat=k,
        pair_load=np.stack([*(pull * blocks.scale[j]), speed[j] * pull[0] + place[j] * pull[1]], axis=1),
        drifting=drifting,
        tip=tip,
        heat_counts=step.heat_counts,
        observed=None if modal.observed is None else modal.observed / scale,
        sensors=sensors,
    )
