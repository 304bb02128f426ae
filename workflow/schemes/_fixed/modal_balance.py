"""Balances of a batch: their coefficients and sums before the march, the residuals after it.

What is summed, and why, stands in :mod:`workflow.schemes._fixed.balance`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels.lanes import lane_rows
from workflow.models import Array, Cases, Structure, project
from workflow.schemes._fixed import balance, case_row, total_row
from workflow.schemes._fixed.balance import Account
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
    heat_theta: float
    """Weight of the temperatures at a step's end in what it loses."""
    decay: Array
    """τ at a step's end per τ at its beginning, ``(thermal mode,)``."""
    warm: Array
    """τ at a step's end per friction heat in it, ``(thermal mode,)``."""
    warm_next: Array
    """τ a step later per friction heat, ``(thermal mode,)``."""
    velocity: Array
    """ζ where the balance begins, ``(case, mode)``."""
    place: Array
    """ξ there, ``(case, mode)``."""
    opens: bool
    """Whether the march begins at the end of a step, whose beginning that is."""


class ModalBalance:
    """The balances of a batch: lanes :attr:`filled` for a block, :meth:`close` after it, :meth:`result` at the end.

    Attributes
    ----------
    account
        What the kernel takes; all blocks share its arrays.
    """

    def __init__(
        self, structure: Structure, modal: Decoupled, free: Coefficients, cases: Cases, begun: Motion, terms: Terms
    ):
        self._modal, self._free, self._cases, self._begun, self._terms = modal, free, cases, begun, terms
        self._content = structure.content @ modal.heat_shapes
        loss = self._content * modal.rate
        self.account = _account(modal, free, loss, terms)
        self._sums = _sums(modal, free, loss, begun, terms)
        self._ended, self._ended_heat = np.zeros_like(self._sums), np.zeros_like(begun.heat)

    @property
    def rows(self) -> int:
        """Rows of lanes that balances add to a step's."""
        return balance.SUM_ROWS + int(self.account.pulled.shape[0] + self.account.former.shape[0])

    @property
    def filled(self) -> list[tuple[Array, Array]]:
        """Rows of lanes, and what all cases begin with in them."""
        speed = (self._terms.velocity * self._modal.tip).T
        pulled = np.zeros((self.account.pulled.shape[0], self._sums.shape[1]))
        return [(self.account.sums, self._sums), (self.account.former, speed), (self.account.pulled, pulled)]

    def close(self, part: slice, state: State) -> None:
        """Keep what the lanes of some cases ended with."""
        count = part.stop - part.start
        self._ended[:, part] = self.account.sums[:, :count]
        self._ended_heat[part] = state.tau[:, :count].T
        if not self._free.heat_counts:
            self._ended[total_row.FRICTION_HEAT, part] -= state.own[case_row.HEAT, :count]

    def result(self, elapsed: float) -> Balance:
        """Return the balances after ``elapsed`` seconds."""
        modal, cases, begun = self._modal, self._cases, self._begun
        warmed = self._ended_heat / modal.heat_scale - begun.heat + elapsed * begun.warming_modes
        initial = project(np.abs(self._content), np.abs(begun.heat + begun.settled))
        heating = elapsed * project(self._content, project(modal.heat_shapes.T, cases.heating))
        rest = rest_energy(modal, cases, begun, elapsed)
        rest += massless_energy(modal, self._free.tip.h, self._terms.velocity)
        return Balance(self._ended, Content(project(self._content, warmed), initial, heating), rest)


def _account(modal: Decoupled, free: Coefficients, loss: Array, terms: Terms) -> Account:
    """Return the coefficients of a batch, and room for its sums."""
    theta, h, tip, pull = free.tip.theta, free.tip.h, modal.tip, modal.frequency**2 * terms.heat_place
    share, half = inverse_square(tip), 0.5 * terms.heat_speed
    begin = (0.5 * h * (1 - theta) * pull - half) * tip * share
    end = (-0.5 * h * theta * pull - half) * tip * share
    place = -pull * tip * share
    decay, spring, impulse, heat_speed, heat_place = free.modes.T
    own = 0.5 * np.sum(np.where(share > 0, pull * terms.heat_place, 0.0))
    return Account(
        modes=by_mode(
            0.25 * h * modal.damping * share,
            begin + end * (decay - h * spring),
            place + end * spring,
            0.5 * terms.kinetic * share,
            0.5 * modal.frequency**2 * share,
        ),
        losses=_lost(loss / modal.heat_scale, terms, h)[1:],
        heat_losses=_heat_lost(loss, terms, h),
        former=lane_rows(tip.size),
        pulled=lane_rows(free.pair_mode.size),
        pair_work=(terms.inertia * share)[free.pair_mode],
        pair_heat=end[free.pair_mode],
        sums=lane_rows(balance.SUM_ROWS),
        lever=terms.lever,
        dragged=terms.dragged,
        heat_on_impulse=np.sum(end * impulse),
        heat_on_heat=own + np.sum(end * heat_speed + place * heat_place),
        heat_on_slid=0.0 if free.sliding is None else np.sum(end * free.sliding.speeds),
    )


def _lost(rate: Array, terms: Terms, h: float) -> Array:
    """Return what a unit of τ loses in 0 … SPAN steps, J, ``(steps, thermal mode)``."""
    lost = np.zeros((balance.SPAN + 1, rate.size))
    for step in range(balance.SPAN):
        lost[step + 1] = lost[step] + h * rate * _weighed(1.0, terms.decay, terms)
        rate = rate * terms.decay
    return lost


def _weighed(begin: Array | float, end: Array, terms: Terms) -> Array:
    """Return temperatures as the loss of a step is that of."""
    return (1 - terms.heat_theta) * begin + terms.heat_theta * end


def _heat_lost(loss: Array, terms: Terms, h: float) -> Array:
    """Return the share of a friction heat that is lost in its own step and 0 … SPAN steps after it, ``(steps,)``."""
    own = h * np.sum(loss * _weighed(0.0, terms.warm, terms))
    later = _lost(loss * terms.warm_next, terms, h)
    first = own + h * np.sum(loss * _weighed(terms.warm, terms.warm_next, terms))
    return np.concatenate([[own], [first + np.sum(row) for row in later[:-1]]])


def _sums(modal: Decoupled, free: Coefficients, loss: Array, begun: Motion, terms: Terms) -> Array:
    """Return the sums of a batch where its balance begins, ``(row, case)``."""
    felt, h = np.where(felt_modes(modal.tip), 1.0, 0.0), free.tip.h
    eta = terms.place + terms.lever * terms.velocity
    sums = np.zeros((balance.SUM_ROWS, terms.velocity.shape[0]))
    squares = terms.velocity**2
    energy = 0.5 * (project(felt * terms.kinetic, squares) + project(felt * modal.frequency**2, eta**2))
    sums[[total_row.FIRST_ENERGY, total_row.LAST_ENERGY, total_row.LARGEST_ENERGY]] = energy
    if not terms.opens:  # the first step of the march counts the dissipation of a step that ends at t = 0
        sums[total_row.DISSIPATED] = -project(h * felt * modal.damping, squares)
    sums[balance.SUM_RELATIVE] = project(modal.tip, terms.velocity)
    sums[balance.SUM_DRAGGED] = project(free.heat_modes[:, HEAT_SPEED] * modal.heat_scale, begun.heat) + begun.drift
    sums[balance.SUM_SETTLED_LOSS] = project(loss, begun.settled)
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
