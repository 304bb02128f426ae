"""The form of a whole study, for one model and its schemes or for all of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cache
from types import GenericAlias
from typing import Any, ClassVar

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag, create_model

from workflow import models, schemes
from workflow.declare import Quantity
from workflow.study.addresses import TOLERANCE, Address, setting_defaults, settings
from workflow.study.draws import SAMPLES, Between, Drawn, drawn
from workflow.study.field_types import MOST_VALUES, AxisValues, Flag, Keyword, Line, Name, Reading
from workflow.study.forms import ByShape, Form, annotated, entry_of, explicit_entries, form, keys_form, summary
from workflow.study.settings import Casing, Friction, Initial, Load, Output, Scene, Steady

LONGEST_TITLE = 1000
SCENE_KEYS = ("casing", "load", "initial", "duration", "speed", "friction")


class _Study(Form):
    """A study of a blade that rubs on its casing."""

    moved: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys((*setting_defaults(), TOLERANCE), "write it under `axes`, as a value or a list"),
        **dict.fromkeys((*SCENE_KEYS, *models.names()), "write it under `scene`"),
    }


class _Axes(Form):
    """What varies from case to case: each list is a dimension of the archive."""

    model_config = ConfigDict(
        json_schema_extra={"patternProperties": {r"^(schemes|scene\.(casing|load)\.harmonics)\.": {}}}
    )

    moved: ClassVar[Mapping[str, str]] = {
        "scene.duration": "all histories share one time axis: write one study per duration",
        "duration": "all histories share one time axis: write one study per duration",
        "scene.initial": "vary `scene.initial.displacement`, `.velocity` or `.temperature`",
    }


def scene_form() -> type[Form]:
    """Return the form of a scene: one entry per model, of which a scene has one, and the rest."""
    return _scene_form(models.names())


@cache
def _scene_form(names: tuple[str, ...]) -> type[Form]:
    declared = {entry.name: entry for entry in dataclasses.fields(Scene)}
    initial = annotated(Any, ByShape((("state", form(Initial)),), word="static"))
    entries: dict[str, Any] = {
        "casing": (form(Casing), Field(description=summary(Casing))),
        "load": (form(Load), Field(default_factory=Load, description=summary(Load))),
        "initial": (initial, Field(default_factory=Initial, description=summary(Initial))),
        "duration": entry_of(declared["duration"], float),
        "speed": entry_of(declared["speed"], float),
        "friction": (form(Friction), Field(None, description=summary(Friction))),
    }
    for name in names:
        if models.fault(name) is not None:  # reported by the reader where a study names it
            entries[name] = Any, Field(None, description="a model that cannot be used")
            continue
        model = models.load(name)
        entries[name] = form(model.Parameters, f"{name}_parameters"), Field(None, description=summary(model))
    return create_model("scene", __base__=Form, __doc__=summary(Scene), **entries)


def scheme_form() -> Any:
    """Return the annotation that reads an entry of ``schemes`` as its method and options."""
    return _scheme_form(schemes.names())


@cache
def _scheme_form(names: tuple[str, ...]) -> Any:
    return annotated(Any, ByShape(tuple((name, _method_form(name)) for name in names), key="method"))


def _method_form(name: str) -> Any:
    """Return the annotation that reads ``{method: ..., options}`` as method and options."""
    if schemes.fault(name) is not None:  # reported by the reader where a study names it
        return annotated(Any, AfterValidator(lambda _: (name, None)))
    options = schemes.load(name).Options
    method = annotated(Any, Keyword((name,))), Field(description=schemes.load(name).about)

    def build(read: Form) -> tuple[str, Any]:
        entries = dict(read)
        return entries.pop("method"), options(**entries)

    return annotated(keys_form(options, f"{name}_options", method=method), AfterValidator(build))


def axes_form(addresses: Mapping[str, Address], zipped: bool = False) -> type[Form]:
    """Return the form of ``axes``, or of a zip, for the values that may vary."""
    entries: dict[str, Any] = {
        path: (
            annotated(Any, AxisValues(address.value, zipped)),
            Field(None, description=f"{address.description}{address.unit and f' [{address.unit}]'}"),
        )
        for path, address in addresses.items()
    }
    return create_model("zip" if zipped else "axes", __base__=_Axes, __doc__=summary(_Axes), **entries)


def zip_form(addresses: Mapping[str, Address]) -> Any:
    """Return the annotation that reads a zip: axes that vary together, or numbers that are drawn."""
    keys = _drawn_form(addresses)

    def tag(value: Any) -> str:
        return "<drawn>" if isinstance(value, dict) and set(keys.model_fields) & set(value) else "<listed>"

    def build(read: Any) -> Drawn:
        return drawn(read.sample, read.points, read.seed, explicit_entries(read.of))

    listed = annotated(axes_form(addresses, zipped=True), Tag("<listed>"))
    return annotated(listed | annotated(annotated(keys, AfterValidator(build)), Tag("<drawn>")), Discriminator(tag))


def _drawn_form(addresses: Mapping[str, Address]) -> type[Form]:
    """Return the form of a drawn zip: real numbers of the scene, e and alpha."""
    drawable = {
        path: address.value
        for path, address in addresses.items()
        if (path.startswith("scene.") or path in ("e", "alpha"))
        and isinstance(address.value, Reading)
        and not address.value.whole
    }
    ranges: dict[str, Any] = {
        path: (annotated(Any, Between(value)), Field(None, description=f"range of the {addresses[path].description}"))
        for path, value in drawable.items()
    }
    of = create_model("ranges", __base__=_Axes, __doc__="Ranges that numbers are drawn from.", **ranges)
    remedy = "draw real numbers of the scene, `e` and `alpha`; vary this one under `axes`"
    of.moved = {**_Axes.moved, **dict.fromkeys(set(addresses) - set(drawable), remedy)}
    points = Quantity("1", "number of points; of sobol_indices a power of two", at_least=2, at_most=MOST_VALUES)
    seed = Quantity("1", "what the generator starts from", at_least=0)
    entries: dict[str, Any] = {
        "sample": (annotated(Any, Keyword(SAMPLES)), Field(description="how points are drawn")),
        "points": (annotated(Any, Reading(points, whole=True)), Field(description=points.description)),
        "seed": (annotated(Any, Reading(seed, whole=True)), Field(0, description=seed.description)),
        "of": (of, Field(description="ranges of what is drawn, [low, high] or {log: [low, high]} by path")),
    }
    return create_model("drawn", __base__=Form, __doc__="A zip whose numbers are drawn.", **entries)


def reference_form(labels: tuple[str, ...], bases: tuple[str, ...]) -> Any:
    """Return the annotation that reads ``reference`` as the settings that it names."""
    entries: dict[str, Any] = {
        name: (annotated(Any, address.value), Field(None, description=address.description))
        for name, address in settings(labels, bases).items()
    }
    doc = "Settings of the solution that errors are measured against; the rest stays the case's own."
    return annotated(create_model("reference", __base__=Form, __doc__=doc, **entries), AfterValidator(explicit_entries))


@cache
def output_form() -> type[Form]:
    """Return the form of ``output``, whose interval may be left out; ``steady`` is a flag or its options."""
    fields = {entry.name: entry for entry in dataclasses.fields(Output)}
    annotation, described = entry_of(fields["interval"], float)
    interval = annotation, Field(None, description=described.description)
    flag, options = annotated(annotated(Any, Flag()), Tag("<flag>")), annotated(form(Steady), Tag("<options>"))
    either = annotated(
        flag | options, Discriminator(lambda given: "<options>" if isinstance(given, dict) else "<flag>")
    )
    asked = AfterValidator(lambda read: (Steady() if read else None) if isinstance(read, bool) else read)
    steady = annotated(either, asked), Field(None, description=summary(Steady))
    return keys_form(Output, "output", interval=interval, steady=steady)


def study_form(addresses: Mapping[str, Address], labels: tuple[str, ...], bases: tuple[str, ...]) -> type[Form]:
    """Return the form of a study whose axes may vary some addresses, for some schemes and bases."""
    axes: Any = axes_form(addresses)
    zips: Any = GenericAlias(dict, (annotated(str, Name("the dimension")), zip_form(addresses)))
    choices: Any = GenericAlias(dict, (annotated(str, Name("the scheme")), scheme_form()))
    entries: dict[str, Any] = {
        "study": (
            annotated(Any, Name("the study (its `title` takes a sentence)")),
            Field(description="name of the study and of its archive"),
        ),
        "title": (annotated(Any, Line(LONGEST_TITLE)), Field("", description="one line on what the study shows")),
        "license": (
            annotated(Any, Line(LONGEST_TITLE)),
            Field("", description="licence of the archive; none if left out"),
        ),
        "scene": (scene_form(), Field(description=summary(Scene))),
        "schemes": (choices, Field(default_factory=dict, description="methods with their options, by label")),
        "axes": (axes, Field(default_factory=axes, description=summary(_Axes))),
        "zip": (
            zips,
            Field(default_factory=dict, description="axes that vary together, by dimension"),
        ),
        "reference": (reference_form(labels, bases), Field(None, description="what errors are measured against")),
        "output": (output_form(), Field(default_factory=output_form(), description=summary(Output))),
    }
    return create_model("study", __base__=_Study, __doc__=summary(_Study), **entries)
