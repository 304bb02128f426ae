"""From a composed text to the cases of a study: first every field by itself, then the checks across fields."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterable, Mapping
from decimal import Decimal
from functools import lru_cache
from typing import Any

from pydantic_core import SchemaValidator, ValidationError

from workflow import models, reduction, schemes
from workflow.study.addresses import MODES, TOLERANCE, addresses, settings
from workflow.study.axes import Arrangement, mode_count
from workflow.study.case_space import CaseSpace, Dimension, Reference
from workflow.study.checks import faults
from workflow.study.document import SCENE_KEYS, study_form
from workflow.study.files import Files
from workflow.study.forms import Entry
from workflow.study.kinds import LONGEST_LIST
from workflow.study.mistakes import UNKNOWN, Place, StudyError, faults_of, one_of, place_of_path
from workflow.study.settings import FULL, Output, Scene, SchemeChoice
from workflow.study.sizes import Sizes, sizes_of
from workflow.study.source import StudyText, mapping, written_axes
from workflow.variables import STEADY, reserved_names


def read_fields(source: StudyText, files: Files) -> tuple[Mapping[str, Any], Mapping[str, Entry]]:
    """Read every field of a study by itself; return its sections, and what its axes may vary.

    Raises
    ------
    StudyError
        Some cannot be read.
    """
    model = _model(source)
    names = (model,) if model else models.names()
    methods = tuple(_methods(source).items())
    varied, form = _form(names, methods, _harmonics(source.tree), reduction.names())
    tree, supplied = _supplied(source, [axis for axis in written_axes(source.tree) if axis[1] in varied])
    sections: dict[str, Any] = {}
    try:
        sections = form.validate_python(tree, context=files)
    except ValidationError as error:
        for place, problem, remedy in faults_of(error):
            follows = not model and place[:1] in (("axes",), ("zip",)) and str(place[-1]).startswith("scene.")
            if place not in supplied and not follows:
                source.report(place, problem, _home(str(place[-1]), varied, remedy) if UNKNOWN in problem else remedy)
    source.refuse()
    return sections, varied


def _home(key: str, varied: Iterable[str], remedy: str) -> str:
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
    bases: tuple[str, ...],
) -> tuple[dict[str, Entry], SchemaValidator]:
    """Return what may vary and the form of a study, for some models, methods by label and harmonics.

    ``bases`` are those that there are: with others it is made anew.
    """
    varied = addresses(names, dict(methods), harmonics)
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
    """Make dimensions of the axes of a study and check its fields against each other.

    Raises
    ------
    StudyError
        They do not go together.
    """
    scene: Scene = sections["scene"]
    defined = {label: dataclasses.replace(c, label=label) for label, c in sections.get("schemes", {}).items()}
    arrangement = Arrangement(source)
    arrangement.take(sections.get("axes", {}), sections.get("zip", {}))
    nodes = f"scene.{scene.model}.nodes"
    counts = (arrangement.values(nodes) or (scene.parameters.nodes,)) if nodes in varied else ()
    try:
        sizes = sizes_of(scene, tuple(map(int, counts)))
    except models.UnusableMatricesError as error:
        source.report(("scene", scene.model), error.problem, error.remedy)
        raise StudyError(source.mistakes) from None
    arrangement.count_modes(nodes, sizes)
    arrangement.refuse_repeated()
    defaults = {path: entry.default for path, entry in settings().items() if path != TOLERANCE}
    asked = sections.get("output", {})
    steady = bool(asked.get("steady")) or bool(arrangement.followed)
    dimensions, scalars, branch = arrangement.named(varied, defaults, _reserved(defined, steady))
    if scene.friction is not None:  # alpha is what it makes
        scalars = tuple(axis for axis in scalars if axis.path != "alpha")
    reference = None
    if sections.get("reference") is not None:
        reference = Reference(_reference(source, sections["reference"], sizes, nodes, dimensions))
    output = _output(asked, scene.duration)
    cases = CaseSpace(
        scene=scene,
        schemes=defined,
        dimensions=dimensions,
        scalars=scalars,
        reference=reference,
        output=output if branch is None else output.of_branches,
        branch=branch,
    )
    cases = dataclasses.replace(cases, schemes=defined | _bare(cases))
    for fault in faults(cases, sizes, source):
        source.report(*fault)
    source.refuse()
    return cases


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
    used = [str(label) for axis in cases.axes() if axis.path == "scheme" for label in axis.values]
    used += [axis.path.split(".")[1] for axis in cases.axes() if axis.path.startswith("schemes.")]
    if cases.reference is not None and "scheme" in cases.reference.values:
        used.append(str(cases.reference.values["scheme"]))
    bare = (label for label in used if label not in cases.schemes)
    return {label: SchemeChoice(label, label, schemes.load(label).Options()) for label in bare}


def _output(asked: Mapping[str, Any], duration: float) -> Output:
    """Return the output; its default interval is a thousandth of the duration."""
    default = {"interval": float(Decimal(repr(duration)) / 1000)}
    return Output(**default | {name: value for name, value in asked.items() if value is not None})
