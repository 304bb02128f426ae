"""Writes files of matrices that the model ``matrices`` reads, and refuses what it would refuse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._matrix_entries import Chosen, checked_matrices
from workflow.models._matrix_files import LABELS, MATRICES, VECTORS, refuse
from workflow.models._structure import Rayleigh


def write_matrices(path: str | Path, *, mass: Any, stiffness: Any, **entries: Any) -> Path:
    """Check the matrices of a structure and write them as NPZ, in the units in which the study will say they are.

    M x'' + C1 x' + K1 x + K12 θ = f and C2 θ' + K2 θ = q: heat that lengthens a blade has entries of K12 below 0.

    Parameters
    ----------
    path
        Of the file; it ends in ``.npz``.
    mass, stiffness
        M and K1, dense arrays or sparse ones of SciPy, (displacement, displacement).
    entries
        ``damping`` C1, ``heat_capacity`` C2, ``conductance`` K2, ``coupling`` K12 (displacement, temperature), the
        vectors ``contact``, ``thermal_contact``, ``load``, ``steady``, ``heating``, ``tangent``, and texts ``labels``
        and ``thermal_labels``.

    Raises
    ------
    UnusableMatricesError
        An entry is wrong; the message says which, and what would be right.
    """
    place, known = Path(path), (*MATRICES, *VECTORS, *LABELS)
    if place.suffix.lower() != ".npz":
        raise refuse(f"`{place.name}` is no NPZ file", "end its name in .npz")
    unknown = sorted(set(entries) - set(known))
    if unknown:
        raise refuse(f"no entry is called {', '.join(unknown)}", f"entries are {', '.join(known)}")
    given = {"mass": mass, "stiffness": stiffness, **entries}
    _check(given)
    arrays: dict[str, Any] = {}
    for name, value in given.items():
        if hasattr(value, "tocsr"):
            rows = value.tocsr()
            parts = {"data": rows.data, "indices": rows.indices, "indptr": rows.indptr, "shape": rows.shape}
            arrays.update({f"{name}.{part}": array for part, array in parts.items()})
        else:
            arrays[name] = np.asarray(value, dtype=str if name in LABELS else np.float64)
    np.savez_compressed(place, **arrays)
    return place


def _check(entries: dict[str, Any]) -> None:
    """Refuse what the model refuses; the study may name contacts that the entries leave out."""
    if "contact" in entries:
        contact, checked = None, entries
    else:
        contact, checked = 0, {name: value for name, value in entries.items() if name != "tangent"}
    heat = None if "thermal_contact" in entries or "heat_capacity" not in entries else 0
    read = {name: value.tocsr() if hasattr(value, "tocsr") else value for name, value in checked.items()}
    read |= {name: np.asarray(read[name], dtype=str) for name in LABELS if name in read}
    checked_matrices(read, Chosen(contact, heat), Rayleigh())
