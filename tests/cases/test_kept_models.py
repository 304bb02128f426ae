"""Reduced models of large structures are kept between processes: the same bits, nothing that is stale or damaged."""

import errno
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse

from workflow import write_matrices
from workflow.cases import _kept_models, _structures, arrange, model_on, reduced, waited_for
from workflow.declare import File
from workflow.plan import plan_study
from workflow.reduction import ReducedModel
from workflow.solve import _tasks
from workflow.study import read_study

NODES = 310


def study(directory: Path, stiffness: float = 1e6, **axes: Any) -> dict[str, Any]:
    """Return a study of a file of 310 equal masses and springs in a line, the last of which touches."""
    links = sparse.eye_array(NODES) - sparse.eye_array(NODES, k=-1)
    contact, springs = np.eye(1, NODES, NODES - 1)[0], (stiffness * links.T @ links).tocsr()
    extra = {"stiffness_speed2": sparse.eye_array(NODES, format="csr")}
    write_matrices(
        directory / "line.npz", mass=sparse.eye_array(NODES, format="csr"), stiffness=springs, contact=contact, **extra
    )
    scene = {"matrices": {"file": str(directory / "line.npz")}, "casing": {"gap": 1e-3}, "duration": 0.01}
    axes = {"scheme": "event_driven", "mechanical_modes": 5, **axes}
    return {"study": "kept", "scene": scene, "axes": axes, "output": {"interval": 1e-3}}


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A directory of its own, and what is reduced, one entry for each time."""
    told: list[str] = []
    real = _structures.reduced_model

    def reduce(*of: Any) -> ReducedModel:
        told.append(of[3])
        return real(*of)

    (tmp_path / "kept").mkdir()
    monkeypatch.setattr(_structures, "reduced_model", reduce)
    monkeypatch.setattr(_kept_models, "directory_of", lambda module: tmp_path / "kept")
    model_on.cache_clear()
    return told


def model(source: dict[str, Any], **other: Any) -> ReducedModel:
    """Return the model of a study as another process would find it."""
    model_on.cache_clear()
    return model_on(replace(reduced(arrange(read_study(source)).settings(0)), **other))


def test_what_an_earlier_process_reduced_is_taken_to_the_bit(tmp_path: Path, made: list[str]) -> None:
    first, again = model(study(tmp_path)), model(study(tmp_path))
    assert len(made) == 1
    for of in ("displacement_basis", "displacement_projection"):
        assert np.array_equal(getattr(first.reduction, of), getattr(again.reduction, of)), of
    assert np.array_equal(first.structure.stiffness_matrix, again.structure.stiffness_matrix)
    elastic = model(study(tmp_path), casing_flexibility=1e-6)
    assert len(made) == 1
    assert elastic.structure.contacts.casing_flexibility == 1e-6


def test_other_inputs_are_other_models(tmp_path: Path, made: list[str]) -> None:
    model(study(tmp_path))
    for other in ({"mechanical_modes": 6}, {"stiffness": 2e6}, {"reduction": "rubin"}):
        count = len(made)
        model(study(tmp_path, **other))
        assert len(made) == count + 1
    parameters = reduced(arrange(read_study(study(tmp_path))).settings(0)).parameters
    file = parameters.file
    assert isinstance(file, File)
    shaken = replace(parameters, file=replace(file, shaken=1e-9))
    for _ in range(2):
        count = len(made)
        model(study(tmp_path), parameters=shaken)
        assert len(made) == count + 1


@pytest.mark.parametrize("change", ["cut", "changed", "gone", "no directory"])
def test_what_is_damaged_or_gone_is_made_again(
    change: str, tmp_path: Path, made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    model(study(tmp_path))
    (kept,) = (tmp_path / "kept").glob("*.model")
    content = bytearray(kept.read_bytes())
    if change == "cut":
        kept.write_bytes(content[: len(content) // 2])
    elif change == "changed":
        content[-40] ^= 1
        kept.write_bytes(content)
    elif change == "gone":
        kept.unlink()
    else:
        monkeypatch.setattr(_kept_models, "directory_of", lambda module: None)
    model(study(tmp_path))
    assert len(made) == 2
    model(study(tmp_path))
    assert len(made) == (3 if change == "no directory" else 2)


def test_a_full_disk_keeps_nothing(tmp_path: Path, made: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*of: Any) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    source = study(tmp_path)
    for count in (1, 2):
        assert model(source).structure.mechanical_size == 6
        assert len(made) == count
    assert list((tmp_path / "kept").iterdir()) == []


def test_the_models_used_longest_ago_go(tmp_path: Path, made: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    model(study(tmp_path))
    (first,) = (tmp_path / "kept").iterdir()
    monkeypatch.setattr(_kept_models, "MOST_BYTES", int(2.5 * first.stat().st_size))
    for stiffness in (2e6, 3e6, 4e6):
        model(study(tmp_path, stiffness))
        model(study(tmp_path))
    assert first.exists()
    assert len(list((tmp_path / "kept").iterdir())) == 2


def test_plan_says_how_many_structures_are_prepared_and_counts_their_time(
    tmp_path: Path, made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    real = _structures.reduced_model

    def reduce(*of: Any) -> ReducedModel:
        said.append(waited_for())
        return real(*of)

    monkeypatch.setattr(_structures, "reduced_model", reduce)
    source = study(tmp_path, **{"scene.speed": [0, 1, 2], "h": [1e-4, 1e-3]})
    assert plan_study(source).time == "seconds"
    assert said == [f"preparing 3 structures, {done} done" for done in (0, 1, 2)]
    assert len(made) == 3
    monkeypatch.setattr(_tasks, "_PREPARED", 10.0)  # 6 200 s each
    assert plan_study(study(tmp_path, **{"scene.speed": [0, 1, 2, 3]})).time == "hours"
