"""The gap of one of several contacts, by its label: in axes, zips, drawn numbers, settings, and in an archive."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes_of_contacts import SCENE, chain, study

from workflow.analysis import casing_motion, period_frequency
from workflow.archive import open_archive
from workflow.cases import arrange, case_hashes, full_structure
from workflow.cases._conditions import conditions
from workflow.run import run_study
from workflow.study import Study, StudyError, parse_study, read_study

END = "scene.casing.gap.end"
USUAL = {"scheme": "moreau", "alpha": 10, "e": 0.2}


def read(place: Path, axes: dict[str, Any], casing: dict[str, Any] | None = None, **more: Any) -> Study:
    scene = {"casing": SCENE["casing"] | (casing or {})}
    return read_study(study(place, axes=USUAL | axes, scene=scene, **more))


def hashes(study: Study) -> list[bytes]:
    return [row.tobytes() for row in case_hashes(arrange(study))]


def gaps(study: Study) -> Any:
    grid = arrange(study)
    settings, inner = grid.settings(0), np.arange(grid.inner_count)
    return conditions(settings, full_structure(settings), grid.inner_values(inner), inner.size).gaps


def test_it_varies_one_gap_and_makes_the_cases_that_a_list_makes(tmp_path: Path) -> None:
    varied = read(tmp_path, {END: [5.5e-5, 7e-5], "scene.casing.clearance": [0, 1e-6]})
    assert gaps(varied).tolist() == [
        [3e-5 + clearance, gap + clearance] for clearance in (0, 1e-6) for gap in (5.5e-5, 7e-5)
    ]
    listed = [
        hashes(read(tmp_path, {}, {"gap": [3e-5, gap], "clearance": c})) for c in (0, 1e-6) for gap in (5.5e-5, 7e-5)
    ]
    assert hashes(varied) == [one for [one] in listed]
    of_all = read(tmp_path, {END: 7e-5}, {"gap": 3e-5})  # one number for all the others
    assert gaps(of_all).tolist() == [[3e-5, 7e-5]]
    assert hashes(of_all) == listed[1]


def test_zips_and_drawn_numbers_have_it(tmp_path: Path) -> None:
    both = read(tmp_path, {}, zip={"gaps": {END: [6e-5, 7e-5], "scene.casing.gap.mid": [1e-5, 2e-5]}})
    assert gaps(both).tolist() == [[1e-5, 6e-5], [2e-5, 7e-5]]
    drawn = {"sample": "random", "points": 3, "of": {END: ["50 um", "60 um"], "scene.casing.gap.mid": [1e-5, 2e-5]}}
    design = read(tmp_path, {}, zip={"design": drawn})
    values = {axis.name: axis.values for axis in design.dimensions[0].axes}
    assert gaps(design).tolist() == [list(row) for row in zip(values["gap_mid"], values["gap_end"], strict=True)]


def test_a_setting_gives_it_once_and_again(tmp_path: Path) -> None:
    plain = read(tmp_path, {})
    once = plain.with_({END: "60 um"})
    assert gaps(once).tolist() == [[3e-5, 6e-5]]
    assert gaps(parse_study(once.text, once.file)).tolist() == [[3e-5, 6e-5]]
    assert gaps(once.with_({END: "50 um"})).tolist() == [[3e-5, 5e-5]]
    with pytest.raises(StudyError, match=f"has no effect, as axes.{END} varies this value"):
        plain.with_({f"axes.{END}": [6e-5, 7e-5]}).with_({END: 6e-5})


@pytest.mark.parametrize(
    ("axes", "casing", "message"),
    [
        ({"scene.casing.gap.ned": [1e-5, 2e-5]}, {}, r"gap.ned: `ned` is no contact of several; did you mean `end`"),
        ({END: [1e-5], "scene.casing.gap": [1e-5]}, {}, "gap.end: stands beside `scene.casing.gap`; vary"),
        ({END: ["1 K"]}, {}, r"gap.end\[0\]: `1 K` is not a length"),
        ({END: [-1e-5, 1e-5]}, {}, "gap.end: contact `end` starts inside the casing, at 0.0 m with a gap of -1e-05 m"),
        ({END: {"sweep": [1e-5, 2e-5, 3]}}, {}, "gap.end: cannot be swept"),
    ],
)
def test_what_is_no_gap_of_a_contact_is_refused(
    tmp_path: Path, axes: dict[str, Any], casing: dict[str, Any], message: str
) -> None:
    with pytest.raises(StudyError, match=message):
        read(tmp_path, axes, casing)


@pytest.mark.parametrize("zipped", [False, True])
def test_gaps_of_contacts_that_would_have_one_name_are_refused(tmp_path: Path, zipped: bool) -> None:
    alike = {f"scene.casing.gap.{label}": [6e-5, 7e-5] for label in ("a b", "a_b")}
    sections = {"axes": USUAL, "zip": {"gaps": alike}} if zipped else {"axes": USUAL | alike}
    labelled = {**chain(), "contact_labels": np.array(["a b", "a_b"])}
    message = "gap.a_b: would be `scene_casing_gap_a_b` in the archive, and so would `scene.casing.gap.a b`; give the"
    with pytest.raises(StudyError, match=message):
        read_study(study(tmp_path, labelled, **sections))


def test_it_stands_for_no_gap_of_the_others_and_for_none_of_one_contact(tmp_path: Path) -> None:
    lone = {name: rows[-1] for name, rows in chain().items() if name in ("contact", "thermal_contact")}
    one = study(
        tmp_path, {**chain(), **lone, "contact_labels": np.array(["end"]), "angle": 0.0}, axes=USUAL | {END: [1e-5]}
    )
    one["scene"]["casing"] = {"gap": 1e-5}
    with pytest.raises(StudyError, match=r"`end` is no contact of several; write `scene.casing.gap`: there is one"):
        read_study(one)
    several = study(tmp_path, axes=USUAL | {END: [1e-5]})
    several["scene"]["casing"] = {}
    with pytest.raises(StudyError, match=r"scene.casing.gap: is missing") as refused:
        read_study(several)
    assert len(refused.value.mistakes) == 1


def test_opposite_stops_are_kept_apart_by_either_gap(tmp_path: Path) -> None:
    entries = chain(heated=False)
    entries |= {"contact": np.outer([1.0, -1.0], np.eye(5)[4]), "contact_labels": np.array(["up", "down"])}
    scene = {"casing": {"gap": [1e-5, -2e-5], "harmonics": []}, "initial": "static"}
    given = study(tmp_path, entries, axes={"scheme": "moreau", "scene.casing.gap.down": [1e-5, -2e-5]}, scene=scene)
    with pytest.raises(StudyError, match=r"gap.down: contacts `up` and `down` are opposite stops -1e-05 m apart"):
        read_study(given)


def test_an_archive_has_it_in_metres_and_each_gap_along_it(tmp_path: Path) -> None:
    given = read(tmp_path, {END: [5.5e-5, 7e-5]})
    run_study(given, tmp_path / "a.nc", threads=1)
    with open_archive(tmp_path / "a.nc") as opened:
        archive = opened.load()
    assert archive["gap_end"].attrs["units"] == "m"
    assert archive["gap_end"].attrs["study_path"] == END
    assert archive["gap"].dims == ("gap_end", "contact")
    assert archive["gap"].values.tolist() == [[3e-5, 5.5e-5], [3e-5, 7e-5]]
    case = archive.sel(gap_end=7e-5, contact="end").squeeze()
    turn = 2 * np.pi * 120 * case["t"].values + 0.2 + 3 * 1.3
    np.testing.assert_allclose(casing_motion(case)[0], 7e-5 + 5e-6 * np.sin(turn), rtol=1e-12)
    assert period_frequency(case, given.resolved()["scene"]) == 65.0


def test_labels_are_written_as_names_of_coordinates(tmp_path: Path) -> None:
    named = chain() | {"contact_labels": np.array(["1.5", "tip / end"])}
    axes = {"scene.casing.gap.1.5": [3e-5, 4e-5], "scene.casing.gap.tip / end": [5e-5, 6e-5]}
    given = read_study(study(tmp_path, named, axes=USUAL | axes))
    assert [dimension.name for dimension in given.dimensions] == ["gap_1_5", "gap_tip___end"]
    assert gaps(given).tolist() == [[a, b] for a in (3e-5, 4e-5) for b in (5e-5, 6e-5)]
