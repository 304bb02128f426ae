"""What sensors show at the end of a step of packs, from the states of blocks.

In the θ-method modes are displaced by z = ξ + hθ v at a step's end. In central differences ξ is z at the time of the
sample, and τ is a step ahead; the sample has half the heat of its impulse. All is linear in u and η of the blocks,
their response R to thermal modes and the known part by constant loads (:mod:`.free_motion`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workflow.kernels.compiled import part
from workflow.models import Array, Cases, project
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.free_motion import InitialState, State
from workflow.schemes._fixed.rows import ContactRecord
from workflow.schemes._interface import RefusedStructureError

CONSTANT, RATE = range(2)
"""What a sensor shows of each case by constant loads: at t = 0, and its rate."""


@part
def sense(rows: Array, state: State, contacts: Sequence[ContactRecord], t: float, shown: Array, lanes: int) -> None:
    """Move what sensors show at the end of the last step to its beginning, and fill it at the end of this one, at t."""
    motion, tau, before, sensing = state.motion, state.tau, state.tau_before, state.sensing
    blocks, modes = motion.shape[0], tau.shape[0]
    for s in range(rows.shape[0]):
        for lane in range(lanes):
            value = sensing[CONSTANT, s, lane] + sensing[RATE, s, lane] * t
            for c in range(len(contacts)):
                value += rows[s, 2 * blocks + 2 * modes + c] * contacts[c].displacement_end[lane]
            for j in range(blocks):
                value += rows[s, j] * motion[j, 0, lane] + rows[s, blocks + j] * motion[j, 1, lane]
            for k in range(modes):
                at = 2 * blocks + k
                value += rows[s, at] * tau[k, 0, lane] + rows[s, at + modes] * before[k, 0, lane]
            shown[0, s, lane] = shown[1, s, lane]
            shown[1, s, lane] = value


def sensing_of(blocks: Blocks, cases: Cases, begun: InitialState) -> tuple[Array, Array]:
    """Return the rows of sensors of a structure in blocks, and their numbers of each case, ``(2, sensor, case)``.

    Rows are per u and per η of the blocks, per τ at the step's end and at its beginning and per x of each contact,
    ``(sensor, column)``.

    Raises
    ------
    RefusedStructureError
        Damping couples the modes, and the structure has more rigid motions than its contacts show: their blocks have no
        place.
    """
    modal, step = blocks.modal, blocks.step
    modes, count, contacts = modal.frequency.size, len(modal.sensors), len(modal.normal)
    if not count:
        return np.zeros((0, 1)), np.zeros((2, 0, cases.count))
    x, theta = modal.sensors[:, :modes], modal.sensors[:, modes:]
    per_place = np.zeros((count, contacts))
    rigid = np.flatnonzero(modal.frequency == 0)
    if blocks.outward is not None and rigid.size and x[:, rigid].any():
        if np.linalg.matrix_rank(modal.normal[:, rigid]) < rigid.size:
            problem = "its damping couples the modes of several rigid motions, of which the scheme keeps no place"
            raise RefusedStructureError(f"{problem} for sensors; event_driven does")
        per_place = x[:, rigid] @ np.linalg.pinv(modal.normal[:, rigid])
        x = x - per_place @ modal.normal
    motion = np.einsum("sm,mrb->srb", x, _places(blocks))
    responds, both = np.einsum("srb,rbk->sk", motion, blocks.response), motion.reshape(count, 2 * blocks.damping.size)
    after, before = (theta / 2, theta * (1 - step.decay / 2)) if step.is_central else (theta, np.zeros_like(theta))
    scale = np.tile(blocks.heat_scale, 2)
    rows = np.hstack([both / np.tile(blocks.scale, 2), np.hstack([responds + after, before]) / scale, per_place])
    heat_time = step.tip.h if step.is_central else 0.0  # of τ after that of the sample, s
    own = np.stack(
        [
            _each(both, begun.known) + _each(theta, begun.settled) + heat_time * _each(responds, begun.warming_modes),
            _each(theta + responds, begun.warming_modes),
        ]
    )
    return np.ascontiguousarray(rows), own


def _places(blocks: Blocks) -> Array:
    """Return z of the modes, as a sample shows it, per u and η of the blocks, ``(mode, 2, block)``."""
    lever = 0.0 if blocks.step.is_central else blocks.step.lever
    if blocks.outward is None:
        one = np.eye(blocks.damping.size)
        return np.stack([lever * one, one], axis=1)
    return np.asarray(blocks.outward[1] + lever * blocks.outward[0])


def _each(rows: Array, states: Array) -> Array:
    """Return rows · states of each case, ``(sensor, case)``, with bits that do not depend on other cases."""
    return project(rows, states.reshape(rows.shape[1], states.shape[-1]).T).T
