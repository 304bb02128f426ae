"""Every law that is stepped against plain matrices: in modes, in blocks, on casings in motion, without mass."""

from typing import Any

import numpy as np
import pytest

import plain_steps
from plain_steps import Motion
from scenes import (
    WAVES,
    cases,
    chain,
    everything_acts,
    heavy_chain,
    sampling,
    step,
    watched,
    with_dashpot,
)
from workflow import models
from workflow.models import Cases, Rayleigh, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import Results

SLOW = pytest.mark.slow

SPRINGS = [(2e7, 0.0), (1e8, 50.0), (1e6, 2000.0)]
"""Stiffness and damping: the structure's own, stiffer with some damping, and nearly all damping."""

CENTRAL: dict[str, tuple[str, dict[str, Any]]] = {
    f"{damping}, {heat} heat": ("carpenter", {"damping": damping, "heat": heat})
    for damping in ("central", "lagged")
    for heat in ("explicit", "implicit")
}
EXPLICIT = {f"spring {k:g} {c:g}": ("penalty", {"stiffness": k, "damping": c}) for k, c in SPRINGS}
IMPLICIT = {
    f"implicit spring {k:g} {c:g}, {theta}": (
        "penalty",
        {"stiffness": k, "damping": c, "integration": "implicit", "theta": theta},
    )
    for k, c in SPRINGS
    for theta in (0.5, 0.8, 1.0)
}
THETA = {f"moreau {theta}": ("moreau", {"theta": theta}) for theta in (0.5, 0.7, 1.0)}
CONSERVING = ("moreau 0.5", *CENTRAL)
CENTRAL["paoli_schatzman"] = ("paoli_schatzman", {"heat": "implicit"})
LAWS = THETA | CENTRAL | EXPLICIT | IMPLICIT


def march(law: str, structure: Structure, case: Cases, h: float, steps: int) -> Motion:
    method, options = LAWS[law]
    if law in CENTRAL:
        newton = plain_steps.rebound(float(case.e[0]) if method == "paoli_schatzman" else 0.0)
        how = {"lagged": options.get("damping") == "lagged", "implicit": options["heat"] == "implicit"}
        return plain_steps.march_centrally(structure, case, h, steps, newton, **how)
    if law in EXPLICIT:
        spring = plain_steps.central_spring(h, options["stiffness"], options["damping"])
        return plain_steps.march_centrally(structure, case, h, steps, spring)
    theta = options["theta"]
    sprung = plain_steps.spring(h, theta, options["stiffness"], options["damping"]) if law in IMPLICIT else None
    return plain_steps.march(structure, case, h, theta, steps, sprung)


def agree(structure: Structure, results: Results, path: Motion) -> None:
    """Compare all histories of a case at the step ends, relative to their largest value."""
    tip = {name: getattr(path, name)[:, -1] for name in ("displacement", "velocity", "temperature")}
    for name, expected in (tip | {"impulse": np.cumsum(path.impulse)}).items():
        error = np.abs(results.histories[name][0] - expected).max() / np.abs(expected).max()
        assert error < 1e-10, (name, error)
    same_sensors(results, structure, 0, path, 1e-10)


def same_sensors(results: Results, structure: Structure, case: int, path: Motion, within: float) -> None:
    """Compare what sensors of :func:`scenes.watched` show with the rows of the whole motion."""
    sensors = watched(structure).sensors
    expected = sensors.of(path.displacement, path.temperature).T
    error = np.abs(results.histories["sensor_value"][case] - expected).max(axis=1)
    assert np.all(error < within * np.abs(expected).max(axis=1)), error


def stepped(law: str, structure: Structure, batch: Cases, h: float, steps: int) -> Results:
    method, options = LAWS[law]
    return step(watched(structure), batch, h, sampling(steps * h, h, balances=True), method, **options)


@pytest.mark.parametrize(
    ("law", "moves"),
    [
        *((law, False) for law in LAWS),
        *(
            pytest.param(law, True, marks=() if law == "moreau 0.5" else SLOW)
            for law in (
                *THETA,
                *CENTRAL,
                "spring 1e+08 50",
                "implicit spring 1e+08 50, 0.5",
                "implicit spring 1e+08 50, 1.0",
            )
        ),
    ],
)
def test_a_chain_on_which_everything_acts(law: str, moves: bool) -> None:
    """With balances; a casing in motion and harmonics of the load, too."""
    structure, (h, steps) = (
        heavy_chain(),
        (5e-6, 2000) if law in EXPLICIT or (moves and law in CENTRAL) else (1e-5, 1000),
    )
    batch = everything_acts(structure, e=0.5, **(WAVES if moves else {}))
    path = march(law, structure, batch, h, steps)
    assert np.sum(path.impulse > 0) > (20 if law in THETA else 100)
    results = stepped(law, structure, batch, h, steps)
    agree(structure, results, path)
    assert law not in CONSERVING or np.abs(results.metrics["energy_residual"]).max() < 1e-11
    if law in CENTRAL and law != "paoli_schatzman":  # no penetration, but for rounding
        casing = np.concatenate([plain_steps.place(batch, k * h) for k in range(steps + 1)])
        assert np.max(results.histories["displacement"][0] - casing) < 1e-19


@pytest.mark.parametrize("law", CENTRAL)
def test_fast_heat(law: str) -> None:
    """Thermal rates up to 0.7 of the explicit limit, so that steps change what modes drag along."""
    structure, h = heavy_chain(convection=2e3, conductance=4e4), 1e-5
    assert 0.4 < models.thermal_modes(structure).values.max() * h / 2 < 1
    batch = everything_acts(structure)
    agree(structure, stepped(law, structure, batch, h, 1000), march(law, structure, batch, h, 1000))


@pytest.mark.parametrize("law", ["central, explicit heat", "central, implicit heat"])
def test_a_pair_near_resonance_and_a_rate_of_one_per_step(law: str) -> None:
    """A thermal mode as fast as an overdamped mechanical one, μ² - cμ + ω² = 0, and hμ = 1, where D = 0."""
    h = 0.125
    for rate in (1.0, 2.0, 1 / h):
        structure = chain(
            nodes=1, mass=1.0, stiffness=2.0, damping=Rayleigh(3.0, 0.0), spacing=1.0, expansion=0.1, convection=rate
        )
        batch = cases(structure, alpha=2.0, gap=0.05, mean=1.0, amplitude=1.0, frequency=0.2, temperature=1.0)
        path = march(law, structure, batch, h, 160)
        assert path.impulse.max() > 0
        agree(structure, stepped(law, structure, batch, h, 160), path)


def test_free_and_adiabatic_bodies() -> None:
    """Rigid and adiabatic modes, reduced or not: their known answers are taken out of the modal states."""
    free = heavy_chain(stiffness=tuple(2e7 * (np.arange(20) > 0)), conductance=0.0, convection=0.0)
    reduction = reduce_structure(heavy_chain(), 3, 12)
    law = "central, explicit heat"
    for structure, batch in (
        (free, everything_acts(free)),
        (reduction.structure, reduction.project(everything_acts(heavy_chain()))),
    ):
        agree(structure, stepped(law, structure, batch, 1e-5, 500), march(law, structure, batch, 1e-5, 500))


@pytest.mark.parametrize("law", ["moreau 0.5", "central, implicit heat"])
def test_a_free_body_whose_damping_couples_its_modes(law: str) -> None:
    """Blocks keep no place of the rigid motion: sensors have it from the tip."""
    free = with_dashpot(heavy_chain(nodes=6, stiffness=tuple(2e7 * (np.arange(6) > 0))), 1, 3, 20.0)
    loads = {"mean": 30.0, "amplitude": 900.0, "frequency": 300.0, "phase": 0.3, "steady": 2.0, "heating": 0.3}
    batch = cases(free, e=0.5, alpha=8.0, gap=5e-5, temperature=1.0, velocity=0.01, **loads, **WAVES)
    agree(free, stepped(law, free, batch, 5e-6, 400), march(law, free, batch, 5e-6, 400))
