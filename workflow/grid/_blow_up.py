"""Cases whose numbers blew up although they stayed finite: marked ``diverged``, whatever the scheme.

Three rules, all about what no motion of the model can do:

- Energy was created, by the balances (:mod:`workflow.grid._created_energy`): of every scheme where the study has
  them, of a contact spring beyond the step up to which it holds in any case. What a scheme dissipates never counts.
- Contact gave the tip energy (:mod:`workflow.grid._contact_work`), of ``moreau`` where the study has balances.
- Of time-stepping, with or without balances, where K1 is regular: the largest |x_n| exceeds both :data:`EXCESS` times
  the largest length that the case accounts for without contact (:func:`_accounted`) and twice the growth by friction
  heat (:func:`_farthest`).

The largest |x_n| is that of the samples and of gap + ``max_penetration``, which fixed-step schemes take over all
steps. It is a lower bound: a motion that blows up between two samples shows in the penetration, as it comes back to
the casing, or in the last sample. A running maximum in the march would cost every step of every case.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Indices
from workflow.grid._contact_work import contact_gave_too_much, contact_work_text
from workflow.grid._created_energy import advice, created_energy
from workflow.grid._operators import runaways_of, statics_of, structure_of
from workflow.models import Array, Cases, Chain, Sparse, Structure
from workflow.schemes import Results, Sampling, Status
from workflow.study import Cell

_LOST = 1e6
"""Quasi-static growth over what a case accounts for otherwise, above which its energy balance is rounding."""

_AT_REST = 1e-12
"""Largest |x_n| over the length a case accounts for, up to which the tip never left a gap of 0: a few thousand
roundings of that length."""

EXCESS = 1000.0
"""Largest |x_n| over the length that a case accounts for, above which it has diverged: a resonance at a damping
ratio of 5e-4 amplifies a load by as much."""

GROWTH = 2.0
"""Largest |x_n| over the growth by friction heat, above which a case has diverged: the casing keeps a pressed tip
from growing at all, and where friction suddenly heats a tip that then leaves it overshoots its growth by as much again.
Runaways of all schemes were below 0.5, contact springs beyond their limit above 2.7."""


def mark_blown_up(cell: Cell, cases: Cases, results: Results, sampling: Sampling) -> Results:
    """Return the results with ``diverged`` and a message for every ok case that blew up.

    Parameters
    ----------
    cell
        The settings that the cases share.
    cases
        Their conditions on the nodes of the full structure.
    results
        What the scheme gave for them.
    sampling
        What it was called with.
    """
    duration = sampling.duration
    ok = results.status == Status.OK
    blown: dict[int, str] = {}
    reach = _reach(results, cases)
    start = np.abs(results.histories["displacement"][:, 0])
    stepped = "h" in schemes.load(cell.scheme.method).READS
    far = np.flatnonzero(ok & stepped & (reach > EXCESS * np.fmax(np.abs(cases.gap), start)))
    if far.size:
        flexibility, growth = statics_of(cell.scene.model, cell.scene.parameters)
        if np.isfinite(flexibility):
            base = np.fmax(_accounted(cell, cases.take(far), flexibility, growth, duration), start[far])
            farthest = _farthest(cell, cases.take(far), results, far, growth[-1], base, duration)
            blown |= {
                int(case): f"the tip moved {reach[case]:.3g} m; {EXCESS:g} times what gap, start, loads and heating "
                f"account for, or {GROWTH:g} times the growth by friction heat, is {most:.3g} m"
                f"{advice(cell, float(cases.friction[case]))}"
                for case, most in zip(far, farthest, strict=True)
                if reach[case] > most
            }
    created = created_energy(cell, cases, results, ok & ~np.isin(np.arange(cases.count), list(blown)), sampling)
    blown |= {
        int(case): contact_work_text(results, int(case), cell.h)
        for case in np.flatnonzero(ok & contact_gave_too_much(results))
        if int(case) not in blown and not _is_rounding(cell, cases, results, int(case), duration)
    }
    blown |= {
        int(case): f"{created.text(int(case))}{advice(cell, float(cases.friction[case]))}"
        for case in np.flatnonzero(ok & created.is_too_much)
        if not _is_rounding(cell, cases, results, int(case), duration)
    }
    if not blown:
        return results
    status = results.status.copy()
    status[list(blown)] = Status.DIVERGED
    return replace(results, status=status, messages={**results.messages, **blown})


def _is_rounding(cell: Cell, cases: Cases, results: Results, case: int, duration: float) -> bool:
    """Tell whether the energy balance of a case is lost in rounding, so that its residual tells nothing.

    Either the tip stays where it was at a gap of 0 and no energy is in the structure: what is left of the work of load
    and contact force, which cancel, is set beside nothing. Or heat pushes a tip that stays where it is: the work
    against thermal forces exceeds the energy by the square of growth over displacement, and 1e-16 of it is as large as
    the energy where that ratio is about 1e8.
    """
    flexibility, growth = statics_of(cell.scene.model, cell.scene.parameters)
    one, reach = cases.take(np.array([case])), float(_reach(results, cases)[case])
    if np.isinf(flexibility):
        return reach <= _AT_REST * _free_flight(cell, one, duration)
    base = float(_accounted(cell, one, flexibility, growth, duration)[0])
    if reach <= _AT_REST * base:
        return True
    return reach <= EXCESS * base and abs(float(results.metrics["thermal_closing"][case])) > _LOST * base


def _free_flight(cell: Cell, case: Cases, duration: float) -> float:
    """Return how far the loads of one case and its initial velocity would take the whole structure, m."""
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    assert not isinstance(structure, Sparse), "it is held"
    mass = structure.masses.sum() if isinstance(structure, Chain) else np.diag(structure.mass).sum()
    load = float(_largest_load(structure, case)[0])
    return load * duration * duration / float(mass) + float(np.abs(case.velocity[0]).max()) * duration


def _largest_load(structure: Structure, cases: Cases) -> Array:
    """Return the largest load of each case, those of all coordinates added up, N, ``(case,)``.

    A load direction counts as at least that of the tip: its entries may be those of modes, 1/√kg.
    """
    moving = np.abs(cases.mean) + np.abs(cases.amplitude) + cases.load_harmonics.reach
    return np.asarray(moving * max(1.0, np.abs(structure.load_direction).sum()) + np.abs(cases.steady).sum(axis=1))


def _reach(results: Results, cases: Cases) -> Array:
    """Return the largest known |x_n| of each case, m."""
    displacement, beyond = results.histories["displacement"], results.metrics["max_penetration"]
    sampled = np.fmax(np.fmax.reduce(displacement, axis=1), -np.fmin.reduce(displacement, axis=1))
    moved = cases.casing_harmonics.reach
    return np.asarray(np.fmax(sampled, np.where(beyond > 0, np.abs(cases.gap + beyond) - moved, 0.0)))


def _accounted(cell: Cell, cases: Cases, flexibility: float, growth: Array, duration: float) -> Array:
    """Return the largest length of what acts on each case without contact, m, ``(case,)``.

    |gap| and how far the casing moves from it; S times the largest load, that of all nodes added up; the
    quasi-static growth of the initial temperatures and of what the heating brings in over the duration, each node's
    heat kept in it; and √(2 S E) with the initial energy E, the largest |x_n| that an energy E can bring about.
    """
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    load, place = _largest_load(structure, cases), np.abs(cases.gap) + cases.casing_harmonics.reach
    warm = np.abs((growth * cases.temperature).sum(axis=1))
    capacity = _heat_capacities(structure)
    heated = (np.abs(growth) * np.abs(cases.heating) / capacity).sum(axis=1) * duration
    reached = np.sqrt(2 * flexibility * _energy(structure, cases))
    return np.asarray(np.max([place, flexibility * load, warm, heated, reached], axis=0))


def _heat_capacities(structure: Structure) -> Array:
    """Return the heat capacity of each temperature, J/K, ``(thermal,)``."""
    if isinstance(structure, Chain):
        return structure.heat_capacities
    if isinstance(structure, Sparse):
        return np.asarray(structure.thermal.inertia.diagonal())
    return np.diag(structure.heat_capacity)


def _energy(structure: Structure, cases: Cases) -> Array:
    """Return the initial energy vᵀMv/2 + xᵀK1x/2 of each case, J."""
    if isinstance(structure, Sparse):
        strained = cases.displacement * structure.elongations(cases.displacement.T).T
        moving = cases.velocity * structure.inertia_forces(cases.velocity.T).T
        return np.asarray(strained.sum(axis=1) + moving.sum(axis=1)) / 2
    if isinstance(structure, Chain):
        elongation = np.diff(cases.displacement, axis=1, prepend=0.0)
        kinetic = (structure.masses * cases.velocity**2).sum(axis=1)
    else:
        elongation = cases.displacement @ structure.elongation.T
        kinetic = ((cases.velocity @ structure.mass) * cases.velocity).sum(axis=1)
    return np.asarray((kinetic + (structure.springs * elongation**2).sum(axis=1)) / 2)


def _farthest(
    cell: Cell, cases: Cases, results: Results, which: Indices, tip_growth: float, base: Array, duration: float
) -> Array:
    """Return how far the tip may move, m, ``(case,)``: EXCESS · ``base``, or GROWTH times the growth by friction heat.

    The growth is quasi-static: that at the end, or that of the tip node at its largest temperature. It counts up to
    EXCESS² · ``base`` · exp(g · duration) with the growth rate g of the tip in contact, if positive: where a scheme
    creates energy it creates heat too, which is no measure of what the model can do. Friction along a tangent may drive
    a pressed tip without heat: then EXCESS · ``base`` · exp(g · duration) is allowed.
    """
    closing = np.abs(results.metrics["thermal_closing"][which])
    sampled = np.abs(results.histories["temperature"][which])
    hottest = np.fmax(np.abs(results.metrics["max_temperature"][which]), np.fmax.reduce(sampled, axis=1))
    _, rate, _ = runaways_of(cell, cases.alpha, cases.friction)
    grown = EXCESS * base * np.exp(np.fmax(rate, 0.0) * duration)
    growth = np.fmax(closing, abs(tip_growth) * hottest)
    by_heat = np.fmax(EXCESS * base, np.fmin(GROWTH * growth, EXCESS * grown))
    return np.asarray(np.where(cases.friction > 0, np.fmax(by_heat, grown), by_heat))
