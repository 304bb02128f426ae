"""What a fixed step does to energy and heat, counted at its end.

The energy is that of the motion relative to what heat and constant loads drag along, of all modes with a share in the
tip. In the v and ξ of the modes (:mod:`workflow.schemes._fixed.blocks`), with η = ξ + ℓ v, it is E = (m v² + ω² η²)/2;
ℓ = hθ and m = 1 of the θ-method, ℓ = h/2 and m = 1 - (hω/2)² of central differences, so that theirs is
(w² + ω² η_k η_k+1)/2 with w = w_k+½. Whatever adds δv and δξ to a step acts by the impulse I = Ŵ δv + ℓ ω² δξ and the
jump J = δξ. With midpoint values (·)_m = (end + begin)/2 the energy residual is the sum over modes and steps of

    ΔE + hc v_m² - I v_m - ω² J η_m.

For the part of load and contact that acts on the tip Σ I v_m is (S_load - p) times the tip's velocity relative to the
dragged one. That is taken from the contact law (``End.driven``), not from the modes: an impulse that does not have
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

What a step took is counted where the next one begins, which adds load and contact to u and η; that of the last step,
and of modes by matrices (:class:`Dense`), by :mod:`~workflow.schemes._fixed.count`. The loss of the temperatures θ of a
step, weighed by ϑ at its end, is summed as h Σ L over all ends but the last, and hϑ (L_end - L_0).

The balances run over whole steps: from t = 0 to the end of the last step, which lies at the duration
or, where the duration is no multiple of h, up to one step beyond it; those of central differences are h/2 longer at
either end.
"""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels.compiled import inlined
from workflow.kernels.lanes import ROW
from workflow.kernels.packs import Lane, Pack, fused, magnitude, pack, shared, spread, store
from workflow.models import Array
from workflow.schemes._fixed.contact import End, Free, TipStep, contact_gain, friction_heat, was_pressed
from workflow.schemes._fixed.rows import Own, Tips, Totals

DAMPING, KINETIC, ELASTIC = range(3)
"""Coefficients of a mode, over φ_n² where it is scaled by that: hc/4, and energy per v² and per η²."""


class Dense(NamedTuple):
    """Motion of modes by matrices: where these are coupled, near resonance with heat, or drift under constant loads.

    Rows of all modes lie one after the other: v and then ξ, or of what acts in a step what it takes per 2 v_m,
    -(I + ℓ ω² J)/2, and then per ξ' - h v/2, -ω² J: together -I v_m - ω² J (η_m + J/2).
    """

    outward: Array
    """Of u and then η of all blocks as kernels scale them, ``(2 mode, 2 block)``."""
    damper: Array
    """h times the damping beside the diagonal, ``(mode, mode)``."""
    lagged: bool
    """Whether v at a step's beginning damps."""
    load: Array
    """Of a unit impulse of the load, beside what of it acts on the tip, ``(mode,)``."""
    half_flexibility: Array
    """1/(2 ω²), 0 of rigid modes, ``(mode,)``."""
    pulls: Array
    """Of τ near resonance, ``(pair, 2 mode)``."""
    constant: Array
    """Of constant loads on drifting blocks, ``(2 mode, lane)``."""
    states: Array
    """u and η at the last step's end, ``(2 block, lane)``."""
    moved: Array
    """v and ξ there, ``(2 mode, lane)``."""
    inputs: Array
    """What acted in that step, ``(2 mode, lane)``."""


class Account(NamedTuple):
    """Coefficients and sums of a block; kernels are given ``None`` in its place where no balances are asked for."""

    modes: Array
    """``(mode, coefficient)``."""
    acts: Array
    """What heat and friction of a unit impulse of contact take, as in :class:`Dense`, ``(2 mode, lane)``."""
    losses: Array
    """Heat loss per τ, W, ``(thermal mode,)``."""
    former: Array
    """v at the last step's end, ``(mode, lane)``."""
    sums: Totals
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


@inlined
def plus(numbers: Pack, weight: Pack, others: Pack | None) -> Pack:
    """Return ``numbers + weight * others``, or the numbers alone where the others are ``None``, known when compiled."""
    return numbers if others is None else numbers + weight * others


@inlined
def lay_out_account(account: Account | None) -> None:
    """Assert how far apart rows lie, as :func:`~workflow.schemes._fixed.free_motion.lay_out` does for a march."""
    if account is None:
        return
    assert account.modes.shape[1] == ELASTIC + 1
    assert account.acts.shape[1] == ROW
    assert account.former.shape[1] == ROW


@inlined
def add_to(row: Array, numbers: Pack, lane: Lane) -> None:
    """Add numbers to a row."""
    store(row, lane, pack(row, lane) + numbers)


@inlined
def count_work(
    account: Account | None,
    step: TipStep,
    end: End,
    dragged: Pack,
    free: Free,
    own: Own,
    tip: Tips,
    lane: Lane,
) -> None:
    """Count friction heat, and the work of load and contact at the tip in a step that contact has closed."""
    if account is None:
        return
    sums, relative = account.sums, end.driven - dragged
    if was_pressed(own, lane):
        heat = friction_heat(own, lane)
        relative -= account.dragged * heat
        add_to(sums.friction_heat, heat, lane)
    before, impulse = pack(sums.relative, lane), account.load_share * free.impulse - end.acting
    store(sums.relative, lane, relative)
    gain = contact_gain(step, end, impulse, relative - before, free, own, tip, lane)
    add_to(sums.dissipated, fused(impulse, -0.5 * (relative + before), gain), lane)


@inlined
def count_mode(
    account: Account | None,
    dense: Dense | None,
    j: int,
    v: Pack,
    xi: Pack,
    h: float,
    contact: Pack | None,
    dissipated: Pack,
    given: Pack,
    lane: Lane,
) -> tuple[Pack, Pack]:
    """Add what damping took from mode j in a step that it ends with v and ξ, and what a unit of contact took."""
    if account is None or dense is not None:
        return dissipated, given
    return count_inputs(account, account.acts, j, v, xi, h, contact, dissipated, given, lane)


@inlined
def count_inputs(
    account: Account,
    inputs: Array,
    j: int,
    v: Pack,
    xi: Pack,
    h: float,
    times: Pack | None,
    dissipated: Pack,
    given: Pack,
    lane: Lane,
) -> tuple[Pack, Pack]:
    """Add what damping took from mode j, and what a unit of inputs took where they acted some ``times``."""
    before = pack(account.former, (j, lane))
    store(account.former, (j, lane), v)
    twice = v + before
    dissipated = fused(shared(account.modes, (j, DAMPING), lane) * twice, twice, dissipated)
    if times is None:
        return dissipated, given
    given = fused(pack(inputs, (j, lane)), twice, given)
    between = fused(spread(-0.5 * h, lane), before, xi)
    return dissipated, fused(pack(inputs, (account.former.shape[0] + j, lane)), between, given)


@inlined
def add_modes(
    account: Account | None, dense: Dense | None, dissipated: Pack, given: Pack, contact: Pack | None, lane: Lane
) -> None:
    """Add what :func:`count_mode` counted of all modes to the sums."""
    if account is None or dense is not None:
        return
    add_dissipation(account, dissipated, given, contact, lane)


@inlined
def add_dissipation(account: Account, dissipated: Pack, given: Pack, times: Pack | None, lane: Lane) -> None:
    """Add what all modes dissipated in a step to the sums, with inputs that acted so many ``times``."""
    if times is not None:
        dissipated += times * (given + times * pack(account.sums.square, lane))
    add_to(account.sums.dissipated, dissipated, lane)


@inlined
def with_loss(account: Account | None, k: int, tau: Pack, loss: Pack, lane: Lane) -> Pack:
    """Add the heat loss of thermal mode k at a step's end, W."""
    return loss if account is None else fused(shared(account.losses, (k,), lane), tau, loss)


@inlined
def add_loss(account: Account | None, h: float, loss: Pack, heat: Pack | None, lane: Lane) -> None:
    """Add the heat lost in h seconds at the loss of all modes, with that of the ``heat`` of the contact."""
    if account is None:
        return
    loss = plus(loss + pack(account.sums.settled_loss, lane), spread(account.heat_loss, lane), heat)
    add_to(account.sums.lost, h * loss, lane)
    add_to(account.sums.turned_over, magnitude(h * loss), lane)
