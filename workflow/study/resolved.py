"""Every value of a study as it is resolved: in SI with its unit, and whether the study gives it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from workflow.declare import File, measure, word_of
from workflow.study.addresses import MODES, TOLERANCE, addresses
from workflow.study.quantities import readable
from workflow.study.ranges import Range
from workflow.study.settings import AUTO, CHOSEN, CaseSettings, Output
from workflow.study.study import Study

Origin = Literal["study", "axis", "default"]
"""Where a value comes from: written once, varied by an axis or a zip, or left to its default."""


@dataclass(frozen=True)
class ResolvedValue:
    """One value of a study, or the values of its axis, in SI; ``drawn`` is a range in their place."""

    path: str
    values: tuple[Any, ...]
    unit: str
    origin: Origin
    drawn: Range | None = None

    @property
    def text(self) -> str:
        """The values as a line: a few of them, of many the ends; the range of drawn ones."""
        if self.drawn is not None:
            law = {"lin": "drawn", "log": "drawn in the logarithm", "branch": "followed as a branch"}[self.drawn.law]
            low, high = (measure(end, readable(self.unit)) for end in (self.drawn.low, self.drawn.high))
            return f"{low} to {high}, {law}"
        values, unit = self.values, readable(self.unit)
        if any(isinstance(value, str) for value in values):  # `static` has no unit
            unit = ""
        elif unit == "m" and 0 < max(map(abs, values)) < 1e-3:
            values, unit = tuple(1e6 * value for value in values), "µm"
        texts = [f"{value:.12g}" if isinstance(value, float) else str(value) for value in values]
        few = texts if len(texts) <= 6 else [texts[0], texts[1], "…", f"{texts[-1]} ({len(texts)} values)"]
        return f"{', '.join(few)} {unit}".rstrip()


def resolved_values(study: Study, cell: CaseSettings) -> tuple[ResolvedValue, ...]:
    """Return the values of a study: scene, settings, scheme options and output; ``cell`` is one of its cases."""
    axes = {axis.path: axis for axis in study.axes()}
    ranges = {path: span for each in study.dimensions if each.drawn for path, span in each.drawn.ranges.items()}
    if study.branch is not None:
        axis = study.branch.axis
        ranges[axis.path] = Range("branch", *map(float, axis.values))
    single = {axis.path for axis in study.scalars}
    labels = {label: (choice.method,) for label, choice in study.schemes.items()}
    harmonics = len(cell.scene.casing.harmonics), len(cell.scene.load.harmonics)
    units = {path: entry.kind.unit for path, entry in addresses((cell.scene.model,), labels, harmonics).items()}
    units["scene.duration"] = "s"
    resolved = list(_files(cell))
    for path in sorted(units, key=lambda path: not path.startswith("scene.")):  # those of the scene first
        if path == TOLERANCE and path not in axes:
            continue
        values = axes[path].values if path in axes else _values_at(study, cell, path)
        if values is not None:
            words = tuple(AUTO if path in MODES and value == CHOSEN else value for value in values)
            origin: Origin = "study" if study.gives(path) else "default"
            varied = path in axes and path not in single
            resolved.append(ResolvedValue(path, words, units[path], "axis" if varied else origin, ranges.get(path)))
    return (*resolved, *_output(study))


def _files(cell: CaseSettings) -> Iterator[ResolvedValue]:
    """Yield the files and tables that the model of a case is read from, a table of the study by its size."""
    for entry in dataclasses.fields(cell.scene.parameters):
        word, value = word_of(entry), getattr(cell.scene.parameters, entry.name)
        if word is not None and word.file and value is not None:
            text = value.name if isinstance(value, File) else f"{len(value)} rows"
            yield ResolvedValue(f"scene.{cell.scene.model}.{entry.name}", (text,), "", "study")


def _values_at(study: Study, cell: CaseSettings, path: str) -> tuple[Any, ...] | None:
    """Return the value of a path in a case as a tuple, ``None`` where it has none; a static start is given once."""
    head, *words = path.split(".")
    if path == "alpha" or (path == "scene.speed" and not cell.scene.speed):
        return None  # made by the scene's friction, and given by its factors; none
    owner: Any = cell.scene
    if head == "schemes":
        label, *words = words
        owner = study.schemes[label].options
    elif words[0] == cell.scene.model:
        owner, words = cell.scene.parameters, words[1:]
    elif words[0] == "initial" and isinstance(cell.scene.initial, str):
        return (cell.scene.initial,) if words[1] == "displacement" else None
    for word in words:
        owner = owner[int(word)] if isinstance(owner, tuple) else getattr(owner, word, None)
    if owner is None:
        return None
    return owner if isinstance(owner, tuple) else (owner,)


def _output(study: Study) -> Iterator[ResolvedValue]:
    values = {entry.name: getattr(study.output, entry.name) for entry in dataclasses.fields(Output)}
    steady = values.pop("steady")
    values |= {"steady": False} if steady is None else {f"steady.{k}": v for k, v in dataclasses.asdict(steady).items()}
    units = {"interval": "s", "temperature_depth": "m"}
    for name, value in ((name, value) for name, value in values.items() if value is not None):
        listed = (value or ("none",)) if isinstance(value, tuple) else (value,)
        origin: Origin = "study" if study.gives(f"output.{name}") else "default"
        yield ResolvedValue(f"output.{name}", listed, units.get(name, ""), origin)
