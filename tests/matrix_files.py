"""A structure written as every kind of file of matrices that is read."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io, sparse

from workflow.models import Structure


def matrices_of(structure: Structure) -> dict[str, Any]:
    """Return the matrices of a structure by the names of their entries."""
    return {
        "mass": structure.mass,
        "stiffness": structure.stiffness_matrix,
        "coupling": structure.coupling_matrix,
        "heat_capacity": structure.heat_capacity,
        "conductance": structure.conductance_matrix,
    }


def as_npz(entries: Mapping[str, Any], directory: Path) -> Path:
    path = directory / "blade.npz"
    np.savez(path, **entries)
    return path


def as_sparse_npz(entries: Mapping[str, Any], directory: Path) -> Path:
    """Compressed rows for M and K1, coordinates for the others, compressed."""
    parts: dict[str, Any] = {}
    for name, matrix in entries.items():
        if name in ("mass", "stiffness"):
            made = sparse.csr_array(matrix)
            parts |= {f"{name}.{part}": getattr(made, part) for part in ("data", "indices", "indptr", "shape")}
        else:
            spread = sparse.coo_array(matrix)
            row, column = spread.coords
            parts |= {
                f"{name}_row": row,
                f"{name}_col": column,
                f"{name}_data": spread.data,
                f"{name}_shape": spread.shape,
            }
    path = directory / "sparse.npz"
    np.savez_compressed(path, **parts)
    return path


def as_mat(entries: Mapping[str, Any], directory: Path) -> Path:
    """M sparse, the rest dense, compressed."""
    path = directory / "blade.mat"
    io.savemat(path, {**entries, "mass": sparse.csc_array(entries["mass"])}, do_compression=True)
    return path


def as_directory(entries: Mapping[str, Any], directory: Path) -> Path:
    """Matrix Market: K1 by its lower half, C2 as a dense array, the rest by coordinates."""
    path = directory / "blade"
    path.mkdir(exist_ok=True)
    for name, matrix in entries.items():
        made = matrix if name == "heat_capacity" else sparse.coo_array(matrix)
        symmetry = "symmetric" if name == "stiffness" else "general"
        io.mmwrite(path / f"{name}.mtx", made, precision=17, symmetry=symmetry)
    return path


def as_harwell_boeing(entries: Mapping[str, Any], directory: Path) -> Path:
    path = directory / "harwell"
    path.mkdir(exist_ok=True)
    for name, matrix in entries.items():
        io.hb_write(path / f"{name}.rua", sparse.csc_array(matrix))
    return path


def as_output4(entries: Mapping[str, Any], directory: Path) -> Path:
    from pyyeti.nastran import op4

    path = directory / "blade.op4"
    op4.write(str(path), {name[:8]: np.asarray(matrix) for name, matrix in entries.items()})
    return path


def as_calculix(entries: Mapping[str, Any], directory: Path) -> Path:
    """M and K1 by their upper halves, and names of degrees of freedom."""
    for name, suffix in (("stiffness", "sti"), ("mass", "mas")):
        matrix = np.asarray(entries[name])
        rows = [f"{i + 1} {j + 1} {matrix[i, j]:.16e}\n" for j in range(len(matrix)) for i in range(j + 1)]
        (directory / f"blade.{suffix}").write_text("".join(rows))
    (directory / "blade.dof").write_text("".join(f"{k + 1}.1\n" for k in range(len(matrix))))
    return directory / "blade.sti"


def triangle(matrix: Any) -> list[tuple[int, int, float]]:
    """Return row, column and value of the entries on and below the diagonal that are not zero."""
    lower = sparse.coo_array(np.tril(np.asarray(matrix)))
    return list(zip(*(index.tolist() for index in lower.coords), lower.data.tolist(), strict=True))


def as_abaqus(entries: Mapping[str, Any], directory: Path) -> Path:
    """FORMAT=MATRIX INPUT: node k has the displacements 2k and 2k + 1 by its dofs 1 and 2."""
    for name, short in (("stiffness", "STIF"), ("mass", "MASS"), ("damping", "DMPV")):
        if name in entries:
            rows = [
                f"{1 + i // 2},{1 + i % 2}, {1 + j // 2},{1 + j % 2}, {value:.15e}\n"
                for i, j, value in triangle(entries[name])
            ]
            (directory / f"blade_{short}1.mtx").write_text("".join(rows))
    return directory / "blade_STIF1.mtx"


def as_punch(entries: Mapping[str, Any], directory: Path) -> Path:
    """DMIG in large fields, as Nastran punches it."""
    text = "$TITLE   = BLADE\nBEGIN SUPER     101\n$\nGRID*                  1               0 0.600000000E+03\n*\n"
    for name, short in (("stiffness", "KAAX"), ("mass", "MAAX"), ("damping", "BAAX")):
        if name not in entries:
            continue
        matrix = np.asarray(entries[name])
        text += f"DMIG    {short:8}{0:8}{6:8}{2:8}{0:8}{len(matrix):24}\n"
        for j in range(len(matrix)):
            text += f"DMIG*   {short:16}{1 + j // 2:16}{1 + j % 2:16}\n"
            for i in np.flatnonzero(matrix[: j + 1, j]):
                text += f"*       {1 + i // 2:16}{1 + i % 2:16}{matrix[i, j]:16.9E}\n".replace("E", "D")
    path = directory / "blade.pch"
    path.write_text(text)
    return path


WRITERS: tuple[Callable[[Mapping[str, Any], Path], Path], ...] = (
    as_npz,
    as_sparse_npz,
    as_mat,
    as_directory,
    as_harwell_boeing,
    as_output4,
)

MECHANICAL = (as_calculix, as_abaqus, as_punch)
"""Of displacements alone."""
