"""Energy and heat balances: the definition on plain matrices, and what each scheme may leave."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_moreau import Trajectory
from plain_moreau import march as plain_march
from test_event_driven_random import scene

from scenes import alone, blade, cases, chain, heavy_chain, same_bits, sampling, step, with_dashpot
from workflow import schemes
from workflow.models import Cases, Rayleigh, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import Recorder, Results, Status, moreau
from workflow.schemes._fixed import march
from workflow.schemes._fixed.decoupled import Decoupled, decouple, modes_at_tip

BALANCES = ("energy_residual", "heat_residual")
STEPPED = [method for method in schemes.names() if method != "event_driven"]
STATES = ("displacement", "velocity", "temperature")
STABLE = 1e-5
"""A step at which explicit schemes are stable on the heavy chain, too (limit 1.12e-5 s)."""


def of_moreau(structure: Structure, batch: Cases, h: float, duration: float, theta: float) -> Results:
    return step(structure, batch, h, sampling(duration, duration, balances=True), theta=theta)


@dataclass(frozen=True)
class Relative:
    """Motion of the first case at every step end relative to what heat and constant loads drag along."""

    modal: Decoupled
    response: np.ndarray
    """η that each thermal mode drags along, ``(mode, thermal mode)``."""
    felt: np.ndarray
    eta: np.ndarray
    zeta: np.ndarray
    tip_force: np.ndarray
    """Constant force on the rigid modes, ``(mode,)``."""


def relative_motion(structure: Structure, batch: Cases, h: float, path: Trajectory) -> Relative:
    """Return η and ζ ``(step end, mode)`` in the modes with a share in the tip."""
    modal = decouple(structure)
    omega2, rate, elastic = modal.frequency[:, None] ** 2, modal.rate, modal.frequency > 0
    response = -modal.coupling / (rate**2 - rate * modal.damping[:, None] + omega2)
    heating = modal.heat_shapes.T @ batch.heating[0]
    settled = np.where(rate > 0, heating / np.where(rate > 0, rate, 1.0), 0.0)
    warming = np.where(rate > 0, 0.0, heating)
    t = h * np.arange(len(path.velocity))[:, None]
    tau = path.temperature @ modal.to_thermal.T - settled - t * warming
    steady, load = response @ warming, modal.shapes.T @ batch.steady[0]
    force = load - modal.coupling @ settled - modal.damping * steady
    rest = np.where(elastic, force / np.where(elastic, omega2[:, 0], 1.0), 0.0)
    eta = path.displacement @ modal.to_modes.T - rest - t * steady - tau @ response.T
    zeta = path.velocity @ modal.to_modes.T - steady + tau @ (response * rate).T
    felt = modes_at_tip(modal.tip)
    return Relative(modal, response, felt, eta[:, felt], zeta[:, felt], np.where(elastic, 0.0, load)[felt])


def looked_at(energy: np.ndarray) -> np.ndarray:
    """The energies of which a balance takes the largest."""
    steps = energy.size - 1
    interval = min(march.ENERGY_INTERVAL, steps // march.FEWEST_ENERGIES + 1)
    return energy[np.append(np.arange(0, steps, interval), steps)]


def left_over(structure: Structure, batch: Cases, h: float, path: Trajectory, theta: float) -> float:
    """What a step of the θ-method does to energy by itself, over the largest energy.

    By θ-weighted velocities it takes (θ - 1/2) (Δζ² + ω² Δη²) of each mode; what damping, load and contact, and heat
    take more by midpoint values is taken off.
    """
    motion = relative_motion(structure, batch, h, path)
    modal, felt, zeta, eta = motion.modal, motion.felt, motion.zeta, motion.eta
    omega2, step = modal.frequency[felt] ** 2, theta - 0.5
    dz, de = np.diff(zeta, axis=0), np.diff(eta, axis=0)
    mean = (zeta[1:] + zeta[:-1]) / 2
    energy_given = -step * (dz**2 + omega2 * de**2).sum()
    t = h * np.arange(len(zeta))
    load = batch.mean[0] + batch.amplitude[0] * np.sin(2 * np.pi * batch.frequency[0] * t + batch.phase[0])
    load = theta * load[1:] + (1 - theta) * load[:-1]
    energy_given += h * (modal.damping[felt] * (mean**2 - (mean + step * dz) ** 2)).sum()
    energy_given += ((h * load - path.impulse) * (dz @ modal.tip[felt])).sum() * step
    energy_given += h * (dz @ motion.tip_force).sum() * step
    heat = batch.alpha[0] * path.impulse
    drags = -(motion.response @ modal.heat_tip)[felt]
    pushes = (motion.response @ (modal.rate * modal.heat_tip))[felt]
    energy_given += step * (heat * (dz @ pushes + de @ (omega2 * drags))).sum()
    energy = 0.5 * (zeta**2 + omega2 * eta**2).sum(axis=1)
    return float(energy_given / looked_at(energy).max())


def heat_gained(structure: Structure, batch: Cases, h: float, path: Trajectory, theta: float) -> float:
    """Change of the heat content less friction and heating plus the losses, on the nodes of a full structure, J."""
    T, p = path.temperature, path.impulse
    content = T @ structure.heat_capacity.sum(axis=0)
    lost = h * (theta * T[1:] + (1 - theta) * T[:-1]) @ structure.conductance_matrix.sum(axis=0)
    friction, heating = batch.alpha[0] * p.sum(), h * p.size * batch.heating[0].sum()
    return float(content[-1] - content[0] - friction - heating + lost.sum())


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from([0.5, 0.7, 1.0]))
def test_moreau_against_the_definition(seed: int, theta: float) -> None:
    structure, batch = scene(np.random.default_rng(seed))
    h, steps = 0.02, 300
    path = plain_march(structure, batch, h, theta, steps)
    metrics = of_moreau(structure, batch, h, h * steps, theta).metrics
    if (
        moreau.init(structure, h, moreau.Options(theta=theta)).blocks.pairs.size == 0
    ):  # else a mechanical and a thermal mode are near resonance
        assert abs(metrics["energy_residual"][0] - left_over(structure, batch, h, path, theta)) < 1e-9
    assert abs(heat_gained(structure, batch, h, path, theta)) < 1e-12
    assert abs(metrics["heat_residual"][0]) < 1e-12
    if theta == 0.5:
        assert abs(metrics["energy_residual"][0]) < 1e-10


@pytest.mark.parametrize("theta", [0.5, 0.7, 1.0])
def test_a_free_mode_loses_what_is_known(theta: float) -> None:
    structure, h, steps = chain(nodes=1, mass=2.0, stiffness=18.0), 0.05, 40
    batch = cases(structure, gap=10.0, displacement=0.3)
    ratio = (1 + (1 - theta) ** 2 * (3 * h) ** 2) / (1 + theta**2 * (3 * h) ** 2)
    metrics = of_moreau(structure, batch, h, h * steps, theta).metrics
    assert metrics["energy_residual"][0] == pytest.approx(ratio**steps - 1, abs=1e-13)
    assert metrics["heat_residual"][0] == 0


def test_nothing_moves_nothing_is_missing() -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=2.0)
    metrics = of_moreau(structure, cases(structure, gap=1.0), 0.1, 1.0, 1.0).metrics
    assert [metrics[name][0] for name in BALANCES] == [0.0, 0.0]


def test_the_rubbing_blade_at_one_half() -> None:
    """Ten thousand steps: rounding adds up to so many units in the last place at most."""
    structure = blade()
    batch = cases(structure, 3, e=[0.0, 0.5, 0.9], alpha=30.0, gap=2e-5, amplitude=24.0, frequency=5.0)
    metrics = step(structure, batch, 2e-5, sampling(0.2, 0.1, balances=True), theta=0.5).metrics
    assert metrics["impacts"].min() > 0
    assert np.abs(metrics["energy_residual"]).max() < 1e-12
    assert np.abs(metrics["heat_residual"]).max() < 5e-12


OVERDAMPED = {"mass": 1.0, "stiffness": 9.0, "damping": Rayleigh(10.0, 0.0), "spacing": 1.0, "expansion": 0.05}
"""A mode with the rates 1 and 9 per second."""


def closing() -> dict[str, tuple[Structure, Cases, float]]:
    """Scenes in which all terms of the balance act: heat from little to runaway, a free root, resonance of the two."""
    structure, rub = heavy_chain(), {"gap": 5e-5, "amplitude": 100.0, "frequency": 20.0, "e": 0.5}
    loose = heavy_chain(stiffness=(0.0, *[2.0e7] * 19))
    pair = chain(nodes=1, conductance=1.0, **OVERDAMPED)
    near = cases(pair, e=0.5, alpha=0.3, gap=0.1, amplitude=3.0, frequency=0.2, temperature=1.0, heating=0.2)
    warm = {"heating": 0.3, "temperature": 1.0, "steady": 1.0, "mean": 2.0}
    return {
        **{
            f"alpha {a}": (structure, cases(structure, alpha=a, **rub, **(warm if a else {})), 1e-4) for a in (0, 1, 50)
        },
        "free root": (loose, cases(loose, alpha=50.0, **rub, **warm), 1e-4),
        "resonance": (pair, near, 0.05),
    }


@pytest.mark.parametrize("name", closing())
def test_the_energy_of_the_relative_motion_closes(name: str) -> None:
    structure, batch, h = closing()[name]
    assert (moreau.init(structure, h, moreau.Options()).blocks.pairs.size > 0) == (name == "resonance")
    metrics = of_moreau(structure, batch, h, 1000 * h, 0.5).metrics
    assert metrics["impacts"][0] > 0
    assert abs(metrics["energy_residual"][0]) < 1e-12
    spring = (
        step(structure, batch, h, sampling(1000 * h, 1000 * h, balances=True), "carpenter")
        if name == "resonance"
        else None
    )
    assert spring is None or abs(spring.metrics["energy_residual"][0]) < 1e-12


def test_a_theta_below_one_half_creates_energy() -> None:
    """With the step at which the present figure was worked out on paper: 1.2557 times the largest energy."""
    structure, batch, _ = closing()["alpha 0"]
    metrics = of_moreau(
        structure, replace(batch, mean=np.full(1, 2.0), steady=np.ones((1, 20))), 1e-5, 0.02, 0.45
    ).metrics
    assert metrics["energy_residual"][0] == pytest.approx(1.2557, abs=2e-3)


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("theta", [0.7, 1.0])
def test_modes_and_blocks_count_as_recorded_states_do(theta: float, coupled: bool) -> None:
    """Where no heat makes their energies different ones; with every step's energy."""
    structure, h, over = heavy_chain(), 1e-4, sampling(0.012, 0.012, balances=True)
    structure = with_dashpot(structure, 10, 4, 100.0) if coupled else structure
    batch = cases(structure, 3, e=[0.0, 0.5, 0.9], gap=5e-5, mean=60.0, amplitude=100.0, frequency=50.0)
    paths = [plain_march(structure, alone(batch, case), h, theta, over.steps(h)) for case in range(3)]
    recorder = Recorder(structure, batch, over, h)
    for k in range(1, recorder.steps + 1):
        load = theta * recorder.load(1.0) + (1 - theta) * recorder.load(0.0)
        states = [np.array([getattr(path, name)[k] for path in paths]) for name in STATES]
        recorder.record(*states, np.array([path.impulse[k - 1] for path in paths]), load)
    recorded, stepped = recorder.results().metrics, step(structure, batch, h, over, theta=theta).metrics
    assert stepped["impacts"].min() > 0
    assert np.abs(stepped["energy_residual"]).min() > 0.01
    assert np.abs(recorded["energy_residual"] - stepped["energy_residual"]).max() < 1e-12


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("moreau", {"theta": 0.5}),
        ("moreau", {"theta": 1.0}),
        ("carpenter", {"heat": "explicit"}),
        ("carpenter", {"heat": "implicit"}),
        ("penalty", {}),
        ("penalty", {"integration": "implicit", "theta": 0.8}),
    ],
)
def test_a_reduced_model_keeps_its_heat(method: str, options: dict[str, Any], coupled: bool) -> None:
    """A basis holds no even temperature: the balance is that of the reduced equations, in modes and by matrices."""
    structure: Structure = heavy_chain(convection=2.0)
    if coupled:
        structure = replace(structure.matrices(), damper=np.diag(np.linspace(0.0, 3.0, 20)))
    rub = {"alpha": 50.0, "gap": 5e-5, "mean": 40.0, "amplitude": 100.0, "frequency": 200.0}
    batch = cases(structure, heating=0.3, temperature=1.0, **rub)
    for modes in (1, 4, 12, 19):
        reduction = reduce_structure(structure, 3, modes)
        over = sampling(0.01, 0.01, balances=True)
        metrics = step(reduction.structure, reduction.project(batch), 5e-6, over, method, **options).metrics
        assert metrics["impacts"][0] > 0
        assert abs(metrics["heat_residual"][0]) < 1e-11, modes


def many(nodes: int = 20) -> tuple[Structure, Cases]:
    structure = heavy_chain(nodes=nodes)
    rng = np.random.default_rng(5)
    return structure, cases(
        structure,
        41,
        e=rng.uniform(0, 1, 41),
        alpha=np.where(np.arange(41) % 3 == 0, 0.0, rng.uniform(0, 60, 41)),
        gap=rng.uniform(2e-5, 6e-5, 41),
        amplitude=rng.uniform(80, 120, 41),
        frequency=20.0,
    )


@pytest.mark.parametrize("method", STEPPED)
def test_looking_changes_nothing(method: str) -> None:
    structure, batch = many()
    over = sampling(0.02, 1e-3)
    plain, seen = (
        step(structure, batch, STABLE, over, method),
        step(structure, batch, STABLE, replace(over, balances=True), method),
    )
    assert not set(BALANCES) & set(plain.metrics)
    for name in BALANCES:
        assert np.isfinite(seen.metrics.pop(name)).all()
    assert same_bits(plain, seen)


def test_a_lost_case_has_no_balance() -> None:
    structure, batch = many()
    sick = batch.take(np.arange(4))
    sick.velocity[1] = np.nan
    results = step(structure, sick, 1e-4, sampling(0.02, 1e-3, balances=True))
    assert results.status[1] == Status.DIVERGED
    for name in BALANCES:
        assert np.isnan(results.metrics[name][1])
        assert np.isfinite(results.metrics[name][[0, 2, 3]]).all()


def test_an_exact_scheme_has_none() -> None:
    structure, batch = many()
    results = step(structure, batch, STABLE, sampling(0.02, 1e-3, balances=True), "event_driven")
    assert all(np.isnan(results.metrics[name]).all() for name in BALANCES)
