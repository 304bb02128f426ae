"""Rows of the table of first-order states, ``(ROWS, column)``; column j holds the state ξ' = -μ ξ + χ0 + χ1 sin ψ.

The harmonic response of ξ is subtracted, so that ξ' decays as exp(-μ t). Outputs o (0: the signal, 1: the tip
temperature) are linear in ξ and ξ', the response of the blocks to ξ included: the row of output o lies 2 o below that
of the signal. Columns are filled up to a multiple of 8 with zeros.
"""

from __future__ import annotations

RATE = 0  # μ, 1/s
SIGNAL_VALUE = 1  # signal per ξ
SIGNAL_SLOPE = 2  # signal per ξ'
TEMPERATURE_VALUE = 3  # tip temperature per ξ
TEMPERATURE_SLOPE = 4
WARMING = 5  # rate of the tip temperature per ξ'
SOURCE = 6  # χ0
HARMONIC_COS = 7  # response to χ1 sin ψ that is subtracted from ξ
HARMONIC_SIN = 8
HEAT_JUMP_VALUE = 9  # jump of ξ per heat at the tip, 1/J; free tip only
HEAT_JUMP_SLOPE = 10  # jump of ξ' per heat at the tip

# scratch of one propagation over dt, x = -μ dt
DECAY = 11  # e^x
PHI1 = 12  # φ1 = (e^x - 1)/x
PHI2 = 13  # φ2 = (φ1 - 1)/x

ROWS = 14
