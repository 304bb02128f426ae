"""What central differences do to energy and heat, counted beside their own steps.

As for the θ-method (:mod:`workflow.schemes._fixed.balance`), a second set of states follows in plain modal
coordinates, driven by the impulses p_k of the scheme's own step. Velocities are central,
v_k = (w_k-½ + w_k+½)/2, and power is taken where the forces act, at the step ends: the sum

    Σ h [v_kᵀ C1 v_k + v_kᵀ K12 θ_k - f_kᵀ v_k] + Σ p_k v_n,k,    first and last term by halves,

p_0 whole, and ΔE with E = ½ vᵀMv + ½ xᵀK1x at the step ends, over the largest E, is the energy residual.
Central differences conserve Σ ½ w_k+½² + ½ ω² η_k η_k+1 instead of E (free, undamped): the residual
swings by a share of (ωh)² and does not drift. The loss of an impulse is p (v_n⁻ + v_n⁺)/2 exactly. Lagged
damping spends v_kᵀ C1 w_k-½. A contact spring κ belongs to E, with ½ κ (x_n - d)² where x_n > d, and its
force is no loss: what contact gives because its step is too long is seen. Heat is counted as for
the θ-method, with θ = 0 where it is explicit and 1 where implicit.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels.compiled import defines, inlined
from workflow.kernels.lanes import PACK, WIDE
from workflow.kernels.packs import Lane, Pack, narrow, of_lane, pack, shared, spread, store, where, wide
from workflow.models import Array, Cases
from workflow.schemes._fixed.balance import (
    AUDIT_FORCE,
    AUDIT_PLACE,
    AUDIT_ZETA,
    GROUP,
    SUM_ENERGY,
    SUM_POWER,
    SUM_SPENT,
    Audit,
    audit_heat,
    audit_step,
    forces,
    store_energy,
)
from workflow.schemes._fixed.books import Books, grouped
from workflow.schemes._fixed.central import Linear, Operator
from workflow.schemes._fixed.contact import CASE_IMPULSE, CASE_LAST, TipStep
from workflow.schemes._fixed.marks import TIP_GAP, TIP_NEW_DISPLACEMENT, TIP_NEW_VELOCITY, Block
from workflow.schemes._fixed.stepping import Now

CENTRAL_FACTOR, CENTRAL_FORCE, CENTRAL_OMEGA, CENTRAL_DAMPING_BEFORE, CENTRAL_DAMPING_AFTER, CENTRAL_TIP = range(6)
"""Coefficients of a mechanical mode ``(mode, coefficient)``: w_k+½ per w_k-½ and per modal impulse; ω; what w_k-½ and
w_k+½ add to C1 v; φ_n."""


@inlined
def _first_forces(motion: Array, first: int, lane: Lane) -> tuple[Pack, Pack, Pack, Pack]:
    """Return the forces f̄ - g at t = 0 on the modes of the group that begins with the ``first``."""
    return (
        pack(motion, (first, AUDIT_FORCE, lane)),
        pack(motion, (first + 1, AUDIT_FORCE, lane)),
        pack(motion, (first + 2, AUDIT_FORCE, lane)),
        pack(motion, (first + 3, AUDIT_FORCE, lane)),
    )


@inlined
def _move_modes(opening: bool, h: float, audit: Audit, impulse: Pack, lane: Lane) -> tuple[Pack, Pack]:
    """Step the mechanical modes from t_k-½ to t_k+½; return the energy they spend about t_k and twice what they hold.

    ``opening`` tells the step at t = 0; ``impulse`` is that of load and contact.
    """
    modes, motion = audit.modes, audit.motion
    assert modes.shape[1] == CENTRAL_TIP + 1
    spent, energy = spread(0.0, lane), spread(0.0, lane)
    for first in range(0, motion.shape[0], GROUP):
        if opening:
            acting = _first_forces(motion, first, lane)
        else:
            acting = forces(audit.coupling, audit.heat, motion, first, lane)
        for i in range(GROUP):
            j, steady = first + i, acting[i]
            before, place = pack(motion, (j, AUDIT_ZETA, lane)), pack(motion, (j, AUDIT_PLACE, lane))
            tip, omega = shared(modes, (j, CENTRAL_TIP), lane), shared(modes, (j, CENTRAL_OMEGA), lane)
            force = tip * impulse + h * (steady - omega * place)
            after = shared(modes, (j, CENTRAL_FACTOR), lane) * before + shared(modes, (j, CENTRAL_FORCE), lane) * force
            speed = 0.5 * (before + after)
            drag = shared(modes, (j, CENTRAL_DAMPING_BEFORE), lane) * before
            drag += shared(modes, (j, CENTRAL_DAMPING_AFTER), lane) * after
            spent += speed * (h * (drag - steady) - tip * impulse)
            energy += speed * speed + place * place
            store(motion, (j, AUDIT_ZETA, lane), after)
            store(motion, (j, AUDIT_PLACE, lane), place + h * (omega * after))
    return spent, energy


@inlined
def account(opening: bool, h: float, stiffness: Pack, audit: Audit, own: Array, tip: Array, lane: Lane) -> None:
    """Count the energy at t_k, that of the contact spring included, and what is spent about t_k.

    ``opening`` tells the step at t = 0, in which p_0 counts whole.
    """
    sums, v = audit.sums, pack(tip, (TIP_NEW_VELOCITY, lane))
    spent, energy = _move_modes(opening, h, audit, pack(own, (CASE_IMPULSE, lane)), lane)
    depth = pack(tip, (TIP_NEW_DISPLACEMENT, lane)) - pack(tip, (TIP_GAP, lane))
    depth = where(depth > 0.0, depth, 0.0)
    spent -= h * stiffness * depth * v
    energy = 0.5 * (energy + stiffness * depth * depth)
    if opening:
        store(sums, (SUM_ENERGY, lane), energy)
        store(sums, (SUM_POWER, lane), spent + pack(own, (CASE_LAST, lane)) * v)
    else:
        power = 0.5 * (pack(sums, (SUM_POWER, lane)) + spent)
        store(sums, (SUM_SPENT, lane), pack(sums, (SUM_SPENT, lane)) + power)
        store_energy(energy, sums, lane)
        store(sums, (SUM_POWER, lane), spent)


@inlined
def _audit(last: bool, h: float, stiffness: Pack, audit: Audit, own: Array, tip: Array, lane: Lane) -> None:
    """Account for t_k, then for the heat of the step from there on, if there is one."""
    account(False, h, stiffness, audit, own, tip, lane)
    if audit.heat.shape[0] > 0 and not last:
        audit_heat(h, audit, own, lane)


@defines(audit_step, Linear)
def audit_central(law: Linear, step: TipStep, now: Now, audit: Audit, own: Array, block: Block) -> None:
    """Account for a step of central differences."""
    h, tip, lanes = step.h, block.tip, block.lanes
    wide_lanes = lanes // WIDE * WIDE
    for first in range(0, wide_lanes, WIDE):
        _audit(now.last, h, of_lane(law.stiffness, wide(first)), audit, own, tip, wide(first))
    for first in range(wide_lanes, lanes, PACK):
        _audit(now.last, h, of_lane(law.stiffness, narrow(first)), audit, own, tip, narrow(first))


class CentralBooks(Books):
    """The balances of a batch stepped by central differences, from the modal w_-½, ``half`` ``(case, mode)``."""

    def __init__(self, operator: Operator, cases: Cases, tip_force: Array, half: Array) -> None:
        h, modal, differences = operator.h, operator.modal, operator.differences
        super().__init__(operator.structure, modal, cases, tip_force, h, float(differences.implicit_heat))
        inertia, factor = differences.damped(h, modal.damping)
        c = modal.damping
        after = np.where(inertia == 1, 0.0, c / 2)
        modes = grouped(factor, 1 / inertia, modal.frequency, c - after, after, modal.tip)
        self.audit = self.audit._replace(modes=modes, stored_end=True)
        self._motion[: c.size, AUDIT_ZETA] = half.T
