"""A study: read from a path, a text or a mapping, checked and resolved to SI."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workflow.declare import plain
from workflow.study.case_space import CaseSpace
from workflow.study.edits import OPTION, plain_tree, replaced, text_of
from workflow.study.files import Attached, Files
from workflow.study.reader import read_fields, resolve
from workflow.study.source import compose, read_text


@dataclass(frozen=True, kw_only=True)
class Study(CaseSpace):
    """A study that has been read, checked and resolved to SI.

    Attributes
    ----------
    name, title, text, file
        Identifier, title (the identifier where a study has none), source as written, and its file.
    license
        Under which the archive may be used, empty where the study states none.
    attached
        Files that came with the study's text.
    given
        Dotted paths of what the text gives.
    """

    name: str
    title: str
    text: str
    file: str
    license: str = ""
    attached: Attached = field(default_factory=dict)
    given: frozenset[str] = frozenset()

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
        values = {
            "study": self.name,
            "title": self.title,
            **({"license": self.license} if self.license else {}),
            "scene": {
                scene.model: plain(scene.parameters),
                "casing": _without_empty(scene.casing, "harmonics"),
                "load": _without_empty(scene.load, "harmonics"),
                "initial": scene.initial if isinstance(scene.initial, str) else dataclasses.asdict(scene.initial),
                "duration": scene.duration,
                **({"speed": scene.speed} if scene.speed else {}),
                **({} if scene.friction is None else {"friction": dataclasses.asdict(scene.friction)}),
            },
            "schemes": {
                label: {"method": choice.method, **plain(choice.options)} for label, choice in self.schemes.items()
            },
            "dimensions": [_without_empty(dimension, "drawn") for dimension in self.dimensions],
            "scalars": [dataclasses.asdict(scalar) for scalar in self.scalars],
            "reference": None if self.reference is None else dict(self.reference.values),
            **({} if self.branch is None else {"branch": dataclasses.asdict(self.branch)}),
            "output": _without_empty(self.output, "sections", "steady", "temperature_depth"),
        }
        resolved: dict[str, Any] = _listed(values)
        return resolved


def _without_empty(owner: Any, *later: str) -> dict[str, Any]:
    """Return the values of a dataclass without those added later that are empty: a study keeps its identity."""
    return {name: value for name, value in dataclasses.asdict(owner).items() if name not in later or value}


def _listed(value: Any) -> Any:
    """Return nested values with lists in the place of tuples, as JSON has them."""
    if isinstance(value, Mapping):
        return {key: _listed(item) for key, item in value.items()}
    return [_listed(item) for item in value] if isinstance(value, list | tuple) else value


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
