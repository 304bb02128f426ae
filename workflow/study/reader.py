"""From the text of a study to a :class:`Study`, or to all of its mistakes at once."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from workflow import models, schemes
from workflow.study.addresses import MODES, Address, scene_values, scheme_options, settings
from workflow.study.axes import Arrangement, Axis, Dimension, expanded
from workflow.study.document import study_form
from workflow.study.forms import Form, sound
from workflow.study.leaves import Axial, Spread
from workflow.study.mistakes import Place, StudyError, one_of, said
from workflow.study.settings import FULL, Initial, Output, Scene, SchemeChoice
from workflow.study.source import Source, compose, read_text
from workflow.study.study import Reference, Study

MOST_SAMPLES = 2_000_000
"""Samples of a history, and load periods of a case: 16 MB of memory for each variable of each case."""

MOST_STEPS = 10**12
"""Steps of a case: at 10 ns a step about three hours of one core."""

LONGEST_STEP = 1e3
"""A step, in durations; one step of any length covers the duration, this leaves room and no overflow."""


def read_study(path: str | Path) -> Study:
    """Read a study from its file.

    Raises
    ------
    StudyError
        The file cannot be read or the study has mistakes; all of them are in ``mistakes``.
    """
    return parse_study(read_text(path), str(path))


def parse_study(text: str, file: str) -> Study:
    """Read a study from its text; ``file`` is its name in messages.

    Raises
    ------
    StudyError
        The study has mistakes; all of them are in ``mistakes``.
    """
    source = compose(text, file)
    reader = _Reader(source)
    study = reader.study()
    if source.mistakes:
        raise StudyError(source.mistakes)
    return study


def _mapping(value: Any, *keys: str) -> dict[str, Any]:
    """Return the mapping at some keys of a tree, an empty one where there is none."""
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else {}


def _first(content: Any) -> Any:
    """Return the first value of an axis as written."""
    while isinstance(content, dict | list) and content:
        content = next(iter(content.values())) if isinstance(content, dict) else content[0]
    return content


@lru_cache(maxsize=32)
def _forms(
    names: tuple[str, ...], methods: tuple[tuple[str, tuple[str, ...]], ...], labels: tuple[str, ...]
) -> tuple[dict[str, Address], type[Form]]:
    """Return what may vary and the form of a study, for some models and schemes."""
    addresses = settings(labels) | scene_values(names) | scheme_options(dict(methods))
    return addresses, study_form(addresses, labels)


class _Reader:
    """Reads one study, section by section; a mistake in one hides none in another."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.tree = source.tree
        self.model = self._model()
        self.labels = self._labels()
        names = (self.model,) if self.model else models.names()
        self.addresses, self.form = _forms(names, tuple(self.labels.items()), tuple(self.labels))
        self.nodes = f"scene.{self.model}.nodes" if self.model else None
        self.counts: tuple[int, ...] | None = None

    def study(self) -> Study:
        """Return the study; where there were mistakes, their list is what counts."""
        supplied = self._supply()
        self.counts = self._node_counts()
        entries = self._read(supplied)
        axes = self._in_order(entries["axes"], "axes")
        zips = {name: self._in_order(zipped, "zip", name) for name, zipped in entries["zip"].items()}
        self._judge_zips()
        arrangement = Arrangement(self.source, self.addresses, self.nodes, self.counts)
        dimensions, scalars = arrangement.arrange(axes, zips)
        scene = entries["scene"]
        reference = entries.get("reference")
        if reference is not None:
            reference = Reference(self._reference(reference, arrangement, dimensions))
        defined = entries["schemes"].items()
        choices = {label: SchemeChoice(label, method, options) for label, (method, options) in defined}
        self._judge_start(scene, dimensions, scalars)
        self._judge_extent(scene, dimensions, scalars)
        output = self._output(entries["output"], scene.get("duration"))
        if self.source.mistakes:
            raise StudyError(self.source.mistakes)
        return Study(
            name=entries["study"],
            title=entries["title"] or entries["study"],
            text=self.source.text,
            file=self.source.file,
            scene=Scene(
                str(self.model),
                scene[str(self.model)],
                scene["casing"].gap,
                scene["load"],
                scene["initial"],
                scene["duration"],
            ),
            schemes=self._used(choices, dimensions, scalars, reference),
            dimensions=dimensions,
            scalars=scalars,
            reference=reference,
            output=output,
        )

    def _model(self) -> str | None:
        """Return the scene's one model, ``None`` where there is not exactly one."""
        written = self.tree.get("scene") if isinstance(self.tree, dict) else None
        scene = _mapping(written)
        found = [key for key in scene if key in models.names()]
        if len(found) > 1:
            problem = f"is a second model beside `{found[0]}`"
            self.source.report(("scene", found[1]), problem, "keep one model per study")
        elif not found and isinstance(written, dict):
            known = set(scene) & {"casing", "load", "initial", "duration"}
            if len(known) == len(scene):  # an unknown key is told by itself
                self.source.report(("scene",), "has no model", one_of("", models.names()))
        return found[0] if len(found) == 1 else None

    def _labels(self) -> dict[str, tuple[str, ...]]:
        """Return every label that a scheme can have with the methods it may stand for."""
        methods = schemes.names()
        defined: dict[str, tuple[str, ...]] = {}
        for label, entry in _mapping(self.tree, "schemes").items():
            method = entry.get("method") if isinstance(entry, dict) else None
            known = isinstance(method, str) and method in methods
            defined[label] = (str(method),) if known else methods
            if label in methods and known and method != label:
                problem = f"names another method than `{method}`"
                self.source.report(("schemes", label), problem, "choose a label that is no method")
        return defined | {method: (method,) for method in methods if method not in defined}

    def _varied(self) -> list[tuple[Place, str, Any]]:
        """Return place, path and content of all axes as written."""
        written: list[tuple[Place, str, Any]] = [
            (("axes", path), path, content) for path, content in _mapping(self.tree, "axes").items()
        ]
        for name in _mapping(self.tree, "zip"):
            columns = _mapping(self.tree, "zip", name).items()
            written += [(("zip", name, path), path, content) for path, content in columns]
        return [entry for entry in written if entry[1] in self.addresses]

    def _supply(self) -> set[Place]:
        """Give the scene the first value of an axis where it has none of its own; return where."""
        supplied: set[Place] = set()
        self.tree = copy.deepcopy(self.tree)
        for place, path, content in self._varied():
            *above, last = path.split(".")
            owner = self.tree
            for word in above:
                owner = owner.setdefault(word, {}) if isinstance(owner, dict) else None
            if not above or above[0] != "scene":
                continue
            if owner == "static":
                remedy = "leave it out, or write `initial` as a mapping"
                self.source.report(place, "varies a start that is `static`", remedy)
            elif isinstance(owner, dict) and last not in owner:
                owner[last] = _first(content)
                supplied.add(tuple(path.split(".")))
        return supplied

    def _node_counts(self) -> tuple[int, ...] | None:
        """Return the numbers of nodes that the cases have, ``None`` where they cannot be read."""
        if self.nodes is None:
            return None
        reading = self.addresses[self.nodes].value
        content = _mapping(self.tree, "scene", str(self.model)).get("nodes")
        for _, path, varied in self._varied():
            content = varied if path == self.nodes else content
        try:
            read = Axial(reading).read(content, {})
            if isinstance(read, Spread) and read.count > 10_000:
                return None
            return tuple(int(count) for count in expanded(read, whole=True))
        except (ValidationError, PydanticCustomError, ValueError):
            return None

    def _read(self, supplied: set[Place]) -> dict[str, Any]:
        """Return what could be read of every section, and report what could not."""
        context = {"nodes": self.counts}
        faults: set[Place] = set()
        try:
            self.form.model_validate(self.tree, context=context)
        except ValidationError as error:
            for line in error.errors(include_url=False):
                place = tuple(step for step in line["loc"] if str(step)[:1] not in "<[")
                faults.add(place)
                if place not in supplied and not self._follows(place):
                    self.source.report(place, line["ctx"]["problem"], line["ctx"]["remedy"])
        if not isinstance(self.tree, dict):
            raise StudyError(self.source.mistakes)
        empty: dict[str, Any] = {"scene": {}, "axes": {}, "zip": {}, "schemes": {}}
        return empty | sound(self.form, self.tree, faults, context)

    def _follows(self, place: Place) -> bool:
        """Whether a mistake follows from another: an axis over a model that is told to be unknown."""
        path = str(place[-1]) if place[:1] in (("axes",), ("zip",)) else ""
        group = path.split(".")[1] if path.startswith("scene.") else ""
        return self.model is None and group in _mapping(self.tree, "scene") and path not in self.addresses

    def _in_order(self, read: Any, *keys: str) -> dict[str, Any]:
        """Return the axes of a section in the order in which they are written."""
        content = dict(read)
        return {path: content[path] for path in _mapping(self.tree, *keys) if content.get(path) is not None}

    def _judge_zips(self) -> None:
        for name, content in _mapping(self.tree, "zip").items():
            if content == {}:
                self.source.report(("zip", name), "is empty", "write the axes that vary together")

    def _reference(
        self, values: dict[str, Any], arrangement: Arrangement, dimensions: tuple[Dimension, ...]
    ) -> dict[str, Any]:
        varied = any(axis.path == self.nodes for dimension in dimensions for axis in dimension.axes)
        for path in MODES:
            if path in values and not (varied and values[path] == FULL):
                values[path] = arrangement.mode_count(("reference", path), values[path], self.counts)
        return values

    def _used(
        self,
        defined: dict[str, SchemeChoice],
        dimensions: tuple[Dimension, ...],
        scalars: tuple[Axis, ...],
        reference: Reference | None,
    ) -> dict[str, SchemeChoice]:
        """Return the defined schemes and the bare methods that the study uses."""
        axes = [*scalars, *(axis for dimension in dimensions for axis in dimension.axes)]
        used = [str(label) for axis in axes if axis.path == "scheme" for label in axis.values]
        used += [axis.path.split(".")[1] for axis in axes if axis.path.startswith("schemes.")]
        if reference is not None and "scheme" in reference.values:
            used.append(str(reference.values["scheme"]))
        bare = {
            label: SchemeChoice(label, label, schemes.load(label).Options()) for label in used if label not in defined
        }
        return defined | bare

    def _judge_start(
        self, scene: Mapping[str, Any], dimensions: tuple[Dimension, ...], scalars: tuple[Axis, ...]
    ) -> None:
        """Refuse a tip that starts inside the casing in any case."""
        initial, casing = scene.get("initial"), scene.get("casing")
        if not isinstance(initial, Initial) or casing is None:
            return
        tip = initial.displacement[-1] if isinstance(initial.displacement, tuple) else initial.displacement
        paths = ("scene.initial.displacement", "scene.casing.gap")
        values: dict[str, tuple[Any, ...]] = {paths[0]: (tip,), paths[1]: (casing.gap,)}
        together = False
        groups = [dimension.axes for dimension in dimensions] + [(scalar,) for scalar in scalars]
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
            self.source.report(self._written(paths), problem, remedy)

    def _judge_extent(
        self, scene: Mapping[str, Any], dimensions: tuple[Dimension, ...], scalars: tuple[Axis, ...]
    ) -> None:
        """Refuse more load periods or steps than any case can have, and steps far beyond the duration."""
        duration, load = scene.get("duration"), scene.get("load")
        if duration is None or load is None:
            return
        axes = [*scalars, *(axis for dimension in dimensions for axis in dimension.axes)]
        values = {axis.path: axis.values for axis in axes}
        fastest = max(float(value) for value in values.get("scene.load.frequency", (load.frequency,)))
        if duration * fastest > MOST_SAMPLES:
            problem = f"gives {duration * fastest:.3g} load periods"
            remedy = f"write a shorter duration, or a frequency up to {MOST_SAMPLES / duration:.3g} Hz"
            self.source.report(self._written(("scene.load.frequency",)), problem, remedy)
        methods = {method for label in values.get("scheme", ()) for method in self.labels.get(str(label), ())}
        if not any("h" in schemes.load(method).READS for method in methods):
            return
        shortest, longest = (float(choose(values["h"])) for choose in (min, max)) if "h" in values else (None, None)
        if shortest is not None and duration / shortest > MOST_STEPS:
            problem = f"{shortest:g} s makes {duration / shortest:.3g} steps of a duration of {duration:g} s"
            self.source.report(self._written(("h",)), problem, f"write at least {duration / MOST_STEPS:.3g} s")
        elif longest is not None and longest > LONGEST_STEP * duration:
            problem = f"{longest:g} s is far longer than the duration of {duration:g} s"
            self.source.report(self._written(("h",)), problem, f"write at most {duration:g} s")

    def _written(self, paths: tuple[str, ...]) -> Place:
        """Return where the first of some scene values is written, as an axis or in the scene."""
        for path in paths:
            for place, varied, _ in self._varied():
                if varied == path:
                    return place
            if tuple(path.split(".")) in self.source.lines:
                return tuple(path.split("."))
        return tuple(paths[-1].split("."))

    def _output(self, entries: Any, duration: float | None) -> Output:
        """Return the output with the default interval, a thousandth of the duration."""
        given = dict(entries)
        if duration is None or "interval" not in given:
            return Output(interval=1.0)
        if given.get("interval") is None:
            given["interval"] = float(Decimal(repr(duration)) / 1000)
        ratio = Fraction(repr(duration)) / Fraction(repr(given["interval"]))
        place = ("output", "interval")
        count = max(1, round(ratio))
        if ratio + 1 > MOST_SAMPLES:
            problem = f"gives {float(ratio):.3g} samples of every history"
            self.source.report(place, problem, f"write at least {duration / MOST_SAMPLES * 1.001:.3g} s")
        elif abs(ratio - count) > Fraction(1, 10**9):
            tidy = (digit * 10**power for power in range(7) for digit in (1, 2, 5))
            count = min(tidy, key=lambda intervals: abs(math.log(intervals / ratio)))
            interval = float(Decimal(repr(duration)) / count)
            problem = f"{said(given['interval'])} s does not divide the duration of {duration:g} s"
            self.source.report(place, problem, f"write e.g. {interval!r}, for {count} intervals")
        return Output(**given)
