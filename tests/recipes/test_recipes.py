"""Recipes: a scheme or a model from outside is one file, and a broken one harms only studies that name it."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plain_steps import Law, Step, complementary, march
from quick import quick
from scenes import cases, heavy_chain, movable, relative, same_bits, sampling, step, taken
from scenes import rubs as random_rubs
from studies import SCENE, parsed
from workflow import models, reduction, schemes, variables
from workflow.archive import open_archive
from workflow.cases import arrange, case_hashes
from workflow.models import Array, Contacts, Structure
from workflow.run import run_study
from workflow.schemes import Sampling, Status
from workflow.solve import solve
from workflow.study import StudyError, read_study

HERE = Path(__file__).parent
H, OVER = 2e-5, Sampling(0.03, 1e-3, 31, balances=True)


def short_chain() -> Structure:
    """Four nodes, so that a loop in Python takes half a second."""
    return heavy_chain(nodes=4, stiffness=4e6)


def added(package: object, directory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(directory)])  # type: ignore[attr-defined]


def scheme(name: str) -> Any:
    """Return a fixture that adds a recipe to the schemes."""

    @pytest.fixture
    def fixture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
        shutil.copy(HERE / f"{name}.py", tmp_path)
        added(schemes, tmp_path, monkeypatch)
        yield name
        sys.modules.pop(f"workflow.schemes.{name}", None)

    return fixture


recipe, compiled_law = scheme("projected_euler"), scheme("hunt_crossley")


@pytest.mark.parametrize(
    ("name", "lines"),
    [("projected_euler", 60), ("hunt_crossley", 80), ("lumps_from_a_table", 30), ("heat_with_the_tip_held", 20)],
)
def test_a_recipe_is_short_and_imports_public_names_only(name: str, lines: int) -> None:
    text = (HERE / f"{name}.py").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= lines
    assert "._" not in text


def rubs(count: int) -> schemes.Cases:
    return random_rubs(short_chain(), count, e=0.0, frequency=50.0)


def test_its_cases_do_not_depend_on_their_neighbours(recipe: str) -> None:
    whole = step(short_chain(), rubs(70), H, OVER, recipe)  # more cases than one block of lanes
    assert np.all(whole.status == Status.OK)
    assert whole.metrics["impacts"].min() > 0
    for part in (slice(0, 1), slice(66, 70)):
        assert same_bits(step(short_chain(), rubs(70).take(part), H, OVER, recipe), taken(whole, part))


def test_it_converges_and_its_balances_close(recipe: str) -> None:
    """Order one: with half the step half the heat error, a smaller energy error and a smaller distance."""
    exact = step(short_chain(), rubs(3), H, OVER, "event_driven")
    runs = [step(short_chain(), rubs(3), h, OVER, recipe) for h in (1.2e-5, 6e-6)]
    names = ("energy_residual", "heat_residual")
    coarse, fine = ({name: np.abs(run.metrics[name]).max() for name in names} for run in runs)
    assert 0 < fine["energy_residual"] < 0.7 * coarse["energy_residual"]
    assert 0 < fine["heat_residual"] < 1e-7
    assert fine["heat_residual"] == pytest.approx(coarse["heat_residual"] / 2, rel=0.1)
    errors = [relative(run.histories["displacement"][1], exact.histories["displacement"][1]) for run in runs]
    assert errors[1] < 0.7 * errors[0]
    assert errors[1] < 0.02


def test_it_runs_in_a_default_study_with_every_variable(recipe: str) -> None:
    grid = arrange(parsed(f"study: a\n{SCENE}axes: {{scheme: [{recipe}], h: {H}, alpha: [0, 5]}}\n"))
    values = solve(grid, 0, np.arange(2)).values
    assert values["status"].tolist() == [0, 0]
    for about in variables.TABLE:
        if about.condition in ("always", "balances"):
            assert about.name in values, about.name


def test_it_takes_several_contacts_as_carpenter_does(recipe: str) -> None:
    """Whose first steps differ by half a step's force: the same motion as h → 0; balances close as they do for one."""
    rows = np.eye(4)[[3, 1]]
    own = Contacts(("tip", "mid"), rows, 0.0 * rows, rows, np.zeros(2))
    structure, distances = replace(short_chain().matrices(), contacts=own), []
    batch = cases(structure, 2, alpha=[0.0, 5.0], gaps=[[3e-5, 1e-5]], amplitude=100.0, frequency=250.0)
    for h in (8e-6, 1e-6):
        over = sampling(2e-3, 1e-5)
        ours = step(structure, batch, h, over, recipe)
        other = step(structure, movable(batch), h, over, "carpenter")
        assert (ours.metrics["impacts"] > 0).all()
        assert np.abs(ours.metrics["heat_residual"]).max() < 1e-5
        distances.append(relative(ours.histories["displacement"], other.histories["displacement"]))
    assert 0 < distances[1] < 0.3 * distances[0] < 0.03


def test_it_sees_harmonics_of_the_load_and_is_refused_a_casing_that_moves(recipe: str) -> None:
    batch = rubs(4)
    load = batch.load_harmonics
    more = replace(batch, load_harmonics=load.scaled(0.0).joined(load))
    one, other = (step(short_chain(), each, H, OVER, recipe).histories for each in (batch, more))
    assert relative(other["displacement"], one["displacement"]) < 1e-12  # 0 + F sin for F sin, over 1500 steps
    text = f"study: a\n{SCENE}axes: {{scheme: [{recipe}]}}\n"
    parsed(text.replace("frequency: 50 Hz", "harmonics: [{amplitude: 1, frequency: 50 Hz}]"))
    with pytest.raises(StudyError, match=f"`{recipe}` does not take a casing that moves; name another scheme"):
        parsed(text.replace("gap: 50 um", "gap: 50 um, harmonics: [{amplitude: 1 um, frequency: 50 Hz}]"))


BROKEN = {
    "not_python": (schemes, "def init(:\n"),
    "raises": (schemes, "raise RuntimeError('no licence')\n"),
    "lacks": (schemes, "READS = frozenset()\nOptions = object\ndef init(structure, h, options):\n    return 0\n"),
    "torn_basis": (reduction, "raise RuntimeError('torn')\n"),
    "half_a_basis": (reduction, "def mechanical(structure, count, duration): ...\n"),
    "torn_model": (models, "raise RuntimeError('torn')\n"),
}
NAMING = {
    schemes: ("axes: {{scheme: [moreau, {0}]}}", "schemes: {{mine: {{method: {0}}}}}\naxes: {{scheme: mine}}"),
    reduction: (
        "axes: {{reduction: {0}}}",
        "axes: {{reduction: [craig_bampton, {0}]}}",
        "reference: {{reduction: {0}}}",
    ),
}
"""Where a study names a scheme or a basis."""


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_breaks_only_studies_that_name_it(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, content = BROKEN[name]
    (tmp_path / f"{name}.py").write_text(content)
    added(package, tmp_path, monkeypatch)
    parsed(f"study: a\n{SCENE}axes: {{mechanical_modes: 1}}\n")
    texts = [f"study: a\n{SCENE}{text.format(name)}\n" for text in NAMING.get(package, ())]
    for text in texts or [f"study: a\nscene: {{{name}: {{}}, casing: {{gap: 1}}, load: {{}}, duration: 1}}\n"]:
        with pytest.raises(StudyError) as refused:
            parsed(text)
        assert [m for m in refused.value.mistakes if name in str(m) and "cannot be used" in str(m)]
    sys.modules.pop(f"{package.__name__}.{name}", None)


LUMPS = """
scene:
  lumps_from_a_table: {table: lumps.txt, material: steel}
  casing: {gap: 50 um}
  load: {amplitude: 100, frequency: 50 Hz}
  duration: 60 ms
axes: {scheme: [moreau, event_driven], h: 1e-5, alpha: [0, 5]}
"""


@pytest.fixture
def lumps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A study of the model from outside and its table."""
    (tmp_path / "models").mkdir()
    shutil.copy(HERE / "lumps_from_a_table.py", tmp_path / "models")
    added(models, tmp_path / "models", monkeypatch)
    (tmp_path / "lumps.txt").write_text("2.5e-3 4e6 1.3\n" * 4)
    (tmp_path / "lumps.yaml").write_text(f"study: lumps\n{LUMPS}")
    yield tmp_path / "lumps.yaml"
    sys.modules.pop("workflow.models.lumps_from_a_table", None)


def test_a_model_is_one_file_without_nodes_or_heating(lumps: Path) -> None:
    outcome = run_study(read_study(lumps), lumps.with_suffix(".nc"), threads=1)
    assert outcome.counts["ok"] == 4
    with open_archive(lumps.with_suffix(".nc")) as archive:
        assert archive.mechanical_modes.item() == 3
        assert float(archive.contact_impulse.min()) > 0


def test_a_file_belongs_to_the_identity_of_its_cases_by_its_content(lumps: Path) -> None:
    def hashes() -> bytes:
        return case_hashes(arrange(read_study(lumps))).tobytes()

    first = hashes()
    moved = lumps.with_name("elsewhere.txt")
    (lumps.parent / "lumps.txt").rename(moved)
    lumps.write_text(lumps.read_text().replace("lumps.txt", "elsewhere.txt"))
    assert hashes() == first
    moved.write_text("2.5e-3 4e6 1.3\n" * 3 + "2.5e-3 4e6 1.4\n")
    assert hashes() != first


@pytest.mark.parametrize("table", ["none.txt", ".", "''", "3", "pipe"])
def test_a_file_that_is_none_is_a_mistake_of_the_study(table: str, lumps: Path) -> None:
    """A pipe is not waited for."""
    os.mkfifo(lumps.with_name("pipe"))
    lumps.write_text(lumps.read_text().replace("table: lumps.txt", f"table: {table}"))
    with pytest.raises(StudyError, match="table"):
        read_study(lumps)


def outside(folder: Path, group: str, name: str, module: str) -> dict[str, str]:
    """Return the environment of a program that finds a module of a folder by an entry point."""
    about = folder / "outside-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{group}]\n{name} = {module}\n")
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}


def typed(directory: Path, environment: dict[str, str], *words: str, status: int = 0) -> tuple[str, str]:
    """Return what a command prints and complains of in a process of its own, in one line each."""
    call = [sys.executable, "-m", "workflow", *words]
    done = subprocess.run(call, capture_output=True, text=True, check=False, env=environment, cwd=directory)
    assert done.returncode == status, done.stderr
    return " ".join(done.stdout.split()), " ".join(done.stderr.split())


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., tuple[str, str]]:
    """The command in a directory of a study of `moreau` and a scheme from outside; what it prints and complains of.

    The scheme is a recipe in which ``old`` is replaced by ``new``.
    """

    def said(scheme: str, *words: str, status: int = 0, old: str = "", new: str = "") -> tuple[str, str]:
        text = quick({"scheme": ["moreau", "carpenter"], "e": 0, "alpha": 0}).text.replace("carpenter", scheme)
        (tmp_path / "quick.yaml").write_text(text, encoding="utf-8")
        if not (tmp_path / f"{scheme}.py").exists():
            recipe = (HERE / f"{scheme}.py").read_text(encoding="utf-8")
            assert old in recipe
            (tmp_path / f"{scheme}.py").write_text(recipe.replace(old, new), encoding="utf-8")
            environment.update(outside(tmp_path, "workflow.schemes", scheme, scheme))
        return typed(tmp_path, environment, *words, status=status)

    environment = dict[str, str]()
    return said


def test_an_error_of_a_model_from_outside_is_said_to_be_its_own(tmp_path: Path) -> None:
    text = (HERE / "lumps_from_a_table.py").read_text(encoding="utf-8")
    (tmp_path / "lumps_outside.py").write_text(text.replace("np.zeros(masses.size)", "masses / [1.0, 2.0]"))
    environment = outside(tmp_path, "workflow.models", "lumps_outside", "lumps_outside")
    (tmp_path / "lumps.txt").write_text("2.5e-3 4e6 1.3\n" * 4)
    (tmp_path / "lumps.yaml").write_text(f"study: lumps\n{LUMPS}".replace("lumps_from_a_table", "lumps_outside"))
    _, said = typed(tmp_path, environment, "plan", "lumps.yaml", status=2)
    assert "lumps_outside.py, line 23: ValueError: operands could not be broadcast" in said
    assert "defect of this program" not in said


@pytest.mark.parametrize("where", ["--threads", pytest.param("--workers", marks=pytest.mark.slow)])
def test_a_scheme_from_outside_that_exits_is_a_failed_case(where: str, command: Callable[..., tuple[str, str]]) -> None:
    """What it prints is no part of what the command says."""
    begins = "    structure, h, mobility, warming = operator"
    change = {"old": begins, "new": f"    print('as it likes')\n    raise SystemExit(3)\n{begins}"}
    said, complained = command("projected_euler", "run", "quick.yaml", where, "1", status=1, **change)
    assert "1 ok, 1 failed" in said
    assert "SystemExit: 3" in said
    assert "as it likes" in complained
    assert "as it likes" not in said


def test_an_option_of_a_scheme_from_outside_has_any_unit(command: Callable[..., tuple[str, str]]) -> None:
    assert "hunt_crossley" in command("hunt_crossley", "plan", "quick.yaml")[0]
    assert "hunt_crossley" in command("hunt_crossley", "schema")[0]


def test_a_scheme_that_reads_e_without_saying_so_gives_no_numbers(command: Callable[..., tuple[str, str]]) -> None:
    change = {"old": "cases.clearances -", "new": "cases.clearances * (1 + 0 * cases.e[:, None]) -"}
    assert "1 ok, 1 diverged" in " ".join(command("projected_euler", "run", "quick.yaml", status=1, **change))


def test_what_numba_cannot_compile_of_a_law_is_said_with_its_line(command: Callable[..., tuple[str, str]]) -> None:
    change = {"old": "law.damping * tip.free", "new": "law.dampin * tip.free"}
    said = " ".join(command("hunt_crossley", "run", "quick.yaml", status=1, **change))
    assert "Unknown attribute 'dampin' of type HuntCrossley" in said
    assert 'hunt_crossley.py", line 39' in said
    assert "Failed in" not in said


@pytest.mark.slow
def test_cases_of_an_edited_scheme_from_outside_are_other_ones(
    command: Callable[..., tuple[str, str]], tmp_path: Path
) -> None:
    scheme, run = "projected_euler", ("run", "quick.yaml")
    assert "2 ok" in command(scheme, *run)[0]
    with (tmp_path / f"{scheme}.py").open("a", encoding="utf-8") as file:
        file.write("# edited\n")
    assert "1 of its 2 cases are not asked for" in command(scheme, *run, status=2)[1]
    assert "1 of them stored before" in " ".join(command(scheme, *run, "--drop"))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("np.zeros(count)]) * 1.01", "line 19: ValueError: vectors of a basis are 0 at the tip and orthonormal"),
        (
            "np.zeros(count)])[:, 1:]",
            "cannot be used: the basis outside gives 1 vectors for 2",
        ),
    ],
)
def test_a_basis_from_outside_that_gives_something_else_is_refused(wrong: str, words: str, tmp_path: Path) -> None:
    text = (HERE / "heat_with_the_tip_held.py").read_text(encoding="utf-8")
    (tmp_path / "held.py").write_text(text.replace("np.zeros(count)])", wrong), encoding="utf-8")
    environment = outside(tmp_path, "workflow.reduction", "outside", "held")
    fixed = {"reduction": "rubin", "mechanical_modes": 2, "thermal_modes": 2}
    study = quick({"e": 0, "alpha": 0, **fixed}, scene={"chain.nodes": 4}).text.replace("rubin", "outside")
    (tmp_path / "quick.yaml").write_text(study, encoding="utf-8")
    assert words in typed(tmp_path, environment, "plan", "quick.yaml", status=2)[1]


@pytest.mark.slow
def test_a_compiled_contact_law_steps_by_central_differences(compiled_law: str, tmp_path: Path) -> None:
    """Another step of the same law: both converge to one motion."""
    text = (HERE / "hunt_crossley.py").read_text(encoding="utf-8").replace("step_theta", "step_central")
    text = text.replace("structure, float(h), 1.0,", "structure, float(h), CentralDifferences(),")
    text = text.replace("init_theta", "init_central").replace("import Contact,", "import CentralDifferences, Contact,")
    (tmp_path / "central_crossley.py").write_text(text, encoding="utf-8")
    structure, distances = short_chain(), []
    batch = cases(structure, 2, alpha=[0.0, 20.0], gap=1e-5, amplitude=100.0, frequency=250.0)
    for h in (2e-6, 2.5e-7):
        one, other = (
            step(structure, batch, h, sampling(4e-3, 1e-5), method, stiffness=2e10, damping=5.0)
            for method in (compiled_law, "central_crossley")
        )
        assert one.histories["impulse"][:, -1].min() > 0
        distances.append(relative(other.histories["displacement"], one.histories["displacement"]))
    assert 0 < distances[1] < 0.4 * distances[0] < 0.02


def crossley_of(stiffness: float, damping: float, h: float) -> Law:
    """0 <= p ⊥ (1/a + c W) p - (1 + c v_free) >= 0, a = h κ δ^{3/2}, of contacts that are δ beyond the casing."""

    def crossley(at: Step) -> tuple[Array, Array]:
        inside, p = np.flatnonzero(at.place > 0), np.zeros(at.place.size)
        sprung = h * stiffness * at.place[inside] ** 1.5
        matrix = np.diag(1 / sprung) + damping * at.taken[np.ix_(inside, inside)]
        p[inside] = complementary(matrix, 1 + damping * at.free[inside])
        return p, p / h

    return crossley


@pytest.mark.slow
@pytest.mark.parametrize("contacts", [2, 5])
def test_a_compiled_contact_law_takes_any_number_of_contacts(compiled_law: str, contacts: int) -> None:
    stiffness, damping, h, rows = 2e8, 20.0, 4e-6, np.eye(6)[-contacts:]
    own = Contacts(tuple("abcde"[:contacts]), rows, 0.2 * np.roll(rows, 1, axis=1), rows, np.zeros(contacts))
    structure = replace(heavy_chain(nodes=6).matrices(), contacts=own)
    gaps = [list(1e-5 * np.linspace(0.5, 1, contacts))]
    batch = cases(structure, alpha=20.0, gaps=gaps, amplitude=150.0, frequency=250.0, friction=0.3)
    results = step(structure, batch, h, sampling(2000 * h, h), compiled_law, stiffness=stiffness, damping=damping)
    plain = march(structure, batch, h, 1.0, 2000, crossley_of(stiffness, damping, h))
    assert (np.count_nonzero(plain.impulse, axis=0) > 10).all()
    assert (np.count_nonzero(plain.impulse, axis=1) > 1).any()
    assert relative(results.histories["displacement"][0], plain.place.T) < 1e-9
    assert relative(results.histories["impulse"][0], np.cumsum(plain.impulse, axis=0).T) < 1e-9


def test_a_basis_is_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With every vector kept nothing is lost; with fewer, fixed-interface modes of heat still come to the same."""
    shutil.copy(HERE / "heat_with_the_tip_held.py", tmp_path)
    added(reduction, tmp_path, monkeypatch)
    structure = heavy_chain()
    batch = cases(structure, 2, alpha=[20.0, 50.0], gap=5e-5, amplitude=100.0, frequency=50.0)
    full = step(structure, batch, H, OVER).histories["temperature"]
    errors = []
    for count in (3, 9, 19):
        reduced = reduction.reduce_structure(structure, 19, count, "heat_with_the_tip_held")
        few = step(reduced.structure, reduced.project(batch), H, OVER)
        errors.append(relative(few.histories["temperature"], full))
    sys.modules.pop("workflow.reduction.heat_with_the_tip_held", None)
    assert errors[0] > errors[1] > errors[2]
    assert errors[1] < 0.1
    assert errors[2] < 1e-9


TWO_CONTACTS = '''"""A chain whose middle and end may touch."""

from dataclasses import dataclass, replace

import numpy as np

from workflow.declare import quantity
from workflow.models import Chain, Contacts, Matrices, Rayleigh


@dataclass(frozen=True)
class Parameters:
    """Its size."""

    nodes: int = quantity("1", "number of nodes", at_least=2)


def assemble(parameters: Parameters) -> Matrices:
    """Return it with a second displacement, a lump on a spring of its own, beside the nodes."""
    n = parameters.nodes + 1
    one, none = np.ones(n), np.zeros(n)
    chain = Chain(1e-3 * one, 1e6 * one, none, one, one, none, Rayleigh(mass=10.0)).matrices()
    rows = np.eye(n)[[n // 2, n - 1]]
    return replace(chain, load=rows[1], contacts=Contacts(("mid", "end"), rows, 0 * rows, rows, np.zeros(2)))
'''


def test_a_model_with_nodes_may_have_several_contacts_and_other_sizes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "two_contacts.py").write_text(TWO_CONTACTS)
    added(models, tmp_path, monkeypatch)
    scene = {"two_contacts": {"nodes": 4}, "casing": {"gap": [5e-5, 2e-5]}, "duration": 0.02}
    scene["load"] = {"amplitude": 100.0, "frequency": 50.0}
    axes = {"scheme": ["moreau", "event_driven"], "h": 1e-5, "alpha": 0, "scene.two_contacts.nodes": [4, 7]}
    given = {"study": "a", "scene": scene, "axes": axes}
    with run_study(read_study(given), tmp_path / "a.nc", threads=1).dataset as archive:
        assert (archive["status"] == 0).all()
        assert archive["contact"].values.tolist() == ["mid", "end"]
        assert archive["mechanical_modes"].values.tolist() == [4, 7]
        assert archive["contact_impulse"].dims == (*archive["status"].dims, "contact")
    with pytest.raises(StudyError, match="has 3 values where the model has 2 contacts"):
        read_study({**given, "scene": {**scene, "casing": {"gap": [5e-5, 2e-5, 1e-5]}}})
    sys.modules.pop("workflow.models.two_contacts", None)
