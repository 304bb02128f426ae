"""What no step may do: gain energy, leave its bounds, lose a contact, or hide that it cannot go on."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_moreau import march
from random_chains import random_chain

from scenes import cases, chain, heavy_chain, sampling, step
from workflow.models import Rayleigh, static_equilibrium
from workflow.reduction import reduce_structure
from workflow.schemes import Status


@st.composite
def unloaded_scenes(draw: st.DrawFn) -> tuple:
    structure, n = random_chain(draw)
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
        path = march(structure, batch, h, theta, 60)
        energy, p, v = path.energy(structure), path.impulse, path.velocity[:-1, -1]
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


def test_ill_posed_case_names_the_limit_of_the_step() -> None:
    """W <= 0 where heat closes the gap faster than the impulse opens it; W is positive below the named h."""
    structure = heavy_chain()
    batch = cases(structure, 2, alpha=[1e8, 5.0], gap=5e-5, amplitude=100.0, frequency=20.0)
    results = step(structure, batch, 1e-3, sampling(0.05, 1e-3))
    assert list(results.status) == [Status.ILL_POSED, Status.OK]
    assert "no unique solution" in results.messages[0]
    assert np.isnan(results.histories["displacement"][0, -1])
    assert np.isnan(results.metrics["contact_time"][0])
    limit = float(results.messages[0].split("at alpha = 1e+08): ")[1].split(" s is the limit")[0])
    assert 0 < limit < 1e-3
    moreau = import_module("workflow.schemes.moreau")
    for h, well_posed in ((0.999 * limit, True), (1.001 * limit, False)):
        delassus = moreau.init(structure, h, moreau.Options()).delassus(h, np.array([1e8]))
        assert (delassus[0] > 0) is np.bool_(well_posed)
    assert "no step helps" in results.messages[0]  # in 0.05 s the heat of a pressed tip outgrows what a float holds


def test_divergence_is_decided_by_theory() -> None:
    """θ < 1/2: without damping at any step, with it above c/((1 - 2θ) k), before a number shows it."""
    swing = {"gap": 100.0, "displacement": 1e-3}
    structure = chain(nodes=1, mass=1.0, stiffness=4.0)
    results = step(structure, cases(structure, **swing), 0.1, sampling(10.0, 0.1), theta=0.45)
    assert results.status[0] == Status.DIVERGED
    assert "stable at no h" in results.messages[0]
    damped = chain(nodes=1, mass=1.0, stiffness=4.0, damping=Rayleigh(0.1, 0.0))
    limit = 0.1 / (0.1 * 4.0)
    for h, status in ((0.99 * limit, Status.OK), (1.01 * limit, Status.DIVERGED)):
        assert step(damped, cases(damped, **swing), h, sampling(100 * h, h), theta=0.45).status[0] == status


def test_rigid_body_is_stable_and_exact() -> None:
    """A free ball: the double eigenvalue 1 of its free step is no divergence; θ = 1/2 is exact."""
    structure = chain(nodes=1, mass=2.0, stiffness=0.0)
    results = step(structure, cases(structure, gap=1e3, mean=3.0, velocity=0.5), 0.1, sampling(10.0, 0.1), theta=0.5)
    t = np.arange(101) * 0.1
    assert results.status[0] == Status.OK
    assert np.allclose(results.histories["displacement"][0], 0.5 * t + 0.75 * t**2, rtol=1e-13)


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
        results = step(structure, loaded, 1e-4, sampling(0.5, 1e-3), theta=theta)
        force = np.diff(results.histories["impulse"], axis=1) / 1e-3
        assert np.array_equal(results.histories["displacement"], np.repeat(gaps[:, None], 501, axis=1))
        assert np.allclose(force, (120.0 - gaps * 1e6)[:, None], rtol=1e-6)
