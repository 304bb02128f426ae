"""Memory of large studies: bounded, and not growing with the number of cases."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

from bench_workflow import HISTORIES, METRICS, memory

from workflow.solve._tasks import TASK_BYTES

HELD = 4 * TASK_BYTES / 2**20
"""MiB that two threads hold: a task's results and their copy on the way to a shard, for each."""

KNOWN = 64 / 2**20
"""MiB for each case: its hash, twice, where it is stored, and their orders."""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "cases"), [(METRICS, 1_000_000), (HISTORIES, 100_000)], ids=["metrics", "histories"])
def test_memory_does_not_grow_with_the_number_of_cases(kind: dict[str, str], cases: int) -> None:
    """The results are 180 and 480 MB; a run of few cases is less than two tasks, hence what tasks hold on top."""
    few, many = memory(cases // 10, kind), memory(cases, kind)
    assert many < few + HELD + KNOWN * cases
    assert many < 500
