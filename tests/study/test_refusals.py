"""Broken studies of every kind: each names line, key, problem and remedy, and nothing else."""

import os
from pathlib import Path

import pytest

from study_samples import BLADE, CHAIN
from workflow.study import StudyError, parse_study, read_study
from workflow.study.source import MOST_ENTRIES, compose

TITLE = "title: Tip response of a compressor blade that rubs on its casing"
STEPS = "{log: [1e-6, 1e-4, 5]}"
CHANGED = [
    (17, "frequency: 5 Hz", "frequency: 1e15 Hz", "scene.load.frequency", "2e+15 load periods", "up to 1e+06 Hz"),
    # line; what is written there, what stands there instead; key, fragments of the problem and the remedy
    (1, "study: blade", "study: 5 blades", "study", "is no name", "letters, digits"),
    (2, "title: Tip", f"title: {'Tip ' * 300}", "title", "characters", "at most 1000"),
    (2, TITLE, 'title: "a\\uD800"', "title", "escape that is no character", "write the character"),
    (2, TITLE, "title: 5", "title", "not a text", "line"),
    (6, "length: 40 mm", "length: 40 kg", "scene.blade.length", "`40 kg` is not a length", "e.g. `0.5 mm`"),
    (6, "length: 40 mm", "length: 9**9**9 m", "scene.blade.length", "`**9**9 m` is not a unit", "metres"),
    (6, "length: 40 mm", "length: '40'", "scene.blade.length", "without a unit", "metres"),
    (6, "length: 40 mm", "length:", "scene.blade.length", "has no value", "metres"),
    (6, "length: 40 mm", "length: 0", "scene.blade.length", "out of range", "above 0 m"),
    (6, "length: 40 mm", "length: !!float 40", "scene.blade.length", "has the tag", "without a tag"),
    (6, "length: 40 mm", "length: 40,5 mm", "scene.blade.length", "`40,5 mm` is no number as YAML", "a point and an e"),
    (9, "density: 4430", "density: [4430, 7850]", "scene.blade.density", "a list", "one value here, and several under"),
    (9, "density: 4430", "density: 4430 K", "scene.blade.density", "in kg/m**3", "1 kg/m**3"),
    (15, "{mass: 10.0, stiffness: 2.0e-7}", "{mas: 10.0}", "scene.blade.damping.mas", "not known", "`mass`"),
    (15, "1.0e6\n", "1.0e6\n    casing: {gap: 20 um}\n", "scene.blade.casing", "not known", "it as `scene.casing`"),
    (15, "1.0e6\n", "1.0e6\n    load: {amplitude: 3}\n", "scene.blade.load", "not known here", "it as `scene.load`"),
    (15, "{mass: 10.0, stiffness: 2.0e-7}", "10", "scene.blade.damping", "is not a mapping", "key: value"),
    (16, "{gap: 20 um}", "{gap: 20 um, phase:}", "scene.casing.phase:", "not known", "a space after the colon"),
    (16, "{gap: 20 um}", "{gap: 20 um, gap:10 um}", "scene.casing.gap:10 um", "not known", "a space after the colon"),
    (16, "{gap: 20 um}", "{gap: 20 um, gap: 10 um}", "scene.casing.gap", "stands twice, first in line 16", "keep one"),
    (16, "{gap: 20 um}", "{gap: 20,5 um}", "scene.casing.5 um", "not known here", "a point, not a comma"),
    (17, "amplitude: 24", "amplitude: 24, 30", "scene.load.30", "not known here", "or a list in brackets"),
    (
        17,
        "frequency: 5 Hz",
        "frequency: 30 rad/s",
        "scene.load.frequency",
        "not a frequency",
        "write hertz or rpm, e.g.",
    ),
    (17, "amplitude: 24", "amplitude: 24,5 N", "scene.load.5 N", "not known here", "a point, not a comma"),
    (17, "frequency: 5 Hz", "frequency: [1 Hz, 2 Hz]", "scene.load.frequency", "a list", "and several under `axes`"),
    (17, "phase: 0", "phase: 1e22", "scene.load.phase", "is out of range", "at least -1000 and at most 1000 rad"),
    (18, "temperature: 0}", "temperature: 20 degC}", "scene.initial.temperature", "has an offset", "the rise above"),
    (
        18,
        "{displacement: 0",
        "{displacement: 15.000001 um",
        "scene.initial.displacement",
        "inside the casing, at 1.5000001e-05 m with a gap of 1.5e-05",
        "static",
    ),
    (18, "{displacement: 0, velocity: 0, temperature: 0}", "statik", "scene.initial", "not a mapping or", "static"),
    (20, "duration: 2 s", "duration: 2 s\n  restitutio: 3", "scene.restitutio", "not known", "what can stand here"),
    (20, "duration: 2 s", "duration: 2 s\n  alpha: 3", "scene.alpha", "not known here", "write it as `axes.alpha`"),
    (3, "  duration: 2 s\n", "", "scene.duration", "is missing", "write it: duration"),
    (22, "midpoint: {method: m", "midpoint: {method: nm", "schemes.midpoint.method", "no method", "`moreau`"),
    (22, "midpoint: {method: moreau,", "midpoint: {", "schemes.midpoint", "`method` is missing", "moreau"),
    (24, "[implicit_euler, midpoint]", "[implicit_euler, midpiont]", "axes.scheme[1]", "none of", "`midpoint`"),
    (25, "e: [0, 0.5, 0.9]", "e: 0, 0.5", "axes.e", "`0, 0.5` is no number as YAML", "or a list in brackets"),
    (25, "e: [0, 0.5, 0.9]", "e: []", "axes.e", "is empty", "at least one"),
    (25, "e: [0, 0.5, 0.9]", "e: [0, 0.5, 0.5]", "axes.e", "has `0.5` twice", "distinct"),
    (25, "e: [0, 0.5, 0.9]", "e: [0, [0.5]]", "axes.e[1]", "not a single value", "single"),
    (4, "tip_stiffness: 1.0e6", "youngs_modulus: 114e9\n    tip_stiffness: 1e6", "scene.blade", "has both", "one of"),
    (4, "    tip_stiffness: 1.0e6\n", "", "scene.blade", "neither `tip_stiffness` nor `youngs_modulus`", "one of"),
    (26, STEPS, "[1e-4, 2.0000001]", "axes.h", "2.0000001 s is longer than the duration of 2.0 s", "at most 2.0 s"),
    (25, "e: [0, 0.5, 0.9]", "restitution: [0]", "axes.restitution", "not known", "did you mean `e`"),
    (26, STEPS, "{log: [0 s, 1e-4, 5]}", "axes.h.log[0]", "out of range", "above 0"),
    (26, STEPS, "{log: [1e-6, 1e-6, 5]}", "axes.h.log", "same value", "list of one"),
    (26, STEPS, "{geo: [1e-6, 1e-4, 5]}", "axes.h.geo", "not known here", "`log`"),
    (23, STEPS, "{log: [1e-6, 1e-4, 1e6]}\n  scene.load.mean: {lin: [0, 1, 1000]}", "axes", "cases", "1e"),
    (27, "alpha: [0, 30]", "thickness: [1e-3]", "axes.thickness", "not known here", "mean `scene.blade.thickness`?"),
    (27, "alpha: [0, 30]", "alpha: {log: [0, 30, 5]}", "axes.alpha.log", "positive ends", "lin"),
    (28, "scene.casing.gap: [", "gap: [", "axes.gap", "not known here", "write it as `scene.casing.gap`"),
    (28, "scene.casing.gap: [", "scene.duration: [", "axes.scene.duration", "does not belong", "one time axis"),
    (27, "alpha: [0, 30]", "schemes.midpiont.theta: [0, 1]", "axes.schemes.midpiont.theta", "not known", "midpoint"),
    (30, "alpha: [0, 30]", "mechanical_modes: [1]", "zip.model.mechanical_modes", "is an axis already", "keep one"),
    (30, "mechanical_modes: [1, 3, full]", "mechanical_modes: [1, full]", "zip.model", "different length", "as many"),
    (30, "mechanical_modes: [1, 3, full]", "mechanical_modes: 3", "zip.model.mechanical_modes", "not a list", "others"),
    (30, "  model: {mech", "  status: {mech", "zip.status", "name of a variable", "another name"),
    (30, "  model: {mech", "  a b: {mech", "zip.a b", "is no name", "letters"),
    (33, "interval: 1 ms", "interval: 3 ms", "output.interval", "does not divide", "write e.g. 0.004, for 500"),
    (35, "precision: float64", "balances: maybe", "output.balances", "neither true nor false", "true or false"),
    (32, "output:", "e: 0.5\noutput:", "e", "does not belong here", "under `axes`"),
    (32, "output:", "<<: {}\noutput:", "<<", "merge key", "not read"),
    (32, "output:", "[1]: 5\noutput:", "", "a key that is no word", "one word"),
]


def mistakes_of(text: str) -> tuple:
    with pytest.raises(StudyError) as refused:
        parse_study(text, "blade.yaml")
    return refused.value.mistakes


@pytest.mark.parametrize(("line", "old", "new", "key", "problem", "remedy"), CHANGED)
def test_changed_line(line: int, old: str, new: str, key: str, problem: str, remedy: str) -> None:
    assert BLADE.count(old) == 1
    mistakes = mistakes_of(BLADE.replace(old, new))
    assert [(mistake.line, mistake.key) for mistake in mistakes] == [(line, key)], "\n".join(map(str, mistakes))
    assert problem in mistakes[0].problem
    assert remedy in mistakes[0].remedy


ENTRIES = "[" + "1, " * (MOST_ENTRIES // 2) + "1]"
GROWING = ["l0: &l0 [x, x]"] + [f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * 9)}]" for i in range(1, 12)]
WHOLE = [
    ("", 1, "is empty"),
    ("- 1\n- 2\n", 1, "is not a mapping"),
    ("study: a\n---\nstudy: b\n", 2, "another document"),
    ("study: 'a\n", 2, "is not YAML"),
    ('study: "\\UFFFFFFFF"\n', 1, "is not YAML"),
    ("%YAML 9.9\n---\nstudy: a\n", 1, "is not YAML"),
    ("study: " + "[" * 10_000, 1, "deeper than 40"),
    ("\n".join(" " * i + "a:" for i in range(1000)), 1, "deeper than 40"),
    ("a: [1]\nb: *a\n", 2, "undefined alias"),
    ("a: &a [1, *a]\n", 1, "deeper than 40"),
    ("a" * (2**20 + 1), None, "larger than 1 MiB"),
    ("\n".join(GROWING), 1, "more than 50000"),
    (f"study: a\naxes: {{e: {ENTRIES}, alpha: {ENTRIES}}}\n", 2, "more than 50000 keys and values"),
]


@pytest.mark.parametrize(("text", "line", "problem"), WHOLE)
def test_whole_text(text: str, line: int | None, problem: str) -> None:
    (mistake,) = mistakes_of(text)
    assert problem in mistake.problem
    assert (mistake.key, mistake.line) == ("", line)
    assert mistake.remedy


def test_an_alias_repeats_its_anchor() -> None:
    text = "a: &a {x: &x [1, {y: 2}], z: *x}\nb: [*a, &n 3 mm]\n*n : *x\n"
    inner = {"x": [1, {"y": 2}], "z": [1, {"y": 2}]}
    assert compose(text, "a.yaml").tree == {"a": inner, "b": [inner, "3 mm"], "3 mm": [1, {"y": 2}]}


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda path: None, "No such file"),
        (lambda path: path.mkdir(), "is not a file"),
        (lambda path: os.mkfifo(path), "is not a file"),
        (lambda path: path.write_bytes(b"study: a\ntitle: \xff\n"), "not UTF-8"),
        (lambda path: path.write_bytes(b"#" * (2**20 + 1)), "larger than 1 MiB"),
    ],
)
def test_file(tmp_path: Path, make, problem: str) -> None:
    path = tmp_path / "study.yaml"
    make(path)
    with pytest.raises(StudyError) as refused:
        read_study(path)
    (mistake,) = refused.value.mistakes
    assert problem in mistake.problem
    assert mistake.file == str(path)
    assert mistake.line == (2 if "UTF" in problem else None)


def test_path_with_a_null_character() -> None:
    with pytest.raises(StudyError, match="null"):
        read_study("a\0b")


def drawn(path: str, points: int = 4) -> str:
    return f"{{sample: random, points: {points}, of: {{{path}: [0, 1]}}}}"


NODES = [
    ("output: {interval: 0.3}", "output.interval", "does not divide"),
    ("output: {interval: 1.0e+3}", "output.interval", "is longer than the duration"),
    ("output: {interval: 1.0e-320}", "output.interval", "samples of every history"),
    ("axes: {mechanical_modes: 3}", "axes.mechanical_modes", "more than the 2"),
    ("axes: {thermal_modes: [2, full]}", "axes.thermal_modes", "has `2` twice"),
    ("axes: {mechanical_modes: auto}", "axes.mechanical_modes", "is `auto` without a `tolerance`"),
    ("axes: {thermal_modes: automatic}", "axes.thermal_modes", "`automatic` is not a number of modes"),
    ("axes: {tolerance: full}", "axes.tolerance", "is not a pure number"),
    ("reference: {thermal_modes: auto}", "reference.thermal_modes", "is `auto` without a `tolerance`"),
    ("reference: {tolerance: 0.1}", "reference.tolerance", "decides nothing"),
    ("axes: {scene.chain.nodes: [2, 3], mechanical_modes: [1, full]}", "axes.mechanical_modes", "nodes varies"),
    ("axes: {scene.chain.nodes: [2, 3], mechanical_modes: 2}", "axes.mechanical_modes", "more than the 1"),
    ("axes: {scene.chain.nodes: [2, 3]}\nreference: {thermal_modes: 2}", "reference.thermal_modes", "more than the 1"),
    ("axes: {scene.chain.nodes: {lin: [2, 5, 3]}}", "axes.scene.chain.nodes.lin", "not whole numbers"),
    ("zip: {a: {}}", "zip.a", "is empty"),
    ("zip: {a: {sample: random, points: 4, of: {e: [0.5, 0]}}}", "zip.a.of.e", "is not from low to high"),
    ("zip: {a: {sample: random, points: 4, of: {e: {log: [0, 1]}}}}", "zip.a.of.e.log", "needs positive ends"),
    ("zip: {a: {sample: random, points: 4, of: {h: [1e-5, 1e-4]}}}", "zip.a.of.h", "does not belong here"),
    ("zip: {a: {sample: random, points: 4, of: {}}}", "zip.a.of", "has 0 numbers"),
    ("zip: {a: {sample: sobol_indices, points: 4, of: {e: [0, 1]}}}", "zip.a.of", "has 1 numbers"),
    ("zip: {a: {sample: sobol_indices, points: 12, of: {e: [0, 1], alpha: [0, 1]}}}", "zip.a.points", "power of two"),
    ("zip: {a: {sample: sobol_indices, points: 524288, of: {e: [0, 1], alpha: [0, 1]}}}", "zip.a.points", "2097152"),
    (f"axes: {{h: {{lin: [1e-5, 1e-4, 1000]}}}}\nzip: {{a: {drawn('e', 10**6)}}}", "axes", "make 1e+09 cases"),
    (f"zip: {{a: {drawn('e')}, b: {drawn('alpha')}}}", "zip.b", "and so is another zip"),
    ("axes: {e: 0}\nzip: {a: {sample: random, points: 4, of: {e: [0, 1]}}}", "zip.a.of.e", "is an axis already"),
    ("axes: {scene.initial: [static]}", "axes.scene.initial", "does not belong"),
    ("schemes: {moreau: 3}", "schemes.moreau", "not a mapping"),
    ("axes:", "axes", "has nothing in it"),
]


@pytest.mark.parametrize(("lines", "key", "problem"), NODES)
def test_added_lines(lines: str, key: str, problem: str) -> None:
    mistakes = mistakes_of(f"{CHAIN}{lines}\n")
    assert [mistake.key for mistake in mistakes] == [key], "\n".join(map(str, mistakes))
    assert problem in mistakes[0].problem
    first = key.partition(".")[0]
    assert mistakes[0].line == 6 + lines[: lines.index(f"{first}:")].count("\n")


def test_lists_per_node_must_fit_every_number_of_nodes() -> None:
    listed = CHAIN.replace("mass: 1 g", "mass: [1 g, 2 g, 3 g]")
    assert parse_study(listed, "f").scene.parameters.mass == (1e-3, 2e-3, 3e-3)
    assert parse_study(f"{listed}axes: {{scene.chain.nodes: [3]}}\n", "f").dimensions[0].size == 1
    (mistake,) = mistakes_of(f"{listed}axes: {{scene.chain.nodes: [2, 3]}}\n")
    assert mistake.key == "scene.chain.mass"
    assert mistake.remedy == "write a scalar"


def test_static_start_has_no_axis() -> None:
    text = CHAIN.replace("  duration", "  initial: static\n  duration")
    (mistake,) = mistakes_of(f"{text}axes: {{scene.initial.velocity: [0, 1]}}\n")
    assert (mistake.key, mistake.line) == ("axes.scene.initial.velocity", 7)


def test_two_models_and_no_model() -> None:
    blade = "{nodes: 3, length: 1, width: 1, thickness: 1, density: 1, specific_heat: 1, conductivity: 1}"
    (second,) = mistakes_of(CHAIN.replace("  casing", f"  blade: {blade}\n  casing"))
    assert (second.key, second.line) == ("scene.blade", 4)
    (unknown,) = mistakes_of(CHAIN.replace("chain: {", "truss: {") + "axes: {scene.truss.mass: [1, 2]}\n")
    assert (unknown.key, unknown.line) == ("scene.truss", 3)
    (none,) = mistakes_of("study: a\nscene: {casing: {gap: 1}, duration: 1}\n")
    assert (none.key, none.line) == ("scene", 2)
    assert "`blade`, `chain`" in none.remedy


def test_mistakes_of_entries_come_at_once_in_the_order_of_the_file_then_those_between_them() -> None:
    entries = {
        "scene.blade.length": ("length: 40 mm", "length: 40 kg"),
        "scene.casing.colour": ("gap: 20 um}", "gap: 20 um, colour: red}"),
        "scene.wind": ("duration: 2 s", "duration: 2 s\n  wind: 3"),
        "schemes.midpoint.theta": ("theta: 0.5", "theta: half"),
        "axes.e[3]": ("0.9]", "0.9, 7]"),
        "axes.alpha": ("alpha: [0, 30]", "alpha: []"),
        "output.precision": ("float64", "float65"),
    }
    between = {"zip.model": ("[4, 12, full]", "[4, 12]"), "output.interval": ("interval: 1 ms", "interval: 3 ms")}
    for changes in (entries, between):
        text, keys = BLADE, list(changes)
        for old, new in changes.values():
            text = text.replace(old, new)
        mistakes = mistakes_of(text)
        assert [mistake.key for mistake in mistakes] == keys
        assert [mistake.line for mistake in mistakes] == sorted(mistake.line or 0 for mistake in mistakes)


def test_the_start_is_judged_in_every_case_and_zips_pair_up() -> None:
    start = "scene.initial.displacement: [0, 30 um], scene.casing.gap: [10 um, 40 um]"
    assert parse_study(f"{CHAIN}zip: {{start: {{{start}}}}}\n", "f").dimensions[0].size == 2
    (mistake,) = mistakes_of(f"{CHAIN}axes: {{{start}}}\n")
    assert mistake.key == "axes.scene.initial.displacement"
    assert "3e-05 m with a gap of 1e-05 m" in mistake.problem
    touching = CHAIN.replace("  duration", "  initial: {displacement: 20 um}\n  duration")
    assert parse_study(touching, "f").scene.initial.displacement == 2e-5
    (closed,) = mistakes_of(CHAIN.replace("20 um", "-1 um"))
    assert closed.key == "scene.casing.gap"
    assert parse_study(CHAIN.replace("20 um}", "-1 um}\n  initial: static"), "f").scene.initial == "static"


NO_YAML = [
    ("scene:\n  a: 1\n b: 2\n", 3, "wrong indentation"),
    ("study: a\nscene:\n  a:1\n  b: 2\n", 4, "a colon without a space after it"),
    ("title: a: b\n", 1, "a text that needs quotes, as one with `: ` in it"),
    ("scene:\n\ta: 1\n", 2, "a tab"),
    ("a: [1, 2\nb: 3\n", 2, "a bracket or a quote that is not closed"),
    ("a: 'x\nb: 2\n", 3, "a bracket or a quote that is not closed"),
    ("a: @x\n", 1, "a text that needs quotes"),
]


@pytest.mark.parametrize(("text", "line", "cause"), NO_YAML)
def test_what_is_no_yaml_has_its_line_and_the_usual_causes(text: str, line: int, cause: str) -> None:
    (mistake,) = mistakes_of(text)
    assert (mistake.line, cause in mistake.remedy) == (line, True)
    assert mistake.problem.startswith("is not YAML, here or just above (")


@pytest.mark.parametrize("name", ["blade.npz", "blade.mtx", "modes.CSV"])
def test_a_file_that_a_study_names_is_no_study(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"\x93NUMPY")
    with pytest.raises(StudyError, match=f"is no study; write one that names it.*{name}"):
        read_study(tmp_path / name)
