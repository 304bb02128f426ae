"""From the text of a study to a :class:`Study`, or to its mistakes."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from workflow import models, reduction, schemes
from workflow.study.addresses import MODES, Address, harmonic_counts, scene_values, scheme_options, settings
from workflow.study.axes import Arrangement, Axis, Dimension
from workflow.study.cross_checks import (
    MOST_SAMPLES,
    WrittenStudy,
    asks_for_steady,
    can_be_used,
    entry_at,
    first_value,
    judge_auto,
    judge_branch,
    judge_extent,
    judge_model,
    judge_parts,
    judge_schemes,
    judge_start,
    judge_support,
    mapping,
)
from workflow.study.document import SCENE_KEYS, study_form
from workflow.study.draws import Drawn
from workflow.study.edits import OPTION, plain_tree, replaced, text_of
from workflow.study.forms import Form, entries_of
from workflow.study.mistakes import Place, StudyError, one_of, place_of_path, quoted
from workflow.study.settings import FULL, Output, Scene, SchemeChoice, Sizes
from workflow.study.sizes import assembled_sizes, node_sizes
from workflow.study.source import Source, compose, read_text
from workflow.study.study import Reference, Study
from workflow.variables import STEADY, reserved_names

StudySource = Study | Mapping[str, Any] | str | Path
"""What :func:`read_study` takes."""


def read_study(source: StudySource, settings: Mapping[str, Any] | None = None) -> Study:
    """Read a study.

    Parameters
    ----------
    source
        Path of a YAML file; or the text itself, which has more than one line; or what the text would hold, as a
        mapping; or a study that was read.
    settings
        Values that replace some of it, by dotted path, see :func:`parse_study`.

    Raises
    ------
    StudyError
        The file cannot be read or the study has mistakes; all of them are in ``mistakes``.
    """
    if isinstance(source, Study):
        return source.with_(settings) if settings else source
    if isinstance(source, Mapping):
        return parse_study(text_of(plain_tree(source)), "study", settings)
    if isinstance(source, str) and "\n" in source.strip():
        return parse_study(source, "study", settings)
    return parse_study(read_text(source), str(source), settings)


def parse_study(
    text: str,
    file: str,
    settings: Mapping[str, Any] | None = None,
    option: str = OPTION,
    attached: Mapping[str, Path] | None = None,
) -> Study:
    """Read a study from its text.

    Parameters
    ----------
    text, file
        The text, and its name in messages.
    settings
        Values that replace some of it, by dotted path; what follows ``axes.`` or ``zip.NAME.`` is one key. The study's
        own ``text`` has them.
    option
        What names these values in messages, before their key.
    attached
        Places of files that came with the text, by the names that it gives them.

    Raises
    ------
    StudyError
        The study has mistakes; all of them are in ``mistakes``.
    """
    source = compose(text, file)
    if settings:
        source = replaced(source, settings, option)
    return _Reader(source, attached or {}).study()


@lru_cache(maxsize=32)
def _forms(
    names: tuple[str, ...],
    methods: tuple[tuple[str, tuple[str, ...]], ...],
    labels: tuple[str, ...],
    bases: tuple[str, ...],
    harmonics: tuple[int, int],
) -> tuple[dict[str, Address], type[Form]]:
    """Return what may vary and the form of a study, for some models, schemes and bases."""
    addresses = settings(labels, bases) | scene_values(names, harmonics) | scheme_options(dict(methods))
    return addresses, study_form(addresses, labels, bases)


class _Reader:
    """Reads one study: first every entry, then the checks across entries."""

    def __init__(self, source: Source, attached: Mapping[str, Path]) -> None:
        self.source, self.tree = source, source.tree
        self.model = self._model()
        self.labels = self._labels()
        names = (self.model,) if self.model else models.names()
        self.addresses, self.form = _forms(
            names, tuple(self.labels.items()), tuple(self.labels), reduction.names(), harmonic_counts(self.tree)
        )
        path = f"scene.{self.model}.nodes"
        self.nodes = path if path in self.addresses else None
        self.where: dict[str, Any] = {"directory": Path(source.file).parent, "attached": attached}
        self.sizes = Sizes()

    def study(self) -> Study:
        """Return the study; checks across entries come when every entry could be read."""
        supplied = self._supply()
        self.sizes = self._sizes()
        entries, written = self._read(supplied), self._written()
        judge_schemes(written)
        self._refuse()
        scene = entries["scene"]
        axes = self._in_order(entries["axes"], "axes")
        zips = {name: self._in_order(zipped, "zip", name) for name, zipped in entries["zip"].items()}
        arrangement = Arrangement(self.source, self.addresses, self.nodes, self.sizes, self._reserved())
        dimensions, scalars = arrangement.arrange(axes, zips)
        if scene["friction"] is not None:  # alpha is what it makes
            scalars = tuple(axis for axis in scalars if axis.path != "alpha")
        reference = entries["reference"]
        if reference is not None:
            reference = Reference(self._reference(reference, arrangement, dimensions))
        branch = arrangement.branch
        groups = [*(dimension.axes for dimension in dimensions), *((axis,) for axis in scalars)]
        groups += [] if branch is None else [(branch.axis,)]
        self._judge_zips()
        judge_auto(written)
        judge_model(written, str(self.model))
        judge_parts(written)
        judge_support(written, self.labels)
        judge_branch(written, branch, groups, self.labels)
        judge_start(written, scene, groups, self.sizes.contact)
        judge_extent(written, scene, groups, self.labels)
        output = self._output(entries["output"], scene["duration"])
        self._refuse()
        choices = {label: SchemeChoice(label, *entry) for label, entry in entries["schemes"].items()}
        return Study(
            name=entries["study"],
            title=entries["title"] or entries["study"],
            text=self.source.text,
            file=self.source.file,
            scene=Scene(str(self.model), scene[str(self.model)], **{key: scene[key] for key in SCENE_KEYS}),
            schemes=self._used(choices, dimensions, scalars, reference),
            dimensions=dimensions,
            scalars=scalars,
            reference=reference,
            output=output if branch is None else output.of_branches,
            license=entries["license"],
            attached=self.where["attached"],
            branch=branch,
        )

    def _refuse(self) -> None:
        if self.source.mistakes:
            raise StudyError(self.source.mistakes)

    def _model(self) -> str | None:
        """Return the scene's one model, ``None`` where there is not exactly one."""
        written = self.tree.get("scene") if isinstance(self.tree, dict) else None
        scene = mapping(written)
        named_models = [key for key in scene if key in models.names()]
        if len(named_models) > 1:
            problem = f"is a second model beside `{named_models[0]}`"
            self.source.report(("scene", named_models[1]), problem, "keep one model per study")
        elif not named_models and isinstance(written, dict):
            known_keys = set(scene) & set(SCENE_KEYS)
            if len(known_keys) == len(scene):  # an unknown key is reported by itself
                self.source.report(("scene",), "has no model", one_of("", models.names()))
        return (
            named_models[0]
            if len(named_models) == 1
            and can_be_used(self.source, ("scene", named_models[0]), models.fault(named_models[0]))
            else None
        )

    def _reserved(self) -> frozenset[str]:
        """Return the names of all variables that an archive of the study can have."""
        methods = {method for choices in self.labels.values() for method in choices if schemes.fault(method) is None}
        names = reserved_names(frozenset(about.name for method in methods for about in schemes.metrics(method)))
        return names | STEADY if asks_for_steady(self.tree) else names

    def _labels(self) -> dict[str, tuple[str, ...]]:
        """Return every label that a scheme can have with the methods it may stand for."""
        methods = schemes.names()
        defined: dict[str, tuple[str, ...]] = {}
        for label, entry in mapping(self.tree, "schemes").items():
            method = entry.get("method") if isinstance(entry, dict) else None
            is_method = isinstance(method, str) and method in methods
            defined[label] = (str(method),) if is_method else methods
            if label in methods and is_method and method != label:
                problem = f"names another method than `{method}`"
                self.source.report(("schemes", label), problem, "choose a label that is no method")
        return defined | {method: (method,) for method in methods if method not in defined}

    def _written(self) -> WrittenStudy:
        return WrittenStudy(self.source, self.tree, self.addresses)

    def _supply(self) -> set[Place]:
        """Give the scene the first value of an axis where it has none of its own; return where."""
        supplied: set[Place] = set()
        self.tree = copy.deepcopy(self.tree)
        for place, path, content in self._written().varied():
            *above, last = path.split(".")
            owner = self.tree
            for word in above:
                owner = entry_at(owner, word)
            if not above or above[0] != "scene":
                continue
            if owner == "static":
                remedy = "leave it out, or write `initial` as a mapping"
                self.source.report(place, "varies a start that is `static`", remedy)
            elif isinstance(owner, dict) and last not in owner:
                owner[last] = first_value(content)
                supplied.add(place_of_path(path))
        return supplied

    def _sizes(self) -> Sizes:
        """Return how many nodes or coordinates the structures of the cases have."""
        if self.nodes is not None:
            return node_sizes(self._written(), str(self.model), self.nodes, self.addresses[self.nodes])
        return assembled_sizes(self._written(), self.model, self.where) if self.model else Sizes()

    def _read(self, supplied: set[Place]) -> dict[str, Any]:
        """Return the entries of every section.

        Raises
        ------
        StudyError
            Some cannot be read; checks across entries wait until all can.
        """
        sizes = self.sizes
        context = {"node": sizes.nodes, "spring": sizes.nodes, "temperature": sizes.temperatures, **self.where}
        try:
            read: dict[str, Any] = entries_of(self.form.model_validate(self.tree, context=context))
        except ValidationError as error:
            for line in error.errors(include_url=False):
                place = tuple(step for step in line["loc"] if str(step)[:1] not in "<[")
                if place not in supplied and not self._follows(place):
                    self.source.report(place, line["ctx"]["problem"], line["ctx"]["remedy"])
            raise StudyError(self.source.mistakes) from None
        return read

    def _follows(self, place: Place) -> bool:
        """Whether a mistake follows from another: an axis over a model that is reported as unknown."""
        path = str(place[-1]) if place[:1] in (("axes",), ("zip",)) else ""
        group = path.split(".")[1] if path.startswith("scene.") else ""
        return self.model is None and group in mapping(self.tree, "scene") and path not in self.addresses

    def _in_order(self, read: Any, *keys: str) -> Any:
        """Return the axes of a section, or a drawn zip with its ranges, in the order in which they are written."""
        if isinstance(read, Drawn):
            return replace(read, ranges=self._in_order(read.ranges, *keys, "of"))
        content = dict(read)
        return {path: content[path] for path in mapping(self.tree, *keys) if content.get(path) is not None}

    def _judge_zips(self) -> None:
        for name, content in mapping(self.tree, "zip").items():
            if content == {}:
                self.source.report(("zip", name), "is empty", "write the axes that vary together")

    def _reference(
        self, values: dict[str, Any], arrangement: Arrangement, dimensions: tuple[Dimension, ...]
    ) -> dict[str, Any]:
        varied = any(axis.path == self.nodes for dimension in dimensions for axis in dimension.axes)
        for path in MODES:
            if path in values:
                sizes, follows = self.sizes.of(path), varied and values[path] == FULL
                if follows and sizes:
                    sizes = (max(sizes),)
                count = arrangement.mode_count(("reference", path), values[path], sizes)
                values[path] = FULL if follows else count
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

    def _output(self, entries: Any, duration: float) -> Output:
        """Return the output with the default interval, a thousandth of the duration."""
        values = dict(entries)
        if values.get("interval") is None:
            values["interval"] = float(Decimal(repr(duration)) / 1000)
        ratio = Fraction(repr(duration)) / Fraction(repr(values["interval"]))
        place = ("output", "interval")
        count = max(1, round(ratio))
        if ratio + 1 > MOST_SAMPLES:
            problem = f"gives {float(min(ratio, Fraction(10) ** 300)):.3g} samples of every history"
            self.source.report(place, problem, f"write at least {duration / MOST_SAMPLES * 1.001:.3g} s")
        elif ratio < Fraction(1, 2):
            problem = f"{quoted(values['interval'])} s is longer than the duration of {duration:g} s"
            self.source.report(place, problem, f"write at most {duration!r} s")
        elif abs(ratio - count) > Fraction(1, 10**9):
            tidy = (digit * 10**power for power in range(7) for digit in (1, 2, 5))
            count = min(tidy, key=lambda intervals: abs(math.log(intervals / ratio)))
            interval = float(Decimal(repr(duration)) / count)
            problem = f"{quoted(values['interval'])} s does not divide the duration of {duration:g} s"
            self.source.report(place, problem, f"write e.g. {interval!r}, for {count} intervals")
        return Output(**values)
