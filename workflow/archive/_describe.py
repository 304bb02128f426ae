"""What the archive of a study holds: its dimensions, coordinates and variables with CF attributes."""

from __future__ import annotations

import datetime
import hashlib
import importlib.metadata
import json
import platform
import sys
from functools import cache
from pathlib import Path

import numpy as np

import workflow
from workflow.archive._layout import Coordinate, Layout, Variable
from workflow.grid import Grid, Units, longest_period_count, scheme_metrics
from workflow.schemes import SOLVER_VERSION, Status
from workflow.study import Axis, Study

SOFTWARE = ("code_revision", "processor", "versions")
"""Texts of the provenance group that tell whether two runs must agree bit for bit."""

COPIED = "copied"
"""Text of the provenance group of an archive that was extended: some of its cases were run elsewhere."""

_HISTORIES = {
    "displacement": ("m", "displacement of the blade tip towards the casing"),
    "velocity": ("m s-1", "velocity of the blade tip towards the casing"),
    "temperature": ("K", "temperature rise of the blade tip above the root"),
    "impulse": ("N s", "impulse of the casing on the blade tip since the start"),
    "contact_force": ("N", "contact force on the blade tip, mean over the preceding interval"),
}

_METRICS = {
    "contact_impulse": ("N s", "impulse of the casing on the blade tip over the duration"),
    "impacts": ("1", "number of impacts"),
    "contact_time": ("s", "time in contact"),
    "max_penetration": ("m", "largest penetration of the casing by the blade tip"),
    "max_temperature": ("K", "largest temperature rise of the blade tip"),
    "thermal_closing": ("m", "quasi-static tip growth by the temperatures at the end"),
    "critical_alpha": ("m s-1", "heat coupling above which a tip in permanent contact runs away"),
    "growth_rate": ("s-1", "largest real eigenvalue of the structure with the tip in permanent contact"),
    "steps": ("1", "number of steps"),
    "wall_time": ("s", "computing time of the case, its share of its batch"),
}

_BALANCES = {
    "energy_residual": ("1", "residual of the mechanical energy balance, relative to the largest energy"),
    "heat_residual": ("1", "residual of the heat balance, relative to the heat turned over"),
}

_ERRORS = {
    "displacement_error": ("1", "relative L2 distance of the displacement from the reference"),
    "temperature_error": ("1", "relative L2 distance of the temperature from the reference"),
    "impulse_error": ("1", "relative L2 distance of the impulse from the reference"),
    "predictability": ("1", "relative L2 change of the reference's displacement when its gap opens by 1e-12"),
}

_PERIODS = {
    "period_impulse": ("N s", "impulse of the casing in a load period"),
    "period_force": ("N", "largest contact force in a load period, mean over an output interval"),
    "period_temperature": ("K", "largest temperature rise of the blade tip in a load period"),
    "period_contact": ("1", "share of a load period in contact"),
}

_COMMENTS = {
    "wall_time": "kernels compiled before; with its balances where output.balances is on, without its reference",
    "impacts": "event_driven: velocity jumps; time-stepping schemes: steps with an impulse after one without",
    "max_penetration": "0 where the tip never passed the casing",
    "energy_residual": (
        "(change of E - work of the loads + dissipation by damping + work against thermal forces + sum over impulses "
        "p of p (v_n before + v_n after)/2) / max E, E = vMv/2 + xK1x/2; time-stepping schemes: midpoint values of "
        "whole steps (central differences: values at the step ends), v_n at the step's ends, so that what the scheme "
        "itself gives (+) or takes (-) remains; penalty: E holds the energy of its contact spring, whose force is no "
        "loss; 0 where max E is 0; NaN where event_driven cannot integrate it at a reasonable cost"
    ),
    "heat_residual": (
        "(change of the heat content - alpha times impulse - heating + conduction to the root and convection) / heat "
        "turned over (the sum of the absolute values of alpha times impulse, heating, losses and initial content); "
        "time-stepping schemes: midpoint values of whole steps; 0 where no heat is turned over"
    ),
    "critical_alpha": "infinite where the root is free or heat at the tip does not push it out",
}


def study_key(study: Study) -> str:
    """Return the identity of a study's results: everything resolved but its title, and the solver's version."""
    resolved = {name: value for name, value in study.resolved().items() if name != "title"}
    identity = json.dumps({"study": resolved, "solver": SOLVER_VERSION}, sort_keys=True)
    return hashlib.sha256(identity.encode()).hexdigest()


@cache
def code_revision() -> str:
    """Return a hash of this package's own sources: the revision of the code that runs."""
    root = Path(workflow.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(root.rglob("*.py")):
        digest.update(f"{source.relative_to(root)}\0".encode() + source.read_bytes())
    return digest.hexdigest()


def describe(study: Study, grid: Grid, units: Units) -> Layout:
    """Return the layout of a study's archive."""
    histories = study.output.histories
    periods = longest_period_count(grid)
    return Layout(
        dims=grid.dims,
        samples=grid.sampling.count if histories else 0,
        periods=periods,
        chunk=units.chunk,
        coordinates=_coordinates(study, grid, periods),
        variables=_variables(study, periods),
        attrs={
            "title": study.title,
            "summary": (
                f"Study {study.name}: tip response of a thermo-elastic {study.scene.model} that rubs on its casing, "
                f"over {', '.join(name for name, _ in grid.dims) or 'a single case'}"
            ),
            "license": "https://creativecommons.org/licenses/by/4.0/",
            "source": f"rotor-stator-workflow {workflow.__version__}, nonsmooth thermo-elastic contact solver",
            "references": (
                "Thorin, Guérin, Legrand: Rotor–stator interaction: reduction of a nonsmooth thermo-elastic "
                "unidimensional model; Acary, Brogliato: Numerical Methods for Nonsmooth Dynamical Systems (2008)"
            ),
            "history": f"{_now()}: workflow run {study.name}",
            "study": study.name,
        },
        provenance={
            "study": study.text,
            "resolved": json.dumps(study.resolved(), sort_keys=True),
            "solver_version": str(SOLVER_VERSION),
            "versions": json.dumps(versions(), sort_keys=True),
            "code_revision": code_revision(),
            "platform": platform.platform(),
            "processor": processor(),
        },
        key=study_key(study),
    )


@cache
def processor() -> str:
    """Return name and features of the processor that kernels are compiled for."""
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    features = "".join(sorted(name for name, there in get_host_cpu_features().items() if there))
    return f"{get_host_cpu_name()} {hashlib.sha256(features.encode()).hexdigest()[:12]}"


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def versions() -> dict[str, str]:
    """Return the version of everything that has a hand in an archive."""
    packages = ("numpy", "scipy", "numba", "xarray", "netCDF4", "h5py", "dask", "pydantic", "pint", "ruamel.yaml")
    found = {"python": sys.version.split()[0], "rotor-stator-workflow": workflow.__version__}
    return found | {name: _version(name) for name in packages}


@cache
def _version(package: str) -> str:
    return importlib.metadata.version(package)


def _coordinate(axis: Axis, dims: tuple[str, ...]) -> Coordinate:
    kind = object if any(isinstance(value, str) for value in axis.values) else None
    values = np.asarray(axis.values, dtype=kind)
    attrs = {"long_name": axis.description} | ({} if kind is object else {"units": axis.unit})
    return Coordinate(axis.name, dims, values if dims else values.reshape(()), attrs)


def _coordinates(study: Study, grid: Grid, periods: int) -> tuple[Coordinate, ...]:
    found = [
        _coordinate(axis, (dimension.name,)) for dimension in (*grid.outer, *grid.inner) for axis in dimension.axes
    ]
    found += [_coordinate(axis, ()) for axis in study.scalars]
    taken = {coordinate.name for coordinate in found} | {name for name, _ in grid.dims}
    if "gap" not in taken:
        about = {"units": "m", "long_name": "tip clearance at rest, cold"}
        found.append(Coordinate("gap", (), np.asarray(study.scene.gap), about))
    if study.output.histories:
        time = {"units": "s", "long_name": "time since the start"}
        found.append(Coordinate("t", ("t",), grid.sampling.times, time))
    if periods:
        number = {"units": "1", "long_name": "number of the load period"}
        found.append(Coordinate("period", ("period",), np.arange(1, periods + 1), number))
    return tuple(found)


def _attributes(name: str, unit: str, long_name: str) -> dict[str, str]:
    comment = {"comment": _COMMENTS[name]} if name in _COMMENTS else {}
    return {"units": unit, "long_name": long_name, **comment}


def _variables(study: Study, periods: int) -> tuple[Variable, ...]:
    precision = {"float64": "f8", "float32": "f4"}[study.output.precision]
    found = [
        Variable(name, "history", precision, _attributes(name, *_HISTORIES[name])) for name in study.output.histories
    ]
    found += [Variable(name, "metric", "f8", _attributes(name, *about)) for name, about in _METRICS.items()]
    found += [
        Variable(name, "metric", "f8", _attributes(name, *about), optional=True)
        for name, about in scheme_metrics(study).items()
    ]
    if study.output.balances:
        found += [Variable(name, "metric", "f8", _attributes(name, *about)) for name, about in _BALANCES.items()]
    if study.reference is not None:
        found += [Variable(name, "metric", "f8", _attributes(name, *about)) for name, about in _ERRORS.items()]
    if periods:
        found += [Variable(name, "period", "f8", _attributes(name, *about)) for name, about in _PERIODS.items()]
    found.append(
        Variable(
            "status",
            "flag",
            "i1",
            {
                "long_name": "how the case ended",
                "flag_values": [int(status) for status in Status],
                "flag_meanings": " ".join(status.name.lower() for status in Status),
            },
        )
    )
    found.append(
        Variable(
            "runaway",
            "flag",
            "i1",
            {
                "long_name": "whether a tip in permanent contact would run away thermally",
                "flag_values": [0, 1],
                "flag_meanings": "bounded runaway",
            },
        )
    )
    return tuple(found)
