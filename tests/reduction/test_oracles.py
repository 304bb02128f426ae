"""Thermal bases against the reductors of pyMOR: balanced truncation, and what no basis can do better."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import heavy_chain
from workflow import reduction
from workflow.models import Structure
from workflow.reduction import reduce_structure

DURATION = 0.3
FREQUENCIES = np.logspace(-3, 4, 300)
"""rad/s: the rates of the heavy chain are 0.018 to 1.8 1/s."""


def answer(structure: Structure) -> np.ndarray:
    """Temperature of the tip by a unit heat load on it, at each frequency, K/W."""
    capacity, conductance = structure.heat_capacity, structure.conductance_matrix
    tip = np.eye(len(capacity))[-1]
    return np.array([np.linalg.solve(1j * w * capacity + conductance, tip)[-1] for w in FREQUENCIES])


@pytest.mark.slow
@pytest.mark.parametrize("vectors", [4, 6, 8])
def test_what_balanced_truncation_can_do(vectors: int) -> None:
    """Its error is a law for all bases from below: the first Hankel singular value that is left out.

    Over all frequencies it is the best to be had. Bases here need right static answers (α_c) and right ones within the
    duration of a case: above 1/duration krylov is a hundred times better and more.
    """
    from pymor.core.logger import set_log_levels
    from pymor.models.iosys import LTIModel
    from pymor.reductors.bt import BTReductor
    from pymor.reductors.h2 import OneSidedIRKAReductor

    set_log_levels({"pymor": "ERROR"})
    whole = heavy_chain()
    tip = np.eye(20)[:, -1:]
    system = LTIModel.from_matrices(-whole.conductance_matrix, tip, tip.T, E=whole.heat_capacity)
    exact, least = answer(whole), system.hsv()
    others = {"balanced": BTReductor(system), "one-sided IRKA": OneSidedIRKAReductor(system, "V")}
    errors = {}
    for name, reductor in others.items():
        transfer = reductor.reduce(vectors).transfer_function
        errors[name] = np.abs(np.array([transfer.eval_tf(1j * w)[0, 0] for w in FREQUENCIES]) - exact)
    for name in reduction.names():
        small = reduce_structure(whole, None, vectors - 1, name, DURATION).structure
        errors[name] = np.abs(answer(small) - exact)
        assert errors[name].max() > 0.99 * least[vectors]
    assert errors["balanced"].max() < 2 * least[vectors:].sum()
    acting = FREQUENCIES > 1 / DURATION
    rivals = min(errors[name][acting].max() for name in others)
    assert errors["krylov"][acting].max() < 1e-2 * rivals
