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
NAMES = [
    "abstract_figure",
    "work_precision",
    "work_precision_blade",
    *(f"hard/{p.stem}" for p in STUDIES if p.parent.name == "hard"),
]
LONG = {"work_precision", "work_precision_blade", "hard/all_steps"}
KEPT = [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in NAMES]
"""Studies whose archives are kept in ``data/``, by path; ``pytest -m "slow or not slow" --regenerate`` writes them."""


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


@pytest.mark.parametrize("name", KEPT)
def test_kept_archives_repeat(name: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """A kept archive is what its study gives today, to the rounding of another machine's libraries.

    ``wall_time`` is that of the run which was kept, and cases that are not ok have no values to compare.
    """
    kept, again = ROOT / "data" / f"{name}.nc", tmp_path / "again.nc"
    run_study(read_study(ROOT / "studies" / f"{name}.yaml"), again, threads=1)  # the times kept are of one thread
    if request.config.getoption("--regenerate"):
        kept.parent.mkdir(exist_ok=True)
        kept.write_bytes(again.read_bytes())
        pytest.skip("regenerated, not compared")
    with open_archive(kept) as old, open_archive(again) as new:
        assert set(old.variables) == set(new.variables)
        assert np.array_equal(old["status"].values, new["status"].values)
        ok = old["status"] == 0
        for variable in set(old.data_vars) - {"wall_time", "message", "status"}:
            before, after = (np.asarray(d[variable].where(ok).values, dtype=float) for d in (old, new))
            finite = np.isfinite(before)
            assert np.array_equal(finite, np.isfinite(after)), variable
            relative = old[variable].attrs.get("units") == "1" and variable not in ("impacts", "steps")
            scale = np.abs(before[finite]).max(initial=1.0 if relative else 0.0)  # errors and residuals may be rounding
            assert np.abs(before[finite] - after[finite]).max(initial=0.0) <= 1e-9 * scale, variable


@pytest.mark.parametrize("name", NAMES)
def test_kept_archives_are_of_today_s_studies(name: str) -> None:
    kept = ROOT / "data" / f"{name}.nc"
    assert provenance(kept)["study"] == (ROOT / "studies" / f"{name}.yaml").read_text(encoding="utf-8")


def test_nothing_is_kept_without_its_study() -> None:
    data = ROOT / "data"
    assert {str(p.relative_to(data).with_suffix("")) for p in data.rglob("*.nc")} == set(NAMES)
