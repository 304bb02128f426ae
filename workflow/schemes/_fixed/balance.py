"""What a time-stepping scheme does to energy and heat, counted beside its own steps.

The states that a scheme steps are scaled by the tip and decoupled: they
cannot give an energy. Where balances are asked for, a second set of states follows in plain modal
coordinates, x = Σ φ_j η_j, v = Σ φ_j ζ_j, θ = Σ χ_l τ_l, driven by the impulses p that the
scheme's own step gave. With G = φᵀ K12 χ, g = G τ, and F the tip load:

    (1 + hθμ) τ' = (1 - h(1-θ)μ) τ + h q_l + χ_ln α p
    (1 + hθc + h²θ²ω²) ζ' = (1 - h(1-θ)c - h²θ(1-θ)ω²) ζ - hω²η + h f̄_j
                            + φ_jn (h F_θ - p) - h (θ g' + (1-θ) g)
    η' = η + h (θ ζ' + (1-θ) ζ)

With midpoint values ζm = (ζ + ζ')/2 and so on, the sum over the steps of

    - F̄ v_n,m h - Σ f̄_j ζm_j h + Σ c_j ζm_j² h + Σ ζm_j g_m,j h + p (v_n + v_n')/2

and ΔE, over the largest E at a step end, is the energy residual: rounding for θ = 1/2, else what the
scheme gives or takes by itself, in each step

    (θ - 1/2) h [v_mᵀ (Δf - C1 Δv - K1 Δx - K12 Δθ) + x_mᵀ K1 Δv].

Contact and tip load are counted together, by the impulse h F_θ - p of the scheme's own step:
(p - h F̄) v_n,m = [h (F_θ - F̄) - (h F_θ - p)] v_n,m.

The heat residual compares the change of the content H = Σ c_i θ_i with αJ + ∫Σq - ∫L(θ) dt, the
loss L = κ_1 θ_1 + Σ b_i θ_i by its midpoint values, over the heat turned over
|αJ| + |∫Σq| + ∫|L| dt + Σ_l |content of thermal mode l at t = 0|. A full model leaves
-(θ - 1/2) h [L(end) - L(0)], zero but for rounding at θ = 1/2. A reduced model adds what its basis
loses: no combination of its equations gives the sum over the nodes unless a uniform temperature
lies in the basis. Σq is taken as far as the basis holds a uniform temperature.

The balances run over whole steps: from t = 0 to the end of the last step, which lies at the duration
or, where the duration is no multiple of h, up to one step beyond it.
"""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels.compiled import by_type, inlined
from workflow.kernels.lanes import PACK, ROW, WIDE
from workflow.kernels.packs import Lane, Pack, magnitude, narrow, pack, shared, spread, store, where, wide
from workflow.models import Array
from workflow.schemes._fixed.contact import CASE_HEAT, CASE_IMPULSE, Law, TipStep
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.stepping import Now
from workflow.schemes._fixed.tip_load import LOAD_AMPLITUDE, LOAD_BALANCE_SINE, weigh_load

GROUP = 4
"""Mechanical modes of a group, whose forces by heat are summed at once: the registers hold as many sums.
Modes are padded with zeros to whole groups."""

AUDIT_MODE_ZETA, AUDIT_MODE_PLACE, AUDIT_MODE_IMPULSE, AUDIT_MODE_FORCE = range(4)
"""Coefficients of a mechanical mode: ζ' - ζ per ζ, per ωη, per tip impulse and per modal force. Steps are counted as
increments, whose coefficients round relative to h."""

AUDIT_MODE_TURN, AUDIT_MODE_DAMPING, AUDIT_MODE_TIP, AUDIT_MODE_MASS = range(4, 8)
"""hω, c, φ_n, and 1, or 0 of the static deformation of a tip without mass."""

AUDIT_HEAT_CHANGE, AUDIT_HEAT_INPUT, AUDIT_HEAT_LOSS = range(3)
"""Coefficients of a thermal mode: τ' - τ per τ and per unit heat at the tip; its heat loss, W."""

AUDIT_ZETA, AUDIT_PLACE, AUDIT_FORCE, AUDIT_STEADY = range(4)
"""Rows of a mechanical mode's motion: ζ, ωη, the force f̄ - g at the step's beginning, then end, and f̄."""

SUM_VELOCITY, SUM_ENERGY, SUM_FIRST_ENERGY, SUM_LARGEST_ENERGY, SUM_SPENT = range(5)
"""Rows of a block's sums: tip velocity and energy at the step's end, energy at t = 0 and the largest; energy spent
(the sum above)."""

SUM_LOSS_RATE, SUM_LOST, SUM_TURNED_OVER, SUM_FRICTION_HEAT, SUM_POWER = range(5, 10)
"""Heat loss at the step's end [W]; heat lost, turned over by loss, and taken in by friction [J]; of central
differences, the energy spent in the step about t_k [J]."""

SUM_ROWS = SUM_POWER + 1


class Audit(NamedTuple):
    """Coefficients and states of a block; without rows where no balances are asked for.

    Attributes
    ----------
    modes
        ``(mode, coefficient)``, padded to whole groups.
    heat_modes
        ``(thermal mode, coefficient)``.
    coupling
        G, ``(group, thermal mode, mode of the group)``.
    motion
        ``(mode, row, lane)``, padded to whole groups.
    heat, heating
        τ and what heating adds to it in a step, ``(thermal mode, lane)``; no rows of the latter where
        nothing heats.
    sums
        ``(row, lane)``, no rows where no balances are asked for.
    stored_end
        Whether it reads the tip's state at the step's end, which is stored then.
    """

    modes: Array
    heat_modes: Array
    coupling: Array
    motion: Array
    heat: Array
    heating: Array
    sums: Array
    stored_end: bool


@inlined
def lay_out_audit(audit: Audit) -> None:
    """Assert how far apart rows lie, as :func:`~workflow.schemes._fixed.modal_lanes.lay_out` does for a march."""
    assert audit.heat_modes.shape[1] == AUDIT_HEAT_LOSS + 1
    assert audit.coupling.shape[2] == GROUP
    assert audit.motion.shape[1] == AUDIT_STEADY + 1
    assert audit.motion.shape[2] == ROW
    assert audit.heat.shape[1] == ROW
    assert audit.heating.shape[1] == ROW
    assert audit.sums.shape[1] == ROW


@inlined
def forces(coupling: Array, heat: Array, motion: Array, first: int, lane: Lane) -> tuple[Pack, Pack, Pack, Pack]:
    """Return the forces f̄ - g, g = G τ, on the modes of the group that begins with the ``first``."""
    g = first // GROUP
    a, b = pack(motion, (first, AUDIT_STEADY, lane)), pack(motion, (first + 1, AUDIT_STEADY, lane))
    c, d = pack(motion, (first + 2, AUDIT_STEADY, lane)), pack(motion, (first + 3, AUDIT_STEADY, lane))
    for k in range(heat.shape[0]):
        tau = pack(heat, (k, lane))
        a -= shared(coupling, (g, k, 0), lane) * tau
        b -= shared(coupling, (g, k, 1), lane) * tau
        c -= shared(coupling, (g, k, 2), lane) * tau
        d -= shared(coupling, (g, k, 3), lane) * tau
    return a, b, c, d


@inlined
def audit_heat(h: float, audit: Audit, own: Array, lane: Lane) -> None:
    """Step the thermal modes and add the heat of friction and the heat lost in a step to the sums."""
    heat_modes, heating, heat, sums = audit.heat_modes, audit.heating, audit.heat, audit.sums
    driven = heating.shape[0] > 0
    taken, loss = pack(own, (CASE_HEAT, lane)), spread(0.0, lane)
    for k in range(heat.shape[0]):
        before = pack(heat, (k, lane))
        change = (
            shared(heat_modes, (k, AUDIT_HEAT_CHANGE), lane) * before
            + shared(heat_modes, (k, AUDIT_HEAT_INPUT), lane) * taken
        )
        if driven:
            change += pack(heating, (k, lane))
        after = before + change
        store(heat, (k, lane), after)
        loss += shared(heat_modes, (k, AUDIT_HEAT_LOSS), lane) * after
    lost = 0.5 * h * (pack(sums, (SUM_LOSS_RATE, lane)) + loss)
    store(sums, (SUM_LOSS_RATE, lane), loss)
    store(sums, (SUM_LOST, lane), pack(sums, (SUM_LOST, lane)) + lost)
    store(sums, (SUM_TURNED_OVER, lane), pack(sums, (SUM_TURNED_OVER, lane)) + magnitude(lost))
    store(sums, (SUM_FRICTION_HEAT, lane), pack(sums, (SUM_FRICTION_HEAT, lane)) + taken)


@inlined
def store_energy(energy: Pack, sums: Array, lane: Lane) -> None:
    """Store the energy at the end of a step and the largest one; a NaN stays."""
    largest = pack(sums, (SUM_LARGEST_ENERGY, lane))
    store(sums, (SUM_ENERGY, lane), energy)
    store(sums, (SUM_LARGEST_ENERGY, lane), where(energy <= largest, largest, energy))


@inlined
def _account(theta: float, h: float, balance_sine: float, audit: Audit, own: Array, load: Array, lane: Lane) -> None:
    """Step the mechanical modes and count the energy they have and spend."""
    modes, motion, sums = audit.modes, audit.motion, audit.sums
    assert modes.shape[1] == AUDIT_MODE_MASS + 1
    pushed, velocity, energy = pack(own, (CASE_IMPULSE, lane)), spread(0.0, lane), spread(0.0, lane)
    spent = pack(sums, (SUM_SPENT, lane))
    for first in range(0, motion.shape[0], GROUP):
        group, acting_forces = spread(0.0, lane), forces(audit.coupling, audit.heat, motion, first, lane)
        for i in range(GROUP):
            j, force = first + i, acting_forces[i]
            speed, place = pack(motion, (j, AUDIT_ZETA, lane)), pack(motion, (j, AUDIT_PLACE, lane))
            force_before = pack(motion, (j, AUDIT_FORCE, lane))
            acting = theta * force + (1.0 - theta) * force_before
            change = (
                shared(modes, (j, AUDIT_MODE_ZETA), lane) * speed + shared(modes, (j, AUDIT_MODE_PLACE), lane) * place
            )
            change += (
                shared(modes, (j, AUDIT_MODE_IMPULSE), lane) * pushed
                + shared(modes, (j, AUDIT_MODE_FORCE), lane) * acting
            )
            after = speed + change
            place += shared(modes, (j, AUDIT_MODE_TURN), lane) * (speed + theta * change)
            twice = speed + after
            store(motion, (j, AUDIT_ZETA, lane), after)
            store(motion, (j, AUDIT_PLACE, lane), place)
            store(motion, (j, AUDIT_FORCE, lane), force)
            velocity += shared(modes, (j, AUDIT_MODE_TIP), lane) * after
            energy += shared(modes, (j, AUDIT_MODE_MASS), lane) * (after * after) + place * place
            group += twice * (shared(modes, (j, AUDIT_MODE_DAMPING), lane) * twice - (force_before + force))
        spent += 0.25 * h * group
    middle = 0.5 * (pack(sums, (SUM_VELOCITY, lane)) + velocity)
    beyond = pack(load, (LOAD_AMPLITUDE, lane)) * (balance_sine + pack(load, (LOAD_BALANCE_SINE, lane)))
    store(sums, (SUM_SPENT, lane), spent + (h * beyond - pushed) * middle)
    store(sums, (SUM_VELOCITY, lane), velocity)
    store_energy(0.5 * energy, sums, lane)


@inlined
def _audit(theta: float, h: float, balance_sine: float, audit: Audit, own: Array, load: Array, lane: Lane) -> None:
    """Account for a step of a pack of lanes."""
    if audit.heat.shape[0] > 0:
        audit_heat(h, audit, own, lane)
    _account(theta, h, balance_sine, audit, own, load, lane)


@inlined
def audit_theta(step: TipStep, now: Now, audit: Audit, own: Array, block: Block) -> None:
    """Account for a step of the θ-method that is done."""
    h, theta, load, lanes = step.h, step.theta, block.load, block.lanes
    sine = weigh_load(0.5 - theta, theta - 0.5, LOAD_BALANCE_SINE, now.leader, load, lanes)
    wide_lanes = lanes // WIDE * WIDE
    for first in range(0, wide_lanes, WIDE):
        _audit(theta, h, sine, audit, own, load, wide(first))
    for first in range(wide_lanes, lanes, PACK):
        _audit(theta, h, sine, audit, own, load, narrow(first))


@by_type
def audit_step(law: Law, step: TipStep, now: Now, audit: Audit, own: Array, block: Block) -> None:
    """Account for a step that is done: of the θ-method where a contact law does not say otherwise."""
    audit_theta(step, now, audit, own, block)
