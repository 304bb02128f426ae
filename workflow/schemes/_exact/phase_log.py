"""What the march keeps for the balances of energy and heat: phases that are gone through once more, and heat loss.

These phases are all contacts, the flights that follow them, and one of :data:`FLIGHTS` others.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import part
from workflow.models import Array
from workflow.schemes._exact.motion import Motion
from workflow.schemes._exact.passage import Motions, fill_modal
from workflow.schemes._exact.tables import first, state

FLIGHTS = 16
"""Flights from one that is logged to the next: there are ten times as many as contacts, all by one regime."""


class Log(NamedTuple):
    """Phases of a case; of no size where no balances are asked for."""

    stiffness: Array
    """ω² of the free modes, 1/s², ``(mode,)``."""
    loss: Array
    """Heat loss per τ, W, ``(thermal mode,)``."""
    content: Array
    """Q per τ, J, ``(thermal mode,)``."""
    per_load: Array
    """Change of Q per heat load, ``(thermal,)``."""
    begun: Array
    """When each phase begins, s, ``(phase,)``."""
    ended: Array
    """… and ends."""
    held: NDArray[np.bool_]
    """Whether the tip is held in it, ``(phase,)``."""
    state: Array
    """[y, y', τ] at its beginning, ``(phase, modal)``."""
    energy: Array
    """Energy at its end, J, ``(phase,)``."""
    final: Array
    """[y, y', τ] at the end of the case, ``(modal,)``."""


def empty_log() -> Log:
    """Return what the march takes where no balances are asked for."""
    row = np.zeros(0)
    return Log(row, row, row, row, row, row, np.zeros(0, dtype=np.bool_), np.zeros((0, 0)), row, row)


@part
def note_energy(log: Log, modal: Array, tally: Any) -> float:
    """Return the energy of a state, J, and keep the largest."""
    energy, modes = 0.0, log.stiffness.size
    for j in range(modes):
        energy += 0.5 * (modal[modes + j] ** 2 + log.stiffness[j] * modal[j] ** 2)
    tally.max_energy = max(tally.max_energy, energy)
    return energy


@part
def note_loss(log: Log, m: Motion, dt: float, tally: Any) -> None:
    """Count the heat lost in a step of a flight, whose motion was advanced last."""
    lost, f, y = 0.0, m.r.first, m.now
    for j in range(m.r.firsts):
        lost += log.loss[j] * (y[state.FIRST, j] + dt * y[state.FIRST_SLOPE, j] * f[first.PHI2, j])
    tally.lost += dt * lost
    tally.turnover += abs(dt * lost)


@part
def begin_phase(log: Log, modal: Array, tally: Any) -> None:
    """Keep that a phase begins in the state ``modal``."""
    i = tally.phases
    log.begun[i], log.held[i] = tally.time, tally.held != 0
    for j in range(log.final.size):
        log.state[i, j] = modal[j]
    tally.phases += 1
    tally.logged, tally.flights = 1, 0


@part
def end_phase(log: Log, motions: Motions, tally: Any) -> None:
    """Keep when and with which energy a phase ends that is logged."""
    i = tally.phases - 1
    fill_modal(motions, tally.held != 0, tally.time)
    log.ended[i], log.energy[i] = tally.time, note_energy(log, motions.free.modal, tally)
    tally.logged = 0
    if log.ended[i] <= log.begun[i]:
        tally.flights = FLIGHTS - 1  # the next one stands for those after it


@part
def note_phase(log: Log, motions: Motions, after: bool, tally: Any) -> bool:
    """Keep the phase that begins, ``after`` a contact or not, if it is logged; return whether there was room for it."""
    tally.flights += 1
    if not (tally.held or after or tally.flights == FLIGHTS):
        return True
    if tally.phases >= log.held.size:
        return False
    if not tally.held:  # what led into a contact has set it
        fill_modal(motions, False, tally.time)
    begin_phase(log, motions.free.modal, tally)
    return True
