"""Contact laws whose parameters are numbers or differ from case to case of a batch."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scenes import cases, heavy_chain, same_bits, taken
from workflow.models import Cases, Structure
from workflow.schemes import Sampling, penalty
from workflow.schemes._fixed.spring import CentralSpring

SAMPLING = Sampling(0.02, 1e-3, 21, balances=True)


def batch(structure: Structure, count: int) -> Cases:
    return cases(structure, count, alpha=np.linspace(0.5, 5, count), gap=5e-5, amplitude=100.0, frequency=20.0)


def with_law(operator: Any, law: Any) -> Any:
    """Return the operator with parameters of its law that stand for some cases."""
    return replace(operator, contact=replace(operator.contact, law=lambda cases: law))


def test_cases_of_one_batch_may_have_contact_springs_of_their_own() -> None:
    structure, stiffnesses = heavy_chain(), np.array([2e7, 1e8, 5e7])
    loaded, over = batch(structure, 3), replace(SAMPLING, balances=False)
    operators = [penalty.init(structure, 2e-6, penalty.Options(stiffness=k, damping=20.0)) for k in stiffnesses]
    together = with_law(operators[0], CentralSpring(stiffnesses, 20.0))
    results = penalty.compute(together, loaded, over)
    assert len(set(results.histories["impulse"][:, -1])) == 3
    for k, operator in enumerate(operators):
        alone = penalty.compute(operator, loaded.take(slice(k, k + 1)), over)
        assert same_bits(alone, taken(results, slice(k, k + 1)))
