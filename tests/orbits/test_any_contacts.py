"""Steady rubs of several contacts, of contacts without mass and on an elastic casing."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from contacts.random_contacts import random_entries
from scenes import cases_of_file, of_entries
from workflow.models import Array, Cases, Structure
from workflow.orbits import BIFURCATIONS, STATES, Options, branch, steady_rubs
from workflow.orbits._flow import Flow, analysed
from workflow.orbits._orbit import Orbit, scale_of
from workflow.orbits._settle import settle

TURN = 2 * np.pi
LOAD = {"amplitude": 1.0, "frequency": 1 / TURN, "phase": np.pi / 2}


def oscillators(count: int, **entries: Any) -> Structure:
    """Return masses on springs of their own, all loaded, each with a contact."""
    one = np.eye(count)
    usual = {"mass": one, "stiffness": one, "damping": 0.1 * one, "contact": one, "load": np.ones(count)}
    return of_entries(usual | entries)


def orbit_of(structure: Structure, batch: Cases) -> Orbit:
    found = settle(Flow(analysed(structure), batch), Options()).orbit
    assert found is not None
    return found


def rub(structure: Structure, batch: Cases) -> dict[str, Any]:
    values, (message,) = steady_rubs(structure, batch, Options(samples=8))
    return {name: value[0] for name, value in values.items()} | {"message": message}


def differences(flow: Flow, orbit: Orbit, scale: Array, share: float) -> Array:
    """Return the derivative of the map by central differences of the exact motion, of fourth order."""
    start, columns = orbit.motion, []
    for j in range(scale.size):
        moved = share * scale[j] * np.eye(scale.size)[j]
        ends = [
            flow.march(start.start + k * moved, start.was_closed, start.begin, start.span).X for k in (1, -1, 2, -2)
        ]
        columns.append((8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * share * scale[j]))
    return np.transpose(columns)


def decay(orbit: Orbit, X: Array, closed: Any, periods: int) -> float:
    """Return ln|µ₁| as a motion from a state shows it: how its part along the left vector of µ₁ changes in a period."""
    flow, (values, left) = orbit.flow, np.linalg.eig(orbit.D.T)
    left, size = left[:, np.argmax(np.abs(values))], []
    for _ in range(periods):
        motion = flow.march(X, closed, orbit.motion.begin, orbit.motion.span)
        size.append(abs(left @ (X - orbit.motion.start)))
        X, closed = motion.X, motion.closed
    return float(np.log(size[-1] / size[0]) / (periods - 1))


def sorted_like(values: Array, others: Array) -> Array:
    """Return the values in the order of the nearest others."""
    left = list(values)
    return np.array([left.pop(int(np.argmin(np.abs(np.array(left) - other)))) for other in others])


@pytest.mark.parametrize("count", [2, 5])
def test_copies_of_an_oscillator_have_its_multipliers_as_often(count: int) -> None:
    """That of Dankowicz, Schilder (SIAM 2013), example 15.2."""
    structure = oscillators(count)
    found = orbit_of(structure, cases_of_file(structure, e=0.8, gaps=np.ones(count), **LOAD))
    alone = oscillators(1)
    one = orbit_of(alone, cases_of_file(alone, e=0.8, gaps=np.ones(1), **LOAD)).multipliers
    assert one[0] == pytest.approx(-0.58429531 + 0.00560035j, abs=5e-9)
    np.testing.assert_allclose(sorted_like(found.multipliers, np.repeat(one, count)), np.repeat(one, count), atol=1e-9)


def warm_pair(conducts: float) -> dict[str, Any]:
    """Return two masses that expand by their temperatures, which conduct heat to each other."""
    grow = -0.05 * np.eye(2)
    return {
        "heat_capacity": 2.0 * np.eye(2),
        "conductance": 0.5 * np.eye(2) + conducts * np.array([[1.0, -1.0], [-1.0, 1.0]]),
        "coupling": grow,
        "thermal_contact": np.eye(2),
    }


LINK = np.array([[1.0, -1.0], [-1.0, 1.0]])


def test_a_symmetric_pair_that_stiffness_couples_has_multipliers() -> None:
    structure = oscillators(2, stiffness=np.eye(2) + 0.1 * LINK, **warm_pair(0.2))
    found = orbit_of(structure, cases_of_file(structure, e=0.8, alpha=0.2, gaps=np.ones(2), **LOAD))
    assert found.corner.size == 0
    assert len(found.motion.times) == 1
    assert np.ptp(found.motion.impulses) < 1e-11
    scale = np.repeat(np.abs(found.motion.start).max(), found.motion.start.size)
    D = differences(found.flow, found, scale, 1e-6)  # its second derivative depends on which of them is first
    np.testing.assert_allclose(found.D, D, atol=1e-6)


HEATS = np.array([[0.8, 0.2], [0.2, 0.8]])


@pytest.mark.parametrize(
    "coupled",
    [
        {"mass": np.eye(2) + 0.1 * LINK},
        {"damping": 0.1 * np.eye(2) + 0.02 * LINK},
        warm_pair(0.1) | {"thermal_contact": HEATS},
    ],
    ids=["mass", "damping", "heat"],
)
def test_a_symmetric_pair_whose_impacts_act_on_each_other_has_none(coupled: dict[str, Any]) -> None:
    """It has the orbit of one mass, and says why it has no multipliers."""
    structure = oscillators(2, **coupled)
    alpha = 0.2 if "heat_capacity" in coupled else 0.0
    found = rub(structure, cases_of_file(structure, e=0.8, alpha=alpha, gaps=np.ones(2), **LOAD))
    assert STATES[found["steady_state"]] == "settles"
    assert found["message"].startswith("steady: contacts 1, 2 strike at the same instant and act on each other")
    assert np.isnan([found["floquet_multiplier"], found["floquet_angle"], found["settling_time"]]).all()
    assert found["steady_residual"] < 1e-10
    np.testing.assert_allclose(found["orbit_displacement"][0], found["orbit_displacement"][1], atol=1e-11)
    if "mass" in coupled:  # in step they are oscillators alone
        alone = oscillators(1)
        one = rub(alone, cases_of_file(alone, e=0.8, gaps=np.ones(1), **LOAD))
        np.testing.assert_allclose(found["orbit_displacement"][0], one["orbit_displacement"], atol=1e-9)
        np.testing.assert_allclose(found["steady_impulse"], one["steady_impulse"], rtol=1e-9)


PAIR = {
    "mass": np.array([[1.0, 0.2], [0.2, 1.5]]),
    "stiffness": np.array([[2.0, -0.7], [-0.7, 3.0]]),
    "damping": np.array([[0.3, -0.05], [-0.05, 0.25]]),
    "load": np.array([1.0, 0.6]),
    **warm_pair(0.2),
}


def paired() -> Orbit:
    structure = oscillators(2, **PAIR)
    batch = cases_of_file(structure, e=0.6, alpha=0.3, gaps=np.array([0.5, 0.4]), mean=0.2, **LOAD | {"frequency": 0.2})
    return orbit_of(structure, batch)


def test_two_coupled_contacts_with_heat() -> None:
    found = paired()
    assert (found.motion.impulses > 0).any(axis=0).all()
    scale = np.repeat(np.abs(found.motion.start).max(), found.motion.start.size)
    D = differences(found.flow, found, scale, 1e-4)
    np.testing.assert_allclose(found.D, D, atol=1e-7 * np.abs(D).max())
    values = np.linalg.eigvals(D)
    np.testing.assert_allclose(sorted_like(values, found.multipliers), found.multipliers, atol=1e-6)


def marched(X: Array, begin: float, span: float) -> Array:
    """Return the state of the pair of masses after a time by an integrator with events, impacts by Moreau's law."""
    M, K, C, G = PAIR["mass"], PAIR["stiffness"], PAIR["damping"], PAIR["coupling"]
    W, gaps, t, end = np.linalg.inv(M), np.array([0.5, 0.4]), begin, begin + span

    def rate(at: float, state: Array) -> Array:
        x, v, warm = np.split(state, 3)
        force = (0.2 + np.sin(TURN * 0.2 * at + np.pi / 2)) * PAIR["load"] - K @ x - C @ v - G @ warm
        return np.concatenate([v, W @ force, -PAIR["conductance"] @ warm / 2.0])

    def gap(k: int) -> Any:
        def own(at: float, state: Array) -> float:
            return float(gaps[k] - state[k])

        own.terminal, own.direction = True, -1.0  # type: ignore[attr-defined]
        return own

    while t < end:
        run = solve_ivp(rate, (t, end), X, method="DOP853", rtol=1e-13, atol=1e-14, events=[gap(0), gap(1)])
        t, X = float(run.t[-1]), run.y[:, -1].copy()
        for k in (0, 1):
            if run.t_events[k].size:
                p = 1.6 * X[2 + k] / W[k, k]
                X[2:4] -= p * W[:, k]
                X[4 + k] += 0.3 * p / 2.0
    return X


@pytest.mark.slow
def test_an_integrator_has_the_orbit_and_multipliers_of_two_contacts() -> None:
    found = paired()
    flow, motion = found.flow, found.motion
    start, end = np.concatenate([part[0] for part in (np.atleast_2d(each) for each in flow.parts(motion.start))]), []
    coordinates = flow.structure.coordinates
    into = np.zeros((6, 6))
    for row, basis in zip((slice(0, 2), slice(2, 4)), (coordinates.displacement_basis,) * 2, strict=True):
        into[row, row] = basis
    into[4:, 4:] = coordinates.temperature_basis
    start, share = into @ start, 1e-3
    np.testing.assert_allclose(marched(start, motion.begin, motion.span), start, atol=1e-10)
    for moved in share * np.eye(6):
        ends = [marched(start + k * moved, motion.begin, motion.span) for k in (1, -1, 2, -2)]
        end.append((8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * share))
    values = np.linalg.eigvals(np.transpose(end))
    np.testing.assert_allclose(sorted_like(values, found.multipliers), found.multipliers, atol=1e-8)


def random_rub(seed: int) -> tuple[Structure, Cases]:
    """Return a structure of one to three contacts, with mass, without, or on an elastic casing, and a case of it."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    size, rubs, warms = count + int(rng.integers(1, 4)), rng.random() < 0.4, rng.random() < 0.5
    entries = random_entries(rng, count, size, 2, rubs, seed % 3 == 1)
    entries["damping"] = float(rng.uniform(5, 60)) * entries["mass"] + 2e-5 * entries["stiffness"]
    structure, frequency = of_entries(entries), float(rng.uniform(80, 300))
    batch = cases_of_file(
        structure,
        e=float(rng.choice([0, 0.3, 0.7])),
        alpha=float(rng.uniform(0.02, 0.1)) if warms else 0.0,
        friction=0.15 if rubs else 0.0,
        mean=float(rng.uniform(0, 4)),
        amplitude=float(rng.uniform(2, 12)),
        frequency=frequency,
        phase=float(rng.uniform(-3, 3)),
        gaps=rng.uniform(2e-6, 3e-5, count),
        casing_harmonics=[[2e-6, frequency, 1.0]],
    )
    return structure.on_casing(4e-6) if seed % 3 == 2 else structure, batch


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 60, 12))
def test_random_structures_settle_where_their_transients_do(first: int) -> None:
    """After 3 000 periods; deviations decay as the multipliers say."""
    settled = 0
    for seed in range(first, first + 12):
        structure, batch = random_rub(seed)
        flow = Flow(analysed(structure), batch)
        orbit, last = settle(flow, Options()).orbit, flow.march(flow.start, flow.all_open, 0.0, 3000 * flow.period)
        if last.failure:
            continue
        after = [flow.march(last.X, last.closed, 0.0, k * flow.period, samples=64) for k in (1, 2, 3, 4)]
        scale = scale_of(flow, after)
        if min(flow.size(one.X - last.X, scale) for one in after) > 1e-9:
            continue
        assert orbit is not None, seed
        settled += 1
        near = flow.march(last.X, last.closed, 0.0, orbit.motion.begin + orbit.order * flow.period)
        ends = [flow.march(near.X, near.closed, orbit.motion.begin, k * flow.period).X for k in range(1, 5)]
        assert min(flow.size(X - orbit.motion.start, scale) for X in ends) < 1e-5, seed
        if orbit.motion.times.size:
            moved = orbit.motion.start * (1 + 1e-7)
            assert decay(orbit, moved, orbit.motion.was_closed, 8) == pytest.approx(
                orbit.growth * orbit.motion.span, rel=0.02
            ), seed
    assert settled > 2


def fan() -> Structure:
    """Return a chain of seven masses with five contacts without mass, which heat it."""
    links = np.eye(7) - np.eye(7, k=-1)
    stiffness = links.T @ links
    return of_entries(
        {
            "mass": np.eye(7),
            "stiffness": stiffness,
            "damping": 0.05 * np.eye(7),
            "contact": np.eye(5, 7, 2),
            "residual_flexibility": 0.1 * np.eye(5) + 0.02,
            "load": np.ones(7),
            "heat_capacity": np.eye(7),
            "conductance": 0.2 * links.T @ links + 0.1 * np.eye(7),
            "coupling": 0.02 * links.T @ (np.eye(7) + np.eye(7, k=-1)),
            "thermal_contact": np.eye(5, 7, 2),
        }
    )


def test_a_chord_of_five_contacts_without_mass() -> None:
    """Its transient comes to the orbit after 200 periods, as fast as the settling time says."""
    structure = fan()
    gaps = np.array([4.0, 5.5, 6.5, 7.2, 7.5])
    batch = cases_of_file(structure, alpha=0.1, gaps=gaps, **LOAD | {"frequency": 0.15 / TURN})
    orbit = orbit_of(structure, batch)
    flow, motion = orbit.flow, orbit.motion
    assert motion.sets.all(axis=1).any()
    assert motion.sets.any(axis=0).all()
    first = flow.march(flow.start, flow.all_open, 0.0, 40 * motion.span + motion.begin)
    last = flow.march(first.X, first.closed, motion.begin, 160 * motion.span)
    np.testing.assert_allclose(last.X, motion.start, atol=1e-10 * np.abs(motion.start).max())
    assert decay(orbit, first.X, first.closed, 30) == pytest.approx(orbit.growth * motion.span, rel=0.02)
    found = rub(structure, batch)
    assert found["settling_time"] == pytest.approx(-1 / orbit.growth, rel=1e-12)
    for name in ("steady_impulse", "steady_contact", "steady_max_temperature", "steady_mean_temperature"):
        assert found[name].shape == (5,)
    assert (found["steady_impacts"] == 0).all()
    heat = structure.matrices()
    source = 0.1 * found["steady_impulse"] / motion.span
    inputs = structure.contacts.heat.T @ source
    mean = structure.contacts.heat @ np.linalg.solve(heat.conductance_matrix, inputs)
    np.testing.assert_allclose(found["steady_mean_temperature"], mean, rtol=1e-9)


PRESSED = {
    "stiffness": np.array([[2.0, -1.0], [-1.0, 1.0]]),
    "contact": np.eye(2)[1:],
    "load": np.ones(2),
}
"""Two masses in a row, the last of which meets the casing."""


@pytest.mark.parametrize(
    ("entries", "own", "order", "names"),
    [
        ({}, {"e": 1.0, "gaps": np.ones(1)}, 0.5, ("orbit_displacement", "floquet_angle")),
        (PRESSED, {"mean": 3.0, "gaps": np.zeros(1)}, 1.0, ("orbit_displacement", "steady_impulse")),
        ({"residual_flexibility": np.array([[0.2]])}, {"gaps": np.ones(1)}, 1.0, ("steady_impulse",)),
    ],
    ids=["impacts", "permanent", "without mass"],
)
def test_a_mass_on_a_casing_that_stiffens_tends_to_one_on_a_rigid_one(
    entries: dict[str, Any], own: dict[str, Any], order: float, names: tuple[str, ...]
) -> None:
    """Order of the flexibility c: 1 in permanent contact or without mass; 1/2, e = 1, of impacts that last π √(m c)."""
    rigid = oscillators(max(1, len(entries.get("load", ()))), **entries)

    def found(flexibility: float) -> dict[str, Any]:
        structure = rigid.on_casing(flexibility) if flexibility else rigid
        return rub(structure, cases_of_file(structure, **LOAD, **own))

    limit, *softer = (found(c) for c in (0.0, 1e-4, 1e-4 / 4, 1e-4 / 16))
    for name in names:
        errors = [np.abs(one[name] - limit[name]).max() for one in softer]
        assert errors[-1] > 1e-9
        np.testing.assert_allclose(np.log(np.divide(errors[:-1], errors[1:])) / np.log(4), order, atol=0.02)


@pytest.mark.parametrize(("residual", "flexibility"), [(0.0, 0.05), (0.05, 0.0), (0.03, 0.02)])
def test_the_fold_of_a_resonance_on_an_elastic_stop(residual: float, flexibility: float) -> None:
    """It is at ω = 1.609368218015, by an independent solver in 40 digits, whatever yields: contact or casing."""
    own = {"residual_flexibility": np.array([[residual]])} if residual else {}
    structure = oscillators(1, damping=np.array([[0.04]]), **own)
    structure = structure.on_casing(flexibility) if flexibility else structure

    def problem(omega: float) -> tuple[Structure, Cases]:
        start = {"displacement": -2.4981210350381513, "velocity": 4.2020412256701025}
        load = {"mean": 0.1, "amplitude": 1.0, "frequency": omega / TURN, "phase": np.pi / 2}
        return structure, cases_of_file(structure, gaps=np.array([1.2]), **load, **start)

    values, message = branch(problem, 1.4, 1.65, 8, Options(periods=1, samples=8))
    assert message == ""
    folds = values["value"][values["bifurcation"] == BIFURCATIONS.index("fold")]
    assert folds == pytest.approx([1.609368218015], rel=1e-10)
