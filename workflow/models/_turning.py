"""What a turning blade needs beside mass and stiffness: K_Ω from several speeds, contacts of the nodes of its tip."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workflow.kernels import Array


def matrices_at_speeds(at: Mapping[float, Any]) -> Any:
    """Return K_Ω of K(Ω) = K(Ω₀) + (Ω² - Ω₀²) K_Ω, the entry ``stiffness_speed2``; of loads r, ``load_speed2``.

    Of two speeds it is the difference, of more the least squares; a warning says what is left of the largest change.

    Parameters
    ----------
    at
        Matrices of one shape, dense or SciPy's sparse ones, by their speeds Ω, rad/s. Ω₀ is the slowest; where that is
        not 0 the stiffness at rest is K(Ω₀) - Ω₀² K_Ω.

    Raises
    ------
    ValueError
        There are not two speeds at least, or shapes differ.
    """
    first, *speeds = sorted(at) or [0.0]
    if not speeds or len({np.shape(value) for value in at.values()}) > 1:
        raise ValueError("K_Ω needs matrices of one shape at two speeds or more, as {0: K0, 942.478: K9000} in rad/s")
    squares, changes = {k: k**2 - first**2 for k in speeds}, {k: at[k] - at[first] for k in speeds}
    found = sum(squares[k] * changes[k] for k in speeds) / sum(square**2 for square in squares.values())
    if len(speeds) > 1:
        left, worst = max((float(abs(changes[k] - squares[k] * found).max()), k) for k in speeds)
        share = left / (float(abs(changes[speeds[-1]]).max()) or 1.0)
        words = (
            f"Ω² K_Ω leaves {share:.2g} of the change up to {speeds[-1]:g} rad/s unexplained, most at {worst:g} rad/s"
        )
        warnings.warn(words, stacklevel=2)
    return found


def casing_contacts(
    coordinates: ArrayLike,
    displacements: Sequence[Sequence[int]],
    size: int,
    axis: ArrayLike,
    origin: ArrayLike = (0.0, 0.0, 0.0),
) -> dict[str, Array]:
    """Return the entries of a file for nodes that touch a casing about an axis a.

    With e_r from the axis to a node ``contact`` w = e_r points to the casing; the blade moves along a × e_r, and the
    casing slides past it along ``tangent`` t = e_r × a, ``(contact, size)``; ``angle`` [rad], ``(contact,)``, is that
    from the first node, in the direction in which the blade turns.

    Parameters
    ----------
    coordinates, displacements
        Place of each node and indices of its displacements x, y and z in the matrices, ``(contact, 3)``.
    size
        Number of displacements.
    axis, origin
        Direction of a, about which the blade turns by the right hand, and a point of it, ``(3,)``.
    """
    along = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    outward = np.atleast_2d(np.asarray(coordinates, dtype=float)) - np.asarray(origin, dtype=float)
    outward -= np.outer(outward @ along, along)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    contact, tangent = np.zeros((2, len(outward), size))
    for row, at in enumerate(displacements):
        contact[row, list(at)], tangent[row, list(at)] = outward[row], np.cross(outward[row], along)
    angle = np.arctan2(outward @ np.cross(along, outward[0]), outward @ outward[0])
    return {"contact": contact, "tangent": tangent, "angle": angle}
