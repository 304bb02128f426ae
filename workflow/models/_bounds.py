"""Bounds of a motion, before anything is stepped: how far its tip reaches, how hot it becomes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workflow.kernels import Array
from workflow.models._cases import Cases
from workflow.models._modes import mechanical_modes, thermal_modes
from workflow.models._runaway import static_tip_growth
from workflow.models._sliding import static_share
from workflow.models._structure import Structure

_STEPS = 400
"""Steps of the quasi-static heat balance over the duration."""


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """Tip of a structure without contact, every array ``(case,)`` and in m; ``inf`` where a rigid mode moves the tip.

    Attributes
    ----------
    static
        Displacement by the constant loads.
    harmonic
        Amplitude of the steady-state response to the harmonic load, of several sinusoids the sum of their amplitudes.
    transient
        Bound of what the start adds: no mode gains energy by itself, so each stays below the amplitude it begins with.
    growth
        Bound of the growth by heating and initial temperatures, twice the quasi-static one.
    """

    static: Array
    harmonic: Array
    transient: Array
    growth: Array

    @property
    def reach(self) -> Array:
        """Largest displacement of the tip towards the casing, an upper bound."""
        return self.static + self.harmonic + self.transient + self.growth


def free_motion(structure: Structure, cases: Cases, duration: float) -> FreeMotion:
    """Return how far the tip moves without contact, from its modes x_n = Σ φ_n η.

    With p̄ the constant modal load and p the harmonic one, η = p̄/ω² + Im[H e^{i(Ωt + φ)}] + a transient, with
    H = p/(ω² - Ω² + iΩc). The transient begins with the difference (Δη, Δζ) of the initial state to the first two, and
    stays below sqrt(Δη² + (Δζ/ω)²). Damping that couples modes hands energy from one to another: H solves for all of
    them, and the transient stays below sqrt(S Σ (ω²Δη² + Δζ²)), S = Σ φ_n²/ω².
    """
    modes = mechanical_modes(structure)
    omega, tip = modes.values, modes.tip
    moving = (omega == 0) & (np.abs(tip) > 1e-9 * np.abs(tip).max())
    if np.any(moving):
        infinite = np.full(cases.count, np.inf)
        return FreeMotion(np.zeros(cases.count), infinite, infinite, infinite)
    elastic = omega > 0
    omega, tip, shapes = omega[elastic], tip[elastic], modes.shapes[:, elastic]
    amplitudes, frequencies, phases = _sinusoids(cases)
    constant = frequencies == 0
    mean = cases.mean + np.where(constant, amplitudes * np.sin(phases), 0.0).sum(axis=0)
    drive = tip if structure.load is None else structure.load @ shapes
    static = (cases.steady @ shapes + mean[:, None] * drive) / omega**2
    damping = structure.damping.of_modes(omega)
    coupled = None if structure.damper is None else shapes.T @ structure.damper @ shapes
    momenta = structure.inertia_forces(shapes)
    offset = cases.displacement @ momenta - static
    speed = cases.velocity @ momenta
    harmonic = np.zeros(cases.count)
    with np.errstate(divide="ignore", invalid="ignore"):
        for amplitude, frequency, phase in zip(np.where(constant, 0.0, amplitudes), frequencies, phases, strict=True):
            acts, turning = amplitude[:, None], 2 * np.pi * frequency[:, None]
            response = acts * drive / (omega**2 - turning**2 + 1j * turning * damping)
            if coupled is not None:
                response = acts * _coupled_response(omega**2, damping, coupled, turning, drive)
            response = np.where(acts == 0, 0.0, response)
            begins = response * np.exp(1j * phase[:, None])
            offset, speed = offset - begins.imag, speed - (1j * turning * begins).imag
            harmonic += np.abs(np.sum(tip * response, axis=1))
        swing = np.hypot(offset, speed / omega)
        transient = np.sum(np.abs(tip) * swing, axis=1)
        if coupled is not None:
            transient = np.sqrt(np.sum((tip / omega) ** 2) * np.sum((omega * swing) ** 2, axis=1))
    growth = 2 * _warmest(structure, cases, duration) @ np.abs(static_tip_growth(structure))
    return FreeMotion(np.sum(tip * static, axis=1), harmonic, transient, np.asarray(growth))


def _coupled_response(stiffness: Array, damping: Array, coupled: Array, turning: Array, drive: Array) -> Any:
    """Return the modal response to a unit load at angular frequencies ``(case, 1)``, complex, ``(case, mode)``."""
    answers = {}
    for omega in np.unique(turning):
        matrix = np.diag(stiffness - omega**2 + 1j * omega * damping) + 1j * omega * coupled
        answers[float(omega)] = np.linalg.lstsq(matrix, drive.astype(complex), rcond=None)[0]
    return np.array([answers[float(omega)] for omega in turning[:, 0]])


def _sinusoids(cases: Cases) -> tuple[Array, Array, Array]:
    """Return amplitude, frequency and phase of all sinusoids of the tip load, ``(sinusoid, case)`` each."""
    first, more = (cases.amplitude, cases.frequency, cases.phase), cases.load_harmonics
    rows = zip(first, (more.amplitude, more.frequency, more.phase), strict=True)
    amplitude, frequency, phase = (np.vstack([one, others.T]) for one, others in rows)
    return amplitude, frequency, phase


def _warmest(structure: Structure, cases: Cases, duration: float) -> Array:
    """Return a bound of the temperatures by initial ones and heating, K, ``(case, thermal)``."""
    started = np.abs(cases.temperature).max(axis=1, initial=0.0)[:, None]
    capacities = structure.heat_capacity.sum(axis=1)
    heated = duration * (np.abs(cases.heating) / capacities).max(axis=1, initial=0.0)[:, None]
    return np.broadcast_to(started + heated, cases.temperature.shape)


def quasi_static_temperature(structure: Structure, cases: Cases, free: FreeMotion, duration: float) -> Array:
    """Return an estimate of the largest temperature within the duration, K, ``(case,)``; ``inf`` without bound.

    The tip is taken to rub as if it had no mass: the contact force is what holds the free motion
    x̄ + D sin(Ωt) + growth back at the gap, averaged over a load period, λ̄ = mean[max(0, x̄ + g - d + D sin)]/S. It
    heats the tip by α λ̄ and does not depend on e, as impulses balance the load whatever e is. How far the casing moves
    is added to D. Friction along t makes S e_nᵀ K1⁻¹ (e_n - µ t); where that is not positive nothing bounds the force.
    """
    thermal = thermal_modes(structure)
    modes = mechanical_modes(structure)
    elastic = modes.values > 0
    flexibility = float(np.sum((modes.tip[elastic] / modes.values[elastic]) ** 2))
    yields = flexibility * np.maximum(0.0, 1.0 - cases.friction * static_share(structure))
    grows = static_tip_growth(structure) @ thermal.shapes
    step = duration / _STEPS
    decay, swing = np.exp(-thermal.values * step), free.harmonic + cases.casing_harmonics.reach
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        gain = np.where(thermal.values > 0, -np.expm1(-thermal.values * step) / thermal.values, step)
        capacities = structure.heat_capacity.sum(axis=1)
        amplitudes = (cases.temperature * capacities) @ thermal.shapes
        heating = cases.heating @ thermal.shapes
        largest = np.abs(cases.temperature).max(axis=1, initial=0.0)
        for _ in range(_STEPS):
            beyond = free.static + amplitudes @ grows - cases.gap
            presses = _mean_positive(beyond, swing)
            force = np.where(presses > 0, presses / yields, 0.0) if np.isfinite(free.reach).all() else 0.0
            heat = heating + (cases.alpha * force)[:, None] * thermal.tip
            amplitudes = decay * amplitudes + gain * heat
            largest = np.fmax(largest, np.abs(amplitudes @ thermal.shapes.T).max(axis=1, initial=0.0))
        return np.where(np.isfinite(amplitudes).all(axis=1), largest, np.inf)


def _mean_positive(middle: Array, amplitude: Array) -> Array:
    """Return the mean of max(0, a + D sin) over a period."""
    inside = np.abs(middle) < amplitude
    share = np.clip(np.where(inside, middle / np.where(amplitude > 0, amplitude, 1.0), 0.0), -1.0, 1.0)
    partly = amplitude * (share * np.arccos(-share) + np.sqrt(1 - share**2)) / np.pi
    return np.asarray(np.where(inside, partly, np.maximum(middle, 0.0)))
