"""Rows of the table of second-order blocks, ``(ROWS, column)``; column k holds the block η'' + c η' + ω² η = F.

The force on a block is F(t) = F0 + Σ (Fc cos ψ + Fs sin ψ): a constant, and the waves of phase ψ = Ω t + φ
(:mod:`~workflow.schemes._exact.tables.wave`).
An *explicit* block keeps F. From every other block the particular solution is
subtracted, so that its motion is free. Outputs o (0: the signal, 1: the tip temperature) are linear in
η and η': the row of output o lies 2 o below that of the signal.

Columns are padded to a multiple of 8 by blocks at rest without outputs, so that vectorised loops have no
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
EXPLICIT_COLUMNS = 6  # of the explicit blocks, `Motion.explicits` of them
APERIODIC_COLUMNS = 7  # of others that do not oscillate, `Motion.aperiodics` of them

# outputs per η and η'
SIGNAL_VALUE = 8
SIGNAL_SLOPE = 9
TEMPERATURE_VALUE = 10
TEMPERATURE_SLOPE = 11
UNFORCED_VALUE = 12  # SIGNAL_VALUE of blocks that are not explicit, else 0; likewise the three rows below
UNFORCED_SLOPE = 13
UNFORCED_TEMPERATURE_VALUE = 14
UNFORCED_TEMPERATURE_SLOPE = 15
SIGNAL_INTEGRAL = 16  # SIGNAL_VALUE/ω² of blocks that are not explicit, else 0: ∫η dt = -Δ(η' + c η)/ω²

# loads
FORCE = 17  # F0
PARTICULAR = 18  # constant part of the particular solution, subtracted from η …
PARTICULAR_SLOPE = 19  # … and from u

# scratch of one propagation over dt
C = 20  # of η(dt) = C η + S η'
S = 21
WORK = 22
POWER = 23

ROWS = 24

# each wave
FORCE_COS = 24  # Fc
FORCE_SIN = 25  # Fs
PARTICULAR_COS = 26  # its part of the particular solution, subtracted from η …
PARTICULAR_SIN = 27
PARTICULAR_SLOPE_COS = 28  # … and from u
PARTICULAR_SLOPE_SIN = 29

WAVE = 6


def padded(size: int) -> int:
    """Return the number of columns for ``size`` blocks: the next multiple of 8."""
    return 8 * ((size + 7) // 8)
