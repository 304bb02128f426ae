"""Sweeps along a chain: the answers of its modes, for the cases of a batch and for one alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plain_moreau import Trajectory, march

from scenes import alone, cases, chain, heavy_chain, same_bits, sampling, step, taken
from workflow.models import Array, Cases, Chain, Rayleigh, _tip_held, static_equilibrium
from workflow.reduction import reduce_structure
from workflow.schemes import Results, Sampling, Status, moreau
from workflow.schemes._fixed.decoupled import decouple, start
from workflow.schemes._sweep.sweeps import Swept, node_rows


def swept(structure: Chain, batch: Cases, h: float, over: Sampling, theta: float) -> Results:
    return moreau.compute(moreau.Operator(structure, h, theta, Swept(structure), moreau.CONTACT), batch, over)


def rubs(nodes: int) -> tuple[Chain, Cases, float]:
    """An uneven chain whose cases rub, with loads and heat on its nodes, and a step for it."""
    rng = np.random.default_rng(nodes)
    structure = heavy_chain(
        nodes=nodes,
        mass=rng.uniform(1e-3, 2e-3, nodes),
        conductance=rng.uniform(0.3, 1.0, nodes),
        convection=rng.uniform(0, 0.1, nodes) * (rng.random(nodes) < 0.3),
    )
    batch = cases(
        structure,
        5,
        e=[0.0, 0.3, 0.5, 0.8, 1.0],
        alpha=[0.0, 10.0, 50.0, 0.0, 3.0],
        gap=5e-5 * nodes / 20,
        amplitude=100.0,
        frequency=20.0,
        phase=0.1,
        steady=rng.normal(size=nodes) * 0.1,
        heating=np.array([[0.0], [0.1], [0.2], [0.0], [0.0]]) * np.ones(nodes),
    )
    return structure, batch, 1e-5 * nodes / 20


def whole_balance(structure: Chain, batch: Cases, h: float, path: Trajectory, theta: float) -> float:
    """Energy residual of the first case's whole motion, by midpoint values on the nodes and the load as θ weighs it."""
    v, p, t = path.velocity, path.impulse, h * np.arange(path.impulse.size + 1)
    f = np.tile(batch.steady[0], (t.size, 1))
    f[:, -1] += batch.mean[0] + batch.amplitude[0] * np.sin(2 * np.pi * batch.frequency[0] * t + batch.phase[0])
    f = theta * f[1:] + (1 - theta) * f[:-1]
    v, T = ((y[1:] + y[:-1]) / 2 for y in (v, path.temperature))
    energy = path.energy(structure)
    spent = np.einsum("ti,ij,tj->", v, structure.damping_matrix, v) - np.sum(f * v)
    spent += np.einsum("ti,ij,tj->", v, structure.coupling_matrix, T)
    return float((energy[-1] - energy[0] + h * spent + np.sum(p * v[:, -1])) / energy.max())


def modal_rounding(structure: Chain, batch: Cases, contact_impulse: Array, steps: int, elapsed: float) -> Array:
    """Bound of what rounding gives the heat residual of modes, ``(case,)``.

    In each step a mode's temperature, less the one that heating settles at, is multiplied by a factor: two sums, a
    quotient and the product round it by at most 4 · eps/2. The heat that this loses is compared with the heat turned
    over, which in a run much shorter than 1/μ is a small share of what the settled temperatures contain.
    """
    modal = decouple(structure)
    contained = np.abs(start(modal, batch).heat * (structure.content @ modal.heat_shapes)).sum(axis=1)
    turned = batch.alpha * contact_impulse + elapsed * batch.heating.sum(axis=1)
    relative = np.divide(contained, turned, out=np.zeros_like(turned), where=turned > 0)
    return np.asarray(2 * np.finfo(float).eps * steps * (1 + relative))


@pytest.mark.parametrize("theta", [0.5, 0.7, 1.0])
@pytest.mark.parametrize("nodes", [1, 2, 20, 60, 200])
def test_sweeps_step_as_modes_do(nodes: int, theta: float) -> None:
    structure, batch, h = rubs(nodes)
    over = Sampling(1010.5 * h, 20.21 * h, 51, balances=True)
    modal = step(structure, batch, h, over, theta=theta)
    results = swept(structure, batch, h, over, theta)
    assert nodes <= 2 or modal.metrics["impacts"].min() > 0
    assert np.array_equal(results.metrics["impacts"], modal.metrics["impacts"])
    for ours, theirs in [(results.histories, modal.histories), (results.metrics, modal.metrics)]:
        for name in ours:
            if name not in ("energy_residual", "heat_residual"):
                scale = max(np.abs(theirs[name]).max(), 1e-300)
                assert np.abs(ours[name] - theirs[name]).max() < 1e-9 * scale, name
    for case in range(5) if nodes <= 20 else ():
        path = march(structure, alone(batch, case), h, theta, 1011)
        expected = whole_balance(structure, alone(batch, case), h, path, theta)
        assert abs(results.metrics["energy_residual"][case] - expected) < 1e-9
    difference = np.abs(results.metrics["heat_residual"] - modal.metrics["heat_residual"])
    assert np.all(difference <= modal_rounding(structure, batch, modal.histories["impulse"][:, -1], 1011, 1011 * h))


@pytest.mark.parametrize("theta", [0.0, 0.4, 0.5, 1.0])
def test_sweeps_are_the_plain_scheme(theta: float) -> None:
    """Free parts, adiabatic nodes, broken springs, an explicit step: the states of plain matrices."""
    rng = np.random.default_rng(3)
    for broken in (0, 1, 3):
        springs, conductors = rng.uniform(1, 5, 5), rng.uniform(0.2, 1, 5)
        springs[:broken:2] = conductors[:broken:2] = 0.0
        structure = chain(
            nodes=5,
            mass=rng.uniform(0.5, 2, 5),
            stiffness=springs,
            damping=Rayleigh(0.1, 0.02),
            spacing=1.0,
            expansion=0.05,
            heat_capacity=rng.uniform(0.5, 2, 5),
            conductance=conductors,
        )
        start = rng.uniform(-0.2, 0.2, 5)
        batch = cases(
            structure,
            e=0.6,
            alpha=0.4,
            gap=start[-1] + 0.01,
            mean=0.3,
            amplitude=1.0,
            frequency=0.2,
            displacement=start,
            temperature=rng.uniform(0, 1, 5),
            heating=0.1,
        )
        plain = march(structure, batch, 0.05, theta, 200)
        histories = swept(structure, batch, 0.05, sampling(10.0, 0.05), theta).histories
        assert plain.impulse.sum() > 0
        assert np.abs(histories["displacement"][0] - plain.displacement[:, -1]).max() < 1e-11
        assert np.abs(histories["temperature"][0] - plain.temperature[:, -1]).max() < 1e-11
        assert np.abs(histories["impulse"][0, 1:] - np.cumsum(plain.impulse)).max() < 1e-11


def test_a_case_is_the_same_alone_and_beside_a_poisoned_one() -> None:
    structure, batch, h = rubs(60)
    over = replace(sampling(500 * h, 50 * h), balances=True)
    whole = swept(structure, batch, h, over, 1.0)
    sick = batch.take(np.arange(5))
    sick.velocity[1, 7] = np.nan
    results = swept(structure, sick, h, over, 1.0)
    assert results.status[1] == Status.DIVERGED
    assert np.isnan(results.metrics["energy_residual"][1])
    for case in (0, 2, 4):
        assert same_bits(taken(results, slice(case, case + 1)), taken(whole, slice(case, case + 1)))
        assert same_bits(swept(structure, alone(batch, case), h, over, 1.0), taken(whole, slice(case, case + 1)))


def test_divergence_and_ill_posed_contact_are_told_alike() -> None:
    structure = heavy_chain()
    batch = cases(structure, 2, alpha=[1e8, 5.0], gap=5e-5, amplitude=100.0, frequency=20.0)
    for h, theta in ((1e-3, 1.0), (1e-4, 0.3), (1e-7, 0.3)):
        modal = step(structure, batch, h, sampling(50 * h, 10 * h), theta=theta)
        results = swept(structure, batch, h, sampling(50 * h, 10 * h), theta)
        assert np.array_equal(results.status, modal.status)
        assert results.messages == modal.messages


def test_a_long_chain_runs_full_and_reduced() -> None:
    """3000 nodes, pressed against the casing: it stays there, and its modes say the same of heat."""
    n = 3000
    full = heavy_chain(
        nodes=n,
        mass=0.05 / n,
        stiffness=1e6 * n,
        spacing=0.05 / n,
        heat_capacity=26.3 / n,
        conductance=0.03 * n,
        convection=0.4 / n,
    )
    assert moreau.operator_name(full) == "sweeps along 3000 nodes"
    assert moreau.operator_name(heavy_chain()) == "20 + 20 modes with the tip's own"
    push = np.zeros(n)
    push[-1] = 60.0
    x, theta = static_equilibrium(full, push, np.zeros(n), 5e-5)
    batch = cases(full, 2, alpha=[0.0, 0.5], gap=5e-5, mean=60.0, displacement=x, temperature=theta)
    over = replace(sampling(2e-3, 1e-4), balances=True)
    results = step(full, batch, 1e-5, over)
    assert np.all(results.histories["displacement"] == 5e-5)
    cold, hot = results.histories["impulse"][:, -1]
    assert cold == pytest.approx(10.0 * 2e-3, rel=1e-9)
    assert cold < hot < 1.0001 * cold
    reduction = reduce_structure(full, 3, 40)
    few = step(reduction.structure, reduction.project(batch), 1e-5, over)
    assert few.histories["impulse"][:, -1] == pytest.approx([cold, hot], rel=1e-5)
    assert np.abs(results.metrics["heat_residual"]).max() < 1e-6
    with pytest.raises(ValueError, match="3000 nodes is kept full or reduced to at most"):
        reduce_structure(full, 3, 500)


def test_reduction_of_a_long_chain_is_that_of_a_short_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Modes found one by one along the chain against all modes at once."""
    structure, batch, h = rubs(60)
    over = sampling(1000 * h, 100 * h)
    plain = reduce_structure(structure, 5, 12)
    monkeypatch.setattr(_tip_held, "MOST_BY_JACOBI", 10)
    long = reduce_structure(structure, 5, 12)
    assert long.displacement_basis.tobytes() != plain.displacement_basis.tobytes()
    expected = step(plain.structure, plain.project(batch), h, over)
    results = step(long.structure, long.project(batch), h, over)
    for name in ("displacement", "temperature", "impulse"):
        scale = np.abs(expected.histories[name]).max()
        assert np.abs(results.histories[name] - expected.histories[name]).max() < 1e-9 * scale


@pytest.mark.parametrize("nodes", [*range(1, 40), 1000, 4093, 4094, 4095, 100_000])
def test_rows_of_nodes_never_fall_upon_each_other_in_the_cache(nodes: int) -> None:
    rows = node_rows(24, nodes)
    assert nodes + 2 <= rows.shape[1] < nodes + 2 + 16
    lines, rest = divmod(rows.strides[0], 64)
    assert rest == 0
    assert np.unique(lines * np.arange(24) % 64).size == 24
