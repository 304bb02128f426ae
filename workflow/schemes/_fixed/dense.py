"""The θ-method by dense matrices, where damping couples the modes of the free tip or the load does not act on it.

With X = [x, v, θ] a free step is X' = A X + b, one matrix for the whole structure; a step of a case costs the square of
the number of its states instead of a few operations for each mode.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workflow.kernels import Array
from workflow.kernels.complex_numbers import magnitude
from workflow.kernels.eigen import eigenvalues
from workflow.kernels.solving import inverse
from workflow.kernels.sums import product
from workflow.models import Cases, Structure, project
from workflow.schemes._fixed.outcome import ROUNDING
from workflow.schemes._fixed.recorder import Recorder
from workflow.schemes._interface import Results, Sampling, Status

_LOOP, _TERM = 5e-5, 4e-9
"""Seconds of a step of a batch in NumPy's loop, shared by some eight cases, and of a product of two numbers in it."""


@dataclass(frozen=True, eq=False)
class DenseOperator:
    """The free step and the responses to an impulse.

    Attributes
    ----------
    structure, h, theta
        What is stepped; s; weight of the step's end.
    step
        A, ``(state, state)`` with states [x, v, θ].
    mobility, warming
        Ŵ⁻¹ and T̂⁻¹, 1/kg and K/J.
    dragged
        Ŵ⁻¹ hθ K12 T̂⁻¹ e_n, by which an impulse's heat drives velocities, per α.
    growth
        Spectral radius of A.
    """

    structure: Structure
    h: float
    theta: float
    step: Array
    mobility: Array
    warming: Array
    dragged: Array
    growth: float


def init(structure: Structure, h: float, theta: float) -> DenseOperator:
    """Invert Ŵ and T̂ once for a batch."""
    M, C, K = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    coupling, capacity, losses = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    n, heats, rest = M.shape[0], capacity.shape[0], 1 - theta
    mobility = inverse(M + h * theta * C + h * h * theta * theta * K)
    warming = inverse(capacity + h * theta * losses)
    cooled = product(warming, capacity - h * rest * losses)
    x, v, t = slice(0, n), slice(n, 2 * n), slice(2 * n, 2 * n + heats)
    A = np.zeros((2 * n + heats, 2 * n + heats))
    A[v, x] = -h * product(mobility, K)
    A[v, v] = product(mobility, M - h * rest * C - h * h * theta * rest * K)
    A[v, t] = -h * product(mobility, product(coupling, theta * cooled + rest * np.eye(heats)))
    A[x] = h * theta * A[v]
    A[x, x] += np.eye(n)
    A[x, v] += h * rest * np.eye(n)
    A[t, t] = cooled
    dragged = h * theta * product(mobility, product(coupling, warming[:, -1]))
    growth = float(magnitude(eigenvalues(A)).max(initial=0.0))
    return DenseOperator(structure, h, theta, A, mobility, warming, dragged, growth)


def compute(operator: DenseOperator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch.

    Raises
    ------
    ValueError
        The casing moves.
    """
    if cases.casing_harmonics.width > 0:
        raise ValueError("with damping that couples the modes of the structure the casing cannot move")
    with np.errstate(over="ignore", invalid="ignore"):  # the status of a case that left the finite numbers says so
        return _marched(operator, cases, sampling)


def _marched(operator: DenseOperator, cases: Cases, sampling: Sampling) -> Results:
    structure, h, theta = operator.structure, operator.h, operator.theta
    n, recorder = structure.mechanical_size, Recorder(structure, cases, sampling, h)
    kick = operator.mobility[:, -1] + cases.alpha[:, None] * operator.dragged
    if structure.tangent is not None:
        kick = kick - cases.friction[:, None] * product(operator.mobility, structure.tangent)
    inverse_mass = np.where(kick[:, -1] > 0, 1 / np.where(kick[:, -1] > 0, kick[:, -1], 1.0), np.nan)
    heat = h * project(operator.warming, cases.heating)
    push = h * project(operator.mobility, cases.steady - theta * project(structure.coupling_matrix, heat))
    response = product(operator.mobility, structure.load_direction)
    states = np.concatenate([cases.displacement, cases.velocity, cases.temperature], axis=1)
    for _ in range(recorder.steps):
        load = theta * recorder.load(1.0) + (1 - theta) * recorder.load(0.0)
        drive = push + (h * load)[:, None] * response
        after = project(operator.step, states)
        after[:, n : 2 * n] += drive
        after[:, 2 * n :] += heat
        x, v = states[:, n - 1], states[:, 2 * n - 1]
        closing = (after[:, 2 * n - 1] + cases.e * v) * inverse_mass
        meets = (x + 0.5 * h * v >= cases.gap) & ~(closing <= 0.0)  # a NaN meets
        p = np.where(meets, closing, 0.0)
        after[:, n : 2 * n] -= p[:, None] * kick
        after[:, 2 * n - 1] = np.where(meets & np.isfinite(p), -cases.e * v, after[:, 2 * n - 1])
        after[:, 2 * n :] += (cases.alpha * p)[:, None] * operator.warming[:, -1]
        after[:, :n] = states[:, :n] + h * (theta * after[:, n : 2 * n] + (1 - theta) * states[:, n : 2 * n])
        states = after
        recorder.record(states[:, :n], states[:, n : 2 * n], states[:, 2 * n :], p, load)
    return _judged(operator, kick[:, -1], recorder.results())


def _judged(operator: DenseOperator, delassus: Array, results: Results) -> Results:
    """Return results whose statuses say what theory knows: no unique solution, or a free step that grows."""
    status, messages = results.status.copy(), dict(results.messages)
    for case in range(status.size):
        if status[case] != Status.OK and delassus[case] <= 0:
            status[case] = Status.ILL_POSED
            messages[case] = f"contact has no unique solution at h = {operator.h:.6g} s (W <= 0); take a smaller h"
        elif operator.growth > 1 + ROUNDING * operator.step.shape[0]:
            status[case] = Status.DIVERGED
            messages[case] = f"the free step grows {operator.growth:.6g}-fold at h = {operator.h:.6g} s"
    return replace(results, status=status, messages=messages)


def cost(structure: Structure, h: float, sampling: Sampling) -> float:
    """Return the estimated seconds of a case."""
    states = 2 * structure.mechanical_size + structure.thermal_size
    return sampling.steps(h) * (_LOOP + _TERM * states * states) * (2 if sampling.balances else 1) / 4


def operator_name(structure: Structure) -> str:
    """Return what a structure is stepped by, as ``plan`` says it."""
    states = 2 * structure.mechanical_size + structure.thermal_size
    reason = "the load does not act on the tip" if structure.damper is None else "damping couples the modes"
    return f"a dense matrix of {states} states, as {reason}: {states * states} products a step"
