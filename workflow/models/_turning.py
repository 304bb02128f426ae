"""What a turning blade needs beside mass and stiffness: K_Ω from several speeds, contacts of the nodes of its tip."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workflow.kernels import Array


def matrices_at_speeds(at: Mapping[float, Any]) -> Any:
    """Return K_Ω of K(Ω) = K(Ω₀) + (Ω² - Ω₀²) K_Ω, the entry ``stiffness_speed2``; of loads f(Ω) r, ``load_speed2``.

    Ω₀ is the slowest speed. Of two speeds K_Ω is the difference, of more the least squares; a warning says what is left
    of the largest change.

    Parameters
    ----------
    at
        By the speed Ω, rad/s, what it is there: dense arrays or SciPy's sparse ones, of one shape. With Ω₀ > 0 the
        stiffness at rest is K(Ω₀) - Ω₀² K_Ω.

    Raises
    ------
    ValueError
        There are not two speeds at least, or shapes differ.
    """
    speeds = sorted(at)
    if len(speeds) < 2 or len({np.shape(value) for value in at.values()}) > 1:
        raise ValueError("K_Ω needs matrices of one shape at two speeds or more, as {0: K0, 942.478: K9000} in rad/s")
    slowest, fastest = at[speeds[0]], at[speeds[-1]]
    squares = {speed: speed**2 - speeds[0] ** 2 for speed in speeds[1:]}
    found = sum(s * (at[speed] - slowest) for speed, s in squares.items()) / sum(s**2 for s in squares.values())
    left = {speed: float(abs(at[speed] - slowest - s * found).max()) for speed, s in squares.items()}
    if len(speeds) > 2:
        worst, most = max(left, key=left.__getitem__), float(abs(fastest - slowest).max())
        share = f"{left[worst] / most if most else 0.0:.2g} of the change up to {speeds[-1]:g} rad/s"
        warnings.warn(f"Ω² K_Ω leaves {share} unexplained, most at {worst:g} rad/s", stacklevel=2)
    return found


def casing_contacts(
    coordinates: ArrayLike,
    displacements: Sequence[Sequence[int]],
    size: int,
    axis: ArrayLike,
    origin: ArrayLike = (0.0, 0.0, 0.0),
) -> dict[str, Array]:
    """Return the entries ``contact``, ``tangent`` and ``angle`` of nodes that touch a casing about an axis.

    With e_r from the axis to a node and a the axis, w = e_r points towards the casing, the blade moves along a × e_r,
    and the casing slides past it along t = e_r × a. Angles grow in the direction in which the blade turns.

    Parameters
    ----------
    coordinates
        Places of the nodes, m, ``(contact, 3)``.
    displacements
        Indices of the displacements x, y and z of each node in the matrices, ``(contact, 3)``.
    size
        Number of displacements.
    axis
        Direction of the axis, ``(3,)``: the blade turns about it as the fingers of the right hand whose thumb it is.
    origin
        A point of the axis, m, ``(3,)``.

    Returns
    -------
    dict
        ``contact`` w and ``tangent`` t, ``(contact, size)``, and ``angle`` from the first contact, rad, ``(contact,)``.
    """
    along = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    places = np.atleast_2d(np.asarray(coordinates, dtype=float)) - np.asarray(origin, dtype=float)
    outward = places - np.outer(places @ along, along)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    contact, tangent = (np.zeros((len(outward), size)) for _ in range(2))
    for row, at in enumerate(displacements):
        contact[row, list(at)], tangent[row, list(at)] = outward[row], np.cross(outward[row], along)
    angle = np.arctan2(outward @ np.cross(along, outward[0]), outward @ outward[0])
    return {"contact": contact, "tangent": tangent, "angle": angle}
