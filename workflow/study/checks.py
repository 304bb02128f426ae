"""Checks across fields of a study: a start inside the casing, far too many steps, values that exclude each other."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from decimal import Decimal
from fractions import Fraction
from functools import partial
from itertools import chain, islice, product
from typing import Any

import numpy as np

from workflow import models, reduction, schemes
from workflow.declare import quantity_of
from workflow.models import AT_BORDER
from workflow.study.axes import Sizes
from workflow.study.mistakes import Fault, Place, one_of, place_of_path, quoted
from workflow.study.settings import (
    CHOSEN,
    FULL,
    MODES,
    TOLERANCE,
    CaseSpace,
    CasingHarmonic,
    Initial,
    LoadHarmonic,
    gaps_of,
)
from workflow.study.source import GAP, GAP_OF, StudyText
from workflow.variables import BY_NAME

MOST_SAMPLES = 2_000_000
"""Samples of a history, and load periods of a case: 16 MB of memory for each variable of each case."""

MOST_STEPS = 10**12
"""Steps of a case: at 10 ns a step about three hours of one core."""

MOST_COMBINATIONS = 10**7
"""Combinations of start and casing that are judged before a study runs."""

_ONE_OF_TWO = "write one of the two"
_CASING_HARMONICS, _FLEXIBILITY = "scene.casing.harmonics", "scene.casing.flexibility"
_GAPS = (GAP, "scene.casing.clearance")


def faults(cases: CaseSpace, sizes: Sizes, source: StudyText) -> Iterator[Fault]:
    """Yield what is wrong between the fields of a study."""
    yield from _auto(cases, source)
    yield from [*_model(cases, source), *_lists(cases, sizes)] or _mesh(cases)
    yield from _harmonics(cases, source)
    yield from _friction(cases, sizes, source)
    yield from _contacts(cases, sizes, source)
    yield from _elastic(cases, source)
    yield from _coating(cases, source)
    yield from _support(cases, source)
    yield from _sensors(cases, sizes)
    yield from _branch(cases)
    yield from _speed(cases, source)
    yield from _sweep(cases, source)
    yield from _start(cases, sizes, source)
    yield from _stops(cases, sizes, source)
    yield from _extent(cases, source)
    yield from _interval(cases)


def _auto(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse `auto` without a tolerance, which has no default, and one of the reference that decides nothing."""
    problem = "is `auto` without a `tolerance`"
    if cases.reference is not None:
        values = cases.reference.values
        path = next((path for path in MODES if values.get(path) == CHOSEN), None)
        if path is not None and TOLERANCE not in values:
            yield ("reference", path), problem, "write e.g. `tolerance: 1e-8` beside it"
        if path is None and TOLERANCE in values:
            remedy = f"write `auto` for {' and '.join(MODES)} of the reference, or leave it out"
            yield ("reference", TOLERANCE), "decides nothing, as no count of modes is `auto`", remedy
    if TOLERANCE not in source.axes:
        for axis in cases.axes():
            if axis.path in MODES and CHOSEN in axis.values:
                yield source.axes[axis.path], problem, "write e.g. `tolerance: 1e-3` under `axes`"


def _model(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse parameters of which the model takes one, where there are none or two, and a ratio beside other damping."""
    model, parameters = cases.scene.model, cases.scene.parameters
    either = getattr(models.load(model), "EITHER", None)
    if either is not None:
        yield from _either(("scene", model), parameters, either)
    damping, path = getattr(parameters, "damping", None), f"scene.{model}.damping"
    if dataclasses.is_dataclass(damping) and source.has(f"{path}.ratio"):
        others = (entry.name for entry in dataclasses.fields(damping) if entry.name != "ratio")
        if any(source.has(f"{path}.{name}") for name in others):
            remedy = "write the ratio alone, or mass and stiffness"
            yield place_of_path(f"{path}.ratio"), "stands beside other damping", remedy


def _either(place: Place, owner: Any, names: tuple[str, str]) -> Iterator[Fault]:
    """Refuse a mapping that has none or both of two keys."""
    given = [name for name in names if getattr(owner, name) is not None]
    if len(given) == 2:
        yield place, f"has both `{names[0]}` and `{names[1]}`", _ONE_OF_TWO
    elif not given:
        yield place, f"has neither `{names[0]}` nor `{names[1]}`", _ONE_OF_TWO


def _mesh(cases: CaseSpace) -> Iterator[Fault]:
    """Refuse cells that are no blade, and a depth that the structure of some case does not have."""
    model, depth, deepest = cases.scene.model, cases.output.temperature_depth, math.inf
    for parameters in _meshes(cases) if depth is not None or hasattr(cases.scene.parameters, "tip_cell") else ():
        try:
            deepest = min(deepest, float(np.sum(getattr(models.structure_of(model, parameters), "lengths", 0.0))))
        except models.UnusableMatricesError as error:
            yield ("scene", model, "tip_cell"), error.problem, error.remedy
            return
    if depth is not None and depth > deepest:
        problem = f"of {depth:g} m is deeper than the {deepest:.6g} m of `{model}`"
        remedy = "write less, or leave it out: only `blade`, and `chain` with `spacing`, have a depth"
        yield ("output", "temperature_depth"), problem, remedy


def _meshes(cases: CaseSpace) -> Iterator[Any]:
    """Yield the parameters of the model in combinations of the axes that decide its mesh, at most 10 000."""
    paths = {f"scene.{cases.scene.model}.{name}": name for name in ("nodes", "length", "tip_cell", "spacing")}
    groups = [[axis for axis in dimension.axes if axis.path in paths] for dimension in cases.dimensions]
    names = [paths[axis.path] for group in groups for axis in group]
    rows = (dict.fromkeys(zip(*(axis.values for axis in group), strict=True)) for group in groups if group)
    for row in islice(product(*rows), 10_000):
        yield dataclasses.replace(cases.scene.parameters, **dict(zip(names, chain(*row), strict=True)))


def _lists(cases: CaseSpace, sizes: Sizes) -> Iterator[Fault]:
    """Refuse lists whose number of values is not that of the nodes, springs or temperatures of every case."""
    scene = cases.scene
    owners = {scene.model: scene.parameters, "load": scene.load, "initial": scene.initial, "casing": scene.casing}
    for group, owner in owners.items():
        for entry in dataclasses.fields(owner) if dataclasses.is_dataclass(owner) else ():
            declared, value = quantity_of(entry), getattr(owner, entry.name)
            if declared is None or declared.per is None or not isinstance(value, tuple):
                continue
            counts = sizes.inputs.get(declared.per, ())
            count = next((count for count in counts if count != len(value)), None)
            if count is not None:
                varies = len(set(counts)) > 1
                some = " in some case" if varies else ""
                problem = f"has {len(value)} values where the model has {count} {declared.per}s{some}"
                remedy = "write a scalar" if varies or count == 1 else f"write a scalar or {count} values"
                yield ("scene", group, entry.name), problem, remedy


def _harmonics(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse harmonics without one frequency, and orders, as those of a profile, without a speed."""
    speed = "write `speed` in the scene, e.g. `speed: 9000 rpm`"
    if cases.scene.casing.profile is not None and not source.has("scene.speed"):
        yield ("scene", "casing", "profile"), "turns at a speed that is not given", speed
    for group, harmonics in _harmonics_of(cases).items():
        for k, harmonic in enumerate(harmonics):
            place: Place = ("scene", group, "harmonics", k)
            yield from _either(place, harmonic, ("frequency", "order"))
            order = f"scene.{group}.harmonics.{k}.order"
            if harmonic.frequency is None and source.has(order) and not source.has("scene.speed"):
                remedy = f"{speed}, or `frequency` in the place of `order`"
                yield source.place_of(order), "is a multiple of a speed that is not given", remedy


def _harmonics_of(cases: CaseSpace) -> dict[str, tuple[LoadHarmonic | CasingHarmonic, ...]]:
    return {"casing": cases.scene.casing.harmonics, "load": cases.scene.load.harmonics}


def _friction(cases: CaseSpace, sizes: Sizes, source: StudyText) -> Iterator[Fault]:
    """Refuse an alpha beside the friction that makes it, and µ with which R - µ R^t is not positive definite."""
    contacts, friction = sizes.rows, cases.scene.friction
    if friction is not None:
        path, other = "scene.friction.coefficient", "sliding_speed" if friction.sliding_speed is None else "heat_share"
        if (friction.sliding_speed is None) != (friction.heat_share is None):
            remedy = f"write `{other}` too, or the coefficient alone and alpha under `axes`"
            yield ("scene", "friction"), f"has no `{other}`, and makes no alpha", remedy
        if contacts.is_massless:
            most = max(map(float, cases.each(path)))
            flexibility = contacts.flexibility(most)
            if np.linalg.eigvalsh(flexibility + flexibility.T)[0] / 2 + min(map(float, cases.each(_FLEXIBILITY))) <= 0:
                problem = f"{most:g} makes the symmetric part of R - µ R^t, the residuals of contacts, indefinite"
                yield source.place_of(path), problem, "write less, or check `residual_tangent`"
        reference = {} if cases.reference is None else cases.reference.values
        beside = [source.axes["alpha"]] if "alpha" in source.axes else []
        beside += [("reference", "alpha")] if "alpha" in reference else []
        for place in beside if cases.scene.makes_alpha else ():
            remedy = "keep one, as alpha = heat_share · coefficient · sliding_speed, or the coefficient alone"
            yield place, "stands beside `scene.friction`, from which it follows", remedy


def _steps(cases: CaseSpace) -> tuple[float, ...]:
    """Return the time steps of all cases; none where no scheme reads them."""
    used = (schemes.load(cases.schemes[str(label)].method) for label in cases.each("scheme"))
    return tuple(map(float, cases.each("h"))) if any("h" in scheme.READS for scheme in used) else ()


def _support(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse schemes that do not take the harmonics of a scene."""
    casing, load = (bool(harmonics) for harmonics in _harmonics_of(cases).values())
    where = source.axes.get("scheme", ("scene", "casing" if casing else "load", "harmonics"))
    named: list[tuple[Place, str]] = [(where, str(label)) for label in cases.each("scheme")]
    if cases.reference is not None and "scheme" in cases.reference.values:
        named.append((("reference", "scheme"), str(cases.reference.values["scheme"])))
    for place, label in named:
        scheme = schemes.load(cases.schemes[label].method)
        reason = scheme.cannot_take(load, casing)
        if reason is not None:
            yield place, f"`{label}` {reason}", "name another scheme, or leave `harmonics` out"
        is_coated = cases.scene.casing.coating is not None
        is_elastic = _is_elastic(cases) and not is_coated
        for word, asked, problem in (
            ("contacts", cases.contacts, f"takes one contact, and the structure has {len(cases.contacts)}"),
            ("elastic", is_elastic, "takes a rigid casing, and this one has a `flexibility`"),
            ("coating", is_coated, "takes a casing without `coating`"),
        ):
            if asked and word not in scheme.GENERAL:
                able = [name for name in schemes.names() if not schemes.fault(name)]
                able = [name for name in able if word in schemes.load(name).GENERAL]
                yield place, f"`{label}` {problem}", f"write {' or '.join(able)}"


def _contacts(cases: CaseSpace, sizes: Sizes, source: StudyText) -> Iterator[Fault]:
    """Refuse other contacts along an axis, and what is of one with mass where there are several, or one without."""
    for path in _own_gaps(source):
        label, place = path.removeprefix(GAP_OF), source.axes[path]
        if label not in cases.contacts:
            known = one_of(label, cases.contacts) if cases.contacts else f"write `{GAP}`: there is one contact"
            yield place, f"{quoted(label)} is no contact of several", known
        elif GAP in source.axes or cases.scene.casing.profile is not None:
            remedy = "vary `scene.casing.clearance`, or the gap of each contact"
            yield place, f"stands beside {'`profile`' if cases.scene.casing.profile else f'`{GAP}`'}", remedy
    for path, end in sizes.ends.items():
        both = sizes.rows.labels, end.contacts.labels
        if max(map(len, both)) > 1 and both[0] != both[1]:
            yield source.axes[path], "has other contacts at its end", "write a study for each choice of contacts"
    if sizes.structure is None or sizes.rows.is_one_with_mass:
        return
    several = (
        f"and the structure has {len(cases.contacts)} contacts" if cases.contacts else "and its contact has no mass"
    )
    yield from _reduced_contacts(cases, sizes, source, several)
    acts = any(axis.path.startswith("scene.load.") and "steady" not in axis.path for axis in cases.axes())
    load = cases.scene.load
    if not np.any(sizes.structure.load_direction) and (acts or load.mean or load.amplitude or load.harmonics):
        remedy = "give the file an entry `load`, the vector it acts along"
        yield ("scene", "load"), f"has no direction, {several}", remedy


def _sensors(cases: CaseSpace, sizes: Sizes) -> Iterator[Fault]:
    """Refuse sensors that the structure does not have, the smallest one where nodes vary, or named as a variable."""
    model, parameters = cases.scene.model, cases.scene.parameters
    if sizes.structure is None and hasattr(parameters, "nodes"):
        parameters = dataclasses.replace(parameters, nodes=min(sizes.inputs["node"]))
    for name, sensor in cases.output.sensors.items():
        place = ("output", "sensors", name)
        if name in BY_NAME:
            yield place, "is the name of a variable", "choose another name"
        try:
            models.sensors_of(model, parameters, (sensor,))
        except models.UnusableMatricesError as error:
            yield place, error.problem, error.remedy
        except Exception:  # whatever else a model raises: its other faults, or its cases, say it
            return


def _is_elastic(cases: CaseSpace) -> bool:
    return any(cases.each(_FLEXIBILITY))


def _elastic(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse what takes a rigid casing only, where the casing is elastic, or worn."""
    if not _is_elastic(cases):
        return
    is_coated = cases.scene.casing.coating is not None
    key = "coating" if is_coated else "flexibility"
    of_rigid = (
        "takes a casing without `coating`" if is_coated else "takes a rigid casing, and this one has a `flexibility`"
    )
    if cases.is_auto:
        yield ("axes", "tolerance"), of_rigid, "write counts of modes"
    if cases.output.temperature_depth is not None:
        yield ("output", "temperature_depth"), of_rigid, f"leave it out, or the {key}"
    if is_coated and cases.branch is not None:
        yield ("axes", cases.branch.axis.path), of_rigid, f"write a list, or leave the {key} out"
    elif is_coated and cases.output.steady is not None:
        yield ("output", "steady"), of_rigid, f"leave it out, or the {key}"


def _coating(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse a coating on a rigid casing, sectors of a casing that does not turn, and a map of either."""
    coating, speeds = cases.scene.casing.coating, cases.each("scene.speed")
    turn = "write `speed` in the scene, e.g. `speed: 9000 rpm`"
    if coating is not None and 0.0 in cases.each(_FLEXIBILITY):
        remedy = "write `flexibility` beside it, that of casing and coating before it is worn, e.g. `flexibility: 1e-7`"
        yield ("scene", "casing", "coating"), "lies on a rigid casing", remedy
    path = "scene.casing.coating.sectors"
    if coating is not None and max(map(float, cases.each(path))) > 1 and 0.0 in speeds:
        yield source.place_of(path), "are of a casing that does not turn", f"{turn}, or `sectors: 1`"
    if cases.output.wear is not None and (coating is None or 0.0 in speeds):
        problem = "maps a coating, and the casing has none" if coating is None else "counts revolutions at no speed"
        yield ("output", "wear"), problem, "leave it out, or write `coating`" if coating is None else turn
    elif cases.output.wear is not None:
        revolutions = int(cases.scene.duration * max(map(float, speeds)) + AT_BORDER)
        if cases.output.wear.every > revolutions:
            problem = f"maps every {cases.output.wear.every} revolutions of a case that has {revolutions}"
            yield ("output", "wear"), problem, "write fewer, or a longer duration"


def _reduced_contacts(cases: CaseSpace, sizes: Sizes, source: StudyText, several: str) -> Iterator[Fault]:
    """Refuse bases that do not take several contacts, or one without mass, and counts of modes that leave out one."""
    contacts = sizes.rows
    values: dict[str, set[Any]] = {axis.path: set(axis.values) for axis in cases.axes()}
    for path, value in {} if cases.reference is None else cases.reference.values.items():
        values.setdefault(path, set()).add(value)

    def place(path: str) -> Place:
        return source.axes.get(path, ("reference", path))

    is_reduced = False
    for path, own in zip(MODES, models.independent_rows(contacts), strict=True):
        size = min(sizes.coordinates[path])
        counts = values[path] - {FULL, *(count - 1 for count in sizes.coordinates[path])}
        is_reduced |= bool(counts)
        counts -= {CHOSEN}
        if max(counts, default=0) > size - own:
            remedy = f"write at most {size - own}, or `full`"
            yield place(path), f"{max(counts)} is more than the {size - own} interior modes, {several}", remedy
    able = [name for name in reduction.names() if not reduction.fault(name) and reduction.takes(name, contacts)]
    for basis in sorted(values["reduction"] - set(able) if is_reduced else ()):
        where = source.axes.get("reduction", ("axes", "reduction"))
        yield where, f"`{basis}` takes one contact with mass, {several}", f"write {' or '.join(able)}"


def _branch(cases: CaseSpace) -> Iterator[Fault]:
    """Refuse a branch of other schemes than event_driven, or beside a reference, and what needs one without it."""
    path = None if cases.branch is None else cases.branch.axis.path
    remedy = "write `{branch: [from, to, count]}` for another number under `axes`"
    if cases.boundary is not None and path is None:
        yield ("axes", cases.boundary.axis.path), "is a boundary without a branch", remedy
    place: Place = ("output", "steady", "uncertain")
    if cases.uncertain and path is None:
        yield place, "moves bifurcations of a branch, and no axis is one", remedy
    for name in cases.uncertain:
        if name == path:
            yield (*place, name), "is the number that is branched", "name another number of the scene"
        elif cases.number_at(name) is None:
            yield (
                (*place, name),
                "is no number of this scene",
                "name one that the scene has; of a list one of its entries",
            )
    if cases.branch is None:
        return
    if {cases.schemes[str(label)].method for label in cases.each("scheme")} != {"event_driven"}:
        remedy = "write `scheme: event_driven` under `axes`, or a list in the place of the branch"
        yield ("axes", cases.branch.axis.path), "is a branch, which only event_driven follows", remedy
    if cases.reference is not None:
        yield ("reference",), "stands beside a branch, which has no errors", "leave it out"


def _speed(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse a branch over a speed that the structure depends on, and a speed above its critical one."""
    scene, path = cases.scene, "scene.speed"
    if not cases.depends_on_speed:
        return
    for law, followed in (("branch", cases.branch), ("boundary", cases.boundary)):
        if followed is not None and followed.axis.path == path:
            problem = f"is a {law} over the speed, on which the structure depends"
            yield ("axes", path), problem, "write a list in its place"
    fastest = max(scene.speed, *map(float, cases.each(path)))
    try:
        models.structure_of(scene.model, models.at_speed(scene.model, scene.parameters, fastest))
    except models.UnusableMatricesError as error:
        yield source.place_of(path), error.problem, error.remedy


def _sweep(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse a sweep beside what looks at single cases, and steps that do not end with the duration."""
    if cases.swept is None:
        return
    place: Place = ("axes", cases.swept.path)
    drawn = any(dimension.drawn for dimension in cases.dimensions)
    beside = {"a branch": cases.branch, "a reference": cases.reference, "`auto`": cases.is_auto, "drawn numbers": drawn}
    for what in (what for what, there in beside.items() if there):
        yield place, f"is a sweep beside {what}", "leave one of the two out, or write a list in the place of the sweep"
    duration = Fraction(repr(cases.scene.duration))
    for h in _steps(cases):
        count = duration / Fraction(repr(h))
        if abs(count - max(1, round(count))) > Fraction(1, 10**9):  # the tolerance of their number
            remedy = f"write e.g. {float(duration / max(1, round(count))):.12g} s"
            yield source.axes.get("h", ("h",)), f"{h!r} s does not divide the duration, as a sweep needs", remedy
            return


def _start(cases: CaseSpace, sizes: Sizes, source: StudyText) -> Iterator[Fault]:
    """Refuse a contact that starts inside the casing, beyond d(0), in some case; without mass it may."""
    initial, casing, structure = cases.scene.initial, cases.scene.casing, sizes.structure
    if not isinstance(initial, Initial) or _is_elastic(cases) or sizes.rows.is_compliant:
        return
    rows, angle = np.ones((1, 1)), np.zeros(1)
    if structure is not None:
        rows, angle = structure.input_contacts, structure.contacts.angle
    start, own = np.atleast_1d(initial.displacement)[-rows.shape[1] :], (casing.gap, casing.angles)
    if start.size not in (1, rows.shape[1]) or any(np.size(one or 0) not in (1, len(rows)) for one in own):
        return  # refused as a list of another length
    paths = ("scene.initial.displacement", GAP, "scene.casing.angles")
    values = _combined(cases, lambda path: path in paths or path.startswith((f"{_CASING_HARMONICS}.", *_GAPS)))
    if values is None:
        return

    each = partial(_each, values)
    tips = each(paths[0], 0.0) * rows.sum(axis=1) if paths[0] in values else (rows * start).sum(axis=1)
    gaps = gaps_of(casing, sizes.rows.labels, values, _count(values))
    angles = each(paths[2], angle if casing.angles is None else casing.angles)
    place = gaps + sum(_begins(harmonic, k, each, angles) for k, harmonic in enumerate(casing.harmonics))
    tips, place, gaps = np.broadcast_arrays(tips, place, gaps)
    inside = np.argmax(tips - place)
    x, begins, gap = (float(array.ravel()[inside]) for array in (tips, place, gaps))
    if x > begins:
        one = f"contact `{cases.contacts[inside % len(rows)]}`" if cases.contacts else "the tip"
        problem = f"{one} starts inside the casing, at {x!r} m with a gap of {gap!r} m"
        problem += "" if begins == gap else f" and the casing at {begins!r} m"
        yield (
            source.place_of(*paths[:1], *_own_gaps(source), GAP),
            problem,
            "start at or below the gap, or write `initial: static`",
        )


def _stops(cases: CaseSpace, sizes: Sizes, source: StudyText) -> Iterator[Fault]:
    """Refuse opposite stops w_j = -c w_i with mass unless d_j + c d_i > 0 at all times, by the amplitudes."""
    casing, contacts = cases.scene.casing, sizes.rows
    if contacts.is_massless or _is_elastic(cases):
        return
    if np.size(casing.gap) not in (1, contacts.count):
        return  # refused as a list of another length
    paths = [f"{_CASING_HARMONICS}.{k}.amplitude" for k in range(len(casing.harmonics))]
    values = _combined(cases, lambda path: path in paths or path.startswith(_GAPS))
    if values is None:
        return
    each = partial(_each, values)
    moves = sum(np.abs(each(path, one.amplitude)) for path, one in zip(paths, casing.harmonics, strict=True))
    least = gaps_of(casing, contacts.labels, values, _count(values)) - moves
    for i, j, ratio in contacts.opposite:
        room = float((least[:, j] + ratio * least[:, i]).min())
        if room <= 0:
            names = " and ".join(f"`{contacts.labels[k]}`" for k in (i, j))
            problem = f"contacts {names} are opposite stops {room!r} m apart where the casing is closest"
            yield source.place_of(*_own_gaps(source), GAP), problem, "write gaps that leave room between the two"


def _count(values: Mapping[str, Any]) -> int:
    """Return the number of combinations of the values of axes, 1 without any."""
    return next(map(len, values.values()), 1)


def _own_gaps(source: StudyText) -> list[str]:
    """Return the paths of the gaps of single contacts."""
    return [path for path in source.axes if path.startswith(GAP_OF)]


def _each(values: Mapping[str, Any], path: str, value: Any) -> Any:
    """Return the values of an axis along the combinations, before contacts, or what there is for all."""
    return values[path][:, None] if path in values else np.asarray(value)


def _combined(cases: CaseSpace, matters: Callable[[str], bool]) -> dict[str, Any] | None:
    """Return the values of some axes in all combinations, ``(combination,)``; ``None`` where they are too many."""
    of_dimensions = [dimension.axes for dimension in cases.dimensions]
    joint = {axis.path for axes in of_dimensions for axis in axes}
    groups = [*of_dimensions, *((axis,) for axis in cases.axes() if axis.path not in joint)]
    chosen = [group for group in groups if any(matters(axis.path) for axis in group)]
    shape = tuple(len(group[0].values) for group in chosen)
    if math.prod(shape) > MOST_COMBINATIONS:
        return None
    places = np.indices(shape).reshape(len(shape), math.prod(shape))
    return {
        axis.path: np.asarray(axis.values, dtype=np.float64)[index]
        for group, index in zip(chosen, places, strict=True)
        for axis in group
        if matters(axis.path)
    }


def _begins(harmonic: CasingHarmonic, k: int, each: Callable[[str, Any], Any], angles: Any) -> Any:
    """Return a sin(φ + order · ψ) of a harmonic of the casing, in all combinations of its axes, at all contacts."""
    path = f"{_CASING_HARMONICS}.{k}"
    turn = 0.0 if harmonic.order is None else each(f"{path}.order", harmonic.order) * angles
    return each(f"{path}.amplitude", harmonic.amplitude) * np.sin(each(f"{path}.phase", harmonic.phase) + turn)


def _extent(cases: CaseSpace, source: StudyText) -> Iterator[Fault]:
    """Refuse more load periods or steps than any case can have, and steps longer than the duration."""
    duration, steps = cases.scene.duration, _steps(cases)
    for path, fastest in _frequencies(cases):
        if duration * fastest > MOST_SAMPLES:
            remedy = f"write a shorter duration, or a frequency up to {MOST_SAMPLES / duration:.3g} Hz"
            yield source.place_of(path), f"gives {duration * fastest:.3g} load periods", remedy
    if not steps:
        return
    shortest, longest, place = min(steps), max(steps), source.axes.get("h", ("h",))
    if duration / shortest > MOST_STEPS:
        problem = f"{shortest:g} s makes {duration / shortest:.3g} steps of a duration of {duration:g} s"
        yield place, problem, f"write at least {duration / MOST_STEPS:.3g} s"
    elif longest > duration:
        problem = f"{longest!r} s is longer than the duration of {duration!r} s"
        yield place, problem, f"write at most {duration!r} s"


def _frequencies(cases: CaseSpace) -> Iterator[tuple[str, float]]:
    """Yield path and largest value of the frequencies that load periods may be counted by."""

    def largest(path: str) -> float:
        return max(map(float, cases.each(path)), default=0.0)

    yield "scene.load.frequency", largest("scene.load.frequency")
    for group, harmonics in _harmonics_of(cases).items():
        path = f"scene.{group}.harmonics.0."
        for first in harmonics[:1]:
            if first.order is None:
                yield f"{path}frequency", largest(f"{path}frequency")
            else:
                yield f"{path}order", largest("scene.speed") * largest(f"{path}order")


def _interval(cases: CaseSpace) -> Iterator[Fault]:
    """Refuse an interval of sampling that does not divide the duration, or does so too often."""
    duration, interval = cases.scene.duration, cases.output.interval
    ratio = Fraction(repr(duration)) / Fraction(repr(interval))
    place: Place = ("output", "interval")
    if ratio + 1 > MOST_SAMPLES:
        problem = f"gives {float(min(ratio, Fraction(10) ** 300)):.3g} samples of every history"
        yield place, problem, f"write at least {duration / MOST_SAMPLES * 1.001:.3g} s"
    elif ratio < Fraction(1, 2):
        problem = f"{quoted(interval)} s is longer than the duration of {duration!r} s"
        yield place, problem, f"write at most {duration!r} s"
    elif abs(ratio - max(1, round(ratio))) > Fraction(1, 10**9):
        tidy = (digit * 10**power for power in range(7) for digit in (1, 2, 5))
        count = min(tidy, key=lambda intervals: abs(math.log(intervals / ratio)))
        problem = f"{quoted(interval)} s does not divide the duration of {duration!r} s"
        yield place, problem, f"write e.g. {float(Decimal(repr(duration)) / count)!r}, for {count} intervals"
