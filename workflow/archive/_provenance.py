"""Where an archive comes from: its study, and the software and processor that made it."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import platform
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import workflow
from workflow.cases import Grid, arrange, choices_text, read_choices
from workflow.models import FACTORISING, has_cholmod
from workflow.pinning import is_pinned
from workflow.registry import outside_sources
from workflow.schemes import SOLVER_VERSION
from workflow.study import Study, packed, parse_study, unpacked

SOFTWARE = ("code_revision", "processor", "versions", "pinned")
"""Texts of the provenance group that decide whether two runs must agree bit for bit."""

COPIED = "copied"
"""Text of the provenance group of an archive some of whose cases were run elsewhere: what of SOFTWARE differed."""


def study_key(study: Study) -> str:
    """Return the identity of a study's results: all resolved but title and licence, and what computes them.

    That is the solver's version, and the sources of the modules from outside that the study names. How the program
    describes an axis does not enter: other words are no other study.
    """
    resolved = {name: value for name, value in study.resolved().items() if name not in ("title", "license")}
    followed = [resolved["branch"]["axis"]] if "branch" in resolved else []
    for axis in (*followed, *resolved["scalars"], *(axis for each in resolved["dimensions"] for axis in each["axes"])):
        del axis["description"]
    identity = json.dumps({"study": resolved, "solver": SOLVER_VERSION}, sort_keys=True)
    identity += "".join(str(source) for name, source in outside_sources().items() if f'"{name}"' in identity)
    return hashlib.sha256(identity.encode()).hexdigest()


@cache
def code_revision() -> str:
    """Return a hash of this package's own sources: the revision of the code that runs."""
    root = Path(workflow.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(root.rglob("*.py")):
        digest.update(f"{source.relative_to(root)}\0".encode() + source.read_bytes())
    return digest.hexdigest()


def grid_of(texts: Mapping[str, str]) -> Grid:
    """Return the grid of the study that texts of a provenance group hold, with the choices its tolerances made.

    Raises :class:`StudyError`, :class:`LookupError` or :class:`ValueError` where they cannot be read.
    """
    study = parse_study(texts["study"], "study", attached=unpacked(texts.get("files", "")))
    return arrange(study, read_choices(texts.get("choices", "{}")))


def json_in(texts: Mapping[str, str], name: str) -> dict[str, Any]:
    """Return what a text of a provenance group holds as JSON; empty where it is no mapping."""
    try:
        value = json.loads(texts.get(name, ""))
    except (ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


def provenance_of(grid: Grid) -> dict[str, str]:
    """Return the texts of the provenance group of a grid's study: ``key``, study, software."""
    study, files = grid.study, packed(grid.study)
    return {
        "key": study_key(study),
        "study": study.text,
        **({"files": files} if files else {}),
        "resolved": json.dumps(study.resolved(), sort_keys=True),
        "solver_version": str(SOLVER_VERSION),
        "versions": json.dumps(versions(), sort_keys=True),
        "code_revision": code_revision(),
        **({"choices": choices_text(grid.choices)} if grid.choices else {}),
        "platform": platform.platform(),
        "processor": processor(),
        "pinned": str(is_pinned()).lower(),
    }


@cache
def processor() -> str:
    """Return architecture, name and features of the processor that kernels are compiled for."""
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    features = "".join(sorted(name for name, there in get_host_cpu_features().items() if there))
    return f"{platform.machine()} {get_host_cpu_name()} {hashlib.sha256(features.encode()).hexdigest()[:12]}"


def versions() -> dict[str, str]:
    """Return the version of everything that has a hand in an archive."""
    packages = ("numpy", "scipy", "numba", "xarray", "netCDF4", "h5py", "dask", "pydantic", "pint", "ruamel.yaml")
    own = {"python": sys.version.split()[0], "rotor-stator-workflow": workflow.__version__}
    return own | {name: _version(name) for name in (*packages, *(FACTORISING if has_cholmod() else ()))}


@cache
def _version(package: str) -> str:
    return importlib.metadata.version(package)
