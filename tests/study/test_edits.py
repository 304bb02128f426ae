"""Values replaced by their path: the study, its text and what is said of mistakes."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from quick import quick
from studies import SMALL, parsed, refusal
from workflow import read_study
from workflow.study import StudyError, setting
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
