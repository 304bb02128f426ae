"""Interface of a scheme: its inputs and results are arrays and frozen dataclasses only."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from enum import IntEnum
from fractions import Fraction
from inspect import signature
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import AT_BORDER, Array, Cases, EndState, Structure, couples_free_modes

HISTORIES = ("displacement", "velocity", "temperature", "impulse")
"""Tip histories that every scheme samples, each of shape ``(case, t)``."""


AT_REST = 1e-13
"""Distance and velocity of a contact relative to its casing at t = 0, over the lengths and velocities in them, up to
which they are rounding: that of the some hundred terms of a static start, or of a state in which another case ended.
Among the velocities is that of the lengths in a step, or in 1/ω of the fastest mode."""

LINEAR = 1000.0
"""Temperature rise, K, above which a linear model means nothing: metals melt, or conduct and expand otherwise."""

EXTRAPOLATED = "extrapolated: "
"""Prefix of the message of a case that ended ok, but in part by extrapolation."""


class Status(IntEnum):
    """Outcome of a case."""

    OK = 0
    DIVERGED = 1
    ILL_POSED = 2
    FAILED = 3
    NOT_RUN = 4


@dataclass(frozen=True)
class Sampling:
    """Common sampling of all histories: t_k = k · interval from 0 to the duration inclusive."""

    duration: float
    interval: float
    """``duration``, ``interval``: seconds; the duration is ``count - 1`` intervals."""
    count: int
    """Number of samples, the initial state included."""
    balances: bool = False
    """Whether the metrics ``energy_residual`` and ``heat_residual`` are given; NaN where the scheme is exact."""
    events: int = 0
    """Most events of a case that are kept, of event_driven."""
    ends: bool = False
    """Whether the states at the end are asked for."""
    wear_every: int = 0
    """Revolutions from one row of ``wear_map`` to the next; 0 where it is not asked for."""

    @property
    def times(self) -> Array:
        """Sample times, s, shape ``(t,)``: decimal multiples of the interval, so that 0.009 is found."""
        ratio = Fraction(repr(float(self.interval)))
        numerator, denominator = float(ratio.numerator), float(ratio.denominator)
        if ratio.numerator * self.count < 2**53 and ratio.denominator < 2**53:
            return np.arange(self.count, dtype=np.float64) * numerator / denominator
        return np.arange(self.count, dtype=np.float64) * self.interval

    def steps(self, h: float) -> int:
        """Return the number of steps of size ``h``: ceil(duration/h - 1e-9)."""
        return max(1, math.ceil(self.duration / h - 1e-9))


@dataclass(frozen=True, eq=False)
class Schedule:
    """Position of the samples between the steps of a fixed h.

    Sample k lies in step ``due[k]``, at the fraction ``weight[k]`` of it; weight 1 is the step's end itself.
    Sample 0 is the initial state and has ``due`` 0.
    """

    steps: int
    due: NDArray[np.int64]
    weight: Array


def schedule(sampling: Sampling, h: float) -> Schedule:
    """Place the samples between step ends by exact decimal arithmetic on ``interval`` and ``h``.

    Both are read as the decimal numbers their shortest representation shows, so that 1e-3 is a
    hundred steps of 1e-5 exactly and no sample slips to the neighbouring step.
    """
    ratio = Fraction(repr(float(sampling.interval))) / Fraction(repr(float(h)))
    p, q = ratio.numerator, ratio.denominator
    steps = sampling.steps(h)
    k: Any = np.arange(sampling.count)
    if max(sampling.count * p, q) > 2**52:  # beyond what int64 and float64 hold exactly
        k = k.astype(object)
    whole, rest = k * p // q, k * p % q
    due = np.where(rest == 0, whole, whole + 1)
    weight = np.where(rest == 0, 1.0, rest / q)
    beyond = due > steps  # the duration is a multiple of the interval only to 1e-9
    due, weight = np.where(beyond, steps, due), np.where(beyond, 1.0, weight)
    return Schedule(steps, due.astype(np.int64), weight.astype(np.float64))


class Worn(NamedTuple):
    """Worn depths of the sectors."""

    depth: Array
    """m, ``(case, contact, sector)``."""
    map: Array
    """Those at the ends of revolutions, ``(case, contact, revolution, sector)``."""
    every: int
    """Revolutions from one row of the map to the next."""


UNWORN = Worn(np.zeros((0, 0, 0)), np.zeros((0, 0, 0, 0)), 1)
"""Of a casing without a coating."""


def worn_of(cases: Cases, contacts: int, sampling: Sampling) -> Worn:
    """Return the worn depths of cases at t = 0, where a pressed contact crushes at once; without sectors if none."""
    own = cases.coating
    count = 0 if own is None else own.worn.shape[2]
    depth = np.zeros((cases.count, contacts, count)) if own is None else own.worn.copy()
    rows = 0 if own is None or not sampling.wear_every else int(np.max(_revolutions(own.speed, sampling)))
    return Worn(depth, np.full((cases.count, contacts, rows, count), np.nan), max(1, sampling.wear_every))


def _revolutions(speed: Array, sampling: Sampling) -> Array:
    """Return the number of rows of the map of each case."""
    return np.floor(sampling.duration * speed / sampling.wear_every + AT_BORDER)


def wear_results(cases: Cases, worn: Worn, lost: NDArray[np.bool_]) -> dict[str, Array]:
    """Return ``worn_depth`` and ``wear_map``, NaN beyond the sectors of a case and where it is ``lost``.

    Nothing without a coating.
    """
    own = cases.coating
    if own is None:
        return {}
    for case, count in enumerate(own.sectors.astype(int).tolist()):
        worn.depth[case, :, 0 if lost[case] else count :] = np.nan
    worn.map[lost] = np.nan
    results = {"worn_depth": worn.depth, "wear_map": worn.map}
    return results if cases.contact_shape else {name: values[:, 0] for name, values in results.items()}


@dataclass(frozen=True, eq=False)
class Results:
    """Results of a scheme for a batch."""

    histories: dict[str, Array]
    """One array per name in :data:`HISTORIES`, shape ``(case, t)``: m, m/s, K, N s. Of several contacts it is ``(case,
    contact, t)``, as all that the table of variables gives each contact has them after the case. And ``sensor_value``,
    ``(case, sensor, t)``, where the structure has sensors."""
    metrics: dict[str, Array]
    """Shape ``(case,)``: ``impacts``, ``contact_time`` [s], ``max_penetration`` [m], ``max_temperature`` [K],
    ``thermal_closing`` [m], ``steps``; with balances ``energy_residual`` [1] and ``heat_residual`` [1]; and those of
    the scheme's ``METRICS``."""
    period_impulse: Array
    period_temperature: Array
    period_contact: Array
    """``period_impulse``, ``period_temperature``, ``period_contact``: per complete load period, shape ``(case,
    period)``, NaN beyond a case's last one: impulse [N s], largest tip temperature [K], share of the period in contact
    [1]."""
    status: NDArray[np.int8]
    """:class:`Status` of every case, int8, shape ``(case,)``. A case that is not ok has NaN from the moment it failed,
    never another case's or an earlier value."""
    messages: dict[int, str]
    """Why a case is not ok, by its position in the batch; deterministic, without addresses or paths. That of a case
    that is ok begins with :data:`EXTRAPOLATED`."""
    sections: dict[str, Array] = field(default_factory=dict)
    """``section_displacement`` [m], ``section_velocity`` [m/s] and ``section_temperature`` [K] at the start of each of
    these periods, and their ``period_impacts`` [1]; empty where a scheme does not give them."""
    events: dict[str, Array] = field(default_factory=dict)
    """``event_time`` [s], ``event_kind`` (place in :data:`~workflow.variables.EVENT_KINDS`), ``event_impulse`` [N s],
    ``event_approach`` [m/s], ``event_contact`` (from 0), ``(case, event)``, NaN beyond the last, and ``event_count``,
    ``(case,)``; empty where none are asked for or given."""
    wear: dict[str, Array] = field(default_factory=dict)
    """Of cases with a coating ``worn_depth`` [m], ``(case, sector)``, and ``wear_map`` [m], ``(case, revolution,
    sector)``, NaN beyond a case's sectors and revolutions; with several contacts after the case. ``border_work`` is a
    metric then."""
    end: EndState | None = None
    """States at the end, in the structure's coordinates, from which the next point of a sweep starts; may be ``None``
    where :attr:`Sampling.ends` is false."""


def merge(parts: list[tuple[NDArray[np.int64], Results]]) -> Results:
    """Merge the results of groups of cases, each given with the positions of its cases."""
    if len(parts) == 1:
        return parts[0][1]
    positions = np.concatenate([where for where, _ in parts])
    order = np.argsort(positions)
    results = [result for _, result in parts]

    def joined(arrays: list[Array]) -> Array:
        whole = np.full((order.size, *map(max, *(a.shape[1:] for a in arrays))), np.nan)
        for (where, _), a in zip(parts, arrays, strict=True):
            inside: Any = (where, *map(slice, a.shape[1:]))
            whole[inside] = a
        return whole

    ends: list[Any] = [result.end for result in results]
    return Results(
        histories={name: joined([r.histories[name] for r in results]) for name in results[0].histories},
        metrics={name: joined([r.metrics[name] for r in results]) for name in results[0].metrics},
        period_impulse=joined([r.period_impulse for r in results]),
        period_temperature=joined([r.period_temperature for r in results]),
        period_contact=joined([r.period_contact for r in results]),
        status=np.concatenate([r.status for r in results])[order],
        messages={int(where[k]): text for where, r in parts for k, text in r.messages.items()},
        sections={name: joined([r.sections[name] for r in results]) for name in results[0].sections},
        events={name: joined([r.events[name] for r in results]) for name in results[0].events},
        wear={name: joined([r.wear[name] for r in results]) for name in results[0].wear},
        end=None if None in ends else EndState(*(np.concatenate(rows)[order] for rows in zip(*ends, strict=True))),
    )


SECTIONS = ("section_displacement", "section_velocity", "section_temperature", "period_impacts")


def sections_of(starts: Array, periods: NDArray[np.int64], start: Array) -> dict[str, Array]:
    """Return :attr:`Results.sections`.

    Parameters
    ----------
    starts
        States at the ends of load periods, and the impacts in them, ``(case, 4, period)``; of several contacts
        ``(case, 4, contact, period)``.
    periods
        Number of complete load periods, ``(case,)``.
    start
        Tip displacement, velocity and temperature at t = 0, ``(case, 3)`` or ``(case, 3, contact)``.
    """
    values = starts.copy()
    values[:, :3, ..., 1:] = starts[:, :3, ..., :-1]
    values[:, :3, ..., :1] = start[..., None]
    case, over = np.nonzero(np.arange(values.shape[-1]) >= periods[:, None])
    values[case, ..., over] = np.nan
    return dict(zip(SECTIONS, values.swapaxes(0, 1), strict=True))


def complete_periods(frequency: Array, sampling: Sampling) -> NDArray[np.int64]:
    """Return how many whole periods of each frequency fit in the duration, up to rounding (1e-9 of one)."""
    return np.floor(sampling.duration * frequency * (1 + 1e-12) + 1e-9).astype(np.int64)


class RefusedStructureError(ValueError):
    """A scheme cannot step a structure; the text says why."""


ONE_CONTACT = "it takes one contact, with mass"
"""Why a scheme cannot step a structure with other contacts."""

NEEDS_MASS = (
    "its contacts are without mass, by which a step of the scheme divides; moreau, event_driven and implicit penalty "
    "take them"
)
"""Why a scheme cannot step contacts without mass."""


def _of_friction(limit: Callable[..., float]) -> Callable[[Structure, Any, float], float]:
    """Return a ``contact_limit`` that takes a friction coefficient, from one that may take two arguments only."""
    if len(signature(limit).parameters) > 2:
        return limit
    return lambda structure, options, friction: limit(structure, options)


@dataclass(frozen=True)
class Scheme:
    """Interface of a scheme's module; fields with a default are optional."""

    Options: type[Any]
    """Frozen dataclass of its options, declared with :func:`workflow.declare.quantity`."""
    READS: frozenset[str]
    """Which of the axes ``e``, ``h``, ``alpha`` change its results: cases that differ only in one of the others are
    computed once. All else of the scene changes them, and so do its own options."""
    init: Callable[[Structure, float, Any], Any]
    """``init(structure, h, options)``: work that depends on the operator alone, done once per batch. That of a module
    is not called where :meth:`refusal` gives a reason: :class:`RefusedStructureError` is raised."""
    compute: Callable[[Any, Cases, Sampling], Results]
    """``compute(operator, cases, sampling)`` runs a whole batch and returns :class:`Results`; it never raises for the
    failure of a case, and a case's bits do not depend on the other cases."""
    STEP_SECONDS: float = 0.0
    """Measured time of a step of one case per state, s; 0 where it was not measured."""
    amplification: Callable[[Array, Array, float, Any], Any] | None = None
    """``amplification(frequency, damping, h, options)``: eigenvalues of the free step of modes x'' + c x' + ω² x = 0,
    complex, ``(mode, 2)``, for ω [rad/s] and c [1/s] of shape ``(mode,)``. A scheme without steps returns the exact
    propagator's for ``h``."""
    thermal_amplification: Callable[[Array, float, Any], Array] | None = None
    """``thermal_amplification(rate, h, options)``: factor of the free step of thermal modes τ' = -μ τ, ``(mode,)``."""
    METRICS: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """Its metrics besides the common ones: name to unit and meaning."""
    TOGETHER: int = 1
    """Number of cases that are stepped at once, at little more than the cost of one: tasks do not split them."""
    contact_limit: Callable[[Structure, Any, float], float] | None = None
    """``contact_limit(structure, options, friction)``: the largest step, s, that is stable in intermittent contact, at
    a friction coefficient along the structure's tangent; without a third argument it holds for all coefficients."""
    operator_name: Callable[[Structure], str] | None = None
    """``operator_name(structure)``: the form in which it solves a structure, as ``plan`` prints it; empty for none."""
    contact_stiffness_of: Callable[[Structure, Any], float] | None = None
    """``contact_stiffness_of(structure, options)``: stiffness of its contact spring, N/m, where it has one."""
    rigid: Callable[[Structure, float], Any] | None = None
    """``rigid(structure, h)``: options with which it converges to a rigid casing as h → 0, where not all do."""
    HARMONICS: frozenset[str] = frozenset({"load"})
    """Which of ``load`` and ``casing`` may have harmonics. By default the load (``Recorder.load`` and ``Cases.load_at``
    include them); ``casing`` declares that it takes a moving casing (``Cases.casing_of_contacts``)."""
    GENERAL: frozenset[str] = frozenset()
    """What else it takes: ``damping`` by a matrix that couples modes, a ``load`` away from the tip, ``friction`` along
    the direction in which the casing slides (``Cases.friction``, ``Contacts.tangent``), ``depth``: the mean
    temperature over a depth to record instead of the tip's (``Contacts.observed``), several ``contacts``
    (``Structure.contacts``, ``Cases.gaps``), which a law by ``init_theta`` or ``init_central`` takes without a word,
    ``massless``: those without mass, one too, an ``elastic`` casing (``Contacts.casing_flexibility``) and its
    ``coating`` (``Cases.coating``)."""
    about: str = ""
    """One line on the scheme; by default the first paragraph of the module's docstring."""

    @classmethod
    def required(cls) -> tuple[str, ...]:
        """Return the names that a module must define."""
        return tuple(f.name for f in fields(cls) if f.default is MISSING and f.default_factory is MISSING)

    @classmethod
    def of(cls, module: ModuleType, also: frozenset[str] = frozenset()) -> Scheme:
        """Return the scheme that a module defines, which takes ``also`` what its parts take, as in ``GENERAL``."""
        offered = {f.name: vars(module)[f.name] for f in fields(cls) if f.name in vars(module)}
        offered["GENERAL"] = offered.get("GENERAL", frozenset()) | also
        if "contact_limit" in offered:
            offered["contact_limit"] = _of_friction(offered["contact_limit"])
        scheme = cls(**{"about": " ".join((module.__doc__ or "").split("\n\n")[0].split()), **offered})

        def init(structure: Structure, h: float, options: Any) -> Any:
            reason = scheme.refusal(structure, options)
            if reason is not None:
                raise RefusedStructureError(reason)
            return module.init(structure, h, options)

        return replace(scheme, init=init)

    def refusal(self, structure: Structure, options: Any) -> str | None:
        """Return why the scheme cannot step a structure, ``None`` where it can."""
        if structure.load is not None and "load" not in self.GENERAL:
            return "its load does not act on the tip, which the scheme does not take"
        if structure.contacts.observed is not None and "depth" not in self.GENERAL:
            return "it does not record the temperature over a depth"
        if structure.contacts.casing_flexibility > 0 and "elastic" not in self.GENERAL:
            return "it takes a rigid casing; `event_driven` and `moreau` take one with `flexibility`"
        if not structure.contacts.is_one_with_mass and "contacts" not in self.GENERAL:
            return ONE_CONTACT
        if structure.contacts.is_massless and "massless" not in self.GENERAL:
            return NEEDS_MASS
        if not structure.contacts.is_one_with_mass and structure.contacts.observed is not None:
            return "it does not record the temperature over a depth at contacts without mass, or on an elastic casing"
        if "damping" not in self.GENERAL and couples_free_modes(structure):
            return "its damping matrix couples its modes, which the scheme does not take"
        try:
            if self.contact_stiffness_of is not None:
                self.contact_stiffness_of(structure, options)
        except RefusedStructureError as error:
            return str(error)
        return None

    def cannot_take(self, load: bool, casing: bool) -> str | None:
        """Return why the scheme refuses a scene with harmonics of load or casing, ``None`` where it takes them."""
        if load and "load" not in self.HARMONICS:
            return "does not take harmonics of the load"
        return "does not take a casing that moves" if casing and "casing" not in self.HARMONICS else None
