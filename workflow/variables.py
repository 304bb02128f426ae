"""Variables of an archive: one table of names, units, shapes and meanings, for physics and workflow alike.

Schemes fill the variables of origin ``scheme`` (:class:`workflow.schemes.Results`), the workflow derives the
others. What an archive declares, which names a study may not use for an axis, what a failed case is filled
with and what results are checked against all come from this table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

Shape = Literal[
    "history",
    "metric",
    "text",
    "period",
    "flag",
    "phase",
    "point",
    "point phase",
    "uncertain point",
    "curve",
    "curve curve_point",
    "event",
    "sector",
    "revolution sector",
]
"""``history``: (…, t); ``metric``: (…) float64, ``text``: (…) text; ``period``: (…, period), ``phase``: (…, phase)
float64; ``flag``: (…) int8; ``point``: (…, point) float64 or int8, ``point phase``: (…, point, phase), in archives of
branches alone, ``uncertain point``: (…, uncertain, point), ``curve``: (…, curve), ``curve curve_point``: (…, curve,
curve_point) too; ``event``: (…, event) float64 or int8; ``sector``: (…, sector), ``revolution sector``: (…, revolution,
sector) float64, NaN beyond the sectors of a case. What is of sensors has ``sensor`` before these."""

Origin = Literal["scheme", "workflow"]

Condition = Literal[
    "always",
    "depth",
    "balances",
    "sections",
    "sensors",
    "events",
    "coating",
    "wear",
    "contacts",
    "steady",
    "steady sensors",
    "branch",
    "uncertain",
    "boundary",
    "reference",
    "scheme",
    "auto",
    "auto reference",
]
"""When an archive has the variable: always, with ``output.temperature_depth``, ``output.balances``,
``output.sections``, ``output.sensors``, ``output.events``, ``output.wear`` or ``output.steady``, with a coating, of
several contacts, with sensors and steady rubs, where an axis is a branch, with
``output.steady.uncertain``, where an axis is a boundary, with a reference, if a scheme declares it,
where a tolerance decides a count of modes."""


@dataclass(frozen=True)
class Variable:
    """One variable of an archive."""

    name: str
    unit: str
    meaning: str
    """``name``, ``unit``, ``meaning``: as in the archive; the unit in CF spelling, the meaning is its long name."""
    shape: Shape = "metric"
    """See :data:`Shape`."""
    origin: Origin = "workflow"
    """Who gives it: the scheme, or the workflow from what schemes give."""
    condition: Condition = "always"
    """See :data:`Condition`."""
    signed: bool = False
    """Whether a case that ended ok may have a negative value."""
    may_be_undefined: bool = False
    """Whether a case that ended ok may have NaN or an infinite value."""
    comment: str = ""
    """Definition, where the meaning leaves something open."""
    cell_methods: str = ""
    """How the values stand for the cells of a dimension, in CF's words, where they are not those at its points."""

    @property
    def is_of_contact(self) -> bool:
        """Whether it has a value for each of several contacts, along ``contact`` before its other dimensions."""
        return (
            (self.shape == "period" and not self.is_of_sensor)
            or self.condition in ("coating", "wear")
            or self.name in _OF_CONTACT
        )

    @property
    def is_of_sensor(self) -> bool:
        """Whether it has a value for each sensor, along ``sensor`` before ``t``, ``period``, ``point`` or ``phase``."""
        return self.condition in ("sensors", "steady sensors")


_OF_CONTACT = frozenset(
    {"displacement", "velocity", "temperature", "impulse", "contact_force", "contact_impulse", "impacts"}
    | {"contact_time", "max_penetration", "max_temperature"}
    | {f"steady_{name}" for name in ("impulse", "impacts", "contact", "max_temperature", "mean_temperature")}
    | {"steady_max_displacement", "steady_min_displacement"}
    | {"orbit_displacement", "orbit_velocity", "orbit_temperature"}
)
"""Histories, metrics and quantities of steady rubs that each of several contacts has; so has each those of load
periods."""

EVENT_KINDS = ("impact", "touches", "leaves", "yields", "stops_yielding")
"""What values of ``event_kind`` mean, from 0 on."""


def _of_sensors() -> Iterator[Variable]:
    """Yield the variables of sensors."""
    defined: Any = {"signed": True, "may_be_undefined": True}
    value = "what a sensor shows"
    yield Variable("sensor_value", "", value, "history", "scheme", "sensors", signed=True)
    for name, meaning in (
        ("sensor_max", "largest value of a sensor"),
        ("sensor_min", "smallest value of a sensor"),
        ("sensor_rms", "root mean square of a sensor"),
    ):
        half = "of the samples in the last half of the duration"
        yield Variable(name, "", meaning, condition="sensors", signed=True, comment=half)
    meaning, ends = (
        "largest value of a sensor in a load period",
        "of samples at ends of output intervals, as period_force",
    )
    yield Variable("period_sensor_max", "", meaning, "period", condition="sensors", signed=True, comment=ends)
    for name, meaning in (
        ("steady_sensor_max", "largest value of a sensor in the steady rub"),
        ("steady_sensor_min", "smallest value of a sensor in the steady rub"),
    ):
        samples = "of samples, 16 or more in a period of the fastest mode"
        yield Variable(name, "", meaning, condition="steady sensors", comment=samples, **defined)
    meaning = "value of a sensor over a period of the steady rub"
    yield Variable("orbit_sensor", "", meaning, "phase", condition="steady sensors", **defined)


def _of_coating() -> Iterator[Variable]:
    """Yield the variables of a casing's coating."""
    beyond, depth = "NaN beyond the sectors of a case", "worn depth of the casing's coating in each sector"
    undefined: Any = {"origin": "scheme", "may_be_undefined": True}
    yield Variable("worn_depth", "m", f"{depth} at the end", "sector", condition="coating", comment=beyond, **undefined)
    yield Variable("max_worn_depth", "m", "largest worn depth of the coating at the end", condition="coating")
    work = "work that crushes the coating: yield_force + hardening x worn depth, integrated over the worn depth"
    yield Variable("crushing_work", "J", work, condition="coating")
    yield Variable(
        "border_work",
        "J",
        "work of the drive at borders between sectors of the coating",
        origin="scheme",
        condition="coating",
        signed=True,
        comment=(
            "what borders put into the elastic casing and crush at once; contact takes from the structure what the "
            "casing holds more at the end than at the start, and crushing_work, less border_work"
        ),
    )
    ends = f"{depth} at the ends of revolutions"
    yield Variable("wear_map", "m", ends, "revolution sector", condition="wear", comment=beyond, **undefined)


def _of_events() -> Iterator[Variable]:
    """Yield the variables of the list of events."""
    for name, unit, meaning in (
        ("time", "s", "time of an event"),
        ("kind", "1", "what happens at an event"),
        ("impulse", "N s", "impulse of the casing at an event"),
        ("approach", "m s-1", "speed at which a contact meets its casing at an event"),
        ("contact", "1", "place of the contact of an event, from 0"),
    ):
        comment = "-1 beyond the last event" if name in ("kind", "contact") else ""
        yield Variable(f"event_{name}", unit, meaning, "event", condition="events", signed=True, comment=comment)
    comment = "event_driven: one for each contact that takes an impulse, touches, leaves, yields or stops; others: 0"
    yield Variable("event_count", "1", "number of events", condition="events", comment=comment)


_STEADY_STATE = (
    "settles: a periodic rub that is met and left, all Floquet multipliers below 1; no_contact, permanent_contact: a "
    "settled motion without events; unstable: a multiplier of 1 or more, on branches alone; runs_away: a contact "
    "that lasts while it grows, or a temperature that leaves every bound; not_asked: of other schemes. "
    "All other variables of steady rubs are NaN where there is none"
)


def steady_variables() -> Iterator[Variable]:
    """Yield the variables of steady rubs, whose period is k common periods T of all loads."""
    meant = "of the steady rub"
    for name, unit, meaning in (
        ("steady_periods", "1", f"number k of common periods of the loads in a period {meant}"),
        ("steady_residual", "1", f"largest change of x, v, θ over a period {meant}, each over its own maximum"),
        ("floquet_multiplier", "1", f"largest modulus of the Floquet multipliers {meant} over its period kT"),
        ("floquet_angle", "rad", f"argument of the Floquet multiplier of largest modulus {meant}"),
        ("settling_time", "s", "time in which a small disturbance falls to 1/e: -kT/ln of the largest multiplier"),
        ("lyapunov", "s-1", "largest Lyapunov exponent along the last periods, where nothing periodic was found"),
        ("steady_impulse", "N s", f"impulse of the casing {meant} over kT, divided by k"),
        ("steady_impacts", "1", f"number of impacts {meant} over kT, divided by k"),
        ("steady_contact", "s", f"time in contact {meant} over kT, divided by k"),
        ("steady_max_temperature", "K", f"largest temperature rise of the blade tip {meant}"),
        ("steady_mean_temperature", "K", f"mean temperature rise of the blade tip {meant}"),
        ("steady_max_displacement", "m", f"largest displacement of the blade tip {meant}"),
        ("steady_min_displacement", "m", f"smallest displacement of the blade tip {meant}"),
        ("steady_closing", "m", f"mean quasi-static tip growth {meant} by its temperatures"),
    ):
        yield Variable(name, unit, meaning, condition="steady", signed=True, may_be_undefined=True)
    for name, unit, meaning in (
        ("orbit_displacement", "m", f"displacement of the blade tip over a period {meant}"),
        ("orbit_velocity", "m s-1", f"velocity of the blade tip over a period {meant}"),
        ("orbit_temperature", "K", f"temperature rise of the blade tip over a period {meant}"),
    ):
        yield Variable(name, unit, meaning, "phase", condition="steady", signed=True, may_be_undefined=True)
    about = "what becomes of the rub"
    yield Variable("steady_state", "1", about, "flag", condition="steady", comment=_STEADY_STATE)


def _of_boundaries() -> Iterator[Variable]:
    """Yield the variables of boundaries, but for the two numbers along them, and of shifts of bifurcations."""
    turns = "signed, to first order; infinite where the boundary turns, NaN without a bifurcation or its boundary"
    defined: Any = {"signed": True, "may_be_undefined": True}
    meaning = "by how much a bifurcation moves along the branched axis, for the change uncertain_value of a number"
    yield Variable("bifurcation_shift", "", meaning, "uncertain point", condition="uncertain", comment=turns, **defined)
    yield Variable("boundary_kind", "1", "what happens at a boundary", "curve", condition="boundary")
    yield Variable("boundary_end", "1", "why a boundary ends within the ranges", "curve", condition="boundary")
    for name, unit, meaning in (
        ("angle", "rad", "angle of the Floquet multiplier of modulus 1 at a boundary"),
        ("other", "1", "largest modulus of all other Floquet multipliers: below 1 the boundary is one of stability"),
    ):
        yield Variable(f"boundary_{name}", unit, meaning, "curve curve_point", condition="boundary", **defined)


_ENERGY = (
    "(change of E + dissipation by damping - work of tip load, contact and friction heat) / max E: what the scheme "
    "itself gives (+) or takes (-). Steps in modes: E is the energy of the motion relative to what heat and constant "
    "loads drag along, of all modes with a share in the tip; what does work does it at the mean velocity of a step's "
    "ends, that of the tip as the contact law gives it; what a contact spring gives as contact begins or ends "
    "counts; the load counts as the step takes it; max E is at least what 1e-12 of the impulse of the tip load would "
    "give the tip. Structures whose modes are coupled, or loaded elsewhere, and recorded plain states: E = vMv/2 + "
    "xK1x/2 of the whole motion, with the work of all loads and against thermal forces (midpoint values of the "
    "motion). 0 where max E is 0; NaN for event_driven, which is exact"
)

_HEAT = (
    "(change of the heat content - alpha times impulse - heating + conduction to the root and convection) / heat "
    "turned over (the sum of the absolute values of alpha times impulse, heating, losses, eight steps together, and "
    "initial content), over whole steps, losses as the step weighs them, of recorded plain states at midpoint values; "
    "0 where no heat is turned over; a reduced model sums over the nodes by its projection of an even temperature; NaN "
    "for event_driven, which is exact"
)

_GROWTH = (
    "eigenvalues, real or not, of the linear system with the tip held at the casing and heated by alpha times the "
    "contact force; known to 1e-12 of the terms that they are sums of, and 0 within that; of more than 600 states "
    "those of its krylov basis of 100 + 100 vectors; NaN where contact forces are not unique"
)

_SETS = (
    "the worst of each contact closed alone and all closed together, of opposite stops one of each pair; other sets "
    "are not searched"
)

_PROJECTION = (
    "largest of the relative norms lost by the basis: initial displacement in strain energy, initial velocity in "
    "kinetic energy, initial temperature weighted by heat capacities, static displacement by constant loads in strain "
    "energy, steady temperature by constant heating weighted by conductances; 0 for a full basis"
)

_LARGEST = (
    "event_driven: over all instants, to 1e-10; time-stepping schemes: at the ends of steps and of load periods, "
    "whatever the output interval; an instant between two load periods belongs to both"
)

_OF_TIP = (
    "of a blade the mean over `depth` [m] (least, largest) from its tip, which grows as that falls until heat enters "
    "deeper in a contact: half the cell there, or what the thermal modes kept amount to"
)

_MEAN = "mean temperature rise over output.temperature_depth from the blade tip"

_DEPTH = "linear between nodes; converges as cells become thinner than the depth"

_PROCESSOR_TIME = (
    "time of the whole batch / batch_width, so it depends on the lengths of the axes within a batch: a few cases take "
    "nearly as long as a full vector register of them; kernels compiled before; with its balances where "
    "output.balances is on, without its reference"
)

_BATCH_WIDTH = (
    "cases with the same operators that one call of the scheme computed; cases that share their results count once"
)

_PREDICTABILITY = (
    "the larger of two changes of the sampled displacement: with the gap opened and with it closed by 1e-12 of a "
    "length of the motion, the larger of abs(gap) and the largest abs(x_n); only opened where closing it would put "
    "the start inside the casing"
)

_BASIS_ERROR = (
    "larger of the relative L2 errors of displacement and temperature of the reduced model in the worst corner of the "
    "scene, event_driven against the full model (of more than 300 coordinates: against 100 + 100 vectors; what "
    "event_driven refuses: moreau, theta = 1, at the shortest step); a corner takes the hardest or mildest value of "
    "each dimension (alpha, gap, answer at the load frequency, magnitude of all else), 16 at most; the text choices of "
    "the provenance group names the worst; where the reference is event_driven and as rich, a case whose "
    "model error is above the tolerance has its own; missing where the study gives both counts, no corner ended ok, or "
    "more than 50 + 50 vectors of 100 + 100 are needed"
)

_REFINEMENT = (
    "relative L2 change of displacement or temperature, the larger, in the worst corner of the scene: by twice as many "
    "mechanical vectors plus by twice as many thermal ones, event_driven; of up to 300 coordinates the error against "
    "the full model; counts and corner stand in the text choices of the provenance group"
)

_TOTAL = "0 where both are identically zero; missing where only the reference is, or failed: see message"

_SCHEME_PART = (
    "from the exact solution (event_driven) of the same reduced model, over the norm of the reference; the error is at "
    "most this and the model's part together; missing where event_driven cannot run the reduced model: see message"
)

_MODEL_PART = (
    "of the exact solution (event_driven) of the same reduced model from the reference, over the norm of the "
    "reference; with another scheme as reference the error of that is part of it"
)

COMPARED = ("displacement", "temperature", "impulse")
"""Histories that are compared with the reference's."""


def _of_balances() -> Iterator[Variable]:
    """Yield the residuals of balances."""
    for name, meaning, comment in (
        ("energy_residual", "residual of the mechanical energy balance, relative to the largest energy", _ENERGY),
        ("heat_residual", "residual of the heat balance, relative to the heat turned over", _HEAT),
    ):
        defined: Any = {"signed": True, "may_be_undefined": True, "comment": comment}
        yield Variable(name, "1", meaning, "metric", "scheme", "balances", **defined)


def _errors(name: str) -> Iterator[Variable]:
    """Yield the error of a history against the reference, and its two parts."""
    for part, meaning, comment in (
        ("", f"relative L2 distance of the {name} from the reference", _TOTAL),
        ("scheme_", f"part of the scheme in the error of the {name}", _SCHEME_PART),
        ("model_", f"part of the reduced model in the error of the {name}", _MODEL_PART),
    ):
        yield Variable(
            f"{name}_{part}error", "1", meaning, condition="reference", may_be_undefined=True, comment=comment
        )


TABLE = (
    Variable("displacement", "m", "displacement of the blade tip towards the casing", "history", "scheme", signed=True),
    Variable(
        "velocity",
        "m s-1",
        "velocity of the blade tip towards the casing",
        "history",
        "scheme",
        signed=True,
        comment="moreau and penalty: of contacts without mass that of the modes, without the rate of their residual",
    ),
    Variable("temperature", "K", "temperature rise of the blade tip above the root", "history", "scheme", signed=True),
    Variable("impulse", "N s", "impulse of the casing on the blade tip since the start", "history", "scheme"),
    Variable(
        "contact_force",
        "N",
        "contact force on the blade tip, mean over the preceding interval",
        "history",
        cell_methods="t: mean (over the preceding interval of t)",
    ),
    Variable("depth_temperature", "K", _MEAN, "history", condition="depth", signed=True, comment=_DEPTH),
    Variable("contact_impulse", "N s", "impulse of the casing on the blade tip over the duration"),
    Variable(
        "impacts",
        "1",
        "number of impacts",
        origin="scheme",
        comment=(
            "event_driven: velocity jumps; impacts that accumulate have no number, a threshold of speed fixes how many "
            "are followed one by one; time-stepping schemes: steps with an impulse after one without"
        ),
    ),
    Variable(
        "contact_time",
        "s",
        "time in contact",
        origin="scheme",
        comment=(
            "event_driven with several contacts: right to 1e-9 of the duration, to 1e-5 where contacts open each other "
            "in turn while their impacts accumulate; so is period_contact"
        ),
    ),
    Variable(
        "max_penetration",
        "m",
        "largest penetration of the casing by the blade tip",
        origin="scheme",
        comment=(
            "0 where the tip never passed the casing; time-stepping schemes: at the ends of steps; event_driven: at "
            "its samples, on a rigid casing their rounding"
        ),
    ),
    Variable(
        "max_temperature",
        "K",
        "largest temperature rise of the blade tip",
        origin="scheme",
        signed=True,
        comment=f"{_LARGEST}; {_OF_TIP}",
    ),
    Variable(
        "max_depth_temperature",
        "K",
        f"largest {_MEAN}",
        condition="depth",
        signed=True,
        comment=f"{_DEPTH}; {_LARGEST}",
    ),
    Variable(
        "thermal_closing", "m", "quasi-static tip growth by the temperatures at the end", origin="scheme", signed=True
    ),
    Variable(
        "critical_alpha",
        "W N-1",
        "heat coupling above which a tip in permanent contact runs away",
        may_be_undefined=True,
        comment=(
            "static limit: infinite where the root is free or heat at the tip does not push it out; "
            "with a light heat capacity a tip can flutter below it, see growth_rate"
        ),
    ),
    Variable(
        "growth_rate",
        "s-1",
        "largest real part of the eigenvalues of the structure with the tip in permanent contact",
        signed=True,
        may_be_undefined=True,
        comment=_GROWTH,
    ),
    *(
        Variable(
            f"{name}_set",
            "",
            f"contacts whose permanent contact gives {of}",
            "text",
            "workflow",
            "contacts",
            comment=_SETS,
        )
        for name, of in (("critical", "critical_alpha"), ("growth", "growth_rate"))
    ),
    Variable(
        "projection_residual",
        "1",
        "share of initial states and constant loads that the reduced basis cannot hold",
        comment=_PROJECTION,
    ),
    *(
        Variable(f"{kind}_modes_used", "1", f"{kind} vectors beside the tip's own in a reduced model", condition="auto")
        for kind in ("mechanical", "thermal")
    ),
    Variable(
        "basis_error",
        "1",
        "error of the reduced model whose counts of modes the tolerance decided",
        condition="auto",
        may_be_undefined=True,
        comment=_BASIS_ERROR,
    ),
    Variable("steps", "1", "number of steps", origin="scheme"),
    Variable(
        "processor_time",
        "s",
        "processor time of the thread that computed the case's batch, shared equally among its cases",
        comment=_PROCESSOR_TIME,
    ),
    Variable("batch_width", "1", "number of cases in the batch that the case ran in", comment=_BATCH_WIDTH),
    *_of_balances(),
    *(part for name in COMPARED for part in _errors(name)),
    Variable(
        "reference_basis_error",
        "1",
        "change of the reference when its basis, which a tolerance decided, is refined",
        condition="auto reference",
        may_be_undefined=True,
        comment=_REFINEMENT,
    ),
    Variable(
        "predictability",
        "1",
        "relative L2 change of the reference's displacement when its gap changes by 1e-12",
        condition="reference",
        may_be_undefined=True,
        comment=_PREDICTABILITY,
    ),
    Variable("period_impulse", "N s", "impulse of the casing in a load period", "period", "scheme"),
    Variable("period_force", "N", "largest contact force in a load period, mean over an output interval", "period"),
    Variable(
        "period_temperature",
        "K",
        "largest temperature rise of the blade tip in a load period",
        "period",
        "scheme",
        signed=True,
        comment=_LARGEST,
    ),
    Variable("period_contact", "1", "share of a load period in contact", "period", "scheme"),
    *(
        Variable(name, unit, meaning, "period", "scheme", "sections", signed=True)
        for name, unit, meaning in (
            ("section_displacement", "m", "displacement of the blade tip at the start of a load period"),
            ("section_velocity", "m s-1", "velocity of the blade tip at the start of a load period"),
            ("section_temperature", "K", "temperature rise of the blade tip at the start of a load period"),
            ("period_impacts", "1", "number of impacts in a load period, in which a step counts that begins in it"),
        )
    ),
    *(
        Variable(
            f"period_displacement{end}",
            "m",
            f"{extreme} displacement of the blade tip in a load period",
            "period",
            condition="sections",
            signed=True,
            comment="of the output samples in it and of the sections at its ends",
        )
        for end, extreme in (("", "largest"), ("_min", "smallest"))
    ),
    *steady_variables(),
    *_of_sensors(),
    *_of_events(),
    *_of_coating(),
    Variable("bifurcation", "1", "what happens at a point of a branch of steady rubs", "point", condition="branch"),
    *_of_boundaries(),
    Variable("status", "1", "how the case ended", "flag", "scheme"),
    Variable(
        "runaway",
        "1",
        "whether a tip in permanent contact would run away",
        "flag",
        comment=(
            "alpha > 0 or friction along a tangent, and growth_rate positive by more than its uncertainty; by heat or "
            "friction alone, or as flutter"
        ),
    ),
)
"""Every variable but those that a scheme declares for itself in ``METRICS``."""

STRUCTURAL = frozenset({"t", "period", "message", "message_length", "provenance", "sample_point", "sample_matrix"})
"""Further names that an archive uses."""

STEADY = frozenset({"phase", "point", "curve", "curve_point", "uncertain", "uncertain_value", "uncertain_unit"})
"""Dimensions of archives with steady rubs or branches."""

SENSORS, EVENTS = frozenset({"sensor", "sensor_unit"}), frozenset({"event"})
"""Dimensions and labels of archives with sensors, or with events."""

WORN = frozenset({"sector", "sector_angle", "revolution"})
"""Dimensions and labels of archives with a coating."""

BY_NAME = {variable.name: variable for variable in TABLE}


def of_scheme(name: str, unit: str, meaning: str) -> Variable:
    """Return the variable that a scheme declares in its ``METRICS``."""
    return Variable(name, unit, meaning, origin="scheme", condition="scheme", signed=True, may_be_undefined=True)


_OF_SEVERAL = {
    "impacts": "velocity jumps of a contact with an impulse of its own; 0 of contacts without mass, which have none",
    "contact_time": "time in which a contact is held",
    "thermal_closing": "the largest of all contacts",
    "steady_closing": "the largest of all contacts",
    "critical_alpha": f"static limit of critical_set, {_SETS}",
    "growth_rate": f"of growth_set, {_SETS}; {_GROWTH}",
}


def of_contacts(variable: Variable) -> Variable:
    """Return a variable as it is defined of a structure with several contacts."""
    comment = _OF_SEVERAL.get(variable.name, variable.comment)
    meaning = variable.meaning.replace("the blade tip", "a contact") if variable.is_of_contact else variable.meaning
    return replace(variable, meaning=meaning, comment=comment)


def select(shape: Shape | None = None, origin: Origin | None = None, *conditions: Condition) -> Iterator[Variable]:
    """Yield the variables of a shape, an origin and any of some conditions; what is left out selects all."""
    for variable in TABLE:
        fits = shape in (None, variable.shape) and origin in (None, variable.origin)
        if fits and (not conditions or variable.condition in conditions):
            yield variable


def along_branch(
    name: str, unit: str, meaning: str, *more: Condition, beside: Sequence[Condition] = ()
) -> Iterator[Variable]:
    """Yield the variables of an archive of branches, at each point: the axis, bifurcations, steady rubs and more.

    Then those of conditions ``beside``, which have shapes of their own.
    """
    yield Variable(name, unit, meaning, "point", signed=True, may_be_undefined=True)
    for variable in select(None, None, "steady", "branch", *more):
        yield replace(variable, shape="point phase" if variable.shape == "phase" else "point")
    yield from (replace(each, unit=each.unit or unit) for word in beside for each in select(None, None, word))


def reserved_names(declared: frozenset[str] = frozenset()) -> frozenset[str]:
    """Return the names that no axis of a study may have; ``declared`` are those of schemes' own metrics."""
    return frozenset(BY_NAME) | STRUCTURAL | declared
