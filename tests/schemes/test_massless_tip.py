"""A tip that its reduction leaves without mass: a contact without impacts, and schemes that cannot step it."""

import pytest

from scenes import cases, heavy_chain, sampling, step
from workflow.reduction import reduce_structure
from workflow.schemes import Status


@pytest.mark.parametrize("method", ["carpenter", "paoli_schatzman", "penalty"])
def test_schemes_that_cannot_step_it_say_so(method: str) -> None:
    structure = reduce_structure(heavy_chain(), 3, 5, "massless").structure
    with pytest.raises(ValueError, match=r"without mass|with mass"):
        step(structure, cases(heavy_chain(nodes=4)), 1e-6, sampling(1e-3, 1e-4), method)


def test_theta_below_one_half_diverges_beyond_a_step() -> None:
    reduction = reduce_structure(heavy_chain(), 3, 5, "massless")
    batch = reduction.project(cases(heavy_chain(), 1, gap=1.0, displacement=1e-6))
    run = step(reduction.structure, batch, 1e-4, sampling(1e-2, 1e-3), theta=0.4)
    assert run.status.tolist() == [Status.DIVERGED]
    assert "it is stable up to h" in run.messages[0]
