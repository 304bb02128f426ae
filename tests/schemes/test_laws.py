"""Contact laws whose coefficients are numbers or differ from case to case of a batch."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import cases, heavy_chain, same_bits, taken
from workflow.models import Cases, Structure
from workflow.schemes import Sampling, carpenter, penalty
from workflow.schemes._fixed.central import Linear, Operator

SAMPLING = Sampling(0.02, 1e-3, 21, balances=True)


def batch(structure: Structure, count: int) -> Cases:
    return cases(structure, count, alpha=np.linspace(0.5, 5, count), gap=5e-5, amplitude=100.0, frequency=20.0)


def law_of(operator: Operator) -> Linear:
    """Return the law without friction."""
    return operator.contact.law(operator.h, cases(operator.structure), operator.delassus(np.zeros(1)))


def with_law(operator: Operator, law: Linear) -> Operator:
    """Return the operator with a law that does not depend on W."""
    return replace(operator, contact=replace(operator.contact, law=lambda *_: law))


def spread_over(law: Linear, count: int) -> Linear:
    """Return the law with each coefficient given once for each case."""
    each = {name: np.full(count, value) for name, value in law._asdict().items() if name != "holds"}
    return law._replace(**each)


@pytest.mark.parametrize(("scheme", "options"), [(carpenter, {}), (penalty, {"damping": 50.0})])
def test_coefficients_of_each_case_give_the_bits_of_shared_ones(scheme: Any, options: dict[str, float]) -> None:
    structure = heavy_chain()
    operator, loaded = scheme.init(structure, 2e-6, scheme.Options(**options)), batch(structure, 19)
    shared = scheme.compute(operator, loaded, SAMPLING)
    assert shared.metrics["impacts"].max() > 0
    each = spread_over(law_of(operator), loaded.count)
    own = scheme.compute(with_law(operator, each), loaded, SAMPLING)
    assert same_bits(shared, own)


def test_cases_of_one_batch_may_have_contact_springs_of_their_own() -> None:
    structure, stiffnesses = heavy_chain(), (2e7, 1e8, 5e7)
    loaded = batch(structure, 3)
    operators = [penalty.init(structure, 2e-6, penalty.Options(stiffness=k, damping=20.0)) for k in stiffnesses]
    laws = [law_of(operator) for operator in operators if isinstance(operator, Operator)]
    each = {name: np.array([getattr(law, name) for law in laws]) for name in Linear._fields if name != "holds"}
    together = laws[0]._replace(**each)
    results = penalty.compute(with_law(operators[0], together), loaded, SAMPLING)
    assert len(set(results.histories["impulse"][:, -1])) == 3
    for k, operator in enumerate(operators):
        alone = penalty.compute(operator, loaded.take(slice(k, k + 1)), SAMPLING)
        assert same_bits(alone, taken(results, slice(k, k + 1)))
