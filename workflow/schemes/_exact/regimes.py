"""The two regimes between contact events in real modal blocks that evolve alone: tip free, and tip held at the gap.

    blocks        η' = u + β(t),   u' = -c u - ω² η + γ(t)   (+ g · ξ in one-way regimes)
    first order   ξ' = -μ ξ + χ(t)

so that a motion of any length costs one exponential per block. Without friction heat (tip free, or α = 0) regimes are
one-way: blocks are mechanical modes and first-order states thermal modes, to which the blocks respond
quasi-statically. With the tip held and α > 0 heat and motion act on each other: the matrix is that of α = 0 plus α
times a rank-one term, blocks are its complex pairs of eigenvalues and pairs of real ones that nearly coincide,
first-order states the other real ones. So it is with friction along a tangent, which is another such term with the same
row.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.poles import real_blocks
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._exact.pole_pairs import InseparablePolesError, pole_pairs
from workflow.schemes._exact.spectrum import is_trusted, secular_spectrum


class Regime(NamedTuple):
    """A linear system in real modal blocks, its outputs, and how its coordinates follow from those of the free tip.

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
    ``(3, first, block)``: g, a, b; zero where heat and motion act on each other."""
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


_PARTED = 1e-11
"""Share by which damping is changed where two poles coincide: they part by its root, 3e-6 of themselves, which leaves
their eigenvectors eleven digits."""


def regime_of(system: ModalSystem, alpha: float = 0.0) -> Regime:
    """Return the regime of a structure with its tip free, or held at α [W/N].

    At α > 0 or with friction along t ``system`` is one of :func:`linked` modes. Where poles coincide, its damping is
    changed by as little as parts them.

    Raises
    ------
    InseparablePolesError
        Damping couples the modes, and three poles coincide, one is a thermal rate, or a real one is positive.
    """
    try:
        regime = _solved(system, alpha)
    except InseparablePolesError:
        regime = _solved(replace(system, damping=(1 + _PARTED) * system.damping), alpha)
    return Regime(*(np.ascontiguousarray(values, dtype=np.float64) for values in regime))


def _solved(system: ModalSystem, alpha: float) -> Regime:
    """Return the regime by its eigenvalues: with friction heat or friction along t, with coupled modes, or neither."""
    if alpha > 0 or system.friction_force is not None:
        return _two_way(system, alpha)
    return _coupled(system) if system.is_coupled else _one_way(system)


def _regime(
    system: ModalSystem, poles: tuple[Array, Array, Array], signal: Array, source: Array, inward: Array, outward: Array
) -> Regime:
    """Return a regime in which blocks respond to no first-order state.

    ``poles`` are c and ω² of blocks and μ of first-order states, ``signal`` and ``source`` those of the coordinates.
    Columns of ``inward`` and rows of ``outward`` are X.
    """
    blocks, firsts = poles[0].size, poles[2].size
    return Regime(
        *poles,
        coupling=np.zeros((3, firsts, blocks)),
        resonant=np.zeros(blocks),
        signal=signal,
        temperature=system.heat_tip @ outward[2 * system.frequency.size :],
        source=np.concatenate([source, signal_inputs(system)[None]]).T,
        inward=inward.T,
        outward=outward.T,
        entry=system.entry,
        exit=system.exit,
    )


def _one_way(system: ModalSystem) -> Regime:
    """Return the regime without friction heat: its blocks are the modes of the system."""
    _, signal, source = state_space(system, 0.0)
    a, b, resonant = quasi_static(system.frequency, system.damping, system.rate, -system.coupling)
    poles, same = (system.damping, system.frequency**2, system.rate), np.eye(signal.size)
    regime = _regime(system, poles, signal, source, same, same)
    return regime._replace(coupling=np.stack([-system.coupling.T, a.T, b.T]), resonant=resonant)


_LINKED = 1e-13
"""A mode is kept where its reaction at the tip exceeds this share of the largest: the rounding of
shapes is some 1e-15, and the modes below it change λ by no more than this share."""


def linked(held: ModalSystem) -> ModalSystem:
    """Leave out the modes that do not press on the held tip.

    Their shapes are free modes as well, with the tip at rest: no output depends on them. Among them are the rigid
    motions of parts that are not linked to the tip, whose double eigenvalue 0 has but one eigenvector.
    """
    keep = np.abs(held.reaction) > _LINKED * np.abs(held.reaction).max(initial=0.0)
    return _some(held, keep | ~_alone(held) if held.is_coupled else keep)


def _some(held: ModalSystem, keep: NDArray[np.bool_]) -> ModalSystem:
    """Return the system of some of its modes."""
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


def _alone(held: ModalSystem) -> NDArray[np.bool_]:
    """Return which modes damping couples to no other, ``(mode,)``."""
    beside = np.abs(held.damping - np.diag(np.diag(held.damping)))
    return np.asarray(np.all(beside <= _LINKED * np.abs(held.damping).max(initial=0.0), axis=1))


def _coupled(system: ModalSystem) -> Regime:
    """Return the regime without friction heat of a structure whose modes damping couples: pairs of poles as blocks.

    Rigid modes, whose pole 0 is a double one, stay blocks, and first-order states are thermal modes.

    Raises
    ------
    InseparablePolesError
        Poles coincide, one is a thermal rate, or a real one is positive.
    """
    A, row, source = state_space(system, 0.0)
    modes, size = system.frequency.size, row.size
    rigid = (system.frequency == 0) & _alone(system)
    moving, still = np.flatnonzero(~rigid), int(rigid.sum())
    own = np.concatenate([moving, modes + moving, np.arange(2 * modes, size)])
    at = np.concatenate([np.arange(still, modes), np.arange(modes + still, size)])
    pairs = pole_pairs(_some(system, ~rigid), A[np.ix_(own, own)])
    inward, outward = np.zeros((size, size)), np.zeros((size, size))
    for k, mode in enumerate(np.flatnonzero(rigid)):
        inward[k, mode] = inward[modes + k, modes + mode] = outward[mode, k] = outward[modes + mode, modes + k] = 1.0
    inward[np.ix_(at, own)], outward[np.ix_(own, at)] = pairs.inward, pairs.outward
    damping = np.concatenate([np.diag(system.damping)[rigid], pairs.damping])
    poles = damping, np.concatenate([np.zeros(still), pairs.stiffness]), system.rate
    return _regime(system, poles, row @ outward, inward @ source, inward, outward)


def _two_way(held: ModalSystem, alpha: float) -> Regime:
    """Return the regime of a held tip at α > 0: complex pairs of eigenvalues as blocks, other real ones apart.

    A pair s = σ ± iν with right and left eigenvectors x and ξ = l X has the real coordinates η = Re ξ
    and u = Re(s ξ), so that η' = u, u' = 2σ u - |s|² η and X = 2 Re(x ξ).
    """
    A, row, source = state_space(held, alpha)
    spectrum = secular_spectrum(held, alpha, A)
    if spectrum is None:
        damping, stiffness, rate, inward, outward = real_blocks(A)
        if not is_trusted(outward, inward):
            raise InseparablePolesError
        return _regime(held, (damping, stiffness, rate), row @ outward, inward @ source, inward, outward)
    first = np.flatnonzero(spectrum.values.imag == 0)
    pairs = np.flatnonzero(spectrum.values.imag > 0)
    pairs = pairs[np.argsort(np.abs(spectrum.values[pairs]), kind="stable")]
    s, left = spectrum.values[pairs], spectrum.left[pairs]
    inward = np.concatenate([left.real, (s[:, None] * left).real, spectrum.left[first].real])

    def outputs(vectors: Any) -> Array:
        """Return values per η and u of pairs and per ξ from those per eigenvector."""
        pair, ratio = vectors[..., pairs], s.real / s.imag
        return np.concatenate(
            [2 * (pair.real - pair.imag * ratio), 2 * pair.imag / s.imag, vectors[..., first].real], axis=-1
        )

    poles = -2 * s.real, s.real**2 + s.imag**2, -spectrum.values[first].real
    return _regime(held, poles, outputs(spectrum.force), inward @ source, inward, outputs(spectrum.right))
