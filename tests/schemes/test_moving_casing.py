"""A casing that moves and loads with harmonics, stepped: plain matrices, a pressed tip, closed forms, other chains."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import plain_casing
import pytest

from scenes import cases, chain, sampling, step, with_dashpot
from workflow.models import Cases, Rayleigh, Structure, static_equilibrium
from workflow.schemes import Recorder

CHAIN = chain(nodes=3, mass=0.01, stiffness=1e5, damping=Rayleigh(10.0, 0.0))
COUPLED = with_dashpot(CHAIN, 0, 1, 5.0)
ELSEWHERE = replace(COUPLED, load=np.array([0.0, 1.0, 0.5]))


def pressed(structure: Structure = CHAIN) -> Cases:
    """A chain pressed on its casing at t = 0, in equilibrium with its constant load."""
    batch = cases(structure, gap=1e-5, mean=20.0, casing_harmonics=[[5e-6, 50.0, 0.3], [2e-6, 150.0, 1.0]])
    x, _ = static_equilibrium(structure, 20.0 * structure.load_direction, np.zeros(3), float(batch.casing_at(0.0)[0]))
    v = np.zeros((1, 3))
    v[:, -1] = batch.casing_velocity_at(0.0)
    return replace(batch, displacement=x[None], velocity=v)


MIDPOINT, EULER = (("moreau", {"theta": theta}) for theta in (0.5, 1.0))


@pytest.mark.parametrize(
    ("structure", "scheme"),
    [
        (CHAIN, MIDPOINT),
        (COUPLED, MIDPOINT),
        (COUPLED, EULER),
        (CHAIN, ("event_driven", {})),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((CHAIN, EULER), (ELSEWHERE, MIDPOINT))),
    ],
)
def test_a_pressed_tip_follows_the_casing_for_a_thousand_periods(structure: Structure, scheme: Any) -> None:
    """Rounding of the time: eps t ḋ, 2e-16 · 20 s · 3.5e-3 m/s."""
    batch, over, (method, options) = pressed(structure), sampling(20.0, 0.01, balances=structure is CHAIN), scheme
    results = step(structure, batch, 1e-4, over, method, **options)
    assert results.metrics["impacts"] == (method == "moreau")
    assert results.metrics["contact_time"] == pytest.approx(20.0, rel=1e-10)  # 2e5 additions of h
    assert results.metrics["max_penetration"] < 2e-17
    place = np.array([plain_casing.place(batch, t) for t in over.times])
    assert np.abs(results.histories["displacement"][0] - place).max() < 2e-17
    if method == "event_driven":
        speed = np.concatenate([batch.casing_velocity_at(t) for t in over.times])
        assert np.abs(results.histories["velocity"][0] - speed).max() < 1e-11 * np.abs(speed).max()  # of its phase


def test_a_scheme_of_plain_states_ends_on_its_casing_within_a_step() -> None:
    """The casing comes inwards while the duration ends a third into a step: a pressed tip is on it, by rounding.

    Counted against the casing at the step's end it would be beyond it by two thirds of the casing's way in the step.
    """
    structure, batch = CHAIN, pressed()
    h, steps = 1e-4, 80
    over = sampling((steps - 2 / 3) * h, (steps - 2 / 3) * h)
    path = step(structure, batch, h, sampling(steps * h, h), theta=0.5)
    x, v = path.histories["displacement"][0], path.histories["velocity"][0]
    recorded = Recorder(structure, batch, over, h)
    for k in range(1, steps + 1):
        recorded.record(np.full((1, 3), x[k]), np.full((1, 3), v[k]), np.zeros((1, 3)), np.ones(1))
    results = recorded.results()
    inwards = float((batch.casing_at((steps - 1) * h) - batch.casing_at(steps * h))[0])
    assert inwards > 1e-8
    assert results.histories["displacement"][0, -1] == pytest.approx(x[-2] + (x[-1] - x[-2]) / 3, rel=1e-12)
    assert results.metrics["max_penetration"][0] < 1e-9 * inwards


def test_the_force_of_a_pressed_tip_is_what_its_casing_asks_for() -> None:
    """J = ∫ (F0 + f - m d̈ - c ḋ - k d) dt of a mass held on its casing: steps err by second order."""
    mass, stiffness, damping = 0.01, 1e4, 0.02
    structure = chain(nodes=1, mass=mass, stiffness=stiffness, damping=Rayleigh(damping / mass, 0.0))
    waves = {"casing_harmonics": [[5e-6, 50.0, 0.3]], "load_harmonics": [[3.0, 70.0, 0.2]]}
    batch = cases(structure, gap=1e-5, mean=20.0, **waves)
    begins, speed = batch.casing_at(0.0), batch.casing_velocity_at(0.0)
    batch = replace(batch, displacement=begins[:, None], velocity=speed[:, None])
    t, turn, load_turn = 0.033, 2 * np.pi * 50.0, 2 * np.pi * 70.0
    moved = 1e-5 * t + 5e-6 * (np.cos(0.3) - np.cos(turn * t + 0.3)) / turn
    pushed = 20.0 * t + 3.0 * (np.cos(0.2) - np.cos(load_turn * t + 0.2)) / load_turn
    exact = pushed - stiffness * moved - damping * (batch.casing_at(t) - begins)
    exact = exact - mass * (batch.casing_velocity_at(t) - speed)
    runs = [step(structure, batch, h, sampling(t, t, balances=True), theta=0.5) for h in (4e-5, 2e-5)]
    without_error = step(structure, batch, 0.0, sampling(t, t), "event_driven").histories["impulse"][0, -1]
    assert without_error == pytest.approx(exact[0], rel=1e-12)
    errors = [abs(float(each.histories["impulse"][0, -1] / exact[0] - 1)) for each in runs]
    assert all(each.metrics["impacts"] == 1 for each in runs)
    assert errors[0] < 2e-5
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.slow
def test_the_casing_s_power_is_that_of_its_mean_velocity() -> None:
    """A tip that its spring presses on the casing: the residual is ΔE + Σ p (V_k + V_{k+1})/2 over the largest E."""
    mass, stiffness, h = 0.01, 1e4, 1e-4
    structure = chain(nodes=1, mass=mass, stiffness=stiffness)
    batch = cases(structure, gap=-1e-3, casing_harmonics=[[1e-4, 50.0, 0.3]])
    batch = replace(batch, displacement=batch.casing_at(0.0)[:, None], velocity=batch.casing_velocity_at(0.0)[:, None])
    results = step(structure, batch, h, sampling(9e-3, h, balances=True), theta=1.0)
    place = np.array([plain_casing.place(batch, k * h) for k in range(91)])
    velocity = np.array([plain_casing.velocity(batch, k * h, h, 1.0) for k in range(91)])
    energy = 0.5 * (mass * velocity**2 + stiffness * place**2)
    taken_by_casing = np.sum(np.diff(results.histories["impulse"][0]) * (velocity[:-1] + velocity[1:])) / 2
    residual = (energy[-1] - energy[0] + taken_by_casing) / energy.max()
    assert results.metrics["contact_time"] == pytest.approx(9e-3, rel=1e-12)
    assert results.metrics["energy_residual"] == pytest.approx(residual, abs=1e-11)
