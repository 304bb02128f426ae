"""An a priori bound of the motion of a tip without contact."""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.models._cases import Cases
from workflow.models._modes import coupled_damping, mechanical_modes
from workflow.models._static import static_tip_growth
from workflow.models._structure import Structure


def free_reach(structure: Structure, cases: Cases, duration: float) -> Array:
    """Return a bound of the tip's displacement without contact, m, ``(case,)``.

    ``inf`` where a rigid mode moves it, or damping couples modes.

    It sums the responses to constant and harmonic loads, the transient of the initial state, and twice the quasi-static
    growth by heating and initial temperatures. In modes, x_n = Σ φ_n η, with p̄ the constant load and p the harmonic
    one, η = p̄/ω² + Im[H e^{i(Ωt + φ)}] + a transient, with H = p/(ω² - Ω² + iΩc). The transient begins with the
    difference (Δη, Δζ) of the initial state from the first two, and stays below sqrt(Δη² + (Δζ/ω)²), as a free mode
    gains no energy.
    """
    modes = mechanical_modes(structure)
    omega, tip, damping = modes.values, modes.tip, coupled_damping(structure, modes)
    moving = (omega == 0) & (np.abs(tip) > 1e-9 * np.abs(tip).max())
    if np.any(moving) or damping.ndim == 2:
        return np.full(cases.count, np.inf)
    elastic = omega > 0
    omega, tip, damping, shapes = omega[elastic], tip[elastic], damping[elastic], modes.shapes[:, elastic]
    amplitudes, frequencies, phases = _sinusoids(cases)
    constant = frequencies == 0
    mean = cases.mean + np.where(constant, amplitudes * np.sin(phases), 0.0).sum(axis=0)
    drive = tip if structure.load is None else structure.load @ shapes
    static = (cases.steady @ shapes + mean[:, None] * drive) / omega**2
    momenta = structure.mechanical.inertia_of(shapes)
    offset = cases.displacement @ momenta - static
    speed = cases.velocity @ momenta
    harmonic = np.zeros(cases.count)
    with np.errstate(divide="ignore", invalid="ignore"):
        for amplitude, frequency, phase in zip(np.where(constant, 0.0, amplitudes), frequencies, phases, strict=True):
            acts, turning = amplitude[:, None], 2 * np.pi * frequency[:, None]
            response = acts * drive / (omega**2 - turning**2 + 1j * turning * damping)
            response = np.where(acts == 0, 0.0, response)
            begins = response * np.exp(1j * phase[:, None])
            offset, speed = offset - begins.imag, speed - (1j * turning * begins).imag
            harmonic += np.abs(np.sum(tip * response, axis=1))
        swing = np.hypot(offset, speed / omega)
        transient = np.sum(np.abs(tip) * swing, axis=1)
    growth = 2 * _warmest(structure, cases, duration) @ np.abs(static_tip_growth(structure))
    return np.asarray(np.sum(tip * static, axis=1) + harmonic + transient + growth)


def _sinusoids(cases: Cases) -> tuple[Array, Array, Array]:
    """Return amplitude, frequency and phase of all sinusoids of the tip load, ``(sinusoid, case)`` each."""
    first, more = (cases.amplitude, cases.frequency, cases.phase), cases.load_harmonics
    rows = zip(first, (more.amplitude, more.frequency, more.phase), strict=True)
    amplitude, frequency, phase = (np.vstack([one, others.T]) for one, others in rows)
    return amplitude, frequency, phase


def _warmest(structure: Structure, cases: Cases, duration: float) -> Array:
    """Return a bound of the temperatures due to initial ones and heating, K, ``(case, thermal)``."""
    started = np.abs(cases.temperature).max(axis=1, initial=0.0)[:, None]
    capacities = structure.thermal.inertia_of(np.ones(structure.thermal_size))
    heated = duration * (np.abs(cases.heating) / capacities).max(axis=1, initial=0.0)[:, None]
    return np.broadcast_to(started + heated, cases.temperature.shape)
