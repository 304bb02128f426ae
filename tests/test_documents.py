"""README, notebooks and kept archives are true: commands run, figures are there, results repeat."""

import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from scripts import script
from studies import judged_within_rounding
from workflow.archive import open_archive, provenance
from workflow.run import run_study, verify
from workflow.study import parse_study, read_study

ROOT = Path(__file__).parents[1]
ARCHITECTURE = ROOT / "ARCHITECTURE.md"
STUDIES = sorted((ROOT / "studies").rglob("*.yaml"))
LONG = ["compressor_blade", "scaling", "work_precision", "work_precision_blade", "work_precision_finite_element"]
LONG += [f"hard/{name}" for name in ("all_steps", "bouncing_bar", "unfit_bases")]
NAMES = sorted({"abstract_figure", *LONG, *(f"hard/{p.stem}" for p in STUDIES if p.parent.name == "hard")})
KEPT = [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in NAMES]
"""Studies whose archives are kept in ``data/``, by path; ``pytest -m "slow or not slow" --regenerate`` writes them."""


def said() -> str:
    """Return README and guide, their lines joined."""
    texts = (path.read_text(encoding="utf-8") for path in (ROOT / "README.md", ROOT / "studies" / "GUIDE.md"))
    return " ".join(" ".join(texts).split())


@pytest.mark.parametrize(
    ("document", "dimensions"),
    [("README.md", "scheme e h alpha model"), ("studies/pages/first_study.md", "scheme h alpha gap")],
)
def test_the_first_study_of_a_document_is_a_study(document: str, dimensions: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    study = parse_study(re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)[0], document)
    assert [d.name for d in study.dimensions] == dimensions.split()


def test_the_reference_is_what_the_declarations_say() -> None:
    """``python studies/reference.py`` writes it anew."""
    reference = script("reference")
    assert reference.FILE.read_text(encoding="utf-8") == reference.text()


def test_the_architecture_is_read_at_one_sitting() -> None:
    text = ARCHITECTURE.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 320
    rooms = {path.name for path in (ROOT / "workflow").iterdir() if (path / "__init__.py").exists()}
    assert [room for room in sorted(rooms) if f"`{room}`" not in text.split("## Rooms")[1]] == []


def test_the_recipes_of_the_architecture_are_those_that_run() -> None:
    shown = re.findall(r"```python\n(.*?)```", ARCHITECTURE.read_text(encoding="utf-8"), re.DOTALL)
    recipes = ROOT / "tests" / "recipes"
    assert shown == [
        (recipes / f"{name}.py").read_text() for name in ("projected_euler", "hunt_crossley", "heat_with_the_tip_held")
    ]


def test_readme_is_read_at_one_sitting() -> None:
    """It begins with a line to run; its links lead somewhere: files, and headings of what is written in Markdown."""
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 90
    readme = "\n".join(lines)
    assert len(readme.encode()) <= 5500
    assert readme.partition("```")[0].endswith("<!-- run -->\n")
    assert all(len(re.findall(rf"<!-- {mark} -->\n```sh\n(.*)\n```", readme)) == 1 for mark in ("run", "test"))
    for document in (ROOT / "README.md", ROOT / "studies" / "GUIDE.md"):
        for link in re.findall(r"\]\((?!https://)([^)\s]+)\)", document.read_text(encoding="utf-8")):
            name, _, heading = link.partition("#")
            target = document.parent / name if name else document
            assert target.exists(), link
            titles = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE) if heading else []
            anchors = [re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles]
            assert not heading or heading in anchors, link


def test_the_guide_names_every_command() -> None:
    from workflow.cli import app

    text = (ROOT / "studies" / "GUIDE.md").read_text(encoding="utf-8")
    for command in app.registered_commands:
        assert f"`workflow {command.callback.__name__}" in text


def test_readme_s_caption_is_what_its_notebook_prints() -> None:
    cells = json.loads((ROOT / "studies" / "abstract_figure.ipynb").read_text(encoding="utf-8"))["cells"]
    printed = "".join(line for cell in cells for out in cell.get("outputs", []) for line in out.get("text", []))
    shares = re.findall(r"(displacement|temperature|contact_force) +scheme ([\d.]+)%, reduction ([\d.]+)%", printed)
    (_, x, x_basis), (_, heat, heat_basis), (_, force, _) = shares
    text = said()
    assert f"{x} % in displacement, {float(heat):.1f} % in temperature, {float(force):.1f} % in contact force" in text
    assert f"change its displacement by {x_basis} %, its temperature by {heat_basis} %" in text


def worst(name: str, variable: str, scheme: str, h: float, e: float = 0.0) -> float:
    """Return the largest value over alpha in a kept archive of full models, at the step nearest to ``h``."""
    with open_archive(ROOT / "data" / f"{name}.nc") as archive:
        cases = archive[variable].isel(model=0).sel(scheme=scheme, e=e).sel(h=h, method="nearest")
        return float(cases.max())


def test_readme_s_errors_are_those_of_the_kept_archives() -> None:
    """Each sentence is written from the archive of the study that it speaks of."""
    heavy, blade = partial(worst, "work_precision"), partial(worst, "work_precision_finite_element")
    carpenter, moreau = (heavy("impulse_error", scheme, 1e-5) for scheme in ("carpenter", "implicit_euler"))
    coarse = [heavy("impulse_error", "implicit_euler", 1e-4, e) for e in (0.0, 0.5, 0.9)]
    rebounds = heavy("impulse_error", "carpenter", 1e-6, 0.9)
    spring = heavy("impulse_error", "penalty_100", 1e-7)
    half_decade = 10**-5.5
    central, cost = (heavy(name, "carpenter", half_decade) for name in ("impulse_error", "processor_time"))
    cost /= heavy("processor_time", "event_driven", half_decade)
    exact, euler, midpoint = (
        blade("displacement_error", scheme, half_decade) for scheme in ("event_driven", "implicit_euler", "midpoint")
    )
    text = said()
    for claim in (
        f"impulse error {carpenter:.1g} against {moreau:.1g} at 1e-5 s",
        f"with errors of {min(coarse):.1%} to {max(coarse):.0%} at 1e-4 s".replace("%", " %"),
        f"with e = 0.9 its error stays at {rebounds:.1e}",
        f"its spring ({spring:.0e} at 100 spring stiffnesses)",
        f"An impulse error of {central:.0e} costs `carpenter` {cost:.1f} times",
        f"errs by {exact:.0e}, `moreau` at 3.2e-6 s by {euler:.2g} (θ = 1) and {midpoint:.1g} (θ = ½)",
    ):
        assert claim.replace("e-0", "e-") in text


@pytest.mark.parametrize("path", STUDIES, ids=lambda p: p.name)
def test_every_study_reads(path: Path) -> None:
    assert read_study(path).name == path.stem


def test_the_blade_study_is_plausible(tmp_path: Path) -> None:
    """At one step: every case is ok, heats the tip where it rubs, and stays within what a linear model can mean."""
    text = (ROOT / "studies" / "blade.yaml").read_text(encoding="utf-8")
    assert "h: {log: [1e-6, 1e-4, 5]}" in text
    study = parse_study(text.replace("{log: [1e-6, 1e-4, 5]}", "1e-4"), "blade.yaml")
    assert run_study(study, tmp_path / "blade.nc").ok
    with open_archive(tmp_path / "blade.nc") as archive:
        assert set(archive["status"].dims) == {"scheme", "e", "alpha", "gap", "model"}
        hottest = archive["max_temperature"].sel(alpha=30).max(("scheme", "e", "model"))
        assert hottest.sel(gap=20e-6) == pytest.approx(668, rel=0.02)  # 670.7 in the limit of fine cells
        assert np.all((hottest > 50) & (hottest < 1000))


@pytest.mark.parametrize("path", sorted((ROOT / "studies").glob("*.ipynb")), ids=lambda p: p.name)
def test_notebooks_keep_their_figures(path: Path) -> None:
    outputs = [o for cell in json.loads(path.read_text())["cells"] for o in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not any(output["output_type"] == "error" for output in outputs)


@pytest.mark.parametrize("name", KEPT)
def test_kept_archives_repeat(
    name: str, tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kept archive is what its study gives today: to the bit, or within what rounding makes of each of its cases.

    The former on every processor that the archive's packages and code run on, the latter with others of these.
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
        cases = old["status"].size
    if provenance(kept)["content_hash"] != provenance(again)["content_hash"]:
        judged_within_rounding(kept, monkeypatch)
        assert [check for check in verify(kept, cases) if not (check.holds and check.judged)] == []


@pytest.mark.parametrize("name", NAMES)
def test_kept_archives_are_of_today_s_studies(name: str) -> None:
    kept = ROOT / "data" / f"{name}.nc"
    assert provenance(kept)["study"] == (ROOT / "studies" / f"{name}.yaml").read_text(encoding="utf-8")


SLOW = ("scaling", "hard/bouncing_bar", "compressor_blade")


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in LONG])
def test_kept_archives_that_take_long_to_repeat_are_verified(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = ROOT / "data" / f"{name}.nc"
    judged_within_rounding(kept, monkeypatch)
    assert [check for check in verify(kept, 2) if not (check.holds and check.judged)] == []
