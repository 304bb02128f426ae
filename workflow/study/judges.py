"""What no single value of a study decides: a start inside the casing, far too many steps, broken schemes and bases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from workflow import reduction, schemes
from workflow.study.addresses import REDUCTION, Address
from workflow.study.axes import Axis
from workflow.study.mistakes import Place
from workflow.study.settings import Initial
from workflow.study.source import Source

MOST_SAMPLES = 2_000_000
"""Samples of a history, and load periods of a case: 16 MB of memory for each variable of each case."""

MOST_STEPS = 10**12
"""Steps of a case: at 10 ns a step about three hours of one core."""

LONGEST_STEP = 1e3
"""A step, in durations; one step of any length covers the duration, this leaves room and no overflow."""


def mapping(value: Any, *keys: str) -> dict[str, Any]:
    """Return the mapping at some keys of a tree, an empty one where there is none."""
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else {}


def flat(content: Any) -> list[Any]:
    """Return the values of an axis as written: of a list each, else the one."""
    return content if isinstance(content, list) else [content]


@dataclass(frozen=True)
class Written:
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
            columns = mapping(self.tree, "zip", name).items()
            written += [(("zip", name, path), path, content) for path, content in columns]
        return [entry for entry in written if entry[1] in self.addresses]

    def place_of(self, paths: tuple[str, ...]) -> Place:
        """Return where the first of some scene values is written, as an axis or in the scene."""
        for path in paths:
            for place, varied, _ in self.varied():
                if varied == path:
                    return place
            if tuple(path.split(".")) in self.source.lines:
                return tuple(path.split("."))
        return tuple(paths[-1].split("."))


def can_be_used(source: Source, place: Place, fault: str | None) -> bool:
    """Report a model or scheme that cannot be used; tell whether it can."""
    if fault is not None:
        source.report(place, f"cannot be used: {fault}", "mend that module, or name another")
    return fault is None


def judge_schemes(written: Written) -> None:
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


def _named(written: Written, setting: str) -> list[tuple[Place, Any]]:
    """Return where axes, zips and the reference name values of a setting, and what they name."""
    found = [(place, name) for place, path, content in written.varied() if path == setting for name in flat(content)]
    return [*found, (("reference", setting), mapping(written.tree, "reference").get(setting))]


def judge_start(written: Written, scene: Mapping[str, Any], groups: Sequence[tuple[Axis, ...]]) -> None:
    """Refuse a tip that starts inside the casing in any case."""
    initial, casing = scene.get("initial"), scene.get("casing")
    if not isinstance(initial, Initial) or casing is None:
        return
    tip = initial.displacement[-1] if isinstance(initial.displacement, tuple) else initial.displacement
    paths = ("scene.initial.displacement", "scene.casing.gap")
    values: dict[str, tuple[Any, ...]] = {paths[0]: (tip,), paths[1]: (casing.gap,)}
    together = False
    for group in groups:
        found = {axis.path: axis.values for axis in group if axis.path in paths}
        together = together or len(found) == 2
        values |= found
    tips, gaps = values[paths[0]], values[paths[1]]
    pairs = list(zip(tips, gaps, strict=True)) if together else [(max(tips), min(gaps))]
    inside = [(x, gap) for x, gap in pairs if x > gap]
    if inside:
        x, gap = inside[0]
        problem = f"the tip starts inside the casing, at {x:g} m with a gap of {gap:g} m"
        remedy = "start at or below the gap, or write `initial: static`"
        written.source.report(written.place_of(paths), problem, remedy)


def judge_extent(
    written: Written, scene: Mapping[str, Any], groups: Sequence[tuple[Axis, ...]], methods: Mapping[str, Sequence[str]]
) -> None:
    """Refuse more load periods or steps than any case can have, and steps far beyond the duration.

    ``methods`` holds the methods that each label of a scheme may stand for.
    """
    duration, load = scene.get("duration"), scene.get("load")
    if duration is None or load is None:
        return
    values = {axis.path: axis.values for group in groups for axis in group}
    fastest = max(float(value) for value in values.get("scene.load.frequency", (load.frequency,)))
    if duration * fastest > MOST_SAMPLES:
        problem = f"gives {duration * fastest:.3g} load periods"
        remedy = f"write a shorter duration, or a frequency up to {MOST_SAMPLES / duration:.3g} Hz"
        written.source.report(written.place_of(("scene.load.frequency",)), problem, remedy)
    used = {method for label in values.get("scheme", ()) for method in methods.get(str(label), ())}
    if not any("h" in schemes.load(method).READS for method in used if schemes.fault(method) is None):
        return
    shortest, longest = (float(choose(values["h"])) for choose in (min, max)) if "h" in values else (None, None)
    if shortest is not None and duration / shortest > MOST_STEPS:
        problem = f"{shortest:g} s makes {duration / shortest:.3g} steps of a duration of {duration:g} s"
        written.source.report(written.place_of(("h",)), problem, f"write at least {duration / MOST_STEPS:.3g} s")
    elif longest is not None and longest > LONGEST_STEP * duration:
        problem = f"{longest:g} s is far longer than the duration of {duration:g} s"
        written.source.report(written.place_of(("h",)), problem, f"write at most {duration:g} s")
