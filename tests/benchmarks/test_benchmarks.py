"""Tiny versions of the benchmarks, so that they cannot rot."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import bench_against
import bench_bases
import bench_event_driven
import bench_first_run
import bench_limits
import bench_moreau
import bench_plan
import bench_rivals
import bench_scaling
import bench_shifts
import bench_table
import bench_workflow
import pytest

from scenes import sampling


def test_bases_are_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """With balances, whose kernels other tests need too."""
    monkeypatch.setattr(bench_bases, "sampling", lambda *over: replace(sampling(*over), balances=True))
    lines = bench_bases.text(sizes=(20,), steps=700).splitlines()[2:-1]
    assert len(lines) == 2 * len(bench_bases.reduction.names())
    assert all(float(line.split("|")[7]) < 1e-12 for line in lines)  # α_c


def test_shifts_print_their_lines(capsys: pytest.CaptureFixture[str]) -> None:
    bench_shifts.main(nodes=(2001,), vectors=(4,), counts=(2, 4))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(",")[0] for line in lines[1:]] == ["2001 nodes", "finite element blade"]
    for line in lines[1:]:
        assert len(line.split("vectors")[1].split()) == 2
        assert all(0 < float(error) < 0.1 for error in line.split("vectors")[1].split())


def test_event_driven_prints_its_lines(capsys: pytest.CaptureFixture[str]) -> None:
    bench_event_driven.main(count=1, runs=1)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines[:3]] == ["e = 0", "e = 0.5", "e = 0.9"]
    assert [line.split(";")[1].strip() for line in lines[3:]] == 2 * ["<= 1.3"]
    for line in lines[:3]:
        assert float(line.split("error ")[1].split(",")[0]) <= 1e-10


def test_moreau_prints_its_lines(capsys: pytest.CaptureFixture[str]) -> None:
    bench_moreau.main(counts=(1, 9), steps=100, runs=1)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(" cases")[0] for line in lines] == ["1", "9"]
    for line in lines:
        assert float(line.split("full ")[1].split(",")[0]) > 0


def test_rivals_print_their_lines(capsys: pytest.CaptureFixture[str]) -> None:
    bench_rivals.main(counts=(2,), steps=100, runs=2)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 4
    for line in lines:
        assert all(f"{label} " in line for label in bench_rivals.RIVALS)
        assert "moreau" in line
        assert "(x 1.00)" in line


def test_workflow_prints_its_lines(capsys: pytest.CaptureFixture[str]) -> None:
    bench_workflow.main(sizes=(8, 20), planned=100, heavy=4, runs=1, processes=False)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 11
    for line in lines:
        measured = line.split(": ")[1]
        assert measured == "not installed" or math.isfinite(float(measured.split()[0]))


def test_limits_print_their_table(capsys: pytest.CaptureFixture[str]) -> None:
    bench_limits.main(bench_limits.TINY)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["what", "asked", "for", "measured", "ratio"]
    for what in (
        "processor's peak",
        "full, 20 + 20",
        "reduced over full",
        "Siconos",
        "NumPy",
        "SciPy",
        "histories",
        "200 nodes, 8 cases",
    ):
        assert any(what in line for line in lines), what
    assert any("two threads" in line and "same bits" in line for line in lines)


def test_the_kept_table_is_what_the_script_prints(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Line by line but for numbers, and for what needs other processes."""

    def lines(text: str) -> set[str]:
        return {
            re.sub(r"[\d.]+(e-?\d+)?", "#", line.split("|")[1]) for line in text.splitlines() if line.startswith("| ")
        }

    text, curves = bench_table.main(bench_limits.TINY, 1, 4, (8, 20), processes=False, extent=bench_scaling.TINY)
    assert capsys.readouterr().out == text
    assert [curve.unit for curve in curves] == ["cases", "nodes", "modes"]
    bench_scaling.draw(curves, tmp_path / "scaling.png")
    assert (tmp_path / "scaling.png").stat().st_size > 10_000
    kept = bench_table._parts(bench_table.TABLE.read_text())[1]
    assert bench_table._parts(bench_table.README.read_text())[1] == bench_table.headlines(kept)
    assert bench_table.headlines(kept).count("\n") == 4 + len(bench_table.HEADLINES) == 10
    assert len(lines(text)) > 20
    assert {re.sub("cases?", "cases", line) for line in lines(text)} <= {
        re.sub("cases?", "cases", line) for line in lines(kept)
    }


@pytest.mark.slow  # five processes
def test_plan_prints_its_lines(capsys: pytest.CaptureFixture[str]) -> None:
    bench_plan.main(["abstract figure"])
    line = capsys.readouterr().out.splitlines()[1]
    assert all(float(line.split(f"{word} ")[1].split(",")[0].split()[0]) > 0 for word in ("first", "again", "wall"))


def test_a_first_run_is_set_beside_that_of_the_table_of_another_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    row = "| workflow run studies/blade.yaml, {} | ≤ {} s | {} s | 0.5 |\n"
    said = bench_first_run.rows(row.format("nothing compiled", 12, 8) + row.format("later", 3, 2.5))
    assert said == {"nothing compiled": (12, 8), "later": (3, 2.5)}
    before, now = ([{"later": seconds} for seconds in runs] for runs in ((1.0, 2.0, 4.0), (2.0, 3.0, 10.0)))
    assert bench_first_run.ratios(before, now) == {"later": 2.0}
    monkeypatch.setattr(bench_first_run, "on_reference_machine", lambda rounds: {"later": (3.0, 1.5)})
    (line,) = bench_first_run.lines(1)
    assert line[1:] == ("<= 3 s", "1.50 s", "0.50")


def test_two_versions_are_compared_row_by_row() -> None:
    head = "*a machine*\n\n| what | asked for | measured | ratio |\n|---|---|---|---|\n"
    runs = [
        bench_against.rows(f"{head}| load {load} | | same bits | 1.9 |\n| a step | <= 1 | {step} ns | 1.2 |\n")
        for load, step in ((0.1, 2.0), (0.7, 2.2), (0.3, 3.0), (0.4, 3.6))
    ]
    lines = bench_against.compared(runs[::2], runs[1::2])
    assert lines[2:] == ["| a step | 2.5e-09 s | 2.9e-09 s | 1.15 **over** |"]
