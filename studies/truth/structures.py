"""The structures of scenes in this directory that are meshed: bars, heated rods, beams and a half-plane.

    python studies/truth/structures.py        writes the file of matrices of each study

A scene that refines its mesh, or varies a number of its structure, makes the matrices anew.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workflow import write_matrices

Array = NDArray[np.float64]
Entries = dict[str, Array]

LIGHT = 1e-9
"""Mass of a unit rod and of a casing that wears: sound passes the rod 3e4 times while heat does once."""


def bar(cells: int) -> tuple[Array, Array]:
    """Return lumped mass and stiffness of a free bar of unit mass and unit stiffness, ``(node, node)``."""
    share = np.full(cells + 1, 1 / cells)
    share[[0, -1]] /= 2
    strain = np.diff(np.eye(cells + 1), axis=0)
    return np.diag(share), cells * strain.T @ strain


def colliding_bars(cells: int = 100) -> Entries:
    """Return two equal bars of steel, of which the second is clamped at its far end: the first strikes it."""
    mass, stiffness = np.zeros((2, 2 * cells + 1, 2 * cells + 1))
    for nodes in (np.s_[: cells + 1], np.s_[cells + 1 :]):
        size = mass[nodes, nodes].shape[0]
        for of_both, of_one, unit in zip((mass, stiffness), bar(cells), (7800 * 4e-4, 2e11 * 4e-4), strict=True):
            of_both[nodes, nodes] = unit * of_one[:size, :size]
    contact = np.zeros((1, 2 * cells + 1))
    contact[0, cells : cells + 2] = 1, -1
    return {"mass": mass, "stiffness": stiffness, "contact": contact}


def heated_rod(cells: int = 100, tip_conductance: float = 0.0) -> Entries:
    """Return a rod with a clamped and cold root, with unit length, stiffness, expansion, conductance, capacity."""
    share, stiffness = (matrix[1:, 1:] for matrix in bar(cells))
    strain, mean = np.eye(cells) - np.eye(cells, k=-1), (np.eye(cells) + np.eye(cells, k=-1)) / 2
    conductance, tip = stiffness.copy(), np.eye(cells)[-1:]
    conductance[-1, -1] += tip_conductance
    own = {"mass": LIGHT * share, "damping": 10 * LIGHT * share, "stiffness": stiffness, "coupling": -strain.T @ mean}
    return {**own, "heat_capacity": share, "conductance": conductance, "contact": tip, "thermal_contact": tip}


def cooled_rod(cells: int = 100) -> Entries:
    """Return the heated rod whose tip loses as much heat per kelvin as the rod conducts."""
    return heated_rod(cells, tip_conductance=1.0)


def worn_rod(cells: int = 100, wear: float = 1.0) -> Entries:
    """Return the heated rod and the casing that it wears, a coordinate on a dashpot of 1/wear."""
    rod = heated_rod(cells)
    mass, damping, stiffness = (np.pad(rod[name], ((0, 1), (0, 1))) for name in ("mass", "damping", "stiffness"))
    mass[-1, -1], damping[-1, -1] = LIGHT, 1 / wear
    contact = np.append(rod["contact"], [[-1.0]], axis=1)
    coupling = np.pad(rod["coupling"], ((0, 1), (0, 0)))
    return {**rod, "mass": mass, "damping": damping, "stiffness": stiffness, "coupling": coupling, "contact": contact}


def worn_wall(wear: float = 1e-3, stiffness: float = 400.0, damping: float = 2.0) -> Entries:
    """Return a mass of 1 kg on a spring and a damper, and the casing of 1e-6 kg that it wears."""
    return {
        "mass": np.diag([1.0, 1e-6]),
        "stiffness": np.diag([stiffness, 0.0]),
        "damping": np.diag([damping, 1 / wear]),
        "contact": np.array([[1.0, -1.0]]),
        "load": np.array([1.0, 0.0]),
    }


def worn_wall_impact() -> Entries:
    """Return the mass without its spring and damper."""
    return worn_wall(stiffness=0.0, damping=0.0)


def beam(elements: int, length: float, bending: float, mass: float) -> tuple[Array, Array, Array]:
    """Return consistent mass, stiffness and K_Ω of a beam, deflection and slope of each node from the root.

    Parameters
    ----------
    bending, mass
        E I [N m²] and mass per length [kg/m]. The root lies on the axis of rotation, so that at a speed Ω the tension
        is Ω² mass (length² - z²)/2; the deflection is along the axis.
    """
    cell = length / elements
    M, K, K_speed = np.zeros((3, 2 * elements + 2, 2 * elements + 2))
    points, weights = np.polynomial.legendre.leggauss(4)
    for at, weight in zip((points + 1) / 2, weights * cell / 2, strict=True):
        deflection = [(1 + 2 * at) * (1 - at) ** 2, cell * at * (1 - at) ** 2]
        deflection += [at**2 * (3 - 2 * at), cell * at**2 * (at - 1)]
        slope = [6 * at * (at - 1) / cell, (1 - at) * (1 - 3 * at), 6 * at * (1 - at) / cell, at * (3 * at - 2)]
        curvature = [(12 * at - 6) / cell**2, (6 * at - 4) / cell, (6 - 12 * at) / cell**2, (6 * at - 2) / cell]
        for k in range(elements):
            nodes = np.s_[2 * k : 2 * k + 4, 2 * k : 2 * k + 4]
            M[nodes] += weight * mass * np.outer(deflection, deflection)
            K[nodes] += weight * bending * np.outer(curvature, curvature)
            tension = mass * (length**2 - ((k + at) * cell) ** 2) / 2
            K_speed[nodes] += weight * tension * np.outer(slope, slope)
    return M, K, K_speed


def falling_beam(elements: int = 10) -> Entries:
    """Return a beam of aluminium of 14 mm square, pinned at its root, that lands with its tip."""
    side = 0.014
    M, K, _ = (matrix[1:, 1:] for matrix in beam(elements, 0.783, 6.7e10 * side**4 / 12, 2400 * side**2))
    return {"mass": M, "stiffness": K, "contact": np.eye(len(M))[-2:-1]}


def rotating_beam(elements: int = 40) -> Entries:
    """Return a cantilever of unit length, E I and mass per length, which turns about its root."""
    M, K, K_speed = (matrix[2:, 2:] for matrix in beam(elements, 1.0, 1.0, 1.0))
    return {"mass": M, "stiffness": K, "stiffness_speed2": K_speed, "contact": np.eye(len(M))[-2:-1]}


WAVELENGTH, CONDUCTIVITY, MODULUS, EXPANSION, DENSITY, SPECIFIC_HEAT = 0.02, 7.0, 1e11, 1e-5, 4430.0, 560.0
"""Of the half-plane, SI."""


def hot_spots(contacts: int = 4) -> Entries:
    """Return a quarter of a wavelength of a half-plane in plane stress, 1 mm thick, with contacts at its surface nodes.

    Bilinear elements on a grid that coarsens with depth, to 1.5 wavelengths: K is a sum of products of matrices of
    lines. At x = 0 the field is symmetric, at the other side antisymmetric: cold, and held along the surface's normal.
    """
    E, nu, thickness = MODULUS, 0.3, 1e-3
    depth = -1.5 * WAVELENGTH * np.expm1(3 * np.linspace(1, 0, 3 * contacts + 1)) / np.expm1(3)
    x, y = _line(np.linspace(0, WAVELENGTH / 4, contacts + 1)), _line(depth)
    area, conduction = np.kron(x[0], y[0]), np.kron(x[1], y[0]) + np.kron(x[0], y[1])
    axial, shear = thickness * E / (1 - nu**2), thickness * E / (2 + 2 * nu)
    mixed = nu * axial * np.kron(x[2], y[2].T) + shear * np.kron(x[2].T, y[2])
    along = axial * np.kron(x[1], y[0]) + shear * np.kron(x[0], y[1])
    across = axial * np.kron(x[0], y[1]) + shear * np.kron(x[1], y[0])
    stiffness = np.block([[along, mixed], [mixed.T, across]])
    pressure = thickness * E * EXPANSION / (1 - nu)  # per kelvin
    coupling = -pressure * np.vstack([np.kron(x[2], y[0]), np.kron(x[0], y[2])])
    column, row = np.divmod(np.arange(len(area)), len(depth))
    odd = (row > 0) & (column > 0)
    even = (row > 0) & (column < contacts)
    kept, surface = np.append(odd, even), row[even] == len(depth) - 1
    mass = thickness * DENSITY * np.kron(np.eye(2), area)[np.ix_(kept, kept)]
    return {
        "mass": mass,
        "damping": 10 * mass,
        "stiffness": stiffness[np.ix_(kept, kept)],
        "coupling": coupling[np.ix_(kept, even)],
        "heat_capacity": thickness * DENSITY * SPECIFIC_HEAT * area[np.ix_(even, even)],
        "conductance": thickness * CONDUCTIVITY * conduction[np.ix_(even, even)],
        "contact": np.pad(np.eye(even.sum())[surface], ((0, 0), (odd.sum(), 0))),
        "thermal_contact": np.eye(even.sum())[surface],
    }


def _line(nodes: Array) -> tuple[Array, Array, Array]:
    """Return ∫ N N, ∫ N′ N′ and ∫ N′ N of the linear shape functions N on a line."""
    matrices = np.zeros((3, len(nodes), len(nodes)))
    for k, cell in enumerate(np.diff(nodes)):
        one = [[cell / 3, cell / 6], [cell / 6, cell / 3]], [[1 / cell, -1 / cell], [-1 / cell, 1 / cell]]
        matrices[:, k : k + 2, k : k + 2] += [*one, [[-0.5, -0.5], [0.5, 0.5]]]
    return matrices[0], matrices[1], matrices[2]


FILES = {
    made.__name__: made
    for made in (
        colliding_bars,
        cooled_rod,
        falling_beam,
        hot_spots,
        rotating_beam,
        worn_rod,
        worn_wall,
        worn_wall_impact,
    )
}
"""What makes the matrices of the study of each name."""


def main(place: Path) -> None:
    """Write a file for each study."""
    for name, made in FILES.items():
        write_matrices(place / f"{name}.npz", **made())


if __name__ == "__main__":
    main(Path(__file__).parent)
