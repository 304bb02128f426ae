"""What the archive of a study holds: its dimensions, coordinates and variables with CF attributes."""

from __future__ import annotations

import dataclasses
import datetime
import hashlib
import importlib.metadata
import json
import math
import platform
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

import workflow
from workflow import variables
from workflow.archive._layout import Attributes, Coordinate, Layout, Variable
from workflow.grid import (
    FRICTION,
    Grid,
    alpha_of,
    arrange,
    choices_text,
    longest_period_count,
    metrics_of,
    periods_of,
    read_choices,
    steady_of,
)
from workflow.models import FACTORISING, has_cholmod
from workflow.pinning import is_pinned
from workflow.registry import outside_sources
from workflow.schemes import SOLVER_VERSION, Status
from workflow.study import AUTO, CHOSEN, MATRIX, MODES, POINT, Axis, Drawn, Study, packed, parse_study, unpacked

HARMONIC = ("amplitude", "frequency", "order", "phase")
"""Numbers of a harmonic of the casing."""

SOFTWARE = ("code_revision", "processor", "versions", "pinned")
"""Texts of the provenance group that decide whether two runs must agree bit for bit."""

COPIED = "copied"
"""Text of the provenance group of an archive that was extended: some of its cases were run elsewhere."""


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


WARNINGS = "warnings"
"""Attribute of an archive: what its plan warned of, a line each."""


def grid_of(texts: Mapping[str, str]) -> Grid:
    """Return the grid of the study that texts of a provenance group hold, with the choices its tolerances made.

    Raises
    ------
    StudyError, LookupError, ValueError
        They cannot be read.
    """
    study = parse_study(texts["study"], "study", attached=unpacked(texts.get("files", "")))
    return arrange(study, read_choices(texts.get("choices", "{}")))


def describe(grid: Grid, warnings: str = "") -> Layout:
    """Return the layout of the archive of a grid's study, of which a plan warned so."""
    study = grid.study
    tails = _tails(study, grid)
    return Layout(
        dims=grid.dims,
        tails=tails,
        coordinates=_coordinates(study, grid, tails),
        variables=_variables(study, tails),
        attrs={
            "title": study.title,
            "summary": (
                f"Study {study.name}: tip response of a thermo-elastic structure ({study.scene.model}) that rubs on "
                f"its casing, over {', '.join(name for name, _ in grid.dims) or 'a single case'}"
            ),
            **({"license": study.license} if study.license else {}),
            "source": f"rotor-stator-workflow {workflow.__version__}, nonsmooth thermo-elastic contact solver",
            "references": (
                "Thorin, Guérin, Legrand: Rotor–stator interaction: reduction of a nonsmooth thermo-elastic "
                "unidimensional model; Acary, Brogliato: Numerical Methods for Nonsmooth Dynamical Systems (2008)"
            ),
            "history": f"{_now()}: workflow run {study.name}",
            "study": study.name,
            "duration": study.scene.duration,
            **({WARNINGS: warnings} if warnings else {}),
        },
        provenance={
            "study": study.text,
            **_attached(study),
            "resolved": json.dumps(study.resolved(), sort_keys=True),
            "solver_version": str(SOLVER_VERSION),
            "versions": json.dumps(versions(), sort_keys=True),
            "code_revision": code_revision(),
            **({"choices": choices_text(grid.choices)} if any(grid.choices) else {}),
            "platform": platform.platform(),
            "processor": processor(),
            "pinned": str(is_pinned()).lower(),
        },
        key=study_key(study),
    )


def _tails(study: Study, grid: Grid) -> dict[str, int]:
    """Return the sizes of the dimensions beyond the cases, those that there are."""
    steady, branch = study.output.steady, study.branch
    tails = {
        "t": grid.sampling.count if study.output.histories else 0,
        "period": longest_period_count(grid) if branch is None else 0,
        "point": 0 if branch is None else branch.points,
        "phase": 0 if steady is None else steady.samples,
    }
    return {name: size for name, size in tails.items() if size}


def _attached(study: Study) -> dict[str, str]:
    files = packed(study)
    return {"files": files} if files else {}


@cache
def processor() -> str:
    """Return architecture, name and features of the processor that kernels are compiled for."""
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    features = "".join(sorted(name for name, there in get_host_cpu_features().items() if there))
    return f"{platform.machine()} {get_host_cpu_name()} {hashlib.sha256(features.encode()).hexdigest()[:12]}"


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def versions() -> dict[str, str]:
    """Return the version of everything that has a hand in an archive."""
    packages = ("numpy", "scipy", "numba", "xarray", "netCDF4", "h5py", "dask", "pydantic", "pint", "ruamel.yaml")
    own = {"python": sys.version.split()[0], "rotor-stator-workflow": workflow.__version__}
    return own | {name: _version(name) for name in (*packages, *(FACTORISING if has_cholmod() else ()))}


@cache
def _version(package: str) -> str:
    return importlib.metadata.version(package)


def _coordinate(axis: Axis, dims: tuple[str, ...]) -> Coordinate:
    kind = object if any(isinstance(value, str) for value in axis.values) else None
    values = np.asarray(axis.values, dtype=kind)
    attrs: Attributes = {"long_name": axis.description, "study_path": axis.path}
    if kind is None:
        attrs = {**attrs, "units": axis.unit}
    if axis.path in MODES and CHOSEN in axis.values:
        attrs = {**attrs, "flag_values": [CHOSEN], "flag_meanings": AUTO}
    return Coordinate(axis.name, dims, values if dims else values.reshape(()), attrs)


def _coordinates(study: Study, grid: Grid, tails: Mapping[str, int]) -> tuple[Coordinate, ...]:
    coordinates = [
        _coordinate(axis, (dimension.name,)) for dimension in (*grid.outer, *grid.inner) for axis in dimension.axes
    ]
    coordinates += [_coordinate(axis, ()) for axis in study.scalars]
    coordinates += [
        one for each in study.dimensions if each.drawn is not None for one in _design(each.name, each.drawn)
    ]
    moves = _motion_of_casing(study)
    coordinates = [
        dataclasses.replace(one, attrs={**one.attrs, **moves}) if one.name == "gap" else one for one in coordinates
    ]
    followed = "" if study.branch is None else study.branch.axis.path
    makes_alpha = study.scene.friction is not None and not followed.startswith(FRICTION)
    coordinates += [_made_by_friction(study, grid)] if makes_alpha else []
    names = {coordinate.name for coordinate in coordinates} | {name for name, _ in grid.dims}
    if "gap" not in names and followed != "scene.casing.gap":
        about = {"units": "m", "long_name": "tip clearance at rest, cold", **moves}
        coordinates.append(Coordinate("gap", (), np.asarray(study.scene.gap), about))
    if "t" in tails:
        time = {"units": "s", "long_name": "time since the start"}
        coordinates.append(Coordinate("t", ("t",), grid.sampling.times, time))
    for name, meaning in (("period", "number of the load period"), ("point", "number of the point, by arclength")):
        if name in tails:
            number = {"units": "1", "long_name": meaning}
            coordinates.append(Coordinate(name, (name,), np.arange(1, tails[name] + 1), number))
    if "phase" in tails:
        share = {"units": "1", "long_name": "share of the period of the steady rub"}
        coordinates.append(Coordinate("phase", ("phase",), np.arange(tails["phase"]) / tails["phase"], share))
    return tuple(coordinates)


def _design(name: str, drawn: Drawn) -> tuple[Coordinate, Coordinate]:
    """Return which point and which matrix of a drawn zip each of its cases is."""
    about = "matrix of the case: A, B, or the path of the number that A has from B"
    points = np.repeat(np.arange(drawn.points), len(drawn.matrices))
    matrices = np.tile(np.array(drawn.matrices, dtype=object), drawn.points)
    return (
        Coordinate(POINT, (name,), points, {"units": "1", "long_name": "number of the drawn point"}),
        Coordinate(MATRIX, (name,), matrices, {"long_name": about}),
    )


def _motion_of_casing(study: Study) -> Attributes:
    """Return what the coordinate ``gap`` says of the casing's motion about it: nothing where it stays there.

    A number for each harmonic, ``casing_amplitude`` [m], ``casing_frequency`` [Hz] or ``casing_order``, the other being
    NaN, and ``casing_phase`` [rad]; ``speed`` in Hz.
    """
    harmonics = [dataclasses.asdict(entry) for entry in study.scene.casing.harmonics]
    if not harmonics:
        return {}
    columns = {name: [math.nan if one[name] is None else float(one[name]) for one in harmonics] for name in HARMONIC}
    return {"speed": [study.scene.speed], **{f"casing_{name}": column for name, column in columns.items()}}


def _made_by_friction(study: Study, grid: Grid) -> Coordinate:
    """Return α = heat_share · coefficient · sliding_speed along the dimensions that it varies with."""
    dimensions = [d for d in (*grid.outer, *grid.inner) if any(axis.path.startswith(FRICTION) for axis in d.axes)]
    shape = tuple(dimension.size for dimension in dimensions)
    varying = {
        axis.path: np.asarray(axis.values, dtype=np.float64)[index].ravel()
        for dimension, index in zip(dimensions, np.indices(shape), strict=True)
        for axis in dimension.axes
    }
    values = alpha_of(grid.settings(0), varying, math.prod(shape)).reshape(shape)
    attrs = {"long_name": "heat coupling: heat_share x coefficient x sliding_speed", "units": "W N-1"}
    return Coordinate("alpha", tuple(dimension.name for dimension in dimensions), values, attrs)


def _declared(about: variables.Variable, dtype: str = "f8") -> Variable:
    """Return a variable of the table as the archive declares it."""
    attrs = {"units": about.unit, "long_name": about.meaning}
    attrs |= {name: text for name in ("comment", "cell_methods") if (text := getattr(about, name))}
    return Variable(about.name, about.shape, dtype, attrs, optional=about.condition in ("scheme", "steady"))


def _variables(study: Study, tails: Mapping[str, int]) -> tuple[Variable, ...]:
    precision = {"float64": "f8", "float32": "f4"}[study.output.precision]
    stored = [_declared(variables.BY_NAME[name], precision) for name in study.output.histories]
    others = [*metrics_of(study), *(periods_of(study) if "period" in tails else ()), *steady_of(study)]
    flags = _flags(study)
    stored += [_declared(about) for about in others if about.name not in flags]
    names = ("status", "runaway") if study.branch is None else ("status",)
    kept = [variables.BY_NAME[name] for name in names]
    return (*stored, *(_flag(about, flags[about.name]) for about in (*others, *kept) if about.name in flags))


def _flags(study: Study) -> dict[str, tuple[str, ...]]:
    """Return what the values of flags mean, from 0 on."""
    flags = {"status": tuple(status.name.lower() for status in Status), "runaway": ("bounded", "runaway")}
    if study.output.steady is None:
        return flags
    from workflow.orbits import BIFURCATIONS, STATES

    return flags | {"steady_state": STATES, "bifurcation": BIFURCATIONS}


def _flag(about: variables.Variable, meanings: tuple[str, ...]) -> Variable:
    attrs: dict[str, str | list[int]] = {"long_name": about.meaning}
    if about.name == "steady_state":
        attrs["comment"] = about.comment
    attrs |= {"flag_values": list(range(len(meanings))), "flag_meanings": " ".join(meanings)}
    return Variable(about.name, about.shape, "i1", attrs, optional=about.condition == "steady")
