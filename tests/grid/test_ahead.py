"""What a study needs compiled, and that it runs all the same where nobody compiles it beforehand."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from quick import quick
from workflow.grid import _compile as compilation
from workflow.grid import arrange
from workflow.grid._ahead import kernel_variants
from workflow.run import run_study

THREE = {
    "axes": {"scheme": ["moreau", "springs"]},
    "schemes": {"springs": {"method": "penalty", "integration": "implicit"}},
    "reference": {"scheme": "event_driven"},
}


def test_every_scheme_and_the_reference_have_kernels_of_their_own() -> None:
    variants = kernel_variants(arrange(quick(**THREE)))
    assert [variant.method for variant in variants] == ["moreau", "penalty", "event_driven"]
    assert variants[1].options.integration == "implicit"
    assert [variant.method for variant in kernel_variants(arrange(quick()))] == ["moreau"]


def test_a_run_goes_on_where_its_helper_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is one that cannot be started."""
    asked: list[list[str]] = []
    start = compilation._started

    def noted(variants: Sequence[compilation.KernelVariant]) -> Any:
        asked.append([variant.method for variant in variants])
        return start(variants)

    monkeypatch.setattr(compilation, "_started", noted)
    monkeypatch.setattr(compilation, "_note", lambda variant: tmp_path / f"{variant.method}.compiled")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "missing"))
    assert run_study(quick(**THREE), tmp_path / "three.nc", threads=2).ok
    run_study(quick(**THREE), tmp_path / "alone.nc", threads=1)
    assert asked == [["penalty", "event_driven"]]
