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
from workflow.schemes._lanes import PACK, ROW, WIDE, fill_lanes, lane_rows
from workflow.schemes._modal_lanes import HEAT, PUSHED, by_mode
from workflow.schemes._packs import Lane, Pack, magnitude, narrow, pack, shared, spread, store, where, wide
from workflow.schemes._tip_load import AMPLITUDE, BALANCE_SINE, weigh_load

MODES = 4
"""Mechanical modes of a group, whose forces by heat are summed at once: the registers hold as many sums.
Modes are padded with zeros to whole groups."""

SLOW, PULL, PUSH, STEP, TURN, DAMP, TIP = range(7)
"""Coefficients of a mechanical mode: ζ' - ζ per ζ, per ωη, per tip impulse and per modal force; hω, c,
φ_n. Steps are counted as increments, whose coefficients round relative to h."""

COOL, WARM, LOSS = range(3)
"""Coefficients of a thermal mode: τ' - τ per τ and per unit heat at the tip; its heat loss, W."""

ZETA, PLACE, FORCE, STEADY = range(4)
"""Rows of a mechanical mode's motion: ζ, ωη, the force f̄ - g at the step's beginning, then end, and f̄."""

SPEED, ENERGY, FIRST_ENERGY, LARGEST_ENERGY, SPENT, LEAK, LOST, TURNED, TAKEN = range(9)
"""Rows of a block's sums: tip velocity and energy at the step's end, energy at t = 0 and the largest;
energy spent (the sum above) and, of heat, the loss at the step's end [W], lost, turned over by loss,
and taken in by friction."""

SUM_ROWS = TAKEN + 1


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
    """

    modes: Array
    heat_modes: Array
    coupling: Array
    motion: Array
    heat: Array
    heating: Array
    sums: Array


@inlined
def lay_out_audit(audit: Audit) -> None:
    """Say how far apart rows lie, as :func:`~workflow.schemes._modal_lanes.lay_out` does for a march."""
    assert audit.heat_modes.shape[1] == LOSS + 1
    assert audit.coupling.shape[2] == MODES
    assert audit.motion.shape[1] == STEADY + 1
    assert audit.motion.shape[2] == ROW
    assert audit.heat.shape[1] == ROW
    assert audit.heating.shape[1] == ROW
    assert audit.sums.shape[1] == ROW


@inlined
def forces(coupling: Array, heat: Array, motion: Array, first: int, lane: Lane) -> tuple[Pack, Pack, Pack, Pack]:
    """Return the forces f̄ - g, g = G τ, on the modes of the group that begins with the ``first``."""
    g = first // MODES
    a, b = pack(motion, (first, STEADY, lane)), pack(motion, (first + 1, STEADY, lane))
    c, d = pack(motion, (first + 2, STEADY, lane)), pack(motion, (first + 3, STEADY, lane))
    for k in range(heat.shape[0]):
        tau = pack(heat, (k, lane))
        a -= shared(coupling, (g, k, 0), lane) * tau
        b -= shared(coupling, (g, k, 1), lane) * tau
        c -= shared(coupling, (g, k, 2), lane) * tau
        d -= shared(coupling, (g, k, 3), lane) * tau
    return a, b, c, d


@inlined
def audit_heat(h: float, audit: Audit, own: Array, lane: Lane) -> None:
    """Step the thermal modes and count the heat they take in and lose in a step."""
    heat_modes, heating, heat, sums = audit.heat_modes, audit.heating, audit.heat, audit.sums
    driven = heating.shape[0] > 0
    taken, loss = pack(own, (HEAT, lane)), spread(0.0, lane)
    for k in range(heat.shape[0]):
        before = pack(heat, (k, lane))
        change = shared(heat_modes, (k, COOL), lane) * before + shared(heat_modes, (k, WARM), lane) * taken
        if driven:
            change += pack(heating, (k, lane))
        after = before + change
        store(heat, (k, lane), after)
        loss += shared(heat_modes, (k, LOSS), lane) * after
    lost = 0.5 * h * (pack(sums, (LEAK, lane)) + loss)
    store(sums, (LEAK, lane), loss)
    store(sums, (LOST, lane), pack(sums, (LOST, lane)) + lost)
    store(sums, (TURNED, lane), pack(sums, (TURNED, lane)) + magnitude(lost))
    store(sums, (TAKEN, lane), pack(sums, (TAKEN, lane)) + taken)


@inlined
def keep_energy(energy: Pack, sums: Array, lane: Lane) -> None:
    """Take in the energy at the end of a step; a NaN stays."""
    largest = pack(sums, (LARGEST_ENERGY, lane))
    store(sums, (ENERGY, lane), energy)
    store(sums, (LARGEST_ENERGY, lane), where(energy <= largest, largest, energy))


@inlined
def _account(theta: float, h: float, balance_sine: float, audit: Audit, own: Array, load: Array, lane: Lane) -> None:
    """Step the mechanical modes and count the energy they have and spend."""
    modes, motion, sums = audit.modes, audit.motion, audit.sums
    assert modes.shape[1] == TIP + 1
    pushed, velocity, energy = pack(own, (PUSHED, lane)), spread(0.0, lane), spread(0.0, lane)
    spent = pack(sums, (SPENT, lane))
    for first in range(0, motion.shape[0], MODES):
        group, acting_forces = spread(0.0, lane), forces(audit.coupling, audit.heat, motion, first, lane)
        for i in range(MODES):
            j, force = first + i, acting_forces[i]
            speed, place = pack(motion, (j, ZETA, lane)), pack(motion, (j, PLACE, lane))
            force_before = pack(motion, (j, FORCE, lane))
            acting = theta * force + (1.0 - theta) * force_before
            change = shared(modes, (j, SLOW), lane) * speed + shared(modes, (j, PULL), lane) * place
            change += shared(modes, (j, PUSH), lane) * pushed + shared(modes, (j, STEP), lane) * acting
            after = speed + change
            place += shared(modes, (j, TURN), lane) * (speed + theta * change)
            twice = speed + after
            store(motion, (j, ZETA, lane), after)
            store(motion, (j, PLACE, lane), place)
            store(motion, (j, FORCE, lane), force)
            velocity += shared(modes, (j, TIP), lane) * after
            energy += after * after + place * place
            group += twice * (shared(modes, (j, DAMP), lane) * twice - (force_before + force))
        spent += 0.25 * h * group
    middle = 0.5 * (pack(sums, (SPEED, lane)) + velocity)
    beyond = pack(load, (AMPLITUDE, lane)) * (balance_sine + pack(load, (BALANCE_SINE, lane)))
    store(sums, (SPENT, lane), spent + (h * beyond - pushed) * middle)
    store(sums, (SPEED, lane), velocity)
    keep_energy(0.5 * energy, sums, lane)


@inlined
def _audit(theta: float, h: float, balance_sine: float, audit: Audit, own: Array, load: Array, lane: Lane) -> None:
    """Account for a step of a pack of lanes."""
    if audit.heat.shape[0] > 0:
        audit_heat(h, audit, own, lane)
    _account(theta, h, balance_sine, audit, own, load, lane)


@inlined
def audit_step(theta: float, h: float, leader: int, audit: Audit, own: Array, load: Array, lanes: int) -> None:
    """Account for a step of the θ-method that is done."""
    sine = weigh_load(0.5 - theta, theta - 0.5, BALANCE_SINE, leader, load, lanes)
    wide_lanes = lanes // WIDE * WIDE
    for first in range(0, wide_lanes, WIDE):
        _audit(theta, h, sine, audit, own, load, wide(first))
    for first in range(wide_lanes, lanes, PACK):
        _audit(theta, h, sine, audit, own, load, narrow(first))


def grouped(*rows: Array) -> Array:
    """Return arrays ``(mode, …)`` as one, ``(mode, row, …)``, with zeros for modes that fill up the last group."""
    count = rows[0].shape[0]
    padded = np.zeros((-(-count // MODES) * MODES, len(rows), *rows[0].shape[1:]))
    padded[:count] = by_mode(*rows)
    return padded


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
            -(h * c + h**2 * theta * omega2) / inertia,
            -h * modal.frequency / inertia,
            modal.tip / inertia,
            h / inertia,
            h * modal.frequency,
            c,
            modal.tip,
        )
        heat_modes = by_mode(-h * mu / slow, modal.heat_tip / slow, loss_row)
        coupling = np.zeros((modes.shape[0], mu.size))
        coupling[: omega2.size] = modal.coupling
        place = modal.frequency * project(modal.to_modes, cases.displacement)
        velocity = project(modal.to_modes, cases.velocity)
        tau, heating = project(modal.to_thermal, cases.temperature), project(modal.heat_shapes.T, cases.heating)
        steady = project(modal.shapes.T, cases.steady) - tip_force[:, None] * modal.tip
        force = steady - project(modal.coupling, tau)
        self._motion = grouped(velocity.T, place.T, force.T, steady.T)
        self._heat = np.ascontiguousarray(tau.T)
        self._heating_in_step = (heating * (h / slow)).T[: None if heating.any() else 0]
        energy = 0.5 * project(np.ones((1, c.size)), velocity**2 + place**2)[:, 0]
        self._begun = np.zeros((SUM_ROWS, cases.count))
        self._begun[[ENERGY, FIRST_ENERGY, LARGEST_ENERGY]] = energy
        self._begun[SPEED] = project(modal.tip[None, :], velocity)[:, 0]
        self._begun[LEAK] = project(loss_row[None, :], tau)[:, 0]
        self._content = warmth_row[:, None]
        self._contained = project(warmth_row[None, :], tau)[:, 0]
        self._initial = project(np.abs(warmth_row)[None, :], np.abs(tau))[:, 0]
        self._heating = project(warmth_row[None, :], heating)[:, 0]
        self.audit = Audit(
            modes=modes,
            heat_modes=heat_modes,
            coupling=np.ascontiguousarray(coupling.reshape(modes.shape[0] // MODES, MODES, mu.size).swapaxes(1, 2)),
            motion=lane_rows(*self._motion.shape[:2]),
            heat=lane_rows(self._heat.shape[0]),
            heating=lane_rows(self._heating_in_step.shape[0]),
            sums=lane_rows(SUM_ROWS),
        )
        self.energy_residual, self.heat_residual = np.zeros(cases.count), np.zeros(cases.count)

    @property
    def rows(self) -> int:
        """Rows of lanes that balances add to a step's."""
        modes, rows, _ = self.audit.motion.shape
        return int(modes * rows + self.audit.heat.shape[0] + self.audit.heating.shape[0] + SUM_ROWS)

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
        content = np.sum(self._content * self.audit.heat, axis=0)[:count]
        heating = elapsed * self._heating[part]
        change = content - self._contained[part] - sums[TAKEN] - heating + sums[LOST]
        turned = sums[TAKEN] + np.abs(heating) + sums[TURNED] + self._initial[part]
        self.heat_residual[part] = share(change, turned)


def no_audit() -> Audit:
    """Return what the kernel takes where no balances are asked for."""
    return Audit(
        modes=np.zeros((0, TIP + 1)),
        heat_modes=np.zeros((0, LOSS + 1)),
        coupling=np.zeros((0, 0, MODES)),
        motion=lane_rows(0, STEADY + 1),
        heat=lane_rows(0),
        heating=lane_rows(0),
        sums=lane_rows(0),
    )


def balance_cost(structure: Structure) -> float:
    """Return estimated seconds that balances take per step of a case in a batch, beside the step itself.

    As :func:`workflow.schemes.moreau.cost` has its numbers: 0.5 ns, 0.25 and 0.05 ns for each mechanical
    and thermal mode and 0.02 ns for each pair of them.
    """
    modes, heats = structure.mechanical_size, structure.thermal_size
    return 0.5e-9 + 0.25e-9 * modes + 0.05e-9 * heats + 0.02e-9 * modes * heats


def share(part: Array, whole: Array) -> Array:
    """Return part/whole, 0 where the whole is 0."""
    nothing = whole == 0
    return np.where(nothing, 0.0, part / np.where(nothing, 1.0, whole))
