"""Free motion of the modes in packs, what an impulse changes in them, and the initial states of a batch.

Where one contact acts on modes these are scaled by their component there, so that the velocity of the contact is the
sum of all u; else :class:`ContactRows` give the velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import by_type, defines, inlined, part
from workflow.kernels.lanes import ROW
from workflow.kernels.packs import Lane, Pack, fused, pack, raised, shared, some, spread, store
from workflow.models import Array, Cases, EndState, project
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.contact import Contact, count_of
from workflow.schemes._fixed.law import CentralStep, Coupling, TipStep
from workflow.schemes._fixed.loads import Drive
from workflow.schemes._fixed.rows import Acting, Own

SPEED, PLACE = range(2)
"""Rows of a block's motion, and of inputs to it: u and η."""

DECAY, SPRING, LOAD = range(3)
"""Coefficients of a block: u' per u and per η, u per unit impulse of the load."""

HEAT_DECAY, HEAT_SPEED = range(2)
"""Coefficients of a thermal mode: τ' per τ, and of one contact its thermal velocity per τ'."""


class ContactRows(NamedTuple):
    """Velocities and temperatures of contacts that are no plain sums."""

    speed: Array
    place: Array
    """Velocity per u and per η, ``(block, contact)``; the second without rows where blocks are modes."""
    heat_speed: Array
    temperature: Array
    """Thermal velocity and temperature per τ', ``(thermal mode, contact)``."""
    expansion: Array
    """Way by the residual coupling per τ', m, likewise; without rows of contacts with mass."""
    load_place: Array
    """η per unit impulse of the load, ``(block,)``."""


class FreeStep(NamedTuple):
    """Coefficients of a step for kernels."""

    blocks: Array
    """``(block, coefficient)``."""
    rows: ContactRows | None
    """``None`` for one contact that acts on modes."""
    heat_modes: Array
    """``(thermal mode, coefficient)``."""
    heat_gain: Array
    """τ per unit heat at a contact, ``(contact, thermal mode)``."""
    pair_block: NDArray[np.int64]
    pair_heat: NDArray[np.int64]
    pair_load: Array
    """u' and η' of a block, and the velocity of one contact, per τ of a thermal mode near resonance, ``(pair, 3)``."""
    drifting: NDArray[np.int64]
    """Blocks of first order on which constant loads act."""
    contact: TipStep
    observed: Array | None
    """Temperature that one contact records per τ', ``(thermal mode,)``; ``None`` for the sum of all τ'."""
    sensors: Array
    """Rows of sensors, see :func:`~workflow.schemes._fixed.sensing.sensing_of`."""


class ModeWork(NamedTuple):
    """Coefficients by which a free step counts the work of the modes of one contact (:mod:`.balance`)."""

    damping: Array
    """hc/4, of the square of 2 v_m, ``(mode,)``."""
    impulse: Array
    """Work of a unit impulse of contact in damping and inputs, per 2 v_m, ``(mode, lane)``."""
    heat: Array
    """Input of a unit heat at the contact, per 2 η_m, ``(mode,)``."""
    loss: Array
    """Heat loss per τ, W, ``(thermal mode,)``."""


class State(NamedTuple):
    """States of a block of cases, and rows of its cases."""

    own: Own
    acts: Sequence[Acting]
    coupling: Coupling | None
    drive: Drive | None
    account: Any
    """:class:`~workflow.schemes._fixed.balance.Account`, ``None`` where no balances are asked for."""
    work: ModeWork | None
    """``None`` where free steps count no work."""
    motion: Array
    """``(block, row, lane)``."""
    drives: Array
    """u and η per unit impulse of a contact, with its friction and its heat, ``(contact, block, row, lane)``."""
    steady: Array
    """Increment of u of drifting blocks in a step by constant loads, ``(drifting block, lane)``."""
    tau: Array
    """``(thermal mode, 1, lane)``; a step ahead in central differences, as u is half a step ahead."""
    motion_before: Array
    tau_before: Array
    """Both at the beginning of the step, where that is asked for; in central differences τ a step before too, and the
    motion, which is not asked for else."""
    sensing: Array
    """Of sensors by each case, ``(2, sensor, lane)``."""


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
    assert state.tau.shape[1] == 1
    assert state.tau.shape[2] == ROW


@part
def is_warmed(acts: Sequence[Acting], lanes: int) -> bool:
    """Tell whether heating or the temperature of the surroundings moves a contact of some lane."""
    warmed = False
    for c in range(len(acts)):
        for lane in range(lanes):
            warmed |= acts[c].drift[lane] != 0.0 or acts[c].warmth[lane] != 0.0 or acts[c].warming[lane] != 0.0
    return warmed


@part
def keep_before(state: State, lanes: int) -> None:
    """Keep the states at the beginning of a step, and in central differences τ at the beginning of the one before."""
    motion, tau = state.motion_before, state.tau_before
    for lane in range(lanes):
        for j in range(motion.shape[0]):
            motion[j, SPEED, lane], motion[j, PLACE, lane] = state.motion[j, SPEED, lane], state.motion[j, PLACE, lane]
        for k in range(tau.shape[0]):
            if tau.shape[1] > 1:
                tau[k, 1, lane] = tau[k, 0, lane]
            tau[k, 0, lane] = state.tau[k, 0, lane]


@inlined
def _plus(numbers: Pack, weight: Pack, others: Pack | None) -> Pack:
    """Return ``numbers + weight * others``, or ``numbers`` where ``others`` is ``None``, decided at compile time."""
    return numbers if others is None else fused(weight, others, numbers)


class Spent(NamedTuple):
    """What the modes lose in a step, without impulses of contact (:mod:`.balance`)."""

    damped: Pack
    """By damping, J."""
    by_impulse: Pack
    by_heat: Pack
    """Work in damping and inputs of a unit impulse of contact, m/s, and of the heat of one, 1."""
    heat: Pack
    """Heat, W."""


@inlined
def _spend(work: ModeWork | None, j: int, twice_v: Pack, twice_eta: Pack, spent: Spent, lane: Lane) -> Spent:
    """Add mode j with 2 v_m and 2 η_m."""
    if work is None:
        return spent
    damped = fused(shared(work.damping, (j,), lane) * twice_v, twice_v, spent.damped)
    by_impulse = fused(pack(work.impulse, (j, lane)), twice_v, spent.by_impulse)
    by_heat = fused(shared(work.heat, (j,), lane), twice_eta, spent.by_heat)
    return Spent(damped, by_impulse, by_heat, spent.heat)


@inlined
def _lose(work: ModeWork | None, k: int, tau: Pack, spent: Spent, lane: Lane) -> Spent:
    """Add thermal mode k."""
    if work is None:
        return spent
    return Spent(spent.damped, spent.by_impulse, spent.by_heat, fused(shared(work.loss, (k,), lane), tau, spent.heat))


@inlined
def step_freely(
    step: FreeStep, rows: ContactRows | None, waited: bool, warmed: bool, t: float, state: State, load: Pack, lane: Lane
) -> tuple[Spent, Moved]:
    """Step all modes to t without impulses of contact, but for one that has ``waited`` since the last (:func:`strike`).

    ``rows`` are those of the step, so that the compiler sees whether they are ``None``.
    """
    if rows is None and waited and raised(state.own.pressed, lane):
        p = pack(state.acts[0].impulse, lane)
        heat = pack(state.own.alpha, lane) * p
        return _step_freely(step, rows, step.observed, state.work, p, heat, warmed, t, state, load, lane)
    return _step_freely(step, rows, step.observed, state.work, None, None, warmed, t, state, load, lane)


@inlined
def _step_freely(
    step: FreeStep,
    rows: ContactRows | None,
    observed: Array | None,
    work: ModeWork | None,
    impulse: Pack | None,
    heat: Pack | None,
    warmed: bool,
    t: float,
    state: State,
    load: Pack,
    lane: Lane,
) -> tuple[Spent, Moved]:
    """Step all modes to t without impulses of contact; return how they move a contact without rows there, store others.

    ``warmed`` is the result of :func:`is_warmed`.
    """
    motion, tau = state.motion, state.tau
    velocity = temperature = zero = spread(0.0, lane)
    spent = Spent(zero, zero, zero, zero)
    for k in range(tau.shape[0]):
        before = _plus(pack(tau, (k, 0, lane)), shared(step.heat_gain, (0, k), lane), heat)
        after = shared(step.heat_modes, (k, HEAT_DECAY), lane) * before
        store(tau, (k, 0, lane), after)
        spent = _lose(work, k, after, spent, lane)
        if rows is None:
            velocity += shared(step.heat_modes, (k, HEAT_SPEED), lane) * after
            shown = _recorded(step.contact, before, after)
            temperature += shown if observed is None else shared(observed, (k,), lane) * shown
    thermal_velocity = velocity
    for j in range(motion.shape[0]):
        u = _plus(pack(motion, (j, SPEED, lane)), pack(state.drives, (0, j, SPEED, lane)), impulse)
        eta = _plus(pack(motion, (j, PLACE, lane)), pack(state.drives, (0, j, PLACE, lane)), impulse)
        after = shared(step.blocks, (j, DECAY), lane) * u + shared(step.blocks, (j, SPRING), lane) * eta
        after += shared(step.blocks, (j, LOAD), lane) * load
        reached = eta + step.contact.h * u
        spent = _spend(work, j, u + after, eta + reached, spent, lane)
        eta = reached
        if rows is not None:
            eta += shared(rows.load_place, (j,), lane) * load
        store(motion, (j, SPEED, lane), after)
        store(motion, (j, PLACE, lane), eta)
        if rows is None:
            velocity += after
    if step.pair_block.size + step.drifting.size != 0:
        velocity += _add_slow(step, state, lane)
    moved = Moved(velocity, thermal_velocity, temperature)
    if rows is None:
        return spent, _of_contact(state.drive, state.acts[0], warmed, t, moved, lane)
    _move_contacts(rows, warmed, t, state, lane)
    return spent, moved


@by_type
def _recorded(contact: TipStep, before: Pack, after: Pack) -> Pack:
    """Return τ of the temperature at the end of a step, from that before and after the step."""
    return after


@defines(_recorded, CentralStep)
def _recorded_centrally(contact: TipStep, before: Pack, after: Pack) -> Pack:
    return before


@inlined
def _add_slow(step: FreeStep, state: State, lane: Lane) -> Pack:
    """Add loads of thermal modes on blocks near resonance with them, and constant loads on drifting blocks.

    Return their part in the velocity of one contact.
    """
    motion, velocity = state.motion, spread(0.0, lane)
    for pair in range(step.pair_block.size):
        j, tau = step.pair_block[pair], pack(state.tau_before, (step.pair_heat[pair], 0, lane))
        for row in range(2):
            pulled = shared(step.pair_load, (pair, row), lane) * tau
            store(motion, (j, row, lane), pack(motion, (j, row, lane)) + pulled)
        velocity += shared(step.pair_load, (pair, 2), lane) * tau
    for k in range(step.drifting.size):
        j, gained = step.drifting[k], pack(state.steady, (k, lane))
        store(motion, (j, SPEED, lane), pack(motion, (j, SPEED, lane)) + gained)
        velocity += gained
    return velocity


class Moved(NamedTuple):
    """How a contact moves without impulses: its velocity, the thermal part of that, its temperature."""

    velocity: Pack
    thermal_velocity: Pack
    temperature: Pack


@inlined
def _of_contact(drive: Drive | None, act: Acting, warmed: bool, t: float, by: Moved, lane: Lane) -> Moved:
    """Return how a contact moves relative to its origin, with its known part by constant loads."""
    velocity, thermal_velocity, temperature = by
    if warmed:
        drift = pack(act.drift, lane)
        velocity, thermal_velocity = velocity + drift, thermal_velocity + drift
        temperature += pack(act.warmth, lane) + pack(act.warming, lane) * t
    velocity = velocity if drive is None else velocity - pack(act.origin_speed, lane)
    return Moved(velocity, thermal_velocity, temperature)


@inlined
def keep_moved(account: Any, act: Acting, moved: Moved, lane: Lane) -> None:
    """Store how a contact moves."""
    store(act.speed_free, lane, moved.velocity)
    if account is not None:
        store(act.thermal_velocity, lane, moved.thermal_velocity)
    store(act.temperature, lane, moved.temperature)


@inlined
def moved_of(rows: ContactRows | None, act: Acting, moved: Moved, lane: Lane) -> Moved:
    """Return how a contact moves: ``moved`` of one without rows, which stays in registers, else what is stored."""
    if rows is None:
        return moved
    return Moved(pack(act.speed_free, lane), pack(act.thermal_velocity, lane), pack(act.temperature, lane))


Four = tuple[Pack, Pack, Pack, Pack]
"""Sums of four contacts, which share the reads of a state."""


@inlined
def _add_four(table: Array, states: Array, row: int, first: int, sums: Four, lane: Lane) -> Four:
    """Add the products of a table ``(state, contact)`` with states to the sums of contacts from the ``first`` on."""
    a, b, c, d = sums
    for j in range(table.shape[0]):
        x = pack(states, (j, row, lane))
        a = fused(shared(table, (j, first), lane), x, a)
        b = fused(shared(table, (j, first + 1), lane), x, b)
        c = fused(shared(table, (j, first + 2), lane), x, c)
        d = fused(shared(table, (j, first + 3), lane), x, d)
    return a, b, c, d


@inlined
def _add_one(table: Array, states: Array, row: int, first: int, sums: Pack, lane: Lane) -> Pack:
    """Do the same for one contact."""
    for j in range(table.shape[0]):
        sums = fused(shared(table, (j, first), lane), pack(states, (j, row, lane)), sums)
    return sums


@inlined
def _move_contacts(rows: ContactRows, warmed: bool, t: float, state: State, lane: Lane) -> None:
    """Store velocities and temperatures of contacts that have rows."""
    acts, zero, motion, tau = state.acts, spread(0.0, lane), state.motion, state.tau
    fours, zeros = len(acts) // 4 * 4, (zero, zero, zero, zero)
    for c in range(0, fours, 4):
        heat = _add_four(rows.temperature, tau, 0, c, zeros, lane)
        warm = _add_four(rows.heat_speed, tau, 0, c, zeros, lane)
        moved = _add_four(rows.place, motion, PLACE, c, _add_four(rows.speed, motion, SPEED, c, warm, lane), lane)
        for i in range(4):
            by = _of_contact(state.drive, acts[c + i], warmed, t, Moved(moved[i], warm[i], heat[i]), lane)
            keep_moved(state.account, acts[c + i], by, lane)
    for c in range(fours, len(acts)):
        one = _add_one(rows.heat_speed, tau, 0, c, zero, lane)
        speed = _add_one(rows.place, motion, PLACE, c, _add_one(rows.speed, motion, SPEED, c, one, lane), lane)
        by = Moved(speed, one, _add_one(rows.temperature, tau, 0, c, zero, lane))
        keep_moved(state.account, acts[c], _of_contact(state.drive, acts[c], warmed, t, by, lane), lane)
    if rows.expansion.shape[0] > 0:
        for c in range(len(acts)):
            grown = pack(acts[c].grown, lane) + pack(acts[c].growing, lane) * t
            store(acts[c].expansion, lane, _add_one(rows.expansion, tau, 0, c, grown, lane))


@inlined
def _add_heat(row: Array, gains: Array, c: int, j: int, heat: Pack, lane: Lane) -> None:
    """Add what the heat at contact j changes at contact c."""
    store(row, lane, fused(shared(gains, (c, j), lane), heat, pack(row, lane)))


@inlined
def move(step: FreeStep, state: State, j: int, lane: Lane) -> None:
    """Add the impulse of contact j and its heat to the states."""
    p = pack(state.acts[j].impulse, lane)
    heat = pack(state.own.alpha, lane) * p
    for b in range(state.motion.shape[0]):
        for row in range(2):
            moved = fused(pack(state.drives, (j, b, row, lane)), p, pack(state.motion, (b, row, lane)))
            store(state.motion, (b, row, lane), moved)
    for k in range(state.tau.shape[0]):
        warmed = fused(shared(step.heat_gain, (j, k), lane), heat, pack(state.tau, (k, 0, lane)))
        store(state.tau, (k, 0, lane), warmed)


@inlined
def strike(step: FreeStep, state: State, waits: bool, lane: Lane) -> None:
    """Add the impulses of contact and their heat to the states, and their heat to the temperatures of contacts.

    Where nothing reads the states before the next step (``waits``) that step adds them as it reads them itself.
    """
    acts, own, contact, count = state.acts, state.own, step.contact, count_of(state.coupling, state.acts)
    for j in range(count):
        p = pack(acts[j].impulse, lane)
        if waits or some(~(p <= 0.0)):  # a NaN too
            heat = pack(own.alpha, lane) * p
            if not waits:
                move(step, state, j, lane)
            for c in range(count if state.tau.shape[0] > 0 else 0):
                _add_heat(acts[c].temperature, contact.warming, c, j, heat, lane)
                if contact.growth.shape[0] > 0:
                    _add_heat(acts[c].expansion, contact.growth, c, j, heat, lane)


NO_DECAY = 1e-30
"""Replaces a thermal factor D of exactly 0, by which temperatures at t_k are τ_k = τ'/D: negligible beside 1."""


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


def start(blocks: Blocks, cases: Cases, velocity: Array, force: Array) -> InitialState:
    """Return the initial states of cases with a modal ``velocity`` ``(case, mode)``, at -h/2 in central differences.

    These have half the heat of springs with a ``force`` ``(case, contact)`` less: their first step adds all of it.
    """
    modal, h, c, k = blocks.modal, blocks.step.tip.h, blocks.damping[:, None], blocks.stiffness[:, None]
    conducting, elastic = modal.rate > 0, modal.frequency > 0
    heating = project(modal.heat_shapes.T, cases.heating)
    settled = np.where(conducting, heating / np.where(conducting, modal.rate, 1.0), 0.0)
    warming = np.where(conducting, 0.0, heating)
    heat = project(modal.to_thermal, cases.temperature) - settled
    if blocks.step.is_central:
        heat -= project(modal.heat.T, 0.5 * h * cases.alpha[:, None] * force)

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
        closing=modal.contacts.growth_at_once + project(modal.growth, settled),
        closing_rate=project(modal.growth, warming),
        drifting=drifting,
        steady=constant[0, drifting],
    )


class LastStep(NamedTuple):
    """What kernels leave of the last step, which ends after t seconds: u, η and τ at its beginning and end."""

    t: float
    motion: Array
    motion_before: Array
    """``(2, block, case)``; at the beginning of central differences only."""
    heat: Array
    heat_before: Array
    """``(thermal mode, case)``."""
    place: Array
    """x of each contact, ``(contact, case)``."""


def end_state(blocks: Blocks, begun: InitialState, last: LastStep) -> EndState:
    """Return the state after the last step; of central differences at t_k, with the velocity (w_k-½ + w_k+½)/2.

    Modes that do not move the tip are not stepped: they end at rest.
    """
    modal, step, h, t, heat = blocks.modal, blocks.step, blocks.step.tip.h, last.t, last.heat

    def in_modes(states: Array, heat: Array, t: float) -> Array:
        return blocks.in_modes(states + begun.known + blocks.thermal_response(heat + begun.warming_modes * t))

    if step.is_central:
        before, _ = in_modes(last.motion_before, last.heat_before, t)
        after, z = in_modes(last.motion, heat, t + h)
        velocity, heat = (before + after) / 2, (1 - step.decay / 2)[:, None] * last.heat_before + heat / 2
    else:
        velocity, places = in_modes(last.motion, heat, t)
        z = places + step.lever * velocity
    rigid = modal.frequency == 0
    if blocks.outward is not None and rigid.any():  # blocks have no ξ of them
        inverse = np.asarray(np.linalg.pinv(modal.normal[:, rigid]), dtype=np.float64)
        z[rigid] += project(inverse, last.place.T - project(modal.normal, z.T)).T
    tau = heat + begun.settled + begun.warming_modes * t
    return EndState(project(modal.shapes, z.T), project(modal.shapes, velocity.T), project(modal.heat_shapes, tau.T))


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
    modal, step, scale = blocks.modal, blocks.step, blocks.heat_scale
    h, (speed, place), (j, k) = step.tip.h, blocks.contacts.swapaxes(0, 1), blocks.pairs.T
    load, load_place = blocks.of_impulses(modal.load[:, None])[..., 0]
    pull, decay = blocks.thermal_load[:, j, k] / scale[k], np.where(step.decay == 0, NO_DECAY, step.decay)
    recorded, rows = modal.recorded / scale, None
    if not modal.is_single:
        after = recorded / decay if step.is_central else recorded
        columns = speed, place, blocks.heat_velocity / scale, after, modal.residual_coupling / scale
        rows = ContactRows._make([*(np.ascontiguousarray(each.T) for each in columns), load_place])
        if blocks.outward is None:
            rows = rows._replace(place=rows.place[:0])
        if not modal.contacts.is_compliant:
            rows = rows._replace(expansion=rows.expansion[:0])
    is_sum = np.array_equal(modal.recorded, modal.heat)
    return FreeStep(
        blocks=np.stack([1 - h * blocks.damping, -h * blocks.stiffness, load * blocks.scale], axis=1),
        rows=rows,
        heat_modes=np.stack([decay, blocks.heat_velocity[0] / scale], axis=1),
        heat_gain=scale * step.heat_gain,
        pair_block=j,
        pair_heat=k,
        pair_load=np.stack([*(pull * blocks.scale[j]), speed[0, j] * pull[0] + place[0, j] * pull[1]], axis=1),
        drifting=drifting,
        contact=_contact_step(blocks, contact),
        observed=recorded[0] if modal.is_single and not is_sum else None,
        sensors=sensors,
    )


def _contact_step(blocks: Blocks, contact: Contact) -> TipStep:
    """Return the coefficients of the contacts in a step."""
    modal, step, contacts = blocks.modal, blocks.step, blocks.modal.contacts
    own = step.tip._replace(
        delassus=step.delassus(modal),
        thermal_velocity=np.tensordot(blocks.contacts, blocks.thermal_response(step.heat_gain.T), 2),
        stiffness=contact.stiffness,
        holds=contact.holds,
        rebounds=contact.rebounds,
    )
    if not contacts.is_compliant:
        return own
    weight, cold = contact.force_weight(own.theta), contacts.flexibility(0.0)
    return own._replace(
        compliant=True,
        sinking=step.sinking(modal, weight),
        residual=np.stack([cold, cold - contacts.flexibility(1.0)]),
        residual_load=contacts.residual_load,
        growth=modal.residual_coupling @ step.heat_gain.T,
        casing_flexibility=contacts.casing_flexibility,
        carried=1 / weight - 1,
        stiffness=0.0,
    )
