"""Estimated seconds per heated case: a fixed model of steps, modes and samples, by which tasks are cut.

Its numbers lie between what a batch of eight and what a batch of a thousand cases took on one
core of a server processor of 2024 (Zen 5, vectors of eight, 3 to 4 GHz), heated, full with 20
nodes and reduced to 3 + 12 modes. A processor with vectors of four takes about
twice as long; fewer than eight cases cost together what eight do.
"""

from __future__ import annotations

from typing import Any

from workflow.models import Structure, needs_matrices
from workflow.schemes._interface import Sampling
from workflow.schemes._sweep.sweeps import is_swept

_SAMPLE = 1.5e-8
"""Seconds for a sample."""

_CASE = 1.5e-6
"""Seconds to set a case up."""

_DENSE_STEP, _DENSE_TERM = 6e-8, 2e-10
"""Seconds of a step by a dense matrix of a case of eight, and of a product of two numbers in it."""


def _seconds(tip: float, structure: Structure, h: float, sampling: Sampling) -> float:
    """Return the seconds of a case stepped by a dense matrix or in modes, ``tip`` seconds a step beside its modes.

    A step takes 0.09 ns for each mechanical and 0.05 ns for each thermal mode. Balances add 0.3 ns, and 0.06 ns for
    each mechanical mode.
    """
    modes, heats, steps = structure.mechanical_size, structure.thermal_size, sampling.steps(h)
    if needs_matrices(structure):
        states = 2 * modes + heats
        return steps * (_DENSE_STEP + _DENSE_TERM * states * states) * (2 if sampling.balances else 1)
    step = tip + 0.9e-10 * modes + 0.5e-10 * heats
    if sampling.balances:
        step += 0.3e-9 + 0.6e-10 * modes
    return steps * step + sampling.count * _SAMPLE + _CASE


def theta_cost(structure: Structure, h: float, options: Any, sampling: Sampling) -> float:
    """Return the seconds of a case of the θ-method.

    Swept along the nodes of a chain it takes 3.4 ns a node and step, 5.4 ns with balances.
    """
    if not is_swept(structure):
        return _seconds(0.6e-9, structure, h, sampling)
    nodes = structure.mechanical_size
    step = 3e-8 + (5.4e-9 if sampling.balances else 3.4e-9) * nodes
    return sampling.steps(h) * step + sampling.count * _SAMPLE + 1e-7 * nodes


def central_cost(structure: Structure, h: float, options: Any, sampling: Sampling) -> float:
    """Return the seconds of a case of central differences."""
    return _seconds(1.0e-9, structure, h, sampling)
