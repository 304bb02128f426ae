"""From the axes as written to the dimensions of a study: counts, values, ``full``, names."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workflow.study.addresses import MODES, TOLERANCE, Address, setting_defaults
from workflow.study.draws import Drawn, Range
from workflow.study.field_types import Listed, Reading, Single, Spread
from workflow.study.mistakes import Place, quoted
from workflow.study.settings import AUTO, CHOSEN, FULL, Sizes
from workflow.study.source import Source

Value = float | int | str
MOST_CASES = 10**8


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


def spread_values(spread: Spread) -> tuple[float, ...]:
    """Return the values of a spread axis, rounded to 12 significant digits."""
    return Range(spread.law, spread.first, spread.last).values(np.arange(spread.count) / (spread.count - 1))


def expanded(content: Single | Listed | Spread, whole: bool) -> tuple[Value, ...]:
    """Return the values of an axis.

    Raises
    ------
    ValueError
        A spread over whole numbers has others between its ends.
    """
    if isinstance(content, Single):
        return (content.value,)
    if isinstance(content, Listed):
        return content.values
    values = spread_values(content)
    if not whole:
        return values
    if any(value != int(value) for value in values):
        raise ValueError("has values that are not whole numbers")
    return tuple(int(value) for value in values)


@dataclass
class _Group:
    """A dimension in the making; a zip has a name of its own."""

    place: Place
    columns: dict[str, tuple[Value, ...]]
    name: str | None = None
    drawn: Drawn | None = None

    def column(self, path: str) -> Place:
        """Return where an axis stands in the study, for messages."""
        return (*self.place, path) if self.name is not None else self.place


class Arrangement:
    """Arranges the axes of a study in dimensions and scalars; mistakes go to the source.

    Parameters
    ----------
    source
        The study as written.
    addresses
        What may vary.
    nodes
        Path of the model's number of nodes, ``None`` where the model is unknown.
    sizes
        How many nodes or coordinates the structures of the cases have.
    reserved
        Names of the archive's variables, which no axis takes.
    """

    def __init__(
        self,
        source: Source,
        addresses: Mapping[str, Address],
        nodes: str | None,
        sizes: Sizes,
        reserved: frozenset[str],
    ) -> None:
        self.reserved = reserved
        self.source, self.addresses, self.nodes, self.sizes = source, addresses, nodes, sizes
        self.groups: list[_Group] = []
        self.singles: dict[str, Value] = {}
        self.followed: dict[str, Spread] = {}
        self.branch: Branch | None = None

    def arrange(
        self, axes: Mapping[str, Any], zips: Mapping[str, Mapping[str, Any] | Drawn]
    ) -> tuple[tuple[Dimension, ...], tuple[Axis, ...]]:
        """Return dimensions and scalars of the axes that could be read; one that is followed is then :attr:`branch`."""
        if not self._few_enough(axes, zips):
            return (), ()
        self._take_axes(axes)
        self._take_zips(axes, zips)
        self._take_modes()
        for group in self.groups:
            self._judge_distinct(group)
        return self._named()

    def _few_enough(self, axes: Mapping[str, Any], zips: Mapping[str, Mapping[str, Any] | Drawn]) -> bool:
        """Judge the number of cases before any axis is expanded."""
        sizes = [content.count for content in axes.values() if not isinstance(content, Single)]
        sizes += [
            zipped.count if isinstance(zipped, Drawn) else max(content.count for content in zipped.values())
            for zipped in zips.values()
            if zipped
        ]
        cases: int = math.prod(sizes)
        if cases > MOST_CASES:
            count = f"{cases:.3g}" if cases < 1e300 else "more than 1e300"
            place: Place = ("axes",) if axes else ("zip",)
            self.source.report(place, f"come to {count} cases", f"keep them to {MOST_CASES:.0e}")
        return cases <= MOST_CASES

    def _expand(self, place: Place, path: str, content: Any) -> tuple[Value, ...] | None:
        value = self.addresses[path].value
        try:
            return expanded(content, isinstance(value, Reading) and value.whole)
        except ValueError as error:
            self.source.report(place, str(error), "write a list")
            return None

    def _take_axes(self, axes: Mapping[str, Any]) -> None:
        for path, content in axes.items():
            if isinstance(content, Spread) and content.law == "branch":
                if self.followed or path in ("h", TOLERANCE):
                    self.source.report(
                        ("axes", path), "cannot be followed", "follow one axis of what event_driven reads"
                    )
                self.followed[path] = content
                continue
            values = self._expand(("axes", path), path, content)
            if isinstance(content, Single):
                self.singles[path] = content.value
            elif values is not None:
                self.groups.append(_Group(("axes", path), {path: values}))

    def _take_zips(self, axes: Mapping[str, Any], zips: Mapping[str, Mapping[str, Any] | Drawn]) -> None:
        varied = set(axes)
        for name, zipped in zips.items():
            place: Place = ("zip", name)
            drawn = zipped if isinstance(zipped, Drawn) else None
            if isinstance(zipped, Drawn):
                if any(group.drawn for group in self.groups):
                    self.source.report(place, "is drawn, and so is another zip", "draw all numbers under one `of`")
                place, read = (*place, "of"), dict[str, tuple[Value, ...]](zipped.columns())
            else:
                columns = {path: self._expand((*place, path), path, content) for path, content in zipped.items()}
                read = {path: values for path, values in columns.items() if values is not None}
            for path in varied & set(read):
                self.source.report((*place, path), "is an axis already", "keep one of the two")
            varied |= set(read)
            sizes = {path: len(values) for path, values in read.items()}
            if len(set(sizes.values())) > 1:
                listed = ", ".join(f"{path} has {size}" for path, size in sizes.items())
                self.source.report(place, f"has axes of different length: {listed}", "give each as many values")
            elif read:
                self.groups.append(_Group(("zip", name), read, name, drawn))

    def _take_modes(self) -> None:
        """Put counts in place of ``full``, which follows the number of nodes where that varies."""
        varied = next((group for group in self.groups if self.nodes in group.columns), None)
        for path in MODES:
            group = next((group for group in self.groups if path in group.columns), None)
            if group is None and varied is not None and self.singles.get(path, FULL) == FULL:
                self.singles.pop(path, None)
                counts = [int(n) for n in varied.columns[str(self.nodes)]]
                self.mode_count(("axes", path), FULL, [max(counts)])
                varied.columns[path] = tuple(n - 1 for n in counts)
            elif group is not None and group is varied:
                pairs = zip(group.columns[path], group.columns[str(self.nodes)], strict=True)
                resolved = [self.mode_count(group.column(path), modes, [int(n)]) for modes, n in pairs]
                group.columns[path] = tuple(resolved)
            elif group is not None:
                place = group.column(path)
                values = [self.mode_count(place, modes, self.sizes.of(path)) for modes in group.columns[path]]
                group.columns[path] = tuple(values)
            else:
                modes = self.singles.get(path, FULL)
                self.singles[path] = self.mode_count(("axes", path), modes, self.sizes.of(path))

    def mode_count(self, place: Place, modes: Value, counts: Sequence[int] | None) -> Value:
        """Return a count of modes for cases with some numbers of nodes, of which ``full`` needs one."""
        if modes == AUTO:
            return CHOSEN
        if not counts:
            return modes
        most, limit = min(counts) - 1, self.sizes.most
        if min(counts) > self.sizes.large and (modes == FULL or int(modes) > limit):
            complaint = "is `full`" if modes == FULL else f"{quoted(modes)} is too many"
            problem = f"{complaint}, and a structure of {min(counts)} coordinates is too large for that"
            self.source.report(place, problem, f"write at most {limit}, or `auto` with a `tolerance`")
            return modes
        if modes == FULL:
            if len(set(counts)) == 1:
                return most
            remedy = "write counts, or zip it with the nodes"
            self.source.report(place, "has `full` where the number of nodes varies", remedy)
        elif int(modes) > most:
            problem = f"{quoted(modes)} is more than the {most} interior modes of {min(counts)} nodes"
            self.source.report(place, problem, f"write at most {most}, or `full`")
        return modes

    def _judge_distinct(self, group: _Group) -> None:
        rows = list(zip(*group.columns.values(), strict=True))
        if len(set(rows)) < len(rows):
            twice = next(row for row, count in Counter(rows).items() if count > 1)
            listed = ", ".join(f"{value:g}" if isinstance(value, float) else str(value) for value in twice)
            full = "; `full` is the largest count" if MODES[0] in group.columns or MODES[1] in group.columns else ""
            self.source.report(group.place, f"has `{listed}` twice", f"keep values distinct{full}")

    def _named(self) -> tuple[tuple[Dimension, ...], tuple[Axis, ...]]:
        """Return dimensions and scalars under the names of their coordinates."""
        defaults = setting_defaults()
        held = {path: self.singles.get(path, default) for path, default in defaults.items()}
        varied = {path for group in self.groups for path in group.columns} | set(self.followed)
        singles = {path: value for path, value in (held | self.singles).items() if path not in varied}
        zips = [group.name for group in self.groups if group.name is not None]
        for group in self.groups:
            if group.name is not None and (group.name in self.reserved or group.name in defaults):
                problem = "is the name of a variable of the archive or of an axis"
                self.source.report(group.place, problem, "name the dimension otherwise")
        names = coordinate_names([*varied, *singles], {*self.reserved, *zips})

        def axis(path: str, values: tuple[Value, ...]) -> Axis:
            address = self.addresses[path]
            return Axis(path, names[path], values, address.unit, address.description)

        for path, spread in self.followed.items():
            self.branch = Branch(axis(path, (spread.first, spread.last)), spread.count)
        dimensions = []
        for group in self.groups:
            axes = tuple(axis(path, values) for path, values in group.columns.items())
            dimensions.append(Dimension(group.name or axes[0].name, axes, group.drawn))
        return tuple(dimensions), tuple(axis(path, (value,)) for path, value in singles.items())


def coordinate_names(paths: Sequence[str], reserved: set[str]) -> dict[str, str]:
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
    ``harmonic_amplitude_0``, then ``casing_harmonic_amplitude_0``.
    """
    words = path.split(".")
    if len(words) < 3 or not words[-2].isdigit():
        return ["_".join(words[k:]) for k in reversed(range(len(words)))]
    *above, entries, index, word = words
    name = f"{entries.removesuffix('s')}_{word}"
    numbered = f"{name}_{index}"
    return [name, numbered, *("_".join([*above[k:], numbered]) for k in reversed(range(len(above))))]
