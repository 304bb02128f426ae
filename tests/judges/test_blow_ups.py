"""Cases that blew up though their numbers are finite are ``diverged``; sound cases are not, however far they move."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenes import cases, chain, heavy_chain, sampling, step, tip_flexibility
from studies import HEAVY_SCENE, solve_all
from workflow.judges.blow_ups import Runaways, mark_blown_up
from workflow.schemes import Status
from workflow.solve import Solved

ONE = """
study: a
scene:
  chain: {{nodes: {nodes}, mass: {mass}, stiffness: {stiffness}{more}}}
  casing: {{gap: {gap}}}
  {scene}
  duration: {duration}
schemes: {{spring: {{method: penalty, stiffness: {spring}}}}}
axes: {{scheme: {scheme}, h: {h}{axes}}}
output: {{interval: {interval}, histories: [], balances: {balances}}}
"""
USUAL = {"nodes": 1, "mass": 1e-3, "stiffness": 1e6, "more": "", "gap": 0, "scene": "", "duration": 0.01, "spring": 1e7}
USUAL |= {"scheme": "moreau", "h": 1e-6, "axes": "", "interval": "1 ms", "balances": "false"}
HEAT = ", damping: {mass: 10}, spacing: 1.0e-2, expansion: 1.0e-5, heat_capacity: 1.0e-2, conductance: "


def heavy(h: float, balances: str) -> str:
    """Return the study of a contact spring far stiffer than the heavy chain."""
    return f"""study: a{HEAVY_SCENE}schemes: {{stiff: {{method: penalty, stiffness: 2.0e9}}}}
axes: {{scheme: stiff, h: {h}, alpha: 0.25}}
reference: {{scheme: event_driven}}
output: {{interval: 1 ms, histories: [], balances: {balances}}}
"""


def solved(text: str) -> Solved:
    (only,) = solve_all(text)
    return only


def one(**values: Any) -> Solved:
    return solved(ONE.format(**{**USUAL, **values}))


def test_a_ball_that_its_table_strikes_a_thousand_times_is_ok() -> None:
    """θ = 1, all impacts in one phase of the table, 250 steps per period: its balance leaves 3e-13 of its energy."""
    table = one(
        mass=0.01, stiffness=0, more=", heat_capacity: 1", duration=20, h=8e-5, axes=", e: 0.8", interval="20 ms",
        gap="0, harmonics: [{amplitude: 80 um, frequency: 50 Hz, phase: 1.1222043866499591}]",
        scene="load: {mean: 0.0981}\n  initial: {displacement: -5.625846933623595e-4}", balances="true",
    )  # fmt: skip
    assert table.values["status"][0] == Status.OK
    assert table.values["impacts"][0] == 1000
    assert abs(table.values["energy_residual"][0]) < 2e-12


def test_a_held_tip_of_a_hundred_times_its_energy_is_not_ok() -> None:
    """Three nodes that start 1 mm from their casing come 0.21 m far: a residual of 0.99999, below 1 for ever."""
    scene = {"nodes": 3, "mass": 0.01, "more": ", heat_capacity: 1", "scene": "initial: {displacement: -1.0e-3}"}
    scene |= {"duration": 0.02, "scheme": "spring", "spring": 1e8, "interval": "0.2 ms", "balances": "true"}
    thrown = one(**scene, h=1.75e-5)
    assert np.abs(thrown.values["displacement"]).max() > 0.1
    assert thrown.values["status"][0] == Status.DIVERGED
    assert "+0.99" in thrown.messages[0]
    sound = one(**scene, h=5e-6)
    assert np.abs(sound.values["displacement"]).max() < 2e-3
    assert sound.values["status"][0] == Status.OK


def test_a_contact_spring_that_creates_energy_is_not_ok() -> None:
    """2e-6 s is below the limit of lasting contact (2.2e-6 s): residual 6.9. Below the limit said it has none."""
    created = solved(heavy(2e-6, "true"))
    assert created.values["energy_residual"][0] > 1
    assert created.values["status"][0] == Status.DIVERGED
    assert created.messages[0].startswith("energy was created")
    sound = solved(heavy(0.5 / np.sqrt(2.0e9 / 2.5e-3), "true"))
    assert sound.values["status"][0] == Status.OK
    assert sound.values["energy_residual"][0] < 0.1


def test_a_tip_that_is_thrown_far_off_is_not_ok_without_balances_either() -> None:
    """An error of 3e86 and 2e87 K: heat that a scheme creates excuses nothing."""
    results = solved(heavy(3.16e-6, "false"))
    assert results.values["displacement_error"][0] > 1e20
    assert results.values["status"][0] == Status.DIVERGED
    assert "the tip moved" in results.messages[0]


def test_heat_that_cannot_leave_excuses_no_blow_up() -> None:
    """α_c = 0: a growth of e²⁰ hid a tip that was 2e8 m from its casing; below the limit the case is a runaway."""
    scene = {"nodes": 4, "more": f"{HEAT}0", "gap": 1e-6, "scene": "load: {amplitude: 10, frequency: 200}"}
    scene |= {"duration": 2, "scheme": "spring", "axes": ", alpha: 8", "interval": "50 ms"}
    created = one(**scene, h=1.41e-5)
    assert created.values["critical_alpha"][0] == 0
    assert created.values["max_penetration"][0] > 1e8
    assert created.values["status"][0] == Status.DIVERGED
    sound = one(**scene, h=5e-6)
    assert sound.values["runaway"][0]
    assert sound.values["thermal_closing"][0] > 1e6 * 1e-6
    assert sound.values["status"][0] == Status.OK


def test_dissipation_never_counts() -> None:
    """A tip that hammers a casing without a gap: implicit Euler takes many times the largest energy."""
    more, load = ", damping: {mass: 5}, heat_capacity: 1", "load: {amplitude: 5, frequency: 700}"
    results = one(nodes=3, more=more, scene=load, duration=0.05, h=1e-5, balances="true", axes=", e: 0.9")
    assert results.values["energy_residual"][0] < -1
    assert results.values["status"][0] == Status.OK


def test_runaway_is_physics() -> None:
    """A pressed tip a hundred times above its critical coupling: it stays ok, with its flag, in every scheme."""
    for scheme in ("moreau", "carpenter", "penalty", "event_driven"):
        values = {"scene": "load: {mean: 7.5}\n  initial: static", "axes": ", alpha: 50", "balances": "true"}
        results = one(nodes=4, more=f"{HEAT}0.1", gap=-1e-5, duration=0.05, h=1e-6, scheme=scheme, **values)
        assert results.values["runaway"][0] == 1
        assert results.values["status"][0] == Status.OK, (scheme, results.messages)


def test_a_runaway_whose_balance_is_rounding_is_physics() -> None:
    """A pressed tip whose heat grows e^113-fold does not move: its energy residual is rounding of thermal work."""
    scene = "load: {mean: 7.5, amplitude: 2, frequency: 100}\n  initial: static"
    for alpha in (300, 500, 700):
        values = {"scene": scene, "axes": f", alpha: {alpha}", "balances": "true"}
        results = one(nodes=1, more=f"{HEAT}0.1", gap=-1e-5, duration=0.05, h=1e-6, **values)
        assert results.values["status"][0] == Status.OK, results.messages


def test_a_free_root_is_left_to_the_balances() -> None:
    """K1 is singular: a tip may fly off as far as it likes."""
    results = one(more=", heat_capacity: 1", scene="load: {mean: -1}", gap=1e-6, duration=1)
    assert results.values["status"][0] == Status.OK
    thrown = one(stiffness=0, more=", heat_capacity: 1", scene="load: {mean: -1000}", gap=1e-9, duration=1, h=1e-3)
    assert thrown.values["status"][0] == Status.OK


@pytest.mark.parametrize("scheme", ["moreau", "event_driven"])
@pytest.mark.parametrize("root", ["1.0e6", "[0, 1.0e6, 1.0e6]"], ids=["clamped", "free"])
def test_a_tip_at_rest_at_a_gap_of_zero_creates_no_energy(scheme: str, root: str) -> None:
    """The load presses the tip and touches zero once a period: nothing moves, and balances are set beside rounding."""
    results = one(
        nodes=3, stiffness=root, more=", heat_capacity: 1, damping: {mass: 10, stiffness: 1.0e-6}", duration=0.1,
        scene="load: {mean: 7.569, amplitude: 7.569, frequency: 122.73668917555895}", scheme=scheme,
        h=4.4e-5, balances="true",
    )  # fmt: skip
    assert np.abs(results.values["displacement"]).max() < 1e-15
    assert results.values["status"][0] == Status.OK, results.messages


def test_a_load_of_a_file_counts_with_all_of_its_newtons(tmp_path: Path) -> None:
    """500 N at each node, `amplitude` their factor: the exact motion, 0.5 mm beside 0.4 um for 1 N, had diverged."""
    stiffness = 1e7 * (2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    stiffness[-1, -1] = 1e7
    np.savez(tmp_path / "bar.npz", mass=0.01 * np.eye(4), stiffness=stiffness, contact=3, load=np.full(4, 500.0))
    run = solved(f"""
study: a
scene:
  matrices: {{file: {tmp_path / "bar.npz"}, damping: {{ratio: 0.01}}}}
  casing: {{gap: 0}}
  load: {{amplitude: 1, frequency: 50 Hz, phase: 3.14159}}
  duration: 20 ms
axes: {{scheme: event_driven}}
output: {{interval: 0.1 ms}}
""")
    assert run.values["displacement"].min() < -5e-4
    assert run.values["status"][0] == Status.OK


ACCOUNTED: dict[str, tuple[dict[str, Any], float]] = {
    "gap": ({"gap": 3e-3}, 3e-3),
    "casing": ({"gap": 1e-3, "casing_harmonics": [[2e-3, 5.0, 0.0]]}, 3e-3),
    "speed": ({"velocity": [0.0, 0.0, 2.0]}, 2.0 * np.sqrt(3e-6 * 1e-3)),
    "stretch": ({"displacement": [-1e-4, 2e-4, 0.0]}, 1e-4 * np.sqrt(3e-6 * (1.0 + 9.0 + 4.0) * 1e6)),
    "load": ({"mean": 2.0, "amplitude": 5.0, "load_harmonics": [[3.0, 7.0, 0.0]], "steady": [0, 0, 4.0]}, 14.0 * 3e-6),
    "warmth": ({"temperature": [0.0, 3.0, -2.0]}, 1.0 * 2e-6),
    "heating": ({"heating": [0.0, 3.0, -2.0]}, 5.0 * 1e-3 * 2e-6),
}
"""Conditions of a chain of three springs of 1e6 N/m, S = 3e-6 m/N, over 1 ms, and what they account for: v √(S m),
√(S Σ k δ²), 2e-6 m/K of 1 J/K at each node."""


@pytest.mark.parametrize("name", ACCOUNTED)
def test_a_tip_may_reach_a_thousand_times_what_accounts_for_it(name: str) -> None:
    """Of an exact motion no more is judged; energy that is created is judged wherever the tip is more than rounding."""
    conditions, length = ACCOUNTED[name]
    structure, over = chain(nodes=3, mass=1e-3, stiffness=1e6), sampling(1e-3, 1e-3)
    batch, still, statics = (
        cases(structure, 2, **conditions),
        np.zeros(2),
        (np.array([tip_flexibility(structure)]), np.full((1, 3), 2e-6)),
    )
    results = step(structure, batch, 1e-5, over)

    def judged_at(reach: float, created: float, is_stepped: bool) -> set[int]:
        far = {**results.histories, "displacement": np.tile([0.0, -reach * length], (2, 1))}
        metrics = {**results.metrics, "energy_residual": np.full(2, created), "max_penetration": still}
        found = replace(results, histories=far, metrics=metrics)
        given = structure, lambda: statics, lambda _: still, batch, found, over.duration
        return set(mark_blown_up(*given, is_stepped=is_stepped).status.tolist())

    assert judged_at(999.0, 0.5, True) == judged_at(1001.0, 0.5, False) == {Status.OK}
    assert judged_at(1001.0, 0.5, True) == {Status.DIVERGED}
    assert judged_at(0.5, 1.5, True) == judged_at(0.5, 1.5, False) == {Status.DIVERGED}
    assert judged_at(1e-13, 1.5, True) == {Status.OK}


@pytest.mark.parametrize(
    ("nodes", "alpha", "rate"), [(300, 30.0, 0.013864702927833), (1000, 2000.0, 0.437656997376324)]
)
def test_growth_of_many_nodes(nodes: int, alpha: float, rate: float) -> None:
    """Rates of all of their poles, of 898 and 2 998 states."""
    found = Runaways(heavy_chain(nodes=nodes)).of(np.array([alpha]), np.zeros(1))
    assert found.growth_rate == pytest.approx([rate], rel=1e-9)
