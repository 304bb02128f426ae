"""Tiny versions of the benchmarks, so that they cannot rot."""

from __future__ import annotations

import bench_event_driven
import bench_moreau
import bench_rivals
import pytest


def test_event_driven_prints_its_lines(capsys: pytest.CaptureFixture[str]) -> None:
    bench_event_driven.main(count=1, runs=1)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == ["e = 0", "e = 0.5", "e = 0.9"]
    for line in lines:
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
