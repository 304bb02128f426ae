"""The modal kernel against plain matrices, Siconos, exact solutions and the known orders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_moreau import march
from random_chains import random_chain

from scenes import blade, blade_rub, cases, chain, sampling, siconos_chain, step
from workflow.models import Rayleigh
from workflow.schemes import Status

DATA = Path(__file__).parents[1] / "data"


@pytest.mark.parametrize(("theta", "e", "file"), [(1.0, 0.0, "theta1_e0"), (0.5, 0.8, "theta0.5_e0.8")])
def test_siconos_trajectories(theta: float, e: float, file: str) -> None:
    with np.load(DATA / f"siconos_{file}.npz") as siconos:
        structure = siconos_chain()
        batch = cases(structure, e=e, gap=1e-4, amplitude=20.0, frequency=50.0)
        histories = step(structure, batch, 1e-5, sampling(0.2, 1e-5), theta=theta).histories
        impulse_per_step = np.diff(histories["impulse"][0], prepend=0.0)
        for ours, theirs in (
            (histories["displacement"][0], siconos["displacement"]),
            (histories["velocity"][0], siconos["velocity"]),
            (impulse_per_step, siconos["impulse_per_step"]),
        ):
            assert np.abs(ours - theirs).max() <= 1e-9 * np.abs(theirs).max()


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
        results = step(structure, batch, h, sampling(steps * h, h), theta=theta)
        if results.status[0] == Status.ILL_POSED:
            return
        x, v, T = plain.displacement[:, -1], plain.velocity[:, -1], plain.temperature[:, -1]
        if np.any(np.abs(x + h / 2 * v - batch.gap[0]) < 1e-12):
            return  # rounding may decide this activation differently in two implementations
        for ours, theirs in (
            (results.histories["displacement"][0], x),
            (results.histories["velocity"][0], v),
            (results.histories["temperature"][0], T),
            (results.histories["impulse"][0][1:], np.cumsum(plain.impulse)),
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
        end = step(structure, batch, h, sampling(duration, 0.1), theta=theta).histories["displacement"][0, -1]
        errors.append(abs(end - exact))
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert abs(slope - order) < 0.1
    assert errors[-1] < largest


def test_bouncing_ball() -> None:
    """Impact times, rest after the accumulation point, and p = m g h per step at rest."""
    m, g, height, e, h = 0.7, 9.81, 1.0, 0.9, 1e-4
    structure = chain(nodes=1, mass=m, stiffness=0.0)
    batch = cases(structure, e=e, gap=height, mean=m * g)
    results = step(structure, batch, h, sampling(10.0, h), theta=0.5)
    impulse = np.diff(results.histories["impulse"][0])
    times = np.arange(1, impulse.size + 1) * h
    tau = np.sqrt(2 * height / g)
    exact = tau * (1 + 2 * np.concatenate([[0], np.cumsum(e ** np.arange(1, 12))]))
    hits = times[impulse > 10 * m * g * h][:12]
    assert np.abs(hits - exact).max() < 25 * h  # the first order of a velocity-level scheme, twelve impacts on
    rest = tau * (1 + e) / (1 - e)
    assert rest == pytest.approx(8.5789491787, abs=1e-9)
    at_rest = times > rest + 0.3
    assert np.abs(impulse[at_rest] - m * g * h).max() < 1e-12 * m * g * h * 1e3
    assert np.ptp(results.histories["displacement"][0, 1:][at_rest]) < 1e-12
    assert results.metrics["contact_time"][0] > 10.0 - rest - 0.3


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
    results = step(structure, batch, h, sampling(12.0, h), theta=theta)
    assert np.abs(results.histories["displacement"][0] - plain.displacement[:, -1]).max() < 1e-10
    force = np.diff(results.histories["impulse"][0]) / h
    t = np.arange(1, force.size + 1) * h
    during = force[(t > 1.1) & (t < 1.9)]
    if theta == 0.5:
        assert during.mean() == pytest.approx(0.5, abs=0.005)
        assert during.std() <= 0.003


@pytest.mark.parametrize("nodes", [10, 20, 40, 80])
def test_blade_against_its_exact_figures(nodes: int) -> None:
    """Ten contacts in ten periods, impulse 0.106 to 0.365 N s, peaks 4.2 and 9.5 N."""
    structure = blade(nodes)
    results = step(structure, blade_rub(structure), 1e-5, sampling(2.0, 1e-3), theta=0.5)
    first, last = results.period_impulse[0, [0, -1]]
    assert results.metrics["impacts"][0] == 10
    assert first == pytest.approx(0.106, rel=0.02)
    assert last == pytest.approx(0.365, rel=0.02)
    assert last / first == pytest.approx(3.4440, rel=0.005)  # n = 80, 3.44396: the tip's half cell converges
    force = np.diff(results.histories["impulse"][0]) / 1e-3
    assert force[:200].max() == pytest.approx(4.2, rel=0.01)
    assert force[-200:].max() == pytest.approx(9.5, rel=0.01)
    if nodes == 20:
        assert results.metrics["max_temperature"][0] == pytest.approx(408, rel=0.005)
