"""An abradable coating in fixed steps: the sector that each contact is in at a step's end, and how it is worn there.

A law (:mod:`~workflow.schemes._fixed.newton`) is given the surface as it is worn, d + w, and the force F_y + H w at
which it crushes, both of the sector of the step's end. Where a border lies in a step, from a force λ at x - d to λ' at
x' - d', the drive gives

    c (λ'² - λ²)/2 + F_y (w' - w) + H (w'² - w²)/2 - (λ + λ')/2 (x' - d' - (x - d)).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import Rows, named_rows, rows_in
from workflow.kernels.packs import Lane, Pack, lanes_of, pack, store
from workflow.models import AT_BORDER, Array, Cases
from workflow.schemes._fixed.law import TipStep
from workflow.schemes._fixed.rows import Acting
from workflow.schemes._interface import Worn


class Track(Rows):
    """The coating of the casing where a contact passes, of each case."""

    yield_force: Array
    hardening: Array
    sectors: Array
    speed: Array
    turns: Array
    """As in :class:`~workflow.models.Coating`."""
    sector: Array
    """The sector at the step's end."""
    until: Array
    """The time before which the contact comes to no border, s."""
    crossed: Array
    """End of the last step in which the worn depth became another by a border, s."""
    depth: Array
    depth_end: Array
    """x - d at the step's beginning and at its end, m."""
    force_before: Array
    """λ at the step's beginning, N."""
    border_work: Array
    """What borders have given so far, J."""
    mapped: Array
    """Number of rows of the map that are filled."""


def tracks_of(cases: Cases, worn: Worn, depth: Array, flexibility: float) -> Array | None:
    """Return the rows of :class:`Track` for contacts that start x - d = ``depth`` deep, ``(contact, row, case)``.

    Those that are pressed at t = 0 wear their sectors. ``None`` without a coating.
    """
    own = cases.coating
    if own is None:
        return None
    force, now = own.pressed(depth, flexibility)
    np.put_along_axis(worn.depth, own.begins_in()[..., None], now[..., None], axis=2)
    rows = np.zeros((depth.shape[1], rows_in(Track), cases.count))
    track: Any = named_rows(Track, rows)
    for name in ("yield_force", "hardening", "sectors", "speed"):
        track[name] = getattr(own, name)
    track["turns"], track["sector"] = own.turns.T, own.begins_in().T
    track["force_before"], track["depth"] = force.T, depth.T
    track["border_work"] = own.crushing_work(worn.depth).T
    return rows


@inlined
def enter_sectors(
    tracks: Sequence[Track] | None, worn: Worn, step: TipStep, t: float, acts: Sequence[Acting], lane: Lane
) -> None:
    """Give the contacts of a pack the surface of the sectors in which they are at t, the end of a step."""
    if tracks is not None:
        _enter_sectors(tracks, worn.depth, step.h, t, acts, lane)


@part
def _enter_sectors(
    tracks: Sequence[Track], depth: Array, h: float, t: float, acts: Sequence[Acting], lane: Lane
) -> None:
    first, stop = lanes_of(lane)
    for c in range(len(acts)):
        for case in range(first, min(stop, depth.shape[0])):
            for at in (t - h, t):  # far from the casing it has entered none
                if at >= tracks[c].until[case]:
                    _enter_sector(tracks[c], depth[case, c], at, acts[c], case)
        store(acts[c].place_free, lane, pack(acts[c].place_free, lane) - pack(acts[c].worn, lane))


@inlined
def _enter_sector(track: Track, depth: Array, t: float, act: Acting, case: int) -> None:
    turns, sectors = track.turns[case] + track.speed[case] * t, track.sectors[case]
    place = sectors * (turns - np.floor(turns)) + AT_BORDER
    now, sector = depth[int(track.sector[case])], np.floor(place)
    track.until[case] = t + (sector + 1.0 - place - AT_BORDER) / (sectors * track.speed[case])
    track.sector[case] = sector if sector < sectors else 0.0
    act.worn[case] = depth[int(track.sector[case])]
    act.level[case] = track.yield_force[case] + track.hardening[case] * act.worn[case]
    track.crossed[case] = t if act.worn[case] != now else track.crossed[case]


@inlined
def wear(
    tracks: Sequence[Track] | None,
    worn: Worn,
    step: TipStep,
    t: float,
    c: int,
    act: Acting,
    depth: Pack,
    engaged: bool,
    lane: Lane,
) -> None:
    """Wear the sector of contact ``c`` where it crushes the coating at t, the end of a step, ``depth`` deep."""
    if tracks is not None:
        if engaged:
            store(tracks[c].depth_end, lane, depth)
            _wear(tracks[c], worn.depth[:, c], step.casing_flexibility, t, act, lane)
        store(tracks[c].depth, lane, depth)


@part
def _wear(track: Track, worn: Array, flexibility: float, t: float, act: Acting, lane: Lane) -> None:
    first, stop = lanes_of(lane)
    for case in range(first, min(stop, worn.shape[0])):
        force, earlier = act.force[case], track.force_before[case]
        depth, before, level, hardening = track.depth_end[case], act.worn[case], act.level[case], track.hardening[case]
        now = before
        if force > 0.0 and force >= level:
            now = max(before, depth - flexibility * force)
            worn[case, int(track.sector[case])] = act.worn[case] = now
            act.level[case] = track.yield_force[case] + hardening * now
        if track.crossed[case] == t:
            stored = 0.5 * flexibility * (force * force - earlier * earlier)
            crushed = (level + 0.5 * hardening * (now - before)) * (now - before)
            way = depth - track.depth[case]
            track.border_work[case] += stored + crushed - 0.5 * (force + earlier) * way
        track.force_before[case] = force


@inlined
def fill_map(tracks: Sequence[Track] | None, worn: Worn, t: float) -> None:
    """Fill the map at t, the end of a step."""
    if tracks is not None and worn.map.shape[2] > 0:
        _fill_map(tracks, worn, t)


@part
def _fill_map(tracks: Sequence[Track], worn: Worn, t: float) -> None:
    """Fill the rows of the map whose revolutions have ended."""
    for c in range(len(tracks)):
        track = tracks[c]
        for case in range(worn.map.shape[0]):
            while track.mapped[case] < worn.map.shape[2]:
                if track.speed[case] * t + AT_BORDER < worn.every * (track.mapped[case] + 1.0):
                    break
                for k in range(int(track.sectors[case])):
                    worn.map[case, c, int(track.mapped[case]), k] = worn.depth[case, c, k]
                track.mapped[case] += 1.0
