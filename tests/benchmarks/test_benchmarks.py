"""Tiny versions of the benchmarks, so that they cannot rot; memory of large studies."""

import re

import bench_against
import bench_bases
import bench_table
import pytest
from bench_workflow import HISTORIES, METRICS, memory
from timing import TINY, parts

from workflow.solve._tasks import TASK_BYTES


def test_bases_are_told_of() -> None:
    """With balances, whose kernels other tests need too."""
    lines = bench_bases.text(sizes=(20,), steps=700, balances=True).splitlines()[2:-1]
    assert len(lines) == 2 * len(bench_bases.reduction.names())
    assert all(float(line.split("|")[7]) < 1e-12 for line in lines)  # α_c


@pytest.mark.slow
def test_the_kept_table_is_what_the_script_prints() -> None:
    """Line by line but for numbers, and for what needs other processes."""

    def lines(text: str) -> set[str]:
        rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| ")]
        return {
            re.sub(r"[\d.]+(e-?\d+)?", "#", row).replace("case ", "cases ").replace("case,", "cases,") for row in rows
        }

    text = bench_table.table(TINY, processes=False)
    kept = parts(*bench_table.TABLE)[1]
    assert len(lines(text)) > 20
    assert lines(text) <= lines(kept)


def test_two_versions_are_compared_row_by_row() -> None:
    head = "*a machine*\n\n| what | asked for | measured | ratio |\n|---|---|---|---|\n"
    runs = [
        bench_against.rows(
            f"{head}| two threads, load {load} | | same bits | 1.9 |\n"
            f"| a step, error against itself {load} | <= 1 | {step} ns | 1.2 |\n"
            f"| of the {name} alone | | 1 s | |\n"
        )
        for load, step, name in ((0.1, 2.0, "old"), (0.7, 2.2, "new"), (0.3, 3.0, "old"), (0.4, 3.6, "new"))
    ]
    lines = bench_against.compared(runs[::2], runs[1::2])
    assert lines[2:] == ["| a step | 2.5e-09 s | 2.9e-09 s | 1.15 **over** |"]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "cases"), [(METRICS, 1_000_000), (HISTORIES, 100_000)], ids=["metrics", "histories"])
def test_memory_does_not_grow_with_the_number_of_cases(kind: dict[str, str], cases: int) -> None:
    """The results are 180 and 480 MB; a run of few cases is less than two tasks, hence what tasks hold on top."""
    few, many = memory(cases // 10, kind), memory(cases, kind)
    held = 4 * TASK_BYTES / 2**20  # by two threads: a task's results and their copy on the way to a shard, for each
    known = 64 / 2**20  # of each case: its hash, twice, where it is stored, and their orders
    assert many < few + held + known * cases
    assert many < 500
