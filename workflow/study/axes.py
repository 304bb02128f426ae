"""From the axes as read to the dimensions of a study: values, names, counts of modes that structures can keep."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

from workflow import models
from workflow.models import Contacts, Structure
from workflow.study.forms import Entry
from workflow.study.mistakes import Place, quoted
from workflow.study.ranges import Content, Drawn, Followed, Swept, Value
from workflow.study.settings import AUTO, CHOSEN, FULL, MODES, TOLERANCE, Axis, Branch, Dimension, Scene
from workflow.study.source import GAP, GAP_OF, StudyText

Counts = tuple[int, ...]
"""Of the cases; empty where they are not known."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of the structures of a study."""

    inputs: Mapping[str, Counts]
    """By what a list has a value for each of, the numbers of values."""
    coordinates: Mapping[str, Counts]
    """Numbers of mechanical and of thermal coordinates, by the setting of their modes."""
    large: float = inf
    most: int = 0
    """``large``, ``most``: coordinates above which a structure cannot be kept full, and the most modes of each kind
    that it then has."""
    structure: Structure | None = None
    """The first structure of a model that makes no chains, where it can be made."""
    ends: Mapping[str, Structure] = field(default_factory=dict)
    """Those at the last value of each axis of its parameters, by path."""

    @property
    def rows(self) -> Contacts:
        """The contacts of the structure, of a chain its tip."""
        return models.the_tip(1, 1) if self.structure is None else self.structure.contacts

    @property
    def contacts(self) -> tuple[str, ...]:
        """Labels of several contacts; none for one."""
        return self.rows.labels if self.rows.count > 1 else ()


def sizes_of(scene: Scene, nodes: Counts, ends: Mapping[str, Any]) -> Sizes:
    """Return the sizes of the structures of all cases; ``nodes`` are the numbers of them where the model has any.

    ``ends`` are the model's parameters at the last value of each of their other axes, by path.

    Raises :class:`UnusableMatricesError` for matrices of the scene that are no structure.
    """
    every = [replace(scene.parameters, nodes=count) for count in nodes] or [scene.parameters]
    try:
        first = models.structure_of(scene.model, every[0])
        if nodes and isinstance(first, models.Chain):
            return _of_chains(nodes)
        structures = [first, *(models.structure_of(scene.model, other) for other in every[1:])]
        most = models.most_modes(scene.model, every[-1])
    except Exception as error:
        if nodes:
            return _of_chains(nodes)
        if isinstance(error, models.UnusableMatricesError):
            raise
        return Sizes({}, dict.fromkeys(MODES, ()))  # whatever a model from outside raises: its cases say it
    displacements, temperatures = zip(*(one.input_sizes for one in structures), strict=True)
    contacts = tuple(one.contacts.count for one in structures)
    inputs = {"node": displacements, "spring": displacements, "temperature": temperatures, "contact": contacts}
    both = zip(*((one.mechanical_size, one.thermal_size) for one in structures), strict=True)
    last = {}
    for path, parameters in ends.items():
        with suppress(Exception):  # its cases say it
            last[path] = models.structure_of(scene.model, parameters)
    counts = dict(zip(MODES, both, strict=True))
    return Sizes(inputs, counts, inf if most is None else most + 1, most or 0, first, last)


def _of_chains(nodes: Counts) -> Sizes:
    """Return the sizes of chains, whose tip is their one contact."""
    inputs = {**dict.fromkeys(("node", "spring", "temperature"), nodes), "contact": (1,)}
    return Sizes(inputs, dict.fromkeys(MODES, nodes), models.MOST_FULL, models.MOST_ONE_BY_ONE)


MOST_CASES = 10**8

Zip = Mapping[str, tuple[Value, ...]]
"""Values of axes that vary together, by path."""


@dataclass
class _Group:
    """A dimension in the making: an axis, or the columns of a zip, which has a name."""

    place: Place
    columns: dict[str, tuple[Value, ...]]
    name: str = ""
    drawn: Drawn | None = None
    swept: bool = False

    def place_of(self, path: str) -> Place:
        """Return where an axis stands in the study."""
        return (*self.place, path) if self.name else self.place

    @property
    def size(self) -> int:
        """Number of values along the dimension."""
        return len(next(iter(self.columns.values())))


@dataclass
class Arrangement:
    """Dimensions in the making, single values and followed axes by path; what is wrong goes to the source."""

    source: StudyText
    groups: list[_Group] = field(default_factory=list)
    singles: dict[str, Value] = field(default_factory=dict)
    followed: dict[str, Followed] = field(default_factory=dict)

    def take(self, axes: Mapping[str, Content], zips: Mapping[str, Zip | Drawn]) -> None:
        """Take the values of all axes; a study of too many cases is refused."""
        for path, content in axes.items():
            if isinstance(content, Followed):
                if content.law in [one.law for one in self.followed.values()] or path in ("h", TOLERANCE):
                    remedy = f"write one {content.law} only, along a number that event_driven reads"
                    self.source.report(("axes", path), "cannot be followed", remedy)
                self.followed[path] = content
            elif isinstance(content, Swept):
                self._take_sweep(path, content.values)
            elif isinstance(content, tuple):
                self.groups.append(_Group(("axes", path), {path: content}))
            else:
                self.singles[path] = content
        for name, zipped in zips.items():
            self._take_zip(name, zipped)
        points = (one.points for one in self.followed.values() if one.law == "branch")
        cases = math.prod([*(group.size for group in self.groups), *points])
        if cases > MOST_CASES:
            count = f"{cases:.3g}" if cases < 1e300 else "more than 1e300"
            place = "axes" if axes else "zip"
            self.source.report((place,), f"make {count} cases", f"write fewer values: {MOST_CASES:.0e} cases at most")
            self.source.refuse()

    def _take_sweep(self, path: str, values: tuple[float, ...]) -> None:
        if any(group.swept for group in self.groups):
            self.source.report(("axes", path), "is a second sweep", "sweep one axis, and list the values of the other")
        elif not (path in ("alpha", "scene.speed") or path.startswith(("scene.load.", "scene.friction."))):
            remedy = "sweep a number of the load or of friction, `scene.speed` or `alpha`; list the values of this one"
            self.source.report(("axes", path), "cannot be swept", remedy)
        self.groups.append(_Group(("axes", path), {path: values}, swept=True))

    def _take_zip(self, name: str, zipped: Zip | Drawn) -> None:
        place: Place = ("zip", name)
        if isinstance(zipped, Drawn):
            if any(group.drawn for group in self.groups):
                self.source.report(place, "is drawn, and so is another zip", "draw all numbers under one `of`")
            group = _Group(place, dict[str, tuple[Value, ...]](zipped.columns()), name, zipped)
            place = (*place, "of")
        else:
            group = _Group(place, dict(zipped), name)
        varied = {path for other in self.groups for path in other.columns} | set(self.singles) | set(self.followed)
        for path in varied & set(group.columns):
            self.source.report((*place, path), "is an axis already", "keep one of the two")
        sizes = {path: len(values) for path, values in group.columns.items()}
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{path} has {size}" for path, size in sizes.items())
            self.source.report(place, f"has axes of different length: {listed}", "give each as many values")
        else:
            self.groups.append(group)

    def values(self, path: str) -> tuple[Value, ...]:
        """Return the values of an axis or a single one, none where a study has none."""
        found = (group.columns[path] for group in self.groups if path in group.columns)
        return next(found, (self.singles[path],) if path in self.singles else ())

    def count_modes(self, nodes: str, sizes: Sizes) -> None:
        """Put counts in place of ``full``, which follows the number of nodes (at path ``nodes``) where that varies."""
        varied = next((group for group in self.groups if nodes in group.columns), None)
        for path in MODES:
            group = next((group for group in self.groups if path in group.columns), None)
            counts = sizes.coordinates[path]
            if group is None and varied is not None and self.singles.get(path, FULL) == FULL:
                self.singles.pop(path, None)
                mode_count(self.source, ("axes", path), FULL, (max(counts),), sizes)
                varied.columns[path] = tuple(count - 1 for count in counts)
            elif group is None:
                modes = self.singles.get(path, FULL)
                self.singles[path] = mode_count(self.source, ("axes", path), modes, counts, sizes)
            else:
                each = [(count,) for count in counts] if group is varied else [counts] * len(group.columns[path])
                group.columns[path] = tuple(
                    mode_count(self.source, group.place_of(path), modes, its_counts, sizes)
                    for modes, its_counts in zip(group.columns[path], each, strict=True)
                )

    def refuse_repeated(self) -> None:
        """Report a group that has the same values twice."""
        for group in self.groups:
            rows = Counter(zip(*group.columns.values(), strict=True))
            twice = next((row for row, count in rows.items() if count > 1), None)
            if twice is not None:
                listed = ", ".join(f"{value:g}" if isinstance(value, float) else str(value) for value in twice)
                full = "; `full` is the largest count" if set(MODES) & set(group.columns) else ""
                self.source.report(group.place, f"has `{listed}` twice", f"keep values distinct{full}")

    def named(
        self, addresses: Mapping[str, Entry], settings: dict[str, Value], reserved: frozenset[str]
    ) -> tuple[tuple[Dimension, ...], tuple[Axis, ...], dict[str, Branch]]:
        """Return dimensions, scalars, and branch and boundary by law, under the names of their coordinates.

        Parameters
        ----------
        addresses
            What may vary.
        settings
            Values of the settings that a study leaves out.
        reserved
            Names of the archive's variables, which no axis takes.
        """
        varied = {path for group in self.groups for path in group.columns} | set(self.followed)
        singles = {path: value for path, value in (settings | self.singles).items() if path not in varied}
        for group in self.groups:
            if group.name in reserved | {"contact"} or group.name in settings or group.name.endswith("_length"):
                problem = "is the name of a variable of the archive or of an axis"
                self.source.report(group.place, problem, "give the dimension another name")
        zips = {group.name for group in self.groups if group.name}
        names = coordinate_names([*varied, *singles], reserved | zips)
        owners = {names[path]: path for path in sorted(names, reverse=True)}
        for path in names:
            if owners[names[path]] != path:  # labels of contacts differ by signs that no name has
                problem = f"would be `{names[path]}` in the archive, and so would {quoted(owners[names[path]])}"
                self.source.report(self.source.axes[path], problem, "give the contacts other labels")

        def axis(path: str, values: tuple[Value, ...]) -> Axis:
            entry = addresses[path]
            return Axis(path, names[path], values, entry.kind.unit, entry.meaning)

        dimensions = []
        for group in self.groups:
            axes = tuple(axis(path, values) for path, values in group.columns.items())
            dimensions.append(Dimension(group.name or axes[0].name, axes, group.drawn, group.swept))
        followed = dict[str, Branch]()
        for path, one in self.followed.items():
            followed[one.law] = Branch(axis(path, (one.low, one.high)), one.points)
            singles |= {path: one.low} if one.law == "boundary" else {}
        return tuple(dimensions), tuple(axis(path, (value,)) for path, value in singles.items()), followed


def mode_count(source: StudyText, place: Place, modes: Value, counts: Counts, sizes: Sizes) -> Value:
    """Return a count of modes for cases with some numbers of coordinates, of which ``full`` needs one."""
    if modes == AUTO:
        return CHOSEN
    if not counts:
        return modes
    most, limit = min(counts) - 1, sizes.most
    if min(counts) > sizes.large and (modes == FULL or int(modes) > limit):
        complaint = "is `full`" if modes == FULL else f"{quoted(modes)} is too many"
        problem = f"{complaint}, and a structure of {min(counts)} coordinates is too large for that"
        source.report(place, problem, f"write at most {limit}, or `auto` with a `tolerance`")
    elif modes == FULL:
        if len(set(counts)) == 1:
            return most
        source.report(place, "has `full` where the number of nodes varies", "write counts, or zip it with the nodes")
    elif not most and place[-1] == "thermal_modes":
        problem = f"{quoted(modes)} is too many: the structure has no temperature beside the tip's"
        source.report(place, problem, "write 0 or `full`, or give the structure heat_capacity and conductance")
    elif int(modes) > most:
        problem = f"{quoted(modes)} is more than the {most} interior modes of {min(counts)} nodes"
        source.report(place, problem, f"write at most {most}, or `full`")
    return modes


def coordinate_names(paths: Sequence[str], reserved: frozenset[str]) -> dict[str, str]:
    """Return a coordinate name for every path: its last word, or as many as make it unlike all others."""
    possible = {path: possible_names(path) for path in paths}
    while True:
        names = {path: possible[path][0] for path in paths}
        counts = Counter(names.values())
        unclear = [
            path for path in paths if (counts[names[path]] > 1 or names[path] in reserved) and len(possible[path]) > 1
        ]
        if not unclear:
            return names
        for path in unclear:
            del possible[path][0]


def possible_names(path: str) -> list[str]:
    """Return the names a coordinate may have, best first: the last word of its path, the last two, and so on.

    None begins with an index: that of ``casing.harmonics.0.amplitude`` is ``harmonic_amplitude``, then
    ``harmonic_amplitude_0``, then ``casing_harmonic_amplitude_0``; that of the gap of a contact is ``gap_LABEL``.
    """
    if path.startswith(GAP_OF):
        path = f"{GAP}_{re.sub(r'[^A-Za-z0-9_]', '_', path.removeprefix(GAP_OF))}"
    words = path.split(".")
    if len(words) < 3 or not words[-2].isdigit():
        return ["_".join(words[k:]) for k in reversed(range(len(words)))]
    *above, entries, index, word = words
    name = f"{entries.removesuffix('s')}_{word}"
    numbered = f"{name}_{index}"
    return [name, numbered, *("_".join([*above[k:], numbered]) for k in reversed(range(len(above))))]
