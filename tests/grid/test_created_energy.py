"""Contact springs beyond the step up to which they hold: cases that are thrown far off are not ok, sound ones are.

``python tests/grid/test_created_energy.py 100`` measures that many random scenes at several multiples of the limit,
with a second word, ``held`` or ``free``, of structures with such a root, with a third, θ, of the implicit scheme.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from scenes import chain
from studies import parsed
from workflow.grid import Solved, arrange, solve
from workflow.models import frequencies, tip_flexibility
from workflow.schemes import Status, penalty

CASES, SAMPLES, MOST_STEPS = 8, 200, 4e5
FINE = 0.125
"""Share of the limit at which a scene is solved to compare with."""


def scene(seed: int, held: bool, **integration: Any) -> tuple[dict[str, Any], float]:
    """Return a study of a random structure without a step, and the step up to which its spring holds, s.

    Free: it falls on its casing from eight heights, in turn by its weight alone, with a harmonic load, on a casing
    that vibrates, with damped springs, with a contact damper. Held: it starts from eight places, or a harmonic load
    moves it, or both; one scene in three is damped, one in four has a contact damper.
    """
    rng = np.random.default_rng(seed)
    kind = seed % 5
    n = int(rng.choice([1, 2, 3, 6, 15] if held else [1, 1, 2, 3, 6]))
    masses = 10 ** rng.uniform(-3, 0) * rng.uniform(0.5, 2, n)
    springs = 10 ** rng.uniform(3, 6) * rng.uniform(0.5, 2, n)
    springs[0] *= held
    lumps: dict[str, Any] = {"nodes": n, "mass": tuple(masses.tolist()), "stiffness": tuple(springs.tolist())}
    structure = chain(**lumps)
    gravity = 9.81 * 10 ** rng.uniform(-1, 1)
    flexibility = tip_flexibility(structure) if held else np.inf
    place = 1e-4 if held else 10 ** rng.uniform(-4, -1)
    time = 2 * np.pi / float(frequencies(structure)[0]) if held else 2 * np.sqrt(2 * place / gravity)
    load = place / flexibility if held else float(masses.sum()) * gravity
    softest = 1 / flexibility if held else load / place * 10  # the tip sinks in by less than half of what it falls
    spring = softest * 10 ** rng.uniform(0.5, 4)
    damper = float(rng.choice([0.03, 0.1, 1]) if kind == 4 else 0.0) * 2 * np.sqrt(spring * masses[-1])
    wave = {"amplitude": load * rng.uniform(0.2, 3), "frequency": rng.uniform(0.3, 5) / time, "phase": 1.0}
    vibrates = {"amplitude": place * rng.uniform(0.02, 0.3), "frequency": rng.uniform(0.3, 5) / time}
    moves = kind == 1 if not held else kind in (1, 3)
    stiffness_damping = 1e-2 * rng.uniform(0, 1) * time if seed % 3 == 0 and springs.any() else 0.0
    options = penalty.Options(stiffness=spring, damping=damper, **integration)
    duration = float(f"{time * rng.choice([5, 15, 40]):.3g}")
    study = {
        "study": "random",
        "scene": {
            "chain": {**lumps, "heat_capacity": 1, "damping": {"stiffness": stiffness_damping}},
            "casing": {"gap": 0, **({"harmonics": [vibrates]} if kind == 2 and not held else {})},
            "load": {**(wave if moves else {}), "steady": 0.0 if held else (masses * gravity).tolist()},
            "initial": {"displacement": -place},
            "duration": duration,
        },
        "schemes": {"spring": {"method": "penalty", "stiffness": spring, "damping": damper, **integration}},
        "axes": {
            "scheme": "spring",
            "scene.initial.displacement": {"lin": [-place, -2 * place, CASES]},
        },
        "output": {"interval": duration / SAMPLES, "balances": seed % 2 == 0},
    }
    return study, penalty.contact_limit(structure, options)


def at(study: dict[str, Any], h: float) -> Solved:
    """Solve a scene with a step."""
    grid = arrange(parsed(json.dumps({**study, "axes": {**study["axes"], "h": h}})))
    (outer,) = grid.places
    return solve(grid, outer, np.arange(grid.inner_count))


def errors(found: Solved, fine: Solved) -> tuple[np.ndarray, np.ndarray]:
    """Return the relative error of the displacement, and how far the tip comes over how far it should, ``(case,)``."""
    x, exact = found.values["displacement"], fine.values["displacement"]
    with np.errstate(all="ignore"):
        error = np.linalg.norm(x - exact, axis=1) / np.linalg.norm(exact, axis=1)
        return error, np.abs(x).max(axis=1) / np.abs(exact).max(axis=1)


@pytest.mark.parametrize("held", [False, True], ids=["free", "held"])
@pytest.mark.parametrize("seed", range(10))
def test_thrown_cases_are_not_ok_and_sound_ones_are(seed: int, held: bool) -> None:
    study, limit = scene(seed, held)
    fine = at(study, FINE * limit)
    for times in (FINE, 1.0, 2.0, 3.5, 5.0):
        found = at(study, times * limit)
        error, far = errors(found, fine)
        ok = found.values["status"] == Status.OK
        assert times > 1 or ok.all()
        assert times > 2 or ok[error < 0.3].all()
        assert not ok[~((error <= 10) & (far <= 10))].any(), times


def _measure(count: int, held: bool, **integration: Any) -> None:
    """Print what share of cases is ok though thrown ten times as far, and how many are not ok though sound."""
    explicit = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 10.0)
    for times in (1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 60.0, 100.0) if integration else explicit:
        thrown = missed = sound = lost = cases = 0
        for seed in range(count):
            study, limit = scene(seed, held, **integration)
            if study["scene"]["duration"] / (FINE * limit) > MOST_STEPS:
                continue
            found, fine = at(study, times * limit), at(study, FINE * limit)
            error, far = errors(found, fine)
            touches, ok = fine.values["impacts"] > 0, found.values["status"] == Status.OK
            off = touches & ~((error <= 10) & (far <= 10))
            near = touches & (error < 0.3)
            cases, thrown, missed = cases + CASES, thrown + off.sum(), missed + (off & ok).sum()
            sound, lost = sound + near.sum(), lost + (near & ~ok).sum()
        print(
            f"{times:4g} of the limit: of {cases} cases {thrown} are off by more than ten times, {missed} of these "
            f"ok; {sound} are off by less than 0.3, {lost} of these not ok",
            flush=True,
        )


if __name__ == "__main__":
    theta = {"integration": "implicit", "theta": float(sys.argv[3])} if len(sys.argv) > 3 else {}
    _measure(int(sys.argv[1]), "held" in sys.argv[2:], **theta)
