"""What is said where the cell at a blade's tip, or what its thermal modes amount to, is thicker than heat enters."""

import re
from pathlib import Path

import numpy as np
import pytest

from studies import BLADE_SCENE, HEAVY_SCENE, parsed
from workflow import open_archive, run_study
from workflow.cases import arrange
from workflow.plan import plan
from workflow.run import warnings_of

EXACT = "axes: {scheme: event_driven, alpha: 30}\noutput: {histories: []}\n"
FINE = BLADE_SCENE.replace("nodes: 20", "nodes: 30, tip_cell: 60 um")
DIFFUSIVITY = 7.0 / (4430 * 560)
COARSE, MODES = (
    r"^the cell at the tip is ([0-9.]+) mm thick, ",
    r"^the thermal modes kept amount to a cell of ([0-9.]+) mm",
)
ENTERS = r"heat enters ([0-9.]+) mm in (a tenth of the shortest period|a mean contact): "


def planned(scene: str, rest: str = EXACT) -> list[str]:
    return list(plan(arrange(parsed(f"study: a{scene}{rest}"))).warnings)


def after(directory: Path, scene: str, rest: str = EXACT) -> list[str]:
    """What is said of an archive, besides what the plan says of steps, and whether it settles."""
    run_study(parsed(f"study: a{scene}{rest}"), directory / "a.nc")
    with open_archive(directory / "a.nc") as archive:
        return [line for line in warnings_of(archive) if "damps" not in line and "settled" not in line]


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
    run_study(parsed(f"study: a{FINE}{rest}"), tmp_path / "a.nc")
    with open_archive(tmp_path / "a.nc") as archive:
        about = archive["max_temperature"].attrs
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
