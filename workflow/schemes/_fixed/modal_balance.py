"""Balances of a batch: their coefficients and sums before the march, the residuals after it.

What is summed, and why, stands in :mod:`workflow.schemes._fixed.balance`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels.lanes import lane_rows
from workflow.models import Array, Cases, Structure, project
from workflow.schemes._fixed import balance, case_row, total_row
from workflow.schemes._fixed.balance import Account
from workflow.schemes._fixed.block_lanes import BlockAccount
from workflow.schemes._fixed.blocks import Step
from workflow.schemes._fixed.decoupled import Decoupled, Motion, felt_modes
from workflow.schemes._fixed.modal_lanes import HEAT_SPEED, Coefficients, State, by_mode
from workflow.schemes._fixed.totals import Balance, Content

REST = 1e-12
"""A tip that is slower than this share of what the tip load could give it within the run is at rest: a few thousand
roundings of that."""


class Terms(NamedTuple):
    """How a scheme's free step enters its balance, by mode ``(mode,)``, and its states where it begins."""

    lever: float
    """η less the kernel's ξ, per ζ, s."""
    kinetic: Array
    """2E per ζ²."""
    inertia: Array
    """Modal impulse per change of ζ."""
    heat_speed: Array
    """Work of a unit of friction heat per ζ_m."""
    heat_place: Array
    """a, what a unit of friction heat adds to η; its work per η_m is ω²a."""
    dragged: float
    """Velocity of the tip that a unit of friction heat drags along in its step."""
    velocity: Array
    """ζ where the balance begins, ``(case, mode)``."""
    place: Array
    """ξ there, ``(case, mode)``."""
    opens: bool
    """Whether the march begins at the end of a step, whose beginning that is."""


class Start(NamedTuple):
    """Cases of a batch and how they start."""

    modal: Decoupled
    cases: Cases
    begun: Motion


class Energy(NamedTuple):
    """What an account needs to count the energy of a batch."""

    fields: dict[str, Any]
    """Of :class:`~workflow.schemes._fixed.balance.Account`."""
    sums: dict[int, Array]
    """Rows of its sums where the balance begins, ``(case,)``."""
    filled: list[tuple[Array, Array]]
    """Rows of lanes, and what all cases begin with in them, ``(row, case)``."""
    rest: Array | float
    """Energy below which all is rounding, J, ``(case,)``."""


class Balances:
    """The balances of a batch: lanes :attr:`filled` for a block, :meth:`close` after it, :meth:`result` at the end.

    Attributes
    ----------
    account
        What the kernel takes; all blocks share its arrays.
    filled
        Rows of lanes, and what all cases begin with in them.
    """

    def __init__(self, structure: Structure, free: Coefficients, start: Start, step: Step, energy: Energy):
        self._free, self._start, self._rest = free, start, energy.rest
        modal, begun = start.modal, start.begun
        self._content = structure.content @ modal.heat_shapes
        loss = self._content * modal.rate
        self.account = Account(
            losses=_lost(loss / modal.heat_scale, step)[1:],
            heat_losses=_heat_lost(loss, step),
            sums=lane_rows(balance.SUM_ROWS),
            **energy.fields,
        )
        self._ended, self._ended_heat = np.zeros((balance.SUM_ROWS, len(begun.heat))), np.zeros_like(begun.heat)
        for row, values in {**energy.sums, balance.SUM_SETTLED_LOSS: project(loss, begun.settled)}.items():
            self._ended[row] = values
        self.filled = [(self.account.sums, self._ended.copy()), *energy.filled]

    @property
    def rows(self) -> int:
        """Rows of lanes that balances add to a step's."""
        return sum(len(rows) for rows, _ in self.filled)

    def close(self, part: slice, state: State) -> None:
        """Keep what the lanes of some cases ended with."""
        count = part.stop - part.start
        self._ended[:, part] = self.account.sums[:, :count]
        self._ended_heat[part] = state.tau[:, :count].T
        if not self._free.heat_counts:
            self._ended[total_row.FRICTION_HEAT, part] -= state.own[case_row.HEAT, :count]

    def result(self, elapsed: float) -> Balance:
        """Return the balances after ``elapsed`` seconds."""
        modal, cases, begun = self._start
        warmed = self._ended_heat / modal.heat_scale - begun.heat + elapsed * begun.warming_modes
        initial = project(np.abs(self._content), np.abs(begun.heat + begun.settled))
        heating = elapsed * project(self._content, project(modal.heat_shapes.T, cases.heating))
        return Balance(self._ended, Content(project(self._content, warmed), initial, heating), self._rest)


def energy_of_modes(start: Start, free: Coefficients, terms: Terms, elapsed: float) -> Energy:
    """Return how the energy of modes scaled by the tip is counted over ``elapsed`` seconds."""
    (modal, cases, begun), theta, h = start, free.tip.theta, free.tip.h
    tip, pull = modal.tip, modal.frequency**2 * terms.heat_place
    share, half = inverse_square(tip), 0.5 * terms.heat_speed
    begin = (0.5 * h * (1 - theta) * pull - half) * tip * share
    end = (-0.5 * h * theta * pull - half) * tip * share
    place = -pull * tip * share
    decay, spring, impulse, heat_speed, heat_place = free.modes.T
    own = 0.5 * np.sum(np.where(share > 0, pull * terms.heat_place, 0.0))
    former, pulled = lane_rows(tip.size), lane_rows(free.pair_mode.size)
    fields = {
        "modes": by_mode(
            0.25 * h * modal.damping * share,
            begin + end * (decay - h * spring),
            place + end * spring,
            0.5 * terms.kinetic * share,
            0.5 * modal.frequency**2 * share,
        ),
        "former": former,
        "pulled": pulled,
        "pair_work": (terms.inertia * share)[free.pair_mode],
        "pair_heat": end[free.pair_mode],
        "lever": terms.lever,
        "dragged": terms.dragged,
        "heat_on_impulse": np.sum(end * impulse),
        "heat_on_heat": own + np.sum(end * heat_speed + place * heat_place),
        "heat_on_slid": 0.0 if free.sliding is None else np.sum(end * free.sliding.speeds),
    }
    filled = [(former, (terms.velocity * tip).T), (pulled, np.zeros((len(pulled), cases.count)))]
    rest = rest_energy(modal, cases, begun, elapsed) + massless_energy(modal, h, terms.velocity)
    return Energy(fields, _sums(start, free, terms), filled, rest)


def energy_of_blocks(start: Start, account: BlockAccount, filled: list[tuple[Array, Array]], velocity: Array) -> Energy:
    """Return how the energy of a structure in blocks is counted, which begins with ``velocity``, ``(case, mode)``."""
    modal, cases, begun = start
    x = project(modal.to_modes, cases.displacement)
    place = x - account.levers[1] * velocity
    begin = place + account.levers[0] * velocity
    energy = 0.5 * (project(account.mass, velocity**2) + project(account.stiffness, begin * x))
    tau = (begun.heat * modal.heat_scale).T
    states = np.zeros((len(account.states), cases.count))
    states[len(states) - len(tau) :] = tau
    filled = [*filled, (account.states, states), (account.place, place.T), (account.speed, velocity.T)]
    none = lane_rows(0)
    fields = {
        "modes": by_mode(*np.zeros((5, 0))),
        "former": none,
        "pulled": none,
        "pair_work": np.zeros(0),
        "pair_heat": np.zeros(0),
        **dict.fromkeys(("lever", "dragged", "heat_on_impulse", "heat_on_heat", "heat_on_slid"), 0.0),
        "blocks": account,
    }
    rows = dict.fromkeys((total_row.FIRST_ENERGY, total_row.LAST_ENERGY, total_row.LARGEST_ENERGY), energy)
    return Energy(fields, {**rows, balance.SUM_RELATIVE: project(modal.tip, velocity)}, filled, 0.0)


def _lost(rate: Array, step: Step) -> Array:
    """Return what a unit of τ loses in 0 … SPAN steps, J, ``(steps, thermal mode)``."""
    lost = np.zeros((balance.SPAN + 1, rate.size))
    for k in range(balance.SPAN):
        lost[k + 1] = lost[k] + step.tip.h * rate * _weighed(1.0, step.decay, step)
        rate = rate * step.decay
    return lost


def _weighed(begin: Array | float, end: Array, step: Step) -> Array:
    """Return temperatures as the loss of a step is that of."""
    return (1 - step.heat_theta) * begin + step.heat_theta * end


def _heat_lost(loss: Array, step: Step) -> Array:
    """Return the share of a friction heat that is lost in its own step and 0 … SPAN steps after it, ``(steps,)``."""
    h, warm, later = step.tip.h, np.zeros_like(step.warm), step.warm  # a step behind in central differences
    if step.heat_counts:
        warm, later = step.warm, step.decay * step.warm
    own = h * np.sum(loss * _weighed(0.0, warm, step))
    first = own + h * np.sum(loss * _weighed(warm, later, step))
    return np.concatenate([[own], [first + np.sum(row) for row in _lost(loss * later, step)[:-1]]])


def _sums(start: Start, free: Coefficients, terms: Terms) -> dict[int, Array]:
    """Return the sums of modes where their balance begins, ``(case,)``."""
    (modal, _, begun), h = start, free.tip.h
    felt = np.where(felt_modes(modal.tip), 1.0, 0.0)
    eta = terms.place + terms.lever * terms.velocity
    squares = terms.velocity**2
    energy = 0.5 * (project(felt * terms.kinetic, squares) + project(felt * modal.frequency**2, eta**2))
    sums = dict.fromkeys((total_row.FIRST_ENERGY, total_row.LAST_ENERGY, total_row.LARGEST_ENERGY), energy)
    if not terms.opens:  # the first step of the march counts the dissipation of a step that ends at t = 0
        sums[total_row.DISSIPATED] = -project(h * felt * modal.damping, squares)
    sums[balance.SUM_RELATIVE] = project(modal.tip, terms.velocity)
    sums[balance.SUM_DRAGGED] = project(free.heat_modes[:, HEAT_SPEED] * modal.heat_scale, begun.heat) + begun.drift
    return sums


def inverse_square(tip: Array) -> Array:
    """Return 1/φ_n² of each mode, 0 for those without a share in the tip."""
    felt = felt_modes(tip)
    return np.where(felt, 1 / np.where(felt, tip, 1.0) ** 2, 0.0)


def rest_energy(modal: Decoupled, cases: Cases, begun: Motion, elapsed: float) -> Array:
    """Return the energy below which the tip is at rest, J, ``(case,)``.

    It is what :data:`REST` times a bound of the load at the tip over ``elapsed`` seconds gives it. Where load and
    contact force cancel at a gap of 0 nothing else moves, and energy and residual are both rounding.
    """
    swing = np.abs(cases.amplitude) + cases.load_harmonics.reach
    impulse = elapsed * (np.abs(cases.mean + begun.tip_force) + swing)
    return np.asarray(0.5 * np.sum(modal.mass * modal.tip**2) * (REST * impulse) ** 2)


def massless_energy(modal: Decoupled, h: float, velocity: Array) -> Array:
    """Return the strain energy of what a mode without mass moves in a step at its first velocity, J, ``(case,)``.

    Of a massless tip that begins with a velocity and no displacement all other energy is rounding.
    """
    massless = modal.mass == 0
    return 0.5 * project((h * modal.frequency[massless]) ** 2, velocity[:, massless] ** 2)
