"""Symplectic Euler with projected contacts: those that would end beyond their casing are put on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from workflow.kernels.lemke import complementarity
from workflow.models import Array, Cases, Structure, project
from workflow.schemes import Recorder, Results, Sampling

READS = frozenset({"h", "alpha"})
GENERAL = frozenset({"contacts", "load"})


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
    """Step v' = v + h M⁻¹ (f - C1 v - K1 x - K12 θ - wᵀp/h), x' = x + h v' with 0 <= p ⊥ d - w x' >= 0."""
    structure, h, mobility, warming = operator
    recorder, contacts = Recorder(structure, cases, sampling, h), structure.contacts
    moves = mobility @ contacts.normal.T
    x, v, temperature = cases.displacement, cases.velocity, cases.temperature
    for _ in range(recorder.steps):
        load = recorder.load()
        force = cases.steady - project(structure.damping_matrix, v) - project(structure.stiffness_matrix, x)
        force += load[:, None] * structure.load_direction - project(structure.coupling_matrix, temperature)
        free = v + h * project(mobility, force)
        closing = project(contacts.normal, free) - (cases.clearances - project(contacts.normal, x)) / h
        p = np.zeros_like(closing)
        for case in np.flatnonzero((closing > 0).any(axis=1)):
            p[case] = complementarity(contacts.normal @ moves, -closing[case])
        heat = h * (cases.heating - project(structure.conductance_matrix, temperature))
        heat += project(contacts.heat.T, cases.alpha[:, None] * p)
        v = free - project(moves, p)
        x, temperature = x + h * v, temperature + project(warming, heat)
        recorder.record(x, v, temperature, p, load)
    return recorder.results()
