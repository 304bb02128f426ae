"""Cases that diverged although their numbers stayed finite, and runaways, which are physics.

A case is marked ``diverged``:

- In every scheme with balances: ``energy_residual`` is above :data:`CREATED`.
- In time-stepping where K1 is regular: the largest |x_n|, of any contact, exceeds :data:`EXCESS` times the length
  accounted for by the scene, the largest of |gap|, |x_n(0)|, S · largest load, √(2 S E) of the initial energy E, and
  the quasi-static growth by initial temperatures, heating and friction heat.

The largest |x_n| is that of the samples and of gap + ``max_penetration``, which is taken over all steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import (
    Array,
    Cases,
    Structure,
    analyse_contacts,
    critical_alphas,
    growth_of_sets,
    one_thread,
    rates,
    set_text,
    worst,
)
from workflow.reduction import OF_AUTO, reduce_structure, takes
from workflow.schemes import Results, Status

CREATED = 0.99
"""Energy residual above which a case has diverged: a hundred times the energy that it should have."""

EXCESS = 1000.0
"""Largest |x_n|, over the length accounted for, above which a case has diverged: a resonance with a damping ratio of
5e-4 amplifies a load by as much."""

_LOST = 1e6
"""Quasi-static growth, over the length accounted for otherwise, above which an energy balance is rounding: the work
against thermal forces exceeds the energy by the square, and 1e-16 of it is as large as the energy at 1e8."""

_AT_REST = 1e-12
"""Largest |x_n|, over the length accounted for, up to which the tip never left a gap of 0: a few thousand roundings.
The work of load and contact force, which cancel, is then compared with no energy."""

_MOST_STATES, _KEPT = 600, 100
"""States up to which all poles of a structure are computed, in a quarter of a second; vectors of each kind of a larger
one, with which rates agree to 1e-9 from a fiftieth to two hundred times the critical coupling."""

_AT_CRITICAL = 1e-9
"""Relative excess over the critical coupling up to which there is no runaway: far above its rounding, about 1e-14."""


def mark_blown_up(
    structure: Structure,
    statics: Callable[[], tuple[Array, Array]],
    growth_rates: Callable[[Cases], Array],
    cases: Cases,
    results: Results,
    duration: float,
    *,
    is_stepped: bool,
) -> Results:
    """Return the results with ``diverged`` and a message for every ok case that has diverged.

    Parameters
    ----------
    structure
        The full structure, on which the cases are given.
    statics
        See :func:`workflow.models.statics`.
    growth_rates
        Growth rates of cases with the tip in contact, 1/s, ``(case,)``.
    cases, results, duration
        The cases, the scheme's results, and the duration, s.
    is_stepped
        Whether the scheme steps in time: an exact motion is not bounded.
    """
    ok, reach = results.status == Status.OK, _reach(results, cases)
    start = _largest(np.abs(results.histories["displacement"][..., 0]))
    residual = results.metrics.get("energy_residual", np.full(cases.count, np.nan))
    created = ok & (residual > CREATED)
    far = ok & is_stepped & (reach > EXCESS * np.fmax(_largest(np.abs(cases.clearances)), start))
    which = np.flatnonzero(created | far)
    if not which.size:
        return results
    suspects, (flexibilities, rows) = cases.take(which), statics()
    flexibility = float(flexibilities.max())
    if np.isfinite(flexibility):
        length = np.fmax(_accounted(structure, suspects, flexibility, rows, duration), start[which])
        most = _farthest(suspects, results, which, rows, length, growth_rates(suspects) * duration)
        pushed = np.abs(results.metrics["thermal_closing"][which]) > _LOST * length
        is_lost = pushed & (reach[which] <= EXCESS * length)
    else:
        length, most = _free_flight(structure, suspects, duration), np.full(which.size, np.inf)
        is_lost = np.zeros(which.size, dtype=bool)
    is_lost |= reach[which] <= _AT_REST * length
    status, messages = results.status.copy(), dict(results.messages)
    for k, case in enumerate(map(int, which)):
        if far[case] and reach[case] > most[k]:
            messages[case] = (
                f"the tip moved {reach[case]:.3g} m; {EXCESS:g} times what gap, start, loads and heat account for is "
                f"{most[k]:.3g} m"
            )
        elif created[case] and not is_lost[k]:
            messages[case] = (
                f"energy was created: its balance has a residual of {residual[case]:+.3g} times the largest energy, "
                f"above {CREATED:+g}"
            )
        else:
            continue
        status[case] = Status.DIVERGED
    return replace(results, status=status, messages=messages)


def _largest(values: Array) -> Array:
    """Return the largest of each case's values, ``(case,)``; NaN does not count."""
    return np.asarray(np.fmax.reduce(values.reshape(len(values), -1), axis=1))


def _reach(results: Results, cases: Cases) -> Array:
    """Return the largest known |x_n| of each case, m."""
    displacement, beyond = results.histories["displacement"], results.metrics["max_penetration"]
    gaps = cases.clearances.reshape(beyond.shape)
    passed = _largest(np.where(beyond > 0, np.abs(gaps + beyond), -np.inf)) - cases.casing_harmonics.reach
    return np.asarray(np.fmax.reduce([_largest(displacement), _largest(-displacement), np.fmax(passed, 0.0)]))


def _accounted(structure: Structure, cases: Cases, flexibility: float, rows: Array, duration: float) -> Array:
    """Return the length accounted for in each case without friction heat, m, ``(case,)``.

    Heating is bounded without conduction, each temperature by its own.
    """
    load, place = _largest_load(structure, cases), _largest(np.abs(cases.clearances)) + cases.casing_harmonics.reach
    warm = [np.abs((row * cases.temperature).sum(axis=1)) for row in rows]
    capacity = np.abs(structure.thermal.inertia_of(np.ones(structure.thermal_size)))
    heated = [(np.abs(row) * np.abs(cases.heating) / capacity).sum(axis=1) * duration for row in rows]
    reached = np.sqrt(2 * flexibility * _energy(structure, cases))
    return np.asarray(np.fmax.reduce([place, flexibility * load, *warm, *heated, reached]))


def _farthest(
    cases: Cases, results: Results, which: NDArray[np.int64], rows: Array, length: Array, exponent: Array
) -> Array:
    """Return the largest admissible displacement of the tip in the cases ``which``, m, ``(case,)``.

    The growth by friction heat is quasi-static: that at the end, or that of the tip node (of several contacts: of the
    whole structure) at its largest temperature. It is limited to the length times e^``exponent``, growth rate ·
    duration: a scheme that creates energy creates heat too. Friction along a tangent may drive a pressed tip without
    heat.
    """
    closing = np.abs(results.metrics["thermal_closing"][which])
    sampled = _largest(np.abs(results.histories["temperature"][which]))
    hottest = np.fmax(_largest(np.abs(results.metrics["max_temperature"][which])), sampled)
    each = abs(rows[0, -1]) if not cases.contact_shape else np.abs(rows).sum(axis=1).max()
    with np.errstate(over="ignore"):
        grown = length * np.exp(np.fmax(exponent, 0.0))
    by_heat = np.fmin(np.fmax(closing, each * hottest), grown)
    return np.asarray(EXCESS * np.fmax(length, np.where(cases.friction > 0, grown, by_heat)))


def _free_flight(structure: Structure, cases: Cases, duration: float) -> Array:
    """Return the displacement of the free structure by loads and initial velocities, m, ``(case,)``."""
    rigid = np.ones(structure.mechanical_size)
    mass = float(rigid @ structure.mechanical.inertia_of(rigid))
    load = _largest_load(structure, cases)
    return np.asarray(load * duration * duration / mass + np.abs(cases.velocity).max(axis=1) * duration)


def _largest_load(structure: Structure, cases: Cases) -> Array:
    """Return the largest load of each case, summed over all coordinates, N, ``(case,)``.

    The norm of a load direction counts as at least 1: its entries may be those of modes, 1/√kg.
    """
    moving = np.abs(cases.mean) + cases.load_harmonics.reach
    return np.asarray(moving * max(1.0, np.abs(structure.load_direction).sum()) + np.abs(cases.steady).sum(axis=1))


def _energy(structure: Structure, cases: Cases) -> Array:
    """Return the initial energy vᵀMv/2 + xᵀK1x/2 of each case, J, ``(case,)``."""
    pair, states = structure.mechanical, zip(cases.displacement, cases.velocity, strict=True)
    return np.array([pair.energies(x).sum() + v @ pair.inertia_of(v) for x, v in states]) / 2


class PermanentContact(NamedTuple):
    """What becomes of cases whose contacts stay closed, ``(case,)`` each."""

    critical_alpha: Array
    """α_c, the least of all closed sets, m/s."""
    critical_set: NDArray[np.str_]
    """Which set that is, in words; empty where α_c is infinite."""
    growth_rate: Array
    frequency: Array
    """``growth_rate``, ``frequency``: of the set that grows fastest, 1/s and Hz, 0 where nothing oscillates."""
    growth_set: NDArray[np.str_]
    runaway: NDArray[np.bool_]
    """``growth_set``, ``runaway``: which set that is, in words, and whether it grows."""


def _without_many_states(structure: Structure) -> Structure:
    """Return a structure, or its reduction by krylov where it has too many states for all of its poles."""
    sizes = structure.mechanical_size, structure.thermal_size
    if 2 * sizes[0] + sizes[1] <= _MOST_STATES or not takes(OF_AUTO, structure.contacts):
        return structure
    slowest, (x, theta) = rates(structure), (None if size <= 2 * _KEPT else _KEPT for size in sizes)
    longest = 100 / float(slowest[slowest > 0].min(initial=np.inf))
    return reduce_structure(structure, x, theta, OF_AUTO, longest or 1.0).structure


class Runaways:
    """What becomes of permanent contact of the structure on which cases are run, kept for each pair of α and µ."""

    def __init__(self, structure: Structure) -> None:
        with one_thread():
            self._basis = analyse_contacts(_without_many_states(structure))
        self._slides = structure.contacts.slides
        self._critical = cache(lambda friction: critical_alphas(structure, friction))
        self._known: dict[tuple[float, float], tuple[Any, ...]] = {}

    def of(self, alpha: Array, friction: Array) -> PermanentContact:
        """Return what becomes of cases in permanent contact.

        Above the critical coupling a real eigenvalue is certainly positive, however small beside the largest one:
        1 - α G(s) is negative at 0 and 1 at infinity.
        """
        distinct, where = np.unique(alpha + 1j * friction, return_inverse=True)
        pairs = list(zip(distinct.real.tolist(), distinct.imag.tolist(), strict=True))
        if new := [pair for pair in pairs if pair not in self._known]:
            computed = self._computed(*np.transpose(new))
            self._known.update(zip(new, zip(*computed, strict=True), strict=True))
        columns = zip(*(self._known[pair] for pair in pairs), strict=True)
        return PermanentContact(*(np.array(column)[where] for column in columns))

    def _computed(self, alpha: Array, friction: Array) -> PermanentContact:
        """Return what becomes of permanent contact at each pair of α and µ."""
        every = [self._critical(each) for each in friction.tolist()]
        least = [min(alphas, key=alphas.__getitem__) for alphas in every]
        critical = np.array([alphas[labels] for alphas, labels in zip(every, least, strict=True)])
        of_sets = growth_of_sets(self._basis, alpha, friction)
        which, fastest = worst(of_sets)
        acts = (alpha > 0) | ((friction > 0) & self._slides)
        return PermanentContact(
            critical,
            np.where(np.isfinite(critical), [set_text(labels) for labels in least], ""),
            fastest.rate,
            fastest.frequency,
            np.array([set_text(labels) for labels in of_sets])[which],
            acts & (fastest.is_positive | (alpha > critical * (1 + _AT_CRITICAL))),
        )
