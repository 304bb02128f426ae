"""Energy and heat balances: what is known of them, and what each scheme may leave."""

import numpy as np
import pytest

from plain_steps import march as plain_march
from scenes import alone, cases, chain, heavy_chain, movable, rubs, same_bits, sampling, step, with_dashpot
from workflow import schemes
from workflow.models import Cases, Rayleigh, Structure
from workflow.schemes import Recorder, Results

BALANCES = ("energy_residual", "heat_residual")
STEPPED = [method for method in schemes.names() if method != "event_driven"]
STATES = ("displacement", "velocity", "temperature")
STABLE = 1e-5
"""A step at which explicit schemes are stable on the heavy chain, too (limit 1.12e-5 s)."""


def of_moreau(structure: Structure, batch: Cases, h: float, duration: float, theta: float) -> Results:
    return step(structure, movable(batch), h, sampling(duration, duration), theta=theta)


@pytest.mark.parametrize("steps", [120, 3000])
@pytest.mark.parametrize("theta", [0.45, 0.5, 0.7, 1.0])
def test_a_lump_by_the_definition(theta: float, steps: int) -> None:
    """Σ [ΔE + hc w_m² - I w_m - k J y_m], y and w relative to x = rθ, which its temperature drags along."""
    m, k, c, h = 2.0, 18.0, 0.9, 0.02
    lump = {"mass": m, "stiffness": k, "damping": Rayleigh(c / m), "spacing": 1.0, "expansion": 0.05}
    structure = chain(nodes=1, heat_capacity=1.3, conductance=2.0, **lump)
    batch = cases(structure, e=0.5, alpha=0.8, gap=0.02, mean=1.0, amplitude=3.0, frequency=0.7, temperature=0.4)
    path = plain_march(structure, batch, h, theta, steps)
    decay = 2.0 / 1.3
    drags = -structure.coupling_matrix[0, 0] / (m * decay**2 - c * decay + k)
    y, w = path.displacement - drags * path.temperature, path.velocity + drags * decay * path.temperature

    def weighed(values: np.ndarray, end: float = theta) -> np.ndarray:
        return end * values[1:] + (1 - end) * values[:-1]

    jump = np.diff(y, axis=0) - h * weighed(w)
    impulse = m * np.diff(w, axis=0) + h * c * weighed(w) + h * k * weighed(y)
    energy = 0.5 * (m * w**2 + k * y**2)
    given = np.diff(energy, axis=0) + h * c * weighed(w, 0.5) ** 2
    given -= impulse * weighed(w, 0.5) + k * jump * weighed(y, 0.5)
    metrics = of_moreau(structure, batch, h, h * steps, theta).metrics
    assert metrics["impacts"][0] > 3
    assert metrics["energy_residual"][0] == pytest.approx(given.sum() / energy.max(), abs=1e-12)


def test_nothing_moves_nothing_is_missing() -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=2.0)
    metrics = of_moreau(structure, cases(structure, gap=1.0), 0.1, 1.0, 1.0).metrics
    assert [metrics[name][0] for name in BALANCES] == [0.0, 0.0]


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("theta", [0.7, 1.0])
def test_modes_and_blocks_count_as_recorded_states_do(theta: float, coupled: bool) -> None:
    """Where no heat makes their energies different ones."""
    structure, h, over = heavy_chain(), 1e-4, sampling(0.05, 0.05)
    structure = with_dashpot(structure, 10, 4, 100.0) if coupled else structure
    batch = movable(cases(structure, 3, e=[0.0, 0.5, 0.9], gap=5e-5, mean=60.0, amplitude=100.0, frequency=50.0))
    paths = [plain_march(structure, alone(batch, case), h, theta, over.steps(h)) for case in range(3)]
    recorder = Recorder(structure, batch, over, h)
    for k in range(1, recorder.steps + 1):
        load = theta * recorder.load(1.0) + (1 - theta) * recorder.load(0.0)
        states = [np.array([getattr(path, name)[k] for path in paths]) for name in STATES]
        recorder.record(*states, np.array([path.impulse[k, 0] for path in paths]), load)
    recorded, stepped = recorder.results().metrics, step(structure, batch, h, over, theta=theta).metrics
    assert stepped["impacts"].min() > 0
    assert np.abs(stepped["energy_residual"]).min() > 0.01
    assert np.abs(recorded["energy_residual"] - stepped["energy_residual"]).max() < 1e-12


@pytest.mark.parametrize("method", STEPPED)
def test_looking_changes_nothing(method: str) -> None:
    structure, batch = heavy_chain(), rubs(heavy_chain(), 41)
    plain, seen = (step(structure, batch, STABLE, sampling(0.02, 1e-3, looks), method) for looks in (False, True))
    assert not set(BALANCES) & set(plain.metrics)
    for name in BALANCES:
        assert np.isfinite(seen.metrics.pop(name)).all()
    assert same_bits(plain, seen)
