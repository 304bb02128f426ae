"""What a study says, in SI: the scene, the schemes, the settings of one case, and the cases with all that they vary."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from workflow import models, reduction
from workflow.declare import File, Values, file, quantity, word
from workflow.models import Array, Sensor
from workflow.study.ranges import Drawn, Value
from workflow.study.source import GAP, GAP_OF

FULL = "full"
"""Not reduced; stored as the number of interior modes, one fewer than the model has nodes."""

AUTO, CHOSEN = "auto", -1
"""As many vectors as `tolerance` asks for; stored as -1."""

MODES = ("mechanical_modes", "thermal_modes")
TOLERANCE = "tolerance"

History = Literal["displacement", "velocity", "temperature", "impulse", "contact_force"]
Precision = Literal["float64", "float32"]

LARGEST_PHASE = 1000.0
"""rad; the sum of ω t and a phase is then known to 1e-13 rad. Beside a phase of 1e22 rad ω t is lost in rounding."""


def _phase(of: str) -> Any:
    return quantity("rad", f"phase of {of}", default=0.0, at_least=-LARGEST_PHASE, at_most=LARGEST_PHASE)


@dataclass(frozen=True)
class LoadHarmonic:
    """One more sinusoid A sin(2π f t + φ) of the load on the tip."""

    amplitude: float = quantity("N", "amplitude of a harmonic of the load")
    phase: float = _phase("a harmonic of the load")
    frequency: float | None = quantity("Hz", "frequency of a harmonic of the load", default=None, at_least=0)
    order: float | None = quantity("1", "frequency of a harmonic of the load, over speed", default=None, at_least=0)


@dataclass(frozen=True)
class CasingHarmonic:
    """One sinusoid a sin(2π f t + φ) of the casing's motion, away from the tip where it is positive."""

    amplitude: float = quantity("m", "amplitude of a harmonic of the casing")
    phase: float = _phase("a harmonic of the casing")
    frequency: float | None = quantity("Hz", "frequency of a harmonic of the casing", default=None, at_least=0)
    order: float | None = quantity("1", "frequency of a harmonic of the casing, over speed", default=None, at_least=0)


@dataclass(frozen=True)
class Load:
    """Load f(t) = F0 + F1 sin(2π f t + φ) + harmonics on the tip [N], and a constant one on every node."""

    mean: float = quantity("N", "constant part F0 of the load on the tip", default=0.0)
    amplitude: float = quantity("N", "amplitude F1 of the load on the tip", default=0.0)
    frequency: float = quantity("Hz", "frequency of the load on the tip", default=0.0, at_least=0)
    phase: float = _phase("the load on the tip")
    steady: Values = quantity("N", "constant load per node", default=0.0, per="node")
    harmonics: tuple[LoadHarmonic, ...] = ()


@dataclass(frozen=True)
class Initial:
    """State at t = 0, a scalar for every node or one value per node."""

    displacement: Values = quantity("m", "initial displacement", default=0.0, per="node")
    velocity: Values = quantity("m/s", "initial velocity", default=0.0, per="node")
    temperature: Values = quantity("K", "initial temperature rise above the root", default=0.0, per="temperature")


@dataclass(frozen=True)
class Coating:
    """An abradable coating of an elastic casing, which crushes where the contact force exceeds its level."""

    yield_force: float = quantity("N", "contact force at which the unworn coating crushes", above=0)
    hardening: float = quantity("N/m", "growth of that force with the worn depth", default=0.0, at_least=0)
    sectors: int = quantity(
        "1", "equal sectors of the casing, each worn alone", default=1, at_least=1, at_most=models.MOST_SECTORS
    )


@dataclass(frozen=True)
class Casing:
    """The casing that the tip rubs on, e.g. ``casing: {gap: 20 um}``; ``angles`` are ``None`` for those of the file."""

    gap: Values = quantity("m", "tip clearance at rest, cold; any sign; or profile", default=None, per="contact")
    harmonics: tuple[CasingHarmonic, ...] = ()
    clearance: float = quantity("m", "added to the gap of every contact", default=0.0)
    flexibility: float = quantity("m/N", "of an elastic casing; 0: rigid", default=0.0, at_least=0)
    coating: Coating | None = None
    angles: Values | None = quantity(
        "rad",
        "angle of each contact in the direction in which the blade turns; the file's where left out",
        default=None,
        at_least=-LARGEST_PHASE,
        at_most=LARGEST_PHASE,
        per="contact",
    )
    profile: File | None = file(
        "CSV file with columns angle [deg], in equal steps from 0 to 360 as the blade turns, and gap [m], in the place "
        "of gap and harmonics by an order",
        default=None,
    )


def gaps_of(casing: Casing, contacts: Sequence[str], values: Mapping[str, Array], count: int) -> Array:
    """Return the clearance of each contact, gap_i + clearance, m, ``(case, contact)``.

    ``contacts`` are labels, ``values`` those of axes by path, ``(case,)`` each.
    """
    gap, clearance = values[GAP][:, None] if GAP in values else casing.gap, values.get("scene.casing.clearance")
    gaps = np.array(np.broadcast_to(gap, (count, len(contacts))), dtype=np.float64)
    for k, label in enumerate(contacts):
        gaps[:, k] = values.get(f"{GAP_OF}{label}", gaps[:, k])
    return gaps + (casing.clearance if clearance is None else clearance[:, None])


@dataclass(frozen=True)
class Friction:
    """What makes the heat coupling, alpha = heat_share · coefficient · sliding_speed; or a coefficient beside alpha."""

    coefficient: float = quantity("1", "friction coefficient between tip and casing", at_least=0)
    sliding_speed: float | None = quantity("m/s", "speed of the tip along the casing", default=None, at_least=0)
    heat_share: float | None = quantity("1", "share of its heat in the blade", default=None, at_least=0, at_most=1)

    @property
    def alpha(self) -> float:
        """Heat coupling α that it makes, W/N."""
        return (self.heat_share or 0.0) * self.coefficient * (self.sliding_speed or 0.0)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Model, casing, load, initial state and duration of a case.

    ``model`` is the name of a module of ``workflow/models/`` and ``parameters`` an instance of its ``Parameters``. An
    ``initial`` state ``"static"`` is equilibrium under the constant loads. ``speed`` is 0 where none is given.
    """

    model: str
    parameters: Any
    casing: Casing
    load: Load = field(default_factory=Load)
    initial: Initial | Literal["static"] = field(default_factory=Initial)
    duration: float = quantity("s", "duration of every case", above=0)
    speed: float = quantity("Hz", "revolutions per second, of which an `order` is a multiple", default=0.0, at_least=0)
    friction: Friction | None = None

    @property
    def makes_alpha(self) -> bool:
        """Whether α follows from friction and is not given as it is."""
        return self.friction is not None and self.friction.sliding_speed is not None

    @property
    def gap(self) -> Values:
        """Tip clearance at rest, cold, m, or that of each contact."""
        return self.casing.gap


@dataclass(frozen=True)
class SchemeChoice:
    """A method of time integration with its options, under the label the study gives it."""

    label: str
    method: str
    options: Any


@dataclass(frozen=True)
class CaseSettings:
    """The settings of one case, everything resolved; e, alpha, h in SI, modes as counts."""

    scene: Scene
    scheme: SchemeChoice
    e: float = quantity("1", "restitution coefficient", default=0.0, at_least=0, at_most=1)
    alpha: float = quantity("W/N", "friction heat into the blade per contact force and second", default=0.0, at_least=0)
    h: float = quantity("s", "time step", default=1e-4, above=0)
    reduction: str = word("basis of the reduced model", default=reduction.DEFAULT)
    mechanical_modes: int = quantity("1", "mechanical vectors kept beside the tip's own", default=FULL, at_least=0)
    thermal_modes: int = quantity("1", "thermal vectors kept beside the tip's own", default=FULL, at_least=0)


@dataclass(frozen=True)
class Change:
    """By how much a number of the scene may be another one, and its CF unit."""

    value: float
    unit: str


_UNCERTAIN = "changes of numbers of the scene, `e` and `alpha` by path; the bifurcations of a branch shift by them"


@dataclass(frozen=True)
class Steady:
    """Search for the steady rub that each case of event_driven leads to."""

    periods: int = quantity(
        "1", "most common periods of the loads in a period of the rub", default=4, at_least=1, at_most=64
    )
    samples: int = quantity("1", "samples of its orbit", default=100, at_least=1, at_most=10_000)
    uncertain: Mapping[str, Change] | None = field(default=None, metadata={"later": True, "meaning": _UNCERTAIN})


@dataclass(frozen=True)
class WearMap:
    """Worn depths of the casing's coating at the ends of its revolutions."""

    every: int = quantity("1", "revolutions from one row of the map to the next", at_least=1)


_BALANCES = (
    "whether to keep energy_residual and heat_residual, with which a step takes about 50 % longer; of several contacts "
    "and of one without mass only where true is written"
)
_DEPTH = "depth from the tip over which a mean temperature is kept; each case runs twice for it"
_EVENTS = "most events of a case of event_driven that are listed: impacts, and contacts that begin or end"
_SENSORS = (
    "places that are recorded beside the contacts, by name: a label, an index or a vector of the file, a node of "
    "`chain` and `blade` from 1, a column of `modes`; {temperature: …} of a temperature"
)
_SECTIONS = "whether to keep the tip's state at the start of each load period, its impacts and extreme displacements"


@dataclass(frozen=True)
class Output:
    """What the archive keeps of every case; ``steady`` is ``None`` where steady rubs are not looked for."""

    interval: float = quantity("s", "sampling of all histories; default: duration/1000", above=0)
    histories: tuple[History, ...] = ("displacement", "temperature", "contact_force")
    precision: Precision = "float64"
    balances: bool = field(default=True, metadata={"meaning": _BALANCES})
    sections: bool = field(default=False, metadata={"meaning": _SECTIONS})
    steady: Steady | None = None
    temperature_depth: float | None = quantity("m", _DEPTH, default=None, above=0)
    sensors: Mapping[str, Sensor] = field(default_factory=dict, metadata={"meaning": _SENSORS})
    events: int | None = quantity("1", _EVENTS, default=None, at_least=1, at_most=1_000_000)
    wear: WearMap | None = None

    @property
    def sampled(self) -> tuple[str, ...]:
        """Names of all histories that the archive keeps."""
        depth = ("depth_temperature",) if self.histories and self.temperature_depth is not None else ()
        sensors = ("sensor_value",) if self.histories and self.sensors else ()
        return (*self.histories, *depth, *sensors)

    @property
    def of_branches(self) -> Output:
        """What an archive of branches keeps: no histories, balances, sections, depths, events, always steady rubs."""
        none: dict[str, Any] = {"histories": (), "temperature_depth": None, "events": None, "wear": None}
        return replace(self, balances=False, sections=False, steady=self.steady or Steady(), **none)


@dataclass(frozen=True)
class Axis:
    """One quantity that a study varies, or one of the settings that it holds."""

    path: str
    """What it sets: ``e``, ``scheme``, ``scene.casing.gap``, ``schemes.LABEL.option``."""
    name: str
    """Name of its coordinate."""
    values: tuple[Value, ...]
    """Values in SI, in the study's order; ``full`` is resolved."""
    unit: str
    """CF unit (``N m-1``); empty for words."""
    description: str
    """Long name."""


@dataclass(frozen=True)
class Dimension:
    """A dimension of the archive: one axis, or axes that vary together, as listed or as drawn.

    Of one that is ``swept`` each point starts from the state in which the one before ended.
    """

    name: str
    axes: tuple[Axis, ...]
    drawn: Drawn | None = None
    swept: bool = False

    @property
    def size(self) -> int:
        """Number of values along the dimension."""
        return len(self.axes[0].values)


@dataclass(frozen=True)
class Branch:
    """The axis along which branches, or their boundaries, are followed; its values are the ends of the range."""

    axis: Axis
    points: int


@dataclass(frozen=True)
class Reference:
    """What errors are measured against: the settings that replace those of a case.

    ``full`` stays a word where the number of nodes varies; :meth:`CaseSpace.cell` resolves it.
    """

    values: Mapping[str, Value]

    @property
    def is_auto(self) -> bool:
        """Whether its tolerance decides a count of modes."""
        return any(self.values.get(path) == CHOSEN for path in MODES)


@dataclass(frozen=True, kw_only=True)
class CaseSpace:
    """The cases of a study, resolved to SI."""

    scene: Scene
    """The scene as written, before axes replace any of it."""
    schemes: Mapping[str, SchemeChoice]
    """Schemes by label: those defined, and the bare methods that are used."""
    dimensions: tuple[Dimension, ...]
    """Axes, then zips, in the study's order."""
    scalars: tuple[Axis, ...]
    """Settings and scene values that are no dimension, with one value each."""
    reference: Reference | None
    """What errors are measured against, or ``None``."""
    output: Output
    """What the archive keeps."""
    branch: Branch | None = None
    """The axis that is followed as a curve, ``None`` where none is."""
    boundary: Branch | None = None
    """The axis over which bifurcations of the branch are followed; a scalar too, with the value at which it begins."""
    contacts: tuple[str, ...] = ()
    """Labels of several contacts; none for one."""

    @property
    def contact_shape(self) -> tuple[int, ...]:
        """Shape of what each of several contacts has: their number; none for one contact."""
        return (len(self.contacts),) if self.contacts else ()

    @property
    def swept(self) -> Axis | None:
        """The axis that is swept, ``None`` where none is."""
        return next((dimension.axes[0] for dimension in self.dimensions if dimension.swept), None)

    @property
    def samples(self) -> int:
        """Number of common samples, the initial state included."""
        return round(self.scene.duration / self.output.interval) + 1

    @property
    def is_auto(self) -> bool:
        """Whether it leaves a count of modes to its tolerance in some case."""
        return any(CHOSEN in self.each(path) for path in MODES)

    @property
    def uncertain(self) -> Mapping[str, Change]:
        """Changes of numbers for which the shifts of bifurcations are given, by path; none without a branch."""
        return (self.output.steady and self.output.steady.uncertain) or {}

    @property
    def depends_on_speed(self) -> bool:
        """Whether the structure depends on the scene's speed, which is one of its parameters then."""
        return models.depends_on_speed(self.scene.model, self.scene.parameters)

    def axes(self) -> Iterator[Axis]:
        """Yield all axes, and the settings that are held."""
        for dimension in self.dimensions:
            yield from dimension.axes
        over = () if self.boundary is None else (self.boundary.axis,)
        yield from (axis for axis in self.scalars if axis.path not in [one.path for one in over])
        yield from over
        if self.branch is not None:
            yield self.branch.axis

    def each(self, path: str) -> tuple[Value, ...]:
        """Return the values at a path in all cases: those of its axis, or the scene's one; none where there is none."""
        along = next((axis.values for axis in self.axes() if axis.path == path), None)
        own = self.number_at(path) if along is None else None
        return along or (() if own is None else (own,))

    def _attributes(self, path: str) -> list[str]:
        """Return the names of attributes that lead to a value of the scene, places in lists too."""
        if path.startswith(GAP_OF):
            return ["casing", "gap", str(self.contacts.index(path.removeprefix(GAP_OF)))]
        _, group, *words = path.split(".")
        return ["parameters" if group == self.scene.model else group, *words]

    def number_at(self, path: str, settings: CaseSettings | None = None) -> float | None:
        """Return a number of the scene, e or α of a case, or of the scene as written; ``None`` where there is none."""
        given = [float(axis.values[0]) for axis in self.axes() if axis.path == path and settings is None]
        if given or "." not in path:
            return given[0] if given else None if settings is None else float(getattr(settings, path))
        if path.startswith(GAP_OF) and path.removeprefix(GAP_OF) not in self.contacts:
            return None
        owner: Any = self.scene if settings is None else settings.scene
        for step in self._attributes(path):
            owner = owner[int(step)] if isinstance(owner, tuple) else getattr(owner, step, None)
        return float(owner) if isinstance(owner, int | float) else None

    def cell(self, values: Mapping[str, Value]) -> CaseSettings:
        """Return the settings of a case; counts of modes that its tolerance decides are :data:`CHOSEN`.

        ``values`` has one for every axis and scalar by path, in SI; raises :class:`KeyError` where one is missing.
        """
        scene, scheme = self.scene, self.schemes[str(values["scheme"])]
        for path, value in values.items():
            head, *rest = path.split(".")
            if head == "scene":
                scene = _replaced(scene, self._attributes(path), value)
            elif head == "schemes" and rest[0] == scheme.label:
                scheme = dataclasses.replace(scheme, options=_replaced(scheme.options, rest[1:], value))
        mechanical, thermal = values["mechanical_modes"], values["thermal_modes"]
        return CaseSettings(
            replace(scene, parameters=models.at_speed(scene.model, scene.parameters, scene.speed)),
            scheme,
            e=float(values["e"]),
            alpha=scene.friction.alpha if scene.friction and scene.makes_alpha else float(values["alpha"]),
            h=float(values["h"]),
            reduction=str(values["reduction"]),
            mechanical_modes=_interior(scene, 0) if mechanical == FULL else int(mechanical),
            thermal_modes=_interior(scene, 1) if thermal == FULL else int(thermal),
        )


def _interior(scene: Scene, kind: int) -> int:
    """Return the number of interior coordinates of a scene's structure, mechanical (0) or thermal (1)."""
    return models.sizes(scene.model, scene.parameters)[kind] - 1


def _replaced(owner: Any, attributes: list[str], value: Value) -> Any:
    """Return a frozen dataclass with a value replaced, however deep it lies."""
    name, *deeper = attributes
    if isinstance(owner, tuple):
        place = int(name)
        return (*owner[:place], _replaced(owner[place], deeper, value) if deeper else value, *owner[place + 1 :])
    return dataclasses.replace(owner, **{name: _replaced(getattr(owner, name), deeper, value) if deeper else value})
