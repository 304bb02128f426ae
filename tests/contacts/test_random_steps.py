"""Every scheme with a fixed step against plain matrices, on random structures of one to five contacts, on all bases."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_contacts import DURATION, drawn, varied

from plain_steps import march, place, results, stepped_as
from scenes import cases, heavy_chain, relative, sampling, step, watched, with_dashpot
from workflow.models import Array, Cases, Structure
from workflow.schemes import HISTORIES, Results, Sampling, Status

H, OVER = 4e-5, sampling(0.006, 5e-5)
KAPPA, DAMPER = 3e6, 150.0
METRICS = ("impacts", "contact_time", "max_penetration", "max_temperature", "thermal_closing")


def options_of(method: str, seed: int) -> dict[str, Any]:
    theta = (0.5, 0.6, 1.0)[seed // 3 % 3]
    if method == "moreau":
        return {"theta": theta}
    if method in ("carpenter", "paoli_schatzman"):
        return {"damping": ("central", "lagged")[seed % 2], "heat": ("explicit", "implicit")[seed % 4 < 2]}
    options = {"stiffness": KAPPA, "damping": DAMPER * (seed % 2)}
    return options if method == "explicit penalty" else options | {"integration": "implicit", "theta": theta}


def both(method: str, structure: Structure, one: Cases, h: float = H, **options: Any) -> tuple[Results, Results]:
    """Return what a scheme and what plain matrices make of a case."""
    name = method.split()[-1]
    truth = results(structure, h, one, OVER, stepped_as(structure, h, name, options))
    return step(structure, one, h, OVER, name, **options), truth


def same_histories(ours: Results, truth: Results, *others: str) -> None:
    for name in (*HISTORIES, *others):
        values = truth.histories[name]
        within = 1e-9 * np.abs(values).max()
        np.testing.assert_allclose(ours.histories[name], values, rtol=0, atol=within, err_msg=name)


def closes(method: str, options: dict[str, Any], massless: bool) -> bool:
    """Tell whether the balance of energy closes: but for springs that begin and end, and damping of the θ-method."""
    if "theta" in options:
        return options["theta"] == 0.5 and (massless or method == "moreau")
    return "penalty" not in method


SCHEMES = {
    "moreau": (30, (False, True)),
    "carpenter": (3, (False,)),
    "paoli_schatzman": (3, (False,)),
    "explicit penalty": (3, (False,)),
    "implicit penalty": (3, (False, True)),
}
"""How many seeds are no slow tests, and whether contacts have no mass."""


@pytest.mark.parametrize(
    ("method", "massless", "seed"),
    [
        pytest.param(method, massless, seed, marks=pytest.mark.slow if seed >= quick else ())
        for method, (quick, each) in SCHEMES.items()
        for massless in each
        for seed in range(64)
    ],
)
def test_schemes_step_as_in_plain_matrices(method: str, massless: bool, seed: int) -> None:
    case, options = varied(seed, massless), options_of(method, seed)
    ours, truth = both(method, case.structure, case.cases, **options)
    assert ours.status.tolist() == [Status.OK], ours.messages
    same_histories(ours, truth, "sensor_value")
    for name in METRICS:
        np.testing.assert_allclose(ours.metrics[name], truth.metrics[name], rtol=1e-9, atol=1e-13, err_msg=name)
    assert abs(ours.metrics["heat_residual"][0]) < 1e-12
    if closes(method, options, massless):
        assert abs(ours.metrics["energy_residual"][0]) < 1e-12


@pytest.mark.parametrize("method", ["carpenter", "explicit penalty"])
@pytest.mark.parametrize("seed", [1, 4])
def test_central_differences_that_start_in_contact(method: str, seed: int) -> None:
    """All contacts are on their casings at t = 0 and approach them: p_0 spans half a step, that of a spring a whole."""
    case = varied(seed, massless=False)
    rows, given = case.structure.contacts.normal, case.cases
    x = rows @ given.displacement[0] + (1e-6 if method == "explicit penalty" else 0.0)
    speeds = np.linalg.pinv(rows) @ np.linspace(0.02, 0.04, len(rows))
    one = replace(given, gaps=given.gaps + x - place(given, 0.0), velocity=speeds[None])
    ours, truth = both(method, case.structure, one, **options_of(method, seed))
    first = truth.histories["impulse"][0, :, 1]
    assert (first > 0).sum() > 1
    same_histories(ours, truth)


@pytest.mark.parametrize("heat", ["explicit", "implicit"])
@pytest.mark.parametrize("coupled", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_sensors_of_central_differences_see_what_warms_without_loss(heat: str, coupled: bool) -> None:
    """Constant heating of a chain that loses no heat: temperatures and what they move grow without bound."""
    structure = heavy_chain(nodes=4, stiffness=4e6, convection=0.0, conductance=[0.0, 0.7, 0.7, 0.7]).matrices()
    structure = watched(with_dashpot(structure, 1, 3, 20.0) if coupled else structure)
    batch = cases(structure, alpha=20.0, gap=3e-5, amplitude=100.0, frequency=250.0, heating=2.0)
    ours, truth = both("carpenter", structure, batch, H / 4, heat=heat)
    values = truth.histories["sensor_value"]
    assert ours.metrics["impacts"][0] > 0
    for sensor in range(values.shape[1]):
        within = 1e-9 * np.abs(values[0, sensor]).max()
        np.testing.assert_allclose(ours.histories["sensor_value"][0, sensor], values[0, sensor], rtol=0, atol=within)


EXACT = Sampling(DURATION, DURATION / 200, 201)


def apart(values: Array, truth: Array) -> float:
    """Return the relative L2 distance over contacts and samples; 0 of what stays 0."""
    return relative(values, truth) if np.any(values != truth) else 0.0


@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("seed", [*range(2), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 50))])
def test_smaller_plain_steps_come_closer_to_the_exact_motion(seed: int, massless: bool) -> None:
    """At first order: 2000 steps come within a tenth of it, in most cases within a hundredth."""
    structure, case = drawn(seed, massless)
    exact = step(structure, case, H, EXACT, "event_driven")
    assert exact.status.tolist() == [Status.OK], exact.messages
    coarse, fine = (
        results(structure, h, case, EXACT, lambda one, n, h=h: march(structure, one, h, 0.5, n)).histories
        for h in (H, H / 4)
    )
    truth = exact.histories
    if massless or case.e[0] == 0.0:  # bounces make a motion chaotic
        distances = [apart(states["displacement"], truth["displacement"]) for states in (coarse, fine)]
        assert distances[1] < 0.6 * distances[0]
    for name in ("displacement", "impulse", "temperature"):
        assert apart(fine[name], truth[name]) < 0.15, name
