"""Small studies that tests of the workflow floor run."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from workflow.archive import provenance
from workflow.cases import arrange
from workflow.pinning import is_pinned
from workflow.run import _verify, run_study
from workflow.solve import Solved, solve
from workflow.solve import _tasks as cutting
from workflow.study import Study, StudyError, parse_study

pinned = pytest.mark.skipif(not is_pinned(), reason="the environment chooses other machine code, or there is no choice")
"""Mark of a test that expects the same bits."""

SCENE = """
scene:
  chain: {nodes: 4, mass: 2.5e-3, stiffness: 4.0e6, damping: {mass: 10, stiffness: 2.0e-7}, spacing: 2.5e-3,
          expansion: 8.6e-6, heat_capacity: 1.3, conductance: 0.6, convection: 0.02}
  casing: {gap: 50 um}
  load: {amplitude: 100, frequency: 50 Hz}
  duration: 60 ms
"""

HEAVY_SCENE = """
scene:
  chain: {nodes: 20, mass: 2.5e-3, stiffness: 2.0e7, damping: {mass: 10, stiffness: 2.0e-7}, spacing: 2.5e-3,
          expansion: 8.6e-6, heat_capacity: 1.315, conductance: 0.605, convection: 0.02}
  casing: {gap: 5.0e-5}
  load: {amplitude: 100, frequency: 20}
  duration: 0.3
"""
"""The chain of ``scenes.heavy_chain`` under a load."""

BLADE_SCENE = """
scene:
  blade: {nodes: 20, length: 40 mm, width: 30 mm, thickness: 1 mm, density: 4430, specific_heat: 560,
          conductivity: 7.0, convection: 400, expansion: 9.0e-6, tip_stiffness: 1.0e6,
          damping: {mass: 10.0, stiffness: 2.0e-7}}
  casing: {gap: 20 um}
  load: {amplitude: 24, frequency: 5 Hz}
  duration: 2 s
"""
"""The blade of ``scenes.blade_rub``."""

FALLING_BALL = """
scene:
  chain: {nodes: 1, mass: 2, stiffness: 0, heat_capacity: 1}
  casing: {gap: 1}
  load: {mean: 19.62}
  duration: 3
"""
"""2 kg that fall 1 m and bounce."""

PRESSED = """
scene:
  chain: {nodes: 1, mass: 1, stiffness: 1, damping: {mass: 0.5}, heat_capacity: 1}
  casing: {gap: 0}
  load: {mean: 2}
  initial: {velocity: -1}
  duration: 1000
schemes: {exact: {method: event_driven, events: 2000}}
reference: {scheme: exact}
"""
"""A damped tip pressed onto its casing: with e near 1 its reference fails, as bounces have no end."""

SMALL = (
    "study: small\ntitle: A chain of four nodes that rubs\n"
    + SCENE
    + """
axes:
  h: [1e-4, 2e-4]
  e: [0, 0.5, 0.9]
  alpha: [0, 5, 10, 20, 50]
zip:
  model: {mechanical_modes: [1, full], thermal_modes: [2, full]}
output: {interval: 1 ms, histories: [displacement, contact_force]}
"""
)

ILL = (
    "study: ill\ntitle: Some cases are ill-posed\n"
    + SCENE
    + """
axes:
  h: 1e-3
  alpha: [0, 1e9, 5, 2e9]
  e: [0, 0.5]
output: {interval: 1 ms}
"""
)

CHAOS = """
study: chaos
scene:
  chain: {nodes: 3, mass: 1.0e-3, stiffness: 1.0e6, damping: {mass: 5}, heat_capacity: 1}
  casing: {gap: 0}
  load: {amplitude: 5, frequency: FREQUENCY}
  duration: DURATION
axes: {scheme: event_driven, e: 0.9}
"""
"""Impacts in chaos, whose motion is known to a few digits, or to none after a longer time."""

SINGLE = "study: single\n" + SCENE + "output: {interval: 1 ms}\n"


def parsed(text: str) -> Study:
    return parse_study(text, "study.yaml")


def refusal(read: Callable[..., object], *words: Any, **named: Any) -> str:
    """Return what is said of the one mistake for which a study is refused."""
    with pytest.raises(StudyError) as refused:
        read(*words, **named)
    (mistake,) = refused.value.mistakes
    return str(mistake)


def solve_all(text: str) -> list[Solved]:
    """Return what each operator of a study gave for all of its cases."""
    grid = arrange(parsed(text))
    return [solve(grid, outer, np.arange(grid.inner_count)) for outer in grid.computed.tolist()]


def written(text: str, directory: Path, name: str = "study.yaml") -> Path:
    path = directory / name
    path.write_text(text, encoding="utf-8")
    return path


def archived(study: Study) -> Any:
    """Return a fixture: the archive of a study, which is run once for a module."""

    @pytest.fixture(scope="module")
    def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
        return run_study(study, tmp_path_factory.mktemp("archived") / f"{study.name}.nc").archive

    return archive


def cut_finely(patch: pytest.MonkeyPatch, cases: int | None = None) -> None:
    """Make a task of so many cases that are missing, else of as many as a row along the innermost dimension has."""
    patch.setattr(cutting, "LONGEST", 1e-9)
    patch.setattr(cutting, "unit", lambda grid, *_: cases or (grid.inner_shape[-1] if grid.inner else 1))


def judged_within_rounding(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have an archive verified as one of the packages and code here, on another processor."""
    texts = provenance(path)
    monkeypatch.setattr(_verify.archive, "code_revision", lambda: texts["code_revision"])
    monkeypatch.setattr(_verify.archive, "versions", lambda: json.loads(texts["versions"]))
    monkeypatch.setattr(_verify, "is_pinned", lambda: False)


def steady_study(axes: dict[str, Any], steady: Any = True) -> Study:
    """A study of the blade with some axes beside its modes, which asks for steady rubs."""
    axes = {"scheme": "event_driven", "mechanical_modes": 3, "thermal_modes": 12, **axes}
    output = {"interval": 0.1, "histories": ["displacement"], "steady": steady}
    return parsed(f"study: steady\n{BLADE_SCENE}\naxes: {json.dumps(axes)}\noutput: {json.dumps(output)}\n")
