"""A motion as kernels of the exact scheme read it, made of tables alone: no structure, no case."""

import numpy as np

from workflow.schemes._exact.motion import ORDER, Expansion, Motion
from workflow.schemes._exact.tables import block, expansion, first, padded, seen, seen_wave, state, wave


def bare_motion(blocks: int, firsts: int = 0, waves: int = 0, growth: float = 0.0, cooling: bool = False) -> Motion:
    """Return a motion whose tables are 0."""
    columns = padded(blocks)
    rows, slow, across = block.ROWS + block.WAVE * waves, first.ROWS + first.WAVE * waves, wave.COLUMNS
    now, after, between = np.zeros((3, state.ROWS, 8))
    return Motion(
        blocks,
        firsts,
        explicits=0,
        aperiodics=0,
        block=np.zeros((rows + seen.ROWS, columns)),
        first=np.zeros((slow + first.SEEN, 8)),
        outputs=np.zeros(3),
        waves=np.full((waves, across + seen_wave.COLUMNS), np.nan),
        differences=np.zeros((9, 4), complex),
        expansion=Expansion(
            np.zeros((expansion.ROWS, blocks + 1)),
            np.zeros((expansion.ROWS, columns)),
            np.zeros(ORDER + 1),
            np.zeros(ORDER + 2),
        ),
        now=now,
        after=after,
        between=between,
        growth=growth,
        fastest=0.0,
        heated=False,
        cooling=cooling,
        contact=0,
        rows=rows,
        slow=slow,
        columns=across,
    )


def add_decay(m: Motion, share: float, rate: float) -> None:
    """Set the only first-order state, of size 1 at t = 0, and the signal per size."""
    m.first[first.RATE, 0], m.first[m.slow, 0] = rate, share
    m.now[state.FIRST, 0], m.now[state.FIRST_SLOPE, 0] = 1.0, -rate
