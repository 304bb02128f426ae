"""README, notebooks and kept archives are true: commands run, figures are there, results repeat."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from workflow.archive import open_archive, provenance
from workflow.run import run_study
from workflow.study import parse_study, read_study

ROOT = Path(__file__).parents[1]
STUDIES = sorted((ROOT / "studies").rglob("*.yaml"))
KEPT = sorted((ROOT / "data").glob("*.nc"))


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)


def test_readme_s_study_is_a_study(tmp_path: Path) -> None:
    study = parse_study(blocks("yaml")[0], "README.md")
    assert [d.name for d in study.dimensions] == ["scheme", "e", "h", "alpha", "gap", "model"]


def test_readme_names_every_command() -> None:
    from workflow.cli import app

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for command in app.registered_commands:
        assert f"`workflow {command.callback.__name__}" in text


@pytest.mark.parametrize("path", STUDIES, ids=lambda p: p.name)
def test_every_study_reads(path: Path) -> None:
    assert read_study(path).name == path.stem


@pytest.mark.parametrize("path", sorted((ROOT / "studies").glob("*.ipynb")), ids=lambda p: p.name)
def test_notebooks_keep_their_figures(path: Path) -> None:
    outputs = [o for cell in json.loads(path.read_text())["cells"] for o in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not any(output["output_type"] == "error" for output in outputs)


@pytest.mark.parametrize("kept", KEPT, ids=lambda p: p.name)
def test_kept_archives_repeat(kept: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """A kept archive is what its study gives today, to the rounding of another machine's libraries."""
    again = tmp_path / kept.name
    run_study(parse_study(provenance(kept)["study"], kept.name), again)
    if request.config.getoption("--regenerate"):
        kept.write_bytes(again.read_bytes())
        pytest.skip("regenerated, not compared")
    with open_archive(kept) as old, open_archive(again) as new:
        assert set(old.variables) == set(new.variables)
        for name in old.data_vars:
            if name == "wall_time":
                continue
            before, after = old[name].values, new[name].values
            if before.dtype.kind == "f":
                scale = np.nanmax(np.abs(before[np.isfinite(before)]), initial=0.0)
                assert np.array_equal(np.isfinite(before), np.isfinite(after)), name
                close = np.abs(before - after)[np.isfinite(before)]
                assert close.max(initial=0.0) <= 1e-9 * scale, name
            else:
                assert np.array_equal(before, after), name


def test_the_abstract_s_figure_is_kept_from_its_study() -> None:
    kept = ROOT / "data" / "abstract_figure.nc"
    assert provenance(kept)["study"] == (ROOT / "studies" / "abstract_figure.yaml").read_text(encoding="utf-8")
