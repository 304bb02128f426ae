"""Arguments of the compiled kernel: the conditions of cases, regimes as tables, and the working memory of a case.

A kernel takes the cases of a batch as rows. A regime is one row of numbers there, which holds its tables one after the
other: those of one batch differ in size.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import part, uncounted
from workflow.schemes._exact.tables import block, expansion, first, state, wave

ORDER = 18
"""Largest order of Taylor polynomials of motions."""

TAYLOR_SPAN = 0.6
"""Largest |pole| · time at which they are used: the remainder is below 0.6^18/18! = 2e-20."""


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
    """Ω, φ, A and a of each wave, ``(wave, GIVEN)``, see :mod:`workflow.schemes._exact.tables.wave`."""
    acting: Any
    """Number of waves: the rows after them are 0."""
    steady: Array
    """Constant load per mechanical coordinate, N."""
    heating: Array
    """Constant heat load per thermal coordinate, W."""
    mobility: Any
    """e_nᵀ M⁻¹ (e_n - µ t), 1/kg: the Delassus operator of an impact."""
    drag: Any
    """γ of :mod:`workflow.schemes._exact.accumulation`, 1/s."""
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


_HEAD = 12
"""Numbers of a regime's row before its tables: its sizes, then what it has besides tables."""

_GROWTH, _FASTEST, _WARMS, _IS_MODAL = 8, 9, 10, 11


def row_length(size: int, modes: int, inputs: int) -> int:
    """Return the length of rows of regimes with up to ``size`` coordinates, of ``modes`` free modes."""
    tables = block.ROWS * block.padded(size // 2) + first.ROWS * block.padded(size) + size * size
    return _HEAD + tables + (inputs + size) * block.padded(size + 1) + 2 * modes * (modes + 1)


def unpacked(row: Array) -> Regime:
    """Return the regime that is stored in a row; its tables are views."""
    blocks, firsts, size, wide = int(row[0]), int(row[1]), int(row[2]), int(row[3])
    inputs, broad, free_modes, modes = int(row[4]), int(row[5]), int(row[6]), int(row[7])
    columns, slow = 8 * ((blocks + 7) // 8), 8 * ((firsts + 7) // 8)
    a = _HEAD + block.ROWS * columns
    b = a + first.ROWS * slow
    c = b + inputs * broad
    d = c + size * wide
    e = d + size * size
    f = e + (free_modes + 1) * modes
    return Regime(
        blocks,
        firsts,
        row[_HEAD:a].reshape((block.ROWS, columns)),
        row[a:b].reshape((first.ROWS, slow)),
        row[b:c].reshape((inputs, broad)),
        row[c:d].reshape((size, wide)),
        row[d:e].reshape((size, size)),
        row[e:f].reshape((free_modes + 1, modes)),
        row[f : f + (modes + 1) * free_modes].reshape((modes + 1, free_modes)),
        row[_GROWTH],
        row[_FASTEST],
        row[_WARMS] != 0.0,
        size > 2 * modes,
        row[_IS_MODAL] != 0.0,
    )


in_row = part(unpacked)
""":func:`unpacked` in kernels."""


@uncounted
def tabulate(
    row: Array,
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
) -> None:
    """Store a regime in a row, from c and ascending ω² of blocks, μ of first-order states, and outputs per coordinate.

    Outputs ``(N,)`` are the signal, see :class:`~workflow.schemes._exact.modal_system.ModalSystem`, and the temperature
    of the tip, K.
    """
    blocks, firsts = damping.size, rate.size
    row[0], row[1], row[2], row[3] = blocks, firsts, inward.shape[0], inward.shape[1]
    row[4], row[5], row[6], row[7] = source.shape[0], source.shape[1], exit_.shape[1], entry.shape[1]
    regime = in_row(row)
    b, f = regime.block, regime.first
    for i in range(_HEAD, _HEAD + b.size + f.size):
        row[i] = 0.0
    _copy(source, regime.source)
    _copy(inward, regime.inward)
    _copy(outward, regime.outward)
    _copy(entry, regime.entry)
    _copy(exit_, regime.exit)
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
    row[_GROWTH], row[_FASTEST], row[_WARMS], row[_IS_MODAL] = growth, fastest, warms, _is_identity(inward)


@part
def _copy(source: Array, target: Array) -> None:
    """Copy a table."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


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
    """Arrays for the motion of a case in a regime."""

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


class Scratch(NamedTuple):
    """Working memory of a march, which cases use in turn."""

    numbers: Array
    """Of the motions with the tip free and held, ``(2, number)``."""
    differences: Complex


def scratch(size: int, waves: int) -> Scratch:
    """Return memory for regimes of up to ``size`` coordinates under up to so many waves."""
    columns, wide = block.padded(size // 2), block.padded(size)
    tables = (block.ROWS + block.WAVE * waves) * columns + (first.ROWS + first.WAVE * waves) * wide
    states = 2 * size + 4 * state.ROWS * wide + wave.COLUMNS * waves
    expanded = expansion.ROWS * (2 * columns + 1) + 2 * ORDER + 3
    return Scratch(np.zeros((2, tables + states + expanded + 2)), np.zeros((9, 4), dtype=np.complex128))


@part
def table(numbers: Array, at: int, rows: int, columns: int) -> tuple[Array, int]:
    """Return a table that begins at a place of a row of numbers, and the place behind it."""
    return numbers[at : at + rows * columns].reshape((rows, columns)), at + rows * columns


@part
def memory_of(regime: Regime, waves: int, numbers: Array, differences: Complex) -> Any:
    """Return memory of zeros for a regime under so many waves."""
    size, columns, wide = regime.outward.shape[0], regime.block.shape[1], regime.first.shape[1]
    for i in range(numbers.size):
        numbers[i] = 0.0
    blocks, at = table(numbers, 0, block.ROWS + block.WAVE * waves, columns)
    firsts, at = table(numbers, at, first.ROWS + first.WAVE * waves, wide)
    own, at = table(numbers, at, waves, wave.COLUMNS)
    sums, at = table(numbers, at, expansion.ROWS, regime.blocks + 1)
    terms, at = table(numbers, at, expansion.ROWS, columns)
    states = numbers[at : at + 16 * max(columns, wide)].reshape((4, state.ROWS, max(columns, wide)))
    at += states.size
    derivatives, explicit = numbers[at : at + ORDER + 1], numbers[at + ORDER + 1 : at + 2 * ORDER + 3]
    at += 2 * ORDER + 3
    outputs, coordinates = numbers[at : at + 2], numbers[at + 2 : at + 2 + size]
    at += 2 if regime.is_modal else 2 + size
    modal = numbers[at : at + size]
    memory = Expansion(sums, terms, derivatives, explicit)
    return Memory(blocks, firsts, coordinates, modal, states, outputs, own, differences, memory)
