"""Physics of the event-driven scheme: exact solutions, limits, the largest temperatures between samples."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from scenes import cases, chain, heavy_chain, relative, sampling, step
from scenes import cases as make_cases
from workflow.models import Cases, Rayleigh, Structure
from workflow.schemes import Results, Sampling, Status, event_driven


def run(structure: Structure, duration: float, count: int, cases: int = 1, **conditions: object) -> Results:
    over = Sampling(duration, duration / (count - 1), count)
    return step(structure, make_cases(structure, cases, **conditions), 0.0, over, "event_driven")


def single(mass: float, stiffness: float = 0.0, damping: Rayleigh | None = None) -> Structure:
    return chain(
        nodes=1,
        mass=mass,
        stiffness=stiffness,
        damping=damping or Rayleigh(),
        spacing=1.0,
        expansion=0.0,
        heat_capacity=1.0,
        conductance=1.0,
    )


def test_ball_that_starts_at_the_wall_with_speed_is_an_impact_at_once() -> None:
    results = run(single(1.0), 1.0, 3, e=0.5, velocity=2.0)
    assert results.histories["impulse"][0, 0] == 0.0  # sample 0 is the initial state
    assert results.histories["velocity"][0, 0] == 2.0
    np.testing.assert_allclose(results.histories["impulse"][0, 1:], 3.0, rtol=1e-14)
    np.testing.assert_allclose(results.histories["displacement"][0], [0.0, -0.5, -1.0], atol=1e-15)
    assert results.metrics["impacts"][0] == 1


def test_tip_beyond_the_gap_is_refused() -> None:
    results = run(single(1.0), 1.0, 3, gap=0.1, displacement=0.2)
    assert results.status[0] == Status.FAILED
    assert "beyond the casing" in results.messages[0]
    assert np.isnan(results.metrics["impacts"][0])


HEAVY = {"alpha": 50.0, "gap": 5.0e-5, "amplitude": 100.0, "frequency": 20.0}
PLACES = [[4e-6, 40.0, 0.1], [1e-6, 300.0, 2.0]]


@pytest.mark.parametrize("places", [[], PLACES], ids=["at rest", "in motion"])
def test_thresholds_do_not_matter(places: list[list[float]]) -> None:
    structure = heavy_chain(nodes=5) if places else heavy_chain()
    rub = HEAVY | ({"gap": 1e-5} if places else {})
    operator = event_driven.init(structure, 1e-4, event_driven.Options())
    cases, over = make_cases(structure, 3, e=[0.0, 0.5, 0.9], casing_harmonics=places, **rub), sampling(0.2, 1e-3)
    base = event_driven.compute(operator, cases, over)
    assert (base.metrics["contact_time"] > 0.01).all()
    thresholds = operator.thresholds
    for name in ("height", "speed") if places else thresholds._fields:
        for factor in (0.1, 10.0):
            varied = replace(operator, thresholds=thresholds._replace(**{name: factor * getattr(thresholds, name)}))
            other = event_driven.compute(varied, cases, over)
            for history in ("displacement", "temperature", "impulse"):
                apart = [
                    relative(*pair) for pair in zip(other.histories[history], base.histories[history], strict=True)
                ]
                assert max(apart) <= (1e-9 if places else 1e-10), (name, factor, history)


def test_budgets_end_a_case_with_what_it_was_doing() -> None:
    structure = heavy_chain()
    cases, sampling = make_cases(structure, 1, e=0.9, **HEAVY), Sampling(0.3, 1e-3, 301)
    for options, words in (
        (event_driven.Options(events=20), "after 20 contact events"),
        (event_driven.Options(steps=20), "after 20 steps"),
    ):
        r = event_driven.compute(event_driven.init(structure, 1e-4, options), cases, sampling)
        assert r.status[0] == Status.FAILED
        assert words in r.messages[0]
        x = r.histories["displacement"][0]
        ended = int(np.argmax(np.isnan(x)))
        assert 0 < ended < 301
        assert np.isnan(x[ended:]).all()
        assert np.isnan(r.metrics["impacts"][0])


def test_period_metrics_with_events_at_the_boundaries() -> None:
    # the oscillator with wall strikes every half period of its own; the load has no amplitude, its
    # period of 2 s is that of two strikes, so that every period ends at an impact
    structure = single(1.0, np.pi**2)
    r = run(structure, 8.0, 81, e=1.0, velocity=-1.0, frequency=0.5)
    assert r.period_impulse[0] == pytest.approx([4.0] * 4, rel=1e-10)
    assert r.histories["impulse"][0, 20::20] == pytest.approx([4.0, 8.0, 12.0, 16.0], rel=1e-10)


@pytest.mark.parametrize("damping", [3e2, 1e4, 1e7, 1e12])
def test_a_stiff_and_slow_mode_follows_its_closed_form(damping: float) -> None:
    """One pole moves 1e-11 in all, the other 1e13: neither may cost steps or digits."""
    structure = chain(nodes=1, mass=1.0, stiffness=1.0, damping=Rayleigh(damping, 0.0))
    batch = make_cases(structure, gap=20.0 / damping, mean=1.0, amplitude=1.0, frequency=0.3)
    over = sampling(10.0, 0.1)
    results = step(structure, batch, 1.0, over, "event_driven")
    assert results.status[0] == Status.OK
    fast = -(damping / 2 + np.sqrt(damping**2 / 4 - 1))
    slow, w, t = 1 / fast, 2 * np.pi * 0.3, over.times
    terms = [
        np.expm1(s * t) / s + (w * np.exp(s * t) - s * np.sin(w * t) - w * np.cos(w * t)) / (s**2 + w**2)
        for s in (slow, fast)
    ]
    exact = (terms[0] - terms[1]) / (slow - fast)
    assert relative(results.histories["displacement"][0], exact) <= 1e-13


@pytest.mark.parametrize("e", [1 - 1e-5, 1.0])
def test_impacts_of_a_damped_pressed_tip_that_no_budget_holds(e: float) -> None:
    """With e = 1 their number grows without end and without a point of accumulation."""
    structure = single(1.0, 1.0, Rayleigh(0.5, 0.0))
    pressed = {"e": e, "mean": 2.0, "velocity": -1.0}
    results, t = run(structure, 1e3, 11, **pressed), np.linspace(0, 1e3, 11)
    assert results.status[0] == Status.OK
    assert results.messages[0].startswith("extrapolated: impacts below")
    assert "option `events`" in results.messages[0]
    lift = float(results.messages[0].split("by at most ")[1].split(" m,")[0])
    assert 0 < lift < 1e-7
    assert np.abs(results.histories["displacement"][0, 1:]).max() <= lift
    impulse = results.histories["impulse"][0, 1:] - results.histories["impulse"][0, 1]
    np.testing.assert_allclose(impulse, 2.0 * (t[1:] - t[1]), rtol=0, atol=1e-7)


def hot(structure: Structure, case: Cases, duration: float, interval: float) -> Results:
    return step(structure, case, 0.0, sampling(duration, interval), "event_driven", events=1000)


@pytest.mark.parametrize("interval", [1000.0, 10.0, 1.0, 0.1])
@pytest.mark.parametrize("frequency", [0.0, 0.004])
def test_heat_that_passes_through_the_tip_between_two_samples(interval: float, frequency: float) -> None:
    """A hot node beside a cold tip far from its casing: the tip warms up, then cools."""
    structure = chain(nodes=2, mass=1.0e-3, stiffness=1.0e6, conductance=1.0, spacing=1.0, expansion=0.0)
    rate = -np.linalg.solve(structure.heat_capacity, structure.conductance_matrix)
    start = np.array([100.0, 0.0])
    top = brentq(lambda t: (rate @ expm(rate * t) @ start)[1], 0.1, 10.0, xtol=1e-12)
    exact = (expm(rate * top) @ start)[1]
    results = hot(structure, cases(structure, gap=1.0, temperature=[start], frequency=frequency), 1000.0, interval)
    assert results.metrics["max_temperature"][0] == pytest.approx(exact, rel=1e-12)
    if frequency:  # load periods of 250 s: the tip is warmest in the first, then at the beginning of each
        boundaries = [(expm(rate * t) @ start)[1] for t in (250.0, 500.0, 750.0)]
        np.testing.assert_allclose(results.period_temperature[0], [exact, *boundaries], rtol=1e-9, atol=1e-12)
