"""Schemes with stability limits, options that vary, and metrics that others do not give."""

import numpy as np
import pytest

from studies import SCENE, parsed
from workflow.cases import arrange
from workflow.plan import plan, template
from workflow.schemes import Status, names
from workflow.solve import solve
from workflow.solve._variables import metrics_of

LIMIT = 2 / (2 * np.sqrt(4e6 / 2.5e-3) * np.sin(7 * np.pi / 18))
"""2/ω_max of the four nodes, whose tip has a whole mass: ω_j = 2 √(k/m) sin((2j-1)π/18)."""


def study(axes: str, schemes: str = "", output: str = "{interval: 1 ms}") -> str:
    return "study: a\n" + SCENE + f"{schemes}\naxes: {axes}\noutput: {output}\n"


def test_a_plan_tells_of_limits() -> None:
    """Above 2/ω_max the free step grows; the penalty spring has a limit of its own."""
    defined = "schemes: {stiff: {method: penalty, stiffness: 2.0e7}, soft: {method: penalty, stiffness: 1.0e5}}"
    steps = (0.9 * LIMIT, 1.1 * LIMIT)
    text = study(f"{{scheme: [carpenter, stiff, soft], h: [{steps[0]}, {steps[1]}]}}", defined)
    grid = arrange(parsed(text))
    warnings = plan(grid).warnings
    for scheme in ("carpenter", "stiff", "soft"):
        (grows,) = [line for line in warnings if line.startswith(f"{scheme} diverges, its free step grows")]
        assert f"{steps[1]:.3g} s" in grows
        assert f"{steps[0]:.3g} s" not in grows
    (contact,) = [line for line in warnings if "is unstable in contact above a step of" in line]
    assert contact.startswith("stiff")
    for outer in grid.computed.tolist():
        solved = solve(grid, outer, np.arange(1))
        cell = grid.settings(outer)
        created = solved.values["energy_residual"][0]
        stiff = cell.scheme.label == "stiff"
        blown_up = cell.h > LIMIT or created > 1
        assert solved.values["status"][0] == (Status.DIVERGED if blown_up else Status.OK), cell
        if cell.h < LIMIT:  # growth in contact throws the tip out, with energy from nowhere
            assert created > 0.5 if stiff else abs(created) < 0.1, cell.scheme.label


def test_contact_stiffness_is_an_axis() -> None:
    text = study(
        "{scheme: [soft, moreau], h: 1e-5, schemes.soft.stiffness: [1.0e6, 1.0e7 N/m], schemes.soft.damping: [0, 1]}",
        "schemes: {soft: {method: penalty}}",
    )
    grid = arrange(parsed(text))
    assert {name for name, _ in grid.dims} >= {"stiffness", "damping"}
    assert plan(grid).unique == 4 + 1
    sunk = {}
    for outer in grid.computed.tolist():
        cell = grid.settings(outer)
        if cell.scheme.label == "soft":
            options = cell.scheme.options
            sunk[options.stiffness, options.damping] = solve(grid, outer, np.arange(1)).values["max_penetration"][0]
    assert sunk[1e6, 0] > 3 * sunk[1e7, 0] > 0
    assert len(set(sunk.values())) == 4


@pytest.mark.parametrize("method", names())
def test_metrics_of_some_schemes(method: str) -> None:
    """A study has them if one of its schemes gives them; where another runs they are NaN."""
    study_of = parsed(study(f"{{scheme: {method}, h: 1e-5}}"))
    grid = arrange(study_of)
    declared = set(template(grid).data_vars)
    assert {about.name for about in metrics_of(study_of)} <= declared
    assert ("effective_restitution" in declared) == (method in ("carpenter", "penalty"))
    mixed = arrange(parsed(study(f"{{scheme: [{method}, carpenter], h: 1e-5}}") if method != "carpenter" else SINGLE))
    restitution = solve(mixed, 0, np.arange(1)).values["effective_restitution"]
    assert np.isnan(restitution[0]) == (method not in ("carpenter", "penalty"))


SINGLE = study("{scheme: carpenter, h: 1e-5}")
