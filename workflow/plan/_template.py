"""What the archive of a study holds, as a dataset in which no case has run yet."""

from __future__ import annotations

import dataclasses
import datetime
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

import workflow
from workflow import variables
from workflow.cases import FRICTION, Grid, alpha_of, full_structure
from workflow.kernels import Array
from workflow.plan._warnings import tip_cells
from workflow.schemes import Status
from workflow.solve import dims_of, lengths, unset, variables_of
from workflow.study import AUTO, CHOSEN, GAP, GAP_OF, MATRIX, MODES, POINT, SWEEP, Axis, Drawn, Study, gaps_of
from workflow.variables import Variable

if TYPE_CHECKING:
    import xarray as xr

CHUNK_BYTES = 2**20
"""No chunk is larger than this before compression, unless it is one instant of many phases."""

LEVEL = 1
"""zlib level of an archive, always with shuffle."""

COMPRESSED = {"zlib": True, "complevel": LEVEL, "shuffle": True, "fletcher32": True}


def encode(dataset: xr.Dataset) -> xr.Dataset:
    """Say of each variable of a dataset how it is stored, and return the dataset.

    All have the same lengths of a chunk along the dimensions of the cases, those of ``status``: whole dimensions
    innermost, then a part of one, as many cases as the largest variable has in :data:`CHUNK_BYTES`, at least one. The
    history of one case may be cut along ``t``, into nearly equal lengths; contacts stay together.
    """
    shape, results = dataset["status"].shape, [dataset.variables[name] for name in dataset.data_vars]
    most = CHUNK_BYTES // max(_case_bytes(variable, len(shape)) for variable in results)
    lengths: list[int] = []
    for size in reversed(shape):
        lengths.append(max(1, min(size, most // math.prod(lengths))))
    cut = dict(zip(dataset["status"].dims, reversed(lengths), strict=True))
    for variable in results:
        fill = {"_FillValue": np.nan} if variable.dtype.kind == "f" else {}
        tail = list(variable.shape[len(shape) :])
        along = len({"contact", "sensor"} & set(variable.dims))
        if len(tail) > along:
            tail[along] = -(-tail[along] // -(-_case_bytes(variable, len(shape)) // CHUNK_BYTES))
        chunks = {**COMPRESSED, "chunksizes": (*cut.values(), *tail)} if variable.dims else {}
        variable.encoding = {**chunks, **fill, **listed_coordinates(dataset, variable.dims)}
    for name in dataset.coords:
        variable = dataset.variables[name]
        is_axis = variable.dims == (name,)
        chunks = {"chunksizes": tuple(size if is_axis else cut.get(dim, size) for dim, size in variable.sizes.items())}
        if variable.dtype.kind == "O" and not is_axis:  # CF allows an axis no further dimension
            variable.encoding = {"dtype": "S1", **COMPRESSED, **chunks}
        elif variable.dtype.kind != "O" and variable.dims:
            variable.encoding = {"fletcher32": True, **chunks}
    return dataset


def listed_coordinates(dataset: xr.Dataset, dims: tuple[Any, ...]) -> dict[str, str]:
    """Return CF's ``coordinates``: the scalar coordinates, those of a zip and the labels that are text."""
    names = [
        str(name)
        for name, one in ((name, dataset.variables[name]) for name in dataset.coords)
        if set(one.dims) <= set(dims) and (one.dtype.kind == "O" or one.dims != (name,))
    ]
    return {"coordinates": " ".join(names)} if names else {}


def _case_bytes(variable: xr.Variable, cases: int) -> int:
    """Return the bytes of one case of a variable, the first dimensions of which are those of the cases."""
    return int(variable.dtype.itemsize) * math.prod(variable.shape[cases:])


HARMONIC = ("amplitude", "frequency", "order", "phase")
"""Numbers of a harmonic of the casing."""

_NUMBERED = {
    "period": "number of the load period",
    "point": "number of the point, by arclength",
    "curve": "number of the boundary",
    "curve_point": "number of the point of a boundary, by arclength",
}

WARNINGS = "warnings"
"""Attribute of an archive: what its plan warned of, a line each."""

_SWEPT = "each point starts from the state in which the one before ended"

_SOURCES = (
    "Thorin, Guérin, Legrand: Rotor–stator interaction: reduction of a nonsmooth thermo-elastic unidimensional model; "
    "Acary, Brogliato: Numerical Methods for Nonsmooth Dynamical Systems (2008)"
)

Attributes = Mapping[str, Any]


def template(grid: Grid, warnings: str = "") -> xr.Dataset:
    """Return the archive of a grid's study before anything has run, of which a plan warned so.

    Its results take no memory: each is one value, repeated along the dimensions of the cases, outermost first, and
    along ``t``, ``period``, ``point``, ``phase`` after them.
    """
    import xarray as xr

    study, sizes = grid.study, dict(grid.dims) | lengths(grid)
    if not study.output.histories:
        del sizes["t"]
    results = {about.name: _result(about, attributes, grid, sizes) for about, attributes in _results(grid)}
    attributes = {
        "Conventions": "CF-1.11",
        "title": study.title,
        "summary": (
            f"Study {study.name}: tip response of a thermo-elastic structure ({study.scene.model}) that rubs on "
            f"its casing, over {', '.join(name for name, _ in grid.dims) or 'a single case'}"
        ),
        **({"license": study.license} if study.license else {}),
        "source": f"rotor-stator-workflow {workflow.__version__}, nonsmooth thermo-elastic contact solver",
        "references": _SOURCES,
        "history": f"{datetime.datetime.now(datetime.UTC):%Y-%m-%dT%H:%M:%SZ}: workflow run {study.name}",
        "study": study.name,
        "duration": study.scene.duration,
        **({WARNINGS: warnings} if warnings else {}),
    }
    return encode(xr.Dataset(results, dict(_coordinates(grid, sizes)), attributes))


def _variable(dims: tuple[str, ...], values: Any, attributes: Attributes) -> xr.Variable:
    """Return a variable; numbers of its attributes have its dtype, as CF wants."""
    import xarray as xr

    typed = {k: v if isinstance(v, str) else np.asarray(v, values.dtype) for k, v in attributes.items()}
    return xr.Variable(dims, values, typed)


def _results(grid: Grid) -> Iterator[tuple[Variable, Attributes]]:
    """Yield the variables of the table that an archive has, with their attributes, flags last."""
    study, flags = grid.study, _flags(grid.study)
    over = {"depth": study.output.temperature_depth}
    depths = {"max_temperature": tip_cells(grid), "depth_temperature": over, "max_depth_temperature": over}
    for about in variables_of(grid):
        if about.name in flags:
            meanings = flags[about.name]
            comment = {"comment": about.comment} if about.name in ("steady_state", "event_kind") else {}
            values = {"flag_values": range(len(meanings)), "flag_meanings": " ".join(meanings)}
            yield about, {"long_name": about.meaning, **comment, **values}
            continue
        if study.branch is not None and about.name == study.branch.axis.name:
            depths[about.name] = {"study_path": study.branch.axis.path, "branch": study.branch.axis.values}
        about = variables.of_contacts(about) if study.contacts else about
        texts = {name: text for name in ("comment", "cell_methods") if (text := getattr(about, name))}
        units = {"units": unit} if (unit := _unit(about, study)) else {}
        units |= {"_Encoding": "utf-8"} if about.shape == "text" else {}
        yield about, {**units, "long_name": about.meaning, **texts, **depths.get(about.name, {})}


def _unit(about: Variable, study: Study) -> str:
    """Return the unit of a variable; that of sensors where all have one, else none: ``sensor_unit`` tells."""
    units = {sensor.unit for sensor in study.output.sensors.values()}
    return about.unit if not about.is_of_sensor else units.pop() if len(units) == 1 else ""


def _flags(study: Study) -> dict[str, tuple[str, ...]]:
    """Return what the values of flags mean, from 0 on."""
    flags = {"status": tuple(status.name.lower() for status in Status), "runaway": ("bounded", "runaway")}
    flags["event_kind"] = variables.EVENT_KINDS
    if study.output.steady is None:
        return flags
    from workflow.orbits import BIFURCATIONS, ENDS, STATES

    flags |= {"steady_state": STATES, "bifurcation": BIFURCATIONS}
    return flags | {"boundary_kind": BIFURCATIONS, "boundary_end": ENDS}


def _result(about: Variable, attributes: Attributes, grid: Grid, sizes: Mapping[str, int]) -> xr.Variable:
    """Return a variable where nothing has run."""
    single = about.shape == "history" and grid.study.output.precision == "float32"
    blank = np.float32(np.nan) if single else unset(about)
    dims = (*(name for name, _ in grid.dims), *dims_of(about, sizes))
    return _variable(dims, np.broadcast_to(blank, tuple(sizes[name] for name in dims)), attributes)


def _coordinates(grid: Grid, sizes: Mapping[str, int]) -> Iterator[tuple[str, xr.Variable]]:
    """Yield the coordinates by name: of dimensions, scalars, drawn points, and those that the scene decides."""
    study, moves, names = grid.study, _motion_of_casing(grid.study), {name for name, _ in grid.dims}
    names |= set() if study.branch is None else {study.branch.axis.name}
    axes = [(axis, (dimension.name,)) for dimension in (*grid.outer, *grid.inner) for axis in dimension.axes]
    for axis, dims in (*axes, *((axis, ()) for axis in study.scalars)):
        names.add(axis.name)
        more = moves if axis.name == "gap" else {SWEEP: _SWEPT} if axis == study.swept else {}
        yield axis.name, _of_axis(axis, dims, more)
    for dimension in study.dimensions:
        if dimension.drawn is not None:
            yield from _design(dimension.name, dimension.drawn)
    followed = "" if study.branch is None else study.branch.axis.path
    if study.scene.makes_alpha and not followed.startswith(FRICTION):
        about = {"long_name": "heat coupling: heat_share x coefficient x sliding_speed", "units": "W N-1"}
        yield "alpha", _variable(*made_by_friction(grid), about)
    if "gap" not in names and not followed.startswith(GAP):
        about, (along, gap) = {"units": "m", "long_name": "tip clearance at rest, cold", **moves}, _gap(grid)
        yield "gap", _variable(along, gap, about)
    yield from _of_contacts(grid, names)
    yield from _of_sensors(study)
    yield from _of_uncertain(study)
    yield from _of_coating(grid)
    for name, values, unit, meaning in (
        ("t", grid.sampling.times, "s", "time since the start"),
        *((name, np.arange(1, 1 + sizes.get(name, 0)), "1", about) for name, about in _NUMBERED.items()),
        ("revolution", grid.revolutions, "1", "number of the revolution of the casing's angle that has ended"),
        (
            "phase",
            np.arange(sizes.get("phase", 0)) / sizes.get("phase", 1),
            "1",
            "share of the period of the steady rub",
        ),
    ):
        if name in sizes and name not in names:  # an axis or a zip may have that name
            yield name, _variable((name,), values, {"units": unit, "long_name": meaning})


def _of_contacts(grid: Grid, names: set[str]) -> Iterator[tuple[str, xr.Variable]]:
    """Yield what no axis gives of the casing: clearance, flexibility, and labels and angles of contacts."""
    study, casing = grid.study, grid.study.scene.casing
    for name, unit, meaning in (
        ("clearance", "m", "added to the gap of every contact"),
        ("flexibility", "m N-1", "flexibility of the casing"),
    ):
        if getattr(casing, name) and name not in names:
            about = {"units": unit, "long_name": meaning, "study_path": f"scene.casing.{name}"}
            yield name, _variable((), np.asarray(getattr(casing, name)), about)
    angle: Any = casing.angles
    if study.contacts:
        yield "contact", _variable(("contact",), np.asarray(study.contacts, dtype=object), {"long_name": "contact"})
        own = full_structure(grid.settings(0)).contacts.angle if angle is None else angle
        angle = np.broadcast_to(own, study.contact_shape)
    if angle is not None and np.any(angle):
        about = {"units": "rad", "long_name": "angle of a contact in the direction in which the blade turns"}
        yield "contact_angle", _variable(("contact",) * np.ndim(angle), np.asarray(angle), about)


def _of_coating(grid: Grid) -> Iterator[tuple[str, xr.Variable]]:
    """Yield the angles of the sectors of a coating, along the axis of their number too where it has one."""
    if not grid.most_sectors:
        return
    path, middles = "scene.casing.coating.sectors", np.arange(grid.most_sectors) + 0.5
    along = [d.name for d in (*grid.outer, *grid.inner) if any(axis.path == path for axis in d.axes)]
    counts = np.array(grid.study.each(path), dtype=np.float64)[:, None]
    angles = 2 * np.pi * np.where(middles < counts, middles / counts, np.nan)
    about = {"units": "rad", "long_name": "angle of the middle of a sector of the casing, as a contact passes it"}
    yield "sector_angle", _variable((*along, "sector"), angles if along else angles[0], about)


def _of_sensors(study: Study) -> Iterator[tuple[str, xr.Variable]]:
    """Yield names and units of sensors."""
    sensors = study.output.sensors
    if sensors:
        units = [sensor.unit for sensor in sensors.values()]
        yield "sensor", _variable(("sensor",), np.asarray(tuple(sensors), dtype=object), {"long_name": "sensor"})
        about = {"long_name": "unit of a sensor"}
        yield "sensor_unit", _variable(("sensor",), np.asarray(units, dtype=object), about)


def _of_uncertain(study: Study) -> Iterator[tuple[str, xr.Variable]]:
    """Yield paths, changes and units of uncertain numbers."""
    if study.uncertain:
        values, units = zip(*((one.value, one.unit) for one in study.uncertain.values()), strict=True)
        paths = np.asarray(tuple(study.uncertain), dtype=object)
        yield "uncertain", _variable(("uncertain",), paths, {"long_name": "path of an uncertain number"})
        yield "uncertain_value", _variable(("uncertain",), np.array(values), {"long_name": "change of the number"})
        about = {"long_name": "unit of the number"}
        yield "uncertain_unit", _variable(("uncertain",), np.asarray(units, dtype=object), about)


def _of_axis(axis: Axis, dims: tuple[str, ...], more: Attributes) -> xr.Variable:
    """Return the coordinate of an axis or scalar, in the study's order."""
    is_text = any(isinstance(value, str) for value in axis.values)
    attributes: dict[str, Any] = {"long_name": axis.description, "study_path": axis.path, **more}
    attributes |= {} if is_text else {"units": axis.unit}
    if axis.path in MODES and CHOSEN in axis.values:
        attributes |= {"flag_values": [CHOSEN], "flag_meanings": AUTO}
    values = np.array([*map(str, axis.values)], dtype=object) if is_text else np.asarray(axis.values)
    return _variable(dims, values if dims else values.reshape(()), attributes)


def _design(name: str, drawn: Drawn) -> Iterator[tuple[str, xr.Variable]]:
    """Yield which point and which matrix of a drawn zip each of its cases is."""
    about = "matrix of the case: A, B, or the path of the number that A has from B"
    points = np.repeat(np.arange(drawn.points), len(drawn.matrices))
    matrices = np.tile(np.array(drawn.matrices, dtype=object), drawn.points)
    yield POINT, _variable((name,), points, {"units": "1", "long_name": "number of the drawn point"})
    yield MATRIX, _variable((name,), matrices, {"long_name": about})


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


def _gap(grid: Grid) -> tuple[tuple[str, ...], Array]:
    """Return the gap, or that of each contact, along the dimensions of axes of single ones before."""
    study, gap = grid.study, np.asarray(grid.settings(0).scene.gap)
    if not gap.ndim:
        return (), gap
    names, shape, varying = _along(grid, GAP_OF)
    casing = replace(study.scene.casing, gap=tuple(gap), clearance=0.0)
    gaps = gaps_of(casing, study.contacts, varying, math.prod(shape))
    return (*names, "contact"), gaps.reshape(*shape, -1)


def _along(grid: Grid, paths: str) -> tuple[tuple[str, ...], tuple[int, ...], dict[str, Array]]:
    """Return dimensions with axes whose paths begin so, their sizes, and values of these in all combinations."""
    dimensions = [d for d in (*grid.outer, *grid.inner) if any(axis.path.startswith(paths) for axis in d.axes)]
    shape = tuple(dimension.size for dimension in dimensions)
    varying = {
        axis.path: np.asarray(axis.values, dtype=np.float64)[index].ravel()
        for dimension, index in zip(dimensions, np.indices(shape), strict=True)
        for axis in dimension.axes
        if axis.path.startswith(paths)
    }
    return tuple(dimension.name for dimension in dimensions), shape, varying


def made_by_friction(grid: Grid) -> tuple[tuple[str, ...], Array]:
    """Return the names of the dimensions along which friction varies, and α along them."""
    names, shape, varying = _along(grid, FRICTION)
    return names, alpha_of(grid.settings(0), varying, math.prod(shape)).reshape(shape)
