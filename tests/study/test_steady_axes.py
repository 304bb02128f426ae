"""What a study may ask of steady rubs and of branches, and how it is told what is wrong."""

from typing import Any

import pytest

from quick import quick
from workflow.study import Steady, StudyError

EXACT = {"scheme": "event_driven", "h": None}
BRANCH = {"branch": [0, 40, 200]}


@pytest.mark.parametrize(
    ("asked", "meant"),
    [(True, Steady()), (False, None), ({}, Steady()), ({"periods": 2}, Steady(periods=2, samples=100))],
)
def test_steady_rubs_are_asked_for_by_a_flag_or_by_options(asked: Any, meant: Steady | None) -> None:
    study = quick(output={"steady": asked})
    assert study.output.steady == meant
    assert ("steady" in study.resolved()["output"]) == (meant is not None)


def test_an_axis_may_be_a_branch() -> None:
    study = quick({**EXACT, "alpha": BRANCH, "e": [0, 0.5]})
    branch = study.branch
    assert branch is not None
    assert (branch.axis.name, branch.axis.values, branch.points) == ("alpha", (0.0, 40.0), 200)
    assert [dimension.name for dimension in study.dimensions] == ["e"]
    assert study.output.histories == ()
    assert study.output.steady == Steady()
    assert quick({**EXACT, "alpha": BRANCH}, output={"steady": {"samples": 7}}).output.steady == Steady(samples=7)
    of_gap = quick({**EXACT, "alpha": 5, "scene.casing.gap": {"branch": ["10 um", "40 um", 20]}}).branch
    assert of_gap is not None
    assert (of_gap.axis.name, of_gap.axis.values) == ("gap", (1e-5, 4e-5))


def test_names_that_their_dimensions_take_are_not_those_of_axes() -> None:
    axes = {**EXACT, "scene.load.phase": [0.0, 1.0]}
    assert [d.name for d in quick(axes).dimensions][-1] == "phase"
    assert [d.name for d in quick(axes, output={"steady": True}).dimensions][-1] == "load_phase"
    assert [d.name for d in quick({**axes, "alpha": BRANCH}).dimensions][-1] == "load_phase"


@pytest.mark.parametrize(
    ("parts", "place", "words"),
    [
        ({"output": {"steady": 3}}, "output.steady", "true or false"),
        ({"output": {"steady": {"period": 3}}}, "output.steady.period", "periods"),
        ({"axes": {"alpha": BRANCH, "scheme": ["event_driven", "moreau"]}}, "axes.alpha", "only event_driven"),
        ({"axes": {**EXACT, "h": {"branch": [1e-5, 1e-4, 20]}}}, "axes.h", "cannot be followed"),
        ({"axes": {**EXACT, "alpha": BRANCH, "e": {"branch": [0, 1, 20]}}}, "axes.alpha", "cannot be followed"),
        ({"axes": {**EXACT, "thermal_modes": {"branch": [0, 1, 20]}}}, "thermal_modes.branch", "real-valued"),
        ({"axes": {**EXACT, "alpha": BRANCH}, "reference": {"scheme": "event_driven"}}, "reference", "no errors"),
        (
            {"axes": {**EXACT, "alpha": 5}, "zip": {"both": {"scene.casing.gap": {"branch": [1e-5, 2e-5, 10]}}}},
            "zip.both.scene.casing.gap.branch",
            "of its own",
        ),
    ],
)
def test_what_cannot_be_asked_is_told(parts: dict[str, Any], place: str, words: str) -> None:
    with pytest.raises(StudyError) as raised:
        quick(parts.pop("axes", None), **parts)
    assert any(place in str(mistake) and words in str(mistake) for mistake in raised.value.mistakes), raised.value
