"""Matrices of a twisted compressor blade in three dimensions, made with scikit-fem: NPZ and Matrix Market.

    python studies/finite_element_blade.py data/compressor_blade.npz              the matrices kept in data/
    python studies/finite_element_blade.py fine.npz --elements 10 40 1            a finer mesh
    python studies/finite_element_blade.py fine --elements 10 40 1                a directory of Matrix Market files
    python studies/finite_element_blade.py data/chord.npz --chord --elements 4 3 1    contacts along the whole tip
    python studies/finite_element_blade.py data/spinning_blade.npz --spin --elements 4 3 1    what the speed does to it

The blade is of Ti-6Al-4V, 100 mm long, 40 mm wide, 2.4 mm thick in the middle and 0.8 mm at its edges, set at 20° to
the engine's axis at the root and at 50° at the tip. Its root is clamped and cold; its surface loses heat to the air. It
touches a conical casing with the leading edge of its tip, or with its chord: the corners of the elements there, at
half the thickness, from the leading to the trailing edge. With --spin the file holds what a speed Ω adds: centrifugal
loads, the stiffness of their stress, less what turning with the rotor takes; Coriolis' forces are left out.
Elements are hexahedra with 27 nodes, for displacement and temperature alike, so that one of them through the thickness
bends as it should.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse
from skfem import Basis, BilinearForm, ElementHex2, ElementVector, FacetBasis, LinearForm, MeshHex, condense, solve
from skfem.helpers import ddot, div, dot, eye, grad, sym_grad, trace

LENGTH, WIDTH, THICKNESS, EDGE = 0.100, 0.040, 2.4e-3, 0.8e-3
"""m; the thickness falls from the middle to the edges as a parabola."""

STAGGER = np.radians([20.0, 50.0])
"""Angle of the chord to the engine's axis, at the root and at the tip."""

YOUNG, POISSON, DENSITY = 114e9, 0.33, 4430.0
SPECIFIC_HEAT, CONDUCTIVITY, CONVECTION, EXPANSION = 560.0, 7.0, 400.0, 9.0e-6
"""Of Ti-6Al-4V, SI; the convection of moderately fast air, W/m2/K."""

CONE = np.radians(15.0)
"""Angle of the casing to the engine's axis."""

HUB = 0.25
"""Radius of the root, m; the engine turns from z towards y."""

ELEMENTS = (4, 5, 1)
"""Along the chord, the span and the thickness, of the matrices in data/."""


def mesh(elements: tuple[int, int, int]) -> MeshHex:
    """Return hexahedra on the twisted blade: x along the engine's axis, y across, z along the span."""
    chord, span, thick = (np.linspace(0, 1, count + 1) for count in elements)
    flat = MeshHex.init_tensor(chord, span, thick)
    along, up, through = flat.p
    half = (EDGE + (THICKNESS - EDGE) * 4 * along * (1 - along)) / 2
    p, q, angle = (along - 0.5) * WIDTH, (2 * through - 1) * half, STAGGER[0] + (STAGGER[1] - STAGGER[0]) * up
    place = np.array([p * np.cos(angle) - q * np.sin(angle), p * np.sin(angle) + q * np.cos(angle), up * LENGTH])
    return MeshHex(place, flat.t)


def matrices(
    elements: tuple[int, int, int], chord: bool = False, spin: bool = False
) -> dict[str, scipy.sparse.csr_matrix | np.ndarray]:
    """Return the matrices without the clamped, cold root, the vectors of the contact, and the nodes' places [m]."""
    body = mesh(elements)
    moving = Basis(body, ElementVector(ElementHex2()), intorder=5)
    warm = Basis(body, ElementHex2(), intorder=5)
    skin = FacetBasis(body, ElementHex2(), facets=body.facets_satisfying(lambda x: x[2] > 1e-9, True), intorder=5)
    whole = mechanical_matrices(moving, warm) | thermal_matrices(warm, skin)
    free, rises = (np.flatnonzero(basis.doflocs[2] > 1e-9) for basis in (moving, warm))
    rows = {"mass": free, "stiffness": free, "coupling": free, "heat_capacity": rises, "conductance": rises}
    columns = {**rows, "coupling": rises}
    tidy = {name: _tidy(whole[name][rows[name]][:, columns[name]], name != "coupling") for name in whole}
    contact = _chord(moving, warm, elements[0]) if chord else _contact(moving, warm)
    if spin:
        stiffening, load = spinning(moving, whole["stiffness"], free)
        tidy["stiffness_speed2"] = _tidy(stiffening[free][:, free], True)
        contact |= {
            "load_speed2": load[free],
            "trailing_edge": _normal(moving, 1.0)[free],
            "load": contact["contact"][free],
        }
    kept = {name: rises if name == "thermal_contact" else free for name in ("contact", "tangent", "thermal_contact")}
    contact |= {name: contact[name][..., kept[name]] for name in kept if name in contact}
    axes = np.array([f"{k // 3}.{'xyz'[k % 3]}" for k in range(moving.N)])
    return {**tidy, **contact, "labels": axes[free], "places": warm.doflocs[:, rises]}


def spinning(moving: Basis, stiffness: scipy.sparse.csr_matrix, free: np.ndarray) -> tuple:
    """Return what a speed of 1 rad/s about the engine's axis adds: stiffness [N s2/(m rad2)] and load [N s2/rad2].

    The load is ρ r, r the distance from the axis; the stiffness is that of the stress σ which it makes, ∫ σ : ∇uᵀ∇v,
    less the mass that moves across the axis, ∫ ρ (u·v)⊥.
    """
    across = np.diag([0.0, 1.0, 1.0])[:, :, None, None]
    load = LinearForm(lambda v, w: DENSITY * (w.x[1] * v[1] + (w.x[2] + HUB) * v[2])).assemble(moving)
    stretched = moving.interpolate(solve(*condense(stiffness, load, I=free)))
    strain = sym_grad(stretched)
    stress = YOUNG / (1 + POISSON) * (strain + POISSON / (1 - 2 * POISSON) * eye(trace(strain), 3))
    stiffening = BilinearForm(
        lambda u, v, w: (
            np.einsum("ij...,ki...,kj...", stress, grad(u), grad(v))
            - DENSITY * np.einsum("ij...,j...,i...", across, u, v)
        )
    ).assemble(moving)
    return stiffening, load


def mechanical_matrices(moving: Basis, warm: Basis) -> dict[str, scipy.sparse.csr_matrix]:
    """Return mass [kg], stiffness [N/m] and coupling [N/K] of the material."""
    second = YOUNG / (2 * (1 + POISSON))
    first = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    swelling = EXPANSION * (3 * first + 2 * second)
    strain = BilinearForm(lambda u, v, w: ddot(2 * second * sym_grad(u) + first * eye(trace(grad(u)), 3), sym_grad(v)))
    return {
        "mass": BilinearForm(lambda u, v, w: DENSITY * dot(u, v)).assemble(moving),
        "stiffness": strain.assemble(moving),
        "coupling": BilinearForm(lambda t, v, w: -swelling * t * div(v)).assemble(warm, moving),
    }


def thermal_matrices(warm: Basis, skin: FacetBasis) -> dict[str, scipy.sparse.csr_matrix]:
    """Return heat capacity [J/K] and conductance [W/K] of the material, its skin in the air."""
    return {
        "heat_capacity": BilinearForm(lambda t, s, w: DENSITY * SPECIFIC_HEAT * t * s).assemble(warm),
        "conductance": BilinearForm(lambda t, s, w: CONDUCTIVITY * dot(grad(t), grad(s))).assemble(warm)
        + BilinearForm(lambda t, s, w: CONVECTION * t * s).assemble(skin),
    }


def _tidy(matrix: scipy.sparse.csr_matrix, symmetric: bool) -> scipy.sparse.csr_matrix:
    """Return a matrix symmetric to the bit, as assembling leaves it to rounding, without rounded zeros."""
    matrix = (matrix + matrix.T) / 2 if symmetric else matrix
    matrix = scipy.sparse.csr_matrix(matrix)
    matrix.data[np.abs(matrix.data) < 1e-15 * np.abs(matrix.data).max()] = 0.0
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix


def _at(basis: Basis, place: float) -> np.ndarray:
    """Return which freedoms lie at a place of the tip's chord: -1 is its leading edge, 1 its trailing edge."""
    corner = np.array([place * np.cos(STAGGER[1]) * WIDTH / 2, place * np.sin(STAGGER[1]) * WIDTH / 2, LENGTH])
    distance = np.linalg.norm(basis.doflocs - corner[:, None], axis=0)
    return distance < distance.min() + 1e-9


def _normal(moving: Basis, place: float) -> np.ndarray:
    """Return the casing's normal at a place of the tip's chord."""
    normal = np.zeros(moving.N)
    normal[_at(moving, place)] = [-np.sin(CONE), 0.0, np.cos(CONE)]
    return normal


def _contact(moving: Basis, warm: Basis) -> dict[str, np.ndarray]:
    """Return the casing's normal at the leading edge of the tip, and the temperature that takes the heat."""
    return {"contact": _normal(moving, -1.0), "thermal_contact": _at(warm, -1.0).astype(float)}


def _chord(moving: Basis, warm: Basis, elements: int) -> dict[str, np.ndarray]:
    """Return normals, sliding directions and temperatures of the contacts along the tip, their angles and names.

    The casing is a cone about the x axis, which lies a hub's radius below the root. It slides against the turning.
    """
    count, angle = elements + 1, STAGGER[1]
    along = (np.linspace(0, 1, count) - 0.5) * WIDTH
    normal, tangent, heat = (np.zeros((count, size)) for size in (moving.N, moving.N, warm.N))
    angles = np.zeros(count)
    for k, p in enumerate(along):
        corner = np.array([p * np.cos(angle), p * np.sin(angle), LENGTH])
        at = np.linalg.norm(warm.doflocs - corner[:, None], axis=0).argmin()
        there = np.linalg.norm(moving.doflocs - warm.doflocs[:, [at]], axis=0) < 1e-9
        psi = angles[k] = np.arctan2(corner[1], HUB + LENGTH)
        normal[k, there] = [-np.sin(CONE), np.cos(CONE) * np.sin(psi), np.cos(CONE) * np.cos(psi)]
        tangent[k, there] = [0.0, -np.cos(psi), np.sin(psi)]
        heat[k, at] = 1.0
    names = ["leading", *(f"{k / elements:.0%}".replace("%", " %") for k in range(1, elements)), "trailing"]
    rows = {"contact": normal, "tangent": tangent, "thermal_contact": heat}
    return {**rows, "angle": angles, "contact_labels": np.array(names)}


def write_npz(found: dict, place: Path, save: Callable[..., None] = np.savez_compressed) -> None:
    """Write all matrices into one file: entry NAME.data, NAME.indices, NAME.indptr, NAME.shape of each sparse one."""
    entries = {}
    for name, value in found.items():
        if scipy.sparse.issparse(value):
            parts = {part: getattr(value, part) for part in ("data", "indices", "indptr", "shape")}
            entries |= {f"{name}.{part}": numbers for part, numbers in parts.items()}
        elif name != "places":
            entries[name] = value
    save(place, **entries)


def write_matrix_market(found: dict, place: Path) -> None:
    """Write a directory with one file for each matrix and vector."""
    place.mkdir(parents=True, exist_ok=True)
    for name, value in found.items():
        if name == "places":
            continue
        if name in ("labels", "contact_labels"):
            (place / f"{name}.txt").write_text("\n".join(value) + "\n")
            continue
        matrix = value if scipy.sparse.issparse(value) else value.reshape(len(value), -1)
        scipy.io.mmwrite(place / f"{name}.mtx", matrix, precision=17)


def main() -> None:
    """Write the matrices of a mesh to the place that is named."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("place", type=Path, help="FILE.npz, or a directory for Matrix Market files")
    parser.add_argument("--elements", type=int, nargs=3, default=ELEMENTS, metavar=("CHORD", "SPAN", "THICKNESS"))
    parser.add_argument("--chord", action="store_true", help="contacts along the tip, not at its leading edge alone")
    parser.add_argument("--spin", action="store_true", help="what the speed adds to stiffness and load")
    arguments = parser.parse_args()
    found = matrices(tuple(arguments.elements), arguments.chord, arguments.spin)
    write = write_npz if arguments.place.suffix == ".npz" else write_matrix_market
    write(found, arguments.place)
    print(f"{arguments.place}: {found['mass'].shape[0]} displacements, {found['heat_capacity'].shape[0]} temperatures")


if __name__ == "__main__":
    main()
