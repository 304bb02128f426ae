"""What central differences do to energy and heat, counted beside their own steps.

As for the θ-method (:mod:`workflow.schemes._balance`), a second set of states follows in plain modal
coordinates, driven by the impulses p_k that the production step found. Velocities are central,
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

from workflow.models import Array, Cases, Structure
from workflow.schemes._balance import (
    ENERGY,
    FORCE,
    PLACE,
    SPEED,
    SPENT,
    ZETA,
    Audit,
    Books,
    forces,
    grouped,
    keep_energy,
)
from workflow.schemes._balance import MODES as GROUP
from workflow.schemes._decoupled import Decoupled
from workflow.schemes._kernel import inlined
from workflow.schemes._modal_lanes import PUSHED
from workflow.schemes._packs import Lane, Pack, pack, shared, spread, store, where

FACTOR, STEP, OMEGA, DAMP_BEFORE, DAMP_AFTER, TIP = range(6)
"""Coefficients of a mechanical mode: w_k+½ per w_k-½ and per modal impulse; ω; what w_k-½ and w_k+½ add
to C1 v; φ_n."""

POWER = SPEED
"""Row of the energy spent in a step about t_k, J; that about t_k-1 until it is replaced."""


@inlined
def begun(motion: Array, first: int, lane: Lane) -> tuple[Pack, Pack, Pack, Pack]:
    """Return the forces f̄ - g at t = 0 on the modes of the group that begins with the ``first``."""
    return (
        pack(motion, (first, FORCE, lane)),
        pack(motion, (first + 1, FORCE, lane)),
        pack(motion, (first + 2, FORCE, lane)),
        pack(motion, (first + 3, FORCE, lane)),
    )


@inlined
def account(
    step: int, h: float, stiffness: float, audit: Audit, own: Array, x: Pack, v: Pack, gap: Pack, lane: Lane
) -> None:
    """Step the mechanical modes from t_k-½ to t_k+½ and count the energy they have and spend at t_k.

    ``x`` and ``v`` are the tip's at t_k, ``gap`` is the casing's place.
    """
    modes, motion, sums = audit.modes, audit.motion, audit.sums
    assert modes.shape[1] == TIP + 1
    pushed, spent, energy = pack(own, (PUSHED, lane)), spread(0.0, lane), spread(0.0, lane)
    for first in range(0, motion.shape[0], GROUP):
        acting = forces(audit.coupling, audit.heat, motion, first, lane) if step > 0 else begun(motion, first, lane)
        for i in range(GROUP):
            j, steady = first + i, acting[i]
            before, place = pack(motion, (j, ZETA, lane)), pack(motion, (j, PLACE, lane))
            force = shared(modes, (j, TIP), lane) * pushed + h * (steady - shared(modes, (j, OMEGA), lane) * place)
            after = shared(modes, (j, FACTOR), lane) * before + shared(modes, (j, STEP), lane) * force
            speed = 0.5 * (before + after)
            drag = shared(modes, (j, DAMP_BEFORE), lane) * before + shared(modes, (j, DAMP_AFTER), lane) * after
            spent += speed * (h * (drag - steady) - shared(modes, (j, TIP), lane) * pushed)
            energy += speed * speed + place * place
            store(motion, (j, ZETA, lane), after)
            store(motion, (j, PLACE, lane), place + h * (shared(modes, (j, OMEGA), lane) * after))
    depth = x - gap
    depth = where(depth > 0.0, depth, 0.0)
    spent -= h * stiffness * depth * v
    energy = 0.5 * (energy + stiffness * depth * depth)
    if step > 0:
        power = 0.5 * (pack(sums, (POWER, lane)) + spent)
        store(sums, (SPENT, lane), pack(sums, (SPENT, lane)) + power)
        keep_energy(energy, sums, lane)
    else:
        store(sums, (ENERGY, lane), energy)
    store(sums, (POWER, lane), spent)


class CentralBooks(Books):
    """The balances of a batch stepped by central differences.

    Parameters
    ----------
    structure, modal, cases, tip_force, h
        As for :class:`~workflow.schemes._balance.Books`.
    implicit_heat
        Weight of the step's end in the heat step, 0 or 1.
    half
        Modal w_-½, ``(case, mode)``.
    inertia, factor
        1 + hc/2 of each mode, or 1 with lagged damping, and the factor of w_k-½.
    """

    def __init__(
        self,
        structure: Structure,
        modal: Decoupled,
        cases: Cases,
        tip_force: Array,
        h: float,
        implicit_heat: float,
        half: Array,
        inertia: Array,
        factor: Array,
    ) -> None:
        super().__init__(structure, modal, cases, tip_force, h, implicit_heat)
        c = modal.damping
        after = np.where(inertia == 1, 0.0, c / 2)
        modes = grouped(factor, 1 / inertia, modal.frequency, c - after, after, modal.tip)
        self.audit = self.audit._replace(modes=modes)
        self._motion[: c.size, ZETA] = half.T
