"""Structures that depend on the speed: K1 + Ω² K_Ω and f + Ω² r, of rods that spin, files and tables of modes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import eigh
from test_modes_model import tables

from matrix_files import as_output4, matrices_of
from workflow import models, reduction
from workflow.models import Chain, Matrices, Structure, UnusableMatricesError, mechanical_modes, write_matrices
from workflow.models._matrix_files import read_entries
from workflow.models.chain import Spin
from workflow.study import read_study

SPEED = 1500.0
SQUARE = (2 * np.pi * SPEED) ** 2

ROD: dict[str, Any] = {
    "nodes": 12,
    "mass": 2.0e-4,
    "stiffness": 2.0e7,
    "spacing": 2.5e-3,
    "expansion": 9e-6,
    "heat_capacity": 0.3,
    "conductance": 0.1,
    "convection": 0.02,
}


def rod(speed: float, radius: float | None = 0.25) -> Chain:
    model = models.load("chain")
    structure = model.assemble(
        model.Parameters(**ROD, spin=None if radius is None else Spin(radius), speed=speed),
    )
    return structure


REST = rod(0.0)
LOAD = REST.masses * (0.25 + np.cumsum(REST.lengths))


def entries(**more: Any) -> dict[str, Any]:
    """The rod at rest as a file of matrices, with what its speed adds."""
    speed = {"stiffness_speed2": -REST.mass, "load_speed2": LOAD}
    return {**matrices_of(REST), "contact": 11, "thermal_contact": 11, **speed, **more}


def from_file(path: Path, speed: float, **parameters: Any) -> Structure:
    model = models.load("matrices")
    file = read_study({"study": "s", "scene": {"matrices": {"file": str(path), **parameters}, "casing": {"gap": 1.0},
                                               "duration": 1.0}}).scene.parameters  # fmt: skip
    return model.assemble(models.at_speed("matrices", file, speed))


def zero(structure: Structure) -> models.Cases:
    mechanical, thermal = structure.input_sizes
    one, x, heat = np.zeros(1), np.zeros((1, mechanical)), np.zeros((1, thermal))
    return structure.received(models.Cases(one, one, one[:, None] + 1.0, one, x, heat, x, x, heat))


def test_rod_has_the_frequencies_and_forces_of_its_matrices() -> None:
    turning, stiffness = rod(SPEED), REST.stiffness_matrix - SQUARE * REST.mass
    squares = eigh(stiffness, REST.mass, eigvals_only=True)
    np.testing.assert_allclose(models.frequencies(turning), np.sqrt(squares), rtol=1e-11)
    at_rest = models.frequencies(REST)
    np.testing.assert_allclose(models.frequencies(turning)[0], np.sqrt(at_rest[0] ** 2 - SQUARE), rtol=1e-12)
    np.testing.assert_allclose(turning.stiffness_matrix, stiffness, atol=1e-14 * stiffness.max())
    np.testing.assert_allclose(turning.coupling_matrix, REST.coupling_matrix, atol=1e-14 * REST.coupling_matrix.max())
    held = eigh(stiffness[:-1, :-1], REST.mass[:-1, :-1], eigvals_only=True)
    np.testing.assert_allclose(turning.mechanical.modes(held=True).values, held, rtol=1e-11)
    np.testing.assert_allclose(turning.mechanical.tip_stiffness, 1 / np.linalg.inv(stiffness)[-1, -1], rtol=1e-12)
    np.testing.assert_allclose(turning.mechanical.solve(LOAD), np.linalg.solve(stiffness, LOAD), rtol=1e-11)
    growth = np.linalg.solve(stiffness, -REST.coupling_matrix)[-1]
    np.testing.assert_allclose(models.static_growth(turning)[0], growth, rtol=1e-11)


def test_static_growth_is_the_square_of_the_speed(tmp_path: Path) -> None:
    given = entries()
    del given["stiffness_speed2"]
    path = write_matrices(tmp_path / "rod.npz", **given)
    grown = []
    for speed in (10.0, 40.0, 1500.0):
        structure = from_file(path, speed)
        start = models.at_rest(structure, zero(structure))
        grown.append(start.displacement[0, -1] / speed**2)
    np.testing.assert_allclose(grown, grown[0], rtol=1e-12)
    turning = rod(SPEED)
    start = models.at_rest(turning, zero(turning)).displacement[0]
    closed = np.linalg.solve(REST.stiffness_matrix - SQUARE * REST.mass, SQUARE * LOAD)
    np.testing.assert_allclose(start, closed, rtol=1e-11)


@pytest.mark.parametrize("basis", [name for name in reduction.names() if reduction.fault(name) is None])
def test_bases_of_the_rod_and_of_its_file_are_the_same(tmp_path: Path, basis: str) -> None:
    same = from_file(write_matrices(tmp_path / "rod.npz", **entries()), SPEED)
    plain = entries(stiffness=REST.stiffness_matrix - SQUARE * REST.mass)
    del plain["stiffness_speed2"], plain["load_speed2"]
    straight = from_file(write_matrices(tmp_path / "plain.npz", **plain), 0.0)
    frequencies = [
        models.frequencies(reduction.reduce_structure(structure, 3, 4, basis, 0.1).structure)
        for structure in (rod(SPEED), same, straight)
    ]
    np.testing.assert_allclose(frequencies[0], frequencies[1], rtol=1e-9)
    assert frequencies[1].tobytes() == frequencies[2].tobytes()


@pytest.mark.parametrize(("size", "count"), [(400, 1), (6, 2)])
def test_a_file_at_a_speed_is_the_file_of_its_sums(tmp_path: Path, size: int, count: int) -> None:
    ones = np.ones(size)
    stiffness = sparse.diags_array([2e7 * ones, -1e7 * ones[1:], -1e7 * ones[1:]], offsets=[0, 1, -1], format="csr")
    mass, turns = sparse.diags_array(1e-3 * ones, format="csr"), sparse.diags_array(-1e-3 * ones, format="csr")
    contact = np.zeros((count, size))
    contact[:, -1 - np.arange(count)] = np.eye(count)
    more = {"mass": mass, "contact": contact}
    speed = 0.5 * float(np.sqrt(np.linalg.eigvalsh(stiffness.toarray())[0] / 1e-3)) / (2 * np.pi)
    square = (2 * np.pi * speed) ** 2
    path = write_matrices(tmp_path / "a.npz", stiffness=stiffness, stiffness_speed2=turns, load_speed2=ones, **more)
    other = write_matrices(tmp_path / "b.npz", stiffness=stiffness + square * turns, steady=square * ones, **more)
    turning, plain = from_file(path, speed), from_file(other, 0.0)
    assert turning.is_sparse == (size > 300)
    assert zero(turning).steady.tobytes() == zero(plain).steady.tobytes()
    reduced = [reduction.reduce_structure(one, min(5, size - count), 0).structure for one in (turning, plain)]
    for name in ("stiffness_matrix", "mass", "damping_matrix"):
        assert getattr(reduced[0], name).tobytes() == getattr(reduced[1], name).tobytes()
    for times in (2.5, 40):
        with pytest.raises(UnusableMatricesError, match=r"at .* rev/s .* is not positive"):
            from_file(path, times * speed)


def test_a_table_of_modes_is_the_same_structure(tmp_path: Path) -> None:
    modes, heat, coupling = tables(REST)
    added = {"stiffness_speed2": -np.eye(12), "load_speed2": (mechanical_modes(REST).shapes.T @ LOAD)[:, None]}
    given = {"table": modes, "heat": heat, "coupling": coupling, **added}
    table = {name: rows.tolist() for name, rows in given.items()}
    study = read_study({"study": "s", "scene": {"modes": table, "casing": {"gap": 1.0}, "duration": 1.0}})
    turning = models.structure_of("modes", models.at_speed("modes", study.scene.parameters, SPEED))
    assert isinstance(turning, Matrices)
    ours = rod(SPEED)
    np.testing.assert_allclose(models.frequencies(turning), models.frequencies(ours), rtol=1e-11)
    np.testing.assert_allclose(models.critical_alpha(turning), models.critical_alpha(ours), rtol=1e-10)
    grown = [models.at_rest(one, zero(one)).displacement[0, -1] for one in (turning, ours)]
    np.testing.assert_allclose(grown[0], grown[1], rtol=1e-11)


def test_above_its_first_frequency_a_rod_is_refused() -> None:
    critical = models.frequencies(REST)[0] / (2 * np.pi)
    assert rod(0.999 * critical).mechanical.tip_stiffness > 0
    for speed in (1.001, 3.0, 50.0):
        with pytest.raises(UnusableMatricesError, match=f"stay below {critical:.6g} rev/s"):
            rod(speed * critical)


def test_units_and_short_names(tmp_path: Path) -> None:
    in_mm = {"mass": 1e-3, "stiffness": 1e-3, "stiffness_speed2": 1e-3}
    scaled = {name: value * in_mm.get(name, 1.0) for name, value in entries().items() if "heat" not in name}
    for name in ("conductance", "coupling", "thermal_contact"):
        del scaled[name]
    path = write_matrices(tmp_path / "mm.npz", **scaled)
    structure = from_file(path, SPEED, units="mm-t-s")
    np.testing.assert_allclose(models.frequencies(structure), models.frequencies(rod(SPEED)), rtol=1e-10)
    np.testing.assert_allclose(zero(structure).steady.sum(), SQUARE * LOAD.sum(), rtol=1e-12)
    short = {"stiffness_speed2": "s_speed2", "load_speed2": "l_speed2"}
    given = {short.get(name, name): np.atleast_2d(value) for name, value in entries().items() if "contact" not in name}
    read = read_entries(as_output4(given, tmp_path))
    assert set(read) == {name for name in entries() if "contact" not in name}
