"""Contact phases, growth of impulses, differences, labels, cost and indices; the case that is shown, its casing."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import sobol_indices

from errors_over_steps import archive_of
from quick import quick
from studies import FALLING_BALL, parsed
from workflow import (
    compare,
    contact_phases,
    labels,
    plots,
    read_study,
    recommend,
    run_study,
    sobol,
    work_precision,
)
from workflow.analysis import (
    NoReferenceError,
    casing_motion,
    effect,
    exact,
    impulse_growth,
    labels_of,
    period_frequency,
    shown_place,
)
from workflow.archive import open_archive
from workflow.plots import histories
from workflow.report import write_report
from workflow.report._sections import effects
from workflow.study.ranges import Drawn, Range

T = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


def forces(*rows: list[float]) -> xr.Dataset:
    coords = {"alpha": np.arange(len(rows), dtype=float), "t": T, "gap": 3.0}
    return xr.Dataset({"contact_force": (("alpha", "t"), np.array(rows))}, coords)


def test_phases_of_known_forces() -> None:
    phases = contact_phases(forces([0, 2, 4, 0, 0, 1], [0, 0, 0, 0, 0, 0], [0, 0, 0, 5, 0, 0], [0, 1, 1, 1, 1, 1]))
    assert dict(phases.sizes) == {"alpha": 4, "phase": 2}
    assert phases["begin"].values == pytest.approx(
        np.array([[0, 0.4], [np.nan, np.nan], [0.2, np.nan], [0, np.nan]]), nan_ok=True
    )
    assert phases["end"].values == pytest.approx(
        np.array([[0.2, 0.5], [np.nan, np.nan], [0.3, np.nan], [0.5, np.nan]]), nan_ok=True
    )
    assert phases["impulse"].sel(alpha=0).values == pytest.approx([0.6, 0.1])
    assert phases["peak_force"].sel(alpha=[0, 2], phase=1).values == pytest.approx([4, 5])
    assert list(phases["phase"].values) == [1, 2]
    assert float(phases["gap"]) == 3.0
    assert phases["impulse"].attrs["units"] == "N s"


def test_a_single_case_and_one_without_contact() -> None:
    one = contact_phases(forces([0, 2, 4, 0, 0, 1]).isel(alpha=0))
    assert one["begin"].dims == ("phase",)
    none = contact_phases(forces([0.0] * 6, [np.nan] * 6))
    assert dict(none.sizes) == {"alpha": 2, "phase": 0}


def test_without_forces_there_are_no_phases() -> None:
    with pytest.raises(ValueError, match=r"no history `contact_force`; name it in `output\.histories`"):
        contact_phases(forces([0.0] * 6).drop_vars("contact_force"))


def test_phases_of_a_ball_hold_its_impacts(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """A ball from 1 m: the first phase holds the first impact, and all of them bear the whole impulse."""
    rest = "axes: {scheme: event_driven, e: [0, 0.7]}\noutput: {interval: 1 ms, histories: [contact_force]}\n"
    archive = run_study(parsed(f"study: ball{FALLING_BALL}{rest}"), tmp_path / "ball.nc").dataset
    phases = contact_phases(archive)
    assert np.all(phases["begin"].sel(phase=1) <= np.sqrt(2 / 9.81))
    assert np.all(phases["end"].sel(phase=1) >= np.sqrt(2 / 9.81))
    assert phases["impulse"].sum("phase").values == pytest.approx(archive["contact_impulse"].values, rel=1e-9)
    assert int(phases["begin"].sel(e=0).count()) == 1  # it lies where it fell
    bounces = phases["impulse"].sel(e=0.7, phase=[1, 2, 3]).values
    assert bounces == pytest.approx(1.7 * 2 * np.sqrt(2 * 9.81) * 0.7 ** np.arange(3), rel=1e-9)


def cases(scale: float = 1.0, interval: float = 0.1, alphas: tuple[float, ...] = (0.0, 1.0)) -> xr.Dataset:
    t = interval * np.arange(round(1.2 / interval) + 1)
    alpha = np.array(alphas)
    return xr.Dataset(
        {
            "displacement": (("alpha", "t"), scale * (1 + alpha[:, None]) * np.sin(t)),
            "contact_impulse": ("alpha", scale * alpha),
            "critical_alpha": ("alpha", np.full(alpha.size, np.inf)),
            "processor_time": ("alpha", np.full(alpha.size, scale)),
            "status": ("alpha", np.zeros(alpha.size, dtype=np.int8)),
        },
        coords={"alpha": alpha, "t": t, "h": 1e-3 * scale},
    )


def test_differences_of_known_arrays() -> None:
    differences = compare(cases(1.02), cases())
    assert set(differences) == {"displacement", "contact_impulse", "critical_alpha"}
    assert differences["displacement"].values == pytest.approx([0.02, 0.02])
    assert differences["contact_impulse"].values == pytest.approx([0.0, 0.02])
    assert differences["critical_alpha"].values == pytest.approx([0.0, 0.0])
    assert compare(cases(), cases(0.0))["displacement"].values == pytest.approx([np.inf, np.inf])
    assert compare(cases(0.0), cases(0.0))["displacement"].values == pytest.approx([0.0, 0.0])


def test_cases_are_paired_by_label_and_samples_by_instant() -> None:
    """0.3 is not three times 0.1 in binary: instants count, not their bits."""
    differences = compare(cases(1.02, 0.1, (1.0, 3.0, 2.0)), cases(1.0, 0.3, (2.0, 1.0, 5.0)))
    assert sorted(differences["alpha"].values) == [1.0, 2.0]
    assert differences["displacement"].values == pytest.approx([0.02, 0.02])
    finer, coarser = cases(1.0, 0.1), cases(1.0, 0.3)
    finer["displacement"][:, 1::3] = 99.0  # at no common instant
    assert compare(finer, coarser)["displacement"].values == pytest.approx([0, 0], abs=1e-15)
    one = compare(cases(), cases().sel(alpha=1.0))
    assert one["displacement"].values == pytest.approx([0.5, 0.0])


def test_what_cannot_be_compared_is_said() -> None:
    with pytest.raises(ValueError, match="no result in common"):
        compare(cases()[["processor_time"]], cases())
    with pytest.raises(ValueError, match="no `alpha` in common"):
        compare(cases(), cases(1.0, 0.1, (7.0,)).sel(alpha=[7.0]))
    late = cases().assign_coords(t=cases()["t"] + 0.05)
    with pytest.raises(ValueError, match="no two samples `t` in common"):
        compare(cases(), late)


def test_a_comparison_with_the_exact_case_is_the_error_in_the_archive(tmp_path) -> None:  # type: ignore[no-untyped-def]
    axes = {"scheme": ["event_driven", "moreau"], "h": [1e-5, 2e-5], "e": None, "alpha": [0.0, 5.0]}
    output = {"histories": ["displacement", "temperature", "impulse"]}
    study = quick(axes, reference={"scheme": "event_driven"}, output=output, scene={"load.frequency": 250.0})
    archive = run_study(study, tmp_path / "a.nc", threads=1).dataset
    differences = compare(archive, archive.sel(scheme="event_driven").isel(h=0))
    for name in ("displacement", "temperature", "impulse"):
        error = archive[f"{name}_error"].transpose(*differences[name].dims)
        assert float(error.max()) > 1e-6
        assert differences[name].values == pytest.approx(error.values, rel=1e-9, abs=1e-15)


def test_growth_of_the_impulse_is_of_the_last_complete_period_over_the_first() -> None:
    nan = np.nan
    impulse = [[2.0, 3.0, 5.0], [2.0, 3.0, nan], [2.0, nan, nan], [0.0, 1.0, 2.0], [nan, nan, nan]]
    growth = impulse_growth(xr.Dataset({"period_impulse": (("case", "period"), impulse)}))
    assert growth == pytest.approx([2.5, 1.5, nan, nan, nan], nan_ok=True)
    assert impulse_growth(xr.Dataset({"period_impulse": (("case", "period"), [[1.0]])})) is None
    assert impulse_growth(xr.Dataset()) is None


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_a_printed_number_is_the_number(value: float) -> None:
    """Up to the rounding of a sum: an opened archive finds it, and nobody reads 3.0000000000000004."""
    assert float(exact(value)) == pytest.approx(value, rel=1.01e-14, abs=0)
    assert exact(np.float64(value)) == exact(value)


def test_numbers_are_as_short_as_they_can_be_without_the_rounding_of_a_sum() -> None:
    values = [1e-6, 3.16227766017e-05, 1e-4, 0.5, 30.0, 1e9]
    assert [exact(value) for value in values] == ["1e-06", "3.16227766017e-05", "0.0001", "0.5", "30", "1e+09"]
    assert exact(np.int64(3)) == "3"
    assert exact("moreau") == "moreau"
    sums = {0.1 * 3 + 2.7: "3", 1.1 * 3: "3.3", -0.1 - 0.2: "-0.3", 1e-6 * 3: "3e-06"}
    assert [exact(value) for value in sums] == list(sums.values())


def test_pictures_round_to_digits_that_tell_values_apart() -> None:
    alike = [1.00001e-5, 1.00002e-5], ["1.00001e-05 s", "1.00002e-05 s"]
    for values, texts in (([3.16227766017e-05], ["3.162e-05 s"]), alike):
        dataset = xr.Dataset(coords={"h": ("h", values, {"units": "s"})})
        assert labels_of(dataset, "h", named=False, rounded=True) == texts
        assert labels_of(dataset, "h", rounded=True) == [f"h {text}" for text in texts]


def archive() -> xr.Dataset:
    """Two schemes and three steps in two scenes; the second scene's error is twice as large."""
    h = np.array([1e-5, 1e-4, 1e-3])
    error = np.array([1.0, 10.0])[:, None, None] * h[:, None] * np.array([1.0, 2.0])
    dataset = archive_of(
        error,
        {"scheme": ["fine", "rough"], "h": h, "gap": [1e-5, 2e-5], "alpha": 30.0},
        temperature_error=3 * error,
        displacement_error=0 * error,
        processor_time=np.array([3e-8, 1e-8])[:, None, None] / h[:, None],
    )
    dataset["status"][1, 2, 0] = 1
    return dataset


def test_cost_and_error_of_known_choices() -> None:
    work = work_precision(archive())
    assert work["error"].dims == ("scheme", "h")
    assert work["error"].sel(scheme="fine").values == pytest.approx([6e-5, 6e-4, 6e-3])
    assert work["error"].sel(scheme="rough").values == pytest.approx([6e-4, 6e-3, np.nan], nan_ok=True)
    assert work["cost"].sel(scheme="fine").values == pytest.approx([3e-3, 3e-4, 3e-5])
    assert (work["cost_per_second"] * 2).values == pytest.approx(work["cost"].values)
    assert work["efficient"].values.tolist() == [[True, True, True], [False, False, False]]
    assert "gap" not in work.coords
    assert float(work["alpha"]) == 30.0
    impulse = work_precision(archive(), "impulse_error")
    assert impulse["error"].sel(scheme="fine").values == pytest.approx([2e-5, 2e-4, 2e-3])


def test_what_is_missing_is_said() -> None:
    with pytest.raises(NoReferenceError, match="no `reference`"):
        work_precision(archive().drop_vars("impulse_error"))
    with pytest.raises(ValueError, match=r"no `force_error`; give one of displacement_error"):
        work_precision(archive(), "force_error")


def test_places_of_a_list_that_is_not_full_have_no_word(tmp_path: Path) -> None:
    """A mass of 10 g at 0.5 m/s touches a casing of 1e-6 m/N at 2e-5 s and leaves it π √(m c) later."""
    scene = {
        "chain": {"nodes": 1, "mass": 0.01, "stiffness": 0, "heat_capacity": 1},
        "casing": {"gap": "10 um", "flexibility": 1e-6},
        "initial": {"velocity": 0.5},
        "duration": 2e-3,
    }
    study = {"study": "words", "scene": scene, "axes": {"scheme": "event_driven", "h": 1e-6}, "output": {"events": 4}}
    dataset = run_study(study, tmp_path / "words.nc", threads=1).dataset
    kinds = dataset["event_kind"]
    assert dataset["event_time"].values[:2] == pytest.approx([2e-5, 2e-5 + np.pi * 1e-4])
    assert labels(kinds).values.tolist() == ["touches", "leaves", "", ""]
    assert labels(kinds.where(kinds != kinds[0])).values.tolist() == ["", "leaves", "", ""]


def test_a_dimension_that_a_function_adds_is_not_that_of_an_axis() -> None:
    phases = contact_phases(forces([0, 2, 4, 0, 0, 1], [0, 1, 1, 1, 1, 1]).rename(alpha="phase"))
    assert phases["begin"].dims == ("phase", "contact_phase")
    assert list(phases["contact_phase"].values) == [1, 2]


def test_paths_are_no_datasets() -> None:
    with pytest.raises(TypeError, match=r"compare takes datasets, and 'a.nc' is none: give open_archive\('a.nc'\)"):
        compare("a.nc", cases())  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> tuple[xr.Dataset, xr.Dataset]:
    """An archive with a reference and one without, carpenter diverged in both; logarithmic gaps."""
    place = tmp_path_factory.mktemp("shown")
    steps = {"scheme": ["carpenter", "moreau", "event_driven"], "h": [1e-4, 3e-5]}
    gaps = {"scheme": ["carpenter", "moreau"], "scene.casing.gap": {"log": [15e-6, 22e-6, 4]}, "e": None, "alpha": None}
    with_errors = run_study(quick(steps, reference={"scheme": "event_driven"}), place / "errors.nc", threads=1)
    return with_errors.dataset, run_study(quick(gaps), place / "gaps.nc", threads=1).dataset


def test_the_case_shown_is_the_one_recommended_or_the_median(archives: tuple[xr.Dataset, xr.Dataset]) -> None:
    with_errors, without = archives
    choice = recommend(with_errors, 0.01).choice
    assert choice is not None
    place = shown_place(with_errors)
    assert np.ravel_multi_index(list(place.values()), with_errors["status"].shape) == choice.number
    shown = without.isel(shown_place(without))
    assert shown["status"] == 0
    ok = without["contact_impulse"].where(without["status"] == 0).values.ravel()
    assert float(shown["contact_impulse"]) == np.sort(ok[~np.isnan(ok)])[2]
    assert str(shown["scheme"].values) == "moreau"
    assert "event_driven" in histories(with_errors).get_suptitle()


def test_axes_are_weighed_by_exact_solutions(archives: tuple[xr.Dataset, xr.Dataset]) -> None:
    dataset = archives[0]
    told = effects(dataset, {})
    assert told is not None
    shares = {dim: share for dim, share, *_ in told["rows"]}
    exact = dataset.sel(scheme="event_driven").isel(h=0)
    for dim in ("e", "alpha"):
        assert shares[dim] == f"{100 * effect(exact, 'contact_impulse', dim):.2g} %"
    assert "scheme" not in shares
    assert told["of_exact"].startswith("scheme event_driven")


def test_an_opened_archive_finds_numbers_written_with_other_digits(archives: tuple[xr.Dataset, xr.Dataset]) -> None:
    dataset, gaps = archives[1], np.geomspace(15e-6, 22e-6, 4)
    assert any(gap not in dataset["gap"].values for gap in gaps)
    for k, gap in enumerate(gaps):
        assert dataset.sel(gap=gap)["gap"] == dataset["gap"][k]
        assert dataset["status"].loc[{"gap": gap * (1 - 9e-10)}]["gap"] == dataset["gap"][k]
        with pytest.raises(KeyError):
            dataset.sel(gap=gap * (1 + 3e-9))
    assert dataset.sel(gap=gaps[::-1]).sizes["gap"] == 4
    assert dataset.sel(gap=slice(gaps[1], gaps[2])).sizes["gap"] == 2
    part = dataset.isel(gap=[3, 1])
    assert part.sel(gap=gaps[1])["gap"] == dataset["gap"][1]
    plain = xr.DataArray(np.ones(4), coords={"gap": dataset["gap"].values}, dims="gap")
    assert (dataset["contact_impulse"] * plain).sizes["gap"] == 4
    assert dataset.reindex(gap=[gaps[0], 1.0]).sizes["gap"] == 2


def case(attrs: dict, **coords: tuple) -> xr.Dataset:
    t = np.linspace(0, 1, 2001)
    dataset = xr.Dataset(coords={"t": t, "gap": ((), 1e-5, attrs)})
    return dataset.assign_coords({name: ((), value, {"study_path": path}) for name, (value, path) in coords.items()})


ENTRIES = [
    {"amplitude": 2e-6, "phase": 0.5, "frequency": None, "order": 3.0},
    {"amplitude": 1e-6, "phase": 0.0, "frequency": 7.0, "order": None},
]


def attributes(entries: list[dict]) -> dict:
    """What the coordinate ``gap`` of an archive says of the casing's harmonics."""
    return {f"casing_{name}": [np.nan if e[name] is None else e[name] for e in entries] for name in entries[0]}


def test_axes_replace_what_the_study_gives() -> None:
    motion = casing_motion(
        case(
            {**attributes(ENTRIES), "speed": 2.0},
            speed=(5.0, "scene.speed"),
            harmonic_amplitude=(4e-6, "scene.casing.harmonics.0.amplitude"),
        )
    )
    assert motion is not None
    t = np.linspace(0, 1, 2001)
    place = 1e-5 + 4e-6 * np.sin(2 * np.pi * 15 * t + 0.5) + 1e-6 * np.sin(2 * np.pi * 7 * t)
    assert np.abs(motion[0] - place).max() < 1e-19  # roundings of 1e-5
    assert np.abs(motion[1] - np.gradient(place, t))[1:-1].max() < 1e-3 * np.abs(motion[1]).max()


@pytest.mark.parametrize(
    "wrong", [{}, {"casing_phase": "none"}, {"casing_phase": [0.0]}, {"casing_amplitude": None}, {"speed": "fast"}]
)
def test_what_makes_no_sense_does_not_move(wrong: dict) -> None:
    assert casing_motion(case({**attributes(ENTRIES), "speed": 2.0, **wrong} if wrong else {})) is None


@pytest.mark.parametrize(
    ("amplitude", "load", "casing", "frequency"),
    [(2.0, [], ENTRIES, 50.0), (0.0, [], ENTRIES, 15.0), (0.0, ENTRIES[1:], ENTRIES, 7.0), (0.0, [], [], 50.0)],
)
def test_periods_are_those_of_the_load_else_of_the_first_harmonic(
    amplitude: float, load: list, casing: list, frequency: float
) -> None:
    scene = {
        "speed": 2.0,
        "load": {"amplitude": 1.0, "frequency": 50.0, "harmonics": load},
        "casing": {"harmonics": casing},
    }
    one = case({}, speed=(5.0, "scene.speed"), amplitude=(amplitude, "scene.load.amplitude"))
    assert period_frequency(one, scene) == frequency


@pytest.mark.parametrize("scene", [{}, {"load": 1}, {"load": {"amplitude": 0, "harmonics": [2]}}])
def test_a_scene_without_sense_has_no_periods(scene: dict) -> None:
    assert np.isnan(period_frequency(case({}), scene))


NUMBERS = ("x", "y", "z")


def table(f: np.ndarray, zipped: Drawn) -> xr.Dataset:
    """Return values ``(…, case)`` as an archive has them."""
    dims = (*("e", "alpha")[: f.ndim - 1], "design")
    about = {"sample_point": np.repeat(np.arange(zipped.points), len(zipped.matrices))}
    about |= {"sample_matrix": np.array(zipped.matrices * zipped.points, dtype=object)}
    numbers = {path: ("design", list(values), {"study_path": path}) for path, values in zipped.columns().items()}
    coords = numbers | {name: ("design", values) for name, values in about.items()}
    return xr.Dataset({"f": (dims, f), "status": (dims, np.zeros(f.shape, np.int8))}, coords)


def ishigami(points: int) -> xr.Dataset:
    zipped = Drawn("sobol_indices", points, 1, dict.fromkeys(NUMBERS, Range("lin", -np.pi, np.pi)))
    x, y, z = zipped.columns().values()
    return table(np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * np.power(z, 4) * np.sin(x), zipped)


def test_estimates_are_those_of_scipy() -> None:
    dataset = ishigami(64)
    a, b, *mixed = dataset["f"].values.reshape(64, 5).T
    scipy = sobol_indices(func={"f_A": a[None], "f_B": b[None], "f_AB": np.array(mixed)[:, None]}, n=64)
    indices = sobol(dataset.isel(design=np.random.default_rng(3).permutation(320)), "f").sel(number=list(NUMBERS))
    assert indices["first"].values == pytest.approx(scipy.first_order, rel=1e-12, abs=1e-12)
    assert indices["total"].values == pytest.approx(scipy.total_order, rel=1e-12, abs=1e-12)


def test_an_interval_is_that_of_resampled_points() -> None:
    dataset, generator = ishigami(16), np.random.default_rng(0)
    f = dataset["f"].values.reshape(16, 5)
    again = [f[generator.integers(16, size=16)] for _ in range(999)]
    both = [sobol(dataset.assign(f=("design", one.ravel())), "f") for one in again[:40]]
    a, b, mixed = (np.array([one[:, at] for one in again]) for at in (0, 1, slice(2, None)))
    centre, variance = np.concatenate([a, b], 1).mean(1)[:, None], np.concatenate([a, b], 1).var(1)[:, None]
    first = ((b - centre)[..., None] * (mixed - a[..., None])).mean(1) / variance
    total = ((mixed - a[..., None]) ** 2).mean(1) / 2 / variance
    assert np.array([one["first"].values for one in both]) == pytest.approx(first[:40])
    indices = sobol(dataset, "f")
    assert pytest.approx(np.percentile(first, [2.5, 97.5], axis=0)) == indices["first_interval"].values.T
    assert pytest.approx(np.percentile(total, [2.5, 97.5], axis=0)) == indices["total_interval"].values.T


def test_other_dimensions_stay_and_what_is_missing_has_no_index() -> None:
    one = ishigami(8)
    dataset = table(np.stack([one["f"].values, np.full(40, 0.1), 2 * one["f"].values]), Drawn(
        "sobol_indices", 8, 1, dict.fromkeys(NUMBERS, Range("lin", -np.pi, np.pi))
    ))  # fmt: skip
    dataset["status"][2, 3] = 1  # the second number of B in the first point
    indices = sobol(dataset, "f")
    assert indices["first"].dims == ("e", "number")
    assert list(indices["number"].values) == list(NUMBERS)
    assert indices["total"][0].values == pytest.approx(sobol(one, "f")["total"].values)
    assert np.isnan(indices["first"][1]).all()
    assert np.isnan(indices["total_interval"][1]).all()
    assert np.isnan(indices["first"][2]).values.tolist() == [False, True, False]
    with pytest.raises(ValueError, match="`g` is no metric along `design`"):
        sobol(dataset, "g")
    with pytest.raises(ValueError, match="draw a zip with `sample: sobol_indices`"):
        sobol(dataset.isel(design=slice(0, None, 5)), "f")


PRESSED = """
study: pressed
scene:
  chain: {nodes: 3, mass: 2.5e-3, stiffness: 4.0e6, damping: {mass: 10}, heat_capacity: 1}
  casing: {gap: 20 um}
  load: {mean: 120}
  initial: static
  duration: 20 ms
axes: {scheme: [moreau, event_driven], h: 1e-4}
zip:
  design: {sample: sobol_indices, points: 128, of: {scene.load.mean: [60, 90], scene.casing.gap: [10 um, 30 um]}}
reference: {scheme: event_driven}
output: {interval: 1 ms}
"""


def test_a_pressed_tip_divides_its_impulse_between_load_and_gap(tmp_path: Path) -> None:
    """The impulse is T (F − d/S), S = 3/4e6 m/N: shares of (30 N)² and (20 µm/S)², nothing together."""
    study = read_study(PRESSED)
    run_study(study, tmp_path / "pressed.nc", threads=1)
    outcome = run_study(study.with_({"zip.design.points": 256}), tmp_path / "pressed.nc", threads=1)
    assert outcome.resumed == 1024
    dataset, flexibility = open_archive(tmp_path / "pressed.nc"), 3 / 4e6
    force = dataset["mean"] - dataset["gap"] / flexibility
    assert dataset["contact_impulse"].values == pytest.approx(np.array([0.02 * force.values] * 2), rel=1e-6)
    indices = sobol(dataset, "contact_impulse")
    load, gap = 30**2, (20e-6 / flexibility) ** 2
    for name in ("first", "total"):
        assert indices[name].sel(number=["mean", "gap"]).values == pytest.approx(
            np.array([[load, gap]] * 2) / (load + gap),
            abs=4e-3,  # of 256 points
        )
    assert "sample_point" not in recommend(dataset).choice.worst.case
    figure = plots.sobol_indices(dataset.sel(scheme="event_driven"), "contact_impulse")
    first, total = (line for line in figure.axes[0].get_lines() if line.get_marker() != "None")
    assert first.get_ydata() == pytest.approx(indices["first"].sel(scheme="event_driven").values)
    assert total.get_ydata() == pytest.approx(indices["total"].sel(scheme="event_driven").values)
    page = write_report(tmp_path / "pressed.nc").page.read_text(encoding="utf-8")
    assert "What the drawn numbers do" in page
    assert "What the axes do" not in page
