"""What sensors show at the end of a step of packs, from the states of blocks, which lack load and contact of that step.

In the θ-method modes are displaced by z = ξ + hθ v at a step's end. In central differences ξ, one step ahead of τ, is z
at the time of the sample, which has half the heat of its impulse. Both are linear in u and η of the blocks, their
response R to thermal modes and the known part by constant loads (:mod:`.free_motion`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workflow.kernels.compiled import part
from workflow.models import Array, Cases, project
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.free_motion import InitialState, State, drives
from workflow.schemes._fixed.rows import Tips
from workflow.schemes._interface import RefusedStructureError

CONSTANT, RATE, IMPULSE = range(3)
"""What a sensor shows of each case: by constant loads at t = 0, its rate, and per unit impulse in the step of each
contact from there on."""


@part
def sense(rows: Array, state: State, tips: Sequence[Tips], marked: bool, t: float, shown: Array, lanes: int) -> None:
    """Move what sensors show at the end of the last step to its beginning, and fill it at the end of this one, at t."""
    motion, tau, acts, sensing = state.motion, state.tau, state.acts, state.sensing
    blocks, after = motion.shape[0], 2 * motion.shape[0] + state.tau.shape[0]
    for s in range(rows.shape[0]):
        for lane in range(lanes):
            value = sensing[CONSTANT, s, lane] + sensing[RATE, s, lane] * t
            value += rows[s, after] * state.own.load[lane]
            for c in range(len(acts)):
                place = tips[c].new_displacement[lane] if marked else tips[c].displacement[lane]
                value += sensing[IMPULSE + c, s, lane] * acts[c].impulse[lane] + rows[s, after + 1 + c] * place
            for j in range(blocks):
                value += rows[s, j] * motion[j, 0, lane] + rows[s, blocks + j] * motion[j, 1, lane]
            for k in range(tau.shape[0]):
                value += rows[s, 2 * blocks + k] * tau[k, lane]
            shown[0, s, lane] = shown[1, s, lane]
            shown[1, s, lane] = value


def sensing_of(blocks: Blocks, cases: Cases, begun: InitialState) -> tuple[Array, Array]:
    """Return the rows of sensors of a structure in blocks, and their numbers of each case, ``(number, sensor, case)``.

    Rows are per u and per η of the blocks, per τ, per impulse of the load and per x of each contact, ``(sensor,
    column)``.

    Raises
    ------
    RefusedStructureError
        Damping couples the modes, and the structure has more rigid motions than its contacts show: their blocks have no
        place.
    """
    modal, step = blocks.modal, blocks.step
    modes, count, contacts = modal.frequency.size, len(modal.sensors), len(modal.normal)
    if not count:
        return np.zeros((0, 2)), np.zeros((IMPULSE + contacts, 0, cases.count))
    x, theta = modal.sensors[:, :modes], modal.sensors[:, modes:]
    per_place = np.zeros((count, contacts))
    rigid = np.flatnonzero(modal.frequency == 0)
    if blocks.outward is not None and rigid.size and x[:, rigid].any():
        if np.linalg.matrix_rank(modal.normal[:, rigid]) < rigid.size:
            problem = "its damping couples the modes of several rigid motions, of which the scheme keeps no place"
            raise RefusedStructureError(f"{problem} for sensors; event_driven does")
        per_place = x[:, rigid] @ np.linalg.pinv(modal.normal[:, rigid])
        x = x - per_place @ modal.normal
    places = _places(blocks)
    motion = np.einsum("sm,mrb->srb", x, places)
    lagged, responds = not step.heat_counts, np.einsum("srb,rbk->sk", motion, blocks.response)
    heat = theta + (step.decay * responds if lagged else responds)
    load = blocks.of_impulses(modal.load[:, None])[..., 0]
    rows = np.hstack(
        [
            motion[:, 0] / blocks.scale,
            motion[:, 1] / blocks.scale,
            heat / modal.heat_scale,
            np.einsum("srb,rb->s", motion, load)[:, None],
            per_place,
        ]
    )
    gains = step.heat_gain @ (responds + (0.5 if lagged else 1.0) * theta).T
    pushes = drives(blocks, cases)
    both, ahead = motion.reshape(count, 2 * blocks.damping.size), step.tip.h if lagged else 0.0
    own = np.stack(
        [
            _each(both, begun.known) + _each(theta, begun.settled) + ahead * _each(responds, begun.warming_modes),
            _each(theta + responds, begun.warming_modes),
            *(
                _each(both, drive) + np.multiply.outer(gain, cases.alpha)
                for drive, gain in zip(pushes, gains, strict=True)
            ),
        ]
    )
    return np.ascontiguousarray(rows), own


def _places(blocks: Blocks) -> Array:
    """Return z of the modes, as a sample shows it, per u and η of the blocks, ``(mode, 2, block)``."""
    lever = blocks.step.lever if blocks.step.heat_counts else 0.0
    if blocks.outward is None:
        one = np.eye(blocks.damping.size)
        return np.stack([lever * one, one], axis=1)
    return np.asarray(blocks.outward[1] + lever * blocks.outward[0])


def _each(rows: Array, states: Array) -> Array:
    """Return rows · states of each case, ``(sensor, case)``, with bits that do not depend on other cases."""
    return project(rows, states.reshape(rows.shape[1], states.shape[-1]).T).T
