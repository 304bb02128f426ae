"""What a time-stepping scheme does to energy and heat, counted beside its own steps.

The production states of :mod:`workflow.schemes.moreau` are scaled by the tip and decoupled: they
cannot give an energy. Where balances are asked for, a second set of states follows in plain modal
coordinates, x = Σ φ_j η_j, v = Σ φ_j ζ_j, θ = Σ χ_l τ_l, driven by the impulses p that the
production step found. With G = φᵀ K12 χ, g = G τ, and F the tip load:

    (1 + hθμ) τ' = (1 - h(1-θ)μ) τ + h q_l + χ_ln α p
    (1 + hθc + h²θ²ω²) ζ' = (1 - h(1-θ)c - h²θ(1-θ)ω²) ζ - hω²η + h f̄_j
                            + φ_jn (h F_θ - p) - h (θ g' + (1-θ) g)
    η' = η + h (θ ζ' + (1-θ) ζ)

With midpoint values ζm = (ζ + ζ')/2 and so on, the sum over the steps of

    - F̄ v_n,m h - Σ f̄_j ζm_j h + Σ c_j ζm_j² h + Σ ζm_j g_m,j h + p (v_n + v_n')/2

and ΔE, over the largest E at a step end, is the energy residual: rounding for θ = 1/2, else what the
scheme gives or takes by itself, in each step

    (θ - 1/2) h [v_mᵀ (Δf - C1 Δv - K1 Δx - K12 Δθ) + x_mᵀ K1 Δv].

Contact and tip load are counted together, by the impulse h F_θ - p that the production step took:
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

import numpy as np

from workflow.models import Array, Cases, Structure, project
from workflow.schemes._decoupled import Decoupled
from workflow.schemes._kernel import inlined
from workflow.schemes._lanes import ROW, fill_lanes, lane_rows
from workflow.schemes._modal_lanes import HEAT, MODES, PUSHED, grouped
from workflow.schemes._stepping import AMPLITUDE, OWN_SINE, weigh_load

HEATS = 5
"""Thermal modes of a group: with the coupling of :data:`MODES` mechanical modes to them, as many
coefficients as the registers of a processor hold."""

SLOW, PULL, PUSH, STEP, TURN, DAMP, TIP = range(7)
"""Coefficients of a mechanical mode: ζ' - ζ per ζ, per ωη, per tip impulse and per modal force; hω, c,
φ_n. Steps are counted as increments, whose coefficients round relative to h."""

COOL, WARM, LOSS = range(3)
"""Coefficients of a thermal mode: τ' - τ per τ and per unit heat at the tip; its heat loss, W."""

SPEED, NEW_SPEED, ENERGY, FIRST_ENERGY, LARGEST_ENERGY, SPENT, LEAK, NEW_LEAK, LOST, TURNED, TAKEN = range(11)
"""Rows of a block's sums: tip velocity at the step's beginning and end, energy at its end, at t = 0
and the largest; energy spent (the sum above) and, of heat, the loss at the step's beginning and end
[W], lost, turned over by loss, and taken in by friction."""

SUM_ROWS = TAKEN + 1


class Audit(NamedTuple):
    """Coefficients and states of a block; without rows where no balances are asked for.

    Attributes
    ----------
    modes, heat_modes
        ``(group, coefficient, mode of the group)``.
    coupling
        G, ``(group, thermal group, mode, thermal mode)``.
    motion
        ``(group, row, lane)``: ζ of the group's modes, then ωη, f̄ - g at the step's beginning, f̄ - g, f̄.
    heat, heating
        τ and what heating adds to it in a step, ``(thermal group, mode of the group, lane)``; no groups
        of the latter where nothing heats.
    sums
        ``(row, lane)``, no rows where no balances are asked for.
    """

    modes: Array
    heat_modes: Array
    coupling: Array
    motion: Array
    heat: Array
    heating: Array
    sums: Array


@inlined
def _couple(coupling: Array, heat: Array, motion: Array, lanes: int) -> None:
    """Find the forces f̄ - g at the step's end, g = G τ."""
    assert coupling.shape[2] == MODES
    assert coupling.shape[3] == HEATS
    assert heat.shape[1] == HEATS
    assert heat.shape[2] == ROW
    assert motion.shape[1] == 5 * MODES
    assert motion.shape[2] == ROW
    for g in range(motion.shape[0]):
        for k in range(heat.shape[0]):
            for lane in range(lanes):
                for j in range(MODES):
                    force = motion[g, 3 * MODES + j, lane] if k > 0 else motion[g, 4 * MODES + j, lane]
                    for m in range(HEATS):
                        force -= coupling[g, k, j, m] * heat[k, m, lane]
                    motion[g, 3 * MODES + j, lane] = force


@inlined
def _leak(h: float, heat_modes: Array, heating: Array, heat: Array, own: Array, sums: Array, lanes: int) -> None:
    """Step the thermal modes and count the heat they take in and lose."""
    assert heat_modes.shape[1] == LOSS + 1
    assert heat_modes.shape[2] == HEATS
    assert heat.shape[1] == HEATS
    assert heat.shape[2] == ROW
    assert heating.shape[1] == HEATS
    assert heating.shape[2] == ROW
    assert own.shape[1] == ROW
    assert sums.shape[1] == ROW
    driven = heating.shape[0] > 0
    for g in range(heat.shape[0]):
        for lane in range(lanes):
            taken = own[HEAT, lane]
            loss = sums[NEW_LEAK, lane] if g > 0 else 0.0
            for k in range(HEATS):
                before = heat[g, k, lane]
                change = heat_modes[g, COOL, k] * before + heat_modes[g, WARM, k] * taken
                after = before + (change + heating[g, k, lane] if driven else change)
                heat[g, k, lane] = after
                loss += heat_modes[g, LOSS, k] * after
            sums[NEW_LEAK, lane] = loss
    for lane in range(lanes):
        loss = sums[NEW_LEAK, lane]
        lost = 0.5 * h * (sums[LEAK, lane] + loss)
        sums[LEAK, lane] = loss
        sums[LOST, lane] += lost
        sums[TURNED, lane] += abs(lost)
        sums[TAKEN, lane] += own[HEAT, lane]


@inlined
def _account(
    theta: float, h: float, modes: Array, motion: Array, own: Array, load: Array, sums: Array, lanes: int
) -> None:
    """Step the mechanical modes and count the energy they have and spend."""
    assert modes.shape[1] == TIP + 1
    assert modes.shape[2] == MODES
    assert motion.shape[1] == 5 * MODES
    assert motion.shape[2] == ROW
    assert own.shape[1] == ROW
    assert load.shape[1] == ROW
    assert sums.shape[1] == ROW
    for g in range(motion.shape[0]):
        for lane in range(lanes):
            pushed = own[PUSHED, lane]
            velocity = sums[NEW_SPEED, lane] if g > 0 else 0.0
            energy = sums[ENERGY, lane] if g > 0 else 0.0
            spent = 0.0
            for j in range(MODES):
                speed, place = motion[g, j, lane], motion[g, MODES + j, lane]
                force_before, force = motion[g, 2 * MODES + j, lane], motion[g, 3 * MODES + j, lane]
                acting = theta * force + (1.0 - theta) * force_before
                change = modes[g, SLOW, j] * speed + modes[g, PULL, j] * place
                change += modes[g, PUSH, j] * pushed + modes[g, STEP, j] * acting
                after = speed + change
                place += modes[g, TURN, j] * (speed + theta * change)
                twice = speed + after
                motion[g, j, lane] = after
                motion[g, MODES + j, lane] = place
                motion[g, 2 * MODES + j, lane] = force
                velocity += modes[g, TIP, j] * after
                energy += after * after + place * place
                spent += twice * (modes[g, DAMP, j] * twice - (force_before + force))
            sums[NEW_SPEED, lane] = velocity
            sums[ENERGY, lane] = energy
            sums[SPENT, lane] += 0.25 * h * spent
    sine = weigh_load(0.5 - theta, theta - 0.5, load, lanes)
    for lane in range(lanes):
        middle = 0.5 * (sums[SPEED, lane] + sums[NEW_SPEED, lane])
        beyond = load[AMPLITUDE, lane] * (sine + load[OWN_SINE, lane])
        sums[SPENT, lane] += (h * beyond - own[PUSHED, lane]) * middle
        sums[SPEED, lane] = sums[NEW_SPEED, lane]
        energy, largest = 0.5 * sums[ENERGY, lane], sums[LARGEST_ENERGY, lane]
        sums[ENERGY, lane] = energy
        sums[LARGEST_ENERGY, lane] = largest if energy <= largest else energy  # a NaN stays


@inlined
def audit_heat(h: float, audit: Audit, own: Array, lanes: int) -> None:
    """Account for the heat of a step, and find the forces at its end."""
    if audit.heat.shape[0] > 0:
        _leak(h, audit.heat_modes, audit.heating, audit.heat, own, audit.sums, lanes)
        _couple(audit.coupling, audit.heat, audit.motion, lanes)


@inlined
def audit_step(theta: float, h: float, audit: Audit, own: Array, load: Array, lanes: int) -> None:
    """Account for a step of the θ-method that is done, where balances are asked for."""
    if audit.sums.shape[0] == 0:
        return
    audit_heat(h, audit, own, lanes)
    _account(theta, h, audit.modes, audit.motion, own, load, audit.sums, lanes)


class Books:
    """The balances of a batch: :meth:`open` them for a block, :meth:`close` them after it.

    Attributes
    ----------
    audit
        What the kernel takes; all blocks share its arrays.
    energy_residual, heat_residual
        Of the blocks that are closed, ``(case,)``.
    """

    def __init__(self, structure: Structure, modal: Decoupled, cases: Cases, tip_force: Array, h: float, theta: float):
        omega2, c, mu = modal.frequency**2, modal.damping, modal.rate
        inertia = 1 + h * theta * c + h**2 * theta**2 * omega2
        slow = 1 + h * theta * mu
        warmth_row = structure.content @ modal.heat_shapes if mu.size else np.zeros(0)
        loss_row = structure.loss_row @ modal.heat_shapes if mu.size else np.zeros(0)
        modes = grouped(
            MODES,
            -(h * c + h**2 * theta * omega2) / inertia,
            -h * modal.frequency / inertia,
            modal.tip / inertia,
            h / inertia,
            h * modal.frequency,
            c,
            modal.tip,
        )
        heat_modes = grouped(HEATS, -h * mu / slow, modal.heat_tip / slow, loss_row)
        coupling = np.zeros((modes.shape[0], MODES, heat_modes.shape[0], HEATS))
        coupling.reshape(modes.shape[0] * MODES, heat_modes.shape[0] * HEATS)[: omega2.size, : mu.size] = modal.coupling
        place = modal.frequency * project(modal.to_modes, cases.displacement)
        velocity = project(modal.to_modes, cases.velocity)
        tau, heating = project(modal.to_thermal, cases.temperature), project(modal.heat_shapes.T, cases.heating)
        steady = project(modal.shapes.T, cases.steady) - tip_force[:, None] * modal.tip
        force = steady - project(modal.coupling, tau)
        rows = grouped(MODES, velocity.T, place.T, force.T, force.T, steady.T)
        self._motion = rows.reshape(modes.shape[0], 5 * MODES, cases.count)
        self._heat = grouped(HEATS, tau.T)[:, 0]
        self._heating_in_step = grouped(HEATS, (heating * (h / slow)).T)[: None if heating.any() else 0, 0]
        energy = 0.5 * project(np.ones((1, c.size)), velocity**2 + place**2)[:, 0]
        self._begun = np.zeros((SUM_ROWS, cases.count))
        self._begun[[ENERGY, FIRST_ENERGY, LARGEST_ENERGY]] = energy
        self._begun[SPEED] = project(modal.tip[None, :], velocity)[:, 0]
        self._begun[LEAK] = project(loss_row[None, :], tau)[:, 0]
        self._content = grouped(HEATS, warmth_row)[:, 0, :, None]
        self._contained = project(warmth_row[None, :], tau)[:, 0]
        self._initial = project(np.abs(warmth_row)[None, :], np.abs(tau))[:, 0]
        self._heating = project(warmth_row[None, :], heating)[:, 0]
        self.audit = Audit(
            modes=modes,
            heat_modes=heat_modes,
            coupling=np.ascontiguousarray(coupling.swapaxes(1, 2)),
            motion=lane_rows(*self._motion.shape[:2]),
            heat=lane_rows(*self._heat.shape[:2]),
            heating=lane_rows(*self._heating_in_step.shape[:2]),
            sums=lane_rows(SUM_ROWS),
        )
        self.energy_residual, self.heat_residual = np.zeros(cases.count), np.zeros(cases.count)

    @property
    def residuals(self) -> dict[str, Array]:
        """The metrics that the balances give."""
        return {"energy_residual": self.energy_residual, "heat_residual": self.heat_residual}

    def open(self, part: slice) -> None:
        """Put the initial states of some cases in the lanes."""
        fill_lanes(self.audit.motion, self._motion[..., part])
        fill_lanes(self.audit.heat, self._heat[..., part])
        fill_lanes(self.audit.heating, self._heating_in_step[..., part])
        fill_lanes(self.audit.sums, self._begun[:, part])

    def close(self, part: slice, elapsed: float) -> None:
        """Take the balances of the lanes after ``elapsed`` seconds."""
        count = part.stop - part.start
        sums = self.audit.sums[:, :count]
        change = sums[ENERGY] - sums[FIRST_ENERGY] + sums[SPENT]
        self.energy_residual[part] = share(change, sums[LARGEST_ENERGY])
        # in the same order whatever lanes are in use
        content = np.sum(self._content * self.audit.heat, axis=(0, 1))[:count]
        heating = elapsed * self._heating[part]
        change = content - self._contained[part] - sums[TAKEN] - heating + sums[LOST]
        turned = sums[TAKEN] + np.abs(heating) + sums[TURNED] + self._initial[part]
        self.heat_residual[part] = share(change, turned)


def no_audit() -> Audit:
    """Return what the kernel takes where no balances are asked for."""
    return Audit(
        modes=np.zeros((0, 7, MODES)),
        heat_modes=np.zeros((0, 3, HEATS)),
        coupling=np.zeros((0, 0, MODES, HEATS)),
        motion=lane_rows(0, 5 * MODES),
        heat=lane_rows(0, HEATS),
        heating=lane_rows(0, HEATS),
        sums=lane_rows(0),
    )


def balance_cost(structure: Structure) -> float:
    """Return estimated seconds that balances take per step of a case in a batch, beside the step itself.

    As :func:`workflow.schemes.moreau.cost` has its numbers: 0.5 ns, 2.2 and 0.3 ns for each group of
    mechanical and thermal modes and 0.45 ns for each pair of groups.
    """
    modes, heats = -(-structure.mechanical_size // MODES), -(-structure.thermal_size // HEATS)
    return 0.5e-9 + 2.2e-9 * modes + 0.3e-9 * heats + 0.45e-9 * modes * heats


def share(part: Array, whole: Array) -> Array:
    """Return part/whole, 0 where the whole is 0."""
    nothing = whole == 0
    return np.where(nothing, 0.0, part / np.where(nothing, 1.0, whole))
