"""A study as resolved: what its cases share, what they vary, and the settings of each."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workflow import models
from workflow.declare import plain
from workflow.study.addresses import MODES
from workflow.study.axes import Axis, Branch, Dimension, Value
from workflow.study.settings import CHOSEN, FULL, CaseSettings, Output, Scene, SchemeChoice


@dataclass(frozen=True)
class Reference:
    """What errors are measured against: the settings that replace those of a case.

    ``full`` stays a word where the number of nodes varies; :meth:`Study.cell` resolves it.
    """

    values: Mapping[str, Value]

    @property
    def is_auto(self) -> bool:
        """Whether its tolerance decides a count of modes."""
        return any(self.values.get(path) == CHOSEN for path in MODES)


@dataclass(frozen=True)
class Study:
    """A study that has been read, checked and resolved to SI.

    Attributes
    ----------
    name, title, text, file
        Identifier, title (the identifier where a study has none), source as written, and its file.
    scene
        The scene as written, before axes replace any of it.
    schemes
        Schemes by label: those defined, and the bare methods that are used.
    dimensions
        Axes, then zips, in the study's order.
    scalars
        Settings and scene values that are no dimension, with one value each.
    reference
        What errors are measured against, or ``None``.
    output
        What the archive keeps.
    license
        Under which the archive may be used, empty where the study states none.
    attached
        Places of files that came with the study's text, by the names that it gives them.
    branch
        The axis that is followed as a curve, ``None`` where none is.
    """

    name: str
    title: str
    text: str
    file: str
    scene: Scene
    schemes: Mapping[str, SchemeChoice]
    dimensions: tuple[Dimension, ...]
    scalars: tuple[Axis, ...]
    reference: Reference | None
    output: Output
    license: str = ""
    attached: Mapping[str, Path] = field(default_factory=dict)
    branch: Branch | None = None

    @property
    def samples(self) -> int:
        """Number of common samples, the initial state included."""
        return round(self.scene.duration / self.output.interval) + 1

    @property
    def is_auto(self) -> bool:
        """Whether it leaves a count of modes to its tolerance in some case."""
        axes = (*self.scalars, *(axis for dimension in self.dimensions for axis in dimension.axes))
        return any(CHOSEN in axis.values for axis in axes if axis.path in MODES)

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
        from workflow.study.reader import parse_study

        return parse_study(self.text, self.file, settings, "with_", self.attached)

    def cell(self, values: Mapping[str, Value]) -> CaseSettings:
        """Return the settings of a case; counts of modes that its tolerance decides are :data:`CHOSEN`.

        Parameters
        ----------
        values
            By path, one value for every axis and scalar, in SI.

        Raises
        ------
        KeyError
            A setting has no value, or no scheme has the label.
        """
        scene, scheme = self.scene, self.schemes[str(values["scheme"])]
        for path, value in values.items():
            head, *rest = path.split(".")
            if head == "scene":
                scene = _replaced(scene, _attributes(rest, scene.model), value)
            elif head == "schemes" and rest[0] == scheme.label:
                scheme = dataclasses.replace(scheme, options=_replaced(scheme.options, rest[1:], value))
        mechanical, thermal = values["mechanical_modes"], values["thermal_modes"]
        return CaseSettings(
            scene,
            scheme,
            e=float(values["e"]),
            alpha=float(values["alpha"]) if scene.friction is None else scene.friction.alpha,
            h=float(values["h"]),
            reduction=str(values["reduction"]),
            mechanical_modes=_interior(scene, 0) if mechanical == FULL else int(mechanical),
            thermal_modes=_interior(scene, 1) if thermal == FULL else int(thermal),
        )

    def resolved(self) -> dict[str, Any]:
        """Return everything resolved as plain JSON values: SI, defaults filled in, no file names."""
        scene = self.scene
        initial = scene.initial if isinstance(scene.initial, str) else dataclasses.asdict(scene.initial)
        resolved: dict[str, Any] = _plain(
            {
                "study": self.name,
                "title": self.title,
                **({"license": self.license} if self.license else {}),
                "scene": {
                    scene.model: plain(scene.parameters),
                    "casing": _without_empty(dataclasses.asdict(scene.casing), "harmonics"),
                    "load": _without_empty(dataclasses.asdict(scene.load), "harmonics"),
                    "initial": initial,
                    "duration": scene.duration,
                    **({"speed": scene.speed} if scene.speed else {}),
                    **({} if scene.friction is None else {"friction": dataclasses.asdict(scene.friction)}),
                },
                "schemes": {
                    label: {"method": choice.method, **plain(choice.options)} for label, choice in self.schemes.items()
                },
                "dimensions": [_without_empty(dataclasses.asdict(each), "drawn") for each in self.dimensions],
                "scalars": [dataclasses.asdict(scalar) for scalar in self.scalars],
                "reference": None if self.reference is None else dict(self.reference.values),
                **({} if self.branch is None else {"branch": dataclasses.asdict(self.branch)}),
                "output": _without_empty(_without_empty(dataclasses.asdict(self.output), "sections"), "steady"),
            }
        )
        return resolved


def _without_empty(values: dict[str, Any], key: str) -> dict[str, Any]:
    """Return values without a key whose value is empty: studies that do not have it keep their identity."""
    return {name: value for name, value in values.items() if name != key or value}


def _interior(scene: Scene, kind: int) -> int:
    """Return the number of interior coordinates of a scene's structure, mechanical (0) or thermal (1)."""
    return models.sizes(scene.model, scene.parameters)[kind] - 1


def _attributes(words: list[str], model: str) -> list[str]:
    """Return how the value of a dotted path below ``scene`` is reached in a :class:`Scene`."""
    return ["parameters", *words[1:]] if words[0] == model else words


def _replaced(owner: Any, attributes: list[str], value: Value) -> Any:
    """Return a frozen dataclass with a value replaced, however deep it lies."""
    name, *deeper = attributes
    if isinstance(owner, tuple):
        place = int(name)
        return (*owner[:place], _replaced(owner[place], deeper, value), *owner[place + 1 :])
    return dataclasses.replace(owner, **{name: _replaced(getattr(owner, name), deeper, value) if deeper else value})


def _plain(value: Any) -> Any:
    """Return nested values with lists in the place of tuples, as JSON has them."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
