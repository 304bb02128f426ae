"""Rows of the table of first-order states, ``(ROWS, column)``; column j holds ξ' = -μ ξ + χ0 + Σ (χc cos ψ + χs sin ψ).

The response of ξ to the waves is subtracted, so that ξ' decays as exp(-μ t). Outputs o (0: the signal, 1: the tip
temperature) are linear in ξ and ξ', the response of the blocks to ξ included: the row of output o lies 2 o below that
of the signal. Columns are filled up to a multiple of 8 with zeros. The rows of wave i lie ``i * WAVE`` below those
named here.
"""

from __future__ import annotations

RATE = 0  # μ, 1/s
SIGNAL_VALUE = 1  # signal per ξ
SIGNAL_SLOPE = 2  # signal per ξ'
TEMPERATURE_VALUE = 3  # tip temperature per ξ
TEMPERATURE_SLOPE = 4
WARMING = 5  # rate of the tip temperature per ξ'
SOURCE = 6  # χ0

# scratch of one propagation over dt, x = -μ dt
DECAY = 7  # e^x
PHI1 = 8  # φ1 = (e^x - 1)/x
PHI2 = 9  # φ2 = (φ1 - 1)/x

ROWS = 10

# each wave
HARMONIC_COS = 10  # response to χc cos ψ + χs sin ψ that is subtracted from ξ
HARMONIC_SIN = 11

WAVE = 2
