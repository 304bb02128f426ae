"""Schemes crossed with bases whose contact has no mass: what can run runs, the rest says why, uncompiled."""

from pathlib import Path

import numpy as np
import pytest

from studies import SCENE, parsed
from workflow.archive import open_archive
from workflow.cases import Grid, arrange
from workflow.plan import plan_study
from workflow.run import run_study
from workflow.schemes import Status
from workflow.solve import Solved, solve
from workflow.solve._solve import kernel_variants
from workflow.study import Study, read_study

CROSSED = """
schemes:
  euler: {method: moreau}
  midpoint: {method: moreau, theta: 0.5}
axes:
  scheme: [euler, midpoint, penalty, carpenter, event_driven]
  reduction: [craig_bampton, macneal, massless]
  h: [1e-5]
  alpha: [5]
zip: {model: {mechanical_modes: [1, full], thermal_modes: [1, full]}}
reference: {scheme: event_driven, mechanical_modes: full, thermal_modes: full}
output: {interval: 1 ms}
"""
ABLE = {"euler", "midpoint", "spring", "event_driven"}


@pytest.fixture(scope="module")
def study() -> Study:
    return parsed(f"study: a\n{SCENE}{CROSSED}")


def at(grid: Grid, **settings: object) -> Solved:
    for outer in range(grid.outer_count):
        cell = grid.settings(outer)
        if (cell.scheme.label, cell.reduction, cell.mechanical_modes) == tuple(settings.values()):
            return solve(grid, outer, np.arange(1))
    raise KeyError(settings)


@pytest.mark.parametrize("scheme", ["euler", "penalty", "carpenter", "event_driven"])
def test_a_scheme_that_cannot_fails_its_own_cases(study: Study, scheme: str) -> None:
    results = at(arrange(study), scheme=scheme, reduction="massless", mechanical_modes=1)
    if scheme in ABLE:
        assert results.values["status"].tolist() == [Status.OK]
        assert results.messages == {}
        for name in ("displacement", "temperature", "impulse"):
            whole, by_scheme, by_model = (
                results.values[f"{name}{part}_error"][0] for part in ("", "_scheme", "_model")
            )
            assert by_model > 0
            assert (by_scheme > 0) == (scheme != "event_driven")
            assert whole <= (by_scheme + by_model) * (1 + 1e-12)
    else:
        assert results.values["status"].tolist() == [Status.FAILED]
        assert "mass" in results.messages[0]


def test_the_plan_says_so_beforehand(study: Study) -> None:
    warnings = plan_study(study).warnings
    assert sum("fails with m" in text for text in warnings) == 4
    assert not any(text.startswith(scheme) and "fails" in text for text in warnings for scheme in ABLE)


AUDIT = Path(__file__).parent / "audit"


def test_a_refused_basis_is_not_compiled() -> None:
    """The first case of each scheme has a contact without mass, which two of them take."""
    grid = arrange(read_study(AUDIT / "refused_bases.yaml"))
    assert {one.method for one in kernel_variants(grid)} == {"moreau", "event_driven"}


@pytest.mark.parametrize("run", range(2))
def test_refused_bases_fail_alone_on_two_threads(run: int, tmp_path: Path) -> None:
    run_study(read_study(AUDIT / "refused_bases.yaml"), tmp_path / "a.nc", threads=2)
    with open_archive(tmp_path / "a.nc") as archive:
        failed = archive.status.transpose("scheme", "reduction", "model").values != 0
    refused = np.zeros((4, 3), dtype=bool)
    refused[[1, 3], :2] = True  # macneal and massless, of central differences
    assert (failed == refused[:, :, None]).all()
