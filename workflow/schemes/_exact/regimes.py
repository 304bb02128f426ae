"""The two regimes between contact events in real blocks that evolve alone: tip free, and tip held at the gap.

    blocks        η' = u + β(t),   u' = -c u - ω² η + γ(t)   (+ g · ξ in modes)
    first order   ξ' = -μ ξ + χ(t)

so that a motion of any length costs one exponential per block. Where neither damping nor friction couples the modes,
blocks are mechanical modes and first-order states thermal modes, to which the blocks respond quasi-statically. All else
is separated by :mod:`workflow.poles`: a damping matrix, the friction heat of a held tip (α times a term of rank one)
and friction along a tangent, which is another such term with the same row.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from workflow.models import Array
from workflow.poles import real_blocks
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._interface import RefusedStructureError

INSEPARABLE = (
    "leaves three poles that coincide, which event_driven cannot separate; change it by a trifle, or take a scheme "
    "with a fixed step"
)
"""Why such a structure is refused."""


class InseparablePolesError(RefusedStructureError):
    """Poles of a structure whose modes damping or friction couples are too near each other."""

    def __init__(self) -> None:
        super().__init__(f"its damping {INSEPARABLE}")


class Regime(NamedTuple):
    """A linear system in real blocks, its outputs, and how its coordinates follow from those of the free tip.

    Coordinates are [η (block), u (block), ξ (first order)], N in all; modal coordinates are those of the free modes,
    [y, y', τ]. Outputs are the signal, see :class:`~workflow.schemes._exact.modal_system.ModalSystem`, and the
    temperature of the tip, K. Inputs are w = [constant loads, heating, tip load, d, d', d''], d the place
    of the casing.
    """

    damping: Array
    """c of each block, 1/s, ``(block,)``."""
    stiffness: Array
    """ω² of each block, 1/s², ascending, ``(block,)``."""
    rate: Array
    """μ of each first-order state, 1/s, ``(first,)``."""
    coupling: Array
    """Force g on a block per first-order state, and a and b of the response η = a ξ + b ξ' to it,
    ``(3, first, block)``: g, a, b; zero where the system is separated."""
    resonant: Array
    """1 where a block has no such response because a first-order state is near one of its poles, ``(block,)``."""
    signal: Array
    """Signal per coordinate, ``(N,)``."""
    temperature: Array
    """Tip temperature per coordinate, ``(N,)``."""
    source: Array
    """Sources [β, γ, χ] and, in the column after theirs, the signal, ``(mechanical + thermal + 4, N + 1)``: rows are
    inputs."""
    inward: Array
    """Coordinates from X = [z, z', τ] of its own modes, ``(N, N)``: rows are X. Columns beyond N fill up packs, as in
    ``source``."""
    outward: Array
    """… and back, ``(N, N)``: rows are coordinates."""
    entry: Array
    exit: Array
    """z from free modes and back, see :class:`~workflow.schemes._exact.modal_system.ModalSystem`."""


_NEAR_RESONANCE = 1e-3
"""A block keeps its thermal force explicit where its denominator μ² - μ c + ω² is below this share
of the *sum* of its terms: the quasi-static response would lose more than three of sixteen digits. A
block as a whole becomes explicit, where the fixed-step schemes couple single pairs."""

_PARTED = 1e-11
"""Share by which damping is changed where two poles coincide: they part by its root, 3e-6 of themselves, which leaves
their eigenvectors eleven digits."""

_TRUSTED = 1e6
"""Σ |inward · outward| of a coordinate up to which it keeps ten digits: it grows without bound as poles meet that have
the same eigenvector."""

_LINKED = 1e-13
"""A mode is kept where its reaction at the tip exceeds this share of the largest: the rounding of
shapes is some 1e-15, and the modes below it change λ by no more than this share."""


def in_modes(system: ModalSystem, alpha: float) -> bool:
    """Whether modes and thermal modes are the coordinates of a regime."""
    return alpha == 0 and system.friction_force is None and not system.is_coupled


def regime_of(system: ModalSystem, alpha: float = 0.0) -> Regime:
    """Return the regime of a structure with its tip free, or held at α [W/N].

    At α > 0 or with friction along t ``system`` is one of :func:`linked` modes.

    Raises
    ------
    InseparablePolesError
        Three poles coincide.
    """
    regime = _in_modes(system) if in_modes(system, alpha) else _in_blocks(system, alpha)
    return Regime(*(np.ascontiguousarray(values, dtype=np.float64) for values in regime))


def _in_modes(system: ModalSystem) -> Regime:
    """Return the regime whose blocks are the modes of the system."""
    _, signal, source = state_space(system, 0.0)
    a, b, resonant = quasi_static(system.frequency, system.damping, system.rate, -system.coupling)
    poles, same = (system.damping, system.frequency**2, system.rate), np.eye(signal.size)
    regime = _regime(system, poles, signal, source, same, same)
    return regime._replace(coupling=np.stack([-system.coupling.T, a.T, b.T]), resonant=resonant)


def _in_blocks(system: ModalSystem, alpha: float) -> Regime:
    """Return the regime whose blocks are pairs of poles; where two pairs coincide, of a damping that parts them."""
    for share in (0.0, _PARTED):
        A, row, source = state_space(replace(system, damping=(1 + share) * system.damping), alpha)
        with suppress(ValueError):  # not finite, or no convergence
            *poles, inward, outward = real_blocks(A)
            if np.all(np.sum(np.abs(inward) * np.abs(outward.T), 1) <= _TRUSTED):
                return _regime(system, tuple(poles), row @ outward, inward @ source, inward, outward)
    raise InseparablePolesError


def _regime(
    system: ModalSystem, poles: tuple[Array, ...], signal: Array, source: Array, inward: Array, outward: Array
) -> Regime:
    """Return a regime in which blocks respond to no first-order state.

    ``poles`` are c and ω² of blocks and μ of first-order states, ``signal`` and ``source`` those of the coordinates.
    Columns of ``inward`` and rows of ``outward`` are X.
    """
    damping, stiffness, rate = poles
    return Regime(
        damping,
        stiffness,
        rate,
        coupling=np.zeros((3, rate.size, damping.size)),
        resonant=np.zeros(damping.size),
        signal=signal,
        temperature=system.heat_tip @ outward[2 * system.frequency.size :],
        source=np.concatenate([source, signal_inputs(system)[None]]).T,
        inward=inward.T,
        outward=outward.T,
        entry=system.entry,
        exit=system.exit,
    )


def quasi_static(frequency: Array, damping: Array, rate: Array, drive: Array) -> tuple[Array, Array, Array]:
    """Return a, b of the response η = a τ + b τ' of blocks to first-order states, and where it fails.

    p(-μ) = μ² - μ c + ω²;  a = drive/ω²,  b = -drive (c - μ)/(ω² p(-μ)).
    """
    omega2, c = frequency[:, None] ** 2, damping[:, None]
    polynomial = rate**2 - rate * c + omega2
    size = rate**2 + rate * c + omega2
    forced = drive != 0
    near = np.any(forced & (np.abs(polynomial) < _NEAR_RESONANCE * size), axis=1)
    use = forced & ~near[:, None]
    a, b = np.zeros_like(drive), np.zeros_like(drive)
    np.divide(drive, omega2, out=a, where=use)
    np.divide(-drive * (c - rate), omega2 * polynomial, out=b, where=use)
    return a, b, near.astype(np.float64)


def linked(held: ModalSystem) -> ModalSystem:
    """Leave out the modes that do not press on the held tip, nor are damped together with others.

    Their shapes are free modes as well, with the tip at rest: no output depends on them. Among them are the rigid
    motions of parts that are not linked to the tip, whose double eigenvalue 0 has but one eigenvector.
    """
    keep = np.abs(held.reaction) > _LINKED * np.abs(held.reaction).max(initial=0.0)
    if held.is_coupled:
        beside = np.abs(held.damping - np.diag(np.diag(held.damping)))
        keep |= np.any(beside > _LINKED * np.abs(held.damping).max(initial=0.0), axis=1)
    return replace(
        held,
        frequency=held.frequency[keep],
        damping=held.damping[np.ix_(keep, keep)] if held.is_coupled else held.damping[keep],
        coupling=held.coupling[keep],
        reaction=held.reaction[keep],
        reaction_slope=held.reaction_slope[keep],
        gap_source=held.gap_source[keep],
        shapes=held.shapes[:, keep],
        entry=held.entry[:, keep],
        exit=held.exit[np.append(keep, True)],
        friction_force=None if held.friction_force is None else held.friction_force[keep],
    )
