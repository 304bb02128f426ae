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
    LARGEST_ENERGY,
    NEW_SPEED,
    SPEED,
    SPENT,
    Audit,
    Books,
)
from workflow.schemes._decoupled import Decoupled
from workflow.schemes._kernel import inlined
from workflow.schemes._lanes import ROW
from workflow.schemes._modal_lanes import MODES, PUSHED, grouped
from workflow.schemes._stepping import GAP, NEW_DISPLACEMENT, NEW_VELOCITY

FACTOR, STEP, OMEGA, DAMP_BEFORE, DAMP_AFTER, TIP = range(6)
"""Coefficients of a mechanical mode: w_k+½ per w_k-½ and per modal impulse; ω; what w_k-½ and w_k+½ add
to C1 v; φ_n."""

POWER = SPEED
"""Row of the energy spent in a step about t_k, J; that about t_k-1 until it is replaced."""


@inlined
def account(step: int, h: float, stiffness: float, audit: Audit, own: Array, tip: Array, lanes: int) -> None:
    """Step the mechanical modes from t_k-½ to t_k+½ and count the energy they have and spend at t_k."""
    modes, motion, sums = audit.modes, audit.motion, audit.sums
    assert modes.shape[1] == TIP + 1
    assert modes.shape[2] == MODES
    assert motion.shape[1] == 5 * MODES
    assert motion.shape[2] == ROW
    assert own.shape[1] == ROW
    assert sums.shape[1] == ROW
    for g in range(motion.shape[0]):
        for lane in range(lanes):
            pushed = own[PUSHED, lane]
            spent = sums[NEW_SPEED, lane] if g > 0 else 0.0
            energy = sums[ENERGY, lane] if g > 0 else 0.0
            for j in range(MODES):
                before, place = motion[g, j, lane], motion[g, MODES + j, lane]
                steady = motion[g, 3 * MODES + j, lane]
                force = modes[g, TIP, j] * pushed + h * (steady - modes[g, OMEGA, j] * place)
                after = modes[g, FACTOR, j] * before + modes[g, STEP, j] * force
                speed = 0.5 * (before + after)
                drag = modes[g, DAMP_BEFORE, j] * before + modes[g, DAMP_AFTER, j] * after
                spent += speed * (h * (drag - steady) - modes[g, TIP, j] * pushed)
                energy += speed * speed + place * place
                motion[g, j, lane] = after
                motion[g, MODES + j, lane] = place + h * (modes[g, OMEGA, j] * after)
            sums[NEW_SPEED, lane] = spent
            sums[ENERGY, lane] = energy
    for lane in range(lanes):
        depth = max(0.0, tip[NEW_DISPLACEMENT, lane] - tip[GAP, lane])
        spent = sums[NEW_SPEED, lane] - h * stiffness * depth * tip[NEW_VELOCITY, lane]
        energy = 0.5 * (sums[ENERGY, lane] + stiffness * depth * depth)
        largest = sums[LARGEST_ENERGY, lane]
        sums[ENERGY, lane] = energy
        if step > 0:
            sums[SPENT, lane] += 0.5 * (sums[POWER, lane] + spent)
            sums[LARGEST_ENERGY, lane] = largest if energy <= largest else energy  # a NaN stays
        sums[POWER, lane] = spent


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
        modes = grouped(MODES, factor, 1 / inertia, modal.frequency, c - after, after, modal.tip)
        self.audit = self.audit._replace(modes=modes)
        self._motion[:, :MODES] = grouped(MODES, half.T)[:, 0]
