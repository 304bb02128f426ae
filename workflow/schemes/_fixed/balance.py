"""What a fixed step does to energy and heat, counted at its end.

The energy is that of the motion relative to what heat and constant loads drag along, of all modes with a share in the
tip. In the v and ξ of the modes (:mod:`workflow.schemes._fixed.blocks`), with η = ξ + ℓ v, it is E = (m v² + ω² η²)/2;
ℓ = hθ and m = 1 of the θ-method, ℓ = h/2 and m = 1 - (hω/2)² of central differences, so that theirs is
(w² + ω² η_k η_k+1)/2 with w = w_k+½. Whatever adds δv and δξ to a step acts by the impulse I = Ŵ δv + ℓ ω² δξ and the
jump J = δξ. With midpoint values (·)_m = (end + begin)/2 the energy residual is the sum over modes and steps of

    ΔE + hc v_m² - I v_m - ω² J η_m.

For the part of load and contact that acts on the tip Σ I v_m is (S_load - p) times the tip's velocity relative to the
dragged one. That is taken from the contact law (``Ahead.driven``), not from the modes: an impulse that does not have
the effect its law states shows in the residual. What is left of an impulse of contact are its heat and its friction.
Damping that couples modes is one more impulse, -h C v_m beside the diagonal. Energy that a contact law gives beside its
impulse, as a contact spring where contact begins and ends, is added (:func:`contact_gain`).

The mean velocity is that of the power of an impact, p (v + v')/2, whatever θ is; on a casing that moves p (V + V')/2
of it is the casing's. Without heat the sum over the steps of a mode is

    -(2θ - 1) h² ω² Σ v_m² + (θ - 1/2) h [ω² ηv - (ω² (θ - 1/2) h + c/2) v²],

brackets the change from the first state to the last: nothing that load, contact or casing does adds up, and a rigid
mode without damping leaves rounding. With θ-weighted velocities it is -(θ - 1/2) (Δv² + ω² Δη²) in each step, but that
counts the jump of each impact as an error of the scheme.
The load counts as the step weighs it, F_θ, in every representation of a structure: a slow motion under it leaves
-2 (θ - 1/2) h ∫ k v² dt, one half of which is F_θ against the mean of the load at the step's ends.

The heat residual is that of pᵀ (1b), with p the temperatures at an even rise (``Structure.even_rise``): the change of
the content H = pᵀC2 θ less αJ + ∫pᵀq - ∫L dt, the loss L = pᵀK2 θ by the temperatures θ of a step as the step weighs
them. Full or reduced, it leaves rounding.

The balances run over whole steps: from t = 0 to the end of the last step, which lies at the duration
or, where the duration is no multiple of h, up to one step beyond it; those of central differences are h/2 longer at
either end.
"""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import PACK, ROW
from workflow.kernels.packs import (
    Lane,
    Pack,
    broad,
    broadest,
    fused,
    magnitude,
    narrow,
    pack,
    plus,
    shared,
    spread,
    store,
    where,
)
from workflow.models import Array
from workflow.schemes._fixed import case_row, total_row
from workflow.schemes._fixed.contact import Ahead, End, Free, TipStep, contact_gain, was_pressed
from workflow.schemes._fixed.free_motion import LOAD, PLACE, SPEED, FreeStep, State, ended

DAMPING, KINETIC, ELASTIC = range(3)
"""Coefficients of a mode, over φ_n² where it is scaled by that: hc/4, and energy per v² and per η²."""

RELATIVE, SETTLED_LOSS, LOSS = range(total_row.ROWS, total_row.ROWS + 3)
"""Rows of sums beside those of ``total_row``: velocity of the tip relative to the dragged one at the last step's end
[m/s]; heat loss of the temperatures that constant heat loads lead to, and of all at the last step's end [W]."""

ROWS = LOSS + 1


class Dense(NamedTuple):
    """Motion of modes by matrices: where these are coupled, near resonance with heat, or drift under constant loads.

    Rows of all modes lie one after the other: v and then ξ, or I and then J.
    """

    outward: Array
    """Of u and then η of all blocks as kernels scale them, ``(2 mode, 2 block)``."""
    damper: Array
    """h times the damping beside the diagonal, ``(mode, mode)``."""
    lagged: bool
    """Whether v at a step's beginning damps."""
    load: Array
    """Of a unit impulse of the load, beside what of it acts on the tip, ``(mode,)``."""
    pulls: Array
    """Of τ near resonance, ``(pair, 2 mode)``."""
    constant: Array
    """Of constant loads on drifting blocks, ``(2 mode, lane)``."""
    states: Array
    """u and η at the last step's end, ``(2 block, lane)``."""
    moved: Array
    """v and ξ there, ``(2 mode, lane)``."""
    inputs: Array
    """I and J in that step, ``(2 mode, lane)``."""


class Account(NamedTuple):
    """Coefficients and sums of a block; kernels are given ``None`` in its place where no balances are asked for."""

    modes: Array
    """``(mode, coefficient)``."""
    acts: Array
    """I and J of a unit impulse of contact by its heat and its friction, of all modes, ``(2 mode, lane)``."""
    losses: Array
    """Heat loss per τ, W, ``(thermal mode,)``."""
    former: Array
    """v at the last step's end, ``(mode, lane)``."""
    sums: Array
    """``(row, lane)``, rows of ``total_row`` and those beside."""
    lever: float
    """ℓ, s."""
    load_share: float
    """Share of the load that acts on the tip."""
    dragged: float
    """Velocity of the tip that a unit of friction heat drags along in its step."""
    heat_loss: float
    """Heat loss per unit of friction heat at the end of its step, 1/s."""
    heat_theta: float
    """Weight of the temperatures at a step's end in what it loses."""
    dense: Dense | None = None


@inlined
def lay_out_account(account: Account | None) -> None:
    """Assert how far apart rows lie, as :func:`~workflow.schemes._fixed.free_motion.lay_out` does for a march."""
    if account is None:
        return
    assert account.modes.shape[1] == ELASTIC + 1
    assert account.acts.shape[1] == ROW
    assert account.former.shape[1] == ROW
    assert account.sums.shape[1] == ROW


@inlined
def add_to(sums: Array, row: int, numbers: Pack, lane: Lane) -> None:
    """Add numbers to a row."""
    store(sums, (row, lane), pack(sums, (row, lane)) + numbers)


@inlined
def count_work(
    account: Account | None,
    step: TipStep,
    end: End,
    ahead: Ahead,
    dragged: Pack,
    free: Free,
    own: Array,
    tip: Array,
    lane: Lane,
) -> None:
    """Count friction heat, and the work of load and contact at the tip in a step that contact has closed."""
    if account is None:
        return
    sums, relative = account.sums, ahead.driven - dragged
    if was_pressed(own, lane):
        heat = pack(own, (case_row.HEAT, lane))
        relative -= account.dragged * heat
        add_to(sums, total_row.FRICTION_HEAT, heat, lane)
    before, impulse = pack(sums, (RELATIVE, lane)), account.load_share * free.impulse - ahead.impulse
    store(sums, (RELATIVE, lane), relative)
    gain = contact_gain(step, end, impulse, relative - before, free, own, tip, lane)
    add_to(sums, total_row.DISSIPATED, fused(impulse, -0.5 * (relative + before), gain), lane)


@inlined
def count_step(
    account: Account | None, step: FreeStep, state: State, opens: bool, looks: bool, in_broad: int, lanes: int
) -> None:
    """Count what a step did to modes and temperatures; ``opens`` at t = 0, ``looks`` where the energy is looked at.

    The first lanes are ``in_broad`` packs, as those of the step.
    """
    if account is not None:
        _count(account.dense, account, step, state, opens, looks, in_broad, lanes)


@part
def _count(
    dense: Dense | None,
    account: Account,
    step: FreeStep,
    state: State,
    opens: bool,
    looks: bool,
    in_broad: int,
    lanes: int,
) -> None:
    _move(dense, account, step.coupled, step, state, lanes)
    for first in range(0, in_broad, broadest()):
        _count_pack(dense, account, step, state, opens, looks, broad(first))
    for first in range(in_broad, lanes, PACK):
        _count_pack(dense, account, step, state, opens, looks, narrow(first))


@inlined
def _count_pack(
    dense: Dense | None, account: Account, step: FreeStep, state: State, opens: bool, looks: bool, lane: Lane
) -> None:
    if was_pressed(state.own, lane):
        _count_motion(dense, account, step, state, pack(state.own, (case_row.IMPULSE, lane)), lane)
    else:
        _count_motion(dense, account, step, state, None, lane)
    if looks:
        _look(dense, account, step, state, lane)
    if not opens:
        _count_heat(account, step.tip.h, state, lane)


@inlined
def _at_end(
    dense: Dense | None, step: FreeStep, state: State, j: int, load: Pack, contact: Pack | None, lane: Lane
) -> tuple[Pack, Pack]:
    """Return v and ξ of mode j at the step's end."""
    if dense is None:
        v = fused(shared(step.blocks, (j, LOAD), lane), load, pack(state.motion, (j, SPEED, lane)))
        v = plus(v, pack(state.drives, (j, SPEED, lane)), contact)
        return v, plus(pack(state.motion, (j, PLACE, lane)), pack(state.drives, (j, PLACE, lane)), contact)
    return pack(dense.moved, (j, lane)), pack(dense.moved, (dense.damper.shape[0] + j, lane))


@inlined
def _count_motion(
    dense: Dense | None, account: Account, step: FreeStep, state: State, contact: Pack | None, lane: Lane
) -> None:
    """Count what damping, and impulses that do not act on the tip, did to the modes."""
    if dense is None:
        _count_modes(dense, account, step, state, contact, account.acts, contact, lane)
    else:
        _count_modes(dense, account, step, state, contact, dense.inputs, spread(1.0, lane), lane)


@inlined
def _count_modes(
    dense: Dense | None,
    account: Account,
    step: FreeStep,
    state: State,
    contact: Pack | None,
    inputs: Array,
    times: Pack | None,
    lane: Lane,
) -> None:
    """Count damping and ``inputs``, of which so many ``times`` act; ``None`` where there are none."""
    former, load = account.former, pack(state.own, (case_row.LOAD, lane))
    dissipated = pack(account.sums, (total_row.DISSIPATED, lane))
    for j in range(former.shape[0]):
        v, xi = _at_end(dense, step, state, j, load, contact, lane)
        before = pack(former, (j, lane))
        store(former, (j, lane), v)
        twice = v + before
        dissipated = fused(shared(account.modes, (j, DAMPING), lane) * twice, twice, dissipated)
        eta = 2.0 * xi - step.tip.h * before + account.lever * twice
        dissipated = _less_work(account, j, twice, eta, inputs, times, dissipated, lane)
    store(account.sums, (total_row.DISSIPATED, lane), dissipated)


@inlined
def _less_work(
    account: Account, j: int, twice: Pack, eta: Pack, inputs: Array, times: Pack | None, dissipated: Pack, lane: Lane
) -> Pack:
    """Take the work of inputs off, I v_m + ω² J η_m: ``twice`` is 2 v_m, ``eta`` is 2 η_m + J."""
    if times is None:
        return dissipated
    jump = pack(inputs, (account.former.shape[0] + j, lane)) * times
    dissipated -= 0.5 * twice * (pack(inputs, (j, lane)) * times)
    return dissipated - shared(account.modes, (j, ELASTIC), lane) * jump * (eta - jump)


@inlined
def _look(dense: Dense | None, account: Account, step: FreeStep, state: State, lane: Lane) -> None:
    """Keep the energy at the end of the last step, and the largest one; a NaN stays."""
    contact, load = pack(state.own, (case_row.IMPULSE, lane)), pack(state.own, (case_row.LOAD, lane))
    energy, largest = spread(0.0, lane), pack(account.sums, (total_row.LARGEST_ENERGY, lane))
    for j in range(account.former.shape[0]):
        v, xi = _at_end(dense, step, state, j, load, contact, lane)
        eta = xi + account.lever * v
        energy = fused(shared(account.modes, (j, KINETIC), lane) * v, v, energy)
        energy = fused(shared(account.modes, (j, ELASTIC), lane) * eta, eta, energy)
    store(account.sums, (total_row.LAST_ENERGY, lane), energy)
    store(account.sums, (total_row.LARGEST_ENERGY, lane), where(energy <= largest, largest, energy))


@inlined
def _count_heat(account: Account, h: float, state: State, lane: Lane) -> None:
    """Count the heat that the step lost."""
    loss, before = pack(account.sums, (SETTLED_LOSS, lane)), pack(account.sums, (LOSS, lane))
    for k in range(state.tau.shape[0]):
        loss = fused(shared(account.losses, (k,), lane), pack(state.tau, (k, lane)), loss)
    loss += account.heat_loss * pack(state.own, (case_row.HEAT, lane))
    lost = h * (account.heat_theta * loss + (1.0 - account.heat_theta) * before)
    store(account.sums, (LOSS, lane), loss)
    add_to(account.sums, total_row.LOST, lost, lane)
    add_to(account.sums, total_row.TURNED_OVER, magnitude(lost), lane)


@part
def _add_product(matrix: Array, states: Array, sums: Array, lanes: int) -> None:
    """Add matrix · states to ``sums``, ``(row, lane)``."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            factor = matrix[i, j]
            if factor != 0.0:
                for lane in range(lanes):
                    sums[i, lane] += factor * states[j, lane]


@inlined
def _move(
    dense: Dense | None, account: Account, coupled: Array | None, step: FreeStep, state: State, lanes: int
) -> None:
    """Take what matrices make of the step's end and of what acted in it."""
    if dense is None:
        return
    blocks, modes, own = state.motion.shape[0], dense.damper.shape[0], state.own
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        contact, load = pack(own, (case_row.IMPULSE, lane)), pack(own, (case_row.LOAD, lane))
        for j in range(blocks):
            u, eta = ended(coupled, step, state, j, load, contact, lane)
            store(dense.states, (j, lane), u)
            store(dense.states, (blocks + j, lane), eta)
        for i in range(2 * modes):
            acts = pack(dense.constant, (i, lane)) + pack(account.acts, (i, lane)) * contact
            if i < modes:
                acts += shared(dense.load, (i,), lane) * load
            for pair in range(step.pair_heat.size):
                tau = pack(state.tau_paired, (step.pair_heat[pair], lane))
                acts += shared(dense.pulls, (pair, i), lane) * tau
            store(dense.inputs, (i, lane), acts)
            store(dense.moved, (i, lane), spread(0.0, lane))
    _add_product(dense.outward, dense.states, dense.moved, lanes)
    _damp(dense, account.former, lanes)


@part
def _damp(dense: Dense, former: Array, lanes: int) -> None:
    """Add the impulses of damping that couples modes to the inputs."""
    for i in range(dense.damper.shape[0]):
        for j in range(dense.damper.shape[1]):
            factor = dense.damper[i, j]
            for lane in range(lanes):
                damps = former[j, lane] if dense.lagged else 0.5 * (former[j, lane] + dense.moved[j, lane])
                dense.inputs[i, lane] -= factor * damps
