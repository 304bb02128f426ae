"""A newcomer's path by README and guide alone, from the clone to the answer.

Blocks of the documents are run as they stand. What a newcomer adds is in this file.
"""

import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from terminal import workflow
from workflow import read_matrices, run_study
from workflow.models._matrix_files import files_of

ROOT = Path(__file__).parents[1]
README, GUIDE = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "studies/GUIDE.md"))

OWN = {
    "study: rub": "study: mine",
    "length: 40 mm": "length: 60 mm",
    "thickness: 1 mm": "thickness: 1.5 mm",
    "density: 4430": "density: 7800",
    "amplitude: 24": "amplitude: 30",
}
"""What a newcomer changes in the guide's study to have their own blade in it."""

AXES = """axes:
  scheme: [moreau, midpoint, event_driven]
  h: [1e-5, 1e-4]
  alpha: [0, 30]
  e: [0, 0.5]
  scene.casing.gap: [20 um, 24 um]
"""

BEAM = """
import numpy as np

n, ell = 20, 60e-3 / 20  # elements of a steel blade of 60 mm × 30 mm × 1.5 mm, pressed along its length
EA, rhoA, cA, kA, expansion = 2.1e11 * 45e-6, 7800 * 45e-6, 7800 * 460 * 45e-6, 45 * 45e-6, 1.2e-5


def assembled(element):
    whole = np.zeros((n + 1, n + 1))
    for k in range(n):
        whole[k : k + 2, k : k + 2] += element
    return whole[1:, 1:]  # clamped and kept cold at the root


share, difference = ell / 6 * np.array([[2, 1], [1, 2]]), np.array([[1, -1], [-1, 1]]) / ell
M, K1 = assembled(rhoA * share), assembled(EA * difference)
C2, K2 = assembled(cA * share), assembled(kA * difference)
K12 = assembled(EA * expansion / 2 * np.array([[1, 1], [-1, -1]]))
w = s = np.eye(n)[-1]
"""
"""Matrices that somebody brings: bar elements whose temperatures are linear, as their displacements."""


@dataclass(frozen=True)
class Place:
    """A directory, what runs ``workflow`` in it, and what returns the output of Python there."""

    directory: Path
    run: Callable[..., subprocess.CompletedProcess[str]]
    python: Callable[[str], str]

    def say(self, *words: str, fails: int = 0) -> str:
        """Return what a command prints; it ends with a status."""
        done = self.run(*words, cwd=self.directory)
        assert done.returncode == fails, done.stderr
        if fails:
            return done.stderr
        assert all("elapsed" in line for line in done.stderr.splitlines())  # of a run that takes minutes
        return done.stdout

    def write(self, name: str, text: str) -> str:
        """Write a file and return its name."""
        (self.directory / name).write_text(text, encoding="utf-8")
        return name


def block(language: str, holding: str = "", document: str = README) -> str:
    """Return a document's first block of code in a language that holds some text."""
    return next(text for text in re.findall(rf"```{language}\n(.*?)```", document, re.DOTALL) if holding in text)


def own_study(axes: str = AXES) -> str:
    """Return the guide's study with another blade and axes of their own."""
    text = block("yaml", document=GUIDE)
    for old, new in OWN.items():
        assert old in text
        text = text.replace(old, new)
    return re.sub(r"axes:.*?(?=zip:)", axes, text, flags=re.DOTALL)


def own_blade(place: Place) -> None:
    """Plan, run and decide on a study of one's own."""
    place.write("mine.yaml", own_study())
    assert "mine: " in place.say("plan", "mine.yaml")
    assert "mine.nc: 144 cases" in place.say("run", "mine.yaml")
    assert "status: 144 ok" in place.say("show", "mine.nc")
    said = place.say("recommend", "mine.nc", "--tolerance", "2%")
    assert " keeps within 2 % in all " in said
    answer = json.loads(place.say("recommend", "mine.nc", "--tolerance", "2%", "--json"))
    assert answer["worst"]["error"] <= answer["tolerance"] == 0.02
    assert answer["scheme"] in said
    assert "page   mine.html" in place.say("report", "mine.nc")
    assert 10_000 < (place.directory / "mine.html").stat().st_size < 6e6


def own_beam(place: Place) -> None:
    """Matrices of finite elements, written and run as the guide says."""
    place.python(BEAM + block("python", "fe.npz", GUIDE))
    model = block("yaml", "fe.npz", GUIDE).partition("scene:\n")[2]
    text = re.sub(r"  blade: .*?\n(?=  casing)", model, own_study(), flags=re.DOTALL).replace(
        "study: mine", "study: fe"
    )
    stiffer = (("amplitude: 30", "amplitude: 4500"), ("alpha: [0, 30]", "alpha: [0, 1e-3]"))
    for old, new in (*stiffer, ("[20, 25, full]", "[4, 12, full]")):  # it has fewer nodes
        text = text.replace(old, new)
    place.write("fe.yaml", text)
    said = place.say("plan", "fe.yaml")
    assert f"tip stiffness {2.1e11 * 45e-6 / 60e-3:.4g} N/m" in said
    assert "fe.nc: 144 cases" in place.say("run", "fe.yaml")
    assert " keeps within 1 % in all " in place.say("recommend", "fe.nc")


PARTS = (own_blade, own_beam)


def printed_here(source: str, directory: Path) -> str:
    """Return what a program prints in this process."""
    output = io.StringIO()
    with contextlib.chdir(directory), contextlib.redirect_stdout(output), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exec(f"import matplotlib\nmatplotlib.use('Agg')\n{source}", {"__name__": "__main__"})
    return output.getvalue()


def test_own_blade_and_beam(tmp_path: Path) -> None:
    """In this process; the slow test starts the commands that are installed."""
    place = Place(tmp_path, workflow, lambda source: printed_here(source, tmp_path))
    for part in PARTS:
        part(place)


@pytest.mark.slow
def test_a_newcomer_installs_it_first(tmp_path: Path) -> None:
    """The README's commands in a fresh clone, with nothing compiled, then the whole path with what is installed."""
    copy = tmp_path / "clone"
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    environment["NUMBA_CACHE_DIR"] = str(tmp_path / "kernels")

    def typed(*command: str, cwd: Path = copy) -> subprocess.CompletedProcess[str]:
        return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=1800, env=environment)

    assert typed("git", "clone", "-q", str(ROOT), str(copy), cwd=tmp_path).returncode == 0
    found = re.search(r"<!-- run -->\n```sh\n(.*?)\n```", README, re.DOTALL)
    assert found is not None
    for command in re.split(" && |\n", found[1]):
        done = typed("bash", "-c", command)
        assert done.returncode == 0, done.stderr
    assert all((copy / f"blade.{kind}").exists() for kind in ("nc", "png", "html"))
    (tmp_path / "work").mkdir()
    binary = copy / ".venv" / "bin"
    place = Place(
        tmp_path / "work",
        lambda *words, cwd: typed(str(binary / "workflow"), *words, cwd=cwd),
        lambda source: typed(str(binary / "python"), "-c", source, cwd=tmp_path / "work").stdout,
    )
    answer = typed(str(binary / "workflow"), "recommend", "blade.nc").stdout
    quoted = block("console").splitlines()[1:]
    assert answer.splitlines()[:2] == quoted[:2]  # costs are those of a machine
    for part in PARTS:
        part(place)


PAGE = GUIDE.split("\n## From my program to a study\n")[1].split("\n## ")[0]
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
