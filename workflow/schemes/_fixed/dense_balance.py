"""Energy and heat of a step of plain states of a structure that modes do not separate.

With midpoint values x_m = (x + x')/2 of a step and F_θ the load as the step takes it, in the direction b, the sum over
the steps of

    - F_θ bᵀv_m h - f̄ᵀ v_m h + v_mᵀ C1 v_m h + v_mᵀ K12 θ_m h + p (e_n - µt)ᵀ v_m

and ΔE, E = ½ vᵀM v + ½ xᵀK1 x, over the largest E at a step end, is the energy residual; the heat residual is that of
:mod:`workflow.schemes._fixed.totals`. Central differences conserve E = ½ wᵀM w + ½ x_kᵀK1 x_k+1, w = w_k+½; their step
from w_k-½ to w_k+½ has v_k for v_m and θ_k for θ_m. What a contact law gives beside its impulse
(:func:`~workflow.schemes._fixed.contact.contact_gain`) is added by the march.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import part
from workflow.kernels.lanes import lane_rows
from workflow.models import Cases, Structure, directions
from workflow.schemes._fixed import total_row


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
    """``(row, lane)``, rows of :mod:`~workflow.schemes._fixed.total_row`."""


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
def store_energy(account: Account, x: Array, ahead: Array, v: Array, lanes: int) -> None:
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
def count_lost_heat(account: Account, h: float, theta: float, before: Array, after: Array, lanes: int) -> None:
    """Count the heat that a step loses with the temperatures at its ends, ``(thermal, lane)``, weighed by θ."""
    for lane in range(lanes):
        flow = 0.0
        for j in range(before.shape[0]):
            flow += account.losses[j] * ((1.0 - theta) * before[j, lane] + theta * after[j, lane])
        account.totals[total_row.LOST, lane] += h * flow
        account.totals[total_row.TURNED_OVER, lane] += abs(h * flow)


def account_of(structure: Structure, cases: Cases) -> tuple[Account, list[tuple[Array, Array]]]:
    """Return an account of a structure, and its rows of lanes with what they take at the beginning, ``(row, case)``."""
    n, heats = structure.mechanical_size, structure.thermal_size
    account = Account(
        structure.mass,
        structure.stiffness_matrix,
        structure.damping_matrix,
        structure.coupling_matrix,
        structure.load_direction,
        structure.loss_row,
        *(lane_rows(rows) for rows in (n, n, 2 * n + heats, 2 * n, total_row.ROWS)),
    )
    pushes, none = directions(structure, cases.friction).T, np.zeros((total_row.ROWS, cases.count))
    return account, [(account.contact, pushes), (account.steady, cases.steady.T), (account.totals, none)]


def no_account() -> Account:
    """Return what stands for an account where no balances are asked for."""
    return Account(*np.zeros((4, 0, 0)), *np.zeros((2, 0)), *(lane_rows(0) for _ in range(5)))
