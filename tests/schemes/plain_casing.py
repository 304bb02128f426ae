"""Load and casing with their harmonics as ARCHITECTURE writes them: for the schemes with plain matrices."""

import numpy as np

from workflow.models import Cases, Structure


def load(batch: Cases, t: float) -> float:
    """f(t) of the first case."""
    waves = batch.load_harmonics
    turned = np.sin(2 * np.pi * waves.frequency[0] * t + waves.phase[0])
    return float(batch.mean[0] + np.sum(waves.amplitude[0] * turned))


def place(batch: Cases, t: float) -> float:
    """d(t) of the first case."""
    moves = batch.casing_harmonics
    turned = np.sin(2 * np.pi * moves.frequency[0] * t + moves.phase[0])
    return float(batch.gap[0] + np.sum(moves.amplitude[0] * turned))


def velocity(batch: Cases, t: float, h: float, theta: float) -> float:
    """V(t) = Σ Im[g a e^{i(ωt + φ)}], g = (e^{iωh} - 1) / (h (1 - θ + θ e^{iωh})), of the first case."""
    moves = batch.casing_harmonics
    omega = 2 * np.pi * moves.frequency[0]
    turn = np.exp(1j * omega * h)
    g = (turn - 1) / (h * (1 - theta + theta * turn))
    return float(np.sum(np.imag(g * moves.amplitude[0] * np.exp(1j * (omega * t + moves.phase[0])))))


def direction(structure: Structure, batch: Cases) -> np.ndarray:
    """The direction e_n - µ t against which a contact force pushes the first case."""
    normal = np.eye(structure.mechanical_size)[-1]
    return normal if structure.tangent is None else normal - batch.friction[0] * structure.tangent
