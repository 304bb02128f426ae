"""Rows of the table of second-order blocks, ``(ROWS, column)``; column k holds the block η'' + c η' + ω² η = F.

The force on a block is F(t) = F0 + Σ (Fc cos ψ + Fs sin ψ): a constant, and the waves of phase ψ = Ω t + φ
(:mod:`~workflow.schemes._exact.tables.wave`).
An *explicit* block keeps F. Of every other block the particular solution is
subtracted, so that what is left moves without a force. Outputs o (0: the signal, 1: the tip temperature) are linear in
η and η': the row of output o lies 2 o below that of the signal.

Columns are filled up to a multiple of 8 by blocks at rest that no output sees, so that vectorised loops have no
remainder. The rows of wave i lie ``i * WAVE`` below those named here.
"""

from __future__ import annotations

# the block
DAMPING = 0  # c, 1/s
STIFFNESS = 1  # ω², 1/s²
OMEGA = 2  # ω, 1/s
INVERSE_OMEGA = 3  # 1/ω, s; 0 where ω = 0
HALF_DAMPING = 4  # c/2, 1/s
NU = 5  # ν = √(ω² - c²/4), 1/s; 1 where the block does not oscillate
EXPLICIT = 6  # 1 where the block keeps its force
EXPLICIT_COLUMNS = 7  # of the explicit blocks, `Response.explicits` of them
APERIODIC_COLUMNS = 8  # of others that do not oscillate, `Response.aperiodics` of them

# outputs per η and η'
SIGNAL_VALUE = 9
SIGNAL_SLOPE = 10
TEMPERATURE_VALUE = 11
TEMPERATURE_SLOPE = 12
UNFORCED_VALUE = 13  # SIGNAL_VALUE of blocks that are not explicit, else 0; likewise the three rows below
UNFORCED_SLOPE = 14
UNFORCED_TEMPERATURE_VALUE = 15
UNFORCED_TEMPERATURE_SLOPE = 16
SIGNAL_INTEGRAL = 17  # SIGNAL_VALUE/ω² of blocks that are not explicit, else 0: ∫η dt = -Δ(η' + c η)/ω²

# loads
FORCE = 18  # F0
SOURCE = 19  # β of η' = u + β + Σ (βc cos ψ + βs sin ψ)
PARTICULAR = 20  # constant part of the particular solution that is subtracted

# scratch of one propagation over dt
C = 21  # of η(dt) = C η + S η'
S = 22
WORK = 23
POWER = 24

ROWS = 25

# each wave
FORCE_COS = 25  # Fc
FORCE_SIN = 26  # Fs
SOURCE_COS = 27  # βc
SOURCE_SIN = 28  # βs
PARTICULAR_COS = 29  # its part of the particular solution
PARTICULAR_SIN = 30

WAVE = 6


def padded(size: int) -> int:
    """Return the number of columns for so many blocks: the next multiple of 8."""
    return 8 * ((size + 7) // 8)
