"""The cases of a study: what they share, what they vary, and the settings of each."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from workflow import models
from workflow.study.addresses import MODES
from workflow.study.draws import Drawn
from workflow.study.ranges import Value
from workflow.study.settings import CHOSEN, FULL, CaseSettings, Output, Scene, SchemeChoice


@dataclass(frozen=True)
class Axis:
    """One quantity that a study varies, or one of the settings that it holds.

    Attributes
    ----------
    path
        What it sets: ``e``, ``scheme``, ``scene.casing.gap``, ``schemes.LABEL.option``.
    name
        Name of its coordinate.
    values
        Values in SI, in the study's order; ``full`` is resolved.
    unit
        CF unit (``N m-1``); empty for words.
    description
        Long name.
    """

    path: str
    name: str
    values: tuple[Value, ...]
    unit: str
    description: str


@dataclass(frozen=True)
class Dimension:
    """A dimension of the archive: one axis, or axes that vary together, as listed or as drawn."""

    name: str
    axes: tuple[Axis, ...]
    drawn: Drawn | None = None

    @property
    def size(self) -> int:
        """Number of values along the dimension."""
        return len(self.axes[0].values)


@dataclass(frozen=True)
class Branch:
    """The axis along which a branch of steady rubs is followed; the ends of its range are the values of ``axis``."""

    axis: Axis
    points: int


@dataclass(frozen=True)
class Reference:
    """What errors are measured against: the settings that replace those of a case.

    ``full`` stays a word where the number of nodes varies; :meth:`CaseSpace.cell` resolves it.
    """

    values: Mapping[str, Value]

    @property
    def is_auto(self) -> bool:
        """Whether its tolerance decides a count of modes."""
        return any(self.values.get(path) == CHOSEN for path in MODES)


@dataclass(frozen=True, kw_only=True)
class CaseSpace:
    """The cases of a study, resolved to SI.

    Attributes
    ----------
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
    branch
        The axis that is followed as a curve, ``None`` where none is.
    """

    scene: Scene
    schemes: Mapping[str, SchemeChoice]
    dimensions: tuple[Dimension, ...]
    scalars: tuple[Axis, ...]
    reference: Reference | None
    output: Output
    branch: Branch | None = None

    @property
    def samples(self) -> int:
        """Number of common samples, the initial state included."""
        return round(self.scene.duration / self.output.interval) + 1

    @property
    def is_auto(self) -> bool:
        """Whether it leaves a count of modes to its tolerance in some case."""
        return any(CHOSEN in axis.values for axis in self.axes() if axis.path in MODES)

    def axes(self) -> Iterator[Axis]:
        """Yield all axes, and the settings that are held."""
        for dimension in self.dimensions:
            yield from dimension.axes
        yield from self.scalars
        if self.branch is not None:
            yield self.branch.axis

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
                attributes = ["parameters", *rest[1:]] if rest[0] == scene.model else rest
                scene = _replaced(scene, attributes, value)
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


def _interior(scene: Scene, kind: int) -> int:
    """Return the number of interior coordinates of a scene's structure, mechanical (0) or thermal (1)."""
    return models.sizes(scene.model, scene.parameters)[kind] - 1


def _replaced(owner: Any, attributes: list[str], value: Value) -> Any:
    """Return a frozen dataclass with a value replaced, however deep it lies."""
    name, *deeper = attributes
    if isinstance(owner, tuple):
        place = int(name)
        return (*owner[:place], _replaced(owner[place], deeper, value), *owner[place + 1 :])
    return dataclasses.replace(owner, **{name: _replaced(getattr(owner, name), deeper, value) if deeper else value})
