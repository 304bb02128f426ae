"""What a study may ask of the structure in a file: labels as they are spelled, lists as long as it is, modes it has."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array, eye_array

from studies import refusal
from workflow import models, write_matrices
from workflow.cases import arrange
from workflow.plan._template import template
from workflow.study import Study, StudyError, read_study, resolved_values
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


def study_of(place: Path, **axes: Any) -> dict[str, Any]:
    scene = {"matrices": {"file": str(place)}, "casing": {"gap": 1e-5}, "duration": 0.1}
    return {"study": "sizes", "scene": scene, "axes": {"h": 1e-4, **axes}}


def mode_counts(study: Study) -> dict[str, Any]:
    values = {axis.path: axis.values[0] for axis in study.scalars}
    return {kind: values[f"{kind}_modes"] for kind in ("mechanical", "thermal")}


def in_file(place: Path, nodes: int, temperatures: int) -> Path:
    """A chain of some nodes, and another one of temperatures that moves nothing."""

    def line(size: int) -> csr_array:
        return csr_array(diags_array([np.full(size, 2.0), *[np.full(size - 1, -1.0)] * 2], offsets=[0, -1, 1]))

    write_matrices(
        place,
        mass=eye_array(nodes, format="csr"),
        stiffness=line(nodes),
        heat_capacity=eye_array(temperatures, format="csr"),
        conductance=line(temperatures),
        contact=nodes - 1,
        thermal_contact=temperatures - 1,
    )
    return place


def test_lists_are_as_long_as_the_file_has_displacements_or_temperatures(tmp_path: Path) -> None:
    place, dense = in_file(tmp_path / "unequal.npz", 7, 4), np.diag([1.0, 1.0, 0.0])
    np.savez(tmp_path / "condensed.npz", mass=dense, stiffness=np.eye(3), contact=0)
    for file, displacements, temperatures in ((place, 7, 4), (tmp_path / "condensed.npz", 3, 1)):
        study = study_of(file)
        loads, start = {"steady": [1.0] * displacements}, {"temperature": [1.0] * temperatures}
        read_study(study | {"scene": study["scene"] | {"load": loads, "initial": start}})
        for part, said in (
            ({"load": {"steady": [1.0] * 2}}, f"has 2 values where the model has {displacements} nodes"),
            ({"initial": {"temperature": [1.0] * 9}}, f"has 9 values where the model has {temperatures} temperatures"),
        ):
            assert said in refusal(read_study, study | {"scene": study["scene"] | part})


def test_a_start_inside_the_casing_is_that_of_the_contact_of_the_file(tmp_path: Path) -> None:
    matrix = np.eye(3)
    for contact, inside, outside in (
        ([1, 0, 0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0]),
        ([0, 0.5, 0.5], [0.0, 2.0, 1.0], [2.0, -2.0, 2.0]),
        ([0, 0, -1], -2.0, 2.0),
    ):
        np.savez(tmp_path / "turned.npz", mass=matrix, stiffness=matrix, contact=np.array(contact, dtype=float))
        scene = study_of(tmp_path / "turned.npz")["scene"]
        study = {"study": "turned", "axes": {"h": 1e-3}}
        read_study(study | {"scene": scene | {"initial": {"displacement": outside}}})
        start = {"initial": {"displacement": inside}}
        assert "the tip starts inside the casing" in refusal(read_study, study | {"scene": scene | start})


def test_full_is_every_mode_of_its_own_kind(tmp_path: Path) -> None:
    assert mode_counts(read_study(study_of(in_file(tmp_path / "unequal.npz", 7, 4)))) == {"mechanical": 6, "thermal": 3}
    four = study_of(tmp_path / "unequal.npz", mechanical_modes=4, thermal_modes=4)
    assert "`4` is more than the 3 interior modes" in refusal(read_study, four)


@pytest.mark.parametrize("count", ["full", 301])
def test_too_much_of_a_large_structure_is_refused_with_what_would_do(tmp_path: Path, count: int | str) -> None:
    place = in_file(tmp_path / "large.npz", 2001, 5)
    said = refusal(read_study, study_of(place, mechanical_modes=count))
    assert "write at most 300, or `auto` with a `tolerance`" in said
    assert mode_counts(read_study(study_of(place, mechanical_modes=300))) == {"mechanical": 300, "thermal": 4}
