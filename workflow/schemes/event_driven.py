"""Event-driven scheme: the exact solution of the model, from contact event to contact event.

Between events the structure is linear, and its load and the position d(t) of its casing are finite sums of sinusoids,
so that its motion is known in closed form:

    M x'' + C1 x' + K1 x + K12 θ = f(t) - λ e_n,   C2 θ' + K2 θ = q + α λ e_n

with the tip free (λ = 0) or held on the casing (x_n = d(t), λ the reaction). A flight ends where the gap d - x_n falls
through zero, a contact where λ does. At an impact with u⁻ > 0, u = v_n - d',

    u⁺ = -e u⁻,   p = (1 + e) u⁻ / (e_nᵀ M⁻¹ (e_n - µ t)),   v⁺ = v⁻ - p M⁻¹ (e_n - µ t),   θ⁺ = θ⁻ + α p C2⁻¹ e_n;

a tip that is pressed on the casing with u = 0 begins a contact, and chattering is summed in closed form
(:mod:`workflow.schemes._exact.events`). No event is missed: each step is certified by bounds of the Taylor
remainder (:mod:`workflow.schemes._exact.step`). A coating that is worn has events of its own
(:mod:`workflow.schemes._exact.coating`). The only error is rounding. There is no step size: ``h`` is not read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workflow.declare import quantity
from workflow.models import Array, Cases, Structure, couples_free_modes, poles
from workflow.schemes._exact.batch import ExactOperator, make_operator, run_batch
from workflow.schemes._exact.closed_sets import ClosedSet
from workflow.schemes._exact.set_motion import Budget
from workflow.schemes._exact.trajectory import Trajectory, growth, one_case, propagators, trajectory
from workflow.schemes._interface import Results, Sampling

__all__ = [
    "Budget",
    "ClosedSet",
    "ExactOperator",
    "Options",
    "Trajectory",
    "amplification",
    "compute",
    "growth",
    "init",
    "make_operator",
    "one_case",
    "operator_name",
    "propagators",
    "thermal_amplification",
    "trajectory",
]

READS = frozenset({"e", "alpha"})
GENERAL = frozenset({"coating", "contacts", "damping", "depth", "elastic", "friction", "load", "massless"})

HARMONICS = frozenset({"load", "casing"})
STEP_SECONDS = 1.4e-8


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    events: int = quantity("1", "most contact events of one case", default=200_000, at_least=1)
    steps: int = quantity("1", "most certified steps of one case", default=5_000_000, at_least=1)


_SEPARATING = 4e-9
"""Time to separate the poles over the cube of the number of states, s."""


def init(structure: Structure, h: float, options: Options) -> ExactOperator:
    """Diagonalise the structure with its contacts open; ``h`` is not read."""
    return make_operator(structure, Budget(options.events, options.steps))


def compute(operator: ExactOperator, cases: Cases, sampling: Sampling) -> Results:
    """Run a batch."""
    return run_batch(operator, cases, sampling)


def operator_name(structure: Structure) -> str:
    """Return how a structure whose damping couples modes is solved, as ``plan`` prints it; empty for others."""
    if not couples_free_modes(structure):
        return ""
    states = 2 * structure.mechanical_size + structure.thermal_size
    seconds = f"{_SEPARATING * states**3:.1g} s"
    return f"poles of {states} states, as damping couples the modes: about {seconds} a batch and each alpha"


def amplification(frequency: Array, damping: Array, h: float, options: Options) -> Any:
    """Return exp(s h) of the two poles s of each mode, complex, ``(mode, 2)``."""
    return np.exp(h * poles(frequency, damping))


def thermal_amplification(rate: Array, h: float, options: Options) -> Array:
    """Return exp(-μ h) of each thermal mode."""
    return np.exp(-rate * h)
