"""What a study may keep of structures of many degrees of freedom, and of unequal numbers of both kinds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array, eye_array

from studies import refusal
from workflow import write_matrices
from workflow.study import Study, read_study


def study_of(place: Path, **axes: Any) -> dict[str, Any]:
    scene = {"matrices": {"file": str(place)}, "casing": {"gap": 1e-5}, "duration": 0.1}
    return {"study": "sizes", "scene": scene, "axes": {"h": 1e-4, **axes}}


def mode_counts(study: Study) -> dict[str, Any]:
    values = {axis.path: axis.values[0] for axis in study.scalars}
    return {kind: values[f"{kind}_modes"] for kind in ("mechanical", "thermal")}


def written(place: Path, nodes: int, temperatures: int) -> Path:
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
    place, dense = written(tmp_path / "unequal.npz", 7, 4), np.diag([1.0, 1.0, 0.0])
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
    assert mode_counts(read_study(study_of(written(tmp_path / "unequal.npz", 7, 4)))) == {"mechanical": 6, "thermal": 3}
    four = study_of(tmp_path / "unequal.npz", mechanical_modes=4, thermal_modes=4)
    assert "`4` is more than the 3 interior modes" in refusal(read_study, four)


@pytest.mark.parametrize("count", ["full", 301])
def test_too_much_of_a_large_structure_is_refused_with_what_would_do(tmp_path: Path, count: int | str) -> None:
    place = written(tmp_path / "large.npz", 2001, 5)
    said = refusal(read_study, study_of(place, mechanical_modes=count))
    assert "write at most 300, or `auto` with a `tolerance`" in said
    assert mode_counts(read_study(study_of(place, mechanical_modes=300))) == {"mechanical": 300, "thermal": 4}
