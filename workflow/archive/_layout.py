"""What an archive holds and how it is cut into chunks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Kind = Literal["history", "metric", "period", "flag", "phase", "point", "point phase"]
Attributes = Mapping[str, str | Sequence[int] | Sequence[float]]

FORMAT = 2
"""Version of shards and archives; raised when an older reader would misread them."""

CHUNK_BYTES = 2**20
"""No chunk is larger than this before compression, unless it is one instant of many phases."""

STATUS = "status"
OK, NOT_RUN = 0, 4
"""Of :class:`workflow.schemes.Status`: what every flag of an archive starts from and must end in."""

LONGEST_MESSAGE = 4000
"""Bytes of a case's message that are kept; those of this package have a few hundred."""

_TAILS: dict[Kind, tuple[str, ...]] = {
    "history": ("t",),
    "period": ("period",),
    "phase": ("phase",),
    "point": ("point",),
    "point phase": ("point", "phase"),
}
"""Dimensions that variables of a kind have beyond the cases."""

_BLANKS = {STATUS: NOT_RUN, "steady_state": 6}
"""What flags are where nothing has run; ``not_asked`` of steady rubs, 0 of others."""

MESSAGE = "message"


@dataclass(frozen=True, eq=False)
class Coordinate:
    """A labelled coordinate; one named as its single dimension labels that dimension.

    Attributes
    ----------
    dims
        None for a scalar, the shared dimension for a coordinate of a zip.
    values
        float64, int64 or text (``str`` in an object array), in the study's order.
    attrs
        CF attributes: ``units``, ``long_name``, …
    """

    name: str
    dims: tuple[str, ...]
    values: NDArray[Any]
    attrs: Attributes

    def __post_init__(self) -> None:
        values = np.asarray(self.values)
        dtype: Any = object
        if values.dtype.kind in "iu":
            dtype = np.int64
        elif values.dtype.kind == "f":
            dtype = np.float64
        elif not all(isinstance(value, str) for value in values.ravel().tolist()):
            raise ValueError(f"coordinate {self.name}: values must be numbers or texts, not {values.dtype}")
        if values.ndim != len(self.dims):
            raise ValueError(f"coordinate {self.name}: {values.ndim}-d values along {self.dims}")
        object.__setattr__(self, "values", values.astype(dtype))

    @property
    def text(self) -> bool:
        """Whether the values are strings."""
        return self.values.dtype == object


@dataclass(frozen=True, eq=False)
class Variable:
    """A result of every case: a metric or flag (…), a history (…, t) and so on, see :data:`_TAILS`.

    Attributes
    ----------
    dtype
        ``"f8"``, ``"f4"`` (missing values are NaN) or ``"i1"`` (flags, no missing value).
    attrs
        CF attributes; sequences of numbers (``flag_values``) are stored in the variable's dtype.
    optional
        Not every scheme gives it: an archive without it holds only cases where it is missing.
    """

    name: str
    kind: Kind
    dtype: str
    attrs: Attributes
    optional: bool = False

    def __post_init__(self) -> None:
        if self.dtype not in ("f8", "f4", "i1"):
            raise ValueError(f"variable {self.name}: dtype {self.dtype!r} is none of f8, f4, i1")

    @property
    def fill(self) -> float | int:
        """What stands where nothing has run: NaN; of flags :data:`_BLANKS`."""
        return math.nan if self.dtype != "i1" else _BLANKS.get(self.name, 0)


@dataclass(frozen=True, eq=False)
class Layout:
    """Dimensions, coordinates and variables of one archive; its cells are numbered in C order over ``dims``.

    Attributes
    ----------
    dims
        Names and sizes of the case dimensions, outermost first.
    tails
        Sizes of ``t``, ``period`` and so on, those that the archive has.
    attrs
        Global CF attributes; ``Conventions`` is added.
    provenance
        Texts of the group ``provenance``; ``key`` and ``content_hash`` are added.
    key
        Identity of study and solver version.
    """

    dims: tuple[tuple[str, int], ...]
    tails: Mapping[str, int]
    coordinates: tuple[Coordinate, ...]
    variables: tuple[Variable, ...]
    attrs: Mapping[str, str | float]
    provenance: Mapping[str, str]
    key: str

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Every dimension and its size, the case dimensions first."""
        return dict(self.dims) | dict(self.tails)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Sizes of the case dimensions."""
        return tuple(size for _, size in self.dims)

    @cached_property
    def cells(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @cached_property
    def by_name(self) -> dict[str, Variable]:
        """The variables, by name."""
        return {variable.name: variable for variable in self.variables}

    def tail(self, variable: Variable) -> tuple[str, ...]:
        """Return the dimensions a variable has beyond the cases."""
        return _TAILS.get(variable.kind, ())

    def tail_shape(self, variable: Variable) -> tuple[int, ...]:
        """Return the sizes of a variable beyond the cases."""
        return tuple(self.sizes[name] for name in self.tail(variable))

    def dims_of(self, variable: Variable) -> tuple[str, ...]:
        """Return a variable's dimensions in the archive."""
        return tuple(name for name, _ in self.dims) + self.tail(variable)

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """Lengths of a chunk along the case dimensions, the same for all variables.

        Whole dimensions innermost, then a part of one: as many cases as the largest variable has in
        :data:`CHUNK_BYTES`, at least one.
        """
        most = CHUNK_BYTES // max(self._bytes(variable) for variable in self.variables)
        lengths: list[int] = []
        for size in reversed(self.shape):
            lengths.append(max(1, min(size, most // math.prod(lengths))))
        return tuple(reversed(lengths))

    def chunk_of(self, variable: Variable) -> tuple[int, ...]:
        """Return the chunk of a variable; the history of one case may be cut along ``t``, into nearly equal lengths."""
        tail = self.tail_shape(variable)
        if not tail:
            return self.lengths
        pieces = -(-self._bytes(variable) // CHUNK_BYTES)
        return (*self.lengths, -(-tail[0] // pieces), *tail[1:])

    def _bytes(self, variable: Variable) -> int:
        """Return the bytes of one case."""
        return np.dtype(variable.dtype).itemsize * math.prod(self.tail_shape(variable))


def truncated_message(text: str) -> str:
    """Return a case's message cut to :data:`LONGEST_MESSAGE` bytes."""
    encoded = text.encode(errors="replace")
    if len(encoded) <= LONGEST_MESSAGE:
        return encoded.decode()
    return encoded[: LONGEST_MESSAGE - 3].decode(errors="ignore") + "…"
