"""Interior vectors that several bases share: orthonormal in the inertia, 0 at the tip."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workflow.models import Array, Structure

Inertia = Callable[[Array], Array]
"""From vectors to inertia · vectors."""

DEPENDENT = 1e-8
"""A vector whose part that is new, and vanishes at the tip, is below this share of it adds no direction: half of
the digits, so that what is kept is known to the other half before it is made orthogonal again."""


def fixed_interface_modes(structure: Structure, count: int) -> Array:
    """Return the lowest mechanical modes with the tip held, ``(node, mode)``."""
    return structure.mechanical.modes(count, held=True).shapes


def relative_thermal_modes(structure: Structure, count: int) -> Array:
    """Return the slowest thermal modes of the whole structure relative to its constraint mode, ``(node, mode)``.

    Their span with the constraint mode holds the modes themselves, tip included. For heat this
    is more accurate than fixed-interface modes: every second one of those feels the tip's
    heat but does not move the tip. A mode that is the constraint mode is passed over.

    Raises
    ------
    ValueError
        Fewer modes are independent of the tip.
    """
    shapes = structure.thermal.modes(count + 1).shapes  # one may be the constraint mode
    return relative(shapes, structure.thermal.constraint, structure.thermal.inertia_of, count)


def relative(shapes: Array, constraint: Array, inertia: Inertia, count: int) -> Array:
    """Return ``count`` vectors relative to the constraint mode, orthonormal in the inertia, ``(node, vector)``.

    Parameters
    ----------
    shapes
        Vectors to take in this order, ``(node, vector)``; what the tip and earlier ones hold is passed over.
    constraint
        1 at the tip, ``(node,)``.
    inertia
        From vectors to inertia · vectors.

    Raises
    ------
    ValueError
        Fewer are independent of the tip and of each other.
    """
    span = Orthonormal(shapes.shape[0], count, inertia)
    for shape in shapes.T:
        new = shape - shape[-1] * constraint
        new[-1] = 0.0
        span.add(new, np.sqrt(np.dot(shape, inertia(shape))))
    return span.all()


class Orthonormal:
    """Vectors made orthonormal in an inertia one after another, up to a number of them.

    Parameters
    ----------
    size
        Entries of a vector.
    count
        Vectors wanted.
    inertia
        From vectors to inertia · vectors.
    """

    def __init__(self, size: int, count: int, inertia: Inertia) -> None:
        self._vectors = np.zeros((size, count))
        self._count = 0
        self._inertia = inertia

    @property
    def is_full(self) -> bool:
        """Whether there are as many vectors as wanted."""
        return self._count == self._vectors.shape[1]

    def add(self, vector: Array, length: float | None = None) -> Array | None:
        """Add what is new in a vector and return it with length 1, ``None`` where nothing is.

        ``length`` is what the new part is compared with: that of the vector if not said.
        """
        if self.is_full:
            return None
        vectors, count = self._vectors, self._count
        size = np.sqrt(np.dot(vector, self._inertia(vector))) if length is None else length
        if size == 0:
            return None
        new = self.apart(vector)
        rest = np.sqrt(np.dot(new, self._inertia(new)))
        if not rest > DEPENDENT * size:
            return None
        vectors[:, count] = new / rest
        self._count += 1
        return np.asarray(vectors[:, count])

    def apart(self, vector: Array) -> Array:
        """Return the part of a vector that is orthogonal to those added so far."""
        vectors = self._vectors[:, : self._count]
        for _ in range(2):  # once more, so that rounding of the first pass goes too
            vector = vector - vectors @ (vectors.T @ self._inertia(vector))
        return vector

    def add_each(self, vectors: Array) -> None:
        """Add vectors ``(entry, vector)`` in their order until there are as many as wanted."""
        for vector in vectors.T:
            self.add(vector)

    def all(self) -> Array:
        """Return the vectors, ``(entry, vector)``.

        Raises
        ------
        ValueError
            There are fewer than wanted.
        """
        if not self.is_full:
            raise ValueError(f"only {self._count} of {self._vectors.shape[1]} vectors are independent of the tip")
        return self._vectors
