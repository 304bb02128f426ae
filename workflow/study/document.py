"""The form of a whole study, for one model and its schemes or for all of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, create_model

from workflow import models, schemes
from workflow.declare import quantity_of
from workflow.study.addresses import Address, setting_defaults, settings
from workflow.study.forms import ByShape, Form, form, summary
from workflow.study.leaves import Axial, Line, Name, Reading
from workflow.study.settings import Casing, Initial, Load, Output, Scene

LONGEST_TITLE = 1000
_SCENE_KEYS = ("casing", "load", "initial", "duration")


class _Study(Form):
    """A study of a blade that rubs on its casing."""

    moved: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(setting_defaults(), "write it under `axes`, as a value or a list"),
        **dict.fromkeys((*_SCENE_KEYS, *models.names()), "write it under `scene`"),
    }


class _Axes(Form):
    """What varies from case to case: each list is a dimension of the archive."""

    moved: ClassVar[Mapping[str, str]] = {
        "scene.duration": "all histories share one time axis: write one study per duration",
        "duration": "all histories share one time axis: write one study per duration",
        "scene.initial": "vary `scene.initial.displacement`, `.velocity` or `.temperature`",
    }


@cache
def scene_form() -> type[Form]:
    """Return the form of a scene: one entry per model, of which a scene has one, and the rest."""
    duration = next(entry for entry in dataclasses.fields(Scene) if entry.name == "duration")
    declared = quantity_of(duration)
    assert declared is not None
    length = Reading(declared)
    entries: dict[str, Any] = {
        name: (
            form(models.load(name).Parameters, f"{name}_parameters"),
            Field(None, description=summary(models.load(name))),
        )
        for name in models.names()
    }
    initial = Annotated[Any, ByShape((("state", form(Initial)),), word="static")]
    entries |= {
        "casing": (form(Casing), Field(description=summary(Casing))),
        "load": (form(Load), Field(default_factory=Load, description=summary(Load))),
        "initial": (initial, Field(default_factory=Initial, description=summary(Initial))),
        "duration": (Annotated[Any, length], Field(description=length.described())),
    }
    return create_model("scene", __base__=Form, __doc__=summary(Scene), **entries)


@cache
def scheme_form() -> Any:
    """Return the annotation that reads an entry of ``schemes`` as its method and options."""
    return Annotated[Any, ByShape(tuple((name, _method_form(name)) for name in schemes.names()), key="method")]


def _method_form(method: str) -> Any:
    """Return the annotation that reads ``{method: ..., options}`` as method and options."""
    options = schemes.load(method).Options
    model = create_model(
        f"{method}_options",
        __base__=form(options).__origin__,
        __doc__=summary(schemes.load(method)),
        method=(Literal[method], Field(description="method of time integration")),
    )

    def build(read: Form) -> tuple[str, Any]:
        entries = dict(read)
        return entries.pop("method"), options(**entries)

    return Annotated[model, AfterValidator(build)]


def axes_form(addresses: Mapping[str, Address], zipped: bool = False) -> type[Form]:
    """Return the form of ``axes``, or of a zip, for the values that may vary."""
    entries: dict[str, Any] = {
        path: (
            Annotated[Any, Axial(address.value, zipped)],
            Field(None, description=f"{address.description}{address.unit and f' [{address.unit}]'}"),
        )
        for path, address in addresses.items()
    }
    return create_model("zip" if zipped else "axes", __base__=_Axes, __doc__=summary(_Axes), **entries)


def reference_form(labels: tuple[str, ...]) -> Any:
    """Return the annotation that reads ``reference`` as the settings that it names."""
    entries: dict[str, Any] = {
        name: (Annotated[Any, address.value], Field(None, description=address.description))
        for name, address in settings(labels).items()
    }
    doc = "Settings of the solution that errors are measured against; the rest stays the case's own."
    model = create_model("reference", __base__=Form, __doc__=doc, **entries)
    return Annotated[model, AfterValidator(lambda read: {name: getattr(read, name) for name in entries_set(read)})]


def entries_set(read: Form) -> list[str]:
    """Return the entries that a study gives, in the order of the form."""
    return [name for name in type(read).model_fields if name in read.model_fields_set]


def study_form(addresses: Mapping[str, Address], labels: tuple[str, ...]) -> type[Form]:
    """Return the form of a study whose axes may vary some addresses and whose schemes have labels."""
    axes, zipped = axes_form(addresses), axes_form(addresses, zipped=True)
    entries: dict[str, Any] = {
        "study": (Annotated[Any, Name("the study")], Field(description="name of the study and of its archive")),
        "title": (Annotated[Any, Line(LONGEST_TITLE)], Field("", description="one line on what the study shows")),
        "scene": (scene_form(), Field(description=summary(Scene))),
        "schemes": (
            dict[Annotated[str, Name("the scheme")], scheme_form()],
            Field(default_factory=dict, description="methods with their options, by label"),
        ),
        "axes": (axes, Field(default_factory=axes, description=summary(_Axes))),
        "zip": (
            dict[Annotated[str, Name("the dimension")], zipped],
            Field(default_factory=dict, description="axes that vary together, by the name of their dimension"),
        ),
        "reference": (reference_form(labels), Field(None, description="what errors are measured against")),
        "output": (_output_form(), Field(default_factory=dict, description=summary(Output))),
    }
    return create_model("study", __base__=_Study, __doc__=summary(_Study), **entries)


@cache
def _output_form() -> Any:
    """Return the annotation that reads ``output`` as the entries that it gives."""
    model = form(Output).__origin__
    interval = model.model_fields["interval"]
    optional = create_model(
        "output",
        __base__=model,
        interval=(Annotated[Any, *interval.metadata], Field(None, description=interval.description)),
    )
    return Annotated[optional, AfterValidator(lambda read: {name: getattr(read, name) for name in entries_set(read)})]
