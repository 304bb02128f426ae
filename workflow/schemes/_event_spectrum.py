"""The regime of the held tip in real blocks, without friction heat and with it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from workflow.models import Array
from workflow.schemes._event_regimes import Held, Regime, contiguous, held_system, quasi_static
from workflow.schemes._event_secular import general_spectrum, secular_spectrum


def held_regime(held: Held, alpha: float = 0.0) -> Regime:
    """Return the regime of the held tip without friction heat, α = 0: one-way, in modes of its own."""
    modes, heats = held.frequency.size, held.rate.size
    size = 2 * modes + heats
    _, force, steady, heating, tip, gap = held_system(held, 0.0)
    a, b, near = quasi_static(held.frequency, held.damping, held.rate, -held.coupling)
    enter, enter_gap, leave, leave_gap = passages(held, np.eye(size), np.eye(size))
    regime = Regime(
        damping=held.damping,
        stiffness=held.frequency**2,
        rate=held.rate,
        coupling=np.stack([-held.coupling, a, b]),
        near=near,
        signal_value=force[:modes],
        signal_slope=force[modes : 2 * modes],
        signal_first=force[2 * modes :],
        signal_steady=held.force_steady,
        signal_tip=1.0,
        signal_gap=-held.stiffness_gap,
        heat_value=np.zeros(modes),
        heat_slope=np.zeros(modes),
        heat_first=held.heat_tip,
        source_steady=steady,
        source_heating=heating,
        source_tip=tip,
        source_gap=gap,
        enter=enter,
        enter_gap=enter_gap,
        leave=leave,
        leave_gap=leave_gap,
    )
    return contiguous(regime)


def passages(held: Held, inward: Array, outward: Array) -> tuple[Array, Array, Array, Array]:
    """Return enter, enter_gap, leave, leave_gap of coordinates q = inward X, X = outward q."""
    modes, free = held.to_held.shape
    heats = held.rate.size
    to_held = np.zeros((2 * modes + heats, 2 * free + heats))
    to_held[:modes, :free] = held.to_held
    to_held[modes : 2 * modes, free : 2 * free] = held.to_held
    to_held[2 * modes :, 2 * free :] = np.eye(heats)
    to_free = np.zeros((2 * free + heats, 2 * modes + heats))
    to_free[:free, :modes] = held.to_free
    to_free[free : 2 * free, modes : 2 * modes] = held.to_free
    to_free[2 * free :, 2 * modes :] = np.eye(heats)
    enter_gap = inward[:, :modes] @ held.to_held_gap
    leave_gap = np.concatenate([held.to_free_gap, np.zeros(free + heats)])
    return (inward @ to_held).T, enter_gap, (to_free @ outward).T, leave_gap


_LINKED = 1e-13
"""A mode takes part where its reaction at the tip exceeds this share of the largest: the rounding of
shapes is some 1e-15, and what is left out below changes λ by no more than this share."""


def linked(held: Held) -> Held:
    """Leave out the modes that do not press on the held tip.

    Their shapes are free modes as well, with the tip at rest: nothing that is watched ever sees
    them. Among them are the rigid motions of parts that are not linked to the tip, whose double
    eigenvalue 0 has but one eigenvector.
    """
    keep = np.abs(held.reaction) > _LINKED * np.abs(held.reaction).max(initial=0.0)
    return replace(
        held,
        frequency=held.frequency[keep],
        damping=held.damping[keep],
        coupling=held.coupling[keep],
        reaction=held.reaction[keep],
        shapes=held.shapes[:, keep],
        to_held=held.to_held[keep],
        to_held_gap=held.to_held_gap[keep],
        to_free=held.to_free[:, keep],
    )


def coupled_regime(held: Held, alpha: float) -> Regime:
    """Return the regime of the held tip at α > 0: complex pairs of eigenvalues as blocks, real ones apart.

    A pair s = σ ± iν with right and left eigenvectors x and ξ = l X has the real coordinates η = Re ξ
    and u = Re(s ξ), so that η' = u, u' = 2σ u - |s|² η and X = 2 Re(x ξ).
    """
    held = linked(held)
    A, force, steady, heating, tip, gap = held_system(held, alpha)
    found = secular_spectrum(held, alpha, A) or general_spectrum(A, force)
    first = np.flatnonzero(found.values.imag == 0)
    pairs = np.flatnonzero(found.values.imag > 0)
    pairs = pairs[np.argsort(np.abs(found.values[pairs]), kind="stable")]
    s, row = found.values[pairs], found.left[pairs]
    inward = np.concatenate([row.real, (s[:, None] * row).real, found.left[first].real])

    def outputs(vectors: Any) -> Array:
        """Return per η and u of pairs and per ξ what there is per eigenvector."""
        pair, ratio = vectors[..., pairs], s.real / s.imag
        return np.concatenate(
            [2 * (pair.real - pair.imag * ratio), 2 * pair.imag / s.imag, vectors[..., first].real], axis=-1
        )

    outward, signal = outputs(found.right), outputs(found.force)
    heat = held.heat_tip @ outward[2 * held.frequency.size :]
    blocks = pairs.size
    enter, enter_gap, leave, leave_gap = passages(held, inward, outward)
    return contiguous(
        Regime(
            damping=-2 * s.real,
            stiffness=np.abs(s) ** 2,
            rate=-found.values[first].real,
            coupling=np.zeros((3, blocks, first.size)),
            near=np.zeros(blocks),
            signal_value=signal[:blocks],
            signal_slope=signal[blocks : 2 * blocks],
            signal_first=signal[2 * blocks :],
            signal_steady=held.force_steady,
            signal_tip=1.0,
            signal_gap=-held.stiffness_gap,
            heat_value=heat[:blocks],
            heat_slope=heat[blocks : 2 * blocks],
            heat_first=heat[2 * blocks :],
            source_steady=inward @ steady,
            source_heating=inward @ heating,
            source_tip=inward @ tip,
            source_gap=inward @ gap,
            enter=enter,
            enter_gap=enter_gap,
            leave=leave,
            leave_gap=leave_gap,
        )
    )
