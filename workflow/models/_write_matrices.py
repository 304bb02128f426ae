"""Writer of files for the model ``matrices``, with the same checks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._matrix_entries import Chosen, checked_matrices
from workflow.models._matrix_files import LABELS, MATRICES, VECTORS
from workflow.models._semidefinite import UnusableMatricesError
from workflow.models._structure import Rayleigh


def write_matrices(path: str | Path, *, mass: Any, stiffness: Any, **entries: Any) -> Path:
    """Check the matrices of a structure and write them as NPZ, in the units that the study will state.

    M x'' + C1 x' + K1 x + K12 θ = f and C2 θ' + K2 θ = q: where heat lengthens a blade, entries of K12 are negative.

    Parameters
    ----------
    path
        Path of the file; it ends in ``.npz``.
    mass, stiffness
        M and K1, dense arrays or SciPy's sparse ones, (displacement, displacement).
    entries
        ``damping`` C1, ``heat_capacity`` C2, ``conductance`` K2, ``coupling`` K12 (displacement, temperature), the
        vectors ``contact``, ``thermal_contact``, ``load``, ``steady``, ``heating``, ``tangent``, the contacts and the
        tangent also as an index or a label, and texts ``labels`` and ``thermal_labels``.

    Raises
    ------
    UnusableMatricesError
        An entry is wrong; the message says which, and what would be right.
    """
    place, known, given = Path(path), (*MATRICES, *VECTORS, *LABELS), {"mass": mass, "stiffness": stiffness, **entries}
    if place.suffix.lower() != ".npz":
        raise UnusableMatricesError(f"`{place.name}` is no NPZ file", "end its name in .npz")
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise UnusableMatricesError(f"no entry is called {', '.join(unknown)}", f"entries are {', '.join(known)}")
    _check(given)
    arrays: dict[str, Any] = {}
    for name, value in given.items():
        if hasattr(value, "tocsr") and name in MATRICES:
            rows = value.tocsr()
            arrays |= {f"{name}.{part}": getattr(rows, part) for part in ("data", "indices", "indptr", "shape")}
        else:  # a contact may be an index or a label
            plain = np.asarray(value.toarray() if hasattr(value, "toarray") else value)
            arrays[name] = plain.astype(str) if name in LABELS else plain if plain.size == 1 else plain.astype(float)
    np.savez_compressed(place, **arrays)
    return place


def _check(given: dict[str, Any]) -> None:
    """Check the entries as the model does, except contacts, which the study may name."""
    contact, checked = None, given
    if "contact" not in given:
        contact, checked = 0, {name: value for name, value in given.items() if name != "tangent"}
    heat = None if "thermal_contact" in given or "heat_capacity" not in given else 0
    checked_matrices(checked, Chosen(contact, heat), Rayleigh())
