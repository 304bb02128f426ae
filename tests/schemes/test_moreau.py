"""The modal kernel against plain matrices, Siconos, exact solutions and the known orders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_moreau import march

from scenes import (
    alone,
    blade,
    blade_rub,
    cases,
    chain,
    heavy_chain,
    relative,
    same_bits,
    sampling,
    siconos_chain,
    step,
    taken,
)
from workflow import schemes
from workflow.models import Rayleigh, static_equilibrium
from workflow.reduction import reduce_structure
from workflow.schemes import Status

DATA = Path(__file__).parents[1] / "data"


@pytest.mark.parametrize(("theta", "e", "file"), [(1.0, 0.0, "theta1_e0"), (0.5, 0.8, "theta0.5_e0.8")])
def test_siconos_trajectories(theta: float, e: float, file: str) -> None:
    with np.load(DATA / f"siconos_{file}.npz") as siconos:
        structure = siconos_chain()
        batch = cases(structure, e=e, gap=1e-4, amplitude=20.0, frequency=50.0)
        found = step(structure, batch, 1e-5, sampling(0.2, 1e-5), theta=theta).histories
        impulse_per_step = np.diff(found["impulse"][0], prepend=0.0)
        for ours, theirs in (
            (found["displacement"][0], siconos["displacement"]),
            (found["velocity"][0], siconos["velocity"]),
            (impulse_per_step, siconos["impulse_per_step"]),
        ):
            assert np.abs(ours - theirs).max() <= 1e-9 * np.abs(theirs).max()


def random_chain(draw: st.DrawFn, heat: bool) -> tuple:
    n = draw(st.integers(1, 6))
    numbers = st.floats(0.2, 5.0)
    free_root = draw(st.booleans())
    stiffness = [draw(numbers) for _ in range(n)]
    if free_root:
        stiffness[0] = 0.0
    lumps = {
        "nodes": n,
        "mass": tuple(draw(numbers) for _ in range(n)),
        "stiffness": tuple(stiffness),
        "damping": Rayleigh(draw(st.sampled_from([0.0, 0.1, 3.0])), draw(st.sampled_from([0.0, 0.02, 2.0]))),
    }
    if heat:
        lumps |= {
            "spacing": 1.0,
            "expansion": draw(st.sampled_from([0.0, 0.05])),
            "heat_capacity": tuple(draw(numbers) for _ in range(n)),
            "conductance": draw(st.sampled_from([0.0, 1.0])),
            "convection": draw(st.sampled_from([0.0, 0.3])),
        }
    return chain(**lumps), n


@st.composite
def coupled_scenes(draw: st.DrawFn) -> tuple:
    structure, n = random_chain(draw, heat=True)
    values = st.floats(-1.0, 1.0)
    lists = st.lists(values, min_size=n, max_size=n)
    state = draw(lists)
    batch = cases(
        structure,
        e=draw(st.floats(0, 1)),
        alpha=draw(st.sampled_from([0.0, 0.3, 2.0])),
        gap=state[-1] + draw(st.sampled_from([0.0, 0.05, 0.5])),
        mean=draw(st.sampled_from([0.0, 0.5, -0.5])),
        amplitude=draw(st.sampled_from([0.0, 2.0])),
        frequency=draw(st.floats(0.01, 2.0)),
        phase=draw(values),
        steady=draw(st.sampled_from([0.0, 0.4])),
        heating=draw(st.sampled_from([0.0, 0.5])),
        displacement=state,
        velocity=draw(lists),
        temperature=draw(lists),
    )
    return structure, batch, draw(st.sampled_from([0.5, 0.7, 1.0])), draw(st.sampled_from([0.01, 0.1, 0.4]))


def test_modal_kernel_is_the_plain_scheme() -> None:
    """Random coupled chains, free roots, adiabatic nodes, overdamped modes: the same trajectory."""
    worst = 0.0

    @settings(max_examples=60, deadline=None, derandomize=True)
    @given(coupled_scenes())
    def check(scene: tuple) -> None:
        nonlocal worst
        structure, batch, theta, h = scene
        steps = 40
        plain = march(structure, batch, h, theta, steps)
        found = step(structure, batch, h, sampling(steps * h, h), theta=theta)
        if found.status[0] == Status.ILL_POSED:
            return
        x, v, T = plain.displacement[:, -1], plain.velocity[:, -1], plain.temperature[:, -1]
        if np.any(np.abs(x + h / 2 * v - batch.gap[0]) < 1e-12):
            return  # rounding may decide this activation differently in two implementations
        for ours, theirs in (
            (found.histories["displacement"][0], x),
            (found.histories["velocity"][0], v),
            (found.histories["temperature"][0], T),
            (found.histories["impulse"][0][1:], np.cumsum(plain.impulse)),
        ):
            scale = max(1.0, np.abs(theirs).max())
            worst = max(worst, float(np.abs(ours - theirs).max() / scale))

    check()
    assert worst < 1e-10  # a few hundred roundings of states of order one, at most 1e3 times amplified


@pytest.mark.parametrize(("theta", "order", "largest"), [(0.5, 2, 2e-6), (1.0, 1, 2e-3)])
def test_order_on_a_smooth_arc(theta: float, order: int, largest: float) -> None:
    """Free swing of the heavy chain from a bent state, against the matrix exponential."""
    from scipy.linalg import expm

    structure = chain(nodes=3, mass=1.0, stiffness=40.0, damping=Rayleigh(0.1, 1e-3))
    start = np.array([0.1, 0.3, 0.2])
    duration = 1.0
    n = 3
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:, :n] = -np.linalg.solve(structure.mass, structure.stiffness_matrix)
    A[n:, n:] = -np.linalg.solve(structure.mass, structure.damping_matrix)
    exact = (expm(A * duration) @ np.concatenate([start, np.zeros(n)]))[n - 1]
    steps = np.array([1e-3, 5e-4, 2.5e-4])
    batch = cases(structure, gap=10.0, displacement=start)
    errors = []
    for h in steps:
        found = step(structure, batch, h, sampling(duration, 0.1), theta=theta).histories["displacement"][0, -1]
        errors.append(abs(found - exact))
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert abs(slope - order) < 0.1
    assert errors[-1] < largest


def test_bouncing_ball() -> None:
    """Impact times, rest after the accumulation point, and p = m g h per step at rest."""
    m, g, height, e, h = 0.7, 9.81, 1.0, 0.9, 1e-4
    structure = chain(nodes=1, mass=m, stiffness=0.0)
    batch = cases(structure, e=e, gap=height, mean=m * g)
    found = step(structure, batch, h, sampling(10.0, h), theta=0.5)
    impulse = np.diff(found.histories["impulse"][0])
    times = np.arange(1, impulse.size + 1) * h
    tau = np.sqrt(2 * height / g)
    exact = tau * (1 + 2 * np.concatenate([[0], np.cumsum(e ** np.arange(1, 12))]))
    hits = times[impulse > 10 * m * g * h][:12]
    assert np.abs(hits - exact).max() < 25 * h  # the first order of a velocity-level scheme, twelve impacts on
    rest = tau * (1 + e) / (1 - e)
    assert rest == pytest.approx(8.5789491787, abs=1e-9)
    at_rest = times > rest + 0.3
    assert np.abs(impulse[at_rest] - m * g * h).max() < 1e-12 * m * g * h * 1e3
    assert np.ptp(found.histories["displacement"][0, 1:][at_rest]) < 1e-12
    assert found.metrics["contact_time"][0] > 10.0 - rest - 0.3


@pytest.mark.parametrize(("theta", "least", "most"), [(0.5, 0.98, 1.0), (1.0, 0.47, 0.50)])
def test_clamped_bar_released_against_its_wall(theta: float, least: float, most: float) -> None:
    """Four contact periods of the exact solution: energy kept, contact force one half."""
    n = 100
    mass = np.full(n, 1 / n)
    mass[-1] /= 2
    structure = chain(nodes=n, mass=tuple(mass), stiffness=float(n))
    start = -np.arange(1, n + 1) / (2 * n)
    batch = cases(structure, displacement=start)
    h = 0.5 / n
    plain = march(structure, batch, h, theta, round(12 / h))
    energy = plain.energy(structure)
    assert energy[0] == pytest.approx(1 / 8, rel=1e-3)
    assert least <= energy[-1] / energy[0] <= most
    found = step(structure, batch, h, sampling(12.0, h), theta=theta)
    assert np.abs(found.histories["displacement"][0] - plain.displacement[:, -1]).max() < 1e-10
    force = np.diff(found.histories["impulse"][0]) / h
    t = np.arange(1, force.size + 1) * h
    during = force[(t > 1.1) & (t < 1.9)]
    if theta == 0.5:
        assert during.mean() == pytest.approx(0.5, abs=0.005)
        assert during.std() <= 0.003


@st.composite
def unloaded_scenes(draw: st.DrawFn) -> tuple:
    structure, n = random_chain(draw, heat=False)
    values = st.lists(st.floats(-1.0, 1.0), min_size=n, max_size=n)
    state = draw(values)
    e = draw(st.floats(0.0, 1.0))
    batch = cases(
        structure,
        e=e,
        gap=state[-1] + draw(st.floats(0.0, 0.3)),
        displacement=state,
        velocity=draw(values),
    )
    theta = draw(st.one_of(st.floats(0.5, 1.0), st.just(1 / (1 + e))))
    return structure, batch, theta, draw(st.sampled_from([0.003, 0.05, 0.5])), e


def test_energy_never_rises_but_by_the_known_work() -> None:
    """Reference README: without load and heat, E rises at most by -p v_n,k [(1-θ) - θe] in a step."""
    impacts = 0

    @settings(max_examples=150, deadline=None, derandomize=True)
    @given(unloaded_scenes())
    def check(scene: tuple) -> None:
        nonlocal impacts
        structure, batch, theta, h, e = scene
        found = march(structure, batch, h, theta, 60)
        energy, p, v = found.energy(structure), found.impulse, found.velocity[:-1, -1]
        rise = np.diff(energy)
        rounding = 1e-12 * max(energy.max(), 1e-300)
        impacts += int(np.sum(p > 0))
        if theta <= 1 / (1 + e):
            assert np.all(rise[(p == 0) | (v >= 0)] <= rounding)
        if theta == 1 / (1 + e):
            assert np.all(rise <= rounding)
        assert np.all(rise <= np.maximum(-p * v * ((1 - theta) - theta * e), 0.0) + rounding)

    check()
    assert impacts > 200  # the scenes do touch


@pytest.mark.parametrize("nodes", [10, 20, 40, 80])
def test_blade_against_its_exact_figures(nodes: int) -> None:
    """DESIGN section 3: ten contacts in ten periods, impulse 0.106 to 0.365 N s, peaks 4.2 and 9.5 N."""
    structure = blade(nodes)
    found = step(structure, blade_rub(structure), 1e-5, sampling(2.0, 1e-3), theta=0.5)
    first, last = found.period_impulse[0, [0, -1]]
    assert found.metrics["impacts"][0] == 10
    assert first == pytest.approx(0.106, rel=0.02)
    assert last == pytest.approx(0.365, rel=0.02)
    assert last / first == pytest.approx(3.4440, rel=0.005)  # n = 80, 3.44396: the tip's half cell converges
    force = np.diff(found.histories["impulse"][0]) / 1e-3
    assert force[:200].max() == pytest.approx(4.2, rel=0.01)
    assert force[-200:].max() == pytest.approx(9.5, rel=0.01)
    if nodes == 20:
        assert found.metrics["max_temperature"][0] == pytest.approx(408, rel=0.005)


@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize("h", [1e-4, 1e-3, 1e-2, 1e-1])
def test_bounded_at_any_step(theta: float, h: float) -> None:
    structure = heavy_chain()
    batch = cases(structure, gap=5e-5, amplitude=100.0, frequency=0.7)
    found = step(structure, batch, h, sampling(10.0, h), theta=theta)
    assert found.status[0] == Status.OK
    assert found.metrics["contact_time"][0] > 0
    assert np.abs(found.histories["displacement"]).max() <= 1.2e-4


def varied_batch(count: int) -> tuple:
    structure = heavy_chain()
    rng = np.random.default_rng(1)
    batch = cases(
        structure,
        count,
        e=rng.uniform(0, 1, count),
        alpha=np.where(rng.random(count) < 0.3, 0.0, rng.uniform(0, 60, count)),
        gap=rng.uniform(2e-5, 6e-5, count),
        amplitude=rng.uniform(80, 120, count),
        frequency=rng.choice([20.0, 30.0, 47.0], count),
        phase=rng.uniform(-1, 1, count),
        heating=rng.choice([0.0, 0.1], count)[:, None],
    )
    return structure, batch


def test_bits_do_not_depend_on_the_batch() -> None:
    structure, batch = varied_batch(1000)
    over = sampling(0.05, 1e-3)
    whole = step(structure, batch, 1e-4, over)
    for case in (0, 31, 32, 517, 999):
        assert same_bits(step(structure, alone(batch, case), 1e-4, over), _trimmed(whole, case, 1))
    seven = slice(30, 37)
    assert same_bits(step(structure, batch.take(seven), 1e-4, over), _trimmed(whole, 30, 7))


def _trimmed(results: schemes.Results, first: int, count: int) -> schemes.Results:
    """Some cases of a batch, with as many columns of periods as they have on their own."""
    from dataclasses import replace

    found = taken(results, slice(first, first + count))
    periods = int(np.max(np.sum(~np.isnan(found.period_impulse), axis=1)))
    return replace(
        found,
        period_impulse=found.period_impulse[:, :periods].copy(),
        period_temperature=found.period_temperature[:, :periods].copy(),
        period_contact=found.period_contact[:, :periods].copy(),
    )


def test_a_lost_neighbour_changes_nothing() -> None:
    structure, batch = varied_batch(9)
    over = sampling(0.05, 1e-3)
    clean = step(structure, batch, 1e-3, over)
    for poison in (np.nan, np.inf, 1e300):
        sick = batch.take(np.arange(9))
        sick.velocity[4, -1] = poison
        sick.alpha[4] = 0.0 if poison != 1e300 else 1e12
        found = step(structure, sick, 1e-3, over)
        assert found.status[4] != Status.OK
        for part in (slice(0, 4), slice(5, 9)):
            assert same_bits(taken(found, part), taken(clean, part))


def test_ill_posed_case_names_the_largest_admissible_step() -> None:
    """W <= 0 where heat closes the gap faster than the impulse opens it; below the named h it runs."""
    structure = heavy_chain()
    batch = cases(structure, 2, alpha=[1e8, 5.0], gap=5e-5, amplitude=100.0, frequency=20.0)
    found = step(structure, batch, 1e-3, sampling(0.05, 1e-3))
    assert list(found.status) == [Status.ILL_POSED, Status.OK]
    assert "no unique solution" in found.messages[0]
    assert np.isnan(found.histories["displacement"][0, -1])
    assert np.isnan(found.metrics["contact_time"][0])
    limit = float(found.messages[0].split("admissible h is ")[1].split(" s")[0])
    assert 0 < limit < 1e-3
    moreau = schemes.load("moreau")
    for h, well_posed in ((0.999 * limit, True), (1.001 * limit, False)):
        modal = moreau.init(structure, h, moreau.Options()).modal
        assert (moreau.delassus(modal, h, 1.0, np.array([1e8]))[0] > 0) is np.bool_(well_posed)


def test_divergence_is_decided_by_theory() -> None:
    """θ < 1/2 without damping: every step grows as the known formula, before a number shows it."""
    structure = chain(nodes=1, mass=1.0, stiffness=4.0)
    batch = cases(structure, gap=100.0, displacement=1e-3)
    h, theta, omega = 0.1, 0.45, 2.0
    found = step(structure, batch, h, sampling(10.0, h), theta=theta)
    assert found.status[0] == Status.DIVERGED
    assert "stable at no h" in found.messages[0]
    growth = (1 + (1 - theta) ** 2 * (omega * h) ** 2) / (1 + theta**2 * (omega * h) ** 2)
    x, v = found.histories["displacement"][0], found.histories["velocity"][0]
    energy = v**2 / 2 + 2 * x**2
    assert energy[-1] / energy[0] == pytest.approx(growth**100, rel=1e-9)
    damped = chain(nodes=1, mass=1.0, stiffness=4.0, damping=Rayleigh(0.1, 0.0))
    limit = 0.1 / (0.1 * 4.0)
    for h, status in ((0.99 * limit, Status.OK), (1.01 * limit, Status.DIVERGED)):
        swing = cases(damped, gap=100.0, displacement=1e-3)
        assert step(damped, swing, h, sampling(100 * h, h), theta=theta).status[0] == status
    assert step(structure, batch, 0.1, sampling(1.0, 0.1), theta=0.5).status[0] == Status.OK


def test_rigid_body_is_stable_and_exact() -> None:
    """A free ball: the double eigenvalue 1 of its free step is no divergence; θ = 1/2 is exact."""
    structure = chain(nodes=1, mass=2.0, stiffness=0.0)
    found = step(structure, cases(structure, gap=1e3, mean=3.0, velocity=0.5), 0.1, sampling(10.0, 0.1), theta=0.5)
    t = np.arange(101) * 0.1
    assert found.status[0] == Status.OK
    assert np.allclose(found.histories["displacement"][0], 0.5 * t + 0.75 * t**2, rtol=1e-13)


def test_samples_between_step_ends_are_linear_and_on_them_exact() -> None:
    structure, batch = varied_batch(3)
    fine = step(structure, batch, 1e-4, sampling(0.03, 1e-4)).histories
    coarse = step(structure, batch, 1e-4, sampling(0.03, 2.5e-4)).histories
    for name in schemes.HISTORIES:
        assert np.array_equal(coarse[name][:, ::2], fine[name][:, ::5])
        assert np.allclose(coarse[name][:, 1::2], (fine[name][:, 2::5] + fine[name][:, 3::5]) / 2, rtol=1e-12, atol=0)


def test_last_step_beyond_the_duration_counts_up_to_it() -> None:
    """duration/h = 12.5: the metrics end where the last sample lies."""
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    batch = cases(structure, gap=0.0, mean=1.0)
    found = step(structure, batch, 0.08, sampling(1.0, 0.5))
    assert found.metrics["steps"][0] == 13
    assert found.metrics["contact_time"][0] == pytest.approx(1.0, rel=1e-12)
    assert found.histories["impulse"][0, -1] == pytest.approx(1.0, rel=1e-12)


def test_load_periods_close_exactly() -> None:
    """Impulses of the periods add up, and shares of contact times the period do too."""
    structure = blade()
    found = step(structure, blade_rub(structure), 3e-4, sampling(2.0, 1e-3))
    assert found.period_impulse.shape == (1, 10)
    assert found.period_impulse.sum() == pytest.approx(found.histories["impulse"][0, -1], rel=1e-12)
    assert found.period_contact.sum() * 0.2 == pytest.approx(found.metrics["contact_time"][0], rel=1e-12)
    assert found.period_temperature.max() == found.metrics["max_temperature"][0]


def test_thermal_states_cost_nothing_where_they_cannot_act() -> None:
    """α = 0, no heating, cold: the mechanical result is that of a structure without heat."""
    structure = heavy_chain()
    scene = {"gap": 5e-5, "amplitude": 100.0, "frequency": 20.0}
    cold = step(structure, cases(structure, **scene), 1e-4, sampling(0.3, 1e-3))
    rigid_heat = heavy_chain(expansion=0.0)
    other = step(rigid_heat, cases(rigid_heat, **scene), 1e-4, sampling(0.3, 1e-3))
    assert np.all(cold.histories["temperature"] == 0)
    assert relative(cold.histories["displacement"], other.histories["displacement"]) < 1e-12


@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize("e", [0.0, 0.7])
def test_a_pressed_tip_stays_on_its_casing(theta: float, e: float) -> None:
    """Static starts at x = d exactly: no rounding may lose the contact, whatever gap, model and heat."""
    full = heavy_chain()
    gaps = np.linspace(1e-5, 7e-5, 31)
    rest = [static_equilibrium(full, np.eye(20)[-1] * 120.0, np.zeros(20), float(gap)) for gap in gaps]
    batch = cases(
        full, 31, e=e, alpha=np.arange(31) % 2 * 1e-9, gap=gaps, mean=120.0, displacement=np.array([x for x, _ in rest])
    )
    reduction = reduce_structure(full, 3, 12)
    for structure, loaded in ((full, batch), (reduction.structure, reduction.project(batch))):
        found = step(structure, loaded, 1e-4, sampling(0.5, 1e-3), theta=theta)
        force = np.diff(found.histories["impulse"], axis=1) / 1e-3
        assert np.array_equal(found.histories["displacement"], np.repeat(gaps[:, None], 501, axis=1))
        assert np.allclose(force, (120.0 - gaps * 1e6)[:, None], rtol=1e-6)
