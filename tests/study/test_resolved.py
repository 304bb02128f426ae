"""Every value of a study as plan tells it: in SI, with its unit, and what was left to its default."""

from pathlib import Path

import pytest

from studies import parsed, written
from workflow.study import ResolvedValue, StudyError, read_study, resolved_values

TEXT = """
study: a
scene:
  chain: {nodes: 2, mass: [2 g, 3 g], stiffness: 1.0e6, heat_capacity: 1}
  casing: {gap: 20 um}
  load: {amplitude: 10, frequency: 600 rpm}
  duration: 1 ms
schemes: {half: {method: moreau, theta: 0.5}}
axes: {scheme: [half, event_driven], e: 0.5, scene.load.phase: [0, 90 deg], h: 1e-5}
zip: {model: {mechanical_modes: [0, full], thermal_modes: [0, full]}}
"""


def resolved_by_path(text: str) -> dict[str, ResolvedValue]:
    study = parsed(text)
    axes = [axis for dimension in study.dimensions for axis in dimension.axes]
    cell = study.cell({axis.path: axis.values[0] for axis in (*study.scalars, *axes)})
    return {value.path: value for value in resolved_values(study, cell)}


def test_counts_that_a_tolerance_decides_are_told_as_they_are_written() -> None:
    axes = "axes: {scheme: [half, event_driven], mechanical_modes: [1, auto], thermal_modes: auto, tolerance: 0.01}"
    values = resolved_by_path(TEXT[: TEXT.index("axes:")] + axes)
    assert values["mechanical_modes"].text == "1, auto"
    assert values["thermal_modes"] == ResolvedValue("thermal_modes", ("auto",), "1", "study")
    assert values["tolerance"] == ResolvedValue("tolerance", (0.01,), "1", "study")
    assert "tolerance" not in resolved_by_path(TEXT)


def test_values_units_and_origins() -> None:
    values = resolved_by_path(TEXT)
    assert values["scene.casing.gap"] == ResolvedValue("scene.casing.gap", (2e-5,), "m", "study")
    assert values["scene.chain.mass"] == ResolvedValue("scene.chain.mass", (0.002, 0.003), "kg", "study")
    assert values["scene.load.frequency"].values == (10.0,)
    assert values["scene.load.mean"] == ResolvedValue("scene.load.mean", (0.0,), "N", "default")
    assert values["scene.load.phase"].origin == "axis"
    assert values["scene.duration"] == ResolvedValue("scene.duration", (1e-3,), "s", "study")
    assert values["scene.chain.damping.mass"].origin == "default"
    assert (values["e"].origin, values["e"].values) == ("study", (0.5,))
    assert (values["alpha"].origin, values["alpha"].values) == ("default", (0.0,))
    assert values["mechanical_modes"] == ResolvedValue("mechanical_modes", (0, 1), "1", "axis")
    assert values["schemes.half.theta"].origin == "study"
    assert values["schemes.event_driven.events"].origin == "default"
    assert values["output.interval"] == ResolvedValue("output.interval", (1e-6,), "s", "default")
    assert values["scene.chain.mass"].text == "0.002, 0.003 kg"
    assert ResolvedValue("a", tuple(map(float, range(10))), "m", "axis").text == "0, 1, …, 9 (10 values) m"


def test_a_static_start_is_listed_once() -> None:
    values = resolved_by_path(TEXT.replace("  duration", "  initial: static\n  duration"))
    start = values["scene.initial.displacement"]
    assert (start.text, start.origin) == ("static", "study")
    assert "scene.initial.velocity" not in values


def test_values_of_a_table_have_the_units_of_its_columns() -> None:
    model = "modes: {table: [[1.2 kHz, 50 %, 14.1]], heat: [[30 1/min, 2 K**0.5/mJ**0.5]]}"
    parameters = parsed(f"study: a\nscene: {{{model}, casing: {{gap: 1e-5}}, duration: 1 ms}}\n").scene.parameters
    assert parameters.table == ((1200.0, 0.5, 14.1),)
    assert parameters.heat == ((0.5, pytest.approx(2 * 1000**0.5)),)
    with pytest.raises(StudyError, match=r"heat\[0\]\[1\]: `2 m` is not in K"):
        parsed(f"study: a\nscene: {{{model.replace('2 K**0.5/mJ**0.5', '2 m')}, casing: {{gap: 1}}, duration: 1}}\n")


def test_files_and_tables_are_listed(tmp_path: Path) -> None:
    (tmp_path / "heat.csv").write_text("rate,tip\n0.5,2\n")
    model = "  modes: {table: [[1200, 0.005, 14.1], [3000, 0.005, 9]], heat: heat.csv}\n  casing: {gap: 1e-5}\n"
    study = read_study(written(f"study: a\nscene:\n{model}  duration: 1 ms\n", tmp_path))
    cell = study.cell({axis.path: axis.values[0] for axis in study.scalars})
    listed = {value.path: value.text for value in resolved_values(study, cell)}
    assert listed["scene.modes.table"] == "2 rows"
    assert listed["scene.modes.heat"] == "heat.csv"
    assert "scene.modes.coupling" not in listed
