"""A reference whose basis is refined until that changes it less than a tolerance: its error is what it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from matrix_files import as_sparse_npz, matrices_of
from scenes import chain
from studies import SCENE, parsed, written
from workflow.grid import arrange, plan_study
from workflow.models import Rayleigh, Structure
from workflow.run import run_study, verify
from workflow.study import read_study

NODES = 310
"""Coordinates of a sparse structure that can also be solved in full, by LAPACK."""


def powers_of_two(nodes: int) -> Structure:
    """Return a chain whose matrices hold sums of powers of two: no entry of its file is rounded.

    With other entries, rounding them moves the answers by eps times the condition of K1 and K2, 3e-11 here, and a
    basis that is right to 1e-12 cannot be told from one that is not.
    """
    return chain(
        nodes=nodes,
        mass=2.0**-14,
        stiffness=2.0**28,
        spacing=2.0**-13,
        expansion=2.0**-17,
        heat_capacity=2.0**-7,
        conductance=2.0**3,
        convection=2.0**-9,
        damping=Rayleigh(10.0, 2e-7),
    )


STUDY = """
study: refined
scene:
  matrices: {{file: sparse.npz, contact: {tip}, thermal_contact: {tip}, damping: {{mass: 10, stiffness: 2.0e-7}}}}
  casing: {{gap: 20 um}}
  load: {{amplitude: 24, frequency: 20 Hz}}
  duration: 0.05 s
axes: {{scheme: event_driven, reduction: [{bases}], alpha: [0, 30]}}
reference:
  {{scheme: event_driven, reduction: krylov, mechanical_modes: auto, thermal_modes: auto, tolerance: {tolerance}}}
output: {{interval: 0.5 ms, histories: []}}
"""


def study_of(directory: Path, tolerance: float, bases: str = "krylov") -> Path:
    as_sparse_npz(matrices_of(powers_of_two(NODES)), directory)
    return written(STUDY.format(tip=NODES - 1, tolerance=tolerance, bases=bases), directory)


@pytest.mark.slow  # events of 309 + 309 modes, and growth rates
@pytest.mark.parametrize("tolerance", [1e-5, 1e-8, 1e-10])
def test_the_error_of_a_reference_is_that_against_the_full_solution(tolerance: float, tmp_path: Path) -> None:
    """Cases are solved in full: what they seem to err is the error of the reference."""
    study = read_study(study_of(tmp_path, tolerance))
    dataset = run_study(study, tmp_path / "a.nc").dataset.load()
    stated = float(dataset["reference_basis_error"].max())
    assert float(dataset["reference_basis_error"].min()) == stated
    true = max(float(dataset[name].max()) for name in ("displacement_error", "temperature_error"))
    assert 0 < true <= stated * 1.2
    assert stated <= tolerance
    [choice] = arrange(study).choices.values()
    assert choice.mechanical_modes < NODES - 1
    structure = f"{NODES} + {NODES} coordinates"
    assert f"reference, tolerance {tolerance:g}, krylov, {structure}" in plan_study(study).choices[0]
    assert {check.name for check in verify(tmp_path / "a.nc", 0) if check.holds} >= {"cases", "choices"}


def test_one_choice_serves_all_bases_of_the_cases(tmp_path: Path) -> None:
    grid = arrange(read_study(study_of(tmp_path, 1e-2, "krylov, rubin")))
    assert len(grid.choices) == 1
    assert len({grid.reference_choice(outer) for outer in range(grid.outer_count)}) == 1


def test_a_small_structure_is_compared_with_the_full_one() -> None:
    reference = "{scheme: event_driven, mechanical_modes: auto, thermal_modes: auto, tolerance: 0.1}"
    text = f"study: a\n{SCENE}axes: {{scheme: event_driven, alpha: [0, 20]}}\nreference: {reference}\n"
    [choice] = arrange(parsed(text)).choices.values()
    assert "the full model" in choice.against
    assert 0 < choice.error <= 0.1
