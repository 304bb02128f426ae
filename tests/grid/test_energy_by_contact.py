"""Tips that contact throws off by work that no casing does: such cases are not ok, sound ones are.

``python tests/grid/test_energy_by_contact.py 200`` measures that many random scenes.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from scenes import cases, chain, sampling, step
from studies import parsed, solve_all
from workflow.grid import arrange, solve
from workflow.grid._contact_work import contact_gave_too_much
from workflow.models import critical_alpha, frequencies, tip_flexibility
from workflow.schemes import Status

BAR = """
study: a
scene:
  chain: {{nodes: 3, mass: [0.01, 0.01, 1.0e-5], stiffness: [0, 1.0e6, 1.0e6], heat_capacity: 1}}
  casing: {{gap: 0{casing}}}
  load: {{steady: [0.0981, 0.0981, 9.81e-5]}}
  initial: {{displacement: -1.0e-4}}
  duration: 0.2 s
schemes: {{half: {{method: moreau, theta: 0.5}}}}
axes: {{scheme: half, e: [0, 0.5], h: {h}}}
output: {{interval: 1 ms}}
"""
FASTEST, FALL = 1.99e-5, 1e-4
"""Period of the bar's fastest mode, s, and how far it falls, m."""
PERIODS = (0.1, 0.3, 1.0, 3.0, 10.0, 20.0, 35.0, 60.0, 100.0)


@pytest.mark.parametrize("casing", ["", ", harmonics: [{amplitude: 0.1 um, frequency: 50 Hz}]"], ids=["", "vibrates"])
@pytest.mark.parametrize("periods", [10, 20])
def test_a_bar_whose_light_tip_throws_it_off_is_not_ok(periods: int, casing: str) -> None:
    """It flies 17 to 1500 times as far as it fell, and its balance leaves rounding: it was ok."""
    (thrown,) = solve_all(BAR.format(h=periods * FASTEST, casing=casing))
    assert np.abs(thrown.values["displacement"]).max(axis=1).min() > 15 * FALL
    assert np.abs(thrown.values["energy_residual"]).max() < 1e-11
    assert (thrown.values["status"] == Status.DIVERGED).all()
    assert all(text.startswith("energy was created: contact gave") for text in thrown.messages.values())
    assert f"h = {periods * FASTEST:.6g} s" in thrown.messages[0]


def test_the_same_bar_in_steps_that_follow_its_modes_is_ok() -> None:
    (sound,) = solve_all(BAR.format(h=0.1 * FASTEST, casing=""))
    assert np.abs(sound.values["displacement"]).max() < 1.01 * FALL
    assert (sound.values["status"] == Status.OK).all()


def test_what_the_scheme_takes_and_little_of_many_steps_do_not_count() -> None:
    """Contact gave 0.8 of the largest energy: much of it in one step or little, and the scheme left or took it."""
    ball = chain(nodes=1, mass=(0.01,), stiffness=(0.0,))
    results = step(ball, cases(ball, 4, gap=1.0), 1e-3, sampling(0.01, 1e-3))
    work = np.array([[0.8, 0.3], [0.8, 0.1], [0.8, 0.3], [0.7, 0.7]])
    residual = {"energy_residual": np.array([0.0, 0.0, -0.2, 0.2])}
    judged = contact_gave_too_much(replace(results, contact_work=work, metrics={**results.metrics, **residual}))
    assert judged.tolist() == [True, False, False, False]
    assert not contact_gave_too_much(results).any()


def scene(seed: int) -> tuple[dict[str, Any], float]:
    """Return a study of a random structure whose tip may be light, and the time of its slow motion, s.

    Free: it falls on its casing by its weight. Held: it starts away from its casing, or a load moves it, or both. Half
    have a harmonic load, two in five friction heat, one in five a casing that vibrates; some are damped.
    """
    rng = np.random.default_rng(77_000 + seed)
    free, n = bool(rng.random() < 0.5), int(rng.choice([2, 3, 6, 12]))
    masses, springs = (
        10 ** rng.uniform(-3, 0) * rng.uniform(0.3, 2, n),
        10 ** rng.uniform(3, 7) * rng.uniform(0.3, 2, n),
    )
    masses = masses * np.geomspace(1, 10 ** rng.uniform(-4, 0), n) if rng.random() < 0.7 else masses
    springs[0] *= not free
    lumps: dict[str, Any] = {"nodes": n, "mass": tuple(masses.tolist()), "stiffness": tuple(springs.tolist())}
    lumps["heat_capacity"] = float(10 ** rng.uniform(-2, 1))
    heats = rng.random() < 0.4
    if heats:
        lumps |= {"spacing": 1e-2, "expansion": float(1e-5 * rng.choice([1, 1, -1]))}
        lumps |= {"conductance": float(10 ** rng.uniform(-2, 1)), "convection": float(rng.choice([0, 0.05]))}
    structure = chain(**lumps)
    place, gravity = 1e-4 * 10 ** rng.uniform(-1, 1), 9.81 * 10 ** rng.uniform(-1, 1)
    slow = 2 * np.sqrt(2 * place / gravity) if free else 2 * np.pi / float(frequencies(structure)[0])
    force = masses.sum() * gravity if free else place / tip_flexibility(structure)
    fast = 2 * np.pi / float(frequencies(structure)[-1])
    damping: dict[str, float] = {}
    if rng.random() < 0.4:
        damping = {"stiffness": float(10 ** rng.uniform(-4, -2) * slow)}
    elif rng.random() < 0.3:
        damping = {"mass": float(rng.choice([0.01, 0.1]) / slow)}
    critical = critical_alpha(structure) if heats else 0.0
    unit = critical if np.isfinite(critical) and critical > 0 else 1.0
    alphas = [0.0, float(unit * 10 ** rng.uniform(-1, 0.3))] if heats else [0.0]
    load: dict[str, Any] = {"steady": (masses * gravity).tolist() if free else 0}
    if rng.random() < 0.5:
        frequency = float(rng.uniform(0.1, 3) / slow)
        load |= {"amplitude": float(force * rng.uniform(0.2, 4)), "frequency": frequency, "phase": 1.0}
    if not free and rng.random() < 0.5:
        load["mean"] = float(force * rng.uniform(0, 2))
    moves = rng.random() < 0.2
    casing: dict[str, Any] = {"gap": 0.0 if free else float(place * rng.choice([0, 0.1, 0.7]))}
    if moves:
        casing["harmonics"] = [
            {"amplitude": float(place * rng.uniform(0.02, 0.3)), "frequency": float(rng.uniform(0.3, 5) / slow)}
        ]
    duration = float(f"{slow * rng.choice([5, 12, 30]):.3g}")
    heating = float(rng.choice([0, 0, 0.1])) if heats else 0.0
    starts = free or rng.random() < 0.6
    start = {"displacement": float(-place * rng.uniform(0.5, 2)) if starts else 0.0}
    steps = sorted({h for h in (float(f"{fast * k:.4g}") for k in PERIODS) if 10 < duration / h < 2e5})
    study = {
        "study": "random",
        "scene": {
            "chain": {**lumps, "damping": damping, "heating": heating},
            "casing": casing,
            "load": load,
            "initial": start,
            "duration": duration,
        },
        "axes": {"h": steps, "e": [0.0, 0.5, 1.0], "alpha": alphas},
        "output": {"interval": duration / 200, "balances": True},
    }
    return study, slow


def judged(seed: int, *thetas: float) -> list[dict[str, Any]]:
    """Solve a random scene by ``moreau`` and exactly; return each case that both can step."""
    study, slow = scene(seed)
    schemes = {f"theta{k}": {"method": "moreau", "theta": theta} for k, theta in enumerate(thetas)}
    study |= {"schemes": schemes, "axes": {"scheme": [*schemes, "event_driven"], **study["axes"]}}
    if not study["axes"]["h"]:
        return []
    grid = arrange(parsed(json.dumps(study)))
    exact, stepped, inner = None, [], np.arange(grid.inner_count)
    for outer in grid.places:
        cell = grid.settings(outer)
        if cell.scheme.method == "moreau":
            stepped.append((cell, solve(grid, outer, inner)))
        elif exact is None:
            exact = solve(grid, outer, inner).values
    assert exact is not None
    rows = []
    for cell, solved in stepped:
        x, v, status = (solved.values[name] for name in ("displacement", "velocity", "status"))
        for case in np.flatnonzero((exact["status"] == Status.OK) & (exact["impacts"] > 0)):
            with np.errstate(all="ignore"):
                far = [
                    np.abs(y[case]).max() / np.abs(z[case]).max()
                    for y, z in ((x, exact["displacement"]), (v, exact["velocity"]))
                ]
                error = np.linalg.norm(x[case] - exact["displacement"][case]) / np.linalg.norm(
                    exact["displacement"][case]
                )
            by_contact = solved.messages.get(int(case), "").startswith("energy was created: contact gave")
            rows.append(
                {
                    "free": study["scene"]["chain"]["stiffness"][0] == 0,
                    "theta": cell.scheme.options.theta,
                    "follows": cell.h <= 0.1 * slow and grid.inner_values(inner)["e"][case] < 1,
                    "off": bool(np.isfinite(far[1]) and not max(far) <= 10),
                    "sound": bool(error < 0.3),
                    "ok": status[case] == Status.OK,
                    "was_ok": status[case] == Status.OK or by_contact,
                }
            )
    return rows


@pytest.mark.parametrize("seed", [21, 72, 129])
def test_thrown_cases_of_random_scenes_are_not_ok_and_sound_ones_are(seed: int) -> None:
    rows = judged(seed, 0.5)
    thrown = [row["ok"] for row in rows if row["off"] and row["follows"]]
    assert not any(thrown)
    assert len(thrown) > 0 or seed == 21  # in which contact gives a sound case nearly as much as makes one diverge
    assert all(row["ok"] for row in rows if row["sound"])


def _measure(count: int) -> None:
    """Print how many cases are ok though thrown ten times as far or as fast, and how many are not though sound."""
    rows = [row for seed in range(count) for row in judged(seed, 0.5, 0.51, 0.6, 1.0)]
    for theta in (0.5, 0.51, 0.6, 1.0):
        for free in (True, False):
            those = [row for row in rows if row["theta"] == theta and row["free"] == free]
            for follows in (True, False):
                off = [row for row in those if row["off"] and row["was_ok"] and row["follows"] == follows]
                what = "e < 1, h up to a tenth of the slow motion" if follows else "others"
                print(
                    f"theta {theta:g}, {'free' if free else 'held'}, {what}: {len(off)} off by more than ten times "
                    f"were ok, {sum(row['ok'] for row in off)} are"
                )
            sound = [row for row in those if row["sound"] and row["was_ok"]]
            print(f"    {len(sound)} off by less than 0.3, {sum(not row['ok'] for row in sound)} of these not ok")


if __name__ == "__main__":
    _measure(int(sys.argv[1]))
