"""The commands as a user types them, what they warn of and show while they run, and the examples that ship."""

import html
import io
import json
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from hostile import ESCAPES
from quick import begin
from studies import BLADE_SCENE, ILL, PRESSED, SINGLE, SMALL, archived, parsed, steady_study, written
from terminal import told, typed, workflow
from workflow.archive import open_archive, provenance
from workflow.cli import _terminal
from workflow.cli._terminal import following, write_json
from workflow.run import Advance, Follower, run_study


def test_run_show_report(tmp_path: Path) -> None:
    study = written(SMALL, tmp_path)
    ran = workflow("run", study, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "small.nc: 60 cases" in ran.stdout
    assert "60 ok" in ran.stdout
    again = workflow("run", study, cwd=tmp_path)
    assert again.returncode == 0
    assert "nothing to do" in again.stdout
    shown = workflow("show", "small.nc", cwd=tmp_path)
    assert shown.returncode == 0
    assert "alpha (5): 0 W/N; 5 W/N" in shown.stdout
    assert "status: 60 ok" in shown.stdout
    done = workflow("report", "small.nc", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {"figure small.png", "page   small.html"} == set(done.stdout.splitlines())
    assert (tmp_path / "small.png").stat().st_size > 10_000
    page = (tmp_path / "small.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 3
    assert re.findall(r"""(?:src|href)=["'](?!data:|#)""", page.split("<script")[0] + page.split("</script>")[-1]) == []
    assert "connect-src 'none'" in page
    repeated = workflow("run", "small.nc", "-o", "a run.nc", cwd=tmp_path)
    assert repeated.returncode == 0, repeated.stderr
    assert "a run.nc: 60 cases" in repeated.stdout
    assert repeated.stdout.splitlines()[-1] == "next: workflow report 'a run.nc'"


def test_a_structure_that_one_value_of_an_axis_spoils_is_no_defect(tmp_path: Path) -> None:
    stiffness = 1e3 * (2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
    np.savez(tmp_path / "blade.npz", mass=np.eye(3), stiffness=stiffness, contact=2, damping=np.eye(3))
    scene = "scene: {matrices: {file: blade.npz}, casing: {gap: 1 mm}, duration: 1 s}"
    study = f"study: a\n{scene}\naxes: {{scene.matrices.damping.ratio: [0, 0.01]}}\n"
    refused = workflow("plan", written(study, tmp_path), cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.startswith("a structure of this study cannot be used: ")
    assert "keep one of them" in refused.stderr


def test_failed_cases_exit_with_one(tmp_path: Path) -> None:
    ran = typed("run", written(ILL, tmp_path), "-o", "out.nc", "--threads", "1", cwd=tmp_path)
    assert ran.returncode == 1
    assert "4 ok, 4 ill_posed" in ran.stdout
    assert "largest admissible h" in ran.stdout
    shown = workflow("show", "out.nc", cwd=tmp_path)
    assert shown.returncode == 0
    assert "ill_posed: " in shown.stdout
    assert " and 1 more: contact has no unique solution" in shown.stdout
    assert [line for line in shown.stdout.splitlines() if "ill_posed: " in line] == [
        line for line in ran.stdout.splitlines() if "ill_posed: " in line
    ]
    assert "alpha 1e+09 W/N" in shown.stdout


FAILED_REFERENCE = f"""study: lost{PRESSED.replace("1000", "100")}axes: {{scheme: moreau, h: 0.01, e: [0, 1]}}
output: {{interval: 0.1 s, histories: [displacement]}}
"""


def test_every_command_names_a_reference_that_failed(tmp_path: Path) -> None:
    """The cases are ok; run exits 1 and says how many lack an error, show and report say why, verify agrees."""
    study = written(FAILED_REFERENCE, tmp_path)
    planned = workflow("plan", study, cwd=tmp_path).stdout
    assert "references   2, and 0 exact solutions" in planned
    assert "beware: at e = 1 the bounces of the tip have no end where the load presses it onto the casing" in planned
    below = workflow("plan", study, "-s", "axes.e=[0, 0.9]", cwd=tmp_path).stdout
    above = workflow("plan", study, "-s", "scene.casing.gap=100 m", cwd=tmp_path).stdout
    assert "the bounces" not in below + above
    ran = workflow("run", study, "-o", "out.nc", "--threads", "1", cwd=tmp_path)
    assert ran.returncode == 1
    assert "2 ok" in ran.stdout
    assert "1 of the ok cases lack an error against the reference" in ran.stdout
    assert "reference: stopped at t = " in ran.stdout
    again = workflow("run", study, "-o", "out.nc", cwd=tmp_path)
    assert again.returncode == 1
    assert "nothing to do" in again.stdout
    shown = workflow("show", "out.nc", cwd=tmp_path)
    assert "ok: e 1: reference: stopped at t = " in shown.stdout
    assert workflow("verify", "out.nc", cwd=tmp_path).returncode == 0
    assert workflow("report", "out.nc", cwd=tmp_path).returncode == 0
    assert "reference: stopped at t = " in (tmp_path / "out.html").read_text(encoding="utf-8")


def test_plan_runs_nothing_and_says_the_same_as_json(tmp_path: Path) -> None:
    study = written(SMALL, tmp_path)
    text, as_json = (workflow("plan", study, *words, cwd=tmp_path) for words in ((), ("--json",)))
    assert (text.returncode, as_json.returncode) == (0, 0)
    assert "60, of which 60 are computed" in text.stdout
    assert "critical alpha" in text.stdout
    assert "beware: moreau damps the first mode" in text.stdout
    assert list(tmp_path.iterdir()) == [study]
    plan = json.loads(as_json.stdout)
    assert (plan["cases"], plan["unique"], plan["time"], plan["archive"]) == (60, 60, "seconds", None)
    assert {value["origin"] for value in plan["scene"]} == {"study", "axis", "default"}
    assert [value["unit"] for value in plan["scene"] if value["path"] == "scene.casing.gap"] == ["m"]
    assert any("damps the first mode" in warning for warning in plan["warnings"])


def test_json_keeps_texts_whole_and_holds_nothing_that_a_terminal_obeys(capsys: pytest.CaptureFixture[str]) -> None:
    value = {"sentence": f"µ {ESCAPES}", "table": [1.5, None]}
    write_json(value, indent=2)
    output = capsys.readouterr().out
    assert json.loads(output) == value
    assert "µ" in output
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", output)


def test_schema_is_json(tmp_path: Path) -> None:
    done = workflow("schema", cwd=tmp_path)
    assert done.returncode == 0
    assert json.loads(done.stdout)["properties"]["scene"]
    assert workflow("schema", "-o", "study.schema.json", cwd=tmp_path).returncode == 0
    assert json.loads((tmp_path / "study.schema.json").read_text()) == json.loads(done.stdout)
    full = workflow("schema", "-o", "/dev/full", cwd=tmp_path)
    assert full.returncode == 2
    assert full.stderr == "/dev/full: no space left on device; choose a place that can be written\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", "none.yaml"), "none.yaml"),
        (("plan", "none.yaml"), "none.yaml"),
        (("show", "none.nc"), "no such archive"),
        (("report", "none.nc"), "no such archive"),
        (("show", "."), "a directory"),
        (("run", "wrong.yaml"), "wrong.yaml:"),
        (("show", "wrong.yaml"), "not a NetCDF-4 file"),
        (("run", "right.yaml", "-o", "no/such/place.nc"), "no/such"),
        (("run", "right.yaml", "--threads", "0"), "threads"),
        (("run", "right.yaml", "--retry", "--recompute"), "--retry and --recompute exclude each other"),
        (("run", "right.yaml", "-s", "axes.h=1e-4", "-s", "axes.h=1e-5"), "-s axes.h: is given more than once"),
        (("plan", "right.yaml", "-s", "study=a", "-s", " study =b"), "-s study: is given more than once"),
        *((("run", "right.yaml", "-o", path), "a directory, not an archive; name a file") for path in ("", ".", "/")),
        (("report", ""), ".: a directory, not an archive; name a file"),
        (("run", "right.yaml", "--workers", "2", "--threads", "2"), "--threads and --workers exclude each other"),
        (("run", "right.yaml", "--scheduler", "a", "--workers", "2"), "--workers and --scheduler exclude each other"),
        (("run", "right.yaml", "--workers", "0"), "workers"),
        (("run", "right.yaml", "--scheduler", "nowhere"), "nowhere: no dask scheduler answers there"),
        (("run",), "STUDY"),
        (("fly",), "fly"),
    ],
)
def test_wrong_calls_exit_with_two_and_one_clear_message(words: tuple[str, ...], message: str, tmp_path: Path) -> None:
    written(SMALL, tmp_path, "right.yaml")
    written("study: a\nscene: {}\n", tmp_path, "wrong.yaml")
    before = sorted(tmp_path.rglob("*"))
    done = workflow(*words, cwd=tmp_path)
    assert done.returncode == 2, done.stdout
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(tmp_path.rglob("*")) == before


small = archived(parsed(SMALL))


def test_a_study_changed_after_an_interrupted_run(tmp_path: Path) -> None:
    begin(parsed(SMALL), tmp_path / "small.nc")
    other = SMALL.replace("study: small", "study: other")
    done = workflow("run", written(other, tmp_path), "-o", "small.nc", cwd=tmp_path)
    assert done.returncode == 2
    assert "small.nc.parts: holds unfinished results of another study" in done.stderr


def test_settings_replace_values_and_are_stored(tmp_path: Path) -> None:
    study = written(SMALL, tmp_path)
    words = ["-s", "scene.casing.gap=10 um", "-s", "axes.e=[0, 0.5]", "-s", "axes.alpha=[0]"]
    done = workflow("run", study, *words, "-q", "-o", "a.nc", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    text = provenance(tmp_path / "a.nc")["study"]
    assert "10 um" in text
    assert "50 um" not in text
    shown = json.loads(workflow("show", "--json", "a.nc", cwd=tmp_path).stdout)
    assert shown["coordinates"]["e"]["values"] == [0.0, 0.5]
    assert shown["coordinates"]["gap"]["values"] == 1e-5
    assert shown["status"] == {"ok": 8}
    refused = workflow("plan", study, "-s", "scene.casing.gap=10 kg", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.startswith("-s scene.casing.gap: ")


def test_show_takes_several_archives_and_asks_after_a_study(small: Path, tmp_path: Path) -> None:
    assert workflow("show", small, small, cwd=tmp_path).stdout.count("status: 60 ok") == 2
    study = written(SMALL, tmp_path)
    study.with_suffix(".nc").write_bytes(small.read_bytes())
    meant = workflow("show", study, cwd=tmp_path)
    assert meant.returncode == 2
    assert f"did you mean {study.with_suffix('.nc')}?" in meant.stderr


RUB = f"study: rub{BLADE_SCENE}axes: {{scheme: event_driven, alpha: [0, 1, 30]}}\n"
RUB = RUB.replace("nodes: 20", "nodes: 30, tip_cell: 60 um").replace("gap: 20 um", "gap: 15 um")


def test_what_only_results_show_is_told_of_them(tmp_path: Path) -> None:
    """``run``, ``show`` and the page name the hottest case and the least settled; ``plan`` cannot know them."""
    study = written(RUB, tmp_path)
    planned = workflow("plan", study, cwd=tmp_path).stdout
    assert " 1000 K" not in planned
    assert "settled" not in planned
    ran, again = (workflow("run", study, cwd=tmp_path).stdout for _ in range(2))
    shown, shown_as_json = workflow("show", "rub.nc", cwd=tmp_path), workflow("show", "rub.nc", "--json", cwd=tmp_path)
    hot, unsettled = json.loads(shown_as_json.stdout)["warnings"]
    assert hot.startswith("1 of 3 ok cases are hotter than 1000 K, above which a linear model means nothing")
    assert hot.endswith("K: alpha = 30")
    assert " of 3 ok cases have not settled: " in unsettled
    assert all(f"  beware: {warning}\n" in text for text in (ran, again) for warning in (hot, unsettled))
    assert shown.stdout.splitlines()[1:3] == [f"  beware: {warning}" for warning in (hot, unsettled)]
    workflow("report", "rub.nc", cwd=tmp_path)
    page = (tmp_path / "rub.html").read_text(encoding="utf-8")
    assert all(f"<p>Beware: {warning}.</p>" in page.split("<h2>")[0] for warning in (hot, unsettled))


def test_a_run_repeats_what_plan_warns_of(tmp_path: Path) -> None:
    """A gap of 5 m that was meant in um: after a run, and where there is nothing left to do."""
    study = written(RUB.replace("15 um", "5"), tmp_path)
    planned = json.loads(workflow("plan", study, "--json", cwd=tmp_path).stdout)["warnings"]
    assert [line[:31] for line in planned] == ["the tip cannot reach the casing"]
    ran, again, shown = (
        workflow(*words, cwd=tmp_path).stdout for words in (("run", study), ("run", study), ("show", "rub.nc"))
    )
    assert [line for text in (ran, again, shown) for line in text.splitlines()[1:2]] == [f"  beware: {planned[0]}"] * 3
    with xr.open_dataset(tmp_path / "rub.nc") as archive:
        assert archive.attrs["warnings"].splitlines() == planned
    workflow("report", "rub.nc", cwd=tmp_path)
    assert f"<p>Beware: {planned[0]}.</p>" in (tmp_path / "rub.html").read_text(encoding="utf-8").split("<h2>")[0]


def test_a_run_repeats_at_most_ten_lines(tmp_path: Path) -> None:
    springs = ", ".join(f"spring_{k}: {{method: penalty, stiffness: {k}.0e4}}" for k in range(1, 15))
    axes = f"schemes: {{{springs}}}\naxes: {{scheme: [{', '.join(f'spring_{k}' for k in range(1, 15))}], h: 1e-5}}\n"
    scene = RUB.split("axes")[0].replace("2 s", "20 ms").replace("nodes: 30, tip_cell: 60 um", "nodes: 6")
    study = written(f"{scene}{axes}output: {{interval: 1 ms}}\n", tmp_path)
    planned = json.loads(workflow("plan", study, "--json", cwd=tmp_path).stdout)["warnings"]
    ran = workflow("run", study, cwd=tmp_path).stdout
    beware = [line.removeprefix("  beware: ") for line in ran.splitlines() if "beware: " in line]
    assert len(planned) == 14
    assert beware == [*planned[:9], "… and 5 more, which `workflow plan` names"]


def test_what_cannot_be_judged_ends_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A foreign scheme's amplification may raise, which no case needs."""

    def raises(*_: object) -> None:
        raise ValueError("no such step")

    monkeypatch.setattr("workflow.schemes.moreau.amplification", raises)
    study = written(RUB.replace("event_driven", "moreau, h: 1e-3"), tmp_path)
    ran = workflow("run", study, cwd=tmp_path)
    assert ran.returncode == 0
    assert "beware: warnings could not be determined: ValueError: no such step" in ran.stdout


def test_plan_says_that_steady_rubs_need_the_exact_scheme(tmp_path: Path) -> None:
    output = "\noutput: {steady: true}\n"
    for scheme, warned in (("moreau, h: 1e-5", True), ("event_driven", False)):
        study = written(RUB.replace("event_driven", scheme) + output, tmp_path)
        warnings = json.loads(workflow("plan", study, "--json", cwd=tmp_path).stdout)["warnings"]
        assert any("only that one has steady rubs" in warning for warning in warnings) == warned, warnings


STUDIES = ("blade", "coating", "interaction_map", "modes", "own_chord", "own_matrices", "steady_rub", "worn_casing")


def printed(name: str, cwd: Path) -> str:
    shown = workflow("example", name, cwd=cwd)
    assert shown.returncode == 0, shown.stderr
    return shown.stdout


def test_they_are_listed_each_with_its_title(tmp_path: Path) -> None:
    lines = workflow("example", cwd=tmp_path).stdout.splitlines()
    assert [line.split()[0] for line in lines] == sorted([*STUDIES, "plate", "slurm"])
    assert all(len(line.split()) > 3 for line in lines)


def test_one_that_is_not_there(tmp_path: Path) -> None:
    asked = workflow("example", "blades", cwd=tmp_path)
    assert asked.returncode == 2
    assert "there is no example `blades`; take one of blade, coating, interaction_map" in asked.stderr


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the matrices of the plate."""
    directory = tmp_path_factory.mktemp("plate")
    (directory / "plate.py").write_text(printed("plate", directory), encoding="utf-8")
    subprocess.run([sys.executable, "plate.py"], cwd=directory, check=True)
    return directory


@pytest.mark.parametrize("name", STUDIES)
def test_each_study_is_planned(name: str, plate: Path) -> None:
    text = printed(name, plate)
    (plate / f"{name}.yaml").write_text(text, encoding="utf-8")
    planned = workflow("plan", f"{name}.yaml", cwd=plate)
    assert planned.returncode == 0, planned.stderr
    assert planned.stdout.startswith(f"{name}: ")
    if "plate.npz" in text:
        assert re.findall(r"^#   (.*)$", text, re.MULTILINE) == ["workflow example plate > plate.py", "python plate.py"]


steady = archived(steady_study({"alpha": [0, 2, 5, 30], "scene.casing.gap": [20e-6, 22e-6]}))


@pytest.mark.parametrize(
    ("options", "status"), [((), 0), (("--max-temperature", "1e-9 K", "--max-displacement", "1e-9 m"), 1)]
)
def test_the_command_answers(steady: Path, options: tuple[str, ...], status: int) -> None:
    ended, said = told("limits", steady, *options, "--json")
    assert ended == status, said
    answer = json.loads(said)
    assert set(answer) == {"limits", "each", "cases", "within", "beyond", "remarks"}
    assert (answer["within"] > 0) == (status == 0)
    ends = {"from", "to", "next", "limited_by", "previous", "begun_by"}
    assert {"axis", "at", "state"} | ends == set(answer["limits"][0])


@pytest.mark.parametrize("bound", ["40 m", "-5K", "-5"])
def test_the_command_refuses(steady: Path, bound: str) -> None:
    status, said = told("limits", steady, "--max-temperature", bound)
    assert (status, bound.split()[0] in said) == (2, True)


@pytest.mark.parametrize("bound", ["40K", "40"])
def test_the_command_says_it_in_sentences(steady: Path, bound: str) -> None:
    status, said = told("limits", steady, "--max-temperature", bound)
    assert status == 0
    assert "alpha from 0 to 2 W/N: all cases are within; at 5 W/N the temperature exceeds 40 K" in said
    assert "gap = 2e-05 m: alpha from 0 to 2 W/N; at 5 W/N the temperature exceeds 40 K.\n" in said
    assert "5 of 8 within; 1 above the temperature, 2 runs_away." in said


def test_archives_without_steady_rubs_are_judged_by_their_periods(tmp_path: Path) -> None:
    plain = run_study(steady_study({"alpha": [0, 30]}, False), tmp_path / "b.nc").archive
    with open_archive(plain) as opened:
        largest = float(abs(opened["displacement"]).sel(alpha=0).max())
    status, said = told("limits", plain)
    assert status == 0
    assert "alpha from 0 to 0 W/N: all cases are within; at 30 W/N the rub has not settled.\n1 of 2 within" in said
    assert "from this start" in said
    for share, status in ((1.01, 0), (0.5, 1)):
        assert told("limits", plain, "--max-displacement", repr(share * largest))[0] == status


def test_the_page_begins_with_it(steady: Path, tmp_path: Path) -> None:
    first = told("limits", steady)[1].splitlines()[0]
    assert told("report", steady, "-o", tmp_path / "a.html")[0] == 0
    assert first in html.unescape((tmp_path / "a.html").read_text(encoding="utf-8").split("<h2>")[1])


SLOW = Advance(540, 204, {"diverged": 2}, 0.349, 12.4, 16.45, 125.0)


def test_a_line_comes_again_and_again_without_a_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run waits until two lines were written; nothing of them is on the standard output."""
    lines: list[str] = []
    twice = threading.Event()

    def print_error(line: str) -> None:
        lines.append(line)
        if len([line for line in lines if "34 %" in line]) >= 2:
            twice.set()

    def slow_run(study: Any, archive: Path, threads: Any, progress: Any, **others: Any) -> Any:
        progress(SLOW)
        assert twice.wait(60)
        return run_study(study, archive, threads, progress, **others)

    assert _terminal.EVERY == 60
    monkeypatch.setattr(_terminal, "EVERY", 0.01)
    monkeypatch.setattr(_terminal, "print_error", print_error)
    monkeypatch.setattr("workflow.run.run_study", slow_run)
    status, said = told("run", written(SINGLE, tmp_path), "-o", tmp_path / "a.nc")
    assert (status, "34 %" in said) == (0, False)
    line = next(line for line in lines if "34 %" in line)
    assert re.fullmatch(r"a\.nc: 34 %, \d:\d\d elapsed, [012]:\d\d left; 204 of 540 cases, 16/s, 2 diverged", line)


def test_a_bar_fits_in_a_terminal_and_shows_the_time_before_anything_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    for advances, line in (
        ([], "0:00 elapsed"),
        ([SLOW], "34 %, 0:00 elapsed, 2:0[45] left; 204 of 540 cases, 16/s, 2 diverged"),
    ):
        screen, follower = io.StringIO(), Follower()
        console = Console(file=screen, force_terminal=True, width=80, markup=False)
        monkeypatch.setattr(_terminal, "console", lambda console=console: console)
        with following(follower, "a.nc", False):
            for advance in advances:
                follower(advance)
        assert re.search(line, screen.getvalue())
        assert "failed" not in screen.getvalue()


def test_a_quiet_run_shows_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(_terminal, "EVERY", 0.0)
    status, said = told("run", written(ILL, tmp_path), "-q", "-o", tmp_path / "a.nc")
    assert (status, "elapsed" in said) == (1, False)
