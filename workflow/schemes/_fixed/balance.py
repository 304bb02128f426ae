"""Residuals of energy and heat of a scheme with a fixed step, summed in its own step.

The energy is that of the motion relative to what heat and constant loads drag along, of all modes with a share in the
tip. In decoupled coordinates (:mod:`workflow.schemes._fixed.decoupled`) no product with a coupling matrix is left: with
the impulse S = h F_θ - p of a step, its friction heat Q = α p, a = -R χ_n, b = R μ χ_n, E = (ζ² + ω² η²)/2 and midpoint
values (·)_m = (end + begin)/2, the energy residual is the sum over modes and steps of

    ΔE + hc ζ_m² - S φ_n ζ_m - Q (b ζ_m + ω² a η_m) + h ζ_m Σ G τ_θ,

with friction along t less µp φᵀt ζ_m; Σ runs over thermal modes near resonance: what the scheme gives (+) or takes
(-) by itself, rounding for θ = 1/2.
In it Σ φ_n ζ is the tip's velocity relative to the dragged one. That is taken from the contact law (``Ahead.driven``),
not from the modes: an impulse that does not have the effect its law states shows in the residual. Central differences
conserve E = (w² + ω² η_k η_k+1)/2 with w = w_k+½; their step from w_k-½ to w_k+½ is the same equation with v_k for ζ_m
and (η_k + η_k+1)/2 for η_m, and leaves nothing. Energy that a contact law gives beside its impulse, as a contact spring
where contact begins and ends, is added (:func:`contact_gain`).

The mean velocity is that of the power of an impact, p (v + v')/2, whatever θ is; on a casing that moves p (V + V')/2
of it is the casing's. Without heat the sum over the steps of a mode is

    -(2θ - 1) h² ω² Σ ζ_m² + (θ - 1/2) h [ω² ηζ - (ω² (θ - 1/2) h + c/2) ζ²],

brackets the change from the first state to the last: nothing that load, contact or casing does adds up, and a rigid
mode without damping leaves rounding. With θ-weighted velocities it is -(θ - 1/2) (Δζ² + ω² Δη²) in each step, but that
counts the jump of each impact as an error of the scheme.
The load counts as the step weighs it, F_θ, in every representation of a structure: a slow motion under it leaves
-2 (θ - 1/2) h ∫ k v² dt, one half of which is F_θ against the mean of the load at the step's ends.

A mode's velocity at the end of a step is known when the next one begins, which adds the impulse to it: damping and
friction heat are counted then, and for the last step by :func:`~workflow.schemes._fixed.modal_lanes.close_balance`.

The heat residual is that of pᵀ (1b), with p the temperatures at an even rise (``Structure.even_rise``): the change of
the content H = pᵀC2 θ less αJ + ∫pᵀq - ∫L dt, the loss L = pᵀK2 θ by the temperatures θ of a step as the step weighs
them, counted for :data:`SPAN` steps at once. Full or reduced, it leaves rounding.

The balances run over whole steps: from t = 0 to the end of the last step, which lies at the duration
or, where the duration is no multiple of h, up to one step beyond it; those of central differences are h/2 longer at
either end.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from workflow.kernels.compiled import inlined
from workflow.kernels.lanes import ROW
from workflow.kernels.packs import Lane, Pack, fused, magnitude, pack, plus, shared, spread, store, where
from workflow.models import Array
from workflow.schemes._fixed import case_row, total_row
from workflow.schemes._fixed.block_lanes import BlockAccount
from workflow.schemes._fixed.contact import End, Free, TipStep, contact_gain, was_pressed

BALANCE_DAMPING, BALANCE_HEAT_SPEED, BALANCE_HEAT_PLACE = range(3)
"""Coefficients of a mechanical mode, all over φ_n²: hc/4, and -1 times the work of a unit of friction heat per ζ at the
step's beginning and per ξ at its end without the heat."""

BALANCE_KINETIC, BALANCE_ELASTIC = range(3, 5)
"""Energy per ζ² and per η²."""

SUM_RELATIVE, SUM_DRAGGED = range(total_row.ROWS, total_row.ROWS + 2)
"""Rows of a block's sums beside those of ``total_row``: velocity of the tip relative to the dragged one at the last
step's end; the dragged one without the heat of this step [m/s]."""

SUM_SETTLED_LOSS, SUM_LOST_AHEAD = range(SUM_DRAGGED + 1, SUM_DRAGGED + 3)
"""Heat loss of the temperatures that constant heat loads lead to [W]; heat lost in the present span of steps, all of
it, which ``total_row.LOST`` has not in it yet [J]."""

SUM_ROWS = SUM_LOST_AHEAD + 1

SPAN = 8
"""Steps whose heat loss is counted at once: what temperatures at their beginning and friction heat in them lose."""


class Account(NamedTuple):
    """Coefficients and sums of a block; kernels are given ``None`` in its place where no balances are asked for."""

    modes: Array
    """``(mode, coefficient)``, rows ``BALANCE_…``."""
    losses: Array
    """Heat that a unit of τ loses in so many steps, of which the first row is one, J, ``(steps, thermal mode)``."""
    heat_losses: Array
    """Share of friction heat that is lost in so many steps after its own, from none, ``(steps,)``."""
    former: Array
    """ζ of each mode at the last step's beginning, ``(mode, lane)``."""
    pulled: Array
    """What thermal modes added to ζ of modes near resonance in the last step, ``(pair, lane)``."""
    pair_work: Array
    """Work of a unit of that per ζ_m, ``(pair,)``."""
    pair_heat: Array
    """-1 times the work of a unit of friction heat per unit of that, ``(pair,)``."""
    sums: Array
    """``(row, lane)``, rows of ``total_row`` and ``SUM_…``."""
    lever: float
    """η - ξ per ζ, s."""
    dragged: float
    """Velocity of the tip that a unit of friction heat drags along in its step."""
    heat_on_impulse: float
    """-1 times the work of a unit of friction heat per impulse in its step, 1/(N s)."""
    heat_on_heat: float
    """-1 times the work of a unit of friction heat per heat in its step, 1/J."""
    heat_on_slid: float
    """-1 times the work of a unit of friction heat per µ times the impulse of contact in its step, 1/(N s)."""
    blocks: BlockAccount | None = None
    """Of a structure that is stepped in blocks: it has no modes then."""


@inlined
def of_modes(blocks: Any, account: Account | None) -> Account | None:
    """Return the account where a structure is stepped in modes scaled by the tip, without ``blocks``."""
    return account if blocks is None else None


@inlined
def _at_tip(blocks: BlockAccount | None, own: Array, lane: Lane) -> Pack:
    """Return the impulse of load less contact at the tip in the last step, N s."""
    impulse = pack(own, (case_row.IMPULSE, lane))
    return impulse if blocks is None else impulse + blocks.load_share * pack(own, (case_row.LOAD, lane))


@inlined
def lay_out_account(account: Account | None) -> None:
    """Assert how far apart rows lie, as :func:`~workflow.schemes._fixed.modal_lanes.lay_out` does for a march."""
    if account is None:
        return
    assert account.modes.shape[1] == BALANCE_ELASTIC + 1
    assert account.pulled.shape[1] == ROW
    assert account.sums.shape[1] == ROW


@inlined
def add_dissipation(account: Account | None, j: int, speed: Pack, slid: Any, dissipated: Pack, lane: Lane) -> Pack:
    """Add the energy that damping and friction along a tangent took from mode j in a step that ended at ζ = ``speed``.

    ``speed`` is stored for the next step.
    """
    if account is None:
        return dissipated
    twice = speed + pack(account.former, (j, lane))
    store(account.former, (j, lane), speed)
    dissipated = fused(shared(account.modes, (j, BALANCE_DAMPING), lane) * twice, twice, dissipated)
    return dissipated if slid is None else dissipated - shared(slid.works, (j,), lane) * twice * slid.impulse


@inlined
def add_heat_work(account: Account | None, j: int, place: Pack, on_heat: Pack, lane: Lane) -> Pack:
    """Add the energy that a unit of friction heat takes from mode j, which ended with ξ = ``place`` but for that heat.

    The impulse's share in it is the same in all steps (:func:`store_dissipation`). To be called before
    :func:`add_dissipation`.
    """
    if account is None:
        return on_heat
    on_heat = fused(shared(account.modes, (j, BALANCE_HEAT_SPEED), lane), pack(account.former, (j, lane)), on_heat)
    return fused(shared(account.modes, (j, BALANCE_HEAT_PLACE), lane), place, on_heat)


@inlined
def store_dissipation(
    account: Account | None, dissipated: Pack, on_heat: Pack, impulse: Pack, heat: Pack | None, slid: Any, lane: Lane
) -> None:
    """Add the energy that all modes dissipated in a step to the sums."""
    if account is None:
        return
    on_heat = on_heat if slid is None else on_heat + account.heat_on_slid * slid.impulse
    on_heat = plus(on_heat + account.heat_on_impulse * impulse, spread(account.heat_on_heat, lane), heat)
    store(
        account.sums,
        (total_row.DISSIPATED, lane),
        plus(pack(account.sums, (total_row.DISSIPATED, lane)) + dissipated, on_heat, heat),
    )


@inlined
def add_pair_work(account: Account | None, pair: int, j: int, speed: Pack, heat: Pack, lane: Lane) -> None:
    """Count the work of a thermal mode near resonance with mode j in a step that ended with ζ = ``speed``."""
    if account is None:
        return
    sums, pulled = account.sums, pack(account.pulled, (pair, lane))
    mean = 0.5 * (speed + pack(account.former, (j, lane)))
    on_heat = shared(account.pair_heat, (pair,), lane) * heat
    dissipated = (on_heat - shared(account.pair_work, (pair,), lane) * mean) * pulled
    store(sums, (total_row.DISSIPATED, lane), pack(sums, (total_row.DISSIPATED, lane)) + dissipated)


@inlined
def store_pull(account: Account | None, pair: int, pull: Pack, lane: Lane) -> None:
    """Store what a thermal mode adds to ζ of a mode near resonance with it."""
    if account is None:
        return
    store(account.pulled, (pair, lane), pull)


@inlined
def store_dragged_velocity(account: Account | None, velocity: Pack, lane: Lane) -> None:
    """Store the tip's dragged velocity at a step's end, without the friction heat in the step."""
    if account is None:
        return
    store(account.sums, (SUM_DRAGGED, lane), velocity)


@inlined
def count_work(
    account: Account | None, step: TipStep, end: End, driven: Pack, free: Free, own: Array, tip: Array, lane: Lane
) -> None:
    """Count the work of load and contact in a step that contact has closed."""
    if account is None:
        return
    sums, impulse = account.sums, pack(own, (case_row.IMPULSE, lane))
    before, relative = pack(sums, (SUM_RELATIVE, lane)), driven - pack(sums, (SUM_DRAGGED, lane))
    if was_pressed(own, lane):
        relative -= account.dragged * pack(own, (case_row.HEAT, lane))
    store(sums, (SUM_RELATIVE, lane), relative)
    gain = contact_gain(step, end, _at_tip(account.blocks, own, lane), relative - before, free, own, tip, lane)
    dissipated = pack(sums, (total_row.DISSIPATED, lane)) + gain
    store(sums, (total_row.DISSIPATED, lane), fused(impulse, -0.5 * (relative + before), dissipated))


@inlined
def count_friction_heat(account: Account | None, step: int, steps: int, own: Array, lane: Lane) -> None:
    """Count the friction heat of a step, and its loss in this span."""
    if account is None:
        return
    if was_pressed(own, lane):
        sums, heat = account.sums, pack(own, (case_row.HEAT, lane))
        lost = shared(account.heat_losses, (min(SPAN - step % SPAN, steps - step),), lane) * heat
        store(sums, (SUM_LOST_AHEAD, lane), pack(sums, (SUM_LOST_AHEAD, lane)) + lost)
        store(sums, (total_row.FRICTION_HEAT, lane), pack(sums, (total_row.FRICTION_HEAT, lane)) + heat)


@inlined
def count_lost_heat(account: Account, step: int, steps: int, h: float, tau: Array, lane: Lane) -> None:
    """Close a span of steps, and count what the temperatures at its end lose in the next one, if there is one."""
    sums, ahead = account.sums, min(SPAN, steps - step)
    lost = pack(sums, (SUM_LOST_AHEAD, lane))
    store(sums, (total_row.LOST, lane), pack(sums, (total_row.LOST, lane)) + lost)
    store(sums, (total_row.TURNED_OVER, lane), pack(sums, (total_row.TURNED_OVER, lane)) + magnitude(lost))
    lost = spread(0.0, lane)
    if ahead > 0:
        lost = (ahead * h) * pack(sums, (SUM_SETTLED_LOSS, lane))
        for k in range(tau.shape[0]):
            lost = fused(shared(account.losses, (ahead - 1, k), lane), pack(tau, (k, lane)), lost)
    store(sums, (SUM_LOST_AHEAD, lane), lost)


@inlined
def with_energy(account: Account, j: int, speed: Pack, place: Pack, energy: Pack, lane: Lane) -> Pack:
    """Add the energy of mode j from ζ and ξ."""
    eta = fused(spread(account.lever, lane), speed, place)
    energy = fused(shared(account.modes, (j, BALANCE_KINETIC), lane) * speed, speed, energy)
    return fused(shared(account.modes, (j, BALANCE_ELASTIC), lane) * eta, eta, energy)


@inlined
def store_energy(account: Account, energy: Pack, lane: Lane) -> None:
    """Store the energy at the end of a step and the largest one; a NaN stays."""
    largest = pack(account.sums, (total_row.LARGEST_ENERGY, lane))
    store(account.sums, (total_row.LAST_ENERGY, lane), energy)
    store(account.sums, (total_row.LARGEST_ENERGY, lane), where(energy <= largest, largest, energy))
