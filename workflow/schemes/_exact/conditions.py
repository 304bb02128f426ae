"""Conditions of the cases of a batch for the march: their nonzero sinusoids are waves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import elementwise
from workflow.models import Array, Cases, project
from workflow.schemes._exact.layout import Budget, Case, Thresholds
from workflow.schemes._exact.modal_system import ModalBasis
from workflow.schemes._exact.tables import wave

_ROUNDING = 4.0 * 2.220446049250313e-16
"""Relative difference of velocities up to which a tip moves with its casing: four roundings."""


class Loads(NamedTuple):
    """Loads and casing of cases, as in :class:`~workflow.schemes._exact.layout.Case`."""

    mean: Array
    gap: Array
    waves: Array
    acting: NDArray[np.int64]


@np.errstate(over="ignore", invalid="ignore")  # of a case that is not finite
def loads_of(cases: Cases) -> Loads:
    """Return loads and casing: a sinusoid of frequency 0 is a constant, one of amplitude 0 left out."""
    given = np.stack([cases.amplitude, cases.frequency, cases.phase])[:, :, None]
    given = np.concatenate([given, cases.load_harmonics.rows, cases.casing_harmonics.rows], axis=2)
    amplitude, frequency, phase = given
    moves = np.arange(amplitude.shape[1]) > cases.load_harmonics.width  # the casing
    constants = np.where((amplitude != 0) & (frequency == 0), amplitude * elementwise.sine_cosine(phase)[0], 0.0)
    acts = (amplitude != 0) & (frequency != 0)
    forces, places = np.where(moves, 0.0, amplitude), np.where(moves, amplitude, 0.0)
    waves = np.stack([2 * np.pi * frequency, phase, forces, places], axis=2)
    first = np.argsort(~acts, axis=1, kind="stable")[:, : int(acts.sum(axis=1).max(initial=0))]
    waves = np.take_along_axis(np.where(acts[:, :, None], waves, 0.0), first[:, :, None], axis=1)
    mean, gap = (_added(own, constants[:, moves == is_casing]) for is_casing, own in enumerate((cases.mean, cases.gap)))
    return Loads(mean, gap, waves, acts.sum(axis=1))


def _added(constant: Array, terms: Array) -> Array:
    """Return a constant plus the terms ``(case, term)`` in their order, ``(case,)``: bits of a case are its own."""
    total = np.array(constant, dtype=np.float64)
    for k in range(terms.shape[1]):
        total += terms[:, k]
    return total


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # not finite; a tip without impact law
def conditions_of(cases: Cases, basis: ModalBasis, duration: float, budget: Budget, thresholds: Thresholds) -> Case:
    """Return the conditions of a batch, without its held regimes: an impulse moves modes by φᵀ(e_n - µ t)."""
    loads, alpha, friction = loads_of(cases), cases.alpha[:, None], cases.friction[:, None]
    struck, casing = basis.tip - friction * basis.tangent, loads.waves[:, :, wave.CASING]
    sin, cos = elementwise.sine_cosine(loads.waves[:, :, wave.PHASE])
    turning = loads.waves[:, :, wave.OMEGA] * (casing * cos)
    speed = cases.velocity[:, -1] - _added(np.zeros(cases.count), turning)
    bound = np.abs(loads.waves[:, :, wave.OMEGA] * casing)
    states = [project(basis.to_modes, cases.displacement), project(basis.to_modes, cases.velocity)]
    return Case(
        free=np.where(cases.heated, 1, 0),
        held=np.zeros(cases.count, dtype=np.int64),
        e=np.array(cases.e),
        alpha=np.array(cases.alpha),
        mean=loads.mean,
        gap=loads.gap,
        waves=loads.waves,
        acting=loads.acting,
        steady=np.array(cases.steady, order="C"),
        heating=np.array(cases.heating, order="C"),
        mobility=basis.mobility - cases.friction * basis.tangential,
        drag=project(basis.damped_tip, struck) / project(basis.tip, struck),
        jump=np.hstack([np.zeros_like(struck), -struck, alpha * basis.free.heat_tip]),
        distance=_added(loads.gap, casing * sin) - cases.displacement[:, -1],
        speed=np.where(np.abs(speed) <= _ROUNDING * _added(np.zeros(cases.count), bound), 0.0, speed),
        reach=_added(np.abs(loads.gap), np.abs(casing)),
        modal=np.hstack([*states, project(basis.to_thermal, cases.temperature)]),
        heat_jump=basis.heat_jump,
        duration=duration,
        budget=budget,
        thresholds=thresholds,
    )


def penetration(loads: Case, displacement: Array, times: Array) -> Array:
    """Return the largest penetration of the samples of each case ``(case, t)``, m, summed in the march's order."""
    place = loads.gap[:, None]
    for omega, phase, _, amplitude in loads.waves.transpose(1, 2, 0)[..., None]:
        if amplitude.any():
            place = place + amplitude * elementwise.sine_cosine(omega * times + phase)[0]
    with np.errstate(invalid="ignore"):
        return np.asarray(np.maximum(0.0, np.max(displacement - place, axis=1)))
