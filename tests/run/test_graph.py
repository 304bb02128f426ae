"""Tasks and their references as graphs of dask: in pieces or whole the same archive, the longest task first."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from quick import quick
from studies import cut_finely
from workflow.archive import content_hash
from workflow.run import _threads, run_study

STUDY = quick({"h": [1e-4, 5e-5]}, reference={"scheme": "moreau", "h": 2e-5})


def computed(monkeypatch: pytest.MonkeyPatch, archive: Path, threads: int = 2) -> list[int]:
    """Run the study and return how many reference solutions each block had that was computed."""
    compute, sizes = _threads.compute_block, list[int]()

    def counting(grid: Any, block: Any) -> Any:
        sizes.append(len(block.inner))
        return compute(grid, block)

    monkeypatch.setattr(_threads, "compute_block", counting)
    run_study(STUDY, archive, threads=threads)
    monkeypatch.setattr(_threads, "compute_block", compute)
    return sizes


def test_pieces_of_a_graph_make_the_same_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """References are computed once in a graph, and again in the next one that needs them; on any number of threads."""
    assert sum(computed(monkeypatch, tmp_path / "whole.nc", 1)) == 2 * 9  # references and exact solutions beside them
    cut_finely(monkeypatch)
    assert sum(computed(monkeypatch, tmp_path / "cut.nc", 4)) == 2 * 9
    monkeypatch.setattr(_threads, "graphs", partial(_threads.graphs, most=3))
    assert sum(computed(monkeypatch, tmp_path / "pieces.nc")) == 4 * 9
    assert len({content_hash(tmp_path / f"{name}.nc") for name in ("whole", "cut", "pieces")}) == 1
