"""Tables of the event-driven solver: names of the rows and columns of the arrays that its kernels share.

They are numbers of constant tuples, not named tuples of views, which would take longer to compile.
"""

from __future__ import annotations

from typing import NamedTuple


def padded(size: int) -> int:
    """Return the number of columns for ``size`` entries: the next multiple of 8, a pack of lanes."""
    return 8 * ((size + 7) // 8)


class _Block(NamedTuple):
    """Rows of the table of second-order blocks, ``(row, column)``; column k holds the block η'' + c η' + ω² η = F.

    The force on a block is F(t) = F0 + Σ (Fc cos ψ + Fs sin ψ): a constant, and the waves of phase ψ = Ω t + φ. An
    *explicit* block keeps F. From every other block the particular solution is subtracted, so that its motion is free.
    Columns are padded to a multiple of 8 by blocks at rest without outputs. The rows of wave i lie ``i * WAVE`` below
    those named here; below all of them lie those of :class:`_Seen` for each contact.
    """

    # the block
    DAMPING: int = 0  # c, 1/s
    STIFFNESS: int = 1  # ω², 1/s²
    OMEGA: int = 2  # ω, 1/s
    INVERSE_OMEGA: int = 3  # 1/ω, s; 0 where ω = 0
    HALF_DAMPING: int = 4  # c/2, 1/s
    NU: int = 5  # ν = √(ω² - c²/4), 1/s; 1 where the block does not oscillate
    EXPLICIT_COLUMNS: int = 6  # of the explicit blocks, `Motion.explicits` of them
    APERIODIC_COLUMNS: int = 7  # of others that do not oscillate, `Motion.aperiodics` of them

    # loads
    FORCE: int = 8  # F0
    PARTICULAR: int = 9  # constant part of the particular solution, subtracted from η …
    PARTICULAR_SLOPE: int = 10  # … and from u

    # scratch of one propagation over dt
    C: int = 11  # of η(dt) = C η + S η'
    S: int = 12
    WORK: int = 13
    POWER: int = 14

    ROWS: int = 15

    # each wave
    FORCE_COS: int = 15  # Fc
    FORCE_SIN: int = 16  # Fs
    PARTICULAR_COS: int = 17  # its part of the particular solution, subtracted from η …
    PARTICULAR_SIN: int = 18
    PARTICULAR_SLOPE_COS: int = 19  # … and from u
    PARTICULAR_SLOPE_SIN: int = 20

    WAVE: int = 6


block = _Block()


class _Seen(NamedTuple):
    """Rows of the table of blocks for one contact, from ``Motion.rows`` on: its outputs per η and η'.

    The row of output o (0: the signal, 1: the temperature) lies 2 o below that of the signal.
    """

    SIGNAL_VALUE: int = 0
    SIGNAL_SLOPE: int = 1
    TEMPERATURE_VALUE: int = 2
    TEMPERATURE_SLOPE: int = 3
    SIGNAL_INTEGRAL: int = 4  # SIGNAL_VALUE/ω² of blocks that are not explicit, else 0: ∫η dt = -Δ(η' + c η)/ω²

    ROWS: int = 5


seen = _Seen()


class _First(NamedTuple):
    """Rows of the table of first-order states, ``(row, column)``: ξ' = -μ ξ + χ0 + Σ (χc cos ψ + χs sin ψ).

    The response of ξ to the waves is subtracted, so that ξ' decays as exp(-μ t). Columns are padded to a multiple of 8
    with zeros. The rows of wave i lie ``i * WAVE`` below those named here; below all of them lie, for each contact,
    those of its outputs per ξ, signal and temperature.
    """

    RATE: int = 0  # μ, 1/s
    SOURCE: int = 1  # χ0

    # scratch of one propagation over dt, x = -μ dt
    DECAY: int = 2  # e^x
    PHI1: int = 3  # φ1 = (e^x - 1)/x
    PHI2: int = 4  # φ2 = (φ1 - 1)/x

    ROWS: int = 5

    # each wave
    HARMONIC_COS: int = 5  # response to χc cos ψ + χs sin ψ that is subtracted from ξ
    HARMONIC_SIN: int = 6

    WAVE: int = 2

    SEEN: int = 2  # rows of each contact


first = _First()


class _Wave(NamedTuple):
    """Columns of the table of waves, ``(wave, column)``: sinusoids of the load and of the casing, phase ψ = Ω t + φ.

    The load on the tip is F0 + Σ A sin ψ, the position of the casing d = d0 + Σ a sin ψ. Behind the columns named here
    lie those of :class:`_SeenWave` for each contact.
    """

    # what a case gives
    OMEGA: int = 0  # Ω, rad/s
    PHASE: int = 1  # φ, rad
    LOAD: int = 2  # A, N
    CASING: int = 3  # a, m
    GIVEN: int = 4  # number of the columns above

    # cos ψ and sin ψ at the last time of evaluation, s, and at the one before; NaN where there was none
    TIME: int = 4
    COS: int = 5
    SIN: int = 6
    TIME_BEFORE: int = 7
    COS_BEFORE: int = 8
    SIN_BEFORE: int = 9

    COLUMNS: int = 10


wave = _Wave()


class _SeenWave(NamedTuple):
    """Columns of the table of waves for one contact, from ``Motion.columns`` on.

    Coefficients of cos ψ and sin ψ in its outputs by the wave alone, and in the position of its casing, m.
    """

    SIGNAL_COS: int = 0
    SIGNAL_SIN: int = 1
    TEMPERATURE_COS: int = 2
    TEMPERATURE_SIN: int = 3
    CASING_COS: int = 4
    CASING_SIN: int = 5

    COLUMNS: int = 6


seen_wave = _SeenWave()


class _State(NamedTuple):
    """Rows of a state of motion, ``(ROWS, column)``, less the particular solution."""

    VALUE: int = 0  # η of each block
    SLOPE: int = 1  # η' of each block
    FIRST: int = 2  # ξ of each first-order state
    FIRST_SLOPE: int = 3  # ξ' of each first-order state

    ROWS: int = 4


state = _State()


class _Terms(NamedTuple):
    """Rows of the tables of an expansion, see :class:`~workflow.schemes._exact.motion.Expansion`.

    In ``terms`` column k belongs to one block. In ``sums`` column K is the sum over the slow terms (loads, first-order
    states, explicit blocks) and the K slowest blocks; the blocks from K on are bounded as a group.
    """

    D0: int = 0  # output s
    D1: int = 1  # its derivatives s', s'', s'''
    D2: int = 2
    D3: int = 3
    FOURTH: int = 4  # bound of |s''''|
    TAIL: int = 5  # terms: bound of |s|; sums: bound of |s| of the blocks from K on
    TAIL_SLOPE: int = 6  # likewise of |s'|
    FOURTH_GROWTH: int = 7  # sums, column 0: largest rate at which the bound of |s''''| grows; terms: not used
    SIZE: int = 8  # sums, column 0: sum of the magnitudes of all terms of s; terms: not used

    ROWS: int = 9


expansion = _Terms()
