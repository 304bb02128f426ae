"""A study: read from a path, a text or a mapping, every field by itself, then all checked together, in SI."""

from __future__ import annotations

import copy
import dataclasses
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from pydantic_core import SchemaValidator, ValidationError

from workflow import models, reduction, schemes
from workflow.declare import File, measure, plain, word_of
from workflow.study.axes import Arrangement, Sizes, mode_count, sizes_of
from workflow.study.checks import faults
from workflow.study.document import REDUCTION, SCENE_KEYS, addresses, settings, study_form
from workflow.study.files import Attached, Files
from workflow.study.forms import LONGEST_LIST, Entry
from workflow.study.mistakes import UNKNOWN, Place, StudyError, faults_of, one_of, place_of_path
from workflow.study.quantities import readable
from workflow.study.ranges import Range
from workflow.study.settings import (
    AUTO,
    CHOSEN,
    FULL,
    MODES,
    TOLERANCE,
    CaseSettings,
    CaseSpace,
    Casing,
    Dimension,
    Output,
    Reference,
    Scene,
    SchemeChoice,
)
from workflow.study.source import (
    GAP,
    GAP_OF,
    OPTION,
    StudyText,
    compose,
    mapping,
    plain_tree,
    read_text,
    replaced,
    text_of,
    written_axes,
)
from workflow.variables import EVENTS, SENSORS, STEADY, WORN, reserved_names


@dataclass(frozen=True, kw_only=True)
class Study(CaseSpace):
    """A study that has been read, checked and resolved to SI."""

    name: str
    title: str
    text: str
    file: str
    """``name``, ``title``, ``text``, ``file``: identifier, title (the identifier where a study has none), source as
    written, and its file."""
    license: str = ""
    """Under which the archive may be used, empty where the study states none."""
    attached: Attached = field(default_factory=dict)
    """Files that came with the study's text."""
    given: frozenset[str] = frozenset()
    """Dotted paths of what the text gives."""

    def gives(self, path: str) -> bool:
        """Tell whether the text gives the value at a path, where it belongs or as an axis of one value."""
        static = path.startswith("scene.initial.") and isinstance(self.scene.initial, str)
        return path in self.given or f"axes.{path}" in self.given or static

    def with_(self, settings: Mapping[str, Any]) -> Study:
        """Return this study with some values replaced; its text has them too.

        Parameters
        ----------
        settings
            New values by dotted path: ``{"scene.casing.gap": "10 um", "axes.e": [0, 0.5]}``; what follows ``axes.`` or
            ``zip.NAME.`` is one key.

        Raises
        ------
        StudyError
            The study has mistakes then.
        """
        return parse_study(self.text, self.file, settings, "with_", self.attached)

    def resolved(self) -> dict[str, Any]:
        """Return everything resolved as plain JSON values: SI, defaults filled in, no file names."""
        scene = self.scene
        resolved = {
            "study": self.name,
            "title": self.title,
            **({"license": self.license} if self.license else {}),
            "scene": {
                scene.model: plain(scene.parameters),
                "casing": _without_empty(
                    scene.casing, "harmonics", "clearance", "flexibility", "coating", "angles", "profile"
                ),
                "load": _without_empty(scene.load, "harmonics"),
                "initial": scene.initial if isinstance(scene.initial, str) else dataclasses.asdict(scene.initial),
                "duration": scene.duration,
                **({"speed": scene.speed} if scene.speed else {}),
                **({} if scene.friction is None else {"friction": dataclasses.asdict(scene.friction)}),
            },
            "schemes": {
                label: {"method": choice.method, **plain(choice.options)} for label, choice in self.schemes.items()
            },
            "dimensions": [_without_empty(dimension, "drawn", "swept") for dimension in self.dimensions],
            "scalars": [dataclasses.asdict(scalar) for scalar in self.scalars],
            "reference": None if self.reference is None else dict(self.reference.values),
            **({} if self.branch is None else {"branch": dataclasses.asdict(self.branch)}),
            **({} if self.boundary is None else {"boundary": dataclasses.asdict(self.boundary)}),
            "output": _without_empty(
                self.output, "sections", "steady", "temperature_depth", "sensors", "events", "wear"
            ),
        }
        as_read: dict[str, Any] = json.loads(json.dumps(resolved))  # tuples as lists
        return as_read


def _without_empty(owner: Any, *later: str) -> dict[str, Any]:
    """Return the values of a dataclass without those added later that are empty: a study keeps its identity."""
    return {name: value for name, value in plain(owner).items() if name not in later or value}


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
    attached: Attached | None = None,
) -> Study:
    """Read a study from its text.

    Parameters
    ----------
    text, file
        The text, and its name in messages.
    settings
        Values that replace some of it, see :meth:`Study.with_`; the study's own ``text`` has them.
    option
        What names these values in messages, before their key.
    attached
        Files that came with the text.

    Raises
    ------
    StudyError
        The study has mistakes; all of them are in ``mistakes``.
    """
    source = compose(text, file)
    if settings:
        source = replaced(source, settings, option)
    files = Files(Path(file).parent, attached or {})
    sections, varied = read_fields(source, files)
    return Study(
        **vars(resolve(source, sections, varied)),
        name=sections["study"],
        title=sections.get("title") or sections["study"],
        text=source.text,
        file=file,
        license=sections.get("license", ""),
        attached=files.attached,
        given=source.given,
    )


def read_fields(source: StudyText, files: Files) -> tuple[Mapping[str, Any], Mapping[str, Entry]]:
    """Read every field of a study by itself; return its sections and what its axes may vary, or raise the mistakes."""
    model = _model(source)
    names = (model,) if model else models.names()
    methods = tuple(_methods(source).items())
    uncertain = mapping(source.tree, "output", "steady", "uncertain")
    gaps = tuple(sorted(path for path in {*source.axes, *uncertain} if path.startswith(GAP_OF)))
    varied, form = _form(names, methods, _harmonics(source.tree), gaps, reduction.names())
    supplying = [axis for axis in written_axes(source.tree) if axis[1] in varied and axis[1] not in gaps]
    tree, supplied = _supplied(source, supplying)
    sections: dict[str, Any] = {}
    try:
        sections = form.validate_python(tree, context=files)
    except ValidationError as error:
        for place, problem, remedy in faults_of(error):
            follows = not model and place[:1] in (("axes",), ("zip",)) and str(place[-1]).startswith("scene.")
            if place not in supplied and not follows:
                source.report(place, problem, _moved(str(place[-1]), varied, remedy) if UNKNOWN in problem else remedy)
    source.refuse()
    return sections, varied


def _moved(key: str, varied: Iterable[str], remedy: str) -> str:
    """Return what to write for a word that is known elsewhere; the remedy of others, and of a part of a word."""
    if remedy.startswith("did you mean") and key in remedy:
        return remedy
    for path in (path if "." in path else f"axes.{path}" for path in varied):
        words = path.split(".")
        if key in words[1:]:
            return f"write it as `{'.'.join(words[: words.index(key) + 1])}`"
    return remedy


@lru_cache(maxsize=32)
def _form(
    names: tuple[str, ...],
    methods: tuple[tuple[str, tuple[str, ...]], ...],
    harmonics: tuple[int, int],
    gaps: tuple[str, ...],
    bases: tuple[str, ...],
) -> tuple[dict[str, Entry], SchemaValidator]:
    """Return what may vary and the form of a study, for some models, methods by label, harmonics and gaps.

    ``bases`` are those that there are: with others it is made anew.
    """
    varied = addresses(names, dict(methods), harmonics, gaps)
    return varied, SchemaValidator(study_form(varied, names).core)


def _model(source: StudyText) -> str:
    """Return the scene's one model, empty where there is not exactly one."""
    scene = mapping(source.tree, "scene")
    named = [key for key in scene if key in models.names()]
    if len(named) > 1:
        problem = f"is a second model beside `{named[0]}`"
        source.report(("scene", named[1]), problem, "keep one model per study")
    elif not named and scene and set(scene) <= set(SCENE_KEYS):  # an unknown key is reported by itself
        source.report(("scene",), "has no model", one_of("", models.names()))
    return named[0] if len(named) == 1 else ""


def _methods(source: StudyText) -> dict[str, tuple[str, ...]]:
    """Return, for each label of a scheme, the methods that it may name."""
    methods = schemes.names()
    defined: dict[str, tuple[str, ...]] = {}
    for label in mapping(source.tree, "schemes"):
        method = mapping(source.tree, "schemes", label).get("method")
        is_method = isinstance(method, str) and method in methods
        defined[label] = (str(method),) if is_method else methods
        if label in methods and is_method and method != label:
            problem = f"names another method than `{method}`"
            source.report(("schemes", label), problem, "choose a label that is no method")
    return defined | {method: (method,) for method in methods if method not in defined}


def _harmonics(tree: Any) -> tuple[int, int]:
    """Return how many harmonics of casing and load a study as written has."""
    lists = (mapping(tree, "scene", group).get("harmonics") for group in ("casing", "load"))
    casing, load = (min(len(entries), LONGEST_LIST) if isinstance(entries, list) else 0 for entries in lists)
    return casing, load


def _supplied(source: StudyText, axes: list[tuple[Place, str, Any]]) -> tuple[Any, set[Place]]:
    """Return the study's tree with the first value of each axis in the place that the axis varies, and these places.

    A value that the study itself has there stays.
    """
    tree: Any = copy.deepcopy(source.tree)
    supplied = set[Place]()
    for place, path, content in axes:
        head, *above, last = path.split(".") if "." in path else ("", path)
        owner: Any = tree.get("scene") if head == "scene" else None
        for word in above:
            if isinstance(owner, dict):
                owner = owner.setdefault(word, {})
            else:
                exists = isinstance(owner, list) and word.isdecimal() and int(word) < len(owner)
                owner = owner[int(word)] if exists else None
        if owner == "static":
            source.report(place, "varies a start that is `static`", "leave it out, or write `initial` as a mapping")
        elif isinstance(owner, dict) and last not in owner:
            owner[last] = _first(content)
            supplied.add(place_of_path(path))
    return tree, supplied


def _first(content: Any) -> Any:
    """Return the first value of an axis as written."""
    while isinstance(content, dict | list) and content:
        content = next(iter(content.values())) if isinstance(content, dict) else content[0]
    return content


def resolve(source: StudyText, sections: Mapping[str, Any], varied: Mapping[str, Entry]) -> CaseSpace:
    """Make dimensions of the axes of a study and check its fields against each other; raise the mistakes."""
    scene: Scene = sections["scene"]
    defined = {label: dataclasses.replace(c, label=label) for label, c in sections.get("schemes", {}).items()}
    arrangement = Arrangement(source)
    arrangement.take(sections.get("axes", {}), sections.get("zip", {}))
    nodes = f"scene.{scene.model}.nodes"
    counts = (arrangement.values(nodes) or (scene.parameters.nodes,)) if nodes in varied else ()
    try:
        sizes = sizes_of(scene, tuple(map(int, counts)), _ends(scene, arrangement))
    except models.UnusableMatricesError as error:
        source.report(("scene", scene.model), error.problem, error.remedy)
        raise StudyError(source.mistakes) from None
    arrangement.count_modes(nodes, sizes)
    arrangement.refuse_repeated()
    defaults = {path: entry.default for path, entry in settings().items() if path != TOLERANCE}
    if any(CHOSEN in arrangement.values(path) for path in MODES):
        defaults[REDUCTION] = reduction.OF_AUTO
    asked = sections.get("output", {})
    steady = bool(asked.get("steady")) or bool(arrangement.followed)
    names = _reserved(defined, steady) | {"contact"}
    names |= WORN if scene.casing.coating is not None else frozenset()
    names |= (SENSORS if asked.get("sensors") else frozenset()) | (EVENTS if asked.get("events") else frozenset())
    dimensions, scalars, followed = arrangement.named(varied, defaults, names)
    branch = followed.get("branch")
    if scene.makes_alpha:
        scalars = tuple(axis for axis in scalars if axis.path != "alpha")
    reference = None
    if sections.get("reference") is not None:
        reference = Reference(_reference(source, sections["reference"], sizes, nodes, dimensions))
        if reference.is_auto and REDUCTION not in source.axes:
            reference = Reference({REDUCTION: reduction.OF_AUTO, **reference.values})
    output = _output(asked, scene.duration)
    if not sizes.rows.is_one_with_mass:
        output = dataclasses.replace(output, balances=asked.get("balances") or False)
    if not sizes.contacts:
        scene = dataclasses.replace(scene, casing=_casing_of_one(scene.casing, sizes))
    elif not isinstance(scene.casing.gap, tuple) and any(path.startswith(GAP_OF) for path in varied):
        each = (scene.casing.gap,) * len(sizes.contacts)
        scene = dataclasses.replace(scene, casing=dataclasses.replace(scene.casing, gap=each))
    cases = CaseSpace(
        scene=scene,
        schemes=defined,
        dimensions=dimensions,
        scalars=scalars,
        reference=reference,
        output=output if branch is None else output.of_branches,
        branch=branch,
        boundary=followed.get("boundary"),
        contacts=sizes.contacts,
    )
    cases = dataclasses.replace(cases, schemes=defined | _bare(cases))
    for fault in faults(cases, sizes, source):
        source.report(*fault)
    source.refuse()
    return cases


def _ends(scene: Scene, arrangement: Arrangement) -> dict[str, Any]:
    """Return the parameters of the model at the last value of each of their axes but that of its nodes, by path."""
    names = {f"scene.{scene.model}.{entry.name}": entry.name for entry in dataclasses.fields(scene.parameters)}
    values = {path: arrangement.values(path) for path, name in names.items() if name != "nodes"}
    last = {path: {names[path]: own[-1]} for path, own in values.items() if len(own) > 1}
    return {path: dataclasses.replace(scene.parameters, **one) for path, one in last.items()}


def _casing_of_one(own: Casing, sizes: Sizes) -> Casing:
    """Return the casing of one contact: numbers in the place of lists of one, and the angle that all files agree on."""
    gap = own.gap[0] if isinstance(own.gap, tuple) and len(own.gap) == 1 else own.gap
    angle = own.angles[0] if isinstance(own.angles, tuple) and len(own.angles) == 1 else own.angles
    angles = {float(rows.angle[0]) for rows in (sizes.rows, *(end.contacts for end in sizes.ends.values()))}
    if angle is None and len(angles) == 1:
        angle = angles.pop() or None
    return dataclasses.replace(own, gap=gap, angles=angle)


def _reserved(defined: Mapping[str, SchemeChoice], steady: bool) -> frozenset[str]:
    """Return the names of all variables that an archive of the study can have."""
    bare = {name for name in schemes.names() if name not in defined and schemes.fault(name) is None}
    methods = bare | {choice.method for choice in defined.values()}
    names = reserved_names(frozenset(about.name for method in methods for about in schemes.metrics(method)))
    return names | STEADY if steady else names


def _reference(
    source: StudyText, values: dict[str, Any], sizes: Sizes, nodes: str, dimensions: tuple[Dimension, ...]
) -> dict[str, Any]:
    """Return the values of a reference with counts of modes; ``full`` follows the number of nodes where that varies."""
    varied = any(axis.path == nodes for dimension in dimensions for axis in dimension.axes)
    for path in MODES:
        if path in values:
            follows, counts = varied and values[path] == FULL, sizes.coordinates[path]
            if follows:
                counts = (max(counts),)
            count = mode_count(source, ("reference", path), values[path], counts, sizes)
            values[path] = FULL if follows else count
    return values


def _bare(cases: CaseSpace) -> dict[str, SchemeChoice]:
    """Return the methods that a study names without defining them."""
    used = [str(label) for label in cases.each("scheme")]
    used += [axis.path.split(".")[1] for axis in cases.axes() if axis.path.startswith("schemes.")]
    if cases.reference is not None and "scheme" in cases.reference.values:
        used.append(str(cases.reference.values["scheme"]))
    bare = (label for label in used if label not in cases.schemes)
    return {label: SchemeChoice(label, label, schemes.load(label).Options()) for label in bare}


def _output(asked: Mapping[str, Any], duration: float) -> Output:
    """Return the output; its default interval is a thousandth of the duration."""
    default = {"interval": float(Decimal(repr(duration)) / 1000)}
    return Output(**default | {name: value for name, value in asked.items() if value is not None})


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
            law = {"lin": "drawn", "log": "drawn in the logarithm", "branch": "followed as a branch"}.get(
                self.drawn.law, "over which boundaries are followed"
            )
            low, high = (measure(end, readable(self.unit)) for end in (self.drawn.low, self.drawn.high))
            return f"{low} to {high}, {law}"
        values, unit = self.values, readable(self.unit)
        if any(isinstance(value, str) for value in values):  # `static` has no unit
            unit = ""
        elif unit == "m" and 0 < max(map(abs, values)) < 1e-3:
            values, unit = tuple(1e6 * value for value in values), "µm"
        digits = 12 if len(values) == 1 else 6
        texts = [f"{value:.{digits}g}" if isinstance(value, float) else str(value) for value in values]
        few = texts if len(texts) <= 6 else [texts[0], texts[1], "…", f"{texts[-1]} ({len(texts)} values)"]
        return f"{', '.join(few)} {unit}".rstrip()


def resolved_values(study: Study, cell: CaseSettings, alpha: tuple[float, ...] = ()) -> tuple[ResolvedValue, ...]:
    """Return the values of a study: scene, settings, scheme options and output; ``cell`` is one of its cases.

    ``alpha`` are the values of α that friction makes.
    """
    axes = {axis.path: axis for axis in study.axes()}
    ranges = {path: span for each in study.dimensions if each.drawn for path, span in each.drawn.ranges.items()}
    if study.branch is not None:
        ranges[study.branch.axis.path] = Range("branch", *map(float, study.branch.axis.values))
    if study.boundary is not None:
        ranges[study.boundary.axis.path] = Range("boundary", *map(float, study.boundary.axis.values))
    single = {axis.path for axis in study.scalars} - set(ranges)
    labels = {label: (choice.method,) for label, choice in study.schemes.items()}
    harmonics = len(cell.scene.casing.harmonics), len(cell.scene.load.harmonics)
    gaps = tuple(path for path in axes if path.startswith(GAP_OF))
    units = {path: entry.kind.unit for path, entry in addresses((cell.scene.model,), labels, harmonics, gaps).items()}
    units["scene.duration"] = "s"
    resolved = list(_files(cell))
    made = ("alpha",) if alpha else ()  # after the friction of which it is made
    for path in sorted(units, key=lambda path: (not path.startswith("scene."), path not in made)):
        if path == TOLERANCE and path not in axes:
            continue
        is_made = path == "alpha" and path not in axes
        values = axes[path].values if path in axes else alpha or None if is_made else _values_at(study, cell, path)
        if values is not None:
            words = tuple(AUTO if path in MODES and value == CHOSEN else value for value in values)
            words = words if units[path] else _with_labels(cell, path.endswith("thermal_contact"), words)
            profiled = study.gives("scene.casing.profile") and path.startswith((GAP, "scene.casing.h"))
            origin: Origin = "study" if study.gives(path) or profiled or is_made else "default"
            varied = len(values) > 1 if is_made else path in axes and path not in single
            resolved.append(ResolvedValue(path, words, units[path], "axis" if varied else origin, ranges.get(path)))
    return (*resolved, *_output_values(study, cell))


def _with_labels(cell: CaseSettings, of_heat: bool, values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return values with the labels of those that are indices of displacements, or temperatures, of the file."""
    if not any(type(value) is int for value in values):
        return values
    at = dict(enumerate(models.labels_of(cell.scene.model, cell.scene.parameters, of_heat)))
    return tuple(f"{value} (label `{at[value]}`)" if value in at else value for value in values)


def _files(cell: CaseSettings) -> Iterator[ResolvedValue]:
    """Yield the files and tables that model and casing of a case are read from, a table of the study by its size."""
    for group, owner in ((cell.scene.model, cell.scene.parameters), ("casing", cell.scene.casing)):
        for entry in dataclasses.fields(owner):
            word, value = word_of(entry), getattr(owner, entry.name)
            if word is not None and word.file and value is not None:
                text = value.name if isinstance(value, File) else f"{len(value)} rows"
                yield ResolvedValue(f"scene.{group}.{entry.name}", (text,), "", "study")


def _values_at(study: Study, cell: CaseSettings, path: str) -> tuple[Any, ...] | None:
    """Return the value of a path in a case as a tuple, ``None`` where it has none; a static start is given once."""
    head, *words = path.split(".")
    if path == "scene.speed" and not cell.scene.speed:
        return None
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


def _output_values(study: Study, cell: CaseSettings) -> Iterator[ResolvedValue]:
    values = {entry.name: getattr(study.output, entry.name) for entry in dataclasses.fields(Output)}
    steady, sensors, wear = (values.pop(name) for name in ("steady", "sensors", "wear"))
    if sensors:
        at = {name: _with_labels(cell, one.of_heat, (one.at,))[0] for name, one in sensors.items()}
        values["sensors"] = tuple(f"{name}: {'temperature ' * one.of_heat}{at[name]}" for name, one in sensors.items())
    values |= {"steady": False} if steady is None else {f"steady.{k}": v for k, v in dataclasses.asdict(steady).items()}
    if study.uncertain:
        changes = ((path, measure(one.value, readable(one.unit))) for path, one in study.uncertain.items())
        values["steady.uncertain"] = tuple(f"{path}: {text}" for path, text in changes)
    values |= {} if wear is None else {"wear.every": wear.every}
    units = {"interval": "s", "temperature_depth": "m"}
    for name, value in ((name, value) for name, value in values.items() if value is not None):
        listed = (value or ("none",)) if isinstance(value, tuple) else (value,)
        origin: Origin = "study" if study.gives(f"output.{name}") else "default"
        yield ResolvedValue(f"output.{name}", listed, units.get(name, ""), origin)
