"""Symplectic Euler with a projected tip: the tip that would end beyond the casing is put on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from workflow.models import Array, Cases, Structure, project
from workflow.schemes import Recorder, Results, Sampling

READS = frozenset({"h", "alpha"})


@dataclass(frozen=True)
class Options:
    """It has none."""


class Operator(NamedTuple):
    """The structure, the step and M⁻¹, C2⁻¹."""

    structure: Structure
    h: float
    mobility: Array
    warming: Array


def init(structure: Structure, h: float, options: Options) -> Operator:
    """Invert the masses and heat capacities once for a batch."""
    return Operator(structure, h, np.linalg.inv(structure.mass), np.linalg.inv(structure.heat_capacity))


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step v' = v + h M⁻¹ (f - C1 v - K1 x - K12 θ) - M⁻¹ e_n p, x' = x + h v' with p >= 0 so that x_n' <= d."""
    structure, h, mobility, warming = operator
    recorder = Recorder(structure, cases, sampling, h)
    x, v, temperature = cases.displacement, cases.velocity, cases.temperature
    for _ in range(recorder.steps):
        force = cases.steady - project(structure.damping_matrix, v) - project(structure.stiffness_matrix, x)
        force = force - project(structure.coupling_matrix, temperature)
        load = recorder.load()
        force[:, -1] += load
        free = v + h * project(mobility, force)
        p = np.maximum(0.0, (free[:, -1] - (cases.gap - x[:, -1]) / h) / mobility[-1, -1])
        heat = h * (cases.heating - project(structure.conductance_matrix, temperature))
        heat[:, -1] += cases.alpha * p
        v = free - p[:, None] * mobility[:, -1]
        x, temperature = x + h * v, temperature + project(warming, heat)
        recorder.record(x, v, temperature, p, load)
    return recorder.results()
