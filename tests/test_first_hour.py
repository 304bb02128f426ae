"""What stood in the way of a newcomer's first hour: wrong numbers, figures of lost cases, riddles in messages."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
import xarray as xr

from terminal import workflow
from workflow import read_study, recommend, run_study, write_matrices
from workflow.analysis import effect, shown_place
from workflow.models._sparse_pair import SparsePair
from workflow.plan import plan_study
from workflow.plots import histories
from workflow.report._sections import effects
from workflow.study import StudyError

ROOT = Path(__file__).parents[1]
BLADE = {
    "nodes": 8, "length": "40 mm", "width": "30 mm", "thickness": "1 mm", "density": 4430, "specific_heat": 560,
    "conductivity": 7.0, "convection": 400, "expansion": 9.0e-6, "tip_stiffness": 1.0e6,
    "damping": {"mass": 10.0, "stiffness": 2.0e-7},
}  # fmt: skip
SCENE = {
    "blade": BLADE,
    "casing": {"gap": "20 um"},
    "load": {"amplitude": 24, "frequency": "5 Hz"},
    "duration": "0.4 s",
}
AXES: dict[str, Any] = {
    "scheme": ["carpenter", "moreau", "event_driven"],
    "h": [1e-4, 3e-5],
    "e": [0, 0.5],
    "alpha": [0, 30],
}
REFERENCE = {"scheme": "event_driven"}


def study(axes: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"study": "hour", "scene": SCENE, "axes": axes, **more}


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> tuple[xr.Dataset, xr.Dataset]:
    """An archive with a reference and one without, carpenter diverged in both; logarithmic gaps."""
    place = tmp_path_factory.mktemp("hour")
    with_errors = run_study(read_study(study(AXES, reference=REFERENCE)), place / "errors.nc").dataset
    gaps = {"scheme": ["carpenter", "moreau"], "h": 1e-4, "scene.casing.gap": {"log": ["15 um", "22 um", 4]}}
    return with_errors, run_study(read_study(study(gaps)), place / "gaps.nc").dataset


def test_the_case_shown_is_the_one_recommended_or_the_median(archives: tuple[xr.Dataset, xr.Dataset]) -> None:
    with_errors, without = archives
    choice = recommend(with_errors, 0.01).choice
    assert choice is not None
    place = shown_place(with_errors)
    assert np.ravel_multi_index(list(place.values()), with_errors["status"].shape) == choice.number
    shown = without.isel(shown_place(without))
    assert shown["status"] == 0
    ok = without["contact_impulse"].where(without["status"] == 0).values.ravel()
    assert float(shown["contact_impulse"]) == np.sort(ok[~np.isnan(ok)])[2]
    assert str(shown["scheme"].values) == "moreau"
    title = histories(with_errors).get_suptitle()
    assert "event_driven" in title


def test_axes_are_weighed_by_exact_solutions(archives: tuple[xr.Dataset, xr.Dataset]) -> None:
    dataset = archives[0]
    told = effects(dataset, {})
    assert told is not None
    shares = {dim: share for dim, share, *_ in told["rows"]}
    exact = dataset.sel(scheme="event_driven").isel(h=0)
    for dim in ("e", "alpha"):
        assert shares[dim] == f"{100 * effect(exact, 'contact_impulse', dim):.2g} %"
    assert "scheme" not in shares
    assert told["of_exact"].startswith("scheme event_driven")


def test_an_opened_archive_finds_numbers_written_with_other_digits(archives: tuple[xr.Dataset, xr.Dataset]) -> None:
    dataset, gaps = archives[1], np.geomspace(15e-6, 22e-6, 4)
    assert any(gap not in dataset["gap"].values for gap in gaps)
    for k, gap in enumerate(gaps):
        assert dataset.sel(gap=gap)["gap"] == dataset["gap"][k]
        assert dataset["status"].loc[{"gap": gap * (1 - 9e-10)}]["gap"] == dataset["gap"][k]
        with pytest.raises(KeyError):
            dataset.sel(gap=gap * (1 + 3e-9))
    assert dataset.sel(gap=gaps[::-1]).sizes["gap"] == 4
    assert dataset.sel(gap=slice(gaps[1], gaps[2])).sizes["gap"] == 2
    part = dataset.isel(gap=[3, 1])
    assert part.sel(gap=gaps[1])["gap"] == dataset["gap"][1]
    plain = xr.DataArray(np.ones(4), coords={"gap": dataset["gap"].values}, dims="gap")
    assert (dataset["contact_impulse"] * plain).sizes["gap"] == 4
    assert dataset.reindex(gap=[gaps[0], 1.0]).sizes["gap"] == 2


@pytest.mark.parametrize(
    ("name", "value"), [("density", 4.43), ("density", 7.85e-9), ("tip_stiffness", 1e3), ("tip_stiffness", 3e9)]
)
def test_units_are_asked_after(name: str, value: float) -> None:
    assert not any("unit" in line for line in plan_study(study({"scheme": "event_driven"})).warnings)
    doubted = read_study(study({"scheme": "event_driven"})).with_({f"scene.blade.{name}": value})
    assert any("check" in line and "unit" in line for line in plan_study(doubted).warnings)


@pytest.mark.parametrize("sizes", [(400,), (14, 7, 4)])
def test_fastest_rate_of_sparse_matrices(sizes: tuple[int, ...]) -> None:
    """Of a mesh of bricks with linear temperatures it is the sum of those along its edges."""
    stiffness, inertia = scipy.sparse.csc_array(np.zeros((1, 1))), scipy.sparse.csc_array(np.ones((1, 1)))
    largest = 0.0
    for n in sizes:
        ends = np.append(np.full(n - 1, 2.0), 1.0)
        along = scipy.sparse.diags_array([-np.ones(n - 1), ends, -np.ones(n - 1)], offsets=[-1, 0, 1])
        heavy = scipy.sparse.diags_array([np.ones(n - 1), 2 * ends, np.ones(n - 1)], offsets=[-1, 0, 1]) / 6
        largest += scipy.linalg.eigvalsh(along.toarray(), heavy.toarray())[-1]
        stiffness = scipy.sparse.kron(stiffness, heavy) + scipy.sparse.kron(inertia, along)
        inertia = scipy.sparse.kron(inertia, heavy)
    pair = SparsePair(scipy.sparse.csc_array(stiffness), scipy.sparse.csc_array(inertia))
    assert 0.94 * largest < pair.spectrum()[-1] <= largest * (1 + 1e-9)


MESSAGES = {
    "axes.gap": ([1e-5, 2e-5], "write it as `scene.casing.gap`"),
    "axes.thickness": ([1e-3], "did you mean `scene.blade.thickness`?"),
    "scene.blade.casing": ({"gap": "20 um"}, "write it as `scene.casing`"),
    "scene.blade.load": ({"amplitude": 3}, "write it as `scene.load`"),
    "scene.restitutio": (3, "what can stand here"),
    "scene.alpha": (3, "write it as `axes.alpha`"),
    "scene.load.amplitude": ("24,5 N", "write a point and an e"),
    "scene.blade.length": ("1,2e-2 m", "write a point and an e"),
    "scene.casing": ({"gap": 20, "5 um": None}, "write a point, not a comma"),
    "scene.blade.density": ([4430, 7850], "write one value here, and several under `axes`"),
    "scene.load": ({"frequency": ["1 Hz", "2 Hz"]}, "write one value here, and several under `axes`"),
}


@pytest.mark.parametrize("key", MESSAGES)
def test_a_message_says_what_to_write(key: str) -> None:
    tree = {**study({"scheme": "moreau"}), "scene": {**SCENE, "blade": dict(BLADE), "load": dict(SCENE["load"])}}  # type: ignore[call-overload]
    value, words = MESSAGES[key]
    *above, last = key.split(".")
    owner: Any = tree
    for word in above:
        owner = owner[word]
    owner[last] = value
    with pytest.raises(StudyError) as refused:
        read_study(tree)
    assert words in str(refused.value)


def test_matrices_without_heat_or_with_wrong_labels(tmp_path: Path) -> None:
    tip, labels = np.eye(3)[-1], ["root.x", "middle.x", "tip.x"]
    springs = np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
    cold = {"mass": np.eye(3), "stiffness": 1e4 * springs, "contact": tip}
    warm = {**cold, "conductance": springs, "thermal_contact": tip, "coupling": np.zeros((3, 3))}
    write_matrices(tmp_path / "cold.npz", **cold)
    write_matrices(tmp_path / "bare.npz", **warm, heat_capacity=np.diag([1.0, 1, 0]))
    write_matrices(tmp_path / "named.npz", **warm, heat_capacity=np.eye(3), labels=labels)

    def refusal(matrices: dict[str, Any], **axes: Any) -> str:
        written = tmp_path / "given.yaml"
        tree = {**study({"scheme": "moreau", **axes}), "scene": {**SCENE, "matrices": matrices}}
        del tree["scene"]["blade"]
        written.write_text(repr(tree))
        with pytest.raises(StudyError) as refused:
            read_study(written)
        return str(refused.value)

    assert "has no temperature beside the tip's; write 0 or `full`" in refusal(
        {"file": "cold.npz"}, thermal_modes=[1, 2]
    )
    assert "the contact heats a temperature without heat capacity" in refusal({"file": "bare.npz"})
    said = refusal({"file": "named.npz", "contact": "tipp.x"})
    assert "write `contact`, `tip.x`" in said
    assert "`thermal_contact`" not in said
    assert "`contact`" not in refusal({"file": "named.npz", "thermal_contact": "tipp.x"}).partition("write")[2]


def test_a_run_says_what_to_do_next_and_the_readme_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(repr({**study({"scheme": "moreau", "alpha": [0, 1]}), "study": "mine"}))
    done = workflow("run", "mine.yaml", "-o", "a run.nc", cwd=tmp_path)
    assert done.stdout.splitlines()[-1] == "next: workflow report 'a run.nc'"
    assert workflow("run", "mine.yaml", "-q", cwd=tmp_path).stdout == ""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    first = readme[: readme.index("```") + 3]
    assert first.endswith("<!-- run -->\n```")
    assert len(re.findall(r"<!-- run -->\n```sh\n(.*)\n```", readme)) == 1
    assert len(re.findall(r"<!-- test -->\n```sh\n(.*)\n```", readme)) == 1
