"""Every law that is stepped against plain matrices: random structures of one to five contacts, and scenes of one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contacts.random_contacts import drawn, varied
from plain_steps import place, results, stepped_as
from scenes import WAVES, cases, chain, everything_acts, heavy_chain, sampling, step, watched, with_dashpot
from workflow import models
from workflow.models import Cases, Rayleigh, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import Results, Sampling, moreau

SLOW = pytest.mark.slow


def agree(
    structure: Structure, batch: Cases, method: str, h: float, over: Sampling, within: float = 1e-10, **options: Any
) -> tuple[Results, Results]:
    """Compare what a scheme and what plain matrices make of cases: all histories of each contact, and of each sensor.

    Distances are relative to the largest value of each.
    """
    ours = step(structure, batch, h, over, method, **options)
    truth = results(structure, h, batch, over, stepped_as(structure, h, method, options))
    assert not ours.status.any(), ours.messages
    for name, values in truth.histories.items():
        found, expected = (each.reshape(-1, over.count) for each in (ours.histories[name], values))
        error, largest = np.abs(found - expected).max(axis=1), np.abs(expected).max(axis=1)
        assert np.all(error <= within * largest), (name, error / largest)
    return ours, truth


H, OVER = 4e-5, sampling(0.006, 5e-5)
METRICS = ("impacts", "contact_time", "max_penetration", "max_temperature", "thermal_closing")
STEPPED = {
    "moreau": (6, (False, True)),
    "carpenter": (1, (False,)),
    "paoli_schatzman": (1, (False,)),
    "explicit penalty": (1, (False,)),
    "implicit penalty": (1, (False, True)),
}
"""How many seeds are no slow tests, and whether contacts have no mass."""


def options_of(method: str, seed: int) -> dict[str, Any]:
    theta = (0.5, 0.6, 1.0)[seed // 3 % 3]
    if method == "moreau":
        return {"theta": theta}
    if method in ("carpenter", "paoli_schatzman"):
        return {"damping": ("central", "lagged")[seed % 2], "heat": ("explicit", "implicit")[seed % 4 < 2]}
    options = {"stiffness": 3e6, "damping": 150.0 * (seed % 2)}
    return options if method == "explicit penalty" else options | {"integration": "implicit", "theta": theta}


def closes(method: str, options: dict[str, Any], massless: bool) -> bool:
    """Tell whether the balance of energy closes: but for springs that begin and end, and damping of the θ-method."""
    if "theta" in options:
        return options["theta"] == 0.5 and (massless or method == "moreau")
    return "penalty" not in method


@pytest.mark.parametrize(
    ("method", "massless", "seed"),
    [
        pytest.param(method, massless, seed, marks=SLOW if seed >= quick else ())
        for method, (quick, each) in STEPPED.items()
        for massless in each
        for seed in range(64)
    ],
)
def test_random_structures(method: str, massless: bool, seed: int) -> None:
    """On all bases, with metrics and balances."""
    case, options = varied(seed, massless), options_of(method, seed)
    ours, truth = agree(case.structure, case.cases, method.split()[-1], H, OVER, 1e-9, **options)
    for name in METRICS:
        np.testing.assert_allclose(ours.metrics[name], truth.metrics[name], rtol=1e-9, atol=1e-13, err_msg=name)
    assert abs(ours.metrics["heat_residual"][0]) < 1e-12
    if closes(method, options, massless):
        assert abs(ours.metrics["energy_residual"][0]) < 1e-12


@pytest.mark.parametrize("theta", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("seed", range(2))
def test_any_weight_of_the_end_steps_contacts_without_mass(seed: int, theta: float) -> None:
    """Explicit steps, θ = 0, are stable up to the damping of the modes."""
    case = drawn(seed, massless=True)
    agree(case.structure, case.cases, "moreau", 2e-6, sampling(2e-3, 2e-5), 1e-9, theta=theta)


@pytest.mark.parametrize("method", ["carpenter", "explicit penalty"])
@pytest.mark.parametrize("seed", [1, 4])
def test_central_differences_that_start_in_contact(method: str, seed: int) -> None:
    """All contacts are on their casings at t = 0 and approach them: p_0 spans half a step, that of a spring a whole."""
    case = varied(seed, massless=False)
    rows, given = case.structure.contacts.normal, case.cases
    x = rows @ given.displacement[0] + (1e-6 if method == "explicit penalty" else 0.0)
    speeds = np.linalg.pinv(rows) @ np.linspace(0.02, 0.04, len(rows))
    one = replace(given, gaps=given.gaps + x - place(given, 0.0), velocity=speeds[None])
    _, truth = agree(case.structure, one, method.split()[-1], H, OVER, 1e-9, **options_of(method, seed))
    assert (truth.histories["impulse"][0, :, 1] > 0).sum() > 1


SPRINGS = [(2e7, 0.0), (1e8, 50.0), (1e6, 2000.0)]
"""Stiffness and damping: the structure's own, stiffer with some damping, and nearly all damping."""

Law = tuple[str, dict[str, Any]]
CENTRAL: dict[str, Law] = {
    f"{damping}, {heat} heat": ("carpenter", {"damping": damping, "heat": heat})
    for damping in ("central", "lagged")
    for heat in ("explicit", "implicit")
}
EXPLICIT: dict[str, Law] = {f"spring {k:g} {c:g}": ("penalty", {"stiffness": k, "damping": c}) for k, c in SPRINGS}
IMPLICIT: dict[str, Law] = {
    f"implicit {name}, {theta}": (method, {**options, "integration": "implicit", "theta": theta})
    for name, (method, options) in EXPLICIT.items()
    for theta in (0.5, 0.8, 1.0)
}
THETA: dict[str, Law] = {f"moreau {theta}": ("moreau", {"theta": theta}) for theta in (0.5, 0.7, 1.0)}
CONSERVING = ("moreau 0.5", *CENTRAL)
CENTRAL["paoli_schatzman"] = ("paoli_schatzman", {"heat": "implicit"})
LAWS = THETA | CENTRAL | EXPLICIT | IMPLICIT


def by_law(law: str, structure: Structure, batch: Cases, h: float, steps: int) -> tuple[Results, Results]:
    """Compare at all step ends, by a law."""
    method, options = LAWS[law]
    return agree(watched(structure), batch, method, h, sampling(steps * h, h), **options)


@pytest.mark.parametrize(
    ("law", "moves"),
    [
        pytest.param(law, moves, marks=SLOW if moves and law != "moreau 0.5" else ())
        for law in LAWS
        for moves in (False, True)
    ],
)
def test_a_chain_on_which_everything_acts(law: str, moves: bool) -> None:
    """With balances; a casing in motion and harmonics of the load, too."""
    small = law in EXPLICIT or (moves and law in CENTRAL)
    structure, (h, steps) = heavy_chain(), (5e-6, 2000) if small else (1e-5, 1000)
    batch = everything_acts(structure, e=0.5, **(WAVES if moves else {}))
    ours, truth = by_law(law, structure, batch, h, steps)
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
    by_law(law, structure, everything_acts(structure), h, 1000)


BALANCED = pytest.mark.parametrize("law", ["moreau 0.5", "central, explicit heat", "central, implicit heat"])
"""Laws whose balance of energy closes."""


@BALANCED
def test_a_pair_near_resonance_and_a_rate_of_one_per_step(law: str) -> None:
    """A thermal mode as fast as an overdamped mechanical one, μ² - cμ + ω² = 0, and hμ = 1, where D = 0."""
    h, lump = 0.125, {"mass": 1.0, "stiffness": 2.0, "spacing": 1.0, "expansion": 0.1}
    for rate in (1.0, 2.0, 1 / h):
        structure = chain(nodes=1, damping=Rayleigh(3.0, 0.0), convection=rate, **lump)
        batch = cases(structure, alpha=2.0, gap=0.05, mean=1.0, amplitude=1.0, frequency=0.2, temperature=1.0)
        ours, _ = by_law(law, structure, batch, h, 160)
        assert ours.histories["impulse"][0, -1] > 0
        assert (moreau.init(structure, h, moreau.Options(theta=0.5)).blocks.pairs.size > 0) == (rate in (1.0, 2.0))
        assert abs(ours.metrics["energy_residual"][0]) < 1e-12


@BALANCED
def test_free_and_adiabatic_bodies(law: str) -> None:
    """Rigid modes and heat that cannot leave, reduced or not: their known answers are taken out of the modal states."""
    free = heavy_chain(stiffness=tuple(2e7 * (np.arange(20) > 0)), conductance=0.0, convection=0.0)
    reduction = reduce_structure(heavy_chain(), 3, 12)
    reduced = reduction.structure, reduction.project(everything_acts(heavy_chain()))
    for structure, batch in ((free, everything_acts(free)), reduced):
        ours, _ = by_law(law, structure, batch, 1e-5, 500)
        assert abs(ours.metrics["energy_residual"][0]) < 1e-12


@pytest.mark.parametrize(
    "law", ["moreau 0.5", *(pytest.param(f"central, {kind} heat", marks=SLOW) for kind in ("explicit", "implicit"))]
)
def test_a_free_body_whose_damping_couples_its_modes(law: str) -> None:
    """Blocks keep no place of the rigid motion: sensors have it from the tip; of the heat nothing is lost."""
    kept = {"stiffness": tuple(2e7 * (np.arange(6) > 0)), "conductance": (0.0, *[0.605] * 5), "convection": 0.0}
    free = with_dashpot(heavy_chain(nodes=6, **kept), 1, 3, 20.0)
    loads = {"mean": 30.0, "amplitude": 900.0, "frequency": 300.0, "phase": 0.3, "steady": 2.0, "heating": 0.3}
    batch = cases(free, e=0.5, alpha=8.0, gap=5e-5, temperature=1.0, velocity=0.01, **loads, **WAVES)
    by_law(law, free, batch, 5e-6, 400)


@pytest.mark.parametrize("link", [0.0, 1e-20, 1e-9])
def test_heat_that_hardly_reaches_the_tip(link: float) -> None:
    """Thermal modes with no or next to no share in the tip's temperature still move the tip."""
    lumps = {"mass": 1.0, "stiffness": 4.0, "damping": Rayleigh(0.1, 0.01), "spacing": 1.0, "expansion": 0.05}
    structure = chain(nodes=5, conductance=[0.7, 0.7, 0.7, 0.7, link], **lumps)
    batch = cases(structure, e=0.5, alpha=0.3, gap=0.2, amplitude=2.0, frequency=0.1, temperature=[[1, 2, 3, 2, 0]])
    _, truth = by_law("moreau 0.7", structure, batch, 0.05, 200)
    assert truth.histories["impulse"][0, -1] > 0


@pytest.mark.parametrize("count", [1, 11])
def test_without_weight_at_the_end_of_the_step_contact_begins_all_the_same(count: int) -> None:
    """θ = 0: the first force of a contact takes no impulse in its own step."""
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    batch = cases(structure, count, gap=0.01, velocity=1.0)
    options = {"stiffness": 1e4, "integration": "implicit", "theta": 0.0}
    _, truth = agree(structure, batch, "penalty", 1e-3, sampling(0.06, 1e-3), **options)
    assert np.sum(np.diff(truth.histories["impulse"][0]) > 0) > 20
