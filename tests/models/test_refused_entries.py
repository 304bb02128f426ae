"""Entries of files that are refused in words: damping that drives motion, labels, names of vectors, tables."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy

from scenes import cases, heavy_chain
from workflow import models
from workflow.declare import File
from workflow.models import (
    Sensor,
    UnusableMatricesError,
    free_reach,
    modes,
    sensors_of,
    structure_of,
    write_matrices,
)

SIZE = 3
LINKS = np.eye(SIZE) - np.eye(SIZE, k=-1)
PLAIN = {"mass": np.eye(SIZE), "stiffness": 1e6 * LINKS.T @ LINKS, "contact": np.eye(1, SIZE, SIZE - 1)[0]}


def given(directory: Path, **entries: Any) -> Any:
    place = directory / "blade.npz"
    np.savez(place, **PLAIN, **entries)
    return models.load("matrices").Parameters(file=File(str(np.random.default_rng().random()), "blade.npz", str(place)))


DRIVES = [
    -0.5 * np.eye(3),
    np.diag([1.0, 1.0, -1e-3]),
    np.diag([1.0, 0.0, 0.0]) + 0.1 * (np.eye(3, k=1) + np.eye(3, k=-1)),
]


@pytest.mark.parametrize("damping", [*DRIVES, np.array([[1.0, 1.05, 0], [1.05, 1.0, 0], [0, 0, 1.0]])])
def test_a_damping_matrix_that_drives_motion_is_refused(tmp_path: Path, damping: Any) -> None:
    with pytest.raises(UnusableMatricesError, match=r"`damping` is not positive semi-definite.*signs"):
        structure_of("matrices", given(tmp_path, damping=damping))
    with pytest.raises(UnusableMatricesError, match="`damping` is not positive semi-definite"):
        write_matrices(tmp_path / "own.npz", **PLAIN, damping=scipy.sparse.csr_array(damping))


@pytest.mark.parametrize(
    "damping",
    [np.zeros((3, 3)), np.diag([0.0, 2.0, 0.0]), np.ones((3, 3)), np.float32(1 / 3) * LINKS[1:].T @ LINKS[1:]],
)
def test_a_damping_matrix_may_leave_motions_undamped(tmp_path: Path, damping: Any) -> None:
    structure_of("matrices", given(tmp_path, damping=damping))


def test_nothing_bounds_motion_that_is_driven() -> None:
    """A model from outside may drive it: the harmonic answer is none then."""
    chain = heavy_chain()
    case = cases(chain, gap=1.0, mean=1.0)
    assert np.isfinite(free_reach(chain, case, 1.0)).all()
    driven = replace(chain, damping=models.Rayleigh(mass=-1e-3))
    assert np.isinf(free_reach(driven, case, 1.0)).all()


@pytest.mark.parametrize(
    ("labels", "problem"),
    [
        (np.array(["a", "a\0x", "b"]), r"`labels` has 'a\\x00x'"),
        (np.array(["\ud800", "mid", "tip"]), r"`labels` has '\\ud800'"),
        (np.array([b"a\xff", b"b", b"c"]), r"`blade.npz: labels` has a text that is not UTF-8: b'a\\xff'"),
    ],
)
def test_labels_that_no_archive_can_keep_are_refused(tmp_path: Path, labels: Any, problem: str) -> None:
    with pytest.raises(UnusableMatricesError, match=problem):
        structure_of("matrices", given(tmp_path, labels=labels))
    with pytest.raises(UnusableMatricesError, match="`labels` has"):
        write_matrices(tmp_path / "own.npz", **PLAIN, labels=labels)


def test_labels_of_bytes_are_utf_8(tmp_path: Path) -> None:
    parameters = given(tmp_path, labels=np.array(["µ1".encode(), b"b", b"c"]))
    sensors_of("matrices", parameters, (Sensor("µ1"),))


OF_ENTRIES = ("file", "allow_pickle", "stiffness", "steady", "load", "angle", "labels", "mass.shape", "mass_data")


@pytest.mark.parametrize("name", [*OF_ENTRIES, "a", "", "x\0"])
def test_a_vector_has_a_name_of_its_own(tmp_path: Path, name: str) -> None:
    with pytest.raises(UnusableMatricesError, match="is no name of a vector: choose one that is no entry and no label"):
        write_matrices(tmp_path / "own.npz", **PLAIN, labels=["a", "b", "c"], vectors={name: np.ones(SIZE)})
    assert not (tmp_path / "own.npz").exists()


def test_labels_that_are_numbers_are_written(tmp_path: Path) -> None:
    """Contacts that the file does not name are checked by any row, not by an index that is a label too."""
    heat = {"heat_capacity": np.eye(SIZE), "conductance": np.eye(SIZE)}
    rest = {name: value for name, value in PLAIN.items() if name != "contact"}
    path = write_matrices(tmp_path / "own.npz", **rest, **heat, labels=["2", "1", "0"], vectors={"a.b": np.ones(SIZE)})
    assert "a.b" in np.load(path)


def table(content: str | bytes, **more: Any) -> Any:
    """Return parameters of modes with a table of this content."""
    data = content.encode() if isinstance(content, str) else content
    file = File(str(np.random.default_rng().random()), "modes.csv", "modes.csv", {"modes.csv": data})
    return models.load("modes").Parameters(table=file, **more)


HEAD = "frequency,damping_ratio,tip"


@pytest.mark.parametrize("name", ["3", "SG-1", "1353.y"])
def test_a_column_of_a_sensor_may_look_like_a_number(name: str) -> None:
    """Also beside one whose name is nearly the same."""
    shown = []
    for column, at in ((name, int(name) if name.isdecimal() else name), ("gauge", "gauge")):
        parameters = table(f"{HEAD},{column},{column}0\n100,0.01,1,7,3\n200,0.01,1,9,3\n")
        shown.append(sensors_of("modes", parameters, (Sensor(at),)).displacement)
    np.testing.assert_array_equal(*shown)


def test_the_remedy_names_the_characters_of_columns() -> None:
    with pytest.raises(UnusableMatricesError, match="letters, digits, _, - and"):
        structure_of("modes", table(f"{HEAD},SG 1\n100,0.01,1,7\n"))


def test_residuals_have_a_row_for_each_contact() -> None:
    with pytest.raises(UnusableMatricesError, match="write 2 of 2, a row for each contact"):
        structure_of("modes", table("frequency,damping_ratio,tip_1,tip_2\n100,0.01,1,1\n", residual=((1e-9, 0.0),)))


def test_rows_are_counted_before_they_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(modes, "in_c", lambda *_: pytest.fail("the rows are parsed"))
    for end in ("\n", "\r", "\r\n"):
        with pytest.raises(UnusableMatricesError, match=r"`modes.csv` has 3001 lines: write 1 to 2000 rows"):
            structure_of("modes", table(end.join([HEAD, *["1"] * 3000, ""])))


def test_empty_rows_do_not_count() -> None:
    structure_of("modes", table(f"{HEAD}\n100,0.01,1\n" + ",,\n" * 5000))
