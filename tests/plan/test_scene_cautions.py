"""What plan warns of in a scene: a tip that stays clear, soft contact springs, bases."""

from pathlib import Path

import pytest

from matrix_files import as_npz, matrices_of
from scenes import heavy_chain
from studies import BLADE_SCENE, parsed, written
from workflow.cases import arrange
from workflow.models import static_growth
from workflow.plan import plan, plan_study
from workflow.study import read_study

BLADE = f"study: a{BLADE_SCENE}".replace("nodes: 20", "nodes: 30, tip_cell: 60 um").replace(
    "stiffness: 2.0e-7}", "stiffness: 2.0e-7}HEATING"
)


def warnings(text: str, heating: str = "") -> list[str]:
    grid = arrange(parsed(text.replace("HEATING", heating)))
    return list(plan(grid).warnings)


def test_a_plausible_scene_has_nothing_to_say() -> None:
    assert warnings(BLADE + "axes: {scheme: event_driven, alpha: [0, 30]}\n") == []


def test_a_gap_in_metres_cannot_be_reached() -> None:
    """``gap: 20`` was meant as 20 um: 24 N on 1e6 N/m move the tip by 24 um."""
    (warning,) = warnings(BLADE.replace("20 um", "20") + "axes: {scheme: event_driven}\n")
    assert warning.startswith("the tip cannot reach the casing at gap = 20 m: without contact it stays below 24 µm")


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_reach_that_overflows_is_no_reach_that_falls_short() -> None:
    """2e308 N is beyond the numbers: the bound of the motion is inf - inf, which said that the tip stays clear."""
    huge = BLADE.replace("amplitude: 24", "mean: 1.0e+308, amplitude: 1.0e+308")
    lines = warnings(huge + "axes: {scheme: event_driven}\n")
    assert not [line for line in lines if "nan" in line or "cannot reach" in line]


def test_a_caution_names_only_gaps_that_no_case_reaches() -> None:
    axes = "axes: {scheme: event_driven, scene.casing.gap: [20 um, 40 um, 1 mm], scene.load.amplitude: [24, 60]}\n"
    (warning,) = [line for line in warnings(BLADE + axes) if "cannot reach" in line]
    assert "gap = 0.001 m:" in warning


def test_heat_and_a_static_start_count_as_reach() -> None:
    start = BLADE.replace("amplitude: 24, frequency: 5 Hz", "mean: 24")
    start = start.replace("  duration", "  initial: static\n  duration")
    assert not [line for line in warnings(start + "axes: {scheme: event_driven}\n") if "cannot reach" in line]
    cold = BLADE.replace("amplitude: 24, frequency: 5 Hz", "mean: 0")
    assert [line for line in warnings(cold + "axes: {scheme: event_driven}\n") if "cannot reach" in line]
    hot = warnings(cold + "axes: {scheme: event_driven}\n", ", heating: 5")
    assert not [line for line in hot if "cannot reach" in line]


def test_a_spring_softer_than_the_tip_gives_a_caution() -> None:
    text = "schemes: {soft: {method: penalty, stiffness: 5.0e5, integration: implicit}, hard: {method: penalty, "
    text += "stiffness: 2.0e8, integration: implicit}}\naxes: {scheme: [soft, hard], h: 1e-5}\n"
    matching = [line for line in warnings(BLADE + text) if "softer" in line]
    assert len(matching) == 1
    assert matching[0].startswith("the contact spring of soft, 5e+05 N/m, is softer than the tip, 1e+06 N/m")


@pytest.mark.parametrize(("modes", "lost"), [("full", False), ("3", True)])
def test_what_a_basis_cannot_hold_gives_a_caution(modes: str, lost: bool) -> None:
    heat = ", heating: [" + ", ".join("1" if node == 7 else "0" for node in range(30)) + "]"
    text = BLADE + f"axes: {{scheme: event_driven, mechanical_modes: {modes}, thermal_modes: {modes}}}\n"
    matching = [line for line in warnings(text, heat) if "projection_residual" in line]
    assert bool(matching) == lost
    assert all("lose 80 %" in line and "and 0.00 % of it at the contacts" in line for line in matching)


def test_heat_that_moves_the_tip_away_gives_a_caution(tmp_path: Path) -> None:
    """K12 of the wrong sign: every alpha is stable, which looks like a sound structure."""
    entries = matrices_of(heavy_chain(nodes=4))
    axes = "axes: {scheme: event_driven, alpha: ALPHA}"
    text = (
        "study: a\nscene:\n  matrices: {file: blade.npz, contact: 3}\n  casing: {gap: 20 um}\n"
        "  load: {amplitude: 400, frequency: 5 Hz}\n  duration: 0.1 s\n"
    )
    by_case = {}
    for sign in (1, -1):
        as_npz({**entries, "coupling": sign * entries["coupling"]}, tmp_path)
        for alpha in (0, 1):
            study = read_study(written(text + axes.replace("ALPHA", str(alpha)), tmp_path))
            by_case[sign, alpha] = [line for line in plan_study(study).warnings if "away from the casing" in line]
    assert [len(lines) for lines in by_case.values()] == [0, 0, 0, 1]
    growth = static_growth(heavy_chain(nodes=4))[0] @ heavy_chain(nodes=4).thermal.constraint[:, 0]
    assert f"{growth:.3g} m for each kelvin" in by_case[-1, 1][0]
