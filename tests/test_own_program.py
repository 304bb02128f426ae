"""The guide's page `From my program to a study` is followed as it stands, with files that CalculiX wrote."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from workflow import read_matrices, run_study
from workflow.models._matrix_files import files_of

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "studies" / "GUIDE.md").read_text(encoding="utf-8").split("\n## From my program to a study\n")[1]
PAGE = PAGE.split("\n## ")[0]
RECIPES = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def copied(place: Path, name: str) -> None:
    for file in files_of(ROOT / "tests" / "models" / "calculix" / "c3d8.sti"):
        shutil.copy(file, place / f"{name}{file.suffix}")


def test_the_page_leads_from_files_to_an_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tip is a face at x = 30 mm of a beam along x that turns about z: it moves to y, its casing slides to -y."""
    monkeypatch.chdir(tmp_path)
    for name in ("blade", "rest", "9000rpm"):
        copied(tmp_path, name)
    files, speeds, *_ = RECIPES
    names: dict = {}
    exec(compile(files, "the page", "exec"), names)
    written = read_matrices("blade.npz")
    assert np.array_equal(
        np.flatnonzero(written["contact"]) % len(names["labels"]), [names["moves"][k][0] for k in (0, 1)]
    )
    assert np.allclose(written["tangent"][0, names["moves"][0]], [0, -1, 0])
    assert np.allclose(written["angle"], 0)
    study = re.search(r"```yaml\n(study: own_blade.*?)```", PAGE, re.DOTALL)
    assert study is not None
    (tmp_path / "own.yaml").write_text(study[1])
    outcome = run_study("own.yaml")
    assert outcome.counts == {"ok": 3}
    assert (outcome.dataset["impacts"].sel(contact="13") > 0).all()
    exec(compile(speeds, "the page", "exec"), names)
    assert abs(read_matrices("turning.npz")["stiffness_speed2"]).max() == 0  # the files are the same


def test_the_recipe_of_a_finite_element_library_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    recipe = next(text for text in RECIPES if "skfem" in text)
    exec(compile("import workflow\nimport numpy as np\n" + recipe, "the page", "exec"), {})
    written = read_matrices("plate.npz")
    outwards, slides = (np.flatnonzero(written[name][0]) for name in ("contact", "tangent"))
    assert slides - outwards == 2  # from x of the first node to its z: about y the blade moves to -z
    assert written["tangent"][0, slides] == 1
    assert np.allclose(np.linalg.norm(written["contact"], axis=1), 1)


def test_the_recipe_of_ansys_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the file that PyMAPDL's reader ships, where that is installed."""
    examples = pytest.importorskip("ansys.mapdl.reader.examples")
    monkeypatch.chdir(tmp_path)
    shutil.copy(examples.fullfile, "file.full")
    recipe = next(text for text in RECIPES if "ansys" in text)
    exec(compile("import workflow\n" + recipe, "the page", "exec"), {})
    entries = read_matrices("blade.npz")
    assert entries["stiffness"].shape == entries["mass"].shape == (len(entries["labels"]),) * 2
