"""What a file claims to hold, judged from its headers before memory is spent on it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from workflow.archive._create import FORMAT_NAME, LENGTH, PROVENANCE
from workflow.archive._files import ArchiveError
from workflow.archive._layout import EARLIER, FORMAT, LONGEST_MESSAGE, MESSAGE, STATUS

LONGEST_TEXT = 2**28
"""Bytes of a text of the provenance; a resolved study whose axes have a million values takes a tenth."""


def judge(path: Path) -> None:
    """Refuse a file that is no archive, or claims sizes that no study has.

    Raises
    ------
    ArchiveError
        What is wrong with it.
    OSError, RuntimeError, LookupError, ValueError, TypeError
        It is damaged.
    """
    import h5py

    from workflow.archive._lock import LOCK

    with LOCK, h5py.File(path, "r") as file:
        recognise(path, file.attrs)
        fault = _missing(file) or _oversized(file)
    if fault:
        raise ArchiveError(f"{path}: not an archive that `workflow run` wrote: {fault}; restore a copy")


def recognise(path: Path, attributes: Any) -> None:
    """Refuse a file that does not say that it is an archive of this version."""
    if FORMAT_NAME not in attributes:
        raise ArchiveError(
            f"{path}: a NetCDF file, but not an archive of this workflow (it has no {FORMAT_NAME}); "
            "an archive that `workflow run` wrote is expected"
        )
    version = as_text(attributes[FORMAT_NAME])
    if version not in (str(EARLIER), str(FORMAT)):
        raise ArchiveError(
            f"{path}: archive format {version}, this version reads {FORMAT}; use the version that wrote it"
        )


def as_text(value: Any) -> str:
    """Return an attribute as text: netCDF-C stores ASCII as characters, anything else as a string."""
    import numpy as np

    value = np.ravel(value)[0] if isinstance(value, np.ndarray) and value.size else value
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _missing(file: Any) -> str:
    """Return which variable that every archive of a study has is missing or of another kind."""
    import h5py

    for name, kinds in ((STATUS, "i"), ("runaway", "i"), (MESSAGE, "SO")):
        stored = file.get(name)
        if stored is None and name == "runaway":  # a study's own, see _describe
            continue
        if not isinstance(stored, h5py.Dataset):
            return f"it has no {name}"
        if stored.dtype.kind not in kinds:
            return f"its {name} is of type {stored.dtype}"
        if (stored.shape[:-1] if stored.dtype.kind == "S" else stored.shape) != file[STATUS].shape:
            return f"{name} and {STATUS} differ in shape"
    return ""


def _oversized(file: Any) -> str:
    """Return what is larger than any study makes it."""
    import h5py

    from workflow.study.axes import MOST_CASES
    from workflow.study.judges import MOST_SAMPLES

    for name, stored in file.items():
        if isinstance(stored, h5py.Dataset) and max(stored.shape or (0,)) > MOST_SAMPLES and name != LENGTH:
            return f"{name} has {max(stored.shape)} values along a dimension"
    if file[MESSAGE].dtype.kind == "S" and math.prod(file[MESSAGE].shape[-1:]) > LONGEST_MESSAGE:
        return f"its messages have {file[MESSAGE].shape[-1]} characters"
    cases = math.prod(file[STATUS].shape)
    if cases > MOST_CASES:
        return f"it has {cases:.3g} cases"
    for name, stored in file.get(PROVENANCE, {}).items():
        if isinstance(stored, h5py.Dataset) and math.prod(stored.shape or (0,)) > LONGEST_TEXT:
            return f"{PROVENANCE}/{name} has {math.prod(stored.shape)} bytes"
    return ""
