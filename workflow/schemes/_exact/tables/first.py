"""Rows of the table of first-order states, ``(ROWS, column)``; column j holds ξ' = -μ ξ + χ0 + Σ (χc cos ψ + χs sin ψ).

The response of ξ to the waves is subtracted, so that ξ' decays as exp(-μ t). The row of output o (0: the signal, 1: the
tip temperature) lies o below that of the signal. Columns are padded to a multiple of 8 with zeros. The rows of wave i
lie ``i * WAVE`` below those named here.
"""

from __future__ import annotations

RATE = 0  # μ, 1/s
SIGNAL = 1  # signal per ξ
TEMPERATURE = 2  # tip temperature per ξ
SOURCE = 3  # χ0

# scratch of one propagation over dt, x = -μ dt
DECAY = 4  # e^x
PHI1 = 5  # φ1 = (e^x - 1)/x
PHI2 = 6  # φ2 = (φ1 - 1)/x

ROWS = 7

# each wave
HARMONIC_COS = 7  # response to χc cos ψ + χs sin ψ that is subtracted from ξ
HARMONIC_SIN = 8

WAVE = 2
