"""event_driven with several contacts: scenes solved in 80 bits by another program, closed forms, uncoupled copies."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_contacts import varied
from scipy.linalg import expm

from scenes import cases_of_file, of_entries, sampling, step
from workflow.models import Rayleigh, Structure
from workflow.schemes import Results, Sampling
from workflow.variables import EVENT_KINDS


def structure(mass: Any, stiffness: Any, rows: Any, damping: Rayleigh | None = None, **more: Any) -> Structure:
    """Return a cold structure with contacts along rows."""
    mass, stiffness = np.atleast_2d(mass).astype(float), np.atleast_2d(stiffness).astype(float)
    return of_entries({"mass": mass, "stiffness": stiffness, "contact": np.asarray(rows), **more}, damping)


def run(own: Structure, times: Any, events: int = 0, **given: Any) -> Results:
    over = Sampling(times[-1], times[1], len(times), events=events)
    return step(own, cases_of_file(own, **given), 0.0, over, "event_driven")


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_ball_between_floor_and_ceiling(e: float) -> None:
    """A free mass flies from stop to stop: speeds are multiplied by e, flights last 2/speed."""
    times = np.linspace(0, 30, 301)
    both = structure(1.0, 0.0, [[1.0], [-1.0]])
    ours = run(both, times, events=20, gaps=[1.0, 1.0], e=e, velocity=1.0)
    x, v, t, place = 0.0, 1.0, 0.0, np.empty(times.size)
    hits = []
    for k, now in enumerate(times):
        while v != 0 and (hit := t + (np.sign(v) - x) / v) <= now:
            x, t = np.sign(v), hit
            hits.append((t, (1 + e) * abs(v), abs(v), len(hits) % 2))
            v = -e * v
        place[k] = x + v * (now - t)
    assert ours.histories["displacement"][0] == pytest.approx(np.stack([place, -place]), abs=1e-12)
    assert ours.metrics["impacts"][0] == pytest.approx([(len(hits) + 1) // 2, len(hits) // 2])
    assert ours.histories["impulse"][0, :, -1].sum() == pytest.approx(sum(p for _, p, *_ in hits), rel=1e-13)
    assert ours.events["event_count"][0] == len(hits)
    names = ("event_time", "event_impulse", "event_approach", "event_contact")
    for name, values in zip(names, zip(*hits, strict=True), strict=True):
        np.testing.assert_allclose(ours.events[name][0, : len(hits)], values, rtol=1e-12, err_msg=name)


@pytest.mark.parametrize("count", [2, 5])
def test_uncoupled_copies_give_the_run_of_one(count: int) -> None:
    links, times = np.eye(4) - np.eye(4, k=-1), np.linspace(0, 0.3, 61)
    M, K, tip = np.diag(np.linspace(1.0, 0.6, 4)), 4e4 * links.T @ links, np.eye(4)[-1]
    moving: dict[str, Any] = {"load_harmonics": [[9.0, 11.0, 0.3]], "casing_harmonics": [[2e-4, 7.0, 0.4]]}
    each, damping = np.eye(count), Rayleigh(mass=3.0)
    many = structure(np.kron(each, M), np.kron(each, K), np.kron(each, tip), damping, load=np.tile(tip, count))
    ours = run(many, times, gaps=np.full(count, 3e-4), **moving)
    single = structure(M, K, tip, damping, load=tip)
    alone = run(single, times, gap=3e-4, **moving)
    assert alone.metrics["impacts"][0] > 3
    for name in ("displacement", "impulse"):
        one = alone.histories[name][0]
        assert ours.histories[name][0] == pytest.approx(np.tile(one, (count, 1)), abs=1e-12 * np.abs(one).max())


def test_a_start_beyond_the_casing_that_a_runaway_has_left_says_so() -> None:
    """Of one contact, of several: a sweep goes on from what the point before has heated."""
    for rows in ([[1.0]], [[1.0], [-1.0]]):
        heat = {"heat_capacity": [[1.0]], "conductance": [[1.0]], "coupling": [[-1.0]], "thermal_contact": np.abs(rows)}
        own = structure(1.0, 1.0, rows, **heat)
        for temperature in (20.0, 2.7e6):
            ours = run(own, np.linspace(0, 1, 11), gaps=[1.0] * len(rows), displacement=2.0, temperature=temperature)
            hot = "; it starts at 2.7e+06 K: in the sweep before it the rub has run away thermally"
            assert "beyond" in ours.messages[0]
            assert ours.messages[0].endswith(hot) == (temperature > 1e3)


TIMES, OMEGA = np.linspace(0, 2, 21), 0.4 * np.pi
COUPLED = np.array([[1.0, 0, -1], [0, 1, -1], [-1, -1, 2]])
DECIDING: dict[str, dict[str, Any]] = {
    "load": {"sine": np.array([3.0, 3, 0])},
    "damping": {"damping": 0.7 * COUPLED, "constant": np.array([0, 0, 4.0])},
    "heat": {"coupling": np.array([-5.0, -4, 0]), "heating": 2.0},
}
"""What alone gives the force of a contact a rate: a load F sin Ωt, a mass that begins to draw it, warming."""


@pytest.mark.parametrize(("kind", "stiff"), [*((kind, 1.0) for kind in DECIDING), ("load", 0.0)])
def test_forces_that_begin_at_zero_are_decided_by_their_rates(kind: str, stiff: float) -> None:
    """Of two masses that touch opposite stops the first is pressed, the second drawn off, without any impact.

    The truth is the exponential of [x, v, θ, p, 1, sin Ωt, cos Ωt]' with the first mass held.
    """
    none, times = dict.fromkeys(("sine", "constant", "coupling"), np.zeros(3)), TIMES
    acts = {"damping": 0 * COUPLED, "heating": 0.0, **none, **DECIDING[kind]}
    m, K, heat = np.array([1.0, 2.0, 1.5]), stiff * np.diag([3.0, 2.0, 1.0]), {"thermal_contact": np.ones((2, 1))}
    entries = {"mass": np.diag(m), "stiffness": K, "contact": np.array([[1.0, 0, 0], [0, -1, 0]]), **heat}
    entries |= {"heat_capacity": np.eye(1), "conductance": np.eye(1), "coupling": acts["coupling"][:, None]}
    entries |= {"damping": acts["damping"], "load": acts["sine"] if kind == "load" else np.ones(3)}
    given = {"load_harmonics": [[float(kind == "load"), 0.2, 0.0]], "heating": acts["heating"]}
    ours = run(of_entries(entries), times, 9, gaps=[0.0, 0.0], steady=acts["constant"], **given)
    push = np.column_stack([-K, -acts["damping"], -acts["coupling"], np.zeros(3), acts["constant"], acts["sine"]])
    A = np.zeros((11, 11))
    A[:3, 3:6], A[4:6, :10], A[7, :10] = np.eye(3), push[1:] / m[1:, None], push[0]
    A[6, [6, 8]], A[9, 10], A[10, 9] = [-1.0, acts["heating"]], OMEGA, -OMEGA
    exact = np.array([expm(A * t)[:, [8, 10]].sum(axis=1) for t in times]).T
    assert ours.histories["impulse"][0] == pytest.approx(np.stack([exact[7], 0 * times]), abs=1e-13 * exact[7].max())
    assert ours.histories["displacement"][0] == pytest.approx(np.stack([0 * times, -exact[1]]), abs=1e-13)
    assert ours.metrics["contact_time"][0].tolist() == [times[-1], 0.0]
    listed = [ours.events[f"event_{name}"][0, 0] for name in ("time", "impulse", "approach", "contact")]
    assert (ours.events["event_count"][0], listed) == (1, [0.0] * 4)


def test_a_small_force_is_decided_before_its_rate() -> None:
    """F sin Ωt - ε draws a mass from its casing first; it comes back after 3 ε/(F Ω)."""
    small, own = 1e-3, structure(np.eye(2), np.diag([0.0, 9.0]), np.eye(2), load=np.array([1.0, 0.0]))
    ours = run(own, TIMES, 9, gaps=[0.0, 1.0], load_harmonics=[[1.0, 0.2, 0.0]], mean=-small)
    assert ours.metrics["impacts"][0].tolist() == [1.0, 0.0]
    assert ours.events["event_time"][0, 0] == pytest.approx(3 * small / OMEGA, rel=1e-5)
    assert ours.events["event_impulse"][0, 0] == pytest.approx(1.5 * small**2 / OMEGA, rel=1e-5)


@pytest.mark.parametrize("phase", [0.0, 0.3])
def test_a_load_on_the_residual_alone_presses_a_contact_without_mass(phase: float) -> None:
    """x = y - R λ + ρ F sin(Ωt + φ): one contact is pressed, m y'' + (k + 1/R) y = -ρ F/R sin(Ωt + φ), one is left."""
    m, k, R, F, times = 1.5, 2.0, 0.1, 4.0, TIMES[:8]
    residual = {"residual_flexibility": R * np.eye(2), "residual_load": np.array([0.3, -0.3])}
    own = structure(m * np.eye(3), k * np.eye(3), np.eye(2, 3), load=np.eye(3)[2], **residual)
    ours = run(own, times, 9, gaps=[0.0, 0.0], load_harmonics=[[F, 0.2, phase]])
    w, turned, cos, sin = np.sqrt((k + 1 / R) / m), OMEGA * times + phase, np.cos(phase), np.sin(phase)
    loads = (cos - np.cos(turned)) / OMEGA  # ∫ sin(Ωt + φ) dt
    own_motion = loads - sin * np.sin(w * times) / w - OMEGA * cos * (1 - np.cos(w * times)) / w**2
    impulse = 0.3 * F / R * (loads - own_motion / R / m / (w**2 - OMEGA**2))
    assert ours.histories["impulse"][0] == pytest.approx(np.stack([impulse, 0 * times]), abs=1e-12)
    left = -0.3 * F * np.sin(turned)
    assert ours.histories["displacement"][0] == pytest.approx(np.stack([0 * times, left]), abs=1e-12)
    assert ours.metrics["contact_time"][0].tolist() == [times[-1], 0.0]
    listed = [ours.events[f"event_{name}"][0, 0] for name in ("time", "approach", "contact")]
    assert (ours.events["event_count"][0], listed) == (1, [0.0, pytest.approx(0.3 * F * OMEGA * cos), 0.0])


def test_the_approach_of_an_elastic_contact_is_that_of_its_beginning() -> None:
    """A mass that strikes elastic stops in turn: v when contact begins, 0 when one that was held ends."""
    both = structure(1.0, 0.0, [[1.0], [-1.0]])
    both = replace(both, contacts=replace(both.contacts, casing_flexibility=0.01))
    ours = run(both, np.linspace(0, 3, 7), 9, gaps=[1.0, 1.0], velocity=1.5)
    count = int(ours.events["event_count"][0])
    kinds, approach, contact = (ours.events[f"event_{name}"][0, :count] for name in ("kind", "approach", "contact"))
    assert [EVENT_KINDS[int(kind)] for kind in kinds] == ["touches", "leaves"] * 2
    assert contact.tolist() == [0, 0, 1, 1]
    assert approach == pytest.approx([1.5, 0.0, 1.5, 0.0], abs=1e-13)


STEPS = 8e-6, 2e-6, 1e-6


def converges(seed: int, massless: bool) -> Any:
    """Return the errors of `moreau` at those steps and of the extrapolation of the last two, over the motion."""
    case = varied(seed, massless, count=1 + seed % 6)
    given, over = replace(case.cases, e=np.zeros(1)), sampling(0.006, 4.8e-5)
    exact = step(case.structure, given, 0.0, over, "event_driven")
    steps = [step(case.structure, given, h, over, theta=0.5).histories["displacement"] for h in STEPS]
    motion = exact.histories["displacement"]
    errors = [np.abs(found - motion).max() for found in (*steps, 2 * steps[2] - steps[1])]
    return np.array(errors) / np.abs(motion).max()


@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("seeds", [6, pytest.param(40, marks=pytest.mark.slow)])
def test_moreau_converges_to_it_in_random_structures(seeds: int, massless: bool) -> None:
    """1 to 6 contacts with friction, heat and coupled damping.

    Contacts without mass lose and take their force continuously, so that the error is h times a function. An impact is
    taken in the step that it falls in: with mass the error is a part of h that depends on where in it the impact is.
    """
    coarse, _, fine, extrapolated = np.transpose([converges(seed, massless) for seed in range(seeds)])
    assert np.median(fine) < 2e-3
    assert fine.max() < 0.1
    np.testing.assert_allclose(np.median(coarse / fine), STEPS[0] / STEPS[2], rtol=0.02 if massless else 0.3)
    if massless:
        assert (coarse > 5 * fine).all()
        assert np.median(extrapolated / fine) < 0.02
