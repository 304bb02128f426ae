"""Arguments of the compiled event loop: the conditions of cases, and regimes as rows of numbers.

A kernel takes the cases of a batch as rows. A regime is one row too, which holds its tables one after the other: those
of one batch differ in size.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from workflow.kernels import Array
from workflow.kernels.compiled import part
from workflow.kernels.packs import view
from workflow.schemes._exact.tables import block, first, padded, seen


class Budget(NamedTuple):
    """Largest number of events and of certified steps of a case."""

    events: int
    steps: int


class Thresholds(NamedTuple):
    """Internal tolerances, varied by tests only."""

    height: float
    """Height of flights v²/(2|a|), over the displacement scale, below which chattering is summed: its error is of this
    size."""
    speed: float
    """Impact speed, over the largest one, below which chattering is summed: at 5e-3 the error of the heavy
    chain was 4e-10, and it falls about quadratically."""
    force: float
    """Contact force, over the rounding of its terms, below which it is zero when a contact begins."""


class Case(NamedTuple):
    """Conditions of one case, or those of a batch, where every array has one more axis before, ``(case, …)``.

    The load on the tip is F0 + Σ A sin ψ, positive towards the casing, which lies at d = d0 + Σ a sin ψ.
    """

    free: Any
    """Row of the regime of the free tip: 0 without thermal modes, where no heat acts, else 1."""
    held: Any
    """Row of the regime of the held tip."""
    e: Any
    alpha: Any
    """α, W/N."""
    mean: Any
    """F0, N."""
    gap: Any
    """d0, m."""
    waves: Array
    """Ω, φ, A and a of each wave, ``(wave, GIVEN)``, with the columns of ``tables.wave``."""
    acting: Any
    """Number of waves: the rows after them are 0."""
    steady: Array
    """Constant load per mechanical coordinate, N."""
    heating: Array
    """Constant heat load per thermal coordinate, W."""
    mobility: Any
    """e_nᵀ M⁻¹ (e_n - µ t), 1/kg: the Delassus operator of an impact."""
    drag: Any
    """γ of :mod:`workflow.schemes._exact.events`, 1/s."""
    jump: Array
    """Change of [y, y', τ] of a free tip by an impulse of 1 N s along e_n - µ t with its friction heat, ``(N,)``."""
    distance: Any
    """d(0) - x_n(0), m."""
    speed: Any
    """v_n(0) - d'(0), m/s."""
    reach: Any
    """|d0| plus the amplitudes of the casing, m."""
    modal: Array
    """[y, y', τ] at the beginning; the march leaves there the state at the end, ``(N,)``."""
    heat_jump: float
    """Rise of the tip temperature per heat at the tip, e_nᵀ C2⁻¹ e_n, K/J."""
    duration: float
    """End of the case, s."""
    budget: Budget
    thresholds: Thresholds


class Regime(NamedTuple):
    """A linear system in real blocks, shared by cases, and the transform of its coordinates from those of the free tip.

    Coordinates are [η (block), u (block), ξ (first order)], N in all; modal coordinates are those of the free modes,
    [y, y', τ]. Inputs are w = [constant loads, heating, tip load, d, d', d''], d the position of the casing.
    """

    blocks: int
    firsts: int
    block: Array
    """With the rows of ``tables.block`` and ``tables.seen``; those that depend on loads are 0 here, as in ``first``."""
    first: Array
    """With the rows of ``tables.first`` and those of its outputs."""
    source: Array
    """Sources [β, γ, χ] and, in the column after theirs, the signal, ``(mechanical + thermal + 4, N + 1)``: rows are
    inputs."""
    inward: Array
    """Transform from X = [z, z', τ] of its own modes to coordinates, ``(N, N)``: rows are X. More columns pad it and
    ``source``."""
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


HEAD = 9
"""Numbers of a regime's row before its tables.

The first five are the numbers of blocks, of first-order states, of inputs, of free modes and of its own modes. The
others are those below.
"""

GROWTH, FASTEST, WARMS, IS_MODAL = 5, 6, 7, 8

BLOCK_ROWS, FIRST_ROWS = block.ROWS + seen.ROWS, first.ROWS + first.SEEN
"""Rows of the tables of a regime: those of its only contact are the last."""


def row_length(size: int, modes: int, inputs: int) -> int:
    """Return the length of rows of regimes with up to ``size`` coordinates, of ``modes`` free modes."""
    tables = BLOCK_ROWS * padded(size // 2) + FIRST_ROWS * padded(size) + size * size
    return HEAD + tables + (inputs + size) * padded(size + 1) + 2 * modes * (modes + 1)


def unpacked(row: Array) -> Regime:
    """Return the regime that is stored in a row; its tables are views."""
    blocks, firsts, inputs, free_modes, modes = int(row[0]), int(row[1]), int(row[2]), int(row[3]), int(row[4])
    size = 2 * blocks + firsts
    columns, slow, wide = 8 * ((blocks + 7) // 8), 8 * ((firsts + 7) // 8), 8 * (size // 8 + 1)
    a = HEAD + BLOCK_ROWS * columns
    b = a + FIRST_ROWS * slow
    c = b + inputs * wide
    d = c + size * wide
    e = d + size * size
    f = e + (free_modes + 1) * modes
    return Regime(
        blocks,
        firsts,
        view(row, HEAD, (BLOCK_ROWS, columns)),
        view(row, a, (FIRST_ROWS, slow)),
        view(row, b, (inputs, wide)),
        view(row, c, (size, wide)),
        view(row, d, (size, size)),
        view(row, e, (free_modes + 1, modes)),
        view(row, f, (modes + 1, free_modes)),
        row[GROWTH],
        row[FASTEST],
        row[WARMS] != 0.0,
        size > 2 * modes,
        row[IS_MODAL] != 0.0,
    )


in_row = part(unpacked)
""":func:`unpacked` in kernels."""
