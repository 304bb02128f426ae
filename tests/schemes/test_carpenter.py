"""Carpenter's scheme against plain matrices, theory, exact solutions and the figures of its trial."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import plain_carpenter
import pytest
from plain_moreau import Trajectory

from scenes import cases, chain, heavy_chain, relative, sampling, siconos_chain, step
from workflow import models
from workflow.models import Cases, Rayleigh, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import Results, Sampling, Status, carpenter, limit_text

SICONOS_LIMITS = {"central": "1.0029e-04", "lagged": "9.08e-05"}
"""Largest stable steps of the Siconos chain, s, to the digits that the issue gives."""

OPTIONS = [{"damping": damping, "heat": heat} for damping in ("central", "lagged") for heat in ("explicit", "implicit")]


def everything_acts(structure: Structure, **values: Any) -> Cases:
    """A case with every load and initial state, which touches its casing many times."""
    rng = np.random.default_rng(1)
    n, m = structure.mechanical_size, structure.thermal_size
    acting = {
        "alpha": 30.0,
        "gap": 5e-5,
        "mean": 20.0,
        "amplitude": 100.0,
        "frequency": 200.0,
        "phase": 0.3,
        "steady": rng.normal(size=n),
        "heating": 10 * rng.normal(size=m),
        "temperature": rng.uniform(0, 3, m),
        "displacement": 1e-6 * rng.normal(size=n),
        "velocity": 1e-2 * rng.normal(size=n),
    }
    return cases(structure, **{**acting, **values})


def agree(results: Results, path: Trajectory, impulse: np.ndarray) -> None:
    """Compare all histories at the step ends, relative to their largest value."""
    tip = {"displacement": path.displacement, "velocity": path.velocity, "temperature": path.temperature}
    exact = {name: states[:, -1] for name, states in tip.items()} | {"impulse": impulse}
    for name, expected in exact.items():
        error = np.abs(results.histories[name][0] - expected).max() / np.abs(expected).max()
        assert error < 1e-10, (name, error)


def running_sum(p: np.ndarray) -> np.ndarray:
    """J at the step ends: half of the last p_k, the whole of p_0."""
    return np.concatenate([[0.0], p[0] / 2 + np.cumsum((p[1:] + p[:-1]) / 2)])


def audited(over: Sampling) -> Sampling:
    return replace(over, balances=True)


@pytest.mark.parametrize("options", OPTIONS, ids=lambda o: "-".join(o.values()))
@pytest.mark.parametrize("hot", [False, True], ids=["slow heat", "fast heat"])
def test_modal_kernel_is_the_scheme(options: dict[str, str], hot: bool) -> None:
    """Fast heat: thermal rates up to 0.7 of the explicit limit, so that steps change what modes drag along."""
    h = 1e-5
    structure = heavy_chain(convection=2e3, conductance=4e4) if hot else heavy_chain()
    largest = models.thermal_modes(structure).values.max() * h / 2
    assert (0.4 < largest < 1) == hot
    batch = everything_acts(structure)
    path = plain_carpenter.march(
        structure, batch, h, 1000, lagged=options["damping"] == "lagged", implicit=options["heat"] == "implicit"
    )
    assert np.sum(path.impulse > 0) > 100
    agree(step(structure, batch, h, sampling(1e-2, h), "carpenter", **options), path, running_sum(path.impulse))


@pytest.mark.parametrize("heat", ["explicit", "implicit"])
def test_a_pair_near_resonance_and_a_rate_of_one_per_step(heat: str) -> None:
    """A thermal mode as fast as an overdamped mechanical one, μ² - cμ + ω² = 0, and hμ = 1, where D = 0."""
    h = 0.125
    for rate in (1.0, 2.0, 1 / h):
        structure = chain(
            nodes=1, mass=1.0, stiffness=2.0, damping=Rayleigh(3.0, 0.0), spacing=1.0, expansion=0.1, convection=rate
        )
        batch = cases(structure, alpha=2.0, gap=0.05, mean=1.0, amplitude=1.0, frequency=0.2, temperature=1.0)
        path = plain_carpenter.march(structure, batch, h, 160, implicit=heat == "implicit")
        assert path.impulse.max() > 0
        results = step(structure, batch, h, sampling(20.0, h), "carpenter", heat=heat)
        agree(results, path, running_sum(path.impulse))


def test_free_and_adiabatic_bodies() -> None:
    """Rigid and adiabatic modes, reduced or not: their known answers are taken out of the modal states."""
    structure = heavy_chain(stiffness=tuple(2e7 * (np.arange(20) > 0)), conductance=0.0, convection=0.0)
    batch = everything_acts(structure)
    path = plain_carpenter.march(structure, batch, 1e-5, 500)
    agree(
        step(structure, batch, 1e-5, sampling(5e-3, 1e-5), "carpenter", heat="explicit"),
        path,
        running_sum(path.impulse),
    )
    reduction = reduce_structure(heavy_chain(), 3, 12)
    loaded = reduction.project(everything_acts(heavy_chain()))
    path = plain_carpenter.march(reduction.structure, loaded, 1e-5, 500)
    results = step(reduction.structure, loaded, 1e-5, sampling(5e-3, 1e-5), "carpenter", heat="explicit")
    agree(results, path, running_sum(path.impulse))


@pytest.mark.parametrize("damping", SICONOS_LIMITS)
def test_stability_limits_of_the_siconos_chain(damping: str) -> None:
    """By the eigenvalues, in the message, and in what a run does on either side."""
    structure = siconos_chain()
    omega = models.mechanical_modes(structure).values
    c, options = 1e-5 * omega**2, carpenter.Options(damping=damping)  # type: ignore[arg-type]

    def growth(h: float) -> float:
        return float(np.abs(carpenter.amplification(omega, c, h, options)).max()) - 1

    stable, unstable = 5e-5, 2e-4
    while unstable - stable > 1e-12:
        middle = (stable + unstable) / 2
        stable, unstable = (stable, middle) if growth(middle) > 1e-9 else (middle, unstable)
    stated = SICONOS_LIMITS[damping]
    print(f"{damping}: {stable:.7g} s")
    assert f"{stable:.{len(stated) - 6}e}" == stated
    if damping == "central":
        assert stable == pytest.approx(1.002943e-4, abs=0.5e-10)
    batch = cases(structure, gap=1e-4, amplitude=20.0, frequency=50.0)
    over = sampling(0.4, 1e-3)
    below = step(structure, batch, 0.999 * stable, over, "carpenter", damping=damping)
    above = step(structure, batch, 1.02 * stable, over, "carpenter", damping=damping)
    assert below.status[0] == Status.OK
    assert np.abs(below.histories["displacement"]).max() < 1e-3
    assert above.status[0] == Status.DIVERGED
    assert not np.abs(above.histories["displacement"]).max() < 1
    match = re.search(r"stable up to ([\d.e-]+) s", above.messages[0])
    assert match is not None
    assert float(match[1]) == pytest.approx(stable, rel=1e-6)


def test_the_heat_step_has_a_limit_of_its_own() -> None:
    """Explicit: 2/μ_max; implicit: none. Unheated cases carry no thermal state."""
    structure = heavy_chain(convection=2e3, conductance=7e4)
    limit = 2 / models.thermal_modes(structure).values.max()
    assert limit < 1.1e-5  # below that of the mechanics, 1.12e-5 s
    batch = cases(structure, 2, alpha=[0.0, 1.0], gap=5e-5, amplitude=100.0, frequency=200.0)
    over = sampling(0.02, 1e-3)
    assert np.all(step(structure, batch, 0.999 * limit, over, "carpenter", heat="explicit").status == Status.OK)
    beyond = step(structure, batch, 1.001 * limit, over, "carpenter", heat="explicit")
    assert beyond.status.tolist() == [Status.OK, Status.DIVERGED]
    assert beyond.messages[1].startswith("the explicit heat step grows")
    assert f"stable up to {limit_text(limit, 7)} s" in beyond.messages[1]
    assert np.all(step(structure, batch, 1.001 * limit, over, "carpenter", heat="implicit").status == Status.OK)


def test_figures_on_the_siconos_chain() -> None:
    """Rms error over gap against the exact solution with e = 0: 2.0e-2 at 1e-4 s, 2.0e-4 at 1e-5 s, and on."""
    structure, over = siconos_chain(), sampling(0.2, 1e-4)
    batch = cases(structure, gap=1e-4, amplitude=20.0, frequency=50.0)
    exact = step(structure, batch, 1.0, over, "event_driven").histories["displacement"]

    def error(h: float) -> float:
        displacement = step(structure, batch, h, over, "carpenter").histories["displacement"]
        return float(np.sqrt(np.mean((displacement - exact) ** 2)) / 1e-4)

    errors = [error(h) for h in (1e-4, 1e-5, 1e-6)]
    print("rms error over gap: " + ", ".join(f"{e:.2e}" for e in errors))
    assert [float(f"{e:.1e}") for e in errors[:2]] == [2.0e-2, 2.0e-4]
    assert errors[2] < 3e-6


def test_converges_with_order_two() -> None:
    """The heavy chain at e = 0: all errors fall with the square of the step while impacts keep their order."""
    structure, over, steps = heavy_chain(), sampling(0.3, 1e-3), (1e-5, 1e-6, 1e-7)
    batch = cases(structure, alpha=50.0, gap=5e-5, amplitude=100.0, frequency=20.0)
    exact = step(structure, batch, 1.0, over, "event_driven").histories
    errors = {name: [] for name in ("displacement", "temperature", "impulse")}
    for h in steps:
        histories = step(structure, batch, h, over, "carpenter").histories
        for name, values in errors.items():
            values.append(relative(histories[name], exact[name]))
    for name, values in errors.items():
        order = np.polyfit(np.log(steps), np.log(values), 1)[0]
        print(f"{name}: " + ", ".join(f"{e:.2e}" for e in values) + f", order {order:.2f}")
        assert order > (1.8 if name == "displacement" else 1.2)
    assert max(errors[name][2] for name in errors) < 1e-6


@pytest.mark.parametrize("h", [1e-2, 7e-3])
def test_a_single_mass_leaves_with_nothing(h: float) -> None:
    """It meets the casing at 2 m/s, stays where it is, and gives up its whole momentum; e is not there."""
    structure = chain(nodes=1, mass=3.0, stiffness=0.0)
    batch = cases(structure, 2, e=[0.0, 0.9], gap=[0.5, 9.0], velocity=2.0)
    results = step(structure, batch, h, sampling(1.0, 0.1), "carpenter")
    assert results.histories["velocity"][0, -1] == pytest.approx(0.0, abs=1e-12)
    assert results.histories["displacement"][0, -1] == pytest.approx(0.5, abs=1e-12)
    assert results.histories["impulse"][0, -1] == pytest.approx(6.0, rel=1e-12)
    assert results.metrics["impacts"].tolist() == [1, 0]
    assert results.metrics["effective_restitution"][0] == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(results.metrics["effective_restitution"][1])  # it met nothing


def test_impact_at_the_start_and_a_load_that_presses() -> None:
    """An impulse at t = 0 counts whole; then the force is the load."""
    structure = chain(nodes=1, mass=2.0, stiffness=0.0)
    batch = cases(structure, 2, gap=0.0, mean=5.0, velocity=[[3.0], [0.0]])
    results = step(structure, batch, 1e-3, sampling(1.0, 0.1), "carpenter")
    assert np.abs(results.histories["displacement"]).max() < 1e-15
    assert results.histories["impulse"][:, -1] == pytest.approx([2 * 3.0 + 5.0, 5.0], rel=1e-3)
    assert np.diff(results.histories["impulse"][1])[1:] == pytest.approx(0.5, rel=1e-12)
    assert results.metrics["max_penetration"].max() < 1e-15


def test_samples_keep_momentum_and_heat() -> None:
    """M (v - v_0) = -J and c (θ - θ_0) = αJ for a free body without loads and losses, at every sample."""
    structure = chain(nodes=1, mass=2.0, stiffness=0.0, heat_capacity=5.0)
    batch = cases(structure, alpha=0.7, gap=1.0, velocity=1.5)
    histories = step(structure, batch, 1e-2, sampling(2.0, 1e-2), "carpenter").histories
    assert 2.0 * (histories["velocity"] - 1.5) == pytest.approx(-histories["impulse"], abs=1e-12)
    assert 5.0 * histories["temperature"] == pytest.approx(0.7 * histories["impulse"], abs=1e-12)


@pytest.mark.parametrize("options", OPTIONS)
def test_energy_of_the_relative_motion_closes(options: dict[str, str]) -> None:
    """Whatever acts, and however damping and heat are differenced."""
    structure, h = heavy_chain(), 1e-5
    results = step(structure, everything_acts(structure), h, audited(sampling(2e-2, 2e-2)), "carpenter", **options)
    assert results.metrics["impacts"][0] > 0
    assert abs(results.metrics["energy_residual"][0]) < 1e-12


@pytest.mark.parametrize("heat", ["explicit", "implicit"])
def test_heat_is_kept(heat: str) -> None:
    structure = heavy_chain(convection=200.0)
    batch = cases(structure, alpha=30.0, gap=5e-5, amplitude=100.0, frequency=200.0)
    results = step(structure, batch, 1e-5, audited(sampling(0.02, 0.02)), "carpenter", heat=heat)
    assert results.metrics["impacts"][0] > 0
    assert abs(results.metrics["heat_residual"][0]) < 1e-12


def test_effective_restitution_vanishes_with_the_step() -> None:
    """On a chain a coarse step lets neighbours throw the tip back: what is measured tends to 0."""
    structure = siconos_chain()
    batch = cases(structure, gap=1e-4, amplitude=20.0, frequency=50.0)
    measured = [
        float(step(structure, batch, h, sampling(0.2, 1e-3), "carpenter").metrics["effective_restitution"][0])
        for h in (1e-4, 1e-5, 1e-6)
    ]
    print("effective restitution: " + ", ".join(f"{e:.1e}" for e in measured))
    assert 0.01 < measured[0] < 0.5
    assert abs(measured[1]) < 0.1 * measured[0]
    assert abs(measured[2]) < 0.1 * abs(measured[1])


@pytest.mark.parametrize("scheme", [carpenter.Options(), carpenter.Options(damping="lagged")])
def test_a_damped_rigid_mode_does_not_grow(scheme: carpenter.Options) -> None:
    """Its roots are 1 and the factor of damping; rounding made 1 + 1e-11 of 1, and sound cases were diverged."""
    steps, rates = np.geomspace(1e-9, 1e-3, 40), np.array([1e-3, 1.0, 10.0, 1e3])
    for h in steps:
        roots = carpenter.amplification(np.zeros(rates.size), rates, float(h), scheme)
        assert np.abs(roots).max() <= 1 + np.finfo(float).eps
