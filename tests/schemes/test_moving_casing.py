"""A casing that moves and loads with harmonics, stepped: plain matrices, a pressed tip, closed forms, other chains."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import plain_carpenter
import plain_casing
import plain_moreau
import plain_penalty
import pytest
from test_carpenter import agree, audited, everything_acts, running_sum

from scenes import alone, cases, chain, heavy_chain, same_bits, sampling, step, taken
from workflow.models import Cases, Harmonics, Rayleigh, Structure, static_equilibrium
from workflow.reduction import reduce_structure
from workflow.schemes import Recorder


def harmonics(*entries: tuple[float, float, float], count: int = 1) -> Harmonics:
    """Amplitude, frequency and phase of each, the same in all cases."""
    return Harmonics(*(np.tile(row, (count, 1)) for row in np.array(entries).T))


def moving(batch: Cases) -> Cases:
    """A batch whose load and casing have two harmonics each."""
    casing = harmonics((4e-6, 330.0, 0.4), (1.5e-6, 90.0, 2.0), count=batch.count)
    load = harmonics((30.0, 410.0, 1.0), (12.0, 37.0, 0.2), count=batch.count)
    return replace(batch, casing_harmonics=casing, load_harmonics=load)


def pressed(count: int = 1) -> tuple[Structure, Cases]:
    """A chain pressed on its casing at t = 0, in equilibrium with its constant load."""
    structure = chain(nodes=3, mass=0.01, stiffness=1e5, damping=Rayleigh(10.0, 0.0))
    batch = cases(structure, count, gap=1e-5, mean=20.0)
    batch = replace(batch, casing_harmonics=harmonics((5e-6, 50.0, 0.3), (2e-6, 150.0, 1.0), count=count))
    load = np.array([0.0, 0.0, 20.0])
    x, _ = static_equilibrium(structure, load, np.zeros(3), float(batch.casing_at(0.0)[0]))
    v = np.zeros((count, 3))
    v[:, -1] = batch.casing_velocity_at(0.0)
    return structure, replace(batch, displacement=np.tile(x, (count, 1)), velocity=v)


GRAVITY = 9.81


def check_moreau(theta: float, e: float) -> None:
    structure, h = heavy_chain(), 1e-5
    batch = moving(everything_acts(structure, e=e))
    path = plain_moreau.march(structure, batch, h, theta, 1000)
    assert np.sum(path.impulse > 0) > 20
    results = step(structure, batch, h, audited(sampling(1e-2, h)), theta=theta)
    agree(results, path, np.concatenate([[0.0], np.cumsum(path.impulse)]))


def test_moreau_is_the_plain_scheme() -> None:
    check_moreau(0.5, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("theta", [0.7, 1.0])
def test_moreau_is_the_plain_scheme_for_other_weights(theta: float) -> None:
    check_moreau(theta, 0.8)


@pytest.mark.slow
@pytest.mark.parametrize("lagged", [False, True])
def test_carpenter_is_the_plain_scheme(lagged: bool) -> None:
    structure, h = heavy_chain(), 5e-6
    batch = moving(everything_acts(structure))
    path = plain_carpenter.march(structure, batch, h, 2000, lagged=lagged, implicit=True)
    results = step(structure, batch, h, sampling(1e-2, h), "carpenter", damping="lagged" if lagged else "central")
    agree(results, path, running_sum(path.impulse))
    place = [plain_casing.place(batch, k * h) for k in range(2001)]
    assert np.max(results.histories["displacement"][0] - place) < 1e-19  # no penetration, but for rounding


@pytest.mark.slow
def test_penalty_is_the_plain_scheme() -> None:
    structure, h = heavy_chain(), 5e-6
    batch = moving(everything_acts(structure))
    path = plain_penalty.explicit(structure, batch, h, 2000, 1e8, 50.0)
    results = step(structure, batch, h, sampling(1e-2, h), "penalty", stiffness=1e8, damping=50.0)
    agree(results, path, running_sum(path.impulse))
    for theta in (0.5, 1.0):
        path = plain_penalty.implicit(structure, batch, h, 2000, 1e8, 50.0, theta)
        options = {"stiffness": 1e8, "damping": 50.0, "integration": "implicit", "theta": theta}
        results = step(structure, batch, h, sampling(1e-2, h), "penalty", **options)
        agree(results, path, np.concatenate([[0.0], np.cumsum(path.impulse)]))


def follows(periods: int, theta: float) -> float:
    """Return how far a pressed tip is from its casing at most, m."""
    structure, batch = pressed()
    over = audited(sampling(periods / 50.0, 0.01))
    results = step(structure, batch, 1e-4, over, theta=theta)
    assert results.metrics["impacts"] == 1
    assert results.metrics["contact_time"] == pytest.approx(over.duration, rel=1e-10)  # 2e5 additions of h
    place = np.array([plain_casing.place(batch, t) for t in over.times])
    return float(np.abs(results.histories["displacement"][0] - place).max())


def test_a_pressed_tip_follows_the_casing() -> None:
    """Rounding of the time: eps t ḋ, 2e-16 · 20 s · 3.5e-3 m/s after 1000 periods."""
    assert follows(1000, 0.5) < 2e-17


def test_a_scheme_of_plain_states_ends_on_its_casing_within_a_step() -> None:
    """The casing comes inwards while the duration ends a third into a step: a pressed tip is on it, by rounding.

    Counted against the casing at the step's end it would be beyond it by two thirds of the casing's way in the step.
    """
    structure, batch = pressed()
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


@pytest.mark.slow
def test_a_pressed_tip_follows_the_casing_with_implicit_euler() -> None:
    assert follows(1000, 1.0) < 2e-17


def test_a_case_is_alone_as_in_a_batch() -> None:
    structure, _ = pressed()
    rng = np.random.default_rng(5)
    batch = cases(structure, 21, e=rng.uniform(0, 1, 21), gap=1e-5, amplitude=rng.uniform(10, 30, 21), frequency=40.0)
    rows = rng.uniform(0, 5e-6, (21, 2)), rng.uniform(20, 300, (21, 2)), rng.uniform(-3, 3, (21, 2))
    batch = replace(batch, casing_harmonics=Harmonics(*rows))
    results = step(structure, batch, 1e-4, audited(sampling(0.1, 1e-3)), theta=0.5)
    assert np.all(results.metrics["impacts"] > 1)
    for case in (0, 7, 20):
        single = step(structure, alone(batch, case), 1e-4, audited(sampling(0.1, 1e-3)), theta=0.5)
        assert same_bits(single, taken(results, slice(case, case + 1)))


def test_a_harmonic_of_the_load_is_the_load_that_has_it_as_its_own() -> None:
    structure, batch = pressed()
    batch = replace(batch, casing_harmonics=batch.casing_harmonics.scaled(0.0))
    own = replace(batch, amplitude=np.full(1, 30.0), frequency=np.full(1, 70.0), phase=np.full(1, 0.4))
    more = replace(batch, load_harmonics=harmonics((30.0, 70.0, 0.4)))
    over = audited(sampling(0.1, 1e-3))
    one, other = (step(structure, each, 1e-4, over, theta=0.5) for each in (own, more))
    assert one.metrics["impacts"] > 1
    for name, values in one.histories.items():
        assert np.abs(values - other.histories[name]).max() <= 1e-12 * np.abs(values).max()  # roundings of 1000 steps


def test_the_force_of_a_pressed_tip_is_what_its_casing_asks_for() -> None:
    """J = ∫ (F0 + f - m d̈ - c ḋ - k d) dt of a mass held on its casing: errors of second order."""
    mass, stiffness, damping = 0.01, 1e4, 0.02
    structure = chain(nodes=1, mass=mass, stiffness=stiffness, damping=Rayleigh(damping / mass, 0.0))
    batch = cases(structure, gap=1e-5, mean=20.0)
    batch = replace(batch, casing_harmonics=harmonics((5e-6, 50.0, 0.3)), load_harmonics=harmonics((3.0, 70.0, 0.2)))
    begins, speed = batch.casing_at(0.0), batch.casing_velocity_at(0.0)
    batch = replace(batch, displacement=begins[:, None], velocity=speed[:, None])
    t, turn, load_turn = 0.033, 2 * np.pi * 50.0, 2 * np.pi * 70.0
    moved = 1e-5 * t + 5e-6 * (np.cos(0.3) - np.cos(turn * t + 0.3)) / turn
    pushed = 20.0 * t + 3.0 * (np.cos(0.2) - np.cos(load_turn * t + 0.2)) / load_turn
    exact = pushed - stiffness * moved - damping * (batch.casing_at(t) - begins)
    exact = exact - mass * (batch.casing_velocity_at(t) - speed)
    runs = [step(structure, batch, h, audited(sampling(t, t)), theta=0.5) for h in (4e-5, 2e-5)]
    errors = [abs(float(each.histories["impulse"][0, -1] / exact[0] - 1)) for each in runs]
    assert all(each.metrics["impacts"] == 1 for each in runs)
    assert errors[0] < 2e-5
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def bouncing(e: float, frequency: float) -> tuple[Structure, Cases]:
    """Return a ball that bounces once a period of its table; it leaves with the velocity πg/ω.

    Period one (Holmes 1982; Guckenheimer, Holmes, section 2.4): up is away from the table, which moves as
    a sin(ωt + φ). The flight from one impact to the next takes a period, v⁺ = πg/ω, and the impact asks for the table's
    velocity V = v⁺ (1-e)/(1+e). Each impact has the impulse m g T.
    """
    omega = 2 * np.pi * frequency
    leaving = np.pi * GRAVITY / omega
    table = leaving * (1 - e) / (1 + e)
    amplitude, phase = 1.2 * table / omega, np.arccos(1 / 1.2)
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    begins = -amplitude * np.sin(phase)  # the load, downwards, is towards the casing
    batch = cases(structure, e=e, mean=GRAVITY, displacement=begins, velocity=-leaving)
    return structure, replace(batch, casing_harmonics=harmonics((-amplitude, frequency, phase)))


def bounced(h: float, e: float = 0.5, frequency: float = 10.0) -> tuple[float, float, float]:
    """Return impacts, and the relative errors of impulse and height, of a ball that bounces once a period."""
    (structure, batch), period = bouncing(e, frequency), 1 / frequency
    leaving = GRAVITY * period / 2
    results = step(structure, batch, h, audited(sampling(4.5 * period, period / 2)), theta=0.5)
    highest = -results.histories["displacement"][0, 1::2] + batch.displacement[0, 0]
    impulse = results.histories["impulse"][0, -1]
    errors = impulse / (4 * GRAVITY * period) - 1, highest / (leaving**2 / (2 * GRAVITY)) - 1
    return float(results.metrics["impacts"][0]), abs(float(errors[0])), float(np.abs(errors[1]).max())


def test_a_ball_bounces_once_in_each_period_of_its_table() -> None:
    (impacts, impulse, height), (_, finer_impulse, finer_height) = bounced(2e-5), bounced(5e-6)
    assert impacts == 4
    assert max(impulse, height) < 1e-2
    assert max(finer_impulse, finer_height) < 0.4 * max(impulse, height)


@pytest.mark.slow
def test_impacts_in_one_phase_of_the_casing_leave_rounding_in_the_balance() -> None:
    """A rigid ball, θ = 0.7, h = T/250: what each impact takes is 0.75 of the largest energy, and its casing gives it.

    250 000 steps add up to 3e-13 of that energy.
    """
    (structure, batch), over = bouncing(e=0.5, frequency=10.0), replace(sampling(100.0, 0.1), balances=True)
    results = step(structure, batch, 4e-4, over, theta=0.7)
    assert results.metrics["impacts"][0] >= 998  # the first and the last lie at the ends
    assert abs(results.metrics["energy_residual"][0]) < 2e-12


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "options", "largest"),
    [
        ("moreau", {"theta": 0.5}, 1e-11),
        ("carpenter", {}, 1e-11),
        ("penalty", {"stiffness": 1e8, "damping": 50.0, "integration": "implicit", "theta": 0.5}, 5e-2),
    ],
)
def test_the_casing_s_power_is_in_the_balance_of_energy(method: str, options: dict[str, Any], largest: float) -> None:
    """Nothing is created at θ = ½ and by central differences; a spring gives or takes as contact begins and ends."""
    structure, h = heavy_chain(), 5e-6
    batch = moving(everything_acts(structure, e=0.6))
    results = step(structure, batch, h, replace(sampling(1e-2, h), balances=True), method, **options)
    assert np.all(results.metrics["impacts"] > 5)
    assert np.abs(results.metrics["energy_residual"]).max() < largest


@pytest.mark.slow
@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_a_tip_without_mass_is_the_plain_scheme(theta: float) -> None:
    """x_{k+1} = d_{k+1} where the tip would end beyond the casing."""
    whole, h = heavy_chain(), 1e-5
    reduction = reduce_structure(whole, 3, 5, "massless")
    batch = reduction.project(moving(cases(whole, gap=2e-5, amplitude=100.0, frequency=200.0, alpha=0.5)))
    path = plain_moreau.march_by_place(reduction.structure, batch, h, theta, 1000)
    assert np.sum(path.impulse > 0) > 50
    results = step(reduction.structure, batch, h, sampling(1e-2, h), theta=theta)
    impulse = np.concatenate([[0.0], np.cumsum(path.impulse)])
    for name, values in (("displacement", path.displacement[:, -1]), ("impulse", impulse)):
        assert np.abs(results.histories[name][0] - values).max() < 1e-9 * np.abs(values).max()


@pytest.mark.slow
def test_the_casing_s_power_is_that_of_its_mean_velocity() -> None:
    """A tip that its spring presses on the casing: the residual is ΔE + Σ p (V_k + V_{k+1})/2 over the largest E."""
    mass, stiffness, h = 0.01, 1e4, 1e-4
    structure = chain(nodes=1, mass=mass, stiffness=stiffness)
    batch = replace(cases(structure, gap=-1e-3), casing_harmonics=harmonics((1e-4, 50.0, 0.3)))
    batch = replace(batch, displacement=batch.casing_at(0.0)[:, None], velocity=batch.casing_velocity_at(0.0)[:, None])
    results = step(structure, batch, h, replace(sampling(9e-3, h), balances=True), theta=1.0)
    place = np.array([plain_casing.place(batch, k * h) for k in range(91)])
    velocity = np.array([plain_casing.velocity(batch, k * h, h, 1.0) for k in range(91)])
    energy = 0.5 * (mass * velocity**2 + stiffness * place**2)
    taken_by_casing = np.sum(np.diff(results.histories["impulse"][0]) * (velocity[:-1] + velocity[1:])) / 2
    residual = (energy[-1] - energy[0] + taken_by_casing) / energy.max()
    assert results.metrics["contact_time"] == pytest.approx(9e-3, rel=1e-12)
    assert results.metrics["energy_residual"] == pytest.approx(residual, abs=1e-11)
