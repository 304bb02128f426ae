"""Axes: values, order, names, zips, ``full``, branches and steady rubs, and the settings of a case."""

import itertools
import json
import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import qmc

from quick import quick
from studies import SCENE, refusal
from study_samples import BLADE, CHAIN
from workflow.cases import arrange, case_hashes
from workflow.study import Initial, Load, Steady, Study, StudyError, json_schema, parse_study, resolved_values
from workflow.study.ranges import Range
from workflow.study.source import compose


def chain(lines: str) -> Study:
    return parse_study(f"{CHAIN}{lines}\n", "chain.yaml")


def first_values(study: Study) -> dict:
    axes = [*study.scalars, *(axis for dimension in study.dimensions for axis in dimension.axes)]
    return {axis.path: axis.values[0] for axis in axes}


def test_the_example() -> None:
    study = parse_study(BLADE, "blade.yaml")
    assert [dimension.name for dimension in study.dimensions] == ["scheme", "e", "h", "alpha", "gap", "model"]
    assert [dimension.size for dimension in study.dimensions] == [2, 3, 5, 2, 2, 3]
    assert [(scalar.name, scalar.values) for scalar in study.scalars] == [("reduction", ("craig_bampton",))]
    gap, model = study.dimensions[4:]
    assert (gap.axes[0].path, gap.axes[0].unit, gap.axes[0].values) == ("scene.casing.gap", "m", (1.5e-5, 2e-5))
    assert [axis.values for axis in model.axes] == [(1, 3, 19), (4, 12, 19)]
    assert study.dimensions[2].axes[0].values[2] == 1e-5
    assert study.dimensions[3].axes[0].unit == "W N-1"
    assert study.scene.load == Load(amplitude=24.0, frequency=5.0)
    assert study.reference is not None
    assert study.reference.values == {"scheme": "moreau", "mechanical_modes": 19, "thermal_modes": 19}
    assert set(study.schemes) == {"implicit_euler", "midpoint", "moreau"}
    assert (study.output.interval, study.samples) == (1e-3, 2001)


def test_what_is_left_out_has_its_default() -> None:
    study = chain("")
    assert study.title == "chain"
    assert first_values(study) == {
        **{"scheme": "moreau", "e": 0.0, "alpha": 0.0, "h": 1e-4},
        **{"reduction": "craig_bampton", "mechanical_modes": 2, "thermal_modes": 2},
    }
    assert (study.scene.load, study.scene.initial) == (Load(), Initial())
    assert study.dimensions == ()
    assert study.output.interval == 1e-3
    assert study.output.histories == ("displacement", "temperature", "contact_force")
    assert study.output.balances
    assert study.schemes["moreau"].options.theta == 1.0


def test_a_bare_value_is_a_scalar_and_a_list_of_one_a_dimension() -> None:
    study = chain("axes: {e: 0.5, h: [1 ms], scene.load.frequency: 300 rpm}")
    assert [dimension.name for dimension in study.dimensions] == ["h"]
    scalars = {scalar.name: scalar.values for scalar in study.scalars}
    assert scalars["e"] == (0.5,)
    assert scalars["frequency"] == (5.0,)
    assert study.cell(first_values(study)).scene.load.frequency == 5.0


@given(st.floats(1e-9, 1e9), st.floats(1.001, 1e6), st.integers(2, 50))
def test_spread_values(first: float, ratio: float, count: int) -> None:
    last = first * ratio
    for law in ("lin", "log"):
        values = Range(law, first, last).spread(count)
        assert len(values) == count
        assert all(float(f"{value:.12g}") == value for value in values)
        assert values[0] == pytest.approx(first, rel=1e-11)
        assert values[-1] == pytest.approx(last, rel=1e-11)
        steps = [b - a if law == "lin" else math.log(b / a) for a, b in itertools.pairwise(values)]
        assert max(steps) == pytest.approx(min(steps), rel=1e-5)


def test_spread_over_decades_and_counts() -> None:
    assert Range("log", 1e-6, 1e-2).spread(5) == (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
    assert Range("lin", 0.0, 1.0).spread(11) == tuple(index / 10 for index in range(11))
    (nodes,) = chain("axes: {scene.chain.nodes: {log: [10, 80, 4]}}").dimensions
    assert nodes.axes[0].values == (10, 20, 40, 80)


def test_full_follows_the_nodes() -> None:
    (dimension,) = chain("axes: {scene.chain.nodes: [2, 5], mechanical_modes: full}").dimensions
    assert dimension.name == "nodes"
    counts = {"nodes": (2, 5), "mechanical_modes": (1, 4), "thermal_modes": (1, 4)}
    assert {axis.name: axis.values for axis in dimension.axes} == counts
    zipped = chain("zip: {size: {scene.chain.nodes: [2, 5], mechanical_modes: [full, 3]}, other: {e: [0, 1]}}")
    columns = {axis.path: axis.values for axis in zipped.dimensions[0].axes}
    assert columns["mechanical_modes"] == (1, 3)
    assert columns["thermal_modes"] == (1, 4)


@pytest.mark.parametrize(
    ("rest", "place"),
    [
        ("axes: {scene.chain.nodes: 2001}", "axes.mechanical_modes"),
        ("axes: {scene.chain.nodes: 2001, mechanical_modes: [4, 2000], thermal_modes: 4}", "axes.mechanical_modes"),
        ("axes: {scene.chain.nodes: [2, 2001], thermal_modes: 1}", "axes.mechanical_modes"),
        ("zip: {size: {scene.chain.nodes: [2, 2001], mechanical_modes: [0, full], thermal_modes: [1, 4]}}", "zip.size"),
        ("axes: {scene.chain.nodes: 2001, mechanical_modes: 4, thermal_modes: 4}\nreference: {FULL}", "reference"),
    ],
)
def test_a_chain_of_more_than_2000_nodes_is_not_kept_full(rest: str, place: str) -> None:
    rest = rest.replace("FULL", "thermal_modes: full")
    with pytest.raises(StudyError) as refused:
        chain(rest)
    mistake = refused.value.mistakes[0]
    assert mistake.key.startswith(place)
    assert "too large for that" in mistake.problem
    assert mistake.remedy == "write at most 100, or `auto` with a `tolerance`"
    chain(rest.replace("2001", "2000").replace("[4, 2000]", "[4, 1999]"))


def test_auto_is_stored_as_minus_one_beside_its_tolerance() -> None:
    study = chain("axes: {mechanical_modes: auto}\nzip: {model: {thermal_modes: [1, auto], tolerance: [0.1, 1e-3]}}")
    [dimension] = study.dimensions
    assert {axis.name: axis.values for axis in dimension.axes} == {"thermal_modes": (1, -1), "tolerance": (0.1, 1e-3)}
    assert [axis.values for axis in study.scalars if axis.path == "mechanical_modes"] == [(-1,)]
    assert study.is_auto
    assert not chain("axes: {tolerance: 0.1}").is_auto
    assert "tolerance" not in {axis.path for axis in chain("axes: {e: 0}").scalars}
    alone = "axes: {scene.chain.nodes: [2, 5], mechanical_modes: auto, thermal_modes: auto, tolerance: 0.1}"
    assert [dimension.name for dimension in chain(alone).dimensions] == ["nodes"]


def test_a_full_reference_is_resolved_in_every_case() -> None:
    study = chain("axes: {scene.chain.nodes: [2, 5], mechanical_modes: 0}\nreference: {mechanical_modes: full}")
    assert study.reference is not None
    values = first_values(study) | {"scene.chain.nodes": 5, "thermal_modes": 4}
    assert study.cell(values).mechanical_modes == 0
    assert study.cell(values | dict(study.reference.values)).mechanical_modes == 4


def test_names_avoid_the_archive_and_each_other() -> None:
    named = {
        "scene.initial.displacement": "initial_displacement",
        "schemes.a.theta": "a_theta",
        "schemes.b.theta": "b_theta",
        "scene.chain.damping.mass": "damping_mass",
        "scene.chain.mass": "chain_mass",
        "scene.load.mean": "mean",
    }
    axes = ", ".join(f"{path}: [0.5 , 1]" if "theta" in path else f"{path}: [1e-6, 2e-6]" for path in named)
    study = chain(f"schemes: {{a: {{method: moreau}}, b: {{method: moreau}}}}\naxes: {{{axes}}}")
    assert {axis.path: axis.name for dimension in study.dimensions for axis in dimension.axes} == named


def test_the_settings_of_a_case() -> None:
    study = chain(
        "schemes: {mid: {method: moreau, theta: 0.5}}\n"
        "axes: {scheme: [mid, moreau], schemes.mid.theta: [0.6, 0.7], scene.chain.damping.stiffness: [1, 2],\n"
        "       scene.casing.gap: [1, 2]}"
    )
    values = first_values(study)
    values |= {"schemes.mid.theta": 0.7, "scene.chain.damping.stiffness": 2.0, "scene.casing.gap": 2.0}
    cell = study.cell(values)
    assert (cell.scheme.label, cell.scheme.options.theta) == ("mid", 0.7)
    assert cell.scene.parameters.damping.stiffness == 2.0
    assert cell.scene.gap == 2.0
    assert cell.scene.parameters.mass == study.scene.parameters.mass
    other = study.cell(values | {"scheme": "moreau"})
    assert other.scheme.options.theta == 1.0
    assert study.scene.gap == 2e-5


def test_an_axis_supplies_what_the_scene_leaves_out() -> None:
    text = CHAIN.replace("{gap: 20 um}", "{}")
    assert parse_study(f"{text}axes: {{scene.casing.gap: [1 mm, 2 mm]}}\n", "f").scene.gap == 1e-3
    assert "axes.scene.casing.gap[0]: " in refusal(parse_study, f"{text}axes: {{scene.casing.gap: [1 kg]}}\n", "f")
    assert refusal(parse_study, text, "f").startswith("f:4: scene.casing.gap: is missing; write it: tip clearance")


def test_resolved_is_plain_and_free_of_places() -> None:
    study = parse_study(BLADE, "somewhere/blade.yaml")
    resolved = study.resolved()
    assert json.loads(json.dumps(resolved, allow_nan=False)) == resolved
    assert "somewhere" not in json.dumps(resolved)
    assert resolved == parse_study(BLADE.replace("20 um", "2.0e-5") + "# more\n", "other.yaml").resolved()
    assert resolved != parse_study(BLADE.replace("amplitude: 24", "amplitude: 25"), "f").resolved()
    assert pickle.loads(pickle.dumps(study)) == study


def test_yaml_1_2() -> None:
    text = "a: 1e-6\nb: 2.0e7\nc: yes\nd: 010\ne: 0x1F\nf: [~, true, .5, '1', 1_000]\ng: 12:30\n"
    source = compose(text, "f")
    assert source.tree == {
        **{"a": 1e-6, "b": 2e7, "c": "yes", "d": 10, "e": 31},
        **{"f": [None, True, 0.5, "1", "1_000"], "g": "12:30"},
    }
    assert source.lines[("f", 3)] == 6


TREES = st.recursive(
    st.integers() | st.text(alphabet="abc", min_size=1),
    lambda below: st.lists(below, max_size=4) | st.dictionaries(st.text(alphabet="xyz", min_size=1), below, max_size=4),
    max_leaves=12,
)


@given(st.dictionaries(st.text(alphabet="xyz", min_size=1), TREES, min_size=1))
def test_json_is_read_as_it_is_and_every_place_has_its_line(tree: dict) -> None:
    text = json.dumps(tree, indent=1)
    source = compose(text, "f")
    assert source.tree == tree
    for place, line in source.lines.items():
        written = text.splitlines()[line - 1]
        value = tree
        for step in place:
            value = value[step]
        start = json.dumps(value)[:1]
        assert written.lstrip().startswith(f'"{place[-1]}"' if isinstance(place[-1], str) else start)


def test_schema_follows_the_declarations() -> None:
    schema = json_schema()
    assert json.loads(json.dumps(schema)) == schema
    assert schema["required"] == ["study", "scene"]
    blade = schema["properties"]["scene"]["properties"]["blade"]
    assert "convection" not in blade["required"]
    assert blade["properties"]["length"]["description"] == "length from root to tip [m]; above 0"
    assert blade["properties"]["length"]["anyOf"][0] == {"type": "number", "exclusiveMinimum": 0}
    axes = schema["properties"]["axes"]["properties"]
    assert {"e", "h", "alpha", "scheme", "scene.casing.gap", "scene.blade.length", "scene.chain.mass"} <= set(axes)
    assert {"lin", "log", "branch", "sweep", "boundary"} == {
        key for form in axes["e"]["anyOf"] for key in form.get("properties", {})
    }


def test_schema_accepts_the_examples_and_refuses_what_the_reader_refuses() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    drawn = "zip: {design: {sample: random, points: 4, of: {e: [0, 1], scene.casing.gap: {log: [1 um, 2]}}}}\n"
    for text in (BLADE, CHAIN, CHAIN + drawn):
        validator.validate(compose(text, "f").tree)
    for old, new in (
        ("length: 40 mm", "lenght: 40 mm"),
        ("length: 40 mm", "length: 0"),
        ("length: 40 mm", "length: mm"),
        ("e: [0, 0.5, 0.9]", "e: [2]"),
        ("e: [0, 0.5, 0.9]", "e: []"),
        ("alpha: [0, 30]", "alhpa: [0, 30]"),
        ("theta: 0.5", "theta: 2"),
        ("precision: float64", "precision: float16"),
    ):
        assert not validator.is_valid(compose(BLADE.replace(old, new), "f").tree), new
    for old, new in (("random", "grid"), ("points: 4, ", ""), ("[0, 1]", "[0]"), ("e:", "h:"), ("log", "lin")):
        assert not validator.is_valid(compose(CHAIN + drawn.replace(old, new), "f").tree), new


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


PATHS = ("scene.casing.gap", "alpha")


def design(sample: str, points: int, seed: int = 1) -> Study:
    ranges = "{scene.casing.gap: [15 um, 25 um], alpha: {log: [1, 30]}}"
    zipped = f"{{sample: {sample}, points: {points}, seed: {seed}, of: {ranges}}}"
    return parse_study(f"study: a\n{SCENE}\naxes: {{h: 1e-3}}\nzip: {{design: {zipped}}}\n", "f")


def columns(study: Study) -> np.ndarray:
    (dimension,) = study.dimensions
    assert dimension.name == "design"
    assert tuple(axis.path for axis in dimension.axes) == PATHS
    return np.array([axis.values for axis in dimension.axes]).T


def in_range(shares: np.ndarray) -> np.ndarray:
    return np.stack([15e-6 + 1e-5 * shares[..., 0], 30 ** shares[..., 1]], axis=-1)


def test_random_values_are_those_of_the_seed() -> None:
    assert columns(design("random", 5)) == pytest.approx(in_range(np.random.default_rng(1).random((5, 2))), rel=1e-11)
    assert np.all(columns(design("random", 5, 2)) != columns(design("random", 5)))


def test_a_hypercube_has_each_number_once_in_each_part() -> None:
    drawn = columns(design("latin_hypercube", 10))
    assert drawn == pytest.approx(in_range(qmc.LatinHypercube(2, seed=1).random(10)), rel=1e-11)
    gap, alpha = (drawn[:, 0] - 15e-6) / 1e-5, np.log(drawn[:, 1]) / np.log(30)
    for shares in (gap, alpha):
        assert sorted(np.floor(10 * shares)) == list(range(10))


def test_sobol_indices_have_two_matrices_and_one_more_for_each_number() -> None:
    sequence = qmc.Sobol(4, bits=64, seed=1).random(8)
    a, b = sequence[:, :2], sequence[:, 2:]
    mixed = np.stack([a, b, np.stack([b[:, 0], a[:, 1]], 1), np.stack([a[:, 0], b[:, 1]], 1)], axis=1)
    study = design("sobol_indices", 8)
    assert columns(study) == pytest.approx(in_range(mixed.reshape(32, 2)), rel=1e-11)
    assert study.dimensions[0].drawn.matrices == ("A", "B", *PATHS)


@pytest.mark.parametrize("sample", ["random", "sobol_indices"])
def test_more_points_keep_the_first(sample: str) -> None:
    few, many = design(sample, 8), design(sample, 8).with_({"zip.design.points": 16})
    assert "points: 16" in many.text
    assert np.array_equal(columns(many)[: len(columns(few))], columns(few))
    hashes = [case_hashes(arrange(study)) for study in (few, many)]
    assert np.array_equal(hashes[1][: len(hashes[0])], hashes[0])


def test_the_plan_names_ranges() -> None:
    study = design("random", 300)
    texts = {one.path: one.text for one in resolved_values(study, arrange(study).settings(0))}
    assert texts["scene.casing.gap"] == "15 µm to 25 µm, drawn"
    assert texts["alpha"] == "1 W/N to 30 W/N, drawn in the logarithm"
    assert study.resolved()["dimensions"][0]["drawn"]["sample"] == "random"
