"""What a study is told of a contact spring whose casing slides: the limit is that with its own friction."""

from pathlib import Path

import numpy as np
import pytest

from sliding import TANGENT
from studies import parsed, solve_all
from workflow.plan import plan_study
from workflow.schemes import Status

KAPPA, FRICTION = 1e3, 0.9
MASS, STIFFNESS = np.array([[0.01, 0.05], [0.05, 1.0]]), np.array([[100.0, -3.0], [-3.0, 100.0]])
"""A light degree of freedom along the tangent that the tip's mass drags along: friction makes W 5.5 times as large."""


def limit(friction: float) -> float:
    """0.95 · 2/ω_max of the matrices, or 0.5/√(κW) where that is less, s."""
    push = np.array([-friction, 1.0])
    fastest = np.linalg.eigvals(np.linalg.solve(MASS, STIFFNESS + KAPPA * np.outer(push, [0.0, 1.0]))).real.max()
    yields = np.linalg.solve(MASS, push)[1]
    return float(min(0.95 * 2 / np.sqrt(fastest), 0.5 / np.sqrt(KAPPA * yields)))


def study(directory: Path, h: float, friction: str, balances: bool = True) -> str:
    np.savez(directory / "slider.npz", mass=MASS, stiffness=STIFFNESS)
    return (
        f"study: s\nscene:\n  matrices: {{file: {directory / 'slider.npz'}, contact: 1, tangent: {TANGENT}}}\n"
        "  casing: {gap: 5 mm}\n  load: {mean: 0.3, amplitude: 1, frequency: 2 Hz}\n"
        f"  friction: {{coefficient: {FRICTION}, sliding_speed: 1, heat_share: 0}}\n  duration: 30 s\n"
        f"schemes: {{stiff: {{method: penalty, stiffness: {KAPPA}}}}}\n"
        f"axes: {{scheme: stiff, h: {h}, {friction}}}\n"
        f"output: {{interval: 30 s, histories: [displacement], balances: {str(balances).lower()}}}\n"
    )


def test_plan_says_the_limit_of_the_largest_friction(tmp_path: Path) -> None:
    h = 0.9 * limit(0.0)
    assert limit(FRICTION) < h
    still = plan_study(parsed(study(tmp_path, h, "scene.friction.coefficient: [0]")))
    assert not any("is unstable in contact" in warning for warning in still.warnings)
    sliding = plan_study(parsed(study(tmp_path, h, f"scene.friction.coefficient: [0, {FRICTION}]")))
    (warning,) = [warning for warning in sliding.warnings if "is unstable in contact" in warning]
    assert f"above a step of {limit(FRICTION):.6g} s" in warning


@pytest.mark.parametrize("balances", [True, False])
def test_a_case_that_slides_away_is_not_ok(tmp_path: Path, balances: bool) -> None:
    """At the limit without friction it comes 1e22 m far, with an energy balance that the casing's drive closes."""
    text = study(tmp_path, limit(0.0), "scene.friction.coefficient: [0, 0.9]", balances)
    (results,) = solve_all(text)
    assert results.values["status"].tolist() == [Status.OK, Status.DIVERGED]
    assert "the tip moved" in results.messages[1]
    (again,) = solve_all(study(tmp_path, limit(FRICTION), "scene.friction.coefficient: [0, 0.9]", balances))
    assert again.values["status"].tolist() == [Status.OK, Status.OK]
