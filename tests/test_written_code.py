"""Every Python line and every command of README, guide and reference runs, on an archive to which it applies.

What a document gains must be named here, or a test fails.
"""

import ast
import contextlib
import io
import json
import re
import shlex
import shutil
import warnings
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workflow
from scripts import script
from terminal import told
from workflow import plots

ROOT = Path(__file__).parents[1]
DOCUMENTS = ("README.md", "studies/GUIDE.md", "studies/REFERENCE.md")
ONE_MASS: dict[str, Any] = {
    "chain": {"nodes": 1, "mass": 0.01, "stiffness": 3948, "damping": {"mass": 63}, "heat_capacity": 1},
    "casing": {"gap": "0.1 mm"},
    "load": {"amplitude": 0.08},
    "initial": {"displacement": "-0.3 mm"},
    "duration": 0.25,
}


def texts_of(document: str) -> tuple[list[str], list[str]]:
    """Return the blocks of a document and what stands between backticks, of Python and of a shell."""
    text = (ROOT / document).read_text(encoding="utf-8")
    blocks = re.findall(r"```(?:python|sh|console)\n(.*?)```", text, re.DOTALL)
    prose = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    inline = [" ".join(one.split()) for one in re.findall(r"`([^`]+)`", prose)]
    return blocks, list(dict.fromkeys(one for one in inline if is_command(one) or is_code(one)))


def is_command(text: str) -> bool:
    return text.startswith(("workflow ", "python ", "pip ", "-s "))


def is_code(text: str) -> bool:
    """Tell whether a text is a call, a selection or an attribute of something, in Python."""
    with contextlib.suppress(SyntaxError):
        body = ast.parse(text.replace("…", "...")).body
        return (
            len(body) == 1 and isinstance(body[0], ast.Expr) and any(isinstance(n, ast.Call) for n in ast.walk(body[0]))
        )
    return text.startswith(".") and "(" in text


GUIDE_PYTHON = {
    'workflow.sobol(archive, "contact_impulse")': "drawn",
    'workflow.plots.sweep(up, "period_impulse", down, branch)': "swept",
    'archive.sel(contact="188")': "chord",
    "workflow.plots.contacts(archive)": "chord",
    "matrices_at_speeds({0: 0 * f, 942.478: f})": "turning",
    "plots.campbell(study)": "turning",
    "plots.clearance(archive)": "turning",
    "archive.sel(speed=100)": "turning",
    "workflow.spectrum(history)": "turning",
    "archive.sel(h=np.logspace(-6, -4, 5)[1])": "blade",
    "archive.drop_sel(e=[1])": "elastic",
    'plots.bifurcation(archive, "frequency")': "sections",
    'archive.sensor_value.sel(sensor="trailing_edge")': "turning",
    'labels(archive["event_kind"])': "turning",
    "workflow.contact_phases(case)": "blade",
    "workflow.plots.wear_map(archive)": "worn",
}
"""What stands in a line of the guide, and the archive that it is for."""

COMMANDS = {
    "workflow plan": "workflow plan blade.yaml",
    "workflow plan rub.yaml": "",
    "workflow run rub.yaml": "",
    "workflow example": "",
    "workflow schema": "",
    "workflow schema -o study.schema.json": "",
    "-s zip.design.points=512": "workflow run drawn.yaml -s zip.design.points=8 -o more.nc",
    "workflow run STUDY [-o ARCHIVE]": "workflow run rub.yaml -o rub.nc",
    "workflow plan STUDY [-o ARCHIVE]": "workflow plan rub.yaml -o rub.nc",
    "workflow show ARCHIVE…": "workflow show rub.nc drawn.nc swept.nc",
    "workflow recommend ARCHIVE [--tolerance 1%]": "workflow recommend blade.nc --tolerance 100%",
    "workflow limits ARCHIVE [--max-temperature 40K] [--max-displacement 0.1mm] [--max-impulse 0.3]":
        "workflow limits branch.nc --max-temperature 40K --max-displacement 0.2mm --max-impulse 0.3",
    "workflow report ARCHIVE…": "workflow report swept.nc down.nc",
    "workflow verify ARCHIVE": "workflow verify chord.nc",
    "workflow example [NAME]": "workflow example blade",
    "workflow example blade > blade.yaml": "workflow example blade",
    "workflow example slurm > slurm.py": "workflow example slurm",
    "workflow example worn_casing": "workflow example worn_casing",
    "workflow example coating": "workflow example coating",
    "workflow run blade.nc -o again.nc": "workflow run rub.nc -o again.nc",
    "-s KEY=VALUE": 'workflow plan rub.yaml -s scene.duration="1 s"',
    '-s scene.duration="1 s"': 'workflow plan rub.yaml -s scene.duration="1 s"',
    "workflow report data/work_precision.nc": "",
}  # fmt: skip
"""Commands of README and guide, and what is run of those that name no file of theirs."""

ELSEWHERE = {
    '["first"].sel(number="gap")': "stands below, with the figures",
    "EXTSEOUT(STIFFNESS,MASS,DAMPING,DMIGPCH)": "is Nastran's",
    "root(x)": "is a part of a recipe",
    "pip install ansys-mapdl-reader": "installs a distribution",
    "pip install '.[docs]'": "installs a distribution",
    "pip install '.[output4]'": "installs a distribution",
    "pip install '.[sparse]'": "installs a distribution",
    "python -m mkdocs build --strict": "tests/test_site.py",
    "python tests/benchmarks/bench_sparse.py": "tests/benchmarks/test_benchmarks.py",
    "python studies/reference.py": "tests/test_documents.py",
    "run_study(..., workers=N)": "tests/run/test_cluster.py",
    "workflow.pin()": "tests/conftest.py",
    '.sel(h=…, method="nearest")': "is a part of a line",
    'ncread("blade.nc", "contact_impulse")': "is MATLAB's",
    "matrices_at_speeds({0: 0 * f, 942.478: f})": "tests/models/test_turning.py",
}
"""What another test runs, or none can."""


def written(name: str, scene: dict[str, Any], axes: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"study": name, "scene": scene, "axes": {"scheme": "event_driven", **axes}, **more}


def made_studies(place: Path) -> dict[str, Any]:
    """Return small studies, each with what some lines of the documents need."""
    blade = workflow.read_study(ROOT / "studies" / "blade.yaml")
    frequency = "scene.load.frequency"
    few = {"interval": 1e-3, "histories": []}
    pair = {"mass": np.diag([1.0, 0.8]), "stiffness": 2e5 * np.array([[2.0, -1.0], [-1.0, 1.0]])}
    np.savez(place / "pair.npz", **pair, contact=np.eye(2), contact_labels=["188", "267"], load=[0.0, 1.0])
    chord = {"matrices": {"file": str(place / "pair.npz"), "damping": {"mass": 20}}, "casing": {"gap": "20 um"},
             "load": {"mean": 5, "amplitude": 10, "frequency": 50}, "duration": 0.04}  # fmt: skip
    (place / "modes.csv").write_text("frequency,damping_ratio,tip,trailing_edge\n420,0.02,9,7\n", encoding="utf-8")
    modes = {"table": str(place / "modes.csv")}
    turning = {
        "modes": modes,
        "casing": {"gap": "0.1 mm", "harmonics": [{"order": 4, "amplitude": "92 um"}]},
        "duration": 0.05,
    }
    drawn = {"sample": "sobol_indices", "points": 4, "of": {"scene.casing.gap": ["50 um", "100 um"], "e": [0, 0.9]}}
    output = {
        "interval": 2e-4,
        "histories": ["displacement"],
        "sensors": {"trailing_edge": "trailing_edge"},
        "events": 9,
    }
    coating = {"yield_force": 0.1, "sectors": 8}
    coated = {**ONE_MASS, "casing": {"gap": -1e-4, "flexibility": 1e-5, "coating": coating}, "speed": 100}
    varied, load = {"e": [0.3, 0.5], frequency: [95, 130]}, {"load": {"amplitude": 0.08, "frequency": 110}}
    return {
        "blade": blade.with_({"scene.duration": "0.02 s", "scene.load.frequency": "100 Hz"}),
        "sections": written("sections", ONE_MASS, varied, output={**few, "sections": True}),
        "swept": written("swept", ONE_MASS, {"e": 0.3, frequency: {"sweep": [100, 128, 3]}}, output=few),
        "down": written("down", ONE_MASS, {"e": 0.3, frequency: {"sweep": [128, 100, 3]}}, output=few),
        "branch": written("branch", ONE_MASS, {"e": 0.3, frequency: {"branch": [100, 110, 10]}}, output=few),
        "elastic": written("elastic", ONE_MASS, {"e": [0.5, 1], frequency: 110}, output=few),
        "chord": written("chord", chord, {"e": 0}, output={"interval": 1e-3, "histories": ["contact_force"]}),
        "turning": written("turning", turning, {"e": 0, "scene.speed": [95, 100, 105]}, output=output),
        "worn": written("worn", coated, {"scheme": "moreau", frequency: 110}, output={**few, "balances": False}),
        "drawn": written("drawn", {**ONE_MASS, **load}, {}, zip={"design": drawn}),
    }  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the studies and their archives."""
    directory = tmp_path_factory.mktemp("written")
    shutil.copytree(ROOT / "studies", directory / "studies", ignore=shutil.ignore_patterns("*.ipynb", "*.png", "*.csv"))
    (directory / "data").mkdir()
    shutil.copy(ROOT / "data" / "work_precision.nc", directory / "data")
    for name, study in made_studies(directory).items():
        workflow.run_study(study, directory / f"{name}.nc", threads=1)
        if isinstance(study, dict):
            (directory / f"{name}.yaml").write_text(json.dumps(study), encoding="utf-8")
    shutil.copy(directory / "studies" / "blade.yaml", directory)
    study = next(one for one in re.findall(r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL))
    short = study.replace("duration: 2 s", "duration: 0.02 s").replace("[1e-6, 1e-4, 5]", "[1e-5, 1e-4, 2]")
    (directory / "rub.yaml").write_text(short, encoding="utf-8")
    return directory


def run_python(code: str, place: Path, archive: str) -> None:
    """Run code beside the archives, with the names that the documents leave to the reader."""
    with contextlib.chdir(place), contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dataset = workflow.open_archive(f"{archive}.nc")
        known = {name: getattr(workflow, name) for name in ("labels", "open_archive", "run_study")}
        known |= {"workflow": workflow, "plots": plots, "np": np, "archive": dataset, "study": f"{archive}.nc"}
        known |= {"matrices_at_speeds": workflow.matrices_at_speeds, "f": np.ones(3)}
        if archive == "blade":
            known["hot"] = dataset.sel(alpha=30, gap=20e-6, scheme=["midpoint", "event_driven"], e=0.5)
            known["case"] = dataset.isel(dict.fromkeys(dataset["status"].dims, 0))
        if "t" in dataset.dims and "displacement" in dataset:
            known["history"] = dataset["displacement"]
        if archive == "swept":
            known |= {
                "up": dataset,
                "down": workflow.open_archive("down.nc"),
                "branch": workflow.open_archive("branch.nc"),
            }
        exec(code, known)


BLOCKS = {
    "from workflow import open_archive, plots\n": "blade",
    'plots.interaction_map(archive, "trailing_edge"': "turning",
    "from workflow import labels, open_archive": "blade",
    'errors = hot["temperature_error"]': "blade",
    'late = archive["section_displacement"]': "sections",
    "from workflow import read_study, recommend": "blade",
}
"""How blocks of Python in README and guide begin, and the archive that each is for."""

BLOCKS_ELSEWHERE = {
    "python3 -m venv": "tests/test_stranger.py",
    "$ .venv/bin/workflow recommend blade.nc": "tests/test_stranger.py",
    "from workflow import write_matrices": "tests/test_stranger.py",
    "from skfem import": "tests/test_stranger.py",
    "import numpy as np\nfrom workflow import write_matrices": "tests/truth/test_truth.py",
    "import workflow\n\nentries = workflow.read_matrices(": "tests/test_stranger.py",
    "K0 = workflow.read_matrices(": "tests/test_stranger.py",
    "import numpy as np\nimport scipy.sparse\nfrom ansys.mapdl import reader": "tests/test_stranger.py",
}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_nothing_is_written_that_no_test_runs(document: str) -> None:
    blocks, inline = texts_of(document)
    figures = script("reference").FIGURES
    begins = (*BLOCKS, *BLOCKS_ELSEWHERE, "workflow.write_matrices(")
    assert [one for one in blocks if not one.startswith(begins) and one.strip() not in figures.values()] == []
    known = {*GUIDE_PYTHON, *COMMANDS, *ELSEWHERE, *FIGURES_INLINE}
    signatures = [one for one in inline if one.partition("(")[0] in figures and document.endswith("REFERENCE.md")]
    assert [one for one in inline if one not in known and one not in signatures] == []


def test_everything_that_is_run_is_written() -> None:
    blocks, inline = ([*chain.from_iterable(parts)] for parts in zip(*map(texts_of, DOCUMENTS), strict=True))
    assert [one for one in (*GUIDE_PYTHON, *COMMANDS, *ELSEWHERE, *FIGURES_INLINE) if one not in inline] == []
    assert [one for one in (*BLOCKS, *BLOCKS_ELSEWHERE) if not any(block.startswith(one) for block in blocks)] == []


FIGURES_INLINE = ('figure.savefig("rub.pdf")', "figure.set_size_inches(6.3, 6)", "figure.axes[0].set_ylim(0, 30)")


@pytest.mark.parametrize("code", GUIDE_PYTHON)
def test_a_line_of_the_guide_runs(code: str, place: Path) -> None:
    run_python(code, place, GUIDE_PYTHON[code])


@pytest.mark.parametrize("begin", BLOCKS)
def test_a_block_runs(begin: str, place: Path) -> None:
    blocks = [one for document in DOCUMENTS for one in texts_of(document)[0] if one.startswith(begin)]
    for block in blocks:
        run_python(block.replace('"blade.nc"', f'"{BLOCKS[begin]}.nc"'), place, BLOCKS[begin])


def test_indices_of_the_guide_and_figures_of_the_reference(place: Path) -> None:
    """The guide selects what it calls first-order and total; the reference says what a figure may be told."""
    code = "indices = workflow.sobol(archive, 'contact_impulse')\nindices['first'].sel(number='gap'), indices['total']"
    run_python(code, place, "drawn")
    lines = "\n".join(FIGURES_INLINE)
    run_python(f"figure = plots.campbell(study)\n{lines}", place, "turning")


def test_the_contacts_of_the_guide_are_written(place: Path) -> None:
    """With and without the entries for contacts without mass."""
    block = next(one for one in texts_of("studies/GUIDE.md")[0] if one.startswith("workflow.write_matrices("))
    names = "M, K, b, dF = np.eye(3), 2e5 * np.diag([1.0, 2, 3]), np.ones(3), 1e-9 * np.eye(3)\n"
    names += "w, t = np.eye(3)[:2], np.zeros((2, 3))\n"
    heat = "s = np.eye(2)\nheat = dict(heat_capacity=np.eye(2), conductance=np.eye(2), coupling=np.zeros((3, 2)))\n"
    code = block.replace('"blade.npz"', '"contacts.npz"').replace("thermal_contact=s,", "thermal_contact=s, **heat,")
    run_python(names + heat + code, place, "chord")
    entries = np.load(place / "contacts.npz")
    assert {"contact_labels", "angle", "residual_flexibility", "thermal_contact"} <= set(entries)


LONG = ("workflow report data/work_precision.nc",)


@pytest.mark.parametrize("command", [pytest.param(c, marks=pytest.mark.slow) if c in LONG else c for c in COMMANDS])
def test_a_command_runs(command: str, place: Path) -> None:
    words = shlex.split(COMMANDS[command] or command)
    with contextlib.chdir(place):
        status, said = told(*words[1:])
    assert status == 0, said
    assert said.strip()
