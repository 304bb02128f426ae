"""What an archive holds and how it is cut into units of work: all this floor knows of a study."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from workflow.archive._cut import Cut, largest_cut

Kind = Literal["history", "metric", "period", "flag", "phase", "point", "point phase"]
Attributes = Mapping[str, str | Sequence[int] | Sequence[float]]

FORMAT = 1
"""Version of shards and archives; raised when an older reader would misread them."""

CHUNK_BYTES = 4 * 2**20
"""No chunk is larger than this before compression."""

SMALL_BYTES, JOINED_BYTES = 64 * 2**10, 2**20
"""Units whose largest chunk has fewer bytes than the first are joined, when they are gathered, to chunks of at most
as many as the second: a chunk costs HDF5 some 100 bytes and dask a task, however small it is."""

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
RESERVED = ("key", "content_hash", "file_checksum", "case_hash")
"""Names of the provenance group that the archive fills in itself."""


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
    """Dimensions, coordinates and variables of one archive, and its units of work.

    Cells are numbered in C order over ``dims``. Units are the blocks of a :class:`~workflow.archive._cut.Cut` in
    ``chunk`` cells; the chunks of the archive are units, or several of them.

    Attributes
    ----------
    dims
        Names and sizes of the case dimensions, outermost first.
    tails
        Sizes of ``t``, ``period`` and so on, those that the archive has.
    chunk
        Cells of a unit.
    attrs
        Global CF attributes; ``Conventions`` is added.
    provenance
        Texts of the group ``provenance``; ``key`` and ``content_hash`` are added.
    key
        Identity of study and solver version.

    Raises
    ------
    ValueError
        The parts do not fit each other.
    """

    dims: tuple[tuple[str, int], ...]
    tails: Mapping[str, int]
    chunk: int
    coordinates: tuple[Coordinate, ...]
    variables: tuple[Variable, ...]
    attrs: Mapping[str, str | float]
    provenance: Mapping[str, str]
    key: str

    def __post_init__(self) -> None:
        sizes = self.sizes
        if len(sizes) != len(self.dims) + len(self.tails) or min(sizes.values(), default=1) < 1:
            raise ValueError(f"dimensions must have distinct names and positive sizes: {self.dims}")
        Cut(self.shape, self.chunk)
        names = [c.name for c in self.coordinates] + [v.name for v in self.variables] + [MESSAGE]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"names used twice, or {MESSAGE}: {', '.join(twice)}")
        if not any(v.name == STATUS and v.kind == "flag" and v.dtype == "i1" for v in self.variables):
            raise ValueError(f"there must be a flag {STATUS!r} of dtype i1")
        for coordinate in self.coordinates:
            if coordinate.values.shape != tuple(sizes.get(name, -1) for name in coordinate.dims):
                raise ValueError(f"coordinate {coordinate.name} does not fit {coordinate.dims} of {sizes}")
        for variable in self.variables:
            if not set(self.tail(variable)) <= set(sizes):
                raise ValueError(f"{variable.name}: a {variable.kind} where there is no such dimension")
        if clash := [name for name in RESERVED if name in self.provenance]:
            raise ValueError(f"provenance fills in {', '.join(clash)} itself")

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Every dimension and its size, the case dimensions first."""
        return dict(self.dims) | dict(self.tails)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Sizes of the case dimensions."""
        return tuple(size for _, size in self.dims)

    @cached_property
    def cut(self) -> Cut:
        """How the cells are cut in units."""
        return Cut(self.shape, self.chunk)

    @cached_property
    def stored(self) -> Cut:
        """How the cells are cut in the chunks of the archive, the same for all variables."""
        bytes_per_cell = max(np.dtype(v.dtype).itemsize * math.prod(self.shape_of(v, 1)[2:]) for v in self.variables)
        whole = all(self.chunk_of(v) == self.shape_of(v, 1) for v in self.variables)  # not cut along t
        if self.chunk * bytes_per_cell >= SMALL_BYTES or not whole:
            return self.cut
        return largest_cut(self.shape, max(self.chunk, JOINED_BYTES // bytes_per_cell))

    @property
    def joined(self) -> bool:
        """Whether chunks of the archive are several units."""
        return self.stored != self.cut

    @cached_property
    def cells(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @cached_property
    def units(self) -> int:
        """Number of units."""
        return self.cut.count

    def cells_of(self, unit: int) -> range:
        """Return the cells of a unit, without the padding of a row's last one."""
        return self.cut.cells_of(unit)

    def tail(self, variable: Variable) -> tuple[str, ...]:
        """Return the dimensions a variable has beyond the cases."""
        return _TAILS.get(variable.kind, ())

    def dims_of(self, variable: Variable) -> tuple[str, ...]:
        """Return a variable's dimensions in the archive."""
        return tuple(name for name, _ in self.dims) + self.tail(variable)

    def shape_of(self, variable: Variable, units: int) -> tuple[int, ...]:
        """Return the shape of a variable's array of so many units: ``(units, chunk, …)``."""
        return (units, self.chunk, *(self.sizes[name] for name in self.tail(variable)))

    def chunk_of(self, variable: Variable) -> tuple[int, ...]:
        """Return the chunk of a variable in a shard, ``(1, chunk[, length, …])``, at most 4 MiB.

        A long history is cut along ``t``, orbits along ``point``, into nearly equal lengths.
        """
        _, _, *tail = self.shape_of(variable, 1)
        if not tail:
            return (1, self.chunk)
        size, *rest = tail
        longest = max(1, CHUNK_BYTES // (self.chunk * np.dtype(variable.dtype).itemsize * math.prod(rest)))
        pieces = -(-size // longest)
        return (1, self.chunk, -(-size // pieces), *rest)

    def archive_chunk_of(self, variable: Variable) -> tuple[int, ...]:
        """Return the chunk of a variable in the archive; joined ones are not cut along ``t``."""
        _, _, *tail = self.shape_of(variable, 1) if self.joined else self.chunk_of(variable)
        return (*self.stored.lengths, *tail)

    @cached_property
    def structure(self) -> str:
        """Hash of what decides a shard's bytes: a shard of another structure cannot be gathered."""
        variables = [(v.name, v.kind, v.dtype, self.chunk_of(v)) for v in self.variables]
        parts = json.dumps([FORMAT, self.key, self.dims, dict(self.tails), self.cut.lengths, variables])
        return hashlib.sha256(parts.encode()).hexdigest()


def blank(layout: Layout, units: int) -> dict[str, NDArray[Any]]:
    """Return arrays for so many units in which nothing has run yet: NaN, status ``not_run``, flags 0.

    The padding of partial units may stay as it is.
    """
    return {v.name: np.full(layout.shape_of(v, units), v.fill, dtype=v.dtype) for v in layout.variables}


def truncated_message(text: str) -> str:
    """Return a case's message cut to :data:`LONGEST_MESSAGE` bytes."""
    encoded = text.encode(errors="replace")
    if len(encoded) <= LONGEST_MESSAGE:
        return encoded.decode()
    return encoded[: LONGEST_MESSAGE - 3].decode(errors="ignore") + "…"
