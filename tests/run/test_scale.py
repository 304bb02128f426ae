"""Memory of large studies: bounded, and not growing with the number of cases."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

from bench_workflow import HISTORIES, METRICS, memory


@pytest.mark.slow
@pytest.mark.parametrize("kind", [METRICS, HISTORIES], ids=["metrics", "histories"])
def test_memory_does_not_grow_with_the_number_of_cases(kind: dict[str, str]) -> None:
    """Ten times the cases take a tenth more memory at most: labels and statuses, never the results."""
    few, many = memory(10_000, kind), memory(100_000, kind)
    assert many < 1.1 * few + 32
    assert many < 1000
