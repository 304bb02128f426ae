"""Balances of energy and heat of the event-driven scheme, taken after its march.

    energy_residual = (ΔE + ∫D dt + E_lost)/max E,   E = Σ (y'² + ω² y²)/2,
    heat_residual   = (ΔQ + ∫L dt - α J - ∫q dt)/(∫|L| dt + α J + |∫q dt| + Σ|Q(0)|),   Q = cᵀ θ,

with D = -∇E · X' the power that leaves the energy by the structure's own matrices, L the heat loss, J the impulse and
E_lost what impacts take, p (v⁻ + v⁺)/2 with v⁺ as the contact law gives it. An impact changes E by p (v⁻ + v⁺)/2 with
the v⁺ of the modes, so that p times half the difference is left of it (:mod:`workflow.schemes._exact.impacts`).

Some phases between two events are gone through once more, from the state in which they began to their end at once. With
that motion, X' = R,

    ∫D dt = -ΔE + ∫∇E · (R - X') dt,

where ΔE is known in closed form, and the last term is what the motion and the matrices disagree about, rounding where
the regime is right. These phases are all contacts, all flights from contacts and one in sixteen others
(:mod:`workflow.schemes._exact.phase_log`); the power that is found in a flight counts up to the next of these. ∫L dt is
that of an output of the regime, in flights as the march goes. The largest E is that of ends of these phases and of
some steps. Modes that the held tip does not feel are left out where a contact with friction heat begins (see
:func:`~workflow.schemes._exact.regimes.linked`): their energy is part of E_lost.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels.compiled import part
from workflow.kernels.sums import product
from workflow.models import Array, Structure
from workflow.schemes._exact.impacts import Case
from workflow.schemes._exact.layout import Layout, Load, Memory
from workflow.schemes._exact.modal_system import Basis, ModalSystem, state_space
from workflow.schemes._exact.motion import Motion, advance, copy_state, integral, to_rates
from workflow.schemes._exact.passage import Motions, fill_modal, motions_of, multiply, set_free, set_held
from workflow.schemes._exact.phase_log import Log, note_energy
from workflow.schemes._exact.regimes import linked
from workflow.schemes._exact.tables import block, first, wave
from workflow.schemes._exact.waves import wave_phase

_EVALUATED_AT = 1 / 16
"""When the power is evaluated, in shares of a phase."""


class Matrices(NamedTuple):
    """A regime's system z'' = A X + B w by the structure's matrices, X = [z, z', τ]."""

    motion: Array
    """Aᵀ, ``(N, mode)``."""
    force: Array
    """Bᵀ, ``(input, mode)``; inputs as in :class:`~workflow.schemes._exact.regimes.Regime`."""


class Side(NamedTuple):
    """A regime with the heat loss as its signal, and what it is the motion of."""

    layout: Layout
    matrices: Matrices


class Regimes(NamedTuple):
    """Both regimes of a case."""

    free: Side
    held: Side
    reduced: bool
    """Whether the held regime leaves modes out, see :func:`~workflow.schemes._exact.regimes.linked`."""
    rates: Array
    """Derivatives of coordinates and of [z, z', τ], ``(2, N)``; scratch."""


def matrices(system: ModalSystem) -> Matrices:
    """Return the matrices of a system."""
    rows = slice(system.frequency.size, 2 * system.frequency.size)
    A, _, source = state_space(system, 0.0)
    return Matrices(np.ascontiguousarray(A[rows].T), np.ascontiguousarray(source[rows].T))


class EnergyBalance:
    """The balances of a batch: what its cases share."""

    def __init__(self, structure: Structure, basis: Basis, free: Layout):
        shapes = basis.held.heat_shapes
        self._content, self._loss = product(structure.content, shapes), product(structure.loss_row, shapes)
        self._per_load, self._stiffness = product(self._content, shapes.T), basis.free.frequency**2
        self._free = Side(with_loss(free, self._loss), matrices(basis.free))
        self._held, self._held_matrices = basis.held, dict[tuple[bool, float], tuple[Matrices, bool]]()

    def regimes(self, held: Layout, alpha: float, friction: float) -> Regimes:
        """Return the regimes of cases of one α and µ."""
        sliding = self._held.sliding(friction)
        key = alpha > 0 or sliding.friction_force is not None, friction
        if key not in self._held_matrices:
            felt = linked(sliding) if key[0] else sliding
            self._held_matrices[key] = matrices(felt), felt.frequency.size < sliding.frequency.size
        side = Side(with_loss(held, self._loss), self._held_matrices[key][0])
        size = max(side.layout.outward.shape[0], self._free.layout.outward.shape[0])
        return Regimes(self._free, side, self._held_matrices[key][1], np.zeros((2, size)))

    def log(self, states: int, phases: int) -> Log:
        """Return the log of a case with so many modal states, for so many phases; cases use it one after the other."""
        f = self._free.layout.first
        return Log(
            stiffness=self._stiffness,
            loss=np.ascontiguousarray(f[first.SIGNAL_VALUE]),
            content=self._content,
            per_load=self._per_load,
            begun=np.zeros(phases),
            ended=np.zeros(phases),
            held=np.zeros(phases, dtype=np.bool_),
            state=np.zeros((phases, states)),
            energy=np.zeros(phases),
            final=np.zeros(states),
        )


def without_balances(free: Layout, held: Layout) -> Regimes:
    """Return what a kernel takes where no balances are asked for."""
    none = Matrices(np.zeros((0, 0)), np.zeros((0, 0)))
    return Regimes(Side(free, none), Side(held, none), False, np.zeros((2, 0)))


def with_loss(g: Layout, loss: Array) -> Layout:
    """Return a regime whose signal is the heat loss, W; ``loss`` is that per thermal mode."""
    b, f, source = g.block.copy(), g.first.copy(), g.source.copy()
    blocks, size = g.blocks, g.outward.shape[0]
    lost = product(g.outward[:, size - loss.size :], loss)
    b[block.SIGNAL_VALUE, :blocks], b[block.SIGNAL_SLOPE, :blocks] = lost[:blocks], lost[blocks : 2 * blocks]
    f[first.SIGNAL_VALUE, : g.firsts] = lost[2 * blocks :]
    source[:, size] = 0.0
    return g._replace(block=b, first=f, source=source)


@part
def residuals(
    regimes: Regimes, case: Case, memories: tuple[Memory, Memory], log: Log, tally: Any
) -> tuple[float, float]:
    """Return the energy and the heat residual of a case that completed."""
    free, held, load, T = regimes.free.layout, regimes.held.layout, case.load, case.load.duration
    motions = motions_of(free, held, load, memories)
    spent, lost, turnover, power = tally.spent, tally.lost, tally.turnover, 0.0
    for i in range(tally.phases):
        t, end, following = log.begun[i], log.ended[i], log.begun[i + 1] if i + 1 < tally.phases else T
        if end > t:
            motion = motions.held if log.held[i] else motions.free
            spent += _begin(motions, regimes.reduced, log, i, tally)
            disagreement = _phase_disagreement(regimes, motions, load, log, i)
            advance(motion.r, motion.now, t, end - t, motion.after)
            if log.held[i]:
                if motion.r.firsts > 0:
                    loss = integral(motion.r, motion.now, motion.after, t, end - t)
                    lost, turnover = lost + loss, turnover + abs(loss)
            else:
                power = disagreement
            copy_state(motion.after, motion.now)
            fill_modal(motions, log.held[i], end)
            spent += log.energy[i] - note_energy(log, motions.free.modal, tally) + disagreement * (end - t)
        spent += power * (following - end)
    energy = spent / tally.max_energy if tally.max_energy != 0.0 else 0.0
    return energy, _heat_residual(case, log, lost, turnover, tally)


@part
def _heat_residual(case: Case, log: Log, lost: float, turnover: float, tally: Any) -> float:
    """Return the heat residual; ``lost`` is ∫L dt, ``turnover`` ∫|L| dt."""
    load, modal, states = case.load, case.modal, 2 * log.stiffness.size
    if modal.size == states:
        return 0.0
    friction, heating = case.tip.alpha * tally.impulse, 0.0
    for k in range(load.heating.size):
        heating += load.duration * log.per_load[k] * load.heating[k]
    change = lost - friction - heating
    turnover = turnover + friction + abs(heating)
    for j in range(log.content.size):
        change += log.content[j] * (log.final[states + j] - modal[states + j])
        turnover += abs(log.content[j]) * abs(modal[states + j])
    return float(change / turnover) if turnover != 0.0 else 0.0


@part
def _begin(motions: Motions, reduced: bool, log: Log, i: int, tally: Any) -> float:
    """Set the motion of a phase to its beginning; return the energy that it thereby has more."""
    state, t = motions.free.modal, log.begun[i]
    for k in range(state.size):
        state[k] = log.state[i, k]
    energy = note_energy(log, state, tally)
    if not log.held[i]:
        set_free(motions, t)
        return 0.0
    set_held(motions, t)
    if reduced:
        return 0.0
    fill_modal(motions, True, t)
    return note_energy(log, state, tally) - energy


@part
def _phase_disagreement(regimes: Regimes, motions: Motions, load: Load, log: Log, i: int) -> float:
    """Return the power by which the motion of a phase and the matrices disagree, W.

    It is evaluated a while after the phase has begun. At the beginning itself the rounding of the state moves poles far
    faster than the phase is long: with rates of 1e15 1/s beside forces that friction heat couples, 1e-5 of the
    energy, gone within 1e-6 s.
    """
    held, t = log.held[i], log.begun[i]
    motion, side = motions.held if held else motions.free, regimes.held if held else regimes.free
    wait = _EVALUATED_AT * (log.ended[i] - t)
    copy_state(motion.now, motion.between)
    advance(motion.r, motion.between, t, wait, motion.now)
    fill_modal(motions, held, t + wait)
    power = _disagreement(side, motion, load, t + wait, motions.free.modal, regimes.rates, log)
    copy_state(motion.between, motion.now)
    return power


@part
def _disagreement(side: Side, motion: Motion, load: Load, t: float, state: Array, rates: Array, log: Log) -> float:
    """Return ∇E · (R - X'), the power by which a motion and the matrices disagree, W.

    ``state`` is [y, y', τ] of the free tip; ``rates`` is scratch.
    """
    x, rate, (regime, system) = motion.modal, rates[1], side
    modes, free, own = system.force.shape[1], log.stiffness.size, rates[0, : motion.coordinates.size]
    to_rates(motion.r, motion.now, t, own)
    multiply(regime.outward, own, rate[: x.size])
    error = rate[modes : 2 * modes]
    for n in range(x.size):
        for m in range(modes):
            error[m] -= system.motion[n, m] * x[n]
    _subtract_forces(system.force, load, motion.r.waves, t, error)
    power = 0.0
    for m in range(modes):
        at, along = 0.0, 0.0
        for k in range(free):
            at += log.stiffness[k] * state[k] * regime.exit[m, k]
            along += state[free + k] * regime.exit[m, k]
        power += at * (rate[m] - x[modes + m]) + along * error[m]
    return float(power)


@part
def _subtract_forces(force: Array, load: Load, waves: Array, t: float, error: Array) -> None:
    """Subtract the forces on modes by constant loads, the load at the tip and the casing."""
    at = load.steady.size + load.heating.size
    push, place, speed, acceleration = load.mean, load.gap, 0.0, 0.0
    for i in range(waves.shape[0]):
        cos, sin = wave_phase(waves, i, t)
        omega, amplitude = waves[i, wave.OMEGA], waves[i, wave.CASING]
        push, place = push + waves[i, wave.LOAD] * sin, place + amplitude * sin
        speed, acceleration = speed + omega * amplitude * cos, acceleration - omega * omega * amplitude * sin
    for m in range(error.size):
        error[m] -= force[at, m] * push + force[at + 1, m] * place
        error[m] -= force[at + 2, m] * speed + force[at + 3, m] * acceleration
    for i in range(load.steady.size):
        if load.steady[i] != 0.0:
            for m in range(error.size):
                error[m] -= force[i, m] * load.steady[i]
