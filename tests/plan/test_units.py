"""What plan warns of where a unit was meant otherwise, and the α that friction makes."""

import re

import pytest

from studies import BLADE_SCENE, FALLING_BALL, parsed, refusal
from workflow.plan import plan_study

AXES = "axes: {scheme: event_driven, e: [0, 0.5]}\n"
STUDY = f"study: a{BLADE_SCENE}".replace("nodes: 20", "nodes: 20, tip_cell: 60 um") + AXES


def warnings(text: str) -> str:
    return "\n".join(plan_study(parsed(text)).warnings)


def alpha(text: str) -> str:
    return {one.path: f"{one.text} {one.origin}" for one in plan_study(parsed(text)).scene}["alpha"]


def test_revolutions_per_minute_are_no_hertz() -> None:
    scene = STUDY.replace("  duration", "  speed: 9000\n  duration")
    said = "a speed of 9000 Hz is 540000 rpm: check its unit, Hz or e.g. `9000 rpm`"
    assert said in warnings(scene)
    assert said in warnings(STUDY.replace("e: [0, 0.5]", "scene.speed: {lin: [3000, 9000, 3]}"))
    assert "speed" not in warnings(scene.replace("9000", "9000 rpm"))


def test_alpha_stands_beside_the_friction_of_which_it_is_made_and_its_critical_value() -> None:
    from workflow.cli._studies import _lines

    text = STUDY.replace(
        "  duration", "  friction: {coefficient: 0.2, sliding_speed: 150, heat_share: 0.5}\n  duration"
    )
    assert alpha(text) == "15 W/N study"
    made = plan_study(parsed(text.replace("e: [0, 0.5]", "scene.friction.coefficient: [0.1, 0.2]")))
    shown = [line.strip() for line in _lines(made)]
    (at,) = (k for k, line in enumerate(shown) if line.startswith("alpha "))
    assert shown[at].endswith("7.5, 15 W/N   (varied)   = coefficient × sliding_speed × heat_share")
    assert shown[at - 1].startswith("scene.")
    low, high = (made_of / made.structures[0].critical_alpha for made_of in (7.5, 15))
    assert any(line.endswith(f"; alpha is {low:.3g} to {high:.3g} times that") for line in shown)
    assert not any("times that" in line or "× sliding" in line for line in _lines(plan_study(parsed(STUDY))))


def test_per_cent_are_no_ratios() -> None:
    said = "a damping ratio of 3 is overcritical: if per cent are meant, write 0.03"
    ratio = STUDY.replace("damping: {mass: 10.0, stiffness: 2.0e-7}", "damping: {ratio: 3}")
    assert said in warnings(ratio)
    assert "overcritical" not in warnings(ratio.replace("ratio: 3", "ratio: 0.03"))
    table = "study: a\nscene:\n  modes: {table: [[400, 0.01, 9.0], [900, 3, 9.0]]}\n  casing: {gap: 20 um}\n"
    assert said in warnings(table + "  duration: 0.1\n" + AXES)


@pytest.mark.parametrize(
    ("given", "other"),
    [("4430", "4.43"), ("4430", "7.85e-9"), ("stiffness: 1.0e6", "stiffness: 1e3"), ("1.0e6", "3e9")],
)
def test_densities_and_stiffnesses_of_no_machine(given: str, other: str) -> None:
    assert "unit" not in warnings(STUDY)
    assert re.search("check .*unit", warnings(STUDY.replace(given, other)))


def test_a_wide_gap_where_nothing_bounds_the_motion() -> None:
    said = "a gap of 20 m is that of no machine: check its unit"
    wide = "axes: {scheme: event_driven, scene.casing.gap: [0.5, 20]}\n"
    assert said in warnings(f"study: a{FALLING_BALL}{wide}")
    assert "machine" not in warnings(f"study: a{FALLING_BALL}{wide.replace('20', '1')}")
    assert "machine" not in warnings(STUDY.replace("20 um", "20"))  # the tip cannot reach it, which is said


def test_a_coefficient_beside_an_alpha_of_its_own() -> None:
    text = STUDY.replace("  duration", "  friction: {coefficient: 0.15}\n  duration")
    assert alpha(text) == "0 W/N default"
    both = text.replace("e: [0, 0.5]", "alpha: [1, 2], scene.friction.coefficient: [0, 0.15]")
    assert alpha(both) == "1, 2 W/N axis"
    assert "`scene.friction.coefficient` changes nothing" in warnings(both)


@pytest.mark.parametrize(
    ("friction", "axes", "problem"),
    [
        ("{coefficient: 0.15, heat_share: 0.5}", "e: 0", "scene.friction: has no `sliding_speed`"),
        ("{coefficient: 0.15}", "scene.friction.sliding_speed: [1, 2]", "scene.friction: has no `heat_share`"),
    ],
)
def test_half_a_friction_makes_no_alpha(friction: str, axes: str, problem: str) -> None:
    text = STUDY.replace("  duration", f"  friction: {friction}\n  duration").replace("e: [0, 0.5]", axes)
    assert problem in refusal(parsed, text)
