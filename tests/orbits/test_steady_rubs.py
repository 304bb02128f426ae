"""Steady rubs against closed forms, published orbits and long transients."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import blade, blade_rub, cases, chain, step
from workflow.models import Cases, Rayleigh, Structure, critical_alpha
from workflow.orbits import STATES, Options, steady_rubs
from workflow.reduction import reduce_structure
from workflow.schemes import Sampling

TURN = 2 * np.pi


def rub(structure: Structure, batch: Cases, **options: int) -> dict[str, Any]:
    values, (message,) = steady_rubs(structure, batch, Options(**options))
    numbers = {name: each[0].tolist() if each.ndim == 1 else each[0] for name, each in values.items()}
    return numbers | {"state": STATES[numbers["steady_state"]], "message": message}


def oscillator(damping: float = 0.0, flexibility: float = 0.0) -> Structure:
    own = chain(nodes=1, mass=1.0, stiffness=1.0, damping=Rayleigh(damping, 0.0))
    return own.on_casing(flexibility) if flexibility else own


def with_numbers(scene: Cases, **numbers: float) -> Cases:
    """The scene with other numbers of all its contacts or of its load, whose frequency may be ``omega``, rad/s."""
    if "omega" in numbers:
        numbers["frequency"] = numbers.pop("omega") / TURN
    load = {name: np.array([[numbers.pop(name)]]) for name in ("amplitude", "frequency") if name in numbers}
    own = {name: np.full_like(getattr(scene, name), value) for name, value in numbers.items()}
    return replace(scene, load_harmonics=replace(scene.load_harmonics, **load), **own)


def test_the_blade_settles_above_its_critical_coupling() -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    found = rub(structure, blade_rub(structure, alpha=5.0))
    assert (found["state"], found["message"], found["steady_periods"], found["steady_impacts"]) == ("settles", "", 1, 1)
    assert critical_alpha(structure) < 5.0
    assert found["steady_residual"] < 1e-10
    assert found["orbit_temperature"][0] == pytest.approx(48.59578199778, rel=1e-9)
    assert found["floquet_multiplier"] == pytest.approx(0.96052457446, rel=1e-9)
    assert found["floquet_angle"] == 0.0
    assert found["settling_time"] == pytest.approx(-0.2 / np.log(0.96052457446), rel=1e-8)
    # heat in is heat out: mean temperature 51.2 K by a mean contact force
    heat = 5.0 * found["steady_impulse"] / 0.2
    warm = np.linalg.solve(structure.conductance_matrix, heat * np.eye(structure.thermal_size)[-1])
    assert found["steady_mean_temperature"] == pytest.approx(warm[-1], rel=1e-9)
    assert found["steady_mean_temperature"] == pytest.approx(found["orbit_temperature"].mean(), rel=1e-3)
    assert found["steady_max_temperature"] == pytest.approx(found["orbit_temperature"].max(), rel=1e-3)
    assert found["steady_max_temperature"] >= found["orbit_temperature"].max()
    assert found["steady_max_displacement"] == pytest.approx(20e-6, rel=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
def test_its_transient_meets_the_orbit(e: float) -> None:
    """After 40 settling times of the mechanical part, without heat; accumulations included."""
    structure = reduce_structure(blade(), 3, 12).structure
    batch = blade_rub(structure, alpha=0.0, e=e)
    found = rub(structure, batch, samples=10)
    run = step(structure, batch, 1.0, Sampling(1.2, 0.02, 61), "event_driven")
    for name, largest in (("displacement", 24e-6), ("velocity", 1e-3)):
        np.testing.assert_allclose(found[f"orbit_{name}"], run.histories[name][0, 50:60], rtol=0, atol=1e-9 * largest)
    impulse = run.histories["impulse"][0]
    assert found["steady_impulse"] == pytest.approx(impulse[60] - impulse[50], rel=1e-9)
    assert found["steady_contact"] == pytest.approx(0.2 * run.period_contact[0, -1], rel=1e-9)


def pressed() -> Structure:
    """Four masses whose root spring is a fourth of 1 kN/m, warmed at the tip by a fourth of 0.3 W/K."""
    lumps = {"mass": 0.1, "stiffness": 4e3, "spacing": 0.01, "expansion": 1e-5, "heat_capacity": 2.0}
    return chain(nodes=4, damping=Rayleigh(40.0, 0.0), conductance=0.3, **lumps)


def test_what_touches_nothing_is_the_linear_response() -> None:
    """x = Im[H e^{i(ωt + φ)}], H = e_nᵀ (K1 + iωC1 - ω²M)⁻¹ e_n F, of a load with a harmonic."""
    structure = reduce_structure(blade(), 3, 12).structure
    harmonic = [[3.0, 50.0, 0.7]]
    batch = cases(structure, gap=1e-4, mean=4.0, amplitude=10.0, frequency=25.0, phase=0.3, load_harmonics=harmonic)
    found = rub(structure, batch, samples=50)
    t = np.arange(50) * 0.04 / 50
    K, C, M = structure.stiffness_matrix, structure.damping_matrix, structure.mass
    x = np.zeros(50)
    for force, frequency, phase in ((4.0, 0.0, np.pi / 2), (10.0, 25.0, 0.3), (3.0, 50.0, 0.7)):
        omega = TURN * frequency
        response = np.linalg.solve(K + 1j * omega * C - omega**2 * M, force * np.eye(len(K))[-1])[-1]
        x += (response * np.exp(1j * (omega * t + phase))).imag
    assert found["state"] == "no_contact"
    assert found["steady_impacts"] == found["steady_impulse"] == found["steady_contact"] == 0
    np.testing.assert_allclose(found["orbit_displacement"], x, rtol=0, atol=1e-12 * np.abs(x).max())
    assert found["steady_min_displacement"] == pytest.approx(x.min(), rel=1e-3)
    assert found["steady_min_displacement"] <= x.min()
    first = np.block([[0 * M, np.eye(len(M))], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    slowest = -np.linalg.eigvals(first).real.max()
    assert found["settling_time"] == pytest.approx(1 / slowest, rel=1e-6)


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_permanent_contact_under_a_constant_load(share: float) -> None:
    """λ = (F - k d/n)/(1 - α/α_c)."""
    structure = pressed()
    limit = critical_alpha(structure)
    batch = cases(structure, alpha=share * limit, gap=1e-3, mean=5.0, e=0.4)
    found = rub(structure, batch)
    force = (5.0 - 1e3 * 1e-3) / (1 - share)
    assert found["state"] == "permanent_contact"
    assert found["steady_impulse"] == pytest.approx(force, rel=1e-9)
    assert found["steady_mean_temperature"] == pytest.approx(share * limit * force / (0.3 / 4), rel=1e-9)
    assert found["steady_contact"] == pytest.approx(1.0, rel=1e-12)
    assert np.isnan(found["floquet_multiplier"])
    np.testing.assert_allclose(found["orbit_displacement"], 1e-3, rtol=1e-12)
    assert found["settling_time"] > 10.0


def test_above_the_critical_coupling_it_runs_away() -> None:
    structure = pressed()
    batch = cases(structure, alpha=1.1 * critical_alpha(structure), gap=1e-3, mean=5.0)
    found = rub(structure, batch)
    assert found["state"] == "runs_away"
    assert found["message"].startswith("steady: ")
    assert np.isnan(found["orbit_temperature"]).all()


def slow_heat() -> Structure:
    """Four masses that take 18 s to warm up, 900 periods of a load of 50 Hz."""
    lumps = {"mass": 2.5e-3, "stiffness": 4e6, "spacing": 2.5e-3, "expansion": 8.6e-6, "heat_capacity": 1.3}
    return chain(nodes=4, damping=Rayleigh(10.0, 2e-7), conductance=0.6, convection=0.02, **lumps)


def test_slow_heat_is_found_by_its_balance() -> None:
    """After 1 000 periods the tip has a half of its temperature; on its way there it decays as the multiplier says."""
    structure = slow_heat()
    batch = cases(structure, alpha=5.0, gap=50e-6, amplitude=100.0, frequency=50.0)
    found = rub(structure, batch)
    assert found["state"] == "settles"
    run = step(structure, batch, 1.0, Sampling(80.0, 20.0, 5), "event_driven")
    away = found["orbit_temperature"][0] - run.histories["temperature"][0]
    assert 0.3 < away[1] / away[0] < 0.6
    assert away[4] / away[3] == pytest.approx(np.exp(-20 / found["settling_time"]), rel=0.03)


def test_slow_heat_without_a_balance_runs_away() -> None:
    structure = slow_heat()
    batch = cases(structure, alpha=10.0, gap=50e-6, amplitude=100.0, frequency=50.0)
    assert rub(structure, batch)["state"] == "runs_away"
    run = step(structure, batch, 1.0, Sampling(80.0, 10.0, 9), "event_driven")
    warming = np.diff(run.histories["temperature"][0])
    assert np.all(np.diff(warming[4:]) > 0)


def light_heat() -> Structure:
    """Eight masses whose heat is as fast as they are."""
    lumps = {"mass": 1.85, "stiffness": 3190.0, "spacing": 0.1, "expansion": 2.04e-3, "heat_capacity": 0.21}
    return chain(nodes=8, conductance=3.36, convection=0.16, damping=Rayleigh(0.6, 3e-4), **lumps)


def test_it_runs_away_without_a_whole_period_in_contact_too() -> None:
    """An intermittent rub whose temperature grows fourfold in each common period of casing and load."""
    structure, frequency = light_heat(), 0.716
    harmonics = {
        "casing_harmonics": [[0.0139, 1.5 * frequency, 3.73]],
        "load_harmonics": [[9.2, 3 * frequency, 1.29]],
    }
    scene = {"mean": -1.0, "amplitude": 18.6, "frequency": frequency, "phase": 3.03, **harmonics}
    start = np.linspace(0, -7.4e-3, 9)[1:]
    batch = cases(structure, alpha=4.52, e=0.25, gap=4.5e-4, displacement=start, **scene)
    found = rub(structure, batch)
    assert found["state"] == "runs_away"
    assert found["message"].endswith("grows without bound")


def test_loads_without_a_common_period_are_said_so() -> None:
    batch = cases(oscillator(0.1), gap=1.0, amplitude=1.0, frequency=1.0, load_harmonics=[[1.0, np.sqrt(2), 0.0]])
    found = rub(oscillator(0.1), batch)
    assert found["state"] == "not_found"
    assert "common period" in found["message"]


def test_what_does_not_repeat_has_an_exponent() -> None:
    """Chaos of the oscillator of Shaw and Holmes, by two motions that part from 1e-9 for ten periods."""
    structure, omega = oscillator(), 2.84
    scene = {"e": 0.8, "amplitude": 1.0, "frequency": omega / TURN, "phase": np.pi / 2}
    found = rub(structure, cases(structure, displacement=-0.5, **scene))
    assert found["state"] == "not_found"
    starts = np.linspace(-0.5, -1.5, 40)
    both = cases(structure, 80, displacement=np.repeat(starts, 2)[:, None] + np.tile([[0], [1e-9]], (40, 1)), **scene)
    period = TURN / omega
    run = step(structure, both, 1.0, Sampling(60 * period, period, 61), "event_driven").histories
    apart = np.hypot(
        np.diff(run["displacement"].reshape(40, 2, -1), axis=1), np.diff(run["velocity"].reshape(40, 2, -1), axis=1)
    )
    grown = np.log(apart[:, 0, 20] / apart[:, 0, 10]).mean() / (10 * period)
    assert found["lyapunov"] == pytest.approx(grown, rel=0.3)
