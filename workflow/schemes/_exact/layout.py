"""What the compiled kernel takes: the loads of a case, its regimes as tables, and the memory that it works in.

Regimes are packed into few arrays, because each array costs compilation in every function that it passes through.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.models import Array
from workflow.schemes._exact import block_table as block
from workflow.schemes._exact import expansion_table as expansion
from workflow.schemes._exact import first_table as first
from workflow.schemes._exact import state_table as state
from workflow.schemes._exact import wave_table as wave
from workflow.schemes._exact.regimes import Regime

ORDER = 18
"""Largest order of Taylor polynomials of motions."""

TAYLOR_SPAN = 0.6
"""Largest |pole| · time over which they are used: the remainder is below 0.6^18/18! = 2e-20."""


class Load(NamedTuple):
    """Loads and casing of one case: F0 + Σ A sin ψ on the tip, positive towards the casing, at d = d0 + Σ a sin ψ."""

    mean: float
    """F0, N."""
    waves: Array
    """Ω, φ, A and a of each wave, ``(wave, GIVEN)``, see :mod:`workflow.schemes._exact.wave_table`."""
    gap: float
    """d0, m."""
    duration: float
    """End of the case, s."""
    steady: Array
    """Constant load per mechanical coordinate, N."""
    heating: Array
    """Constant heat load per thermal coordinate, W."""


class Layout(NamedTuple):
    """A regime as tables, shared by cases; rows that loads decide are 0 here and filled in :class:`Memory`."""

    blocks: int
    firsts: int
    block: Array
    """See :mod:`workflow.schemes._exact.block_table`."""
    first: Array
    """See :mod:`workflow.schemes._exact.first_table`."""
    coupling: Array
    source: Array
    from_modal: Array
    to_modal: Array
    """All see :class:`~workflow.schemes._exact.regimes.Regime`."""
    growth: float
    """Largest rate at which a block may grow, 1/s, not negative."""
    first_growth: float
    """… and a first-order state."""
    fastest: float
    """Bound of the poles of blocks, 1/s."""
    fastest_first: float
    """Largest |μ|, 1/s."""
    two_way: bool
    """Whether blocks show in the tip temperature or their η' in the signal."""
    warms: bool
    """Whether blocks show in the tip temperature."""


def layout(g: Regime) -> Layout:
    """Pack a regime."""
    b, f = _block_table(g), _first_table(g)
    warms = bool(b[[block.TEMPERATURE_VALUE, block.TEMPERATURE_SLOPE]].any())
    return Layout(
        blocks=g.damping.size,
        firsts=g.rate.size,
        block=b,
        first=f,
        coupling=g.coupling,
        source=g.source,
        from_modal=g.from_modal,
        to_modal=g.to_modal,
        growth=float(np.max(-g.damping, initial=0.0)),
        first_growth=float(np.max(-g.rate, initial=0.0)),
        fastest=float(np.max(np.maximum(np.sqrt(g.stiffness), np.abs(g.damping)), initial=0.0)),
        fastest_first=float(np.max(np.abs(g.rate), initial=0.0)),
        two_way=warms or bool(b[block.SIGNAL_SLOPE].any()),
        warms=warms,
    )


def _block_table(g: Regime) -> Array:
    """Return the rows of the blocks that do not depend on loads."""
    blocks = g.damping.size
    b = np.zeros((block.ROWS, block.padded(blocks)))
    b[block.STIFFNESS] = max(1.0, float(g.stiffness[-1])) if blocks else 1.0
    b[block.STIFFNESS, :blocks] = g.stiffness
    b[block.DAMPING, :blocks], b[block.RESONANT, :blocks] = g.damping, g.resonant
    b[block.SIGNAL_VALUE, :blocks], b[block.SIGNAL_SLOPE, :blocks] = g.signal[: 2 * blocks].reshape(2, -1)
    b[block.TEMPERATURE_VALUE, :blocks], b[block.TEMPERATURE_SLOPE, :blocks] = g.temperature[: 2 * blocks].reshape(
        2, -1
    )
    part = 0.25 * g.damping * g.damping
    b[block.NU] = 1.0
    np.sqrt(g.stiffness - part, out=b[block.NU, :blocks], where=g.stiffness > part)
    b[block.HALF_DAMPING] = 0.5 * b[block.DAMPING]
    b[block.OMEGA] = np.sqrt(b[block.STIFFNESS])
    np.divide(1.0, b[block.OMEGA], out=b[block.INVERSE_OMEGA], where=b[block.OMEGA] > 0)
    return b


def _first_table(g: Regime) -> Array:
    """Return the rows of the first-order states that do not depend on loads."""
    states, columns = 2 * g.damping.size, slice(0, g.rate.size)
    f = np.zeros((first.ROWS, block.padded(g.rate.size)))
    f[first.RATE, columns] = g.rate
    f[first.SIGNAL_VALUE, columns] = g.signal[states:]
    f[first.TEMPERATURE_VALUE, columns] = g.temperature[states:]
    f[first.HEAT_JUMP_VALUE, columns] = g.temperature[states:]  # C2⁻¹ e_n in thermal modes of unit norm: χ_n
    f[first.HEAT_JUMP_SLOPE, columns] = -g.rate * g.temperature[states:]
    return f


class Memory(NamedTuple):
    """Arrays in which a case follows a regime; one case after the other may use them.

    Without columns for first-order states where no heat acts.
    """

    block: Array
    first: Array
    """Tables of the layout, completed by what the loads of the case decide."""
    coordinates: Array
    """[η, u, ξ], ``(N,)``."""
    states: Array
    """Three states of motion, ``(3, 4, column)``."""
    outputs: Array
    """Of signal and tip temperature what constant loads alone give, ``(2,)``."""
    waves: Array
    """See :mod:`workflow.schemes._exact.wave_table`."""
    sums: Array
    terms: Array
    derivatives: Array
    """See :class:`~workflow.schemes._exact.expansion.Expansion`."""


def memory(regime: Layout, heated: bool, waves: int) -> Memory:
    """Return memory for a regime under so many waves."""
    firsts = regime.firsts if heated else 0
    columns, wide = block.padded(regime.blocks), block.padded(firsts)
    return Memory(
        block=np.zeros((block.ROWS + block.WAVE * waves, columns)),
        first=np.zeros((first.ROWS + first.WAVE * waves, wide)),
        coordinates=np.zeros(2 * regime.blocks + firsts),
        states=np.zeros((3, state.ROWS, max(columns, wide))),
        outputs=np.zeros(2),
        waves=np.zeros((waves, wave.COLUMNS)),
        sums=np.zeros((expansion.ROWS, regime.blocks + 1)),
        terms=np.zeros((expansion.ROWS, columns)),
        derivatives=np.zeros(ORDER + 1),
    )
