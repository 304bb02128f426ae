"""Rows of sensors: from labels, indices and vectors of files, columns of tables, nodes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from workflow import models
from workflow.declare import File
from workflow.models import Sensor, UnusableMatricesError, sensors_of

SIZE = 4


def entries() -> dict[str, Any]:
    """Return matrices of four displacements, one of them without mass, and three temperatures."""
    links = np.eye(SIZE) - np.eye(SIZE, k=-1)
    return {
        "mass": np.diag([1.0, 2.0, 0.0, 1.0]),
        "stiffness": 1e3 * links.T @ links,
        "heat_capacity": np.eye(3),
        "conductance": np.diag([1.0, 2.0, 3.0]),
        "labels": np.array(["1.x", "2.x", "3.x", "4.x"]),
        "thermal_labels": np.array(["a", "b", "c"]),
        "contact": np.array("4.x"),
        "thermal_contact": np.array("c"),
        "strain": np.array([-1.0, 1.0, 0.0, 0.0]),
        "mean": np.array([0.5, 0.5, 0.0]),
        "both": np.eye(2, SIZE),
    }


@pytest.fixture
def parameters(tmp_path: Path) -> Any:
    place = tmp_path / "blade.npz"
    np.savez(place, **entries())
    return models.load("matrices").Parameters(file=File(str(place), "blade.npz", str(place)))


def test_rows_of_a_file(parameters: Any) -> None:
    sensors = (
        Sensor("2.x"),
        Sensor(0),
        Sensor("strain"),
        Sensor("4.x"),
        Sensor("b", of_heat=True),
        Sensor(2, of_heat=True),
        Sensor("mean", of_heat=True),
    )
    rows = sensors_of("matrices", parameters, sensors)
    structure = models.structure_of("matrices", parameters)
    given = np.random.default_rng(1).normal(size=(5, SIZE))
    given[:, 2] = 0.5 * (given[:, 1] + given[:, 3])  # it follows
    warm = np.random.default_rng(2).normal(size=(5, 3))
    onto = structure.coordinates
    shown = rows.of(given @ onto.displacement_projection.T, warm @ onto.temperature_projection.T)
    x, t = given.T, warm.T
    np.testing.assert_allclose(shown.T, [x[1], x[0], x[1] - x[0], x[3], t[1], t[2], (t[0] + t[1]) / 2], atol=1e-13)


@pytest.mark.parametrize(
    ("sensor", "problem", "remedy"),
    [
        (Sensor("5.x"), "`sensor: 5.x` is neither a label nor a vector of the file", "an index from 0 to 3"),
        (Sensor(4), "`sensor: 4` is no index", "from 0 to 3"),
        (Sensor(-1), "`sensor: -1` is no index", "from 0 to 3"),
        (Sensor("both"), "`both` has 2 rows", "choose a vector"),
        (Sensor("3.x"), "`3.x` is held or has no mass", "choose a displacement that has mass"),
        (Sensor("d", of_heat=True), "`sensor: d` is neither", "`a`"),
        (Sensor("mean"), "`mean` has the shape (3,)", "must have 4 entries"),
    ],
)
def test_what_a_file_does_not_have_is_told(parameters: Any, sensor: Sensor, problem: str, remedy: str) -> None:
    with pytest.raises(UnusableMatricesError) as raised:
        sensors_of("matrices", parameters, (sensor,))
    assert problem in raised.value.problem
    assert remedy in raised.value.remedy


def test_nodes_count_from_the_root() -> None:
    parameters = models.load("chain").Parameters(3, mass=1.0, stiffness=1.0, heat_capacity=1.0)
    rows = sensors_of("chain", parameters, (Sensor(1), Sensor(3, of_heat=True)))
    assert rows.displacement.tolist() == [[1, 0, 0], [0, 0, 0]]
    assert rows.temperature.tolist() == [[0, 0, 0], [0, 0, 1]]
    for at in (0, 4, "tip"):
        with pytest.raises(UnusableMatricesError) as raised:
            sensors_of("chain", parameters, (Sensor(at),))
        assert "1 to 3" in raised.value.remedy


def table(directory: Path, head: str, rows: list[str]) -> File:
    place = directory / f"{len(head)}.csv"
    place.write_text("\n".join([head, *rows]), encoding="utf-8")
    return File(str(place), place.name, str(place))


def test_columns_of_tables_of_modes(tmp_path: Path) -> None:
    modes = table(tmp_path, "edge [1/√kg],frequency,damping_ratio,tip", ["0.5,10,0.01,2", "-1.5,30,0.01,1"])
    heat = table(tmp_path, "rate,tip,root", ["1,2,0.25", "5,1,-1"])
    parameters = models.load("modes").Parameters(modes, heat)
    rows = sensors_of("modes", parameters, (Sensor("edge"), Sensor("tip"), Sensor("root", of_heat=True)))
    structure = models.structure_of("modes", parameters)
    eta, tau = np.random.default_rng(1).normal(size=(2, 5, 2))
    onto = structure.coordinates
    shown = rows.of(eta @ onto.displacement_projection.T, tau @ onto.temperature_projection.T)
    expected = [eta @ [0.5, -1.5], eta @ [2, 1], tau @ [0.25, -1]]
    np.testing.assert_allclose(shown.T, expected, atol=1e-14)
    with pytest.raises(UnusableMatricesError, match="`rim` is no column of `table`: write edge or tip"):
        sensors_of("modes", parameters, (Sensor("rim"),))
    misspelt = models.load("modes").Parameters(table(tmp_path, "tangnet,frequency,damping_ratio,tip", ["1,1,0,1"]))
    with pytest.raises(UnusableMatricesError, match="has the columns"):
        models.structure_of("modes", misspelt)
