"""Cautions about a structure with its cases, and about a scheme at one step size on it, one sentence or phrase each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from workflow.declare import measure
from workflow.judges.blow_ups import Runaways
from workflow.kernels.algebra import Complex
from workflow.models import (
    Array,
    Cases,
    ContactBasis,
    NoEquilibriumError,
    Structure,
    analyse_contacts,
    at_rest,
    critical_friction,
    free_reach,
    frequencies,
    independent_rows,
    mechanical_modes,
    modal_damping,
    poles_in_contact,
    rates,
    rounding_of_flexibility,
    static_reach,
    statics,
    steady_warmth,
)
from workflow.reduction import OF_AUTO, ReducedModel, reduce_structure, takes
from workflow.schemes import Scheme, limit_text

ROUNDED = 1e-6
"""Relative change of the tip's stiffness by rounding of a file's entries, up to which there is no caution."""

_CANCELLED = 1e-9
"""A sum of terms of both signs, over the largest term, up to which it is rounding."""

_GROWS = 1e-12
"""Excess of the spectral radius over 1 up to which a free step is stable: a million steps grow by a millionth."""

_COARSE = 20
"""Steps per load period below which a plan warns: implicit Euler then has an error of about a sixth."""

_JUDGED = 400
"""Coordinates up to which a plan looks for growing eigenvalues: those of 800 states take a second."""

FEW = 6
"""Number of amounts up to which all are listed."""

_WIDEST = 1.0
"""Gap above which its unit is doubtful, where nothing bounds the motion, m."""

_FAR = 100
"""Static tip displacement by a load, over the gap, above which units are doubtful: a rub has a few."""


def scene_cautions(
    structure: Structure, model: ReducedModel, cases: Cases, duration: float, *, is_static: bool
) -> Iterator[str]:
    """Yield the cautions about a full structure and its cases, which run on a reduced model where it is sparse."""
    if structure.coordinates is not None:
        yield from _from_files(structure, cases)
    if structure.is_sparse:
        structure, cases = model.structure, model.project(cases)
    try:
        cases = at_rest(structure, cases) if is_static else cases
    except NoEquilibriumError:
        return  # its cases fail with this message
    yield from _static_reach(structure, cases)
    with np.errstate(all="ignore"):
        yield from _without_contact(structure, cases, free_reach(structure, cases, duration))
    yield from _friction_limits(structure, cases, has_impacts=not model.structure.contacts.is_compliant)


def _name(structure: Structure, contact: int) -> str:
    """Name one of several contacts, or the tip."""
    return "the tip" if structure.contacts.count == 1 else f"contact `{structure.contacts.labels[contact]}`"


def _from_files(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield doubts about matrices from a file: the direction in which heat moves contacts, and their stiffness."""
    flexibilities, growth = statics(structure)
    shares = growth * steady_warmth(structure)
    closing, least = shares.sum(axis=1), np.abs(shares).max(axis=1)
    if cases.alpha.max() > 0 and np.all(closing < -_CANCELLED * least):
        k = int(np.argmax(closing))
        every = "the tip" if closing.size == 1 else "every contact"
        yield (
            f"friction heat moves {every} away from the casing, {-closing[k]:.3g} m for each kelvin at "
            f"{_name(structure, k)}; where heat should close the gap, check the sign of `coupling` (equation 1a has "
            "K12 θ on the left) and the direction of `contact`"
        )
    if np.isfinite(flexibilities).all():
        lost = rounding_of_flexibility(structure)
        if lost > ROUNDED:
            yield (
                f"rounding in the file makes the tip's stiffness uncertain by about {lost:.1g}, as other entries "
                "of `stiffness` are far larger; make near-rigid links softer, or join what they connect"
            )


def _static_reach(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield that the load, applied statically, would move a contact by more than :data:`_FAR` gaps."""
    moved, gaps = _moved(structure, cases), cases.clearances
    far = np.where((moved / _FAR > gaps) & (gaps > 0), moved, 0.0)
    if far.any():
        k, contact = np.unravel_index(np.argmax(far), far.shape)
        yield (
            f"the load alone would move {_name(structure, int(contact))} by {measure(moved[k, contact], 'm', 3)}, over "
            f"a gap of {measure(gaps[k, contact], 'm', 3)}: check the units of stiffness and load"
        )


def _moved(structure: Structure, cases: Cases) -> Array:
    """Return how far the load, applied statically, moves each contact, m, ``(case, contact)``; 0 of a free body."""
    reach, load = np.abs(static_reach(structure)), np.abs(cases.mean) + cases.load_harmonics.reach
    return load[:, None] * np.where(np.isfinite(reach).all(), reach, 0.0)


def endless_bounces(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield that at e = 1 a contact never comes to rest where the load presses it onto the casing."""
    elastic = cases.take(np.flatnonzero(cases.e == 1))
    if structure.contacts.is_compliant or not elastic.count:
        return
    pressed = _moved(structure, elastic) > elastic.clearances
    if pressed.any():
        yield (
            f"at e = 1 the bounces of {_name(structure, int(pressed.any(axis=0).argmax()))} have no end where the load "
            "presses it onto the casing: damping makes them ever faster, until a case of event_driven has spent its "
            "`events` and fails, or its reference does; take e below 1"
        )


def _without_contact(structure: Structure, cases: Cases, reach: Array) -> Iterator[str]:
    """Yield the gaps at which no contact of any case reaches the casing; NaN is no bound."""
    room = cases.clearances - cases.casing_harmonics.reach[:, None] - reach
    nearest = np.argmin(room, axis=1)[:, None]
    gaps, room, reach = (np.take_along_axis(each, nearest, axis=1) for each in (cases.clearances, room, reach))
    clear = [gap for gap in np.unique(gaps) if np.all(room[gaps == gap] > 0)]
    if clear:
        of_clear = np.where(np.isin(gaps, clear), reach, -np.inf)
        name = _name(structure, int(nearest[np.argmax(of_clear), 0]))
        cannot, it = ("the tip cannot", "it") if name == "the tip" else ("no contact can", name)
        yield (
            f"{cannot} reach the casing at gap = {listed(measure(gap, 'm', 6) for gap in clear)}: without contact {it} "
            f"stays below {measure(float(of_clear.max()), 'm', 3)} (static and harmonic answer, and a bound of what "
            "the start adds)"
        )
    elif gaps.max() > _WIDEST:
        yield f"a gap of {gaps.max():.6g} m is that of no machine: check its unit, m or e.g. `20 um`"


def _friction_limits(structure: Structure, cases: Cases, *, has_impacts: bool) -> Iterator[str]:
    """Yield the friction coefficients at which contact has no unique solution or no stable rest."""
    if not structure.contacts.slides:
        return
    limits, most = critical_friction(structure), float(cases.friction.max(initial=0.0))

    def named(contacts: tuple[str, ...]) -> str:
        return f" of {', '.join(f'`{label}`' for label in contacts)}" if structure.contacts.count > 1 else ""

    first = min(limits, key=lambda limit: limit.impact)
    if has_impacts and most >= first.impact:
        yield (
            f"contact{named(first.contacts)} has no unique solution at a friction coefficient of {first.impact:.4g} or "
            f"more (n·M⁻¹(n - µt) <= 0: an impulse pushes the tip into the casing); the largest here is {most:g}"
        )
    first = min(limits, key=lambda limit: limit.standstill)
    if most >= first.standstill:
        yield (
            f"permanent contact{named(first.contacts)} has no stable equilibrium at a friction coefficient of "
            f"{first.standstill:.4g} or more (n·K⁻¹(n - µt) <= 0): the contact force grows without bound; "
            f"the largest here is {most:g}"
        )


def flutter(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield that lasting contact of the cases of most heat oscillates as it grows, or below the static limit of α.

    ``structure`` is the one that is run. Of more than :data:`_JUDGED` coordinates it takes too long.
    """
    if structure.mechanical_size + structure.thermal_size > _JUDGED:
        return
    some = np.unique([np.argmax(cases.alpha), np.argmax(cases.friction)])
    alpha, friction, several = cases.alpha[some], cases.friction[some], structure.contacts.count > 1
    contact = Runaways(structure).of(alpha, friction)
    for k in np.flatnonzero(contact.runaway & ((contact.frequency > 0) | (alpha < contact.critical_alpha)))[:1]:
        slides = f" and a friction coefficient of {friction[k]:g}" if structure.contacts.slides else ""
        limit = ", although alpha is below its critical value, the static limit"
        what = f"an oscillation of {contact.frequency[k]:.4g} Hz" if contact.frequency[k] else "a motion"
        yield (
            f"at alpha = {alpha[k]:.4g} W/N{slides} permanent contact flutters"
            f"{limit if alpha[k] < contact.critical_alpha[k] else ''}: "
            f"{f'with {contact.growth_set[k]} closed ' if several else ''}{what} grows at "
            f"{contact.growth_rate[k]:.3g} 1/s (`runaway` is set)"
        )


_SAME = 0.1
"""Relative distance of frequencies up to which an unstable pole of a basis is one of another model, too."""


def flutter_of_basis(
    reduced: Structure, friction: float, basis: str, other: Callable[[], Structure], others_name: str
) -> Iterator[str]:
    """Yield a contact whose friction, with it alone closed, drives modes of the basis that another model lacks.

    ``other`` makes that model where it is asked: the full structure, or its basis of another count.
    """
    if friction == 0 or not reduced.contacts.slides:
        return
    own, whole = analyse_contacts(reduced).unheated, None
    for k in range(own.contacts.count):
        grow = _growing(own, k, friction)
        if grow.size:
            whole = whole or analyse_contacts(other()).unheated
            for known in _growing(whole, k, friction):  # each is one of the basis at most
                apart = np.abs(1 - known.imag / grow.imag)
                grow = np.delete(grow, np.flatnonzero(apart == apart.min(initial=_SAME))[:1])
        if grow.size:
            pole = grow[np.argmax(grow.real)]
            yield (
                f"{basis}: friction at {_name(reduced, k)} closed alone drives an oscillation of "
                f"{measure(pole.imag / (2 * np.pi), 'Hz', 4)} that grows at {pole.real:.3g} 1/s, and that "
                f"{others_name} does not have: this basis is wrong; choose another count of mechanical modes"
            )


def _growing(basis: ContactBasis, contact: int, friction: float) -> Complex:
    """Return the growing oscillations with one contact closed and no heat, 1/s."""
    poles = poles_in_contact(basis, np.array([contact]), 0.0, friction)
    return poles.pole[poles.is_positive & (poles.frequency > 0)]


def coarse_heat(full: Structure, reduced: Structure, seconds: float, period: str, basis: str) -> Iterator[str]:
    """Yield contacts at which a thermal basis resolves a larger depth than heat enters in some time, ``period``.

    Heat at a contact warms the capacity 1/(s C2⁻¹ s) of the basis at once, and of the structure the capacity t/u in the
    time t, with its answer u = s (K2 + C2/t)⁻¹ s to unit power, which krylov has exactly at that one shift.
    """
    own = independent_rows(full.contacts)[1]
    if full.thermal_size <= 2 * own or not takes(OF_AUTO, full.contacts):
        return
    exact = reduce_structure(full, 0, own, OF_AUTO, seconds).structure
    answers = _at_contacts(exact, exact.conductance_matrix + exact.heat_capacity / seconds)
    depth = answers / (seconds * _at_contacts(reduced, reduced.heat_capacity))
    coarse = np.flatnonzero(depth > 1 + ROUNDED)
    if coarse.size:
        where = f"in {period} at {listed(_name(full, int(k)) for k in coarse)}"
        kept = f"the thermal modes kept resolve {depth.max():.2g} times the depth that heat enters"
        yield f"{basis}: {kept} {where}: temperatures there are too low; keep more, or use krylov"


def _at_contacts(structure: Structure, matrix: Array) -> Array:
    """Return s_i matrix⁻¹ s_i of each contact, ``(contact,)``."""
    heat = structure.contacts.heat
    return np.asarray((heat.T * np.linalg.solve(matrix, heat.T)).sum(axis=0))


def soft_spring(structure: Structure, stiffness: float, label: str) -> Iterator[str]:
    """Yield that a contact spring [N/m] is softer than the full structure at its tip, or at any of its contacts."""
    flexibility = float(statics(structure)[0].max())
    if 0 < flexibility < np.inf and stiffness * flexibility < 1:
        yield (
            f"the contact spring of {label}, {stiffness:.3g} N/m, is softer than the tip, "
            f"{1 / flexibility:.3g} N/m: it gives way more than the structure it stands against"
        )


class FreeModes(NamedTuple):
    """ω, c and μ of a structure's modes; of a long chain those of the lowest and the highest."""

    omega: Array
    damping: Array
    rates: Array


def free_modes(structure: Structure) -> FreeModes:
    """Return the modes of a structure with its tip free."""
    omega = frequencies(structure)
    damping = structure.damping.of_modes(omega)
    if structure.damper is not None:
        damping = modal_damping(structure, mechanical_modes(structure))
    return FreeModes(omega, damping, rates(structure))


class StepCaution(NamedTuple):
    """An effect of a step, its amount in words (empty where it has none), and a number that grows with it."""

    what: str
    amount: str
    size: float


def step_cautions(
    scheme: Scheme,
    options: Any,
    h: float,
    structure: Structure,
    modes: FreeModes,
    friction: tuple[float, float],
    frequency: float,
) -> Iterator[StepCaution]:
    """Yield the cautions about a step h [s] on a structure: it diverges, or is unstable in contact, damps or is coarse.

    ``modes`` are those of the structure, ``friction`` the ends of the cases' coefficients and ``frequency`` the largest
    of load and casing, Hz.
    """
    if "h" not in scheme.READS or scheme.amplification is None or scheme.thermal_amplification is None:
        return
    free = np.abs(scheme.amplification(modes.omega, modes.damping, h, options))
    heat = np.abs(scheme.thermal_amplification(modes.rates, h, options))
    growth = float(max(free.max(initial=0.0), heat.max(initial=0.0)))
    if growth > 1 + _GROWS:
        yield StepCaution("diverges, its free step grows", f"{growth:.6g}-fold", growth)
        return
    if scheme.contact_limit is not None:
        limit = min(scheme.contact_limit(structure, options, coefficient) for coefficient in friction)
        if h > limit:
            yield StepCaution("is unstable in contact above a step of", f"{limit_text(limit)} s", -limit)
    yield from _numerical_damping(scheme, options, h, modes)
    if frequency * h * _COARSE > 1:
        yield StepCaution("takes few steps per load period,", f"{1 / (frequency * h):.3g}", frequency * h)


def _numerical_damping(scheme: Scheme, options: Any, h: float, modes: FreeModes) -> Iterator[StepCaution]:
    """Yield the numerical damping of an underdamped first mode, where it exceeds the physical one.

    A step multiplies the mode by z = exp(s h) and damps it by ζ = -Re s/|s| of critical; z = 0 stops it at once.
    """
    assert scheme.amplification is not None
    omega, damping = modes.omega[:1], modes.damping[:1]
    if not (omega[0] > 0 and damping[0] < 2 * omega[0]):
        return
    z = complex(scheme.amplification(omega, damping, h, options)[0, 0])
    exponent = complex(np.log(z)) if z else complex(-1.0)
    physical = float(damping[0] / (2 * omega[0]))
    numerical = (-exponent.real / abs(exponent) if exponent else 0.0) - physical
    if numerical > physical + _GROWS:
        own = f"its own damping ratio is {physical:.2g}" if physical else "it has no damping of its own"
        what = f"damps the first mode ({omega[0] / (2 * np.pi):.4g} Hz) numerically; {own}, that of the scheme"
        yield StepCaution(what, f"{numerical:.2g}", numerical)


def listed(texts: Iterable[str]) -> str:
    """Join a few texts, or the ends of many."""
    few = list(texts)
    return ", ".join(few) if len(few) <= FEW else f"{few[0]} to {few[-1]}"
