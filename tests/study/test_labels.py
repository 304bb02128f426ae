"""Labels that look like numbers: looked up as they are spelled, in files, settings and texts of studies."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studies import refusal
from workflow import models
from workflow.cases import arrange
from workflow.plan._template import template
from workflow.study import StudyError, read_study, resolved_values
from workflow.study.source import compose, plain_tree, replaced, setting, text_of

STUDY = """study: labels
scene:
  matrices: {file: blade.npz, contact: CONTACT}
  casing: {gap: 10 um}
  duration: 0.02
axes: {scheme: event_driven}
"""


def stiffnesses(size: int) -> Any:
    """Return 1/S of each displacement of a row of springs in line, N/m: 1e6/k of the k-th."""
    return 1e6 / np.arange(1, size + 1)


def write(directory: Path, labels: list[str], **more: Any) -> str:
    size = len(labels)
    links = np.eye(size) - np.eye(size, k=-1)
    np.savez(directory / "blade.npz", mass=np.eye(size), stiffness=1e6 * links.T @ links, labels=labels, **more)
    return str(directory / "labels.yaml")


def chosen(path: str, contact: str, settings: dict[str, Any] | None = None) -> float:
    """Return the tip stiffness at the contact that a study chooses, N/m."""
    Path(path).write_text(STUDY.replace("CONTACT", contact))
    study = read_study(path, settings)
    again = study.text.replace("blade.npz", str(Path(path).parent / "blade.npz"))  # its own text says so too
    both = [models.structure_of("matrices", one.scene.parameters) for one in (study, read_study(again))]
    first, second = (1 / float(models.statics(one)[0].max()) for one in both)
    assert first == second
    return first


FRACTIONS = ["3.1", "3.2", "3.10", "1e3", ".5", "+4"]


@pytest.mark.parametrize("label", FRACTIONS)
def test_a_scalar_is_looked_up_as_it_is_spelled(tmp_path: Path, label: str) -> None:
    path = write(tmp_path, FRACTIONS)
    right = pytest.approx(stiffnesses(6)[FRACTIONS.index(label)])
    assert chosen(path, label) == right
    assert chosen(path, f'"{label}"') == right
    assert chosen(path, "3.2", dict([setting(f"scene.matrices.contact={label}")])) == right


def test_leading_zeros_make_a_label_and_no_index(tmp_path: Path) -> None:
    path = write(tmp_path, ["007", "008", "1", "4"])
    assert chosen(path, "007") == pytest.approx(1e6)
    assert chosen(path, "0") == pytest.approx(1e6)
    with pytest.raises(StudyError, match=r"`contact: 001` is no index; write .*`007`.* or an index from 0 to 3"):
        chosen(path, "001")


def test_an_integer_that_is_a_label_and_another_index_is_refused_with_both_readings(tmp_path: Path) -> None:
    path = write(tmp_path, ["1", "3", "2", "104"])
    assert chosen(path, "2") == pytest.approx(1e6 / 3)  # label and index of one place
    assert chosen(path, "104") == pytest.approx(1e6 / 4)  # no index
    assert chosen(path, "0") == pytest.approx(1e6)  # no label
    for settings in (None, {"scene.matrices.contact": 1}):
        with pytest.raises(
            StudyError, match=r'`contact: 1` is the label .* write `"1"` in quotes .*, `"3"` for the index'
        ):
            chosen(path, "1", settings)


def test_contacts_and_sensors_called_by_numbers(tmp_path: Path) -> None:
    rows = np.eye(6)[[4, 5]]
    path = write(tmp_path, list("abcdef"), contact=rows, contact_labels=["1", "30"], load=np.ones(6))
    for contact, called in (('["1", 30]', ("1", "30")), ("[4, 5]", ("4", "5"))):
        Path(path).write_text(STUDY.replace("CONTACT", contact))
        assert read_study(path).contacts == called
    Path(path).write_text(STUDY.replace("CONTACT", "[1, 30]"))
    assert "`contact: 1` is the label of one place" in refusal(read_study, path)
    Path(path).write_text(STUDY.replace("CONTACT", '["1", "30"]') + "output: {sensors: {s: 1}}\n")
    assert "`sensor: 1` is the label of one place" in refusal(read_study, path)


def test_what_is_wrong_with_heat_or_a_label_is_said_of_its_own_entry(tmp_path: Path) -> None:
    tip, study = np.eye(3)[-1], str(tmp_path / "labels.yaml")
    heat = {"conductance": np.eye(3), "thermal_contact": tip, "coupling": np.zeros((3, 3))}

    def said(contact: str, **more: Any) -> str:
        write(tmp_path, ["root.x", "middle.x", "tip.x"], **{"contact": tip, **more})
        Path(study).write_text(STUDY.replace(", contact: CONTACT", contact))
        return refusal(read_study, study, {} if more else {"axes.thermal_modes": 1})

    assert "has no temperature beside the tip's; write 0 or `full`" in said("")
    bare, whole = heat | {"heat_capacity": np.diag([1.0, 1, 0])}, heat | {"heat_capacity": np.eye(3)}
    assert "the contact heats a temperature without heat capacity" in said("", **bare)
    wrong = said(", contact: tipp.x", **whole)
    assert "write `contact`, `tip.x`" in wrong
    assert "`thermal_contact`" not in wrong
    assert "`contact`" not in said(", thermal_contact: tipp.x", **whole).partition("write")[2]


def test_a_plan_names_the_label_at_an_index(tmp_path: Path) -> None:
    path = write(tmp_path, ["root", "mid", "tip"])
    Path(path).write_text(STUDY.replace("CONTACT", "2") + "output: {sensors: {s: 1, t: tip}}\n")
    study = read_study(path)
    texts = {one.path: one.text for one in resolved_values(study, arrange(study).settings(0))}
    assert texts["scene.matrices.contact"] == "2 (label `tip`)"
    assert texts["output.sensors"] == "s: 1 (label `mid`), t: tip"


WRITTEN = "a: {x: 007, y: 3.10} # kept\nb: &b {k: 1e3}\nc: [.5, 0x10, 2.50e+3, '7']\n"


def test_settings_keep_spellings_and_comments() -> None:
    source = replaced(compose(WRITTEN, "f"), dict([setting("a.x=008"), setting('a.z=[1.50, 2, "3.0"]')]))
    assert "# kept" in source.text
    assert repr(compose(source.text, "f").tree) == repr(source.tree)
    assert repr(source.tree["a"]) == "{'x': 008, 'y': 3.10, 'z': [1.50, 2, '3.0']}"


def test_a_text_that_cannot_be_kept_keeps_spellings() -> None:
    source = replaced(compose(WRITTEN + "d: *b\n", "f"), dict([setting("b.k=2e3")]))
    assert source.text.startswith("{")
    tree = compose(source.text, "f").tree
    assert (repr(tree["a"]), repr(tree["b"]), repr(tree["d"])) == ("{'x': 007, 'y': 3.10}", "{'k': 2e3}", "{'k': 1e3}")
    assert (tree["a"]["x"], tree["d"]["k"]) == (7, 1000.0)


def test_texts_of_other_loaders_keep_their_spelling() -> None:
    """PyYAML reads 1e3 as a text, which is a number here, and may be a label."""
    assert (
        repr(compose(text_of(plain_tree({"a": {"b": "1e3", "c": "007"}})), "f").tree) == "{'a': {'b': 1e3, 'c': '007'}}"
    )


def test_an_axis_of_contacts_is_no_dimension_of_contacts(tmp_path: Path) -> None:
    """Labels and indices are texts of one coordinate; a result has its dimension once."""
    path = write(tmp_path, ["007", "a", "b"])
    Path(path).write_text(STUDY.replace(", contact: CONTACT", ""))
    archive = template(arrange(read_study(path, {"axes.scene.matrices.contact": ["007", 2, "a"]})))
    assert archive["matrices_contact"].values.tolist() == ["007", "2", "a"]
    assert archive["impacts"].dims == ("matrices_contact",)
