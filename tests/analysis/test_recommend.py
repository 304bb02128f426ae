"""The recommended choice is the one that a brute search of the archive finds; what it says is what was found."""

import itertools
import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic_core import to_json

from studies import SCENE, parsed
from terminal import workflow
from workflow.analysis import (
    NoReferenceError,
    recommend,
    recommendation_cautions,
    recommendation_entries,
    recommendation_row,
    sentence,
    undecidable,
)
from workflow.analysis._recommend import SPREAD
from workflow.archive import open_archive
from workflow.run import run_study
from workflow.schemes import Status

ERRORS = ("displacement_error", "temperature_error", "impulse_error")
DIMS = ("e", "scheme", "model", "gap", "h")
SIZES = {"e": 2, "scheme": 2, "model": 2, "gap": 3, "h": 3}


def archive(seed: int, bad: float = 0.1, parts: bool = True) -> xr.Dataset:
    """An archive of random errors in which some cases failed, are missing or have no error."""
    rng = np.random.default_rng(seed)
    shape = tuple(SIZES[dim] for dim in DIMS)
    fits = rng.uniform(0.5, 3.0, (1, 2, 2, 1, 3))  # decades by which a choice is good in all cases of the scene
    data: dict[str, Any] = {}
    for name in ERRORS:
        scheme, model = 10 ** (-fits - rng.uniform(0, 1, (2, *shape)))
        data[name] = scheme + model
        if parts:
            data[name.replace("_error", "_scheme_error")] = scheme
            data[name.replace("_error", "_model_error")] = model
    status = np.where(rng.uniform(size=shape) < bad, rng.choice([1, 3, 4], shape), 0)
    for name in data:
        data[name] = np.where((status != 0) | (rng.uniform(size=shape) < bad / 4), np.nan, data[name])
    data["processor_time"] = np.where(status == Status.NOT_RUN, np.nan, rng.uniform(1e-4, 1e-1, shape))
    data["predictability"] = 10 ** rng.uniform(-9, -3, shape)
    data["status"] = status.astype(np.int8)
    data["message"] = np.where(status == 1, "it grew", "").astype(object)
    return xr.Dataset(
        {name: (DIMS, values) for name, values in data.items()},
        coords={
            "e": [0.0, 0.5], "scheme": ["moreau", "carpenter"], "gap": [1e-5, 2e-5, 3e-5], "h": [1e-6, 1e-5, 1e-4],
            "mechanical_modes": ("model", [3, 19]), "thermal_modes": ("model", [12, 19]), "alpha": 30.0,
        },
        attrs={"duration": 2.0},
    )  # fmt: skip


def brute(dataset: xr.Dataset, tolerance: float) -> tuple[float, dict[str, int]] | None:
    """Return cost and place of the answer, case by case: the most accurate within 25 % of the least cost."""
    good = []
    for k, m, s in itertools.product(range(2), range(2), range(3)):
        times, met, worst = [], True, 0.0
        for e, gap in itertools.product(range(2), range(3)):
            case = dataset.isel(e=e, scheme=k, model=m, gap=gap, h=s)
            met &= int(case.status) == 0 and all(float(case[name]) <= tolerance for name in ERRORS)
            worst = max(worst, *(float(case[name]) for name in ERRORS))
            times.append(float(case.processor_time))
        if met:
            good.append((worst, float(np.mean(times)), {"scheme": k, "model": m, "h": s}))
    least = min((cost for _, cost, _ in good), default=np.inf)
    among = [one for one in good if one[1] <= 1.25 * least]
    return min(among, key=lambda one: one[0])[1:] if among else None


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.sampled_from([0.3, 0.1, 0.03, 0.01, 1e-6]),
    st.sampled_from([0.0, 0.01, 0.1]),
    st.booleans(),
)
def test_it_is_what_a_brute_search_finds(seed: int, tolerance: float, bad: float, parts: bool) -> None:
    dataset = archive(seed, bad, parts)
    expected, recommended = brute(dataset, tolerance), recommend(dataset, tolerance)
    assert (recommended.choice is None) == (expected is None)
    if expected is not None and recommended.choice is not None:
        cost, place = expected
        chosen = dataset.isel(place)
        assert recommended.choice.cost == pytest.approx(cost, rel=1e-12)
        assert recommended.choice.cost_per_second == pytest.approx(cost / 2, rel=1e-12)
        settings_of = {name: chosen[name].item() for name in ("scheme", "h", "mechanical_modes", "thermal_modes")}
        assert recommended.choice.settings == settings_of
        assert recommended.choice.share == 1.0
        assert recommended.choice.worst.error == max(float(chosen[name].max()) for name in ERRORS)
        assert recommended.choice.worst.error <= tolerance
        if recommended.next is not None:
            assert recommended.next.cost < recommended.choice.cost
            assert recommended.next.share < 1
    assert json.loads(to_json(recommendation_entries(recommended)))["tolerance"] == tolerance
    assert sentence(recommended).endswith(".")
    assert len(recommendation_row(recommended)) == 6


def test_a_step_is_named_for_people_and_holds_the_digits_that_select_it_in_json() -> None:
    dataset = even().assign_coords(h=[1e-6, 10**-5.5, 1e-4])
    dataset["impulse_error"][{"h": 0}] = dataset["impulse_error"][{"h": 2}] = 0.5
    answer = recommend(dataset, 0.01)
    assert "h = 3.16e-06 s" in sentence(answer)
    assert recommendation_entries(answer)["h"] == 10**-5.5


def test_of_choices_of_about_the_same_cost_the_most_accurate_is_named() -> None:
    dataset = even()
    dataset["processor_time"] = xr.full_like(dataset["processor_time"], 1.0)
    dataset["processor_time"][{"scheme": 0, "model": 1, "h": 0}] = 1 + 1e-3
    dataset["processor_time"][{"scheme": 1}] = 1.01 + SPREAD
    dataset["impulse_error"][{"h": 1}] = 2e-4
    for name in ERRORS:
        dataset[name][{"scheme": 0, "model": 1, "h": 0}] = 9e-5
    recommended = recommend(dataset, 0.01)
    assert recommended.choice is not None
    assert recommended.choice.settings == {"scheme": "moreau", "h": 1e-6, "mechanical_modes": 19, "thermal_modes": 19}


def test_the_order_of_dimensions_and_chunks_do_not_matter() -> None:
    dataset = archive(3, 0.01)
    turned = dataset.transpose(*reversed(DIMS)).chunk({"h": 1})
    assert recommendation_entries(recommend(dataset, 0.1)) == recommendation_entries(recommend(turned, 0.1))


def even(**changed: float) -> xr.Dataset:
    """An archive in which all cases have the same errors but for what is changed."""
    dataset = archive(0, 0.0)
    for name in dataset.data_vars:
        if "error" in str(name):
            dataset[name] = xr.full_like(dataset[name], changed.get(str(name), 1e-4))
    return dataset


def test_the_larger_part_limits() -> None:
    by_basis = even(temperature_error=5e-3, temperature_scheme_error=1e-3, temperature_model_error=4e-3)
    chosen = recommend(by_basis, "1%").choice
    assert chosen is not None
    assert (chosen.worst.variable, chosen.worst.limited_by) == ("temperature", "basis")
    nothing = recommend(by_basis, "0.1%")
    assert nothing.choice is None
    assert "more modes" in sentence(nothing)
    by_step = even(impulse_error=5e-3, impulse_scheme_error=4e-3, impulse_model_error=1e-3)
    by_step["impulse_error"][{"h": 2}] = 5e-2
    said = sentence(recommend(by_step, 1e-3))
    assert "Nothing in this study meets 0.1 % in all 6 cases" in said
    assert "smaller steps: at order one" in said
    for tolerance in (4.5e-3, 4.99e-3):  # the step's part alone is within them
        failing = recommend(by_step, tolerance)
        assert failing.next is not None
        advised = float(sentence(failing).partition("at order one about h = ")[2].split()[0])
        assert 0.5 < advised / failing.next.settings["h"] < 1


def test_a_case_without_an_error_misses_and_is_named() -> None:
    dataset = even()
    dataset["status"][{"e": 1, "gap": 2}] = Status.DIVERGED
    dataset["message"][{"e": 1, "gap": 2}] = "it grew"
    recommended = recommend(dataset, 0.01)
    assert recommended.choice is None
    assert recommended.next is not None
    assert recommended.next.share == pytest.approx(5 / 6)
    assert recommended.next.worst.case == {"e": 0.5, "gap": 3e-5}
    assert "e = 0.5, gap = 3e-05 (diverged: it grew)" in sentence(recommended)


def test_cases_without_a_reference_are_named_with_the_answer_without_them() -> None:
    """Of e = 1, say: no step and no mode helps there."""
    dataset = even()
    for name in ERRORS:
        dataset[name][{"e": 1}] = np.nan
    dataset["message"][{"e": 1}] = "reference: stopped"
    recommended = recommend(dataset, 0.01)
    assert recommended.choice is None
    assert [case["e"] for case in recommended.missing] == [0.5] * 3
    assert recommended.leave_out == "drop_sel(e=[0.5])"
    without = recommend(dataset.drop_sel(e=[0.5]), 0.01)
    assert without.choice is not None
    assert recommended.rest == without
    said = sentence(recommended)
    assert "Nothing has an error in 3 of them: e = 0.5, gap = 1e-05; " in said
    assert "(reference: stopped). Without them, `archive.drop_sel(e=[0.5])`: " + sentence(without) in said
    assert "Add " not in said
    assert recommendation_row(recommended) == recommendation_row(without)
    assert recommendation_entries(recommended)["rest"]["sentence"] == sentence(without)
    for name in ERRORS:
        dataset[name][{"e": 0, "gap": 1}] = np.nan  # each value of e has one, two of the gap have none
    assert recommend(dataset, 0.01).leave_out == ""
    for name in ERRORS:
        dataset[name][{"e": 1, "gap": [0, 2]}] = 1e-4
    assert recommend(dataset, 0.01).leave_out == "drop_sel(gap=[2e-05])"


def test_a_reference_that_some_choices_lack_is_asked_for() -> None:
    dataset = even()
    for name in ERRORS:
        dataset[name][{"e": 1, "h": [0, 1]}] = np.nan
        dataset[name][{"h": 2}] = 0.5
    recommended = recommend(dataset, 0.01)
    assert recommended.missing == ()
    assert sentence(recommended).endswith("Add a reference that ends ok in that case.")
    assert recommendation_row(recommended)[4:] == ("no error", "no reference")


def test_coordinates_have_their_units() -> None:
    dataset = even()
    dataset["gap"].attrs["units"] = "m"
    dataset["h"].attrs["units"] = "s"
    dataset["impulse_error"][{"e": 1, "gap": 2}] = 5e-3
    assert "(impulse, e = 0.5, gap = 30 µm)" in sentence(recommend(dataset, 0.01))


def test_cases_that_have_not_run_ask_for_the_run() -> None:
    dataset = even()
    dataset["status"][:] = Status.NOT_RUN
    for name in ("processor_time", *ERRORS):
        dataset[name][:] = np.nan
    recommended = recommend(dataset, 0.01)
    answer = sentence(recommended)
    assert answer == "No choice that has run in all its cases meets 1 %. Run the study to its end."
    assert "any time step" not in answer
    assert recommendation_row(recommended)[2:] == ("not measured", "0 %", "not run", "no result")


def test_a_reference_with_the_modes_of_each_case_is_said_to_judge_no_basis() -> None:
    dataset = even()
    assert recommendation_cautions(dataset) == ()
    for name in ERRORS:
        dataset[name.replace("_error", "_model_error")][:] = 0.0
    [caution] = recommendation_cautions(dataset)
    assert "do not contain that of the reduced model" in caution
    assert recommendation_cautions(dataset.isel(model=[0])) == ()


def test_undecidable_cases_are_named_and_not_counted() -> None:
    dataset = even()
    assert "keeps within 1 % in all 6 cases (e × gap)" in sentence(recommend(dataset, 0.01))
    dataset["predictability"][{"e": 1, "gap": 0}] = 2e-3
    recommended = recommend(dataset, 0.01)
    assert recommended.undecidable == ({"e": 0.5, "gap": 1e-5},)
    assert "e = 0.5" in undecidable(recommended)
    assert "keeps within 1 % in all 5 decidable of 6 cases (e × gap)" in sentence(recommended)
    assert recommend(dataset, 0.1).undecidable == ()


def test_a_scheme_that_reads_no_step_is_said_to_need_none() -> None:
    dataset = even()
    assert "any time step" in sentence(recommend(dataset, 0.01))
    dataset["impulse_error"][{"h": 0}] = 2e-4
    assert "any time step" not in sentence(recommend(dataset, 0.01))


def test_a_recommendation_is_printed_as_its_sentence() -> None:
    recommended = recommend(even(), 0.01)
    assert str(recommended) == sentence(recommended)
    assert "mechanical + " in str(recommended)
    assert "1 %" in recommended._repr_html_()


def test_options_of_schemes_are_numerical() -> None:
    """Stiffnesses of the contact spring are chosen among; a coordinate of the scene is not."""
    dataset = even().rename(gap="stiffness")
    dataset["stiffness"].attrs["study_path"] = "schemes.penalty.stiffness"
    recommended = recommend(dataset, 0.01)
    assert recommended.choice is not None
    assert recommended.choice.settings["stiffness"] in dataset.stiffness.values
    assert recommended.choice.worst.case.keys() == {"e"}


@pytest.mark.parametrize("tolerance", ["0", "-1%", "much", "nan", "inf"])
def test_a_tolerance_is_a_positive_number(tolerance: str) -> None:
    with pytest.raises(ValueError, match="positive"):
        recommend(even(), tolerance)


def test_the_studys_own_tolerance_is_the_default() -> None:
    assert recommend(even()).tolerance == 0.01
    assert recommend(even().assign_coords(tolerance=1e-3)).tolerance == 1e-3


def test_without_a_reference_there_is_no_answer() -> None:
    with pytest.raises(NoReferenceError):
        recommend(even().drop_vars("impulse_error"))


KEPT = Path(__file__).parents[2] / "data" / "compressor_blade.nc"


def test_what_is_advised_without_a_reference_gives_an_answer(tmp_path: Path) -> None:
    axes = "axes: {scheme: [moreau, event_driven], h: [1e-4, 1e-5], e: [0, 0.5], alpha: [0, 5]}\n"
    (tmp_path / "plain.yaml").write_text(f"study: plain\n{SCENE}{axes}output: {{histories: []}}\n")
    assert workflow("run", "plain.yaml", cwd=tmp_path).returncode == 0
    refusal = workflow("recommend", "plain.nc", cwd=tmp_path)
    assert refusal.returncode == 2
    assert "reference" in refusal.stderr
    command = shlex.split(refusal.stderr.split("e.g. ")[1])
    assert workflow(*command[1:], cwd=tmp_path).returncode == 0
    assert workflow("recommend", command[-1], cwd=tmp_path).returncode == 0


def test_the_command_answers(tmp_path: Path) -> None:
    text = workflow("recommend", KEPT, "--tolerance", "10%", cwd=tmp_path)
    assert text.returncode == 0
    assert "keeps within 10 % in all 8 cases (amplitude × gap × alpha)" in text.stdout.splitlines()[0]
    answer = workflow("recommend", KEPT, "--json", cwd=tmp_path)
    choice = json.loads(answer.stdout)
    assert choice["tolerance"] == 0.01
    assert {"scheme", "h", "mechanical_modes", "thermal_modes", "reduction", "cost", "worst", "share"} <= set(choice)
    assert {"limited_by", "next"} <= set(choice)
    assert [row["tolerance"] for row in choice["table"]] == [0.1, 0.01, 0.001]
    nothing = workflow("recommend", KEPT, "--tolerance", "1e-6", cwd=tmp_path)
    assert nothing.returncode == 1
    assert "Nothing in this study meets" in nothing.stdout
    undecided = workflow("recommend", KEPT.with_name("work_precision.nc"), "--tolerance", "1e-14", cwd=tmp_path)
    assert "0 decidable of 24 cases" in undecided.stdout
    assert undecided.returncode == 1


def test_an_answer_without_contact_or_with_cases_not_run_is_cautioned() -> None:
    status = xr.DataArray([Status.OK, Status.OK])
    free, touched = xr.DataArray([0.0, 0.0]), xr.DataArray([1e-3, 0.0])
    assert list(recommendation_cautions(xr.Dataset({"status": status, "contact_impulse": touched}))) == []
    (said,) = recommendation_cautions(xr.Dataset({"status": status, "contact_impulse": free}))
    assert "free motion" in said
    diverged = xr.Dataset(
        {"status": status.copy(data=[Status.OK, Status.DIVERGED]), "contact_impulse": free.copy(data=[0, np.nan])}
    )
    assert list(recommendation_cautions(diverged)) == [said]
    waiting = xr.Dataset({"status": xr.DataArray([Status.OK, Status.NOT_RUN]), "contact_impulse": touched})
    assert list(recommendation_cautions(waiting)) == ["1 of 2 cases are not run yet"]


def test_a_value_of_a_zip_that_holds_not_all_cases_of_the_scene_is_judged_in_its_own(tmp_path: Path) -> None:
    zipped = "zip: {pair: {h: [1e-4, 5e-5], scene.casing.gap: [1e-5, 2e-5]}}"
    reference = "reference: {scheme: event_driven, mechanical_modes: full, thermal_modes: full}"
    study = parsed(f"study: a\n{SCENE}axes: {{scheme: moreau}}\n{zipped}\n{reference}\noutput: {{interval: 1 ms}}\n")
    run_study(study, tmp_path / "a.nc", threads=1)
    with open_archive(tmp_path / "a.nc") as archived:
        dataset = archived.load()
    for tolerance in (10.0, 1e-12):
        text = sentence(recommend(dataset, tolerance))
        assert "in all of its cases" in text
        assert "at gap = " in text
