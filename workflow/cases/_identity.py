"""Identity of a case: what its results depend on, hashed; never where it stands in a grid."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import schemes
from workflow.cases._arrangement import TOLERANCE, Grid, Indices
from workflow.cases._conditions import (
    FRICTION,
    alpha_of,
    angles_of,
    coating_numbers,
    friction_of,
    harmonics_of,
    heat_load,
    turns_of,
)
from workflow.cases._reference import exact_settings, reference_settings
from workflow.cases._structures import full_structure
from workflow.declare import plain
from workflow.judges.trials import EXACT
from workflow.reduction import DEFAULT
from workflow.registry import outside_sources
from workflow.schemes import SOLVER_VERSION
from workflow.study import GAP, GAP_OF, Branch, CaseSettings, Scene, Study, gaps_of

HASH_BYTES = 16
"""Of the SHA-256: two of 1e8 cases share their first 128 bits with a probability of 1e-23."""

_CONDITIONS = tuple(f"scene.load.{name}" for name in ("mean", "amplitude", "frequency", "phase"))
_PER_NODE = ("scene.load.steady", *(f"scene.initial.{name}" for name in ("displacement", "velocity", "temperature")))


_AT_ONCE = 50_000
"""Cases of an outer index whose conditions are in memory at once."""


def case_hashes(grid: Grid) -> NDArray[np.uint8]:
    """Return the hash of every case in archive order, ``(case, HASH_BYTES)``, see :func:`hashes_of`."""
    hashes = np.empty((grid.outer_count, grid.inner_count, HASH_BYTES), np.uint8)
    at_once = max(1, _AT_ONCE // grid.points) * grid.points  # whole lines
    for first in range(0, grid.inner_count, at_once):
        inner = np.arange(first, min(first + at_once, grid.inner_count), dtype=np.int64)
        for outer in range(grid.outer_count):
            hashes[outer, inner] = hashes_of(grid, outer, inner)
    return hashes.reshape(-1, HASH_BYTES)


def hashes_of(grid: Grid, outer: int, inner: Indices) -> NDArray[np.uint8]:
    """Return the hashes of some cases of an outer index, ``(case, HASH_BYTES)``.

    A hash covers the solver's version, which stands for the sources of this package, and the sources of modules from
    outside that the case uses; model, conditions, duration and sampling; the scheme with its options, those of e, h
    and α that it reads, basis and mode counts (those that a tolerance decided, with the error that was found); what is
    asked of steady rubs, temperatures over a depth, sensors, events and wear; balances, which cases of fixed steps are
    judged by; and the reference in the same way: values in SI, to the bit. Labels, titles, the place in the grid, the
    precision and which histories are stored do not enter.

    A point of a sweep has the hash of that of the point before and of its own; ``inner`` are whole lines then.
    """
    if grid.points == 1:
        return _hashes_at(grid, outer, grid.settings(outer), inner)
    lines = inner.reshape(-1, grid.points)
    hashes = np.empty((*lines.shape, HASH_BYTES), np.uint8)
    for point, some in enumerate(lines.T):
        hashes[:, point] = _hashes_at(grid, outer, grid.at_point(outer, point), some)
        for line in hashes if point else ():
            chained = hashlib.sha256(line[point - 1].tobytes() + line[point].tobytes()).digest()
            line[point] = np.frombuffer(chained[:HASH_BYTES], np.uint8)
    return hashes.reshape(-1, HASH_BYTES)


def _hashes_at(grid: Grid, outer: int, settings: CaseSettings, inner: Indices) -> NDArray[np.uint8]:
    """Return the hashes of some cases that have the same settings but for what varies within a batch."""
    prefix = hashlib.sha256(json.dumps(_shared(grid, outer, settings), sort_keys=True).encode())
    rows = _rows(grid, outer, settings, grid.inner_values(inner), inner.size)
    content, size, digests = rows.tobytes(), rows.strides[0], bytearray()
    for begin in range(0, len(content), size):
        digest = prefix.copy()
        digest.update(content[begin : begin + size])
        digests += digest.digest()[:HASH_BYTES]
    return np.frombuffer(digests, np.uint8).reshape(-1, HASH_BYTES)


def _shared(grid: Grid, outer: int, settings: CaseSettings) -> dict[str, Any]:
    """Return what all cases of an outer index share: all but the numbers of :func:`_rows`."""
    reference, choice, of_reference = grid.study.reference, grid.choice(outer), grid.reference_choice(outer)
    return {
        "solver": SOLVER_VERSION,
        "duration": grid.sampling.duration,
        "interval": grid.sampling.interval,
        "run": _numerics(settings, _read(settings)),
        "reference": None if reference is None else _numerics(reference_settings(grid, outer), frozenset({"h"})),
        **_widths(settings.scene),
        **({} if (depth := grid.study.output.temperature_depth) is None else {"temperature_depth": depth.hex()}),
        **_steady(grid.study, settings),
        **({} if grid.sampling.balances or "h" not in _read(settings) else {"balances": False}),
        **({} if not (sensors := grid.study.output.sensors) else {"sensors": [plain(one) for one in sensors.values()]}),
        **_events(grid.study, settings),
        **({} if (wear := grid.study.output.wear) is None else {"wear": plain(wear)}),
        **({} if choice is None else {"basis_error": choice.error.hex()}),
        **({} if of_reference is None else {"reference_basis_error": of_reference.error.hex()}),
        **({} if choice is None or reference is None else {"tolerance": float(grid.value(outer, TOLERANCE))}),
        "lists": {path: value for path, value in _per_node(settings).items() if not isinstance(value, float)},
    }


def _events(study: Study, settings: CaseSettings) -> dict[str, Any]:
    """Return how many events are listed, which event_driven alone has."""
    most = study.output.events
    return {} if most is None or settings.scheme.method != EXACT else {"events": most}


def _steady(study: Study, settings: CaseSettings) -> dict[str, Any]:
    """Return what is asked of steady rubs, which event_driven alone has, and the axis that is followed."""
    if study.output.steady is None or settings.scheme.method != EXACT:
        return {}
    asked = {"steady": plain(study.output.steady)}
    branch = study.branch
    if branch is not None:
        asked["branch"] = _followed(branch)
    if study.uncertain:
        asked["uncertain"] = list(study.uncertain)  # the order of their rows
    if study.boundary is not None:
        asked["boundary"] = _followed(study.boundary)
    return asked


def _followed(branch: Branch) -> list[Any]:
    return [branch.axis.path, *(float(end).hex() for end in branch.axis.values), branch.points]


def _widths(scene: Scene) -> dict[str, Any]:
    """Return the numbers of load and casing harmonics, which decide what the entries of a row mean, and the profile."""
    widths = len(scene.load.harmonics), len(scene.casing.harmonics)
    casing, own = scene.casing, dict[str, Any]()
    own |= {"gaps": len(casing.gap)} if isinstance(casing.gap, tuple) else {}
    own |= {} if casing.profile is None else {"profile": plain(casing.profile)}
    return {**({"harmonics": widths} if any(widths) else {}), **own}


def _read(settings: CaseSettings) -> frozenset[str]:
    return schemes.load(settings.scheme.method).READS


def _numerics(settings: CaseSettings, read: frozenset[str]) -> dict[str, Any]:
    parameters = plain(settings.scene.parameters)
    parameters.pop("heating", None)  # a condition
    flexibility = settings.scene.casing.flexibility
    named = {settings.scene.model, settings.scheme.method, settings.reduction}
    outside = {name: source for name, source in outside_sources().items() if name in named}
    return {
        "model": settings.scene.model,
        "parameters": parameters,
        "method": settings.scheme.method,
        "options": plain(settings.scheme.options),
        "modes": [settings.mechanical_modes, settings.thermal_modes],
        **({"outside": outside} if outside else {}),
        **({"casing_flexibility": flexibility} if flexibility else {}),
        "h": float(settings.h).hex() if "h" in read else None,
        **({} if settings.reduction == DEFAULT else {"reduction": settings.reduction}),  # of old it was the only one
    }


def _per_node(settings: CaseSettings) -> dict[str, Any]:
    """Return the conditions that may be given per node: a number, or a list of them, or ``static``."""
    scene, values = settings.scene, {}
    for path in (*_PER_NODE, f"scene.{settings.scene.model}.heating"):
        *_, group, name = path.split(".")
        owner: Any = {"load": scene.load, "initial": scene.initial}.get(group)
        value = heat_load(scene.parameters) if owner is None else owner if owner == "static" else getattr(owner, name)
        values[path] = float(value) if isinstance(value, int | float) else value
    return values


def _is_summed_up(path: str) -> bool:
    """Tell whether results depend on an axis through α, µ, the harmonics or the casing alone."""
    return path == "scene.speed" or path.startswith((FRICTION, "scene.load.harmonics.", "scene.casing."))


def _of_casing(settings: CaseSettings, contacts: Sequence[str], varying: Any, count: int) -> dict[str, Any]:
    """Return the conditions at the casing by name, ``(case,)`` each.

    They are gap + clearance of each contact that has its own, by what it is turned, and the coating.
    """
    casing, columns = settings.scene.casing, dict[str, Any]()
    if isinstance(casing.gap, tuple):
        gaps = gaps_of(casing, contacts, varying, count)
        columns |= {f"{GAP_OF}{k}": gap for k, gap in enumerate(gaps.T)}
    else:
        columns[GAP] = gaps_of(casing, ("",), varying, count)[:, 0]
    if any(entry.order is not None for entry in casing.harmonics):
        structure = full_structure(settings)
        if casing.angles is not None or not structure.contacts.is_one_with_mass:
            turns = turns_of(settings.scene, structure, varying, count)
            columns |= {f"scene.casing.turns.{k}": column for k, column in enumerate(turns.reshape(count, -1).T)}
    if casing.coating is not None:
        numbers = coating_numbers(settings.scene, varying, count)
        angles = angles_of(settings.scene, full_structure(settings), varying, count)
        columns |= {f"scene.casing.coating.{name}": column for name, column in numbers.items()}
        columns |= {f"scene.casing.coating.angle.{k}": column for k, column in enumerate(angles.T)}
    return columns


def _harmonic_columns(scene: Scene, varying: Any, count: int) -> dict[str, Any]:
    """Return amplitude, frequency and phase of all harmonics by name, ``(case,)`` each; orders as frequencies."""
    by_name: dict[str, Any] = {}
    for group in ("load", "casing"):
        harmonics = harmonics_of(scene, group, varying, count)
        for name in ("amplitude", "frequency", "phase"):
            columns = getattr(harmonics, name).T
            by_name |= {f"scene.{group}.harmonics.{k}.{name}": column for k, column in enumerate(columns)}
    return by_name


def _rows(grid: Grid, outer: int, settings: CaseSettings, varying: Any, count: int) -> NDArray[np.float64]:
    """Return the conditions of every case that are numbers, ``(case, condition)``; those not read are 0."""
    scene, reference = settings.scene, grid.study.reference
    read = _read(settings)
    values: dict[str, Any] = {path: getattr(scene.load, path.rsplit(".", 1)[1]) for path in _CONDITIONS}
    values |= {path: value if isinstance(value, float) else 0.0 for path, value in _per_node(settings).items()}
    values |= {"e": settings.e}
    values |= {path: value for path, value in varying.items() if not _is_summed_up(path)}
    values |= _of_casing(settings, grid.study.contacts, varying, count)
    values |= {"alpha": alpha_of(settings, varying, count), **_harmonic_columns(scene, varying, count)}
    if scene.friction is not None:
        structure = full_structure(settings)
        values |= {"friction": friction_of(settings, structure, varying, count)} if structure.contacts.slides else {}
    columns = [values[path] for path in sorted(set(values) - {"e", "alpha"})]
    columns += [values[name] if name in read else 0.0 for name in ("e", "alpha")]
    if reference is not None:
        reads = _read(reference_settings(grid, outer)) | _read(exact_settings(grid, outer))
        columns += [reference.values.get(name, values[name]) if name in reads else 0.0 for name in ("e", "alpha")]
    rows = np.empty((count, len(columns)))
    for k, column in enumerate(columns):
        rows[:, k] = column
    return rows + 0.0  # -0.0 is 0.0
