"""Loads, casing and initial state of one case of a batch for the march; its nonzero sinusoids are waves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workflow.kernels import elementwise
from workflow.models import Array, Cases
from workflow.schemes._exact.impacts import TipData
from workflow.schemes._exact.layout import CaseLoads, Regime
from workflow.schemes._exact.modal_system import ModalBasis
from workflow.schemes._exact.tables import wave

_LOAD, _CASING = 0, 1
"""Owner of a sinusoid."""

_ROUNDING = 4.0 * 2.220446049250313e-16
"""Relative difference of velocities up to which a tip moves with its casing: four roundings."""


def load_of(cases: Cases, i: int, duration: float) -> CaseLoads:
    """Return loads and casing of case ``i``: a sinusoid of frequency 0 is a constant, one of amplitude 0 left out."""
    constants, waves = [float(cases.mean[i]), float(cases.gap[i])], []
    for which, amplitude, frequency, phase in _sinusoids(cases, i):
        if frequency == 0:
            constants[which] += amplitude * float(elementwise.sine_cosine(phase)[0])
        else:
            acts = (amplitude, 0.0) if which == _LOAD else (0.0, amplitude)
            waves.append((2 * np.pi * frequency, phase, *acts))
    return CaseLoads(
        constants[_LOAD],
        np.array(waves).reshape(-1, wave.GIVEN),
        constants[_CASING],
        duration,
        np.ascontiguousarray(cases.steady[i]),
        np.ascontiguousarray(cases.heating[i]),
    )


def _sinusoids(cases: Cases, i: int) -> Iterator[tuple[int, float, float, float]]:
    """Return owner, amplitude, frequency and phase of each nonzero sinusoid."""
    if cases.amplitude[i] != 0:
        yield _LOAD, float(cases.amplitude[i]), float(cases.frequency[i]), float(cases.phase[i])
    for which, more in ((_LOAD, cases.load_harmonics), (_CASING, cases.casing_harmonics)):
        for k in range(more.width):
            if more.amplitude[i, k] != 0:
                yield which, float(more.amplitude[i, k]), float(more.frequency[i, k]), float(more.phase[i, k])


def tip_of(cases: Cases, i: int, basis: ModalBasis, free: Regime, load: CaseLoads) -> TipData:
    """Return impact law and initial state of the tip of case ``i``: an impulse moves the modes by φᵀ(e_n - µ t)."""
    alpha, friction, modes = float(cases.alpha[i]), float(cases.friction[i]), basis.tip.size
    struck, size = basis.tip - friction * basis.tangent, free.inward.shape[0]
    with np.errstate(divide="ignore", invalid="ignore"):  # a tip that no impulse moves has no impact law
        drag = float(np.divide(np.dot(basis.damped_tip, struck), np.dot(basis.tip, struck)))
    jump = np.concatenate([np.zeros(modes), -struck, alpha * basis.free.heat_tip[: size - 2 * modes]])
    place, velocity, reach, turning = load.gap, 0.0, abs(load.gap), 0.0
    for omega, phase, _, amplitude in load.waves.tolist():
        if amplitude != 0:
            sin, cos = elementwise.sine_cosine(phase)
            place += float(amplitude * sin)
            velocity += float(omega * (amplitude * cos))
            reach, turning = reach + abs(amplitude), turning + abs(omega * amplitude)
    speed = float(cases.velocity[i, -1]) - velocity
    return TipData(
        float(cases.e[i]),
        alpha,
        basis.mobility - friction * basis.tangential,
        basis.heat_jump,
        drag,
        jump if free.is_modal else jump @ free.inward[:, :size],
        place - float(cases.displacement[i, -1]),
        0.0 if abs(speed) <= _ROUNDING * turning else speed,
        reach,
    )


def penetration(cases: Cases, displacement: Array, times: Array) -> Array:
    """Return the largest penetration of the samples of each case ``(case, t)``, m, summed in the march's order."""
    place = np.repeat(cases.gap[:, None], times.size if cases.casing_harmonics.width else 1, axis=1)
    for i in np.flatnonzero(cases.casing_harmonics.acting):
        load = load_of(cases, int(i), float(times[-1]))
        place[i] = load.gap
        for omega, phase, _, amplitude in load.waves:
            if amplitude != 0:
                place[i] += amplitude * elementwise.sine_cosine(omega * times + phase)[0]
    with np.errstate(invalid="ignore"):
        return np.asarray(np.maximum(0.0, np.max(displacement - place, axis=1)))
