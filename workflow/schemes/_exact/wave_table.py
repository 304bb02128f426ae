"""Columns of the table of waves, ``(wave, COLUMNS)``: sinusoids of the load and of the casing, phase ψ = Ω t + φ.

The load on the tip is F0 + Σ A sin ψ, the place of the casing d = d0 + Σ a sin ψ.
"""

from __future__ import annotations

# what a case gives
OMEGA = 0  # Ω, rad/s
PHASE = 1  # φ, rad
LOAD = 2  # A, N
CASING = 3  # a, m
GIVEN = 4  # number of the columns above

# cos ψ and sin ψ at the last time asked for, s; NaN where none was
TIME = 4
COS = 5
SIN = 6

# what the wave alone gives of the outputs: coefficients of cos ψ and sin ψ
SIGNAL_COS = 7
SIGNAL_SIN = 8
TEMPERATURE_COS = 9
TEMPERATURE_SIN = 10

# scratch of a Taylor series: a derivative of the force on an explicit block, and cos ψ and sin ψ where it begins
FORCE_COS = 11
FORCE_SIN = 12
COS_BEGUN = 13
SIN_BEGUN = 14

COLUMNS = 15
