"""Energy and heat of a step of plain states of a structure that modes do not separate.

With midpoint values x_m = (x + x')/2 of a step and F_θ the load as the step takes it, in the direction b, the sum over
the steps of

    - F_θ bᵀv_m h - f̄ᵀ v_m h + v_mᵀ C1 v_m h + v_mᵀ K12 θ_m h + p (e_n - µt)ᵀ v_m

and ΔE, E = ½ vᵀM v + ½ xᵀK1 x, over the largest E at a step end, is the energy residual; the change of the heat
content less αJ and heating plus the losses, over the heat turned over, is the heat residual. Central differences
conserve E = ½ wᵀM w + ½ x_kᵀK1 x_k+1, w = w_k+½; their step from w_k-½ to w_k+½ has v_k for v_m and θ_k for θ_m. What a
contact law gives beside its impulse (:func:`~workflow.schemes._fixed.contact.contact_gain`) is added by the march.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import part, uncounted
from workflow.kernels.lanes import LANES, PACK, fill_lanes, lane_rows
from workflow.models import Cases, Structure, directions
from workflow.schemes._fixed import total_row
from workflow.schemes._fixed.totals import Content, residuals

States = tuple[Array, Array, Array]
"""Displacement and velocity ``(case, mechanical)``, temperature ``(case, thermal)``."""


class Account(NamedTuple):
    """The balances of a block; of no rows where none are asked for."""

    mass: Array
    stiffness: Array
    damping: Array
    coupling: Array
    load: Array
    """b, ``(mechanical,)``."""
    losses: Array
    """Heat flow out of the structure per temperature, W/K, ``(thermal,)``."""
    contact: Array
    """e_n - µt, ``(mechanical, lane)``."""
    steady: Array
    """f̄, ``(mechanical, lane)``."""
    middle: Array
    """Velocity v_m, that which damps, and θ_m, ``(row, lane)``: what :func:`add_dissipation` is given."""
    force: Array
    """Room for forces, ``(2 mechanical, lane)``."""
    totals: Array
    """``(row, lane)``, rows of :mod:`~workflow.schemes._fixed.totals`."""


@part
def multiply(matrix: Array, states: Array, forces: Array, lanes: int) -> None:
    """Fill ``forces`` with matrix · states, ``(row, lane)``, added in the order of the columns."""
    for i in range(matrix.shape[0]):
        for lane in range(lanes):
            forces[i, lane] = 0.0
        for j in range(matrix.shape[1]):
            factor = matrix[i, j]
            for lane in range(lanes):
                forces[i, lane] += factor * states[j, lane]


@part
def measure(account: Account, x: Array, ahead: Array, v: Array, lanes: int) -> None:
    """Store the energy ½ vᵀM v + ½ xᵀK1 x', x' = ``ahead``, and the largest; a NaN stays."""
    count, totals = v.shape[0], account.totals
    inertia, elastic = account.force[:count], account.force[count : 2 * count]
    multiply(account.mass, v, inertia, lanes)
    multiply(account.stiffness, ahead, elastic, lanes)
    for lane in range(lanes):
        kinetic = strained = 0.0
        for i in range(count):
            kinetic += v[i, lane] * inertia[i, lane]
            strained += x[i, lane] * elastic[i, lane]
        energy, largest = 0.5 * (kinetic + strained), totals[total_row.LARGEST_ENERGY, lane]
        totals[total_row.LAST_ENERGY, lane] = energy
        totals[total_row.LARGEST_ENERGY, lane] = largest if energy <= largest else energy


@part
def add_dissipation(account: Account, h: float, impulse: Array, load: Array, lanes: int) -> None:
    """Add the energy that a step dissipates; ``impulse`` of contact [N s] and ``load`` [N], ``(lane,)``."""
    count, totals = account.mass.shape[0], account.totals
    v, damps, temperature = account.middle[:count], account.middle[count : 2 * count], account.middle[2 * count :]
    damped, pulled = account.force[:count], account.force[count : 2 * count]
    multiply(account.damping, damps, damped, lanes)
    multiply(account.coupling, temperature, pulled, lanes)
    for lane in range(lanes):
        work = driven = pushed = 0.0
        for i in range(count):
            work += v[i, lane] * (damped[i, lane] + pulled[i, lane] - account.steady[i, lane])
            driven += account.load[i] * v[i, lane]
            pushed += account.contact[i, lane] * v[i, lane]
        totals[total_row.DISSIPATED, lane] += h * (work - load[lane] * driven) + impulse[lane] * pushed


@part
def lose(account: Account, h: float, before: Array, after: Array, lanes: int) -> None:
    """Count the heat that a step loses by the mean of its temperatures, ``(thermal, lane)``."""
    for lane in range(lanes):
        flow = 0.0
        for j in range(before.shape[0]):
            flow += account.losses[j] * (0.5 * (before[j, lane] + after[j, lane]))
        account.totals[total_row.LOST, lane] += h * flow
        account.totals[total_row.TURNED_OVER, lane] += abs(h * flow)


def account_of(structure: Structure) -> Account:
    """Return an account of a structure, which :func:`open_account` opens for some cases."""
    n, heats = structure.mechanical_size, structure.thermal_size
    return Account(
        structure.mass,
        structure.stiffness_matrix,
        structure.damping_matrix,
        structure.coupling_matrix,
        structure.load_direction,
        structure.loss_row,
        *(lane_rows(rows) for rows in (n, n, 2 * n + heats, 2 * n, total_row.ROWS)),
    )


def no_account() -> Account:
    """Return what stands for an account where no balances are asked for."""
    return Account(*np.zeros((4, 0, 0)), *np.zeros((2, 0)), *(lane_rows(0) for _ in range(5)))


def open_account(account: Account, structure: Structure, cases: Cases) -> None:
    """Set the account to zero, for up to ``LANES`` cases."""
    fill_lanes(account.contact, directions(structure, cases.friction).T)
    fill_lanes(account.steady, cases.steady.T)
    account.totals[:] = 0.0


def content_of(structure: Structure, cases: Cases, last: Array, elapsed: float) -> Content:
    """Return the heat content of cases with the temperatures ``last`` at the end, K, ``(case, thermal)``."""
    content, ones = structure.content[None, :], np.ones_like(cases.heating)
    initial = content * cases.temperature
    return Content(
        _dot(content * last - initial, ones), _dot(np.abs(initial), ones), elapsed * _dot(cases.heating, ones)
    )


def _dot(left: Array, right: Array) -> Array:
    """Return Σ left · right of each case, added in the order of the coordinates, ``(case,)``."""
    total = np.zeros(left.shape[0])
    for column in range(left.shape[1]):
        total += left[:, column] * right[:, column]
    return total


@uncounted
def _begin(account: Account, x: Array, v: Array, lanes: int) -> None:
    """Take the energy at t = 0."""
    measure(account, x, x, v, lanes)


@uncounted
def _add(account: Account, h: float, impulse: Array, load: Array, before: Array, after: Array, lanes: int) -> None:
    """Count a step from its states at both ends."""
    n, heats = account.mass.shape[0], account.losses.size
    middle = account.middle
    for lane in range(lanes):
        for i in range(n):
            middle[i, lane] = 0.5 * (before[n + i, lane] + after[n + i, lane])
            middle[n + i, lane] = middle[i, lane]
        for j in range(2 * n, 2 * n + heats):
            middle[j, lane] = 0.5 * (before[j, lane] + after[j, lane])
    add_dissipation(account, h, impulse, load, lanes)
    lose(account, h, before[2 * n :], after[2 * n :], lanes)
    measure(account, after[:n], after[:n], after[n : 2 * n], lanes)


class DenseBalance:
    """Sums of a batch that is recorded step by step."""

    def __init__(self, structure: Structure, cases: Cases, h: float) -> None:
        self._structure, self._cases, self._h, self._step = structure, cases, h, 0
        self._parts = [slice(first, first + LANES) for first in range(0, cases.count, LANES)]
        self._accounts = [account_of(structure) for _ in self._parts]
        rows = 2 * structure.mechanical_size + structure.thermal_size
        self._states, self._acting = (lane_rows(rows), lane_rows(rows)), (lane_rows(), lane_rows())
        for these, account in zip(self._parts, self._accounts, strict=True):
            some = cases.take(these)
            open_account(account, structure, some)
            _begin(account, _lanes(some.displacement), _lanes(some.velocity), -(-some.count // PACK) * PACK)
            account.totals[total_row.FIRST_ENERGY] = account.totals[total_row.LAST_ENERGY]

    def add(self, before: States, after: States, impulse: Array, load: Array) -> None:
        """Add a step from its states at both ends, the impulse p and the load F_θ in it, N s and N, ``(case,)``."""
        self._step += 1
        for these, account in zip(self._parts, self._accounts, strict=True):
            for rows, states in zip(self._states, (before, after), strict=True):
                fill_lanes(rows, np.concatenate([each[these] for each in states], axis=1).T)
            for row, values in zip(self._acting, (impulse, load), strict=True):
                fill_lanes(row, values[these])
            count = impulse[these].size
            _add(account, self._h, *self._acting, *self._states, -(-count // PACK) * PACK)
            account.totals[total_row.FRICTION_HEAT, :count] += self._cases.alpha[these] * impulse[these]

    def residuals(self, last: States) -> dict[str, Array]:
        """Return ``energy_residual`` and ``heat_residual``; 0 where there is no energy, or no heat turned over."""
        count = self._cases.count
        totals = np.concatenate([account.totals[:, :LANES] for account in self._accounts], axis=1)[:, :count]
        return residuals(totals, content_of(self._structure, self._cases, last[2], self._step * self._h))


def _lanes(states: Array) -> Array:
    """Return states ``(case, coordinate)`` as rows of lanes."""
    rows = lane_rows(states.shape[1])
    fill_lanes(rows, states.T)
    return rows
