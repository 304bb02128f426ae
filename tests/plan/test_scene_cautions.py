"""What plan warns of in a scene: a tip that stays clear, soft springs, bases, meshes, friction, mistaken units."""

import re
from pathlib import Path

import numpy as np
import pytest

from matrix_files import as_npz, matrices_of
from scenes import heavy_chain
from sliding import TANGENT
from studies import BLADE_SCENE, FALLING_BALL, HEAVY_SCENE, parsed, refusal, solve_all, written
from workflow import open_archive, run_study
from workflow.cases import arrange
from workflow.models import static_growth
from workflow.plan import plan, plan_study
from workflow.schemes import Status
from workflow.study import read_study

EXACT = "axes: {scheme: event_driven, alpha: 30}\noutput: {histories: []}\n"
PLAIN = "axes: {scheme: event_driven}\n"
FINE = BLADE_SCENE.replace("nodes: 20", "nodes: 30, tip_cell: 60 um")


def planned(scene: str, rest: str = EXACT) -> list[str]:
    return list(plan(arrange(parsed(f"study: a{scene}{rest}"))).warnings)


def unreached(scene: str, rest: str = PLAIN) -> list[str]:
    return [line for line in planned(scene, rest) if "cannot reach" in line]


def test_a_plausible_scene_has_nothing_to_say() -> None:
    assert planned(FINE, "axes: {scheme: event_driven, alpha: [0, 30]}\n") == []


def test_a_gap_in_metres_cannot_be_reached() -> None:
    """``gap: 20`` was meant as 20 um: 24 N on 1e6 N/m move the tip by 24 um."""
    (warning,) = planned(FINE.replace("20 um", "20"), PLAIN)
    assert warning.startswith("the tip cannot reach the casing at gap = 20 m: without contact it stays below 24 µm")


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_reach_that_overflows_is_no_reach_that_falls_short() -> None:
    """2e308 N is beyond the numbers: the bound of the motion is inf - inf, which said that the tip stays clear."""
    lines = planned(FINE.replace("amplitude: 24", "mean: 1.0e+308, amplitude: 1.0e+308"), PLAIN)
    assert not [line for line in lines if "nan" in line or "cannot reach" in line]


def test_a_caution_names_only_gaps_that_no_case_reaches() -> None:
    axes = "axes: {scheme: event_driven, scene.casing.gap: [20 um, 40 um, 1 mm], scene.load.amplitude: [24, 60]}\n"
    (warning,) = unreached(FINE, axes)
    assert "gap = 0.001 m:" in warning


def test_heat_and_a_static_start_count_as_reach() -> None:
    start = FINE.replace("amplitude: 24, frequency: 5 Hz", "mean: 24")
    assert not unreached(start.replace("  duration", "  initial: static\n  duration"))
    cold = FINE.replace("amplitude: 24, frequency: 5 Hz", "mean: 0")
    assert unreached(cold)
    assert not unreached(cold.replace("2.0e-7}", "2.0e-7}, heating: 5"))


def test_a_spring_softer_than_the_tip_gives_a_caution() -> None:
    text = "schemes: {soft: {method: penalty, stiffness: 5.0e5, integration: implicit}, hard: {method: penalty, "
    text += "stiffness: 2.0e8, integration: implicit}}\naxes: {scheme: [soft, hard], h: 1e-5}\n"
    (line,) = [line for line in planned(FINE + text, "") if "softer" in line]
    assert line.startswith("the contact spring of soft, 5e+05 N/m, is softer than the tip, 1e+06 N/m")


@pytest.mark.parametrize(("modes", "lost"), [("full", False), ("3", True)])
def test_what_a_basis_cannot_hold_gives_a_caution(modes: str, lost: bool) -> None:
    heated = FINE.replace("2.0e-7}", f"2.0e-7}}, heating: {[int(node == 7) for node in range(30)]}")
    axes = f"axes: {{scheme: event_driven, mechanical_modes: {modes}, thermal_modes: {modes}}}\n"
    matching = [line for line in planned(heated, axes) if "projection_residual" in line]
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


DIFFUSIVITY = 7.0 / (4430 * 560)
COARSE, MODES = (
    r"^the cell at the tip is ([0-9.]+) mm thick, ",
    r"^the thermal modes kept amount to a cell of ([0-9.]+) mm",
)
ENTERS = r"heat enters ([0-9.]+) mm in (a tenth of the shortest period|a mean contact): "


def after(directory: Path, scene: str, rest: str = EXACT) -> list[str]:
    """What is said of an archive, besides what the plan says of steps, and whether it settles."""
    said = run_study(parsed(f"study: a{scene}{rest}"), directory / "a.nc").warnings
    return [line for line in said if "damps" not in line and "settled" not in line]


def test_before_a_run_a_contact_is_a_tenth_of_the_load_period() -> None:
    (line,) = planned(BLADE_SCENE)
    thickness, (entered, time) = re.search(COARSE, line), re.search(ENTERS, line).groups()
    assert float(thickness[1]) == 2
    assert time == "a tenth of the shortest period"
    assert float(entered) == pytest.approx(1e3 * np.sqrt(DIFFUSIVITY * 0.02), rel=0.05)
    cell = re.search(r"`tip_cell: ([0-9.]+ mm)` would do$", line)[1]
    assert planned(BLADE_SCENE.replace("nodes: 20", f"nodes: 30, tip_cell: {cell}")) == []


@pytest.mark.parametrize(
    ("scene", "rest"),
    [
        (FINE, EXACT),
        (BLADE_SCENE, EXACT.replace("alpha: 30", "alpha: 0")),
        (BLADE_SCENE.replace("load: {amplitude: 24, frequency: 5 Hz}", "load: {mean: 24}"), EXACT),
        (BLADE_SCENE.replace("conductivity: 7.0", "conductivity: 0"), EXACT),
        (HEAVY_SCENE, EXACT.replace("30", "1")),
    ],
    ids=["fine", "no heat", "no period", "no conduction", "lumps"],
)
def test_nothing_is_said_of_what_is_fine_or_has_no_measure(scene: str, rest: str) -> None:
    assert planned(scene, rest) == []


def test_friction_makes_heat_too() -> None:
    friction = "  friction: {coefficient: 0.1, sliding_speed: 100, heat_share: 0.5}\n"
    assert len(planned(BLADE_SCENE + friction, EXACT.replace(", alpha: 30", ""))) == 1


@pytest.mark.parametrize(("modes", "thickness"), [(12, 0.685), (15, 0.432), (20, None), (25, None)])
def test_few_thermal_modes_are_as_coarse_as_few_nodes(modes: int, thickness: float | None) -> None:
    lines = planned(FINE, EXACT.replace("alpha: 30", f"alpha: 30, mechanical_modes: 3, thermal_modes: {modes}"))
    found = [float(re.search(MODES, line)[1]) for line in lines]
    assert found == ([] if thickness is None else [pytest.approx(thickness, abs=1e-3)])
    assert all(line.endswith("max_temperature depends on their number; keep more, or use krylov") for line in lines)


def test_krylov_vectors_resolve_the_cell_with_few() -> None:
    axes = "reduction: krylov, mechanical_modes: 3, thermal_modes: 8"
    assert planned(FINE, EXACT.replace("alpha: 30", f"alpha: 30, {axes}")) == []


@pytest.mark.parametrize("e", [0, 0.9])
@pytest.mark.parametrize("scheme", ["event_driven", "moreau, h: 2e-5"])
def test_after_a_run_it_is_the_mean_contact(tmp_path: Path, scheme: str, e: float) -> None:
    """47 ms each load period, with bounces before or without: heat enters 0.37 mm."""
    rest = EXACT.replace("event_driven", scheme).replace("alpha: 30", f"alpha: 30, e: {e}")
    (line,) = after(tmp_path, BLADE_SCENE, rest)
    entered, time = re.search(ENTERS, line).groups()
    assert float(entered) == pytest.approx(0.37, rel=0.25)  # steps lose contact at e = 0, and count it anew
    assert time == "a mean contact"


def test_a_contact_shorter_than_the_plan_took_is_told_after_the_run(tmp_path: Path) -> None:
    """A blade that hits once for 73 µs: the plan has no load period, the run says 14 µm."""
    once = BLADE_SCENE.replace(
        "gap: 20 um}\n  load: {amplitude: 24, frequency: 5 Hz}", "gap: 0}\n  initial: {velocity: 1}"
    )
    once = once.replace("2 s", "0.2 ms")
    assert planned(once) == []
    (line,) = after(tmp_path, once)
    assert float(re.search(ENTERS, line)[1]) == pytest.approx(0.014)


@pytest.mark.parametrize("scheme", ["event_driven", "moreau, h: 1e-4"])
def test_impacts_alone_heat_alike_at_any_mesh(tmp_path: Path, scheme: str) -> None:
    """A free blade that bounces at e = 0.9: α (1 + e) v/c at each impact, and no contact that lasts."""
    ball = BLADE_SCENE.replace("nodes: 20", "nodes: 1").replace("tip_stiffness: 1.0e6", "tip_stiffness: 0")
    ball = ball.replace("damping: {mass: 10.0, stiffness: 2.0e-7}", "damping: {mass: 0}").replace(
        "gap: 20 um", "gap: 1 mm"
    )
    ball = ball.replace("amplitude: 24, frequency: 5 Hz", "mean: 0.1").replace("2 s", "0.1 s")
    rest = EXACT.replace("event_driven", scheme).replace("alpha: 30", "alpha: 30, e: 0.9")
    assert after(tmp_path, ball, rest) == []


def test_along_an_axis_of_meshes_it_is_said_how_far_the_temperature_still_moves(tmp_path: Path) -> None:
    for axis, ends in (("scene.blade.nodes: [80, 20, 40]", "nodes = 40 to 80"),
                       ("scene.blade.tip_cell: [0.5 mm, 0.1 mm, 60 um]", "tip_cell = 0.0001 to 6e-05")):  # fmt: skip
        name = axis.split(".")[2][:4]
        rest = EXACT.replace("alpha: 30", f"alpha: 30, {axis}")
        (tmp_path / name).mkdir()
        (line,) = [line for line in after(tmp_path / name, BLADE_SCENE, rest) if "still changes" in line]
        assert line.endswith(f"from {ends}")
        with open_archive(tmp_path / name / "a.nc") as archive:
            values = np.sort(archive["max_temperature"].values.ravel())
        share = float(re.search(r"by up to ([0-9.]+) %", line)[1])
        assert share == pytest.approx(100 * (1 - values[-2] / values[-1]), rel=0.06)


def test_the_attribute_says_the_depth(tmp_path: Path) -> None:
    rest = EXACT.replace("alpha: 30", "alpha: 30, mechanical_modes: 3, thermal_modes: [12, full]")
    about = run_study(parsed(f"study: a{FINE}{rest}"), tmp_path / "a.nc").dataset["max_temperature"].attrs
    assert about["depth"] == pytest.approx([30e-6, 0.685e-3 / 2], rel=1e-3)
    assert about["depth_of_mesh"] == pytest.approx(30e-6)
    assert about["thermal_diffusivity"] == pytest.approx(DIFFUSIVITY)
    assert "mean over `depth`" in about["comment"]


@pytest.mark.parametrize(("interval", "told"), [("1 ms", False), ("10 us", False), ("5 us", True)])
def test_means_of_contact_force_over_less_than_two_cells(interval: str, told: bool) -> None:
    """A cell of the 20 is 2 mm, which a wave takes 3.65 µs through."""
    rest = f"axes: {{scheme: event_driven}}\noutput: {{interval: {interval}}}\n"
    lines = [line for line in planned(BLADE_SCENE, rest) if "two cells" in line]
    assert len(lines) == told
    assert all("(7.3e-06 s)" in line for line in lines)
    assert planned(BLADE_SCENE, rest.replace("output: {", "output: {histories: [displacement], ")) == []


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
