"""Values of axes: single, listed, spread between two ends, or drawn there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from workflow.declare import Quantity
from workflow.study.files import Files
from workflow.study.kinds import Kind, Number, Schema, number, read_each, read_list
from workflow.study.mistakes import quoted, wrong

Value = float | int | str
MOST_VALUES = 10**6
MOST_POINTS = 10_000
"""Of a branch."""


@dataclass(frozen=True)
class Range:
    """Values between two ends, at equal or drawn distances or ratios, or those of a branch."""

    law: Literal["lin", "log", "branch"]
    low: float
    high: float

    def values(self, shares: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the values at shares of the range, rounded to 12 significant digits."""
        ends = np.array([self.low, self.high])
        first, last = np.log10(ends) if self.law == "log" else ends
        values = first * (1 - shares) + last * shares
        return tuple(float(f"{value:.12g}") for value in (10.0**values if self.law == "log" else values))


@dataclass(frozen=True)
class Spread(Range):
    """So many values at equal distances or ratios, not yet expanded, or points of a branch."""

    count: int

    def expanded(self) -> tuple[float, ...]:
        """Return the values."""
        return self.values(np.arange(self.count) / (self.count - 1))


Content = Value | tuple[Value, ...] | Spread
"""Of an axis: one value, which makes no dimension, a list, or what is spread."""


def count_of(content: Content) -> int:
    """Return the number of values of an axis."""
    return content.count if isinstance(content, Spread) else len(content) if isinstance(content, tuple) else 1


def axis_values(kind: Kind, zipped: bool = False) -> Kind:
    """Return the kind of an axis: a scalar, a list, or ``{LAW: [first, last, count]}``, LAW lin, log or branch.

    What is spread over real numbers is not expanded.
    """

    def one(value: Any, files: Files) -> Any:
        if isinstance(value, list | dict):
            raise wrong(f"{quoted(value)} is not a single value", "an axis has single values")
        return kind.read(value, files)

    def read(value: Any, files: Files) -> Content:
        if isinstance(value, dict):
            return _spread(value, kind, zipped, files)
        if isinstance(value, list):
            if not value:
                raise wrong("is empty", "write at least one value, or leave the axis out")
            return read_list(value, Kind(one, {}), files)
        if zipped:
            raise wrong(f"{quoted(value)} is not a list", "write a list as long as the others of this zip")
        single: Value = one(value, files)
        return single

    forms = [*([] if zipped else [kind.schema]), {"type": "array", "items": kind.schema, "minItems": 1}]
    if isinstance(kind, Number):
        end, count = kind.single.schema, {"type": "integer", "minimum": 2, "maximum": MOST_VALUES}
        ends = {"type": "array", "prefixItems": [end, end, count], "minItems": 3, "maxItems": 3}
        forms += [_of_law(law, ends) for law in ("lin", "log", *(() if zipped else ("branch",)))]
    return Kind(read, {"anyOf": forms})


def _spread(value: dict[str, Any], kind: Kind, zipped: bool, files: Files) -> Content:
    """Read ``{LAW: [first, last, count]}``; whole numbers are listed at once, which they can be at most."""
    form = "write a list, {lin: [first, last, count]} or {log: [first, last, count]}"
    law: Literal["lin", "log", "branch"] = "branch" if "branch" in value else "log" if "log" in value else "lin"
    if set(value) != {law}:
        raise wrong("is neither a list nor `lin`, `log` or `branch`", form)
    if not isinstance(kind, Number):
        raise wrong("has words for values, which cannot be spread", "write a list")
    if law == "branch" and (zipped or kind.whole):
        raise wrong("is followed along a real-valued axis of its own alone", "write a list or lin", law)
    entries = value[law]
    if not isinstance(entries, list) or len(entries) != 3:
        raise wrong(f"{quoted(entries)} is not first, last and count", form, law)
    count = Quantity("1", "number of values", at_least=2, at_most=MOST_POINTS if law == "branch" else MOST_VALUES)
    kinds = (kind.single, kind.single, number(count, whole=True))
    first, last, size = read_each(zip(range(3), kinds, entries, strict=True), files, law)
    if first == last:
        raise wrong("begins and ends with the same value", "write a list of one", law)
    if law == "log" and not min(first, last) > 0:
        raise wrong("a logarithmic axis needs positive ends", "write above 0, or use lin", law)
    spread = Spread(law, first, last, size)
    if not kind.whole:
        return spread
    if size > abs(last - first) + 1 or any(each != int(each) for each in spread.expanded()):
        raise wrong("has values that are not whole numbers", "write a list")
    return tuple(int(each) for each in spread.expanded())


def between(kind: Number) -> Kind:
    """Return the kind of the range of a number that is drawn: ``[low, high]``, or ``{log: [low, high]}``."""

    def read(value: Any, files: Files) -> Range:
        law: Literal["lin", "log"] = "log" if isinstance(value, dict) and set(value) == {"log"} else "lin"
        ends = value["log"] if law == "log" else value
        if not isinstance(ends, list) or len(ends) != 2:
            raise wrong(f"{quoted(ends)} is no range", "write [low, high] or {log: [low, high]}")
        low, high = read_list(ends, kind, files, *(("log",) if law == "log" else ()))
        if not low < high:
            raise wrong("does not end above its begin", "write the lower end first")
        if law == "log" and not low > 0:
            raise wrong("has a logarithm and needs positive ends", "write above 0, or [low, high]")
        return Range(law, low, high)

    ends = {"type": "array", "items": kind.schema, "minItems": 2, "maxItems": 2}
    return Kind(read, {"anyOf": [ends, _of_law("log", ends)]})


def _of_law(law: str, ends: Schema) -> Schema:
    return {"type": "object", "properties": {law: ends}, "required": [law], "additionalProperties": False}
