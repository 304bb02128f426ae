"""Checks across the entries of a study: a start inside the casing, far too many steps, broken schemes and bases."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workflow import models, reduction, schemes
from workflow.models import Array
from workflow.study.addresses import DEFAULT_SCHEME, MODES, REDUCTION, TOLERANCE, Address, harmonic_counts
from workflow.study.axes import Axis, Branch
from workflow.study.mistakes import Place, place_of_path
from workflow.study.settings import AUTO, CasingHarmonic, Initial
from workflow.study.source import Source

MOST_SAMPLES = 2_000_000
"""Samples of a history, and load periods of a case: 16 MB of memory for each variable of each case."""

MOST_STEPS = 10**12
"""Steps of a case: at 10 ns a step about three hours of one core."""

MOST_COMBINATIONS = 10**7
"""Combinations of start and casing that are judged before a study runs."""

_CASING_HARMONICS = "scene.casing.harmonics"


def mapping(value: Any, *keys: str) -> dict[str, Any]:
    """Return the mapping at some keys of a tree, an empty one where there is none."""
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else {}


def flat(content: Any) -> list[Any]:
    """Return the values of an axis as written: of a list each, else the one."""
    return content if isinstance(content, list) else [content]


def first_value(content: Any) -> Any:
    """Return the first value of an axis as written."""
    while isinstance(content, dict | list) and content:
        content = next(iter(content.values())) if isinstance(content, dict) else content[0]
    return content


def entry_at(owner: Any, word: str) -> Any:
    """Return what a mapping or a list holds under a word of a path; a mapping gets what it lacks."""
    if isinstance(owner, dict):
        return owner.setdefault(word, {})
    exists = isinstance(owner, list) and word.isdecimal() and int(word) < len(owner)
    return owner[int(word)] if exists else None


@dataclass(frozen=True)
class WrittenStudy:
    """A study as written: its source, its tree and the values that axes may vary."""

    source: Source
    tree: Any
    addresses: Mapping[str, Address]

    def varied(self) -> list[tuple[Place, str, Any]]:
        """Return place, path and content of all axes as written."""
        written: list[tuple[Place, str, Any]] = [
            (("axes", path), path, content) for path, content in mapping(self.tree, "axes").items()
        ]
        for name in mapping(self.tree, "zip"):
            place: Place = ("zip", name, "of") if "of" in mapping(self.tree, "zip", name) else ("zip", name)
            columns = mapping(self.tree, *map(str, place)).items()
            written += [((*place, path), path, content) for path, content in columns]
        return [entry for entry in written if entry[1] in self.addresses]

    def place_of(self, paths: tuple[str, ...]) -> Place:
        """Return where the first of some scene values is written, as an axis or in the scene."""
        for path in paths:
            for place, varied, _ in self.varied():
                if varied == path:
                    return place
            if place_of_path(path) in self.source.lines:
                return place_of_path(path)
        return place_of_path(paths[-1])


def judge_parts(written: WrittenStudy) -> None:
    """Report harmonics without one frequency, orders without a speed, an alpha beside the friction that makes it."""
    _judge_friction(written)
    for group in ("casing", "load"):
        entries = mapping(written.tree, "scene", group).get("harmonics")
        for k, entry in enumerate(entries if isinstance(entries, list) else ()):
            if isinstance(entry, dict):
                _judge_harmonic(written, f"scene.{group}.harmonics.{k}", entry)


def judge_either(written: WrittenStudy, place: Place, entry: Mapping[str, Any], names: tuple[str, str]) -> bool:
    """Report a mapping that has none or both of two keys; tell whether it has one."""
    given = [name in entry for name in names]
    if all(given):
        written.source.report(place, f"has both `{names[0]}` and `{names[1]}`", "write one of the two")
    elif not any(given):
        written.source.report(place, f"has neither `{names[0]}` nor `{names[1]}`", "write one of the two")
    return sum(given) == 1


def _judge_harmonic(written: WrittenStudy, path: str, entry: Mapping[str, Any]) -> None:
    """Report one entry of ``harmonics`` that has no frequency, two, or an order of no speed."""
    one = judge_either(written, place_of_path(path), entry, ("frequency", "order"))
    if one and "order" in entry and "speed" not in mapping(written.tree, "scene"):
        remedy = "write `speed` in the scene, e.g. `speed: 9000 rpm`, or `frequency` in the place of `order`"
        written.source.report(
            written.place_of((f"{path}.order",)), "is a multiple of a speed that is not given", remedy
        )


def _judge_friction(written: WrittenStudy) -> None:
    if "friction" not in mapping(written.tree, "scene"):
        return
    beside = [place for place, path, _ in written.varied() if path == "alpha"]
    beside += [("reference", "alpha")] if "alpha" in mapping(written.tree, "reference") else []
    for place in beside:
        problem = "stands beside `scene.friction`, which makes it"
        written.source.report(place, problem, "keep one of the two: alpha = heat_share · coefficient · sliding_speed")


def can_be_used(source: Source, place: Place, fault: str | None) -> bool:
    """Report a model or scheme that cannot be used; tell whether it can."""
    if fault is not None:
        source.report(place, f"cannot be used: {fault}", "mend that module, or name another")
    return fault is None


def judge_schemes(written: WrittenStudy) -> None:
    """Report the schemes and bases that a study names and that cannot be used."""
    for place, basis in _named(written, REDUCTION):
        if isinstance(basis, str) and basis in reduction.names():
            can_be_used(written.source, place, reduction.fault(basis))
    named: list[tuple[Place, Any]] = [
        (("schemes", label, "method"), mapping(written.tree, "schemes", label).get("method"))
        for label in mapping(written.tree, "schemes")
    ]
    for place, name in (*named, *_named(written, "scheme")):
        if isinstance(name, str) and name in schemes.names():
            can_be_used(written.source, place, schemes.fault(name))


def judge_auto(written: WrittenStudy) -> None:
    """Refuse `auto` without a tolerance, which has no default, and one of the reference that decides nothing."""
    reference = mapping(written.tree, "reference")
    auto_path = next((path for path in MODES if reference.get(path) == AUTO), None)
    if auto_path is not None and TOLERANCE not in reference:
        remedy = "write e.g. `tolerance: 1e-8` beside it"
        written.source.report(("reference", auto_path), "is `auto` without a `tolerance`", remedy)
    if auto_path is None and TOLERANCE in reference:
        remedy = f"write `auto` for {' and '.join(MODES)} of the reference, or leave it out"
        written.source.report(("reference", TOLERANCE), "decides nothing", remedy)
    varied = written.varied()
    if any(path == TOLERANCE for _, path, _ in varied):
        return
    for place, path, content in varied:
        if path in MODES and AUTO in flat(content):
            remedy = "write e.g. `tolerance: 1e-3` under `axes`"
            written.source.report(place, "is `auto` without a `tolerance`", remedy)


def asks_for_steady(tree: Any) -> bool:
    """Tell whether a study as written asks for steady rubs, or follows them along a branch."""
    axes = mapping(tree, "axes").values()
    return bool(mapping(tree, "output").get("steady")) or any("branch" in mapping(content) for content in axes)


def judge_branch(
    written: WrittenStudy,
    branch: Branch | None,
    groups: Sequence[tuple[Axis, ...]],
    methods: Mapping[str, Sequence[str]],
) -> None:
    """Refuse a branch of other schemes than event_driven, or beside a reference."""
    if branch is None:
        return
    labels = next((axis.values for group in groups for axis in group if axis.path == "scheme"), ())
    if {method for label in labels for method in methods.get(str(label), ())} != {"event_driven"}:
        remedy = "write `scheme: event_driven` under `axes`, or a list in the place of the branch"
        written.source.report(("axes", branch.axis.path), "is a branch, which event_driven alone follows", remedy)
    if "reference" in mapping(written.tree):
        written.source.report(("reference",), "stands beside a branch, which has no errors", "leave it out")


def _named(written: WrittenStudy, setting: str) -> list[tuple[Place, Any]]:
    """Return where axes, zips and the reference name values of a setting, and what they name."""
    entries = [(place, name) for place, path, content in written.varied() if path == setting for name in flat(content)]
    return [*entries, (("reference", setting), mapping(written.tree, "reference").get(setting))]


def judge_support(written: WrittenStudy, methods: Mapping[str, Sequence[str]]) -> None:
    """Report the schemes that do not take the harmonics of a scene; ``methods`` are what each label stands for."""
    casing, load = harmonic_counts(written.tree)
    used = [(place, name) for place, name in _named(written, "scheme") if isinstance(name, str)]
    if not any(place[0] != "reference" for place, _ in used):
        used.append((("scene", "casing" if casing else "load", "harmonics"), DEFAULT_SCHEME))
    for place, name in used:
        for method in methods[name]:
            reason = schemes.load(method).cannot_take(load > 0, casing > 0)
            if reason is not None:
                remedy = "name another scheme, or leave `harmonics` out"
                written.source.report(place, f"`{name}` {reason}", remedy)


def judge_model(written: WrittenStudy, model: str) -> None:
    """Refuse parameters of which the model takes one, where there are none or two, and a ratio beside other damping."""
    names = getattr(models.load(model), "EITHER", None)
    if names is not None:
        judge_either(written, ("scene", model), mapping(written.tree, "scene", model), names)
    damping = mapping(written.tree, "scene", model, "damping")
    if "ratio" in damping and len(damping) > 1:
        place: Place = ("scene", model, "damping", "ratio")
        written.source.report(place, "stands beside other damping", "write the ratio alone, or mass and stiffness")


def judge_start(
    written: WrittenStudy,
    scene: Mapping[str, Any],
    groups: Sequence[tuple[Axis, ...]],
    contact: Array | None,
) -> None:
    """Refuse a tip that starts inside the casing, beyond d(0), in any case; ``contact`` as :class:`Sizes` has it."""
    initial, casing = scene["initial"], scene["casing"]
    if not isinstance(initial, Initial):
        return
    start, weights = initial.displacement, np.ones(1) if contact is None else contact
    tip = np.sum(weights * start[-weights.size :]) if isinstance(start, tuple) else np.sum(weights) * start
    paths = ("scene.initial.displacement", "scene.casing.gap")
    values = _combined(groups, lambda path: path in paths or path.startswith(f"{_CASING_HARMONICS}."))
    if values is None:
        return
    tips = np.sum(weights) * values[paths[0]] if paths[0] in values else tip
    gaps = values.get(paths[1], np.float64(casing.gap))
    place = gaps + sum(_begins(harmonic, k, values) for k, harmonic in enumerate(casing.harmonics))
    tips, place, gaps = np.broadcast_arrays(tips, place, gaps)
    inside = np.argmax(tips - place)
    x, begins, gap = (float(array.ravel()[inside]) for array in (tips, place, gaps))
    if x > begins:
        problem = f"the tip starts inside the casing, at {x:g} m with a gap of {gap:g} m"
        problem += "" if begins == gap else f" and the casing at {begins:g} m"
        remedy = "start at or below the gap, or write `initial: static`"
        written.source.report(written.place_of(paths), problem, remedy)


def _combined(groups: Sequence[tuple[Axis, ...]], matters: Callable[[str], bool]) -> dict[str, Any] | None:
    """Return the values of some axes in all combinations, ``(combination,)``; ``None`` where they are too many."""
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


def _begins(harmonic: CasingHarmonic, k: int, values: Mapping[str, Any]) -> Any:
    """Return a sin φ of a harmonic of the casing, in all combinations of its axes."""
    amplitude = values.get(f"{_CASING_HARMONICS}.{k}.amplitude", harmonic.amplitude)
    phase = values.get(f"{_CASING_HARMONICS}.{k}.phase", harmonic.phase)
    return amplitude * np.sin(phase)


def judge_extent(
    written: WrittenStudy,
    scene: Mapping[str, Any],
    groups: Sequence[tuple[Axis, ...]],
    methods: Mapping[str, Sequence[str]],
) -> None:
    """Refuse more load periods or steps than any case can have, and steps longer than the duration.

    ``methods`` holds the methods that each label of a scheme may stand for.
    """
    duration = scene["duration"]
    values = {axis.path: axis.values for group in groups for axis in group}
    for path, fastest in _frequencies(scene, values):
        if duration * fastest > MOST_SAMPLES:
            problem = f"gives {duration * fastest:.3g} load periods"
            remedy = f"write a shorter duration, or a frequency up to {MOST_SAMPLES / duration:.3g} Hz"
            written.source.report(written.place_of((path,)), problem, remedy)
    used = {method for label in values.get("scheme", ()) for method in methods.get(str(label), ())}
    if not any("h" in schemes.load(method).READS for method in used):
        return
    shortest, longest = (float(choose(values["h"])) for choose in (min, max)) if "h" in values else (None, None)
    if shortest is not None and duration / shortest > MOST_STEPS:
        problem = f"{shortest:g} s makes {duration / shortest:.3g} steps of a duration of {duration:g} s"
        written.source.report(written.place_of(("h",)), problem, f"write at least {duration / MOST_STEPS:.3g} s")
    elif longest is not None and longest > duration:
        problem = f"{longest:g} s is longer than the duration of {duration:g} s"
        written.source.report(written.place_of(("h",)), problem, f"write at most {duration:g} s")


def _frequencies(scene: Mapping[str, Any], values: Mapping[str, tuple[Any, ...]]) -> Iterator[tuple[str, float]]:
    """Yield path and largest value of the frequencies that load periods may be counted by."""

    def largest(path: str, value: float) -> float:
        return max(float(each) for each in values.get(path, (value,)))

    yield "scene.load.frequency", largest("scene.load.frequency", scene["load"].frequency)
    for group in ("load", "casing"):
        for harmonic in scene[group].harmonics[:1]:
            path = f"scene.{group}.harmonics.0."
            if harmonic.order is None:
                yield f"{path}frequency", largest(f"{path}frequency", harmonic.frequency or 0.0)
            else:
                speed = largest("scene.speed", scene["speed"])
                yield f"{path}order", speed * largest(f"{path}order", harmonic.order)
