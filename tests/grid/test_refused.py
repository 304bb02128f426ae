"""What a scheme refuses is not compiled, and harms no other case."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from workflow import schemes
from workflow.archive import open_archive
from workflow.grid._ahead import kernel_variants
from workflow.grid._arrangement import arrange
from workflow.grid._compile import KernelVariant, compile_scheme
from workflow.run import run_study
from workflow.study import read_study

AUDIT = Path(__file__).parent / "audit"


def variant(massless_tip: bool) -> KernelVariant:
    return KernelVariant("penalty", schemes.load("penalty").Options(), True, massless_tip=massless_tip)


def test_a_refused_variant_of_a_scheme_raises_into_no_case() -> None:
    for massless_tip in (True, False):
        compile_scheme(variant(massless_tip))


def test_a_refused_basis_is_not_compiled() -> None:
    """The first case of each scheme has a tip without mass, which moreau alone takes."""
    grid = arrange(read_study(AUDIT / "refused_bases.yaml"))
    assert {one.method for one in kernel_variants(grid)} == {"moreau"}


@pytest.mark.parametrize("run", [*range(4), *(pytest.param(run, marks=pytest.mark.slow) for run in range(4, 30))])
def test_refused_bases_fail_alone_on_two_threads(run: int, tmp_path: Path) -> None:
    run_study(read_study(AUDIT / "refused_bases.yaml"), tmp_path / "a.nc", threads=2)
    with open_archive(tmp_path / "a.nc") as archive:
        failed = archive.status.transpose("scheme", "reduction", "model").values != 0
    refused = np.zeros((4, 3), dtype=bool)
    refused[1:, :2] = True  # macneal and massless, of all schemes but moreau
    assert (failed == refused[:, :, None]).all()
