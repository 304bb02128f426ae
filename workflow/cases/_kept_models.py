"""Reduced models of large structures, kept between processes beside the machine code of kernels.

A model is named by a digest of all that decides it: its parameters and the content of its files, basis, counts and
duration, the sources of this package and of modules from outside, the versions of NumPy and SciPy. What is missing or
damaged is made again, so that the files may be deleted at any time; the oldest go as soon as there are too many.
"""

from __future__ import annotations

import hashlib
import json
import os
import pickle
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, cast
from uuid import uuid4

import numpy as np
import scipy

from workflow.declare import files_of, plain
from workflow.kernels.compiled import directory_of
from workflow.reduction import ReducedModel
from workflow.registry import outside_sources, source_digest

MOST_BYTES = 512 * 2**20
"""Of all models together: two of 100 000 displacements, or some hundred of 2 000."""


def kept_model(decided_by: Any, make: Callable[[], ReducedModel]) -> ReducedModel:
    """Return what ``make`` gives, or gave to an earlier process that needed a model decided by the same."""
    place = _place(decided_by)
    if place is None:
        return make()
    with suppress(Exception):  # it is missing or damaged
        content = place.read_bytes()
        if hashlib.sha256(content[32:]).digest() == content[:32]:
            os.utime(place)
            return cast(ReducedModel, pickle.loads(content[32:]))
    model = make()
    with suppress(Exception):  # the disk is full, or a module from outside gives what cannot be kept
        content = pickle.dumps(model)
        aside = place.with_suffix(f".{uuid4().hex}.model")  # what a killed process leaves goes like an old one
        aside.write_bytes(hashlib.sha256(content).digest() + content)
        aside.replace(place)
        _remove_oldest(place.parent)
        return cast(ReducedModel, pickle.loads(content))  # in the order of memory in which later ones read it
    return model


def _place(decided_by: Any) -> Path | None:
    """Return where a model is kept, ``None`` where it is not: no directory, or numbers that only a check changes."""
    directory = directory_of("workflow.reduction")
    if directory is None or any(file.shaken for file in files_of(decided_by)):
        return None
    versions = source_digest("workflow"), outside_sources(), np.__version__, scipy.__version__
    text = json.dumps([plain(decided_by), versions, os.environ.get("OPENBLAS_CORETYPE")], sort_keys=True)
    return directory / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.model"


def _remove_oldest(directory: Path) -> None:
    """Remove the models that were used longest ago, of more than :data:`MOST_BYTES`."""
    left = MOST_BYTES
    for used, place in sorted(((path.stat(), path) for path in directory.glob("*.model")), key=_last, reverse=True):
        left -= used.st_size
        if left < 0:
            place.unlink()


def _last(entry: tuple[os.stat_result, Path]) -> float:
    return entry[0].st_mtime
