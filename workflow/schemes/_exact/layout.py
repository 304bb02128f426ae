"""Arguments of the compiled kernel: the loads of a case, its regimes as tables, and its working memory.

Regimes are packed into few arrays, because each array costs compile time in every function that it passes through.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import kernel, part
from workflow.models import Array
from workflow.schemes._exact.tables import block, expansion, first, state, wave

ORDER = 18
"""Largest order of Taylor polynomials of motions."""

TAYLOR_SPAN = 0.6
"""Largest |pole| · time at which they are used: the remainder is below 0.6^18/18! = 2e-20."""


class CaseLoads(NamedTuple):
    """Loads and casing of one case: F0 + Σ A sin ψ on the tip, positive towards the casing, at d = d0 + Σ a sin ψ."""

    mean: float
    """F0, N."""
    waves: Array
    """Ω, φ, A and a of each wave, ``(wave, GIVEN)``, see :mod:`workflow.schemes._exact.tables.wave`."""
    gap: float
    """d0, m."""
    duration: float
    """End of the case, s."""
    steady: Array
    """Constant load per mechanical coordinate, N."""
    heating: Array
    """Constant heat load per thermal coordinate, W."""


class Regime(NamedTuple):
    """A linear system in real blocks, shared by cases, and the transform of its coordinates from those of the free tip.

    Coordinates are [η (block), u (block), ξ (first order)], N in all; modal coordinates are those of the free modes,
    [y, y', τ]. Inputs are w = [constant loads, heating, tip load, d, d', d''], d the position of the casing.
    """

    blocks: int
    firsts: int
    block: Array
    """See :mod:`workflow.schemes._exact.tables.block`; rows that depend on loads are 0 here, as in ``first``."""
    first: Array
    """See :mod:`workflow.schemes._exact.tables.first`."""
    source: Array
    """Sources [β, γ, χ] and, in the column after theirs, the signal, ``(mechanical + thermal + 4, N + 1)``: rows are
    inputs."""
    inward: Array
    """Transform from X = [z, z', τ] of its own modes to coordinates, ``(N, N)``: rows are X. More columns pad packs, as
    in ``source``."""
    outward: Array
    """Its inverse, ``(N, N)``: rows are coordinates."""
    entry: Array
    exit: Array
    """Transforms from free modes to z and back, see :class:`~workflow.schemes._exact.modal_system.ModalSystem`."""
    growth: float
    """Largest rate at which a block or first-order state may grow, 1/s, not negative."""
    fastest: float
    """Bound of all poles, 1/s."""
    warms: bool
    """Whether the tip temperature depends on blocks."""
    heated: bool
    """Whether it has thermal modes."""
    is_modal: bool
    """Whether the coordinates are those of the modes, [z, z', τ]."""


@kernel
def tabulated(
    damping: Array,
    stiffness: Array,
    rate: Array,
    signal: Array,
    temperature: Array,
    source: Array,
    inward: Array,
    outward: Array,
    entry: Array,
    exit_: Array,
) -> Regime:
    """Return a regime from c and ascending ω² of blocks, μ of first-order states, and outputs per coordinate, ``(N,)``.

    Outputs are the signal, see :class:`~workflow.schemes._exact.modal_system.ModalSystem`, and the temperature of the
    tip, K.
    """
    blocks, firsts = damping.size, rate.size
    b, f = np.zeros((block.ROWS, 8 * ((blocks + 7) // 8))), np.zeros((first.ROWS, 8 * ((firsts + 7) // 8)))
    growth, fastest, warms = 0.0, 0.0, False
    filled = max(1.0, stiffness[blocks - 1]) if blocks > 0 else 1.0
    for k in range(b.shape[1]):
        b[block.STIFFNESS, k] = stiffness[k] if k < blocks else filled
        b[block.OMEGA, k], b[block.NU, k] = np.sqrt(b[block.STIFFNESS, k]), 1.0
        if b[block.OMEGA, k] > 0.0:
            b[block.INVERSE_OMEGA, k] = 1.0 / b[block.OMEGA, k]
    for k in range(blocks):
        c = damping[k]
        b[block.DAMPING, k], b[block.HALF_DAMPING, k] = c, 0.5 * c
        b[block.SIGNAL_VALUE, k], b[block.SIGNAL_SLOPE, k] = signal[k], signal[blocks + k]
        b[block.TEMPERATURE_VALUE, k], b[block.TEMPERATURE_SLOPE, k] = temperature[k], temperature[blocks + k]
        if stiffness[k] > 0.25 * c * c:
            b[block.NU, k] = np.sqrt(stiffness[k] - 0.25 * c * c)
        growth, fastest = max(growth, -c), max(fastest, b[block.OMEGA, k], abs(c))
        warms |= temperature[k] != 0.0 or temperature[blocks + k] != 0.0
    for j in range(firsts):
        mu, own = rate[j], 2 * blocks + j
        f[first.RATE, j], f[first.SIGNAL, j], f[first.TEMPERATURE, j] = mu, signal[own], temperature[own]
        growth, fastest = max(growth, -mu), max(fastest, abs(mu))
    return Regime(
        blocks,
        firsts,
        b,
        f,
        source,
        inward,
        outward,
        entry,
        exit_,
        growth,
        fastest,
        warms,
        inward.shape[0] > 2 * entry.shape[1],
        _is_identity(inward),
    )


@part
def _is_identity(matrix: Array) -> bool:
    """Whether a matrix is the identity."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            if matrix[i, j] != (1.0 if i == j else 0.0):
                return False
    return True


class Expansion(NamedTuple):
    """Memory of an expansion, rows as in :mod:`~workflow.schemes._exact.tables.expansion`.

    :func:`~workflow.schemes._exact.expansion.expand` fills the first and the last column of the sums,
    :func:`~workflow.schemes._exact.expansion.accumulate` those between.
    """

    sums: Array
    """``(9, block + 1)``."""
    terms: Array
    """``(9, column)``; scratch."""
    derivatives: Array
    """Derivatives of the signal, ``(ORDER + 1,)``; scratch."""
    explicit: Array
    """Derivatives of an explicit block, ``(ORDER + 2,)``; scratch."""


class Memory(NamedTuple):
    """Arrays for the motion of a case in a regime; cases may use them in turn."""

    block: Array
    first: Array
    """Tables of the regime, with the rows that depend on the loads of the case."""
    coordinates: Array
    """[η, u, ξ], ``(N,)``."""
    modal: Array
    """[z, z', τ] of the modes of the regime, ``(N,)``; the array of the coordinates where these are modal."""
    states: Array
    """Three states of motion, and the change of the state by a unit impulse, ``(4, 4, column)``."""
    outputs: Array
    """Signal and tip temperature by constant loads alone, ``(2,)``."""
    waves: Array
    """See :mod:`workflow.schemes._exact.tables.wave`."""
    differences: Complex
    """Divided differences of an explicit block, ``(9, 4)``; scratch."""
    expansion: Expansion


def memory(regime: Regime, waves: int) -> Memory:
    """Return memory for a regime under a number of waves."""
    columns, wide = block.padded(regime.blocks), block.padded(regime.firsts)
    coordinates = np.zeros(regime.inward.shape[0])
    return Memory(
        block=np.zeros((block.ROWS + block.WAVE * waves, columns)),
        first=np.zeros((first.ROWS + first.WAVE * waves, wide)),
        coordinates=coordinates,
        modal=coordinates if regime.is_modal else coordinates.copy(),
        states=np.zeros((4, state.ROWS, max(columns, wide))),
        outputs=np.zeros(2),
        waves=np.zeros((waves, wave.COLUMNS)),
        differences=np.zeros((9, 4), dtype=np.complex128),
        expansion=Expansion(
            np.zeros((expansion.ROWS, regime.blocks + 1)),
            np.zeros((expansion.ROWS, columns)),
            np.zeros(ORDER + 1),
            np.zeros(ORDER + 2),
        ),
    )
