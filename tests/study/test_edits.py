"""Values replaced by their path, and every value as plan tells it: in SI, with its unit and where it comes from."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from quick import quick
from studies import SMALL, parsed, refusal, written
from workflow.study import ResolvedValue, StudyError, read_study, resolved_values, setting
from workflow.study.ranges import Range

ONE_NODE = "{nodes: 1, mass: 1e-3, stiffness: 1e6, heat_capacity: 1}"


def test_a_replaced_value_stands_in_the_text_too() -> None:
    study = parsed(SMALL.replace("casing:", "casing:  # as built\n   ")).with_(
        {"scene.casing.gap": "10 um", "axes.e": np.array([0.0, 0.25]), "axes.scene.load.frequency": ["50 Hz", 60]}
    )
    assert study.scene.gap == 1e-5
    again = read_study(study.text)
    assert again.resolved() == study.resolved()
    values = {axis.path: axis.values for dimension in again.dimensions for axis in dimension.axes}
    assert values["e"] == (0.0, 0.25)
    assert values["scene.load.frequency"] == (50.0, 60.0)
    assert "# as built" in study.text
    assert "h: [1e-4, 2e-4]" in study.text


def test_a_study_is_read_from_a_path_a_text_and_a_mapping(tmp_path: Path) -> None:
    content = json.loads(quick().text)
    study = read_study(content | {"axes": content["axes"] | {"e": np.array([0.0, 0.5])}})
    path = tmp_path / "a.yaml"
    path.write_text(quick({"e": [0.0, 0.5]}).text, encoding="utf-8")
    for other in (str(path), path, study.text):
        assert read_study(other).resolved() == study.resolved()
    assert read_study(study) is study
    assert read_study(study, {"axes.e": [0, 0.7]}).dimensions[0].axes[0].values == (0, 0.7)


def test_numbers_that_a_yaml_1_1_loader_leaves_as_texts_are_numbers() -> None:
    scene = {"chain": {"nodes": 2, "mass": "1e-3", "stiffness": ["2.0e7", 1], "heat_capacity": 1}}
    scene |= {"casing": {"gap": "1 um"}, "duration": "1.e-1"}
    study = read_study({"study": "a", "title": "1e6", "scene": scene, "axes": {"h": ["1e-6", "2E-6"]}})
    assert study.title == "1e6"
    assert study.scene.duration == 0.1
    assert study.scene.parameters.stiffness == (2e7, 1)
    assert read_study(study.text).resolved() == study.resolved()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("scene.casing.gap", "10 kg", "with_ scene.casing.gap: "),
        ("axes.e", [0, 2], "with_ axes.e: [1]: `2` is out of range"),
        ("study.name", "b", "with_ study.name: leads through study"),
        ("scene..gap", 1, "has an empty word in its path"),
        ("scene.casing.gap", object(), "holds a value of the type object"),
    ],
)
def test_a_mistake_names_the_setting(key: str, value: object, message: str) -> None:
    assert message in refusal(parsed(SMALL).with_, {key: value})


@pytest.mark.parametrize(
    ("section", "varied"),
    [
        ("axes: {GAP: [1 um, 2 um]}", "axes.GAP"),
        ("zip: {both: {GAP: [1 um, 2 um], e: [0, 1]}}", "zip.both.GAP"),
        ("zip: {a: {sample: random, points: 2, of: {GAP: [1 um, 2 um]}}}", "zip.a.of.GAP"),
    ],
)
def test_a_value_that_an_axis_or_a_zip_varies_is_not_replaced_in_silence(section: str, varied: str) -> None:
    section, varied = (text.replace("GAP", "scene.casing.gap") for text in (section, varied))
    study = read_study(f"study: a\nscene: {{chain: {ONE_NODE}, casing: {{gap: 1 um}}, duration: 0.1}}\n{section}\n")
    with pytest.raises(StudyError, match=f"with_ scene.casing.gap: .*; set {re.escape(varied)} instead"):
        study.with_({"scene.casing.gap": "10 um"})
    again = study.with_({varied: ["3 um", "4 um"]}).dimensions[0]
    assert again.axes[0].values == (3e-6, 4e-6) or again.drawn.ranges["scene.casing.gap"] == Range("lin", 3e-6, 4e-6)


def test_a_setting_is_yaml() -> None:
    assert setting("axes.e=[0, 0.5]") == ("axes.e", [0, 0.5])
    assert setting("axes.h=1e-6") == ("axes.h", 1e-6)
    assert setting("scene.casing.gap=10 um") == ("scene.casing.gap", "10 um")
    assert setting("reference=") == ("reference", None)
    for wrong in ("axes.e", "=1", "axes.e=[0", "axes.e=*a"):
        with pytest.raises(StudyError, match="-s "):
            setting(wrong)


TEXT = """
study: a
scene:
  chain: {nodes: 2, mass: [2 g, 3 g], stiffness: 1.0e6, heat_capacity: 1}
  casing: {gap: 20 um}
  load: {amplitude: 10, frequency: 600 rpm}
  duration: 1 ms
schemes: {half: {method: moreau, theta: 0.5}}
axes: {scheme: [half, event_driven], e: 0.5, scene.load.phase: [0, 90 deg], h: 1e-5}
zip: {model: {mechanical_modes: [0, full], thermal_modes: [0, full]}}
"""


def resolved_by_path(text: str) -> dict[str, ResolvedValue]:
    study = parsed(text)
    axes = [axis for dimension in study.dimensions for axis in dimension.axes]
    cell = study.cell({axis.path: axis.values[0] for axis in (*study.scalars, *axes)})
    return {value.path: value for value in resolved_values(study, cell)}


def test_counts_that_a_tolerance_decides_are_told_as_they_are_written() -> None:
    axes = "axes: {scheme: [half, event_driven], mechanical_modes: [1, auto], thermal_modes: auto, tolerance: 0.01}"
    values = resolved_by_path(TEXT[: TEXT.index("axes:")] + axes)
    assert values["mechanical_modes"].text == "1, auto"
    assert values["thermal_modes"] == ResolvedValue("thermal_modes", ("auto",), "1", "study")
    assert values["tolerance"] == ResolvedValue("tolerance", (0.01,), "1", "study")
    assert "tolerance" not in resolved_by_path(TEXT)


def test_values_units_and_origins() -> None:
    values = resolved_by_path(TEXT)
    assert values["scene.casing.gap"] == ResolvedValue("scene.casing.gap", (2e-5,), "m", "study")
    assert values["scene.chain.mass"] == ResolvedValue("scene.chain.mass", (0.002, 0.003), "kg", "study")
    assert values["scene.load.frequency"].values == (10.0,)
    assert values["scene.load.mean"] == ResolvedValue("scene.load.mean", (0.0,), "N", "default")
    assert values["scene.load.phase"].origin == "axis"
    assert values["scene.duration"] == ResolvedValue("scene.duration", (1e-3,), "s", "study")
    assert values["scene.chain.damping.mass"].origin == "default"
    assert (values["e"].origin, values["e"].values) == ("study", (0.5,))
    assert (values["alpha"].origin, values["alpha"].values) == ("default", (0.0,))
    assert values["mechanical_modes"] == ResolvedValue("mechanical_modes", (0, 1), "1", "axis")
    assert values["schemes.half.theta"].origin == "study"
    assert values["schemes.event_driven.events"].origin == "default"
    assert values["output.interval"] == ResolvedValue("output.interval", (1e-6,), "s", "default")
    assert values["scene.chain.mass"].text == "0.002, 0.003 kg"
    assert ResolvedValue("a", tuple(map(float, range(10))), "m", "axis").text == "0, 1, …, 9 (10 values) m"


def test_a_static_start_is_listed_once() -> None:
    values = resolved_by_path(TEXT.replace("  duration", "  initial: static\n  duration"))
    start = values["scene.initial.displacement"]
    assert (start.text, start.origin) == ("static", "study")
    assert "scene.initial.velocity" not in values


def test_values_of_a_table_have_the_units_of_its_columns() -> None:
    model = "modes: {table: [[1.2 kHz, 50 %, 14.1]], heat: [[30 1/min, 2 K**0.5/mJ**0.5]]}"
    parameters = parsed(f"study: a\nscene: {{{model}, casing: {{gap: 1e-5}}, duration: 1 ms}}\n").scene.parameters
    assert parameters.table == ((1200.0, 0.5, 14.1),)
    assert parameters.heat == ((0.5, pytest.approx(2 * 1000**0.5)),)
    with pytest.raises(StudyError, match=r"heat\[0\]\[1\]: `2 m` is not in K"):
        parsed(f"study: a\nscene: {{{model.replace('2 K**0.5/mJ**0.5', '2 m')}, casing: {{gap: 1}}, duration: 1}}\n")


def test_files_and_tables_are_listed(tmp_path: Path) -> None:
    (tmp_path / "heat.csv").write_text("rate,tip\n0.5,2\n")
    model = "  modes: {table: [[1200, 0.005, 14.1], [3000, 0.005, 9]], heat: heat.csv}\n  casing: {gap: 1e-5}\n"
    study = read_study(written(f"study: a\nscene:\n{model}  duration: 1 ms\n", tmp_path))
    cell = study.cell({axis.path: axis.values[0] for axis in study.scalars})
    listed = {value.path: value.text for value in resolved_values(study, cell)}
    assert listed["scene.modes.table"] == "2 rows"
    assert listed["scene.modes.heat"] == "heat.csv"
    assert "scene.modes.coupling" not in listed
