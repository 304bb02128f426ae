"""The form of a whole study, for one model and its schemes or for all of them; what axes may vary, by path."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import MISSING
from functools import partial
from typing import Any

from workflow import models, reduction, schemes
from workflow.declare import Quantity, Word
from workflow.models import Sensor
from workflow.study.forms import (
    FLAG,
    LINE,
    Entry,
    Kind,
    Number,
    RecordKind,
    either,
    entries_of,
    keyword,
    leaf,
    name,
    named,
    no_mapping,
    number,
    record,
    record_of,
    summary,
    text,
    usable,
)
from workflow.study.mistakes import one_of, quoted, wrong
from workflow.study.profile import casing_of
from workflow.study.ranges import MOST_VALUES, SAMPLES, axis_values, between, drawn
from workflow.study.settings import (
    AUTO,
    FULL,
    MODES,
    TOLERANCE,
    CaseSettings,
    Casing,
    CasingHarmonic,
    Change,
    Friction,
    Initial,
    Load,
    LoadHarmonic,
    Output,
    Scene,
    SchemeChoice,
    Steady,
)
from workflow.study.source import GAP_OF

DEFAULT_SCHEME = "moreau"
REDUCTION = "reduction"
OF_SCENE = ("model", "parameters", "casing", "initial")
"""Fields of a scene that are not read as they are declared."""


def addresses(
    names: tuple[str, ...],
    methods: Mapping[str, tuple[str, ...]],
    harmonics: tuple[int, int] = (0, 0),
    gaps: tuple[str, ...] = (),
) -> dict[str, Entry]:
    """Return all that an axis may vary, by dotted path: settings of a case, scene values and options of schemes.

    ``names`` are the models, ``methods`` those that each label of a scheme may stand for, ``harmonics`` the numbers of
    harmonics of the casing and of the load, ``gaps`` paths of the gaps of single contacts.
    """
    values = settings(tuple(methods)) | _scene_values(names, harmonics) | _scheme_options(methods)
    about = "tip clearance at rest, cold, of contact {}"
    own = {path: Quantity("m", about.format(path.removeprefix(GAP_OF))) for path in gaps}
    return values | {path: Entry(number(gap), gap.description) for path, gap in own.items()}


def settings(labels: tuple[str, ...] = ()) -> dict[str, Entry]:
    """Return the settings of a case by their bare names, for some schemes; ``tolerance`` has no default."""
    values = dict(entries_of(CaseSettings, ("scene", "scheme")))
    for path in MODES:
        modes = Quantity("1", values[path].meaning, at_least=0)
        values[path] = dataclasses.replace(values[path], kind=number(modes, whole=True, words=(FULL, AUTO)))
    values[REDUCTION] = dataclasses.replace(values[REDUCTION], kind=keyword(reduction.names(), fault=reduction.fault))
    about = "largest relative error that the reduced model of `auto` leaves; tolerance of a recommendation"
    values[TOLERANCE] = Entry(number(Quantity("1", about, above=0.0)), about, MISSING)
    scheme = keyword(labels, labels=True, fault=_fault_of_scheme)
    return {"scheme": Entry(scheme, "time integration scheme", DEFAULT_SCHEME)} | values


def _fault_of_scheme(label: str) -> str | None:
    """Return why a method cannot be used; that of a label of the study is judged where it is defined."""
    return schemes.fault(label) if label in schemes.names() else None


def _scene_values(names: tuple[str, ...], harmonics: tuple[int, int]) -> dict[str, Entry]:
    """Return the scene values of some models by dotted path, without the duration."""
    groups: dict[str, type] = {name: models.load(name).Parameters for name in names if models.fault(name) is None}
    groups |= {"casing": Casing, "load": Load, "initial": Initial}
    groups |= {f"casing.harmonics.{k}": CasingHarmonic for k in range(harmonics[0])}
    groups |= {f"load.harmonics.{k}": LoadHarmonic for k in range(harmonics[1])}
    groups |= {"friction": Friction}
    values = {"scene.speed": entries_of(Scene, OF_SCENE)["speed"]}
    for group, declared in groups.items():
        values |= _values(entries_of(declared), f"scene.{group}")
    return values


def _scheme_options(methods: Mapping[str, tuple[str, ...]]) -> dict[str, Entry]:
    """Return the options of schemes by dotted path."""
    return {
        path: dataclasses.replace(entry, meaning=f"{entry.meaning} of {label}")
        for label, candidates in methods.items()
        for method in candidates
        if schemes.fault(method) is None
        for path, entry in _values(entries_of(schemes.load(method).Options), f"schemes.{label}")
    }


def _values(entries: Mapping[str, Entry], above: str) -> Iterator[tuple[str, Entry]]:
    """Yield the single values among some entries with their paths, those of nested mappings too."""
    for last, entry in entries.items():
        kind, path = entry.kind, f"{above}.{last}"
        if isinstance(kind, RecordKind):
            yield from _values(kind.entries, path)
        elif kind.varies:
            yield path, dataclasses.replace(entry, kind=kind.single if isinstance(kind, Number) else kind)


SCENE_KEYS = ("casing", "load", "initial", "duration", "speed", "friction")

_STUDY = "A study of a blade that rubs on its casing."
_AXES = "What varies from case to case: each list is a dimension of the archive."
_REFERENCE = "Settings of the solution that errors are measured against; the rest stays the case's own."
_NOT_VARIED = {
    "scene.duration": "all histories share one time axis: write one study per duration",
    "duration": "all histories share one time axis: write one study per duration",
    "scene.initial": "vary `scene.initial.displacement`, `.velocity` or `.temperature`",
}
_SOME = r"^(schemes|scene\.(casing|load)\.harmonics|scene\.casing\.gap)\."
"""Paths that only some studies have."""


def _static(value: Any) -> Any:
    if value != "static":
        raise wrong(f"{quoted(value)} is not a mapping or `static`", "write a mapping or `static`")
    return value


_STATIC = leaf(_static, {"const": "static"})
"""The word ``static`` in the place of an initial state."""


def _broken(model: str, value: Any) -> None:
    usable(models.fault(model))


def _scene(names: tuple[str, ...]) -> RecordKind:
    """Return the form of a scene: one entry per model, of which a scene has one, and the rest."""
    start = Entry(either(no_mapping, record_of(Initial), _STATIC), summary(Initial))
    casing = Entry(record(summary(Casing), entries_of(Casing), casing_of), summary(Casing), MISSING)
    entries = entries_of(Scene, OF_SCENE) | {"casing": casing, "initial": start}
    for model in names:
        if models.fault(model) is None:
            entries[model] = Entry(record_of(models.load(model).Parameters), summary(models.load(model)))
        else:
            entries[model] = Entry(leaf(partial(_broken, model), {}), "a model that cannot be used")

    def build(given: dict[str, Any]) -> Scene:
        model = next((key for key in given if key in names), "")
        rest = {key: value for key, value in given.items() if key not in names}
        return Scene(model=model, parameters=given.get(model), **rest)

    return record(summary(Scene), entries, build)


def _schemes() -> Kind:
    """Return the form of ``schemes``: methods with their options, by label."""
    names = schemes.names()

    def options(method: str) -> RecordKind:
        if schemes.fault(method) is not None:
            return record("A method that cannot be used.", {"method": Entry(keyword((method,)), "", MISSING)})
        scheme = schemes.load(method)
        entries = {"method": Entry(keyword((method,)), scheme.about, MISSING)} | entries_of(scheme.Options)

        def build(given: dict[str, Any]) -> SchemeChoice:
            return SchemeChoice("", given.pop("method"), scheme.Options(**given))

        return record(summary(scheme.Options), entries, build)

    def choose(value: Any) -> int:
        if not isinstance(value, dict):
            raise wrong(f"{quoted(value)} is not a mapping", "write a mapping")
        if "method" not in value:
            raise wrong("`method` is missing", one_of("", names))
        if value["method"] not in names:
            raise wrong(f"{quoted(value['method'])} is no method", one_of(str(value["method"]), names), "method")
        usable(schemes.fault(value["method"]), "method")
        return names.index(value["method"])

    return named(name("the scheme"), either(choose, *map(options, names)))


def _axes(varied: Mapping[str, Entry], zipped: bool = False) -> RecordKind:
    """Return the form of ``axes``, or of a zip, for the values that may vary."""
    entries = {path: Entry(axis_values(entry.kind, zipped), entry.described) for path, entry in varied.items()}

    def build(given: dict[str, Any]) -> dict[str, Any]:
        if zipped and not given:
            raise wrong("is empty", "write the axes that vary together")
        return given

    return record(_AXES, entries, build, moved=_NOT_VARIED, more=_SOME)


def _of_scene(varied: Mapping[str, Entry]) -> dict[str, Number]:
    """Return the real numbers of the scene, ``e`` and ``alpha`` among the values that may vary."""
    return {
        path: entry.kind
        for path, entry in varied.items()
        if (path.startswith("scene.") or path in ("e", "alpha"))
        if isinstance(entry.kind, Number) and not entry.kind.whole
    }


def _zip(varied: Mapping[str, Entry]) -> Kind:
    """Return the form of ``zip``: axes that vary together, or real numbers that are drawn, by dimension."""
    ranges = {
        path: Entry(between(kind), f"range of the {varied[path].meaning}") for path, kind in _of_scene(varied).items()
    }
    remedy = "draw real numbers of the scene, `e` and `alpha`; vary this one under `axes`"
    moved = _NOT_VARIED | dict.fromkeys(set(varied) - set(ranges), remedy)
    points = Quantity("1", "number of points; of sobol_indices a power of two", at_least=2, at_most=MOST_VALUES)
    seed = Quantity("1", "what the generator starts from", at_least=0)
    of = "ranges of what is drawn, [low, high] or {log: [low, high]} by path"
    keys = {
        "sample": Entry(keyword(SAMPLES), "how points are drawn", MISSING),
        "points": Entry(number(points, whole=True), points.description, MISSING),
        "seed": Entry(number(seed, whole=True), seed.description, 0),
        "of": Entry(record("Ranges that numbers are drawn from.", ranges, moved=moved, more=_SOME), of, MISSING),
    }
    design = record("A zip whose numbers are drawn.", keys, lambda given: drawn(**given))

    def choose(value: Any) -> int:
        return 0 if isinstance(value, dict) and set(keys) & set(value) else 1

    return named(name("the dimension"), either(choose, design, _axes(varied, zipped=True)))


def _sensors() -> Kind:
    """Return the form of sensors, by name: where each is, of a temperature in a mapping."""
    place = text(Word("label, index or vector", number=True))
    warm = {"temperature": Entry(place, "label, index or vector of a temperature", MISSING)}
    of_heat = record("A sensor of a temperature.", warm, lambda given: Sensor(given["temperature"], of_heat=True))
    return named(name("the sensor"), either(no_mapping, of_heat, place.built(Sensor)))


def _change(unit: str, value: float) -> Change:
    return Change(value, unit)


def _output(varied: Mapping[str, Entry]) -> RecordKind:
    """Return the form of ``output``, read as it is written; ``steady`` is a flag or its options."""
    changes = {
        path: Entry(
            number(Quantity(kind.declared.unit, "change of a number")).built(partial(_change, kind.unit)),
            varied[path].meaning,
        )
        for path, kind in _of_scene(varied).items()
    }
    own = next(entry for entry in dataclasses.fields(Steady) if entry.name == "uncertain")
    about = own.metadata["meaning"]
    steady = entries_of(Steady, ("uncertain",)) | {"uncertain": Entry(record(about, changes, more=_SOME), about)}
    entries = dict(entries_of(Output, ("steady", "sensors")))
    entries["interval"] = dataclasses.replace(entries["interval"], default=None)
    sensors = next(entry for entry in dataclasses.fields(Output) if entry.name == "sensors")
    entries["sensors"] = Entry(_sensors(), sensors.metadata["meaning"])
    options = record(summary(Steady), steady, lambda given: Steady(**given))
    entries["steady"] = Entry(either(no_mapping, options, FLAG), summary(Steady))

    def build(given: dict[str, Any]) -> dict[str, Any]:
        if isinstance(given.get("steady"), bool):
            given["steady"] = Steady() if given["steady"] else None
        return given

    return record(summary(Output), entries, build)


def study_form(varied: Mapping[str, Entry], names: tuple[str, ...]) -> RecordKind:
    """Return the form of a study for some models; ``varied`` is what its axes may vary."""
    of_case = {path: entry for path, entry in varied.items() if "." not in path}
    reference = {path: dataclasses.replace(entry, default=None) for path, entry in of_case.items()}
    entries = {
        "study": Entry(name("the study (its `title` takes a sentence)"), "name of study and archive", MISSING),
        "title": Entry(LINE, "one line on what the study shows"),
        "license": Entry(LINE, "licence of the archive; none if left out"),
        "scene": Entry(_scene(names), summary(Scene), MISSING),
        "schemes": Entry(_schemes(), "methods with their options, by label"),
        "axes": Entry(_axes(varied), _AXES),
        "zip": Entry(_zip(varied), "axes that vary together, by dimension"),
        "reference": Entry(record(_REFERENCE, reference), "what errors are measured against"),
        "output": Entry(_output(varied), summary(Output)),
    }
    moved = {
        **dict.fromkeys(of_case, "write it under `axes`, as a value or a list"),
        **dict.fromkeys((*SCENE_KEYS, *models.names()), "write it under `scene`"),
    }
    return record(_STUDY, entries, moved=moved)


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a study, of any model and any scheme (draft 2020-12), for editors that check."""
    names, methods = models.names(), {method: (method,) for method in schemes.names()}
    schema = study_form(addresses(names, methods), names).schema
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
