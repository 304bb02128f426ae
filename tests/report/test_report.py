"""Reports of one archive, of several and of branches: what stands in them, what a page holds, what is refused."""

import html
import os
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from errors_over_steps import archive_of
from quick import quick
from studies import SCENE, parsed
from terminal import workflow
from workflow import plots
from workflow.analysis import answer_lines, exact_partners, notable_cases, recommend
from workflow.archive import ArchiveError, open_archive
from workflow.plots._units import scaled
from workflow.report import ReportFiles, write_report
from workflow.report import _sections as sections
from workflow.report._explorer import (
    _window,
    described,
    on_screen,
    per_period,
    shown_part,
    thinned,
    thinned_times,
    three_digits,
)
from workflow.report._figures import case_figures
from workflow.run import run_study
from workflow.study import read_study, readable

REFERRED = (
    "study: referred\ntitle: Two weights and the exact solution\n"
    + SCENE
    + """
schemes: {implicit_euler: {method: moreau, theta: 1}, unstable: {method: moreau, theta: 0.3}}
axes: {scheme: [implicit_euler, unstable, event_driven], h: [5e-5, 1e-4, 2e-4], e: [0, 0.5], alpha: 2}
zip: {model: {mechanical_modes: [1, full], thermal_modes: [2, full]}}
reference: {scheme: event_driven, mechanical_modes: full, thermal_modes: full}
output: {interval: 1 ms, histories: []}
"""
)
PRESSED = (
    "study: pressed\ntitle: Pressed tips\n"
    + SCENE.replace("gap: 50 um", "gap: 0").replace("{amplitude: 100, frequency: 50 Hz}", "{mean: 10}")
    + """
axes: {alpha: [0, 1000, 2000]}
output: {interval: 1 ms}
"""
)


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    directory = tmp_path_factory.mktemp("archives")
    made = [directory / "referred.nc", directory / "pressed.nc"]
    run_study(parsed(REFERRED), made[0])
    run_study(parsed(PRESSED), made[1])
    return made


@pytest.fixture(scope="module")
def reports(archives: list[Path], tmp_path_factory: pytest.TempPathFactory) -> list[ReportFiles]:
    """A page of each archive."""
    directory = tmp_path_factory.mktemp("pages")
    return [write_report(archive, directory / f"{archive.stem}.html") for archive in archives]


def test_extrapolated_impulses_are_never_negative() -> None:
    """A rub that touches in every other load period: a change of 1, of 1/4 in the period before."""
    drawn = per_period(np.tile([1.0, 0.0], 9)[:-1], growth=100 * np.log(4), frequency=100.0)["predicted"]
    assert drawn[-2:] == pytest.approx([0.0, 1.0])
    assert np.isnan(drawn[:-2]).all()


def test_impulses_of_cases_without_heat_are_not_extrapolated(archives: list[Path]) -> None:
    """The growth rate is of permanent contact with its heat."""
    load = {"load": {"amplitude": 100.0, "frequency": 50.0}}
    with open_archive(archives[0]) as archive:
        case = archive.isel(model=0, e=0).sel(scheme="event_driven", h=1e-4)
        for alpha in (2.0, 0.0):
            cases = described(case.assign_coords(alpha=alpha), (0,), {}, load)["cases"]
            assert ("Dashed" in cases["entries"]["0"]["periods"]["text"]) == (alpha > 0)


def test_a_page_shows_the_last_of_many_load_periods() -> None:
    """On its narrow panel a casing that moves is a field of dashes from about 40 on."""
    shown = _window(np.linspace(0.0, 0.3, 1001), frequency=200.0)
    assert shown is not None
    assert shown["start"] == pytest.approx(0.2)
    assert _window(np.linspace(0.0, 0.2, 1001), frequency=200.0) is None


def test_a_report_draws_speed_against_error(reports: list[ReportFiles]) -> None:
    written = reports[0]
    text = written.page.read_text(encoding="utf-8")
    assert written.figure == written.page.with_suffix(".png")  # speed against error, as there are no histories
    assert written.figure.stat().st_size > 10_000
    for part in ("Who stays stable", "Speed against error", "Observed orders", "What the axes do", "Errors"):
        assert f"{part}" in text, part
    assert '<span class="diverged">diverged</span>' in text
    assert "<td>unstable</td>" in text or ">unstable<" in text
    assert text.count("<img alt=") == 4


def test_a_page_of_cases_that_all_diverged_is_written(tmp_path: Path) -> None:
    lost = "axes: {scheme: [penalty, carpenter], h: [1e-4, 3.16227766017e-4], alpha: [0, 2000]}"
    study = PRESSED.replace("axes: {alpha: [0, 1000, 2000]}", lost)
    archive = tmp_path / "lost.nc"
    assert run_study(parsed(study), archive).counts == {"diverged": 8}
    text = write_report(archive).page.read_text(encoding="utf-8")
    assert '<td class="tight">0.0003162 s</td>' in text


def test_a_report_of_exact_cases_draws_maps_and_asks_for_no_step(tmp_path: Path) -> None:
    study = "study: rub\n" + SCENE + "axes: {scheme: event_driven, e: {lin: [0, 0.6, 4]}, alpha: {lin: [0, 2, 5]}}\n"
    study += "output: {interval: 1 ms, histories: [], balances: false}\n"
    run_study(parsed(study), tmp_path / "rub.nc")
    written = write_report(tmp_path / "rub.nc")
    text = written.page.read_text(encoding="utf-8")
    assert "there is no step to choose" in text
    assert text.count("map of the scene over two axes") == 4
    assert written.figure is not None


def test_several_archives_share_a_page(archives: list[Path], tmp_path: Path) -> None:
    done = workflow("report", *archives, "-o", "joint.html", cwd=tmp_path)
    assert done.stdout.splitlines() == ["page   joint.html"], done.stderr
    text = (tmp_path / "joint.html").read_text(encoding="utf-8")
    assert "2 studies" in text
    assert text.index(">referred<") < text.index(">pressed<")
    assert "no h" in text  # theta = 0.3
    missing = workflow("report", archives[0], "none.nc", "-o", "other.html", cwd=tmp_path)
    assert missing.returncode == 2
    assert "none.nc: no such archive" in missing.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["joint.html"]


@pytest.mark.parametrize(("name", "joint"), [("pressed.html", False), ("pressed.png", False), ("pressed.html", True)])
def test_a_report_never_overwrites_an_archive(name: str, joint: bool, archives: list[Path], tmp_path: Path) -> None:
    archive = tmp_path / name
    archive.write_bytes(before := archives[1].read_bytes())
    with pytest.raises(ArchiveError, match="would be one file"):
        write_report([archives[0], archive] if joint else archive, archive if joint else None)
    assert archive.read_bytes() == before


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_the_figure_alone_is_what_its_name_says(kind: str, archives: list[Path], tmp_path: Path) -> None:
    begins = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[kind]
    assert workflow("report", archives[1], "-o", f"figure.{kind}", cwd=tmp_path).returncode == 0
    assert [path.read_bytes()[: len(begins)] for path in tmp_path.iterdir()] == [begins]


def test_figures_and_pages_are_drawn_whatever_a_user_s_matplotlibrc_says(
    archives: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A machine without LaTeX, a colour map that a package of the user's registers: the figure is the same."""
    named = [tmp_path / "plain.png", tmp_path / "own.png"]
    write_report(archives[1], named[0])
    for name, value in {"text.usetex": True, "image.cmap": "firm", "axes.facecolor": "red"}.items():
        monkeypatch.setitem(matplotlib.rcParams, name, value)
    write_report(archives[1], named[1])
    assert named[0].read_bytes() == named[1].read_bytes()
    assert write_report(archives[1], tmp_path / "page.html").figure == tmp_path / "page.png"
    assert matplotlib.rcParams["text.usetex"]


def test_what_can_be_no_report_is_refused(archives: list[Path], tmp_path: Path) -> None:
    """A page is written aside and renamed: the administrator's /dev/full became one."""
    pipe, figures = tmp_path / "pipe", r"a page, \.html, or of one archive its figure alone, \.png, \.svg, \.pdf"
    os.mkfifo(pipe)
    places = {pipe: "a pipe or a device", tmp_path: "a directory", tmp_path / "no" / "a": "no such"}
    for place, problem in (
        places | dict.fromkeys((tmp_path / f"a{end}" for end in ("", ".txt", ".nc")), figures)
    ).items():
        with pytest.raises(ArchiveError, match=problem):
            write_report(archives[0], place)
    with pytest.raises(ArchiveError, match=r"of one archive"):
        write_report(archives, tmp_path / "both.png")
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]


def test_flutter_is_not_said_to_lie_above_the_critical_coupling(tmp_path: Path) -> None:
    archive = tmp_path / "flutter.nc"
    light = """
study: flutter
scene:
  chain: {nodes: 4, mass: 1.0e-3, stiffness: 1.0e6, damping: {mass: 10}, spacing: 1.0e-2, expansion: 1.0e-5,
          heat_capacity: 1.0e-5, conductance: 0.1}
  casing: {gap: 1.0e-3}
  duration: 1 ms
axes: {alpha: [0, 0.1, 0.45, 0.6], scheme: event_driven, scene.chain.expansion: [1.0e-5, 1.0e-9]}
output: {interval: 1 ms, histories: []}
"""
    run_study(parsed(light), archive)
    page = write_report(archive).page.read_text(encoding="utf-8")
    assert "a thermo-elastic structure (chain) that rubs" in page
    passed = page.partition("1 of the ok cases lie above the critical heat coupling (")[2].partition(" W/N)")[0]
    assert passed.startswith("0.5")
    assert "," not in passed
    assert "2 of the ok cases would flutter in permanent contact below" in page
    shown = workflow("show", archive, cwd=tmp_path).stdout
    assert (
        "1 ok cases above their critical alpha: in permanent contact their tip runs away thermally, which is physics"
        in shown
    )
    assert "2 ok cases below their critical alpha: in permanent contact their tip flutters, which is physics" in shown


def test_a_report_begins_with_the_answer_and_says_where_it_comes_from(
    archives: list[Path], reports: list[ReportFiles]
) -> None:
    text = reports[0].page.read_text(encoding="utf-8")
    with open_archive(archives[0]) as dataset:
        recommended = recommend(dataset)
    lines = [html.escape(line).replace("&#x27;", "&#39;") for line in answer_lines(recommended)]
    assert [line for line in lines if line not in text.split("Map of the cases")[0]] == []
    assert text.index("Map of the cases") < text.index("Who stays stable")
    assert 'class="within"' in text  # the exact scheme with all modes, though a model of one mode errs
    assert "has no <code>reference</code>" in reports[1].page.read_text(encoding="utf-8")
    for word in ("processor time", "processor", " threads", "written", "numba", "Effective e: ", "Energy residual: "):
        assert word in text, word


def test_what_is_somebody_else_s_is_written_over_only_where_it_is_named(
    archives: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    archive, page, picture = tmp_path / "a.nc", tmp_path / "a.html", tmp_path / "a.png"
    archive.write_bytes(archives[1].read_bytes())
    for foreign in (page, picture):
        foreign.write_text("mine")
        with pytest.raises(ArchiveError, match=f"{foreign.name}: is there, and no report wrote it"):
            write_report(archive)
        assert foreign.read_text() == "mine"
        foreign.unlink()
    page.write_text("mine")
    picture.write_text("mine")
    with pytest.raises(ArchiveError, match=r"a\.png: is there"):
        write_report(archive, page)
    write_report(archive, picture)
    write_report(archive, page)  # both are named by now, or a report's
    assert write_report(archive) == ReportFiles(page, picture)
    Path("report.html").write_text("mine")
    with pytest.raises(ArchiveError, match=r"report\.html: is there"):
        write_report(archives)


def test_two_sweeps_of_one_axis_are_drawn_over_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever stands first: up is the one that begins lower; sweeps of two axes are not."""
    drawn, own = list[tuple[float, float]](), plots.sweep

    def sweep(up: xr.Dataset, variable: str, down: xr.Dataset, branch: xr.Dataset | None) -> Figure:
        drawn.append((float(up["frequency"][0]), float(down["frequency"][0])))
        return own(up, variable, down, branch)

    monkeypatch.setattr(plots, "sweep", sweep)
    monkeypatch.chdir(tmp_path)
    axes = {
        "load.frequency": {"up": [500.0, 800.0, 3], "down": [800.0, 500.0, 3]},
        "load.amplitude": {"other": [50, 99, 3]},
    }
    for path, ways in axes.items():
        for name, ends in ways.items():
            over = {"h": None, "e": 0.3, "alpha": 0.0, "scheme": "event_driven", f"scene.{path}": {"sweep": ends}}
            run_study(quick(over, output={"interval": 4e-3, "histories": []}), tmp_path / f"{name}.nc", threads=1)
    assert workflow("report", "down.nc", "up.nc", cwd=tmp_path).returncode == 0
    text = Path("report.html").read_text(encoding="utf-8")
    assert 'alt="impulse of the load periods along frequency"' in text
    assert drawn == [(500.0, 800.0)]
    write_report([Path("up.nc"), Path("other.nc")])
    assert "Both sweeps" not in Path("report.html").read_text(encoding="utf-8")


def test_a_page_shows_what_changes_over_the_speed_and_along_a_sweep(tmp_path: Path) -> None:
    scene = {
        "chain": {"nodes": 1, "mass": 0.01, "stiffness": 4000.0, "damping": {"mass": 60.0}, "heat_capacity": 1.0},
        "casing": {"gap": 1e-4, "harmonics": [{"order": 2, "amplitude": 1e-5}]},
        "load": {"harmonics": [{"order": 1, "amplitude": 0.1}]},
        "speed": 50.0,
        "duration": 0.2,
    }
    axes = {"scheme": "event_driven", "e": 0.3, "scene.speed": {"sweep": [80, 120, 5]}}
    output = {"interval": 1e-3, "histories": [], "sensors": {"tip": 1}}
    study = read_study({"study": "swept", "scene": scene, "axes": axes, "output": output})
    spectra = ["spectrum of tip over the speed", "spectrum of displacement over the speed"]
    for histories, between in (([], []), (["displacement"], spectra)):
        kept = study.with_({"output.histories": histories})
        with run_study(kept, tmp_path / f"{len(between)}.nc").dataset as dataset:
            shown = sections.over_speed(dataset)
        assert shown is not None
        assert [one["about"] for one in shown["pictures"]] == [
            "contact impulse along the sweep of speed",
            *between,
            "closing of the clearance over the speed",
        ]
    assert "Over the speed and along the sweep" in write_report(tmp_path / "2.nc").page.read_text(encoding="utf-8")


RNG = np.random.default_rng(1)


def gridded(**sizes: int) -> xr.Dataset:
    """An gridded with errors that grow with h, scheme ``b`` exact; the last case diverges."""
    coords: dict[str, Any] = {name: np.arange(1, size + 1) * 1e-6 for name, size in sizes.items()}
    coords |= {"scheme": ["a", "b", "c"][: sizes["scheme"]] if "scheme" in sizes else "a"}
    scheme, h = (xr.DataArray(coords.get(name, 1e-3), dims=[name] * (name in sizes)) for name in ("scheme", "h"))
    error = (1e3 * h * (scheme != "b")).broadcast_like(xr.Dataset(coords=coords)).transpose(*sizes)
    dataset = archive_of(error.values, coords, processor_time=2e-3, max_temperature=RNG.random([*sizes.values()]))
    dataset["status"][(-1,) * len(sizes)] = 1
    return dataset


def test_thinning_keeps_the_least_and_the_largest_of_every_piece() -> None:
    values = RNG.normal(size=10_007)
    values[5000] = 50
    thin = thinned(values, 400)
    assert thin.size == thinned_times(np.linspace(0, 1, values.size), 400).size == 800
    assert (thin.min(), thin.max()) == (values.min(), 50)
    assert np.argmax(thin) / thin.size == pytest.approx(5000 / values.size, abs=2e-3)
    assert np.array_equal(thinned(values[:800], 400), values[:800])


def test_curves_are_rounded_within_a_thousandth_of_their_range() -> None:
    for scale in (1e-9, 1.0, 3e7):
        values = scale * np.array([1.0, -2.0, np.nan, 1e-3, np.inf, 3.0, np.pi / 4])
        finite = np.isfinite(values)
        kept = on_screen(values)
        assert np.array_equal(np.isfinite(kept), finite)
        assert kept[finite] == pytest.approx(values[finite], abs=5.01e-3 * scale)
        assert all(len(f"{value:.15g}") < 12 for value in kept[finite])
    for extreme in (np.zeros(4), np.full(4, np.nan), np.array([-1.7e308, 1.7e308])):
        assert np.array_equal(on_screen(extreme), extreme, equal_nan=True)


def test_metrics_keep_the_three_digits_that_a_page_shows() -> None:
    values = [2.7555631955617828, 9.994, -9.986, 0.9999, 0.0, *np.exp(RNG.uniform(-80, 80, 1000))]
    assert [f"{value:.3g}" for value in three_digits(np.array(values))] == [f"{value:.3g}" for value in values]
    assert np.isnan(three_digits(np.array([np.inf, np.nan]))).all()


def test_units_are_those_of_what_is_small() -> None:
    assert scaled("m", np.array([2e-5, 5e-5, 1e86])) == ("µm", 1e6)
    assert scaled("m", np.array([0.0, np.nan])) == ("m", 1.0)
    assert scaled("s", np.array([2e-3]))[0] == "ms"
    assert [readable(unit) for unit in ("m s-1", "W N-1", "s-1", "N s", "1")] == ["m/s", "W/N", "1/s", "N s", ""]


def test_the_first_case_is_the_worst_of_the_choice_and_each_extreme_is_named() -> None:
    dataset = gridded(scheme=3, h=4, gap=5)
    notable = notable_cases(dataset, recommend(dataset, 0.0025).choice)
    scheme, step, _ = np.unravel_index(next(iter(notable)), (3, 4, 5))
    assert (scheme, step) == (0, 0) or scheme == 1
    named = {why: case for case, why in notable.items()}
    assert named["the first case that is diverged"] == 59
    hottest = np.where(dataset["status"] == 0, dataset["max_temperature"], 0)
    assert named["hottest tip"] == int(np.argmax(hottest))


def test_exact_partners_have_the_frequency_that_a_zip_gives_with_the_step() -> None:
    dataset = gridded(scheme=2, f=3).assign_coords(h=("f", [4e-4, 2e-4, 1e-4]), frequency=("f", [1.0, 2.0, 4.0]))
    partners = exact_partners(dataset, {"b": "event_driven"}).reshape(2, 3)
    assert partners.tolist() == [[3, 4, -1]] * 2  # the last one diverged


def test_a_large_archive_is_shown_in_part_and_the_page_says_which() -> None:
    dataset = gridded(h=3, alpha=90_000)
    notable = notable_cases(dataset, recommend(dataset, 0.0025).choice)
    shown = shown_part(dataset, notable)
    assert shown.dataset.sizes["h"] == 3
    assert 2000 <= shown.dataset.sizes["alpha"] <= 2000 + len(notable) + 1
    assert shown.left_out == (f"alpha: {shown.dataset.sizes['alpha']} of its 90000 values",)
    for one, case in zip(notable, shown.cases, strict=True):
        whole, part = np.unravel_index(one, (3, 90_000)), np.unravel_index(case, shown.dataset["status"].shape)
        assert dataset["alpha"][whole[1]] == shown.dataset["alpha"][part[1]]


def test_a_page_holds_as_many_metrics_as_fit_and_tells_which_it_leaves_out() -> None:
    dataset = gridded(h=2, alpha=1000, gap=50)
    for k in range(20):
        dataset[f"extra_{k}"] = (dataset["status"].dims, RNG.random(dataset["status"].shape))
    notable = notable_cases(dataset, recommend(dataset, 0.0025).choice)
    shown = shown_part(dataset, notable)
    about = described(shown.dataset, shown.cases, {}, {})
    assert len(about["metrics"]) == 20
    assert about["left_out"][-1] == "extra 19"
    assert about["metrics"][0]["name"] == "error"
    values = about["metrics"][0]["values"]
    assert values[:-1] == pytest.approx(np.ravel(dataset["impulse_error"])[:-1], rel=5e-3)
    assert np.isnan(values[-1])  # it diverged


def test_panels_are_there_where_the_archive_has_their_axes() -> None:
    for dataset, parts in (
        (gridded(scheme=3, h=4, gap=5), {"map", "controls", "cost", "order"}),
        (gridded(gap=4), {"map", "controls"}),
    ):
        about = described(dataset, (0,), {}, {})
        assert set(case_figures(about | {"chosen_modes": None})) == parts


def test_orders_of_the_page_are_those_of_the_scheme_in_its_scene() -> None:
    dataset = gridded(scheme=3, h=4, gap=5)
    order = described(dataset, (0,), {}, {})["order"].reshape(3, 4, 5)
    assert np.isnan(order[1]).all()  # without error
    assert order[0] == pytest.approx(np.ones((4, 5)))
