"""Balances of energy and heat of a fixed step, counted at its end.

The energy is that of all modes that move the tip, relative to the particular solution for heat and constant loads. In
the v and ξ of the modes (:mod:`workflow.schemes._fixed.blocks`), with η = ξ + ℓ v, it is E = (m v² + ω² η²)/2; ℓ = hθ
and m = 1 of the θ-method, ℓ = h/2 and m = 1 - (hω/2)² of central differences, whose energy is (w² + ω² η_k η_k+1)/2
with w = w_k+½. An input that adds δv and δξ in a step is the impulse I = Ŵ δv + ℓ ω² δξ and the jump J = δξ. With
midpoint values (·)_m = (end + begin)/2 the energy residual is the sum over modes and steps of

    ΔE + hc v_m² - I v_m - ω² J η_m.

For the part of load and contact that acts on the tip Σ I v_m is (S_load - p) times the tip's velocity relative to the
particular solution. That velocity is taken from the contact law (``End.driven``), not from the modes, so that an
impulse without the effect its law states shows in the residual. The heat and the friction of a contact impulse are
inputs besides. Damping that couples modes is one more impulse, -h C v_m with the off-diagonal C. Energy that a contact
law creates besides its impulse, as a contact spring where contact begins and ends, is added (:func:`contact_gain`).

The mean velocity is that of the power of an impact, p (v + v')/2, whatever θ is; on a casing that moves p (V + V')/2
of it is the casing's. Without heat the sum over the steps of a mode is

    -(2θ - 1) h² ω² Σ v_m² + (θ - 1/2) h [ω² ηv - (ω² (θ - 1/2) h + c/2) v²],

with brackets for changes from the first state to the last: no work of load, contact or casing accumulates in it, and a
rigid mode without damping leaves rounding. With θ-weighted velocities it would be -(θ - 1/2) (Δv² + ω² Δη²) in each
step, which counts the jump of each impact as an error of the scheme.
The largest energy is that of all step ends, of which few are computed. With v_ℓ = v + ℓ/h Δv, η_ℓ likewise,

    ΔE = I v_ℓ + ω² J η_ℓ - h c v_ℓ² - (ℓ/h - 1/2) (Δv² + ω² Δη²),    of central differences with v_m, η_m,

so that for ℓ >= h/2 no energy exceeds the last one computed by more than Σ (S_load - p) v_ℓ of the tip and
p √(2 max E) √(I² + ω² J²), with the inputs I, J by heat and friction of a unit impulse of contact. E is computed where
this bound exceeds the largest one so far.
The load counts as the step weights it, F_θ, in every representation of a structure. A quasi-static motion under it
leaves -2 (θ - 1/2) h ∫ k v² dt, half of which is the difference of F_θ from the mean of the load at the step's ends.

The heat residual is that of pᵀ (1b), with p the temperatures of ``Structure.uniform_rise``: the change of the content
H = pᵀC2 T less αJ + ∫pᵀq - ∫L dt, with the loss L = pᵀK2 T by the temperatures T as the step weights them. It is
rounding, whether the structure is full or reduced.

A step is counted at the beginning of the next one, which adds load and contact to u and η; the last step, and modes
with :class:`Dense` balances, are counted in :mod:`~workflow.schemes._fixed.modal_balance`. With the weight θ of a
step's end the loss is summed as h Σ L over all step ends but the last, plus hθ (L_end - L_0).

With the energy E, dissipation D less the work of loads and contact, heat content H, losses L, friction heat αJ and
heating Q = ∫pᵀq of a whole march the residuals are, and 0 where the denominator is 0,

    energy residual = (E_end - E_0 + D) / max E
    heat residual = (H_end - H_0 - αJ - Q + L) / (αJ + |Q| + ∫|dL| + Σ|c T_0|).

The balances run over whole steps: from t = 0 to the end of the last step, which lies at the duration
or, where the duration is no multiple of h, up to one step beyond it; those of central differences are h/2 longer at
either end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels.compiled import inlined
from workflow.kernels.lanes import ROW
from workflow.kernels.packs import Lane, Pack, fused, magnitude, pack, shared, spread, store
from workflow.models import Array, Cases, Structure
from workflow.schemes._fixed.contact import End, TipInput, TipStep, contact_gain, friction_heat, was_pressed
from workflow.schemes._fixed.rows import Own, Tips, Totals

DAMPING, KINETIC, ELASTIC = range(3)
"""Coefficients of a mode, divided by φ_n² where φ_n scales its states: hc/4, energy per v² and energy per η²."""


class Dense(NamedTuple):
    """Balance of modes by matrices: where modes are coupled, near resonance with heat, or drift under constant loads.

    States are v of all modes and then ξ of all. An input has the energy that it takes per 2 v_m, -(I + ℓ ω² J)/2, of
    all modes and then that per ξ' - h v/2, -ω² J: together -I v_m - ω² J (η_m + J/2).
    """

    outward: Array
    """States per u and then η of all blocks as kernels scale them, ``(2 mode, 2 block)``."""
    off_diagonal: Array
    """h times the off-diagonal damping, ``(mode, mode)``."""
    lagged: bool
    """Whether v at a step's beginning damps."""
    load: Array
    """Input per unit impulse of the load, without the part that acts on the tip, ``(mode,)``."""
    half_flexibility: Array
    """1/(2 ω²), 0 of rigid modes, ``(mode,)``."""
    pair_inputs: Array
    """Input per τ near resonance, ``(pair, 2 mode)``."""
    constant: Array
    """Input of constant loads on drifting blocks, ``(2 mode, lane)``."""
    states: Array
    """u and η at the last step's end, ``(2 block, lane)``."""
    modal_states: Array
    """v and ξ there, ``(2 mode, lane)``."""
    inputs: Array
    """All inputs of that step, ``(2 mode, lane)``."""


class Account(NamedTuple):
    """Coefficients and sums of the balances of a block; ``None`` in kernels where no balances are asked for."""

    modes: Array
    """``(mode, coefficient)``."""
    contact_inputs: Array
    """Input by heat and friction of a unit impulse of contact, as in :class:`Dense`, ``(2 mode, lane)``."""
    losses: Array
    """Heat loss per τ, W, ``(thermal mode,)``."""
    velocity_before: Array
    """v at the last step's end, ``(mode, lane)``."""
    sums: Totals
    h: float
    """s."""
    energy_lever: float
    """ℓ, s."""
    load_share: float
    """Fraction of the load that acts on the tip."""
    thermal_velocity: float
    """Thermal velocity of the tip per unit of friction heat in its step."""
    heat_loss: float
    """Heat loss per unit of friction heat at the end of its step, 1/s."""
    heat_theta: float
    """Weight of the temperatures at a step's end in its heat loss."""
    unbounded: float
    """0, or ∞ of the θ-method with θ < 1/2, whose free motion may gain energy."""


@inlined
def plus(numbers: Pack, weight: Pack, others: Pack | None) -> Pack:
    """Return ``numbers + weight * others``, or ``numbers`` where ``others`` is ``None``, decided at compile time."""
    return numbers if others is None else numbers + weight * others


@inlined
def lay_out_account(account: Account | None) -> None:
    """Assert the strides of the rows, as :func:`~workflow.schemes._fixed.free_motion.lay_out` does for a march."""
    if account is None:
        return
    assert account.modes.shape[1] == ELASTIC + 1
    assert account.contact_inputs.shape[1] == ROW
    assert account.velocity_before.shape[1] == ROW


@inlined
def add_to(row: Array, numbers: Pack, lane: Lane) -> None:
    """Add numbers to a row."""
    store(row, lane, pack(row, lane) + numbers)


@inlined
def count_work(
    account: Account | None,
    step: TipStep,
    end: End,
    thermal_velocity: Pack,
    free: TipInput,
    own: Own,
    tip: Tips,
    lane: Lane,
) -> None:
    """Add a step's friction heat, and the work of load and contact at the tip, to the sums."""
    if account is None:
        return
    sums, relative = account.sums, end.driven - thermal_velocity
    if was_pressed(own, lane):
        heat = friction_heat(own, lane)
        relative -= account.thermal_velocity * heat
        add_to(sums.friction_heat, heat, lane)
        add_to(sums.energy_bound, end.impulse * pack(sums.work_bound, lane), lane)
    before, impulse = pack(sums.relative, lane), account.load_share * free.impulse - end.acting
    store(sums.relative, lane, relative)
    working = fused(spread(account.energy_lever / step.h, lane), relative - before, before)
    store(sums.energy_bound, lane, fused(impulse, working, pack(sums.energy_bound, lane)))
    gain = contact_gain(step, end, impulse, relative - before, free, own, tip, lane)
    add_to(sums.dissipated, fused(impulse, -0.5 * (relative + before), gain), lane)


class Taken(NamedTuple):
    """Energy taken from modes in a step, by damping and by a unit of their inputs."""

    dissipated: Pack
    given: Pack


@inlined
def nothing_taken(lane: Lane) -> Taken:
    """Return the sums before the first mode."""
    return Taken(spread(0.0, lane), spread(0.0, lane))


@inlined
def count_mode(
    account: Account | None,
    dense: Dense | None,
    j: int,
    v: Pack,
    xi: Pack,
    contact: Pack | None,
    taken: Taken,
    lane: Lane,
) -> Taken:
    """Add the energy that damping and a unit of contact took from mode j in a step that ends with v and ξ."""
    if account is None or dense is not None:
        return taken
    return count_inputs(account, account.contact_inputs, j, v, xi, contact, taken, lane)


@inlined
def count_inputs(
    account: Account, inputs: Array, j: int, v: Pack, xi: Pack, times: Pack | None, taken: Taken, lane: Lane
) -> Taken:
    """Add the energy that damping and, where ``times`` is given, a unit of ``inputs`` took from mode j in a step."""
    before = pack(account.velocity_before, (j, lane))
    store(account.velocity_before, (j, lane), v)
    twice = v + before
    dissipated = fused(shared(account.modes, (j, DAMPING), lane) * twice, twice, taken.dissipated)
    if times is None:
        return Taken(dissipated, taken.given)
    given = fused(pack(inputs, (j, lane)), twice, taken.given)
    between = fused(spread(-0.5 * account.h, lane), before, xi)
    pulls = pack(inputs, (account.velocity_before.shape[0] + j, lane))
    return Taken(dissipated, fused(pulls, between, given))


@inlined
def add_modes(account: Account | None, dense: Dense | None, taken: Taken, contact: Pack | None, lane: Lane) -> None:
    """Add the energies of :func:`count_mode`, of all modes, to the sums."""
    if account is None or dense is not None:
        return
    add_dissipation(account, taken, contact, lane)


@inlined
def add_dissipation(account: Account, taken: Taken, times: Pack | None, lane: Lane) -> None:
    """Add the energy that all modes dissipated in a step to the sums, with ``times`` the unit inputs."""
    dissipated = taken.dissipated
    if times is not None:
        dissipated += times * (taken.given + times * pack(account.sums.square, lane))
    add_to(account.sums.dissipated, dissipated, lane)


@inlined
def with_loss(account: Account | None, k: int, tau: Pack, loss: Pack, lane: Lane) -> Pack:
    """Return ``loss`` with the heat loss of thermal mode k at a step's end, W."""
    return loss if account is None else fused(shared(account.losses, (k,), lane), tau, loss)


@inlined
def add_loss(account: Account | None, h: float, loss: Pack, heat: Pack | None, lane: Lane) -> None:
    """Add the heat that all modes lose in h seconds, with that of the contact's ``heat``, to the sums."""
    if account is None:
        return
    loss = plus(loss + pack(account.sums.settled_loss, lane), spread(account.heat_loss, lane), heat)
    add_to(account.sums.lost, h * loss, lane)
    add_to(account.sums.turned_over, magnitude(h * loss), lane)


class Content(NamedTuple):
    """Heat content of cases [J], ``(case,)``."""

    gained: Array
    """H_end - H_0."""
    initial: Array
    """Σ|c T_0|."""
    heating: Array
    """Q = ∫pᵀq."""


def row_totals(terms: Array) -> Array:
    """Return the sum of each row, ``(row,)``, with the same bits for a case alone and among others."""
    return np.asarray(np.ascontiguousarray(terms).sum(axis=1))


def content_of(structure: Structure, cases: Cases, last: Array, elapsed: float) -> Content:
    """Return the heat content of cases with the temperatures ``last`` after ``elapsed`` seconds, K."""
    content, heating = structure.content, structure.uniform_rise * cases.heating
    initial = content * cases.temperature
    return Content(row_totals(content * last - initial), row_totals(np.abs(initial)), elapsed * row_totals(heating))


class Balance(NamedTuple):
    """Balances of cases after their march."""

    totals: Totals
    content: Content
    rest: Array | float = 0.0
    """Energy below which all is rounding, J: the least value of max E."""

    def residuals(self) -> dict[str, Array]:
        """Return ``energy_residual`` and ``heat_residual``, ``(case,)``."""
        totals, content = self.totals, self.content
        change = totals.last_energy - totals.first_energy + totals.dissipated
        friction, heating = totals.friction_heat, content.heating
        gained = content.gained - friction - heating + totals.lost
        turned = friction + np.abs(heating) + totals.turned_over + content.initial
        largest = np.maximum(totals.largest_energy, self.rest)
        return {"energy_residual": ratio(change, largest), "heat_residual": ratio(gained, turned)}


def ratio(part: Array, whole: Array) -> Array:
    """Return part/whole, 0 where the whole is 0."""
    nothing = whole == 0
    return np.where(nothing, 0.0, part / np.where(nothing, 1.0, whole))
