"""Free motion: coefficients of a step for kernels, and the initial states of a batch.

Load and contact of a step are added to u and η of a block when the next step begins: :func:`ended` returns both at the
step's end. Where one contact acts on modes these are scaled by their component there, so that the velocity of the
contact is the sum of all u; else :class:`ContactRows` give the velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import inlined
from workflow.kernels.lanes import ROW
from workflow.kernels.packs import Lane, Pack, pack, shared
from workflow.models import Array, Cases, EndState, project
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.law import Coupling, TipStep, YieldingStep
from workflow.schemes._fixed.rows import Acting, Own

SPEED, PLACE = range(2)
"""Rows of a block's motion, and of inputs to it: u and η."""

DECAY, SPRING, LOAD = range(3)
"""Coefficients of a block: u' per u and per η, u per unit impulse of the load."""

ABREAST = 4
"""Contacts whose velocities are summed at a time: rows of coefficients are padded to a multiple."""

HEAT_DECAY, HEAT_INPUT, HEAT_SPEED = range(3)
"""Coefficients of a thermal mode, scaled so that the temperature of one contact is the sum of all τ: τ' per τ, and of
one contact τ per unit heat there, and the thermal velocity of the contact per τ."""


class ContactRows(NamedTuple):
    """Velocities and temperatures of contacts that are no plain sums, columns padded to whole :data:`ABREAST`."""

    speed: Array
    place: Array
    """Velocity per u and per η, ``(block, contact)``; the second without rows where blocks are modes."""
    heat_speed: Array
    temperature: Array
    """Thermal velocity and temperature per τ, ``(thermal mode, contact)``."""
    expansion: Array
    """Way by the residual coupling per τ, m, likewise; without rows of contacts with mass."""
    load_place: Array
    """η per unit impulse of the load, ``(block,)``."""
    heat: Array
    """τ per unit heat at a contact, ``(contact, thermal mode)``."""


class FreeStep(NamedTuple):
    """Coefficients of a free step and of a unit impulse of the load, for kernels."""

    blocks: Array
    """``(block, coefficient)``."""
    rows: ContactRows | None
    """``None`` for one contact that acts on modes."""
    heat_modes: Array
    """``(thermal mode, coefficient)``."""
    pair_block: NDArray[np.int64]
    pair_heat: NDArray[np.int64]
    pair_load: Array
    """u' and η' of a block, and the velocity of one contact, per τ of a thermal mode near resonance, ``(pair, 3)``."""
    drifting: NDArray[np.int64]
    """Blocks of first order on which constant loads act."""
    contact: TipStep
    heat_counts: bool
    """Whether τ at a step's end includes the contact heat of that step; central differences add it in the next step."""
    observed: Array | None
    """Temperature that one contact records per τ, ``(thermal mode,)``; ``None`` for the sum of all τ."""
    sensors: Array
    """Rows of sensors, see :func:`~workflow.schemes._fixed.sensing.sensing_of`."""


class State(NamedTuple):
    """States of a block of cases, and rows of its cases."""

    own: Own
    acts: Sequence[Acting]
    coupling: Coupling | None
    motion: Array
    """``(block, row, lane)``."""
    drives: Array
    """u and η per unit impulse of a contact, with its friction and its heat, ``(contact, block, row, lane)``."""
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
    assert state.drives.shape[2] == PLACE + 1
    assert state.drives.shape[3] == ROW
    assert state.tau.shape[1] == ROW


@inlined
def plus(numbers: Pack, weight: Pack, others: Pack | None) -> Pack:
    """Return ``numbers + weight * others``, or ``numbers`` where ``others`` is ``None``, decided at compile time."""
    return numbers if others is None else numbers + weight * others


@inlined
def loaded(
    rows: ContactRows | None, step: FreeStep, j: int, u: Pack, eta: Pack, load: Pack, lane: Lane
) -> tuple[Pack, Pack]:
    """Return u and η of block j with an impulse of the load."""
    u += shared(step.blocks, (j, LOAD), lane) * load
    return u, eta if rows is None else eta + shared(rows.load_place, (j,), lane) * load


@inlined
def ended(step: FreeStep, state: State, j: int, load: Pack, contact: Pack | None, lane: Lane) -> tuple[Pack, Pack]:
    """Return u and η of block j at the end of the last step; ``contact`` is the impulse in it, if any, of one contact.

    Of several contacts all impulses count.
    """
    u, eta = pack(state.motion, (j, SPEED, lane)), pack(state.motion, (j, PLACE, lane))
    if state.coupling is None:
        u = plus(u, pack(state.drives, (0, j, SPEED, lane)), contact)
        eta = plus(eta, pack(state.drives, (0, j, PLACE, lane)), contact)
    else:
        for c in range(len(state.acts)):
            p = pack(state.acts[c].impulse, lane)
            u += pack(state.drives, (c, j, SPEED, lane)) * p
            eta += pack(state.drives, (c, j, PLACE, lane)) * p
    return loaded(step.rows, step, j, u, eta, load, lane)


@inlined
def with_heat(rows: ContactRows | None, state: State, k: int, tau: Pack, struck: bool, lane: Lane) -> Pack:
    """Return thermal mode k with the heat of contacts that have rows in the last step, if any was struck."""
    if rows is None:
        return tau
    if struck:
        for c in range(rows.heat.shape[0]):
            tau += shared(rows.heat, (c, k), lane) * (pack(state.own.alpha, lane) * pack(state.acts[c].impulse, lane))
    return tau


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
    """``drift``, ``warmth``, ``warming`` of each contact: m/s, K and K/s, ``(case, contact)``."""
    closing: Array
    closing_rate: Array
    """``closing``, ``closing_rate``: quasi-static growth of the known temperatures, m and m/s, ``(case, contact)``."""
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
    speed, place = blocks.contacts.swapaxes(0, 1)
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
    """u and η, ``(2, block, case)``."""
    drives: Array
    """Their changes by a unit impulse of a contact, ``(contact, 2, block, case)``."""
    heat: Array
    """τ, ``(thermal mode, case)``."""
    load: Array
    """Impulse, ``(case,)``."""
    contact: Array
    place: Array
    """Impulse and x of each contact, ``(contact, case)``."""


def end_state(blocks: Blocks, cases: Cases, begun: InitialState, last: LastStep) -> EndState:
    """Return the state after the last step; of central differences at t_k, with the velocity (w_k-½ + w_k+½)/2.

    Modes that do not move the tip are not stepped: they end at rest.
    """
    modal, step, h = blocks.modal, blocks.step, blocks.step.tip.h

    def in_modes(states: Array, heat: Array, t: float) -> Array:
        return blocks.in_modes(states + begun.known + blocks.thermal_response(heat + begun.warming_modes * t))

    heat = last.heat
    ended = last.motion + blocks.of_impulses(modal.load[:, None]) * last.load
    entered = np.zeros_like(heat)
    for drive, gain, impulse in zip(last.drives, step.heat_gain, last.contact, strict=True):
        ended, entered = ended + drive * impulse, entered + gain[:, None] * (cases.alpha * impulse)
    if step.heat_counts:
        velocity, places = in_modes(ended, heat, last.t)
        z = places + step.lever * velocity
    else:
        before, places = in_modes(_behind(blocks, begun, last), heat, last.t)
        after, _ = in_modes(ended, step.decay[:, None] * heat + entered, last.t + h)
        velocity, z, heat = (before + after) / 2, places + h * before, heat + entered / 2
    rigid = modal.frequency == 0
    if blocks.outward is not None and rigid.any():  # blocks have no ξ of them
        inverse = np.asarray(np.linalg.pinv(modal.normal[:, rigid]), dtype=np.float64)
        z[rigid] += project(inverse, last.place.T - project(modal.normal, z.T)).T
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
    """Return u and η after the first step of central differences without load and contact, and the contacts' velocity.

    The third value is the thermal part of that velocity, ``(case, contact)``.
    """
    states = blocks.ahead(begun.states)
    states[0, begun.drifting] += begun.steady
    for block, mode in blocks.pairs:
        states[:, block] += blocks.thermal_load[:, block, mode, None] * begun.heat[mode]
    thermal_velocity = project(blocks.heat_velocity, begun.heat.T) + begun.drift
    velocity = sum(project(row, values.T) for row, values in zip(blocks.contacts.swapaxes(0, 1), states, strict=True))
    return states, velocity + thermal_velocity, thermal_velocity


def contact_heat(blocks: Blocks, cases: Cases) -> Array:
    """Return the changes of u and η by heat and friction of a unit impulse, ``(contact, 2, block, case)``."""
    warm = blocks.of_heat(blocks.step.heat_gain.T).transpose(2, 0, 1)[..., None] * cases.alpha
    along = blocks.of_impulses(blocks.modal.tangent.T).transpose(2, 0, 1)[..., None]
    return np.asarray(warm + along * cases.friction)


def drives(blocks: Blocks, cases: Cases) -> Array:
    """Return the changes of u and η by a unit impulse of each contact, ``(contact, 2, block, case)``."""
    normal = blocks.of_impulses(blocks.modal.normal.T).transpose(2, 0, 1)[..., None]
    return np.asarray(contact_heat(blocks, cases) - normal)


def free_step(blocks: Blocks, contact: Contact, drifting: NDArray[np.int64], sensors: Array) -> FreeStep:
    """Return the coefficients of a step for kernels, with the rows of sensors for them."""
    modal, step, scale = blocks.modal, blocks.step, blocks.modal.heat_scale
    h, (speed, place), (j, k) = step.tip.h, blocks.contacts.swapaxes(0, 1), blocks.pairs.T
    load, load_place = blocks.of_impulses(modal.load[:, None])[..., 0]
    pull, decay = blocks.thermal_load[:, j, k] / scale[k], np.where(step.decay == 0, NO_DECAY, step.decay)
    mobility = np.sum(speed * load + place * load_place, axis=1)
    heat = scale * step.heat_gain / (1.0 if step.heat_counts else decay)
    rows = None
    if not modal.is_single:
        columns = speed, place, blocks.heat_velocity / scale, modal.recorded / scale, modal.residual_coupling
        padded = [np.pad(each.T, ((0, 0), (0, -len(each) % ABREAST))) for each in columns]
        if blocks.outward is None:
            padded[1] = padded[1][:0]
        if not modal.contacts.is_compliant:
            padded[4] = padded[4][:0]
        rows = ContactRows._make([*map(np.ascontiguousarray, padded), load_place, heat])
    is_observed = modal.is_single and not np.array_equal(modal.recorded, modal.heat)
    return FreeStep(
        blocks=np.stack([1 - h * blocks.damping, -h * blocks.stiffness, load * blocks.scale], axis=1),
        rows=rows,
        heat_modes=np.stack([decay, heat[0], blocks.heat_velocity[0] / scale], axis=1),
        pair_block=j,
        pair_heat=k,
        pair_load=np.stack([*(pull * blocks.scale[j]), speed[0, j] * pull[0] + place[0, j] * pull[1]], axis=1),
        drifting=drifting,
        contact=_contact_step(blocks, contact)._replace(load_mobility=mobility),
        heat_counts=step.heat_counts,
        observed=modal.recorded[0] / scale if is_observed else None,
        sensors=sensors,
    )


def _contact_step(blocks: Blocks, contact: Contact) -> TipStep:
    """Return the coefficients of the contacts in a step, but for their mobility by the load."""
    modal, step, contacts = blocks.modal, blocks.step, blocks.modal.contacts
    own = step.tip._replace(delassus=step.delassus(modal), stiffness=contact.stiffness, holds=contact.holds)
    if not contacts.is_compliant:
        return own
    weight, cold = contact.force_weight(own.theta), contacts.flexibility(0.0)
    return YieldingStep(*own)._replace(
        sinking=step.sinking(modal, weight),
        residual=np.stack([cold, cold - contacts.flexibility(1.0)]),
        residual_load=contacts.residual_load_or_zero,
        growth=modal.residual_coupling @ step.heat_gain.T,
        casing_flexibility=contacts.casing_flexibility,
        carried=1 / weight - 1,
        stiffness=0.0,
    )
