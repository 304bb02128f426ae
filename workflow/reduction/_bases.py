"""Interior vectors of several bases: orthonormal in the inertia, 0 at the tip."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workflow.models import Array, Structure

Inertia = Callable[[Array], Array]
"""Product of an inertia and vectors."""

DEPENDENT = 1e-8
"""Norm of the new part of a vector, over the vector's, up to which it is linearly dependent: half of the digits, so
that the new part has the other half before it is orthogonalised again."""


def fixed_interface_modes(structure: Structure, count: int) -> Array:
    """Return the lowest mechanical modes with the tip held, ``(node, mode)``."""
    return structure.mechanical.modes(count, held=True).shapes


def relative_thermal_modes(structure: Structure, count: int) -> Array:
    """Return the slowest thermal modes of the whole structure relative to its constraint mode, ``(node, mode)``.

    Their span with the constraint mode contains the modes themselves, tip included. For heat this is more accurate than
    fixed-interface modes, every second of which heat at the tip excites without effect on the tip. A mode that is the
    constraint mode is skipped.

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
        Vectors in their order, ``(node, vector)``; those that depend on the tip's and earlier ones are skipped.
    constraint
        Constraint mode, 1 at the tip, ``(node,)``.
    inertia
        Product of the inertia and vectors.

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
    """Gram–Schmidt orthonormalisation in an inertia, up to a number of vectors.

    Parameters
    ----------
    size
        Entries of a vector.
    count
        Number of vectors.
    inertia
        Product of the inertia and vectors.
    """

    def __init__(self, size: int, count: int, inertia: Inertia) -> None:
        self._vectors = np.zeros((size, count))
        self._count = 0
        self._inertia = inertia

    @property
    def is_full(self) -> bool:
        """Whether the number of vectors is reached."""
        return self._count == self._vectors.shape[1]

    def add(self, vector: Array, length: float | None = None) -> Array | None:
        """Add the new part of a vector and return it normalised, ``None`` where the vector is dependent.

        The new part is compared with ``length``, by default that of the vector.
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
        for _ in range(2):  # the second pass removes the rounding of the first
            vector = vector - vectors @ (vectors.T @ self._inertia(vector))
        return vector

    def add_each(self, vectors: Array) -> None:
        """Add vectors ``(entry, vector)`` in their order until the number is reached."""
        for vector in vectors.T:
            self.add(vector)

    def all(self) -> Array:
        """Return the vectors, ``(entry, vector)``.

        Raises
        ------
        ValueError
            There are too few.
        """
        if not self.is_full:
            raise ValueError(f"only {self._count} of {self._vectors.shape[1]} vectors are independent of the tip")
        return self._vectors
