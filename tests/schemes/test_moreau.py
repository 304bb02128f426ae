"""The modal kernel against plain matrices, Siconos, exact solutions and the known orders."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_moreau import march
from test_event_driven_random import scene

from scenes import blade, blade_rub, sampling, step
from workflow.schemes import Status


def test_modal_kernel_is_the_plain_scheme() -> None:
    """Random coupled chains, free roots, adiabatic nodes, overdamped modes: the same trajectory."""
    worst, steps = 0.0, 40

    @settings(max_examples=60, deadline=None, derandomize=True)
    @given(st.integers(0, 10**6), st.sampled_from([0.5, 0.7, 1.0]), st.sampled_from([0.01, 0.1, 0.4]))
    def check(seed: int, theta: float, h: float) -> None:
        nonlocal worst
        structure, batch = scene(np.random.default_rng(seed))
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
