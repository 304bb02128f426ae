"""Errors against a reference: what they compare, what is computed how often, what is lost with it."""

from __future__ import annotations

import numpy as np
import pytest

from studies import SCENE, parsed
from workflow import schemes
from workflow.grid import arrange, solve

REFERRED = (
    "study: a\n"
    + SCENE
    + """
schemes: {midpoint: {method: moreau, theta: 0.5}}
axes: {scheme: [moreau, midpoint], h: [1e-4, 1e-5], alpha: [0, 5, 20], e: [0, 0.5]}
zip: {model: {mechanical_modes: [1, full], thermal_modes: [2, full]}}
reference: {scheme: midpoint, h: 1e-5, mechanical_modes: full, thermal_modes: full}
output: {interval: 1 ms}
"""
)


def test_errors_are_relative_distances_from_the_reference() -> None:
    grid = arrange(parsed(REFERRED))
    inner = np.arange(grid.inner_count)
    found = [solve(grid, outer, inner).values for outer in range(grid.outer_count)]
    truth_at = next(
        outer
        for outer in range(grid.outer_count)
        if (c := grid.settings(outer)).scheme.label == "midpoint" and c.h == 1e-5 and c.mechanical_modes == 3
    )
    truth = found[truth_at]
    assert np.all(truth["displacement_error"] == 0)
    assert np.all(truth["impulse_error"] == 0)
    for values in found:
        for name in ("displacement", "temperature", "impulse"):
            size = np.linalg.norm(truth[name], axis=1)
            expected = np.linalg.norm(values[name] - truth[name], axis=1)
            expected = np.divide(expected, size, out=np.zeros_like(size), where=size > 0)
            assert np.allclose(values[f"{name}_error"], expected, rtol=1e-12)
    cold = grid.inner_values(inner)["alpha"] == 0
    assert np.all(found[0]["temperature_error"][cold] == 0)  # both are identically zero
    assert np.all(found[0]["impulse_error"] > 0)


def test_each_distinct_reference_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    moreau = schemes.load("moreau")
    compute, counted = moreau.compute, []

    def counting(operator: object, cases: schemes.Cases, over: schemes.Sampling) -> schemes.Results:
        counted.append((operator.theta, operator.h, cases.count))  # type: ignore[attr-defined]
        return compute(operator, cases, over)

    monkeypatch.setattr(moreau, "compute", counting)
    text = REFERRED.replace("h: 1e-5, mechanical", "h: 2e-5, e: 0, mechanical")
    grid = arrange(parsed(text))
    for outer in range(grid.outer_count):
        solve(grid, outer, np.arange(grid.inner_count))
    references = [count for theta, h, count in counted if h == 2e-5]
    assert references == [3, 3]  # one per alpha, and once more with the gap opened by 1e-12


def test_a_reference_that_fails_leaves_no_error_number() -> None:
    text = REFERRED.replace("alpha: [0, 5, 20]", "alpha: [0, 1e15]")
    grid = arrange(parsed(text))
    inner = np.arange(grid.inner_count)
    found = solve(grid, 0, inner).values
    hot = grid.inner_values(inner)["alpha"] > 0
    assert np.isnan(found["displacement_error"][hot]).all()
    assert np.isfinite(found["displacement_error"][~hot]).all()


def test_a_reference_that_raises_harms_no_case() -> None:
    """One load of three moves the free body for ever: that case fails, the others have their errors."""
    text = """
study: a
scene:
  chain: {nodes: 3, mass: 1, stiffness: [0, 2, 2], heat_capacity: 1}
  casing: {gap: 0.1}
  initial: static
  duration: 1
axes: {scene.load.mean: [1, -1, 2], h: 1e-3}
reference: {scheme: event_driven}
"""
    grid = arrange(parsed(text))
    found = solve(grid, 0, np.arange(3))
    assert found.values["status"].tolist() == [0, 3, 0]
    assert list(found.messages) == [1]
    assert np.isnan(found.values["impulse_error"][1])
    assert np.all(found.values["impulse_error"][[0, 2]] < 1e-9)


def test_an_axis_that_only_the_reference_reads_makes_cases_of_its_own() -> None:
    text = "study: a\n" + SCENE + "axes: {scheme: event_driven, h: [1e-3, 1e-5]}\nreference: {scheme: moreau}\n"
    grid = arrange(parsed(text))
    assert grid.places == {0: (0,), 1: (1,)}
    coarse, fine = (solve(grid, outer, np.arange(1)).values["displacement_error"][0] for outer in (0, 1))
    assert coarse > 3 * fine > 0
    replaced = arrange(parsed(text.replace("moreau}", "moreau, h: 1e-5}")))
    assert replaced.places == {0: (0, 1)}
