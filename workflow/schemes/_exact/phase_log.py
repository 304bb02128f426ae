"""What the march keeps for the balances of energy and heat: the instants and states at which phases begin."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import part, rare
from workflow.models import Array
from workflow.schemes._exact.passage import Motions, fill_modal


class Log(NamedTuple):
    """Phases of a case; of no size where no balances are asked for."""

    stiffness: Array
    """ω² of the free modes, 1/s², ``(mode,)``."""
    begun: Array
    """When each phase begins, s, ``(phase,)``."""
    held: NDArray[np.bool_]
    """Whether the tip is held in it, ``(phase,)``."""
    state: Array
    """[y, y', τ] at its beginning, ``(phase, modal)``."""
    final: Array
    """[y, y', τ] at the end of the case, ``(modal,)``."""


def empty_log() -> Log:
    """Return what the march takes where no balances are asked for."""
    row = np.zeros(0)
    return Log(row, row, np.zeros(0, dtype=np.bool_), np.zeros((0, 0)), row)


@part
def note_energy(log: Log, modal: Array, tally: Any) -> float:
    """Return the energy of a state, J, and keep the largest."""
    energy, modes = 0.0, log.stiffness.size
    for j in range(modes):
        energy += 0.5 * (modal[modes + j] ** 2 + log.stiffness[j] * modal[j] ** 2)
    tally.max_energy = max(tally.max_energy, energy)
    return energy


@part
def begin_phase(log: Log, modal: Array, tally: Any) -> None:
    """Keep that a phase begins in the state ``modal``."""
    i = tally.phases
    log.begun[i], log.held[i] = tally.time, tally.held != 0
    for j in range(log.final.size):
        log.state[i, j] = modal[j]
    tally.phases += 1


@rare
def note_phase(log: Log, motions: Motions, tally: Any) -> bool:
    """Keep the phase that begins; return whether there was room for it."""
    if tally.phases >= log.held.size:
        return False
    modal = motions.free.coordinates  # set by what led into a contact
    if not tally.held:
        fill_modal(motions, False, tally.time)
    begin_phase(log, modal, tally)
    return True
