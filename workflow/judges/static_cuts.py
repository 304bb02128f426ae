"""How deep loads that are applied statically press a structure into the coating of its casing, over the angle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.models import Cases, Structure, static_reach, statics

ANGLES = np.arange(720) / 2
"""Angles of the casing at which it is looked at, degrees."""

_WHOLE = 1e-9
"""Relative difference of a frequency from a multiple of the speed up to which a harmonic stands still in the casing."""


class StaticCut(NamedTuple):
    """What the largest loads of a case cut without moving, of all contacts alone the most."""

    inside: Array
    """x - d of the casing before it is worn, m, ``(angle,)``; negative where the structure is clear of it."""
    depth: float
    """Largest worn depth, m."""
    speed: float
    """Largest speed at which casing and loads, applied statically, move a contact, m/s."""


def static_cut(structure: Structure, cases: Cases) -> StaticCut | None:
    """Return the static cut of the first case; ``None`` without a coating, or where loads move it for ever."""
    coating, rows, pair = cases.coating, structure.contacts, structure.mechanical
    load = cases.steady[0] + cases.mean[0] * structure.load_direction
    if coating is None or pair.moves(load):
        return None
    reach, flexibility = np.abs(static_reach(structure)), statics(structure)[0] + rows.casing_flexibility
    if not np.isfinite([*reach, *flexibility]).all():
        return None
    waves, moves, turning = cases.load_harmonics, cases.casing_harmonics, coating.speed[0]
    place = rows.normal @ pair.solve(load) + cases.mean[0] * rows.residual_load - cases.clearances[0]
    inside = np.tile((place + reach * waves.reach[0])[:, None], ANGLES.size)
    for amplitude, frequency, phase in zip(*(row[0] for row in moves.rows), strict=True):
        order = np.round(frequency / turning) if turning > 0 else np.nan
        if abs(frequency - order * turning) <= _WHOLE * frequency:
            inside -= amplitude * np.sin(np.radians(order * ANGLES) + phase)
        else:  # it turns in the casing, and comes as near at each angle
            inside += abs(amplitude)
    crushed = inside.max(axis=1) - flexibility * coating.yield_force[0]
    depth = float(np.max(crushed / (1 + flexibility * coating.hardening[0])))
    speeds = [float(np.abs(one.amplitude[0]) @ one.angular[0]) for one in (waves, moves)]
    return StaticCut(inside.max(axis=0), max(depth, 0.0), float(reach.max()) * speeds[0] + speeds[1])
