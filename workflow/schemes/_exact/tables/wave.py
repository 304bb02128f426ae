"""Columns of the table of waves, ``(wave, COLUMNS)``: sinusoids of the load and of the casing, phase ψ = Ω t + φ.

The load on the tip is F0 + Σ A sin ψ, the position of the casing d = d0 + Σ a sin ψ.
"""

from __future__ import annotations

# what a case gives
OMEGA = 0  # Ω, rad/s
PHASE = 1  # φ, rad
LOAD = 2  # A, N
CASING = 3  # a, m
GIVEN = 4  # number of the columns above

# cos ψ and sin ψ at the last time of evaluation, s, and at the one before; NaN where there was none
TIME = 4
COS = 5
SIN = 6
TIME_BEFORE = 7
COS_BEFORE = 8
SIN_BEFORE = 9

# outputs by the wave alone: coefficients of cos ψ and sin ψ
SIGNAL_COS = 10
SIGNAL_SIN = 11
TEMPERATURE_COS = 12
TEMPERATURE_SIN = 13

COLUMNS = 14
