"""Identity of a case: all that its results depend on; reduced models that are kept between processes, never stale."""

import errno
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from quick import hashes_of, quick
from workflow import write_matrices
from workflow.cases import _identity, _kept_models, _structures, arrange, model_on, reduced, waited_for
from workflow.declare import File
from workflow.plan import plan_study
from workflow.reduction import ReducedModel
from workflow.solve import _tasks
from workflow.study import read_study

ONE = {"h": 1e-4, "e": 0.5, "alpha": 5.0}


def identity(axes: dict[str, Any] | None = None, **parts: Any) -> bytes:
    [case_hash] = hashes_of(quick({**ONE, **(axes or {})}, **parts))
    return case_hash


SAME = {
    "title": {"title": "Another title"},
    "name": {"study": "other"},
    "a scalar as an axis of one": {"axes": {"e": [0.5]}},
    "another unit": {"scene": {"casing.gap": "20 um"}},
    "a whole number": {"axes": {"alpha": 5}},
    "minus nothing": {"scene": {"load.phase": -0.0}},
    "no histories": {"output": {"histories": []}},
    "other histories": {"output": {"histories": ["velocity", "temperature"]}},
    "precision": {"output": {"precision": "float32"}},
    "a label of the scheme": {"schemes": {"mine": {"method": "moreau"}}, "axes": {"scheme": "mine"}},
    "options of a scheme that is not used": {"schemes": {"mine": {"method": "moreau", "theta": 0.7}}},
}


@pytest.mark.parametrize("parts", SAME.values(), ids=SAME.keys())
def test_what_changes_no_result_changes_no_identity(parts: dict[str, Any]) -> None:
    assert identity(**parts) == identity()


OTHER = {
    "gap": {"scene": {"casing.gap": 21e-6}},
    "one bit of the gap": {"scene": {"casing.gap": math.nextafter(20e-6, 1.0)}},
    "mean": {"scene": {"load.mean": 1.0}},
    "amplitude": {"scene": {"load.amplitude": 101.0}},
    "frequency": {"scene": {"load.frequency": 1001.0}},
    "phase": {"scene": {"load.phase": 0.1}},
    "steady": {"scene": {"load.steady": 1.0}},
    "heating": {"scene": {"chain.heating": 1.0}},
    "displacement": {"scene": {"initial.displacement": 1e-6}},
    "velocity": {"scene": {"initial.velocity": 1e-3}},
    "temperature": {"scene": {"initial.temperature": 1.0}},
    "static": {"scene": {"initial": "static"}},
    "mass": {"scene": {"chain.mass": 2.6e-3}},
    "stiffness": {"scene": {"chain.stiffness": 4.1e6}},
    "damping": {"scene": {"chain.damping": {"mass": 10.0, "stiffness": 0.0}}},
    "spacing": {"scene": {"chain.spacing": 2.6e-3}},
    "expansion": {"scene": {"chain.expansion": 9e-6}},
    "capacity": {"scene": {"chain.heat_capacity": 1.4}},
    "conductance": {"scene": {"chain.conductance": 0.7}},
    "convection": {"scene": {"chain.convection": 0.02}},
    "nodes": {"scene": {"chain.nodes": 2}},
    "duration": {"scene": {"duration": 5e-3}},
    "interval": {"output": {"interval": 1e-3}},
    "h": {"axes": {"h": 5e-5}},
    "e": {"axes": {"e": 0.6}},
    "alpha": {"axes": {"alpha": 6.0}},
    "scheme": {"axes": {"scheme": "event_driven"}},
    "balances, by which cases are judged": {"output": {"balances": False}},
    "option": {"schemes": {"mine": {"method": "moreau", "theta": 0.7}}, "axes": {"scheme": "mine"}},
    "reference": {"reference": {"scheme": "moreau", "h": 1e-5}},
}


def test_what_may_change_a_result_changes_the_identity() -> None:
    assert len({identity(), *(identity(**parts) for parts in OTHER.values())}) == 1 + len(OTHER)


def test_lists_per_node_count_node_by_node() -> None:
    two = {"chain.nodes": 2}
    identities = [identity(scene={**two, "load.steady": value}) for value in ([1.0, 2.0], [2.0, 1.0], 1.0)]
    assert len(set(identities)) == 3


def test_modes_count() -> None:
    scene = {"chain.nodes": 3}
    identities = {
        identity({"mechanical_modes": modes, "thermal_modes": thermal}, scene=scene)
        for modes in (1, 2)
        for thermal in (1, "full")
    }
    assert len(identities) == 4
    assert identity(scene=scene) in identities  # all modes, told as a number


def test_the_version_of_the_solver_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    before = identity()
    monkeypatch.setattr(_identity, "SOLVER_VERSION", _identity.SOLVER_VERSION + 1)
    assert identity() != before


@pytest.mark.parametrize(("scheme", "name"), [("event_driven", "h"), ("penalty", "e")])
def test_what_a_scheme_does_not_read_does_not_count(scheme: str, name: str) -> None:
    other = {"h": 5e-5, "e": 0.6}[name]
    own = {"scheme": scheme}
    assert identity({**own, name: other}) == identity(own)
    assert identity({**own, "alpha": 6.0}) != identity(own)
    reads_it = {"scheme": "moreau", name: ONE[name]}
    assert identity({**own, name: other}, reference=reads_it) == identity(own, reference=reads_it)


def test_balances_do_not_count_without_steps() -> None:
    exact = {"scheme": "event_driven"}
    assert identity(exact, output={"balances": False}) == identity(exact)


def test_what_only_the_reference_reads_counts() -> None:
    """Errors of a case without e are those against a reference with e."""
    penalty, reference = {"scheme": "penalty"}, {"scheme": "event_driven"}
    assert identity({**penalty, "e": 0.6}, reference=reference) != identity(penalty, reference=reference)
    fixed = {**reference, "e": 0.5}
    assert identity({**penalty, "e": 0.6}, reference=fixed) == identity(penalty, reference=fixed)
    other = {**reference, "e": 0.4}
    assert identity(penalty, reference=other) != identity(penalty, reference=fixed)


VALUES = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=4, unique=True)


@settings(max_examples=30, deadline=None)
@given(e=VALUES, alpha=VALUES, steps=st.lists(st.sampled_from([1e-4, 5e-5, 2e-5]), min_size=1, max_size=3, unique=True))
def test_place_and_arrangement_do_not_count(e: list[float], alpha: list[float], steps: list[float]) -> None:
    """The cases of a grid, however it is laid out, are those that stand alone."""
    whole = hashes_of(quick({"h": steps, "e": e, "alpha": alpha}))
    backward = hashes_of(quick({"alpha": alpha[::-1], "e": e[::-1], "h": steps[::-1]}))
    alone = [hashes_of(quick({"h": h, "e": x, "alpha": y}))[0] for h in steps for x in e for y in alpha]
    assert len(set(whole)) == len(whole)
    assert sorted(whole) == sorted(backward) == sorted(alone)


def test_a_zip_is_its_pairs() -> None:
    pairs = {"e": [0.0, 0.5], "alpha": [5.0, 50.0]}
    zipped = hashes_of(quick({"e": None, "alpha": None}, zip={"pair": pairs}))
    assert zipped == [identity({"e": e, "alpha": alpha}) for e, alpha in zip(*pairs.values(), strict=True)]


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
