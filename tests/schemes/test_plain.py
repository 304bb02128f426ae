"""Every law that is stepped against plain matrices: in modes, in blocks, on casings in motion, without mass."""

from typing import Any

import numpy as np
import pytest

from plain_steps import place, results, stepped_as
from scenes import WAVES, cases, chain, everything_acts, heavy_chain, sampling, step, watched, with_dashpot
from workflow import models
from workflow.models import Cases, Rayleigh, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import HISTORIES, Results

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


def agree(law: str, structure: Structure, batch: Cases, h: float, steps: int) -> tuple[Results, Results]:
    """Compare all histories at the step ends, each and those of every sensor, relative to its largest value."""
    (method, options), over, whole = LAWS[law], sampling(steps * h, h), watched(structure)
    ours = step(whole, batch, h, over, method, **options)
    truth = results(whole, h, batch, over, stepped_as(whole, h, method, options))
    for name in (*HISTORIES, "sensor_value"):
        found, expected = (np.atleast_2d(each.histories[name][0]) for each in (ours, truth))
        error = np.abs(found - expected).max(axis=1) / np.abs(expected).max(axis=1)
        assert np.all(error < 1e-10), (name, error)
    return ours, truth


@pytest.mark.parametrize(
    ("law", "moves"),
    [
        pytest.param(law, moves, marks=pytest.mark.slow if moves and law != "moreau 0.5" else ())
        for law in LAWS
        for moves in (False, True)
    ],
)
def test_a_chain_on_which_everything_acts(law: str, moves: bool) -> None:
    """With balances; a casing in motion and harmonics of the load, too."""
    small = law in EXPLICIT or (moves and law in CENTRAL)
    structure, (h, steps) = heavy_chain(), (5e-6, 2000) if small else (1e-5, 1000)
    batch = everything_acts(structure, e=0.5, **(WAVES if moves else {}))
    ours, truth = agree(law, structure, batch, h, steps)
    assert np.sum(np.diff(truth.histories["impulse"][0]) > 0) > (20 if law in THETA else 100)
    assert law not in CONSERVING or np.abs(ours.metrics["energy_residual"]).max() < 1e-11
    if law in CENTRAL and law != "paoli_schatzman":  # no penetration, but for rounding
        casing = np.concatenate([place(batch, k * h) for k in range(steps + 1)])
        assert np.max(ours.histories["displacement"][0] - casing) < 1e-19


@pytest.mark.parametrize("law", CENTRAL)
def test_fast_heat(law: str) -> None:
    """Thermal rates up to 0.7 of the explicit limit, so that steps change what modes drag along."""
    structure, h = heavy_chain(convection=2e3, conductance=4e4), 1e-5
    assert 0.4 < models.thermal_modes(structure).values.max() * h / 2 < 1
    batch = everything_acts(structure)
    agree(law, structure, batch, h, 1000)


@pytest.mark.parametrize("law", ["central, explicit heat", "central, implicit heat"])
def test_a_pair_near_resonance_and_a_rate_of_one_per_step(law: str) -> None:
    """A thermal mode as fast as an overdamped mechanical one, μ² - cμ + ω² = 0, and hμ = 1, where D = 0."""
    h = 0.125
    for rate in (1.0, 2.0, 1 / h):
        structure = chain(
            nodes=1, mass=1.0, stiffness=2.0, damping=Rayleigh(3.0, 0.0), spacing=1.0, expansion=0.1, convection=rate
        )
        batch = cases(structure, alpha=2.0, gap=0.05, mean=1.0, amplitude=1.0, frequency=0.2, temperature=1.0)
        ours, _ = agree(law, structure, batch, h, 160)
        assert ours.histories["impulse"][0, -1] > 0


def test_free_and_adiabatic_bodies() -> None:
    """Rigid and adiabatic modes, reduced or not: their known answers are taken out of the modal states."""
    free = heavy_chain(stiffness=tuple(2e7 * (np.arange(20) > 0)), conductance=0.0, convection=0.0)
    reduction = reduce_structure(heavy_chain(), 3, 12)
    for structure, batch in (
        (free, everything_acts(free)),
        (reduction.structure, reduction.project(everything_acts(heavy_chain()))),
    ):
        agree("central, explicit heat", structure, batch, 1e-5, 500)


@pytest.mark.parametrize("law", ["moreau 0.5", pytest.param("central, implicit heat", marks=pytest.mark.slow)])
def test_a_free_body_whose_damping_couples_its_modes(law: str) -> None:
    """Blocks keep no place of the rigid motion: sensors have it from the tip."""
    free = with_dashpot(heavy_chain(nodes=6, stiffness=tuple(2e7 * (np.arange(6) > 0))), 1, 3, 20.0)
    loads = {"mean": 30.0, "amplitude": 900.0, "frequency": 300.0, "phase": 0.3, "steady": 2.0, "heating": 0.3}
    batch = cases(free, e=0.5, alpha=8.0, gap=5e-5, temperature=1.0, velocity=0.01, **loads, **WAVES)
    agree(law, free, batch, 5e-6, 400)
