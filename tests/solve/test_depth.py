"""``output: {temperature_depth: …}``: what an archive holds of it, in all bases and batches; refusals."""

from pathlib import Path

import numpy as np
import pytest

from matrix_files import as_npz, matrices_of
from quick import hashes_of
from scenes import heavy_chain
from studies import BLADE_SCENE, SCENE, parsed, refusal, solve_all, written
from workflow import open_archive, run_study
from workflow.study import read_study

AXES = """
axes: {scheme: [moreau, event_driven], h: 2e-5, alpha: [0, 30]}
zip: {model: {mechanical_modes: [1, full], thermal_modes: [2, full]}}
"""
DEEP = f"study: deep\n{SCENE}{AXES}output: {{interval: 2 ms, temperature_depth: 6 mm}}\n"

TWO_MESHES = DEEP.split("zip")[0].replace("alpha: [0, 30]", "scene.chain.nodes: [4, 2]") + DEEP.splitlines()[-1]


def test_an_archive_holds_the_mean_over_the_depth_in_every_basis(tmp_path: Path) -> None:
    """The mean lies below the tip of a blade that is heated there, and schemes agree on it as on the tip."""
    run_study(parsed(DEEP), tmp_path / "deep.nc")
    with open_archive(tmp_path / "deep.nc") as archive:
        assert (archive["status"] == 0).all()
        assert archive["depth_temperature"].dims == archive["temperature"].dims
        assert archive["max_depth_temperature"].dims == archive["max_temperature"].dims
        assert archive["depth_temperature"].attrs["depth"] == archive["max_depth_temperature"].attrs["depth"] == 6e-3
        hot = archive.sel(alpha=30)
        assert (hot["depth_temperature"].max("t") <= hot["max_depth_temperature"] * (1 + 1e-12)).all()
        assert (hot["max_depth_temperature"] < 0.9 * hot["max_temperature"]).all()
        exact = hot.sel(scheme="event_driven")
        for name in ("max_depth_temperature", "max_temperature"):
            assert (np.abs(hot[name] / exact[name] - 1) < 0.1).all()
        assert not archive.sel(alpha=0)["depth_temperature"].any()


@pytest.mark.parametrize(("nodes", "mean"), [(20, 254.182), pytest.param(320, 261.019, marks=pytest.mark.slow)])
def test_the_mean_over_two_millimetres_of_the_example_converges(nodes: int, mean: float) -> None:
    scene = BLADE_SCENE.replace("nodes: 20", f"nodes: {nodes}")
    axes, output = "axes: {scheme: event_driven, alpha: 30}", "output: {temperature_depth: 2 mm, histories: []}"
    (solved,) = solve_all(f"study: a{scene}{axes}\n{output}\n")
    assert solved.values["max_depth_temperature"][0] == pytest.approx(mean, abs=2e-3)


def test_histories_alone_have_samples_of_it(tmp_path: Path) -> None:
    text = DEEP.replace("temperature_depth", "histories: [], temperature_depth")
    archive = run_study(parsed(text), tmp_path / "deep.nc").dataset
    assert "depth_temperature" not in archive
    assert archive["max_depth_temperature"].notnull().all()


def test_results_depend_on_the_depth() -> None:
    texts = [DEEP.replace("6 mm", depth) for depth in ("6 mm", "0.6 cm", "5 mm")]
    same, again, *others = map(hashes_of, map(parsed, [*texts, DEEP.replace(", temperature_depth: 6 mm", "")]))
    assert same == again
    assert not any(set(same) & set(other) for other in others)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (DEEP.replace("6 mm", "11 mm"), "of 0.011 m is deeper than the 0.01 m of `chain`"),
        (DEEP.replace("spacing: 2.5e-3,", ""), "of 0.006 m is deeper than the 0 m of `chain`"),
        (TWO_MESHES, "deeper than the 0.005 m of `chain`"),
        (DEEP.replace("6 mm", "-1 mm"), "it must be above 0 m"),
    ],
)
def test_a_depth_that_a_structure_does_not_have_is_refused(text: str, problem: str) -> None:
    mistake = refusal(parsed, text)
    assert "output.temperature_depth" in mistake
    assert problem in mistake


def test_matrices_have_no_depth(tmp_path: Path) -> None:
    as_npz(matrices_of(heavy_chain(nodes=4)), tmp_path)
    text = f"study: a{BLADE_SCENE}output: {{temperature_depth: 1 mm}}\n"
    before, after = text.split("  blade: {")[0], text.split("stiffness: 2.0e-7}}\n")[1]
    path = written(f"{before}  matrices: {{file: blade.npz, contact: 3}}\n{after}", tmp_path)
    assert "deeper than the 0 m of `matrices`" in refusal(read_study, path)
