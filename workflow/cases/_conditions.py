"""Conditions of the cases of a batch, also with their data changed by a trifle."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from workflow import schemes
from workflow.cases._structures import full_structure
from workflow.declare import File, Values
from workflow.judges.distances import perturbed
from workflow.models import Array, Cases, Coating, EndState, Harmonics, Structure
from workflow.study import CaseSettings, Initial, Scene, gaps_of

FRICTION = "scene.friction."
"""How the axes begin that make α."""


class Start(NamedTuple):
    """How the cases of a point of a sweep start: as those of the point before ended."""

    displacement: Array
    velocity: Array
    temperature: Array
    """In the coordinates in which initial states are given, ``(case, given)``."""
    load_turns: Array
    casing_turns: Array
    """Parts of a turn by which their harmonics are ahead of the phases of the study, 1, ``(case, harmonic)``."""
    sector_turns: Array
    """Part of a turn by which the contacts are ahead along a coating, 1, ``(case,)``."""
    worn: Array
    """Worn depths of the coating, m, ``(case, contact, sector)``; no sectors without one."""

    @classmethod
    def after(cls, end: EndState, worn: Array, cases: Cases, start: Start | None, duration: float) -> Start:
        """Return the start after cases, with that of their own, which ended there after a time [s]."""
        load, casing = (own.frequency * duration for own in (cases.load_harmonics, cases.casing_harmonics))
        turns = np.zeros(cases.count) if cases.coating is None else cases.coating.speed * duration
        if start is not None:
            load, casing, turns = load + start.load_turns, casing + start.casing_turns, turns + start.sector_turns
        return cls(*end, load % 1.0, casing % 1.0, turns % 1.0, worn)

    def take(self, which: Any) -> Start:
        """Return that of some cases."""
        return Start(*(rows[which] for rows in self))


def conditions(
    settings: CaseSettings, structure: Structure, varying: Mapping[str, Array], count: int, start: Start | None = None
) -> Cases:
    """Return the cases of a batch on the full structure; ``initial: static`` is left to ``at_rest``.

    A scheme that does not say that it reads e is given NaN: cases that differ in e alone are computed once.

    Parameters
    ----------
    settings
        Settings that all cases of the batch share.
    structure
        The full structure; loads and initial states are given per node, or in the coordinates it was given in.
    varying
        Values of the axes along which the cases differ, by path, each ``(case,)``.
    count
        Number of cases.
    start
        How they start, ``None`` for the initial state of the scene.
    """
    scene = settings.scene

    def of_case(path: str, value: float) -> Array:
        return spread(varying, path, value, count)

    mechanical, thermal = structure.input_sizes

    def of_node(path: str, value: Values, size: int = mechanical) -> Array:
        if path in varying:
            return np.repeat(np.asarray(varying[path], dtype=np.float64)[:, None], size, axis=1)
        return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (count, size)))

    load, (load_harmonics, casing) = scene.load, sinusoids_of(scene, varying, count)
    initial = Initial() if scene.initial == "static" else scene.initial  # see at_rest
    begins = EndState(
        of_node("scene.initial.displacement", initial.displacement),
        of_node("scene.initial.velocity", initial.velocity),
        of_node("scene.initial.temperature", initial.temperature, thermal),
    )
    if start is not None:
        begins, load_harmonics = EndState(*start[:3]), load_harmonics.turned(start.load_turns)
        casing = casing.turned(start.casing_turns)
    reads = schemes.load(settings.scheme.method).READS
    given = Cases(
        e=of_case("e", settings.e) if "e" in reads else np.full(count, np.nan),
        alpha=alpha_of(settings, varying, count),
        gaps=gaps_of(scene.casing, structure.contacts.labels, varying, count),
        mean=of_case("scene.load.mean", load.mean),
        steady=of_node("scene.load.steady", load.steady),
        heating=of_node(f"scene.{scene.model}.heating", heat_load(scene.parameters), thermal),
        **begins._asdict(),
        load_harmonics=load_harmonics,
        casing_harmonics=casing,
        friction=friction_of(settings, structure, varying, count),
        turns=turns_of(scene, structure, varying, count),
        offset=offset_of(structure, count),
        coating=_coating_of(scene, structure, varying, count, start),
    )
    return structure.received(given)


def _coating_of(
    scene: Scene, structure: Structure, varying: Mapping[str, Array], count: int, start: Start | None
) -> Coating | None:
    """Return the coating of each case, unworn or as it is at the start; ``None`` without one."""
    own = scene.casing.coating
    if own is None:
        return None
    numbers = coating_numbers(scene, varying, count)
    sectors, turns = numbers["sectors"], angles_of(scene, structure, varying, count) / (2 * np.pi)
    worn = np.zeros((*turns.shape, int(sectors.max())))
    if start is not None:
        turns, worn = turns + start.sector_turns[:, None], start.worn[..., : worn.shape[2]]
    return Coating(**numbers, turns=turns, worn=worn)


def coating_numbers(scene: Scene, varying: Mapping[str, Array], count: int) -> dict[str, Array]:
    """Return yield force, hardening, sectors and speed of each case with a coating, ``(case,)``, by name."""
    own, above = scene.casing.coating, "scene.casing.coating"
    names = ("yield_force", "hardening", "sectors")
    numbers = {name: spread(varying, f"{above}.{name}", getattr(own, name), count) for name in names}
    return numbers | {"speed": spread(varying, "scene.speed", scene.speed, count)}


def spread(varying: Mapping[str, Array], path: str, value: float, count: int) -> Array:
    """Return a number of each case, ``(case,)``: the values along its axis, or one for all."""
    return np.array(np.broadcast_to(varying.get(path, np.float64(value)), (count,)), dtype=np.float64)


def alpha_of(settings: CaseSettings, varying: Mapping[str, Array], count: int) -> Array:
    """Return α of each case, W/N, ``(case,)``: heat_share · coefficient · sliding_speed where a scene has these."""
    friction = settings.scene.friction
    if not settings.scene.makes_alpha:
        return spread(varying, "alpha", settings.alpha, count)
    share, coefficient, speed = (
        spread(varying, f"{FRICTION}{name}", getattr(friction, name), count)
        for name in ("heat_share", "coefficient", "sliding_speed")
    )
    return share * coefficient * speed


def friction_of(settings: CaseSettings, structure: Structure, varying: Mapping[str, Array], count: int) -> Array:
    """Return µ of each case, 1, ``(case,)``; 0 without a direction of sliding or without friction."""
    if not structure.contacts.slides or settings.scene.friction is None:
        return np.zeros(count)
    return spread(varying, f"{FRICTION}coefficient", settings.scene.friction.coefficient, count)


def offset_of(structure: Structure, count: int) -> Array:
    """Return what constant loads of a file move its contacts by beside its modes, m, ``(case, contact)``."""
    own = structure.contacts.residual_steady
    return np.tile(np.zeros(structure.contacts.count) if own is None else own, (count, 1))


def turns_of(scene: Scene, structure: Structure, varying: Mapping[str, Array], count: int) -> Array:
    """Return order · ψ_i of the casing's harmonics, 0 of those by a frequency, rad, ``(case, contact, harmonic)``."""
    angles = angles_of(scene, structure, varying, count)
    turns = np.zeros((*angles.shape, len(scene.casing.harmonics)))
    for k, entry in enumerate(scene.casing.harmonics):
        if entry.order is not None:
            order = spread(varying, f"scene.casing.harmonics.{k}.order", entry.order, count)
            turns[:, :, k] = order[:, None] * angles
    return turns


def angles_of(scene: Scene, structure: Structure, varying: Mapping[str, Array], count: int) -> Array:
    """Return ψ_i of the contacts, rad, ``(case, contact)``."""
    own = structure.contacts.angle
    angles = np.asarray(own if scene.casing.angles is None else scene.casing.angles)
    if "scene.casing.angles" in varying:
        angles = varying["scene.casing.angles"][:, None]
    return np.array(np.broadcast_to(angles, (count, own.size)))


def sinusoids_of(scene: Scene, varying: Mapping[str, Array], count: int) -> tuple[Harmonics, Harmonics]:
    """Return the harmonics of load and casing of each case; that of ``scene.load`` itself is the load's first."""
    rows = (
        spread(varying, f"scene.load.{name}", getattr(scene.load, name), count)[:, None]
        for name in ("amplitude", "frequency", "phase")
    )
    load, casing = (harmonics_of(scene, group, varying, count) for group in ("load", "casing"))
    return Harmonics(*rows).joined(load), casing


def harmonics_of(scene: Scene, group: Literal["load", "casing"], varying: Mapping[str, Array], count: int) -> Harmonics:
    """Return the listed harmonics of load or casing of each case; an ``order`` is a multiple of ``scene.speed``."""
    entries: Sequence[Any] = scene.load.harmonics if group == "load" else scene.casing.harmonics
    speed = spread(varying, "scene.speed", scene.speed, count)
    rows: dict[str, list[Array]] = {"amplitude": [], "frequency": [], "phase": []}
    for k, entry in enumerate(entries):
        for name, row in rows.items():
            named = "order" if name == "frequency" and entry.order is not None else name
            value = spread(varying, f"scene.{group}.harmonics.{k}.{named}", getattr(entry, named), count)
            row.append(value * speed if named == "order" else value)
    return Harmonics(*(np.array(row).reshape(len(entries), count).T for row in rows.values()))


def heat_load(parameters: Any) -> Values:
    """Return the constant heat load of a model's parameters, W; 0 of a model that declares no ``heating``."""
    declared = {entry.name for entry in dataclasses.fields(parameters)}
    value: Values = parameters.heating if "heating" in declared else 0.0
    return value


SHARE = 1e-12
"""Relative change of the data: ten thousand roundings, some of which other libraries make otherwise."""


@dataclass(frozen=True)
class Perturbation:
    """A change of all data of a case but its discretisation, in one of two directions."""

    direction: int
    """1 or -1."""
    reach: float
    """Largest displacement of the tip, m: the gap changes by :data:`SHARE` of it, also where it is 0."""


def cases_of(
    settings: CaseSettings,
    varying: Mapping[str, Array],
    count: int,
    perturbation: Perturbation | None = None,
    start: Start | None = None,
) -> tuple[CaseSettings, Cases]:
    """Return settings, and their cases on the full structure, both with their data changed if asked.

    See :func:`workflow.cases._conditions.conditions`; settings of cases with a ``start`` have no static one.
    """
    if start is not None:
        settings = replace(settings, scene=replace(settings.scene, initial=Initial()))
    if perturbation is None:
        return settings, conditions(settings, full_structure(settings), varying, count, start)
    share, scene = perturbation.direction * SHARE, settings.scene
    settings = replace(settings, scene=replace(scene, parameters=_changed(scene.parameters, share)))
    structure = full_structure(settings)
    cases = conditions(settings, structure, varying, count, start)
    return settings, perturbed(cases, share, perturbation.reach, structure.input_contacts)


def _changed(value: Any, share: float) -> Any:
    """Return numbers changed by a share of them, neighbours in opposite directions; counts and words as they are.

    Numbers in a file are changed by the model that reads them.
    """
    if isinstance(value, float):
        return value * (1 + share)
    if isinstance(value, tuple):
        return tuple(_changed(item, share if k % 2 == 0 else -share) for k, item in enumerate(value))
    if isinstance(value, File):
        return replace(value, shaken=share)
    if is_dataclass(value) and not isinstance(value, type):
        named = [field.name for field in fields(value) if field.init]
        changed = {
            name: _changed(getattr(value, name), share if k % 2 == 0 else -share) for k, name in enumerate(named)
        }
        return replace(value, **changed)
    return value
