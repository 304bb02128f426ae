"""Cautions about a structure with its cases, and about a scheme at one step size on it, one sentence or phrase each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from workflow.declare import measure
from workflow.judges.blow_ups import statics
from workflow.models import (
    Array,
    Cases,
    NoEquilibriumError,
    Sparse,
    Structure,
    at_rest,
    critical_friction,
    free_reach,
    frequencies,
    mechanical_modes,
    modal_damping,
    rates,
    rounding_of_flexibility,
    static_tip_growth,
    tip_flexibility,
)
from workflow.reduction import ReducedModel
from workflow.schemes import Scheme, limit_text

ROUNDED = 1e-6
"""Relative change of the tip's stiffness by rounding of a file's entries, up to which there is no caution."""

_CANCELLED = 1e-9
"""A sum of terms of both signs, over the largest term, up to which it is rounding."""

_GROWS = 1e-12
"""Excess of the spectral radius over 1 up to which a free step is stable: a million steps grow by a millionth."""

_COARSE = 20
"""Steps per load period below which a plan warns: implicit Euler then has an error of about a sixth."""

FEW = 6
"""Number of amounts up to which all are listed."""

_FAR = 100
"""Static tip displacement by a load, over the gap, above which units are doubtful: a rub has a few."""


def scene_cautions(
    structure: Structure, model: ReducedModel, cases: Cases, duration: float, *, is_static: bool
) -> Iterator[str]:
    """Yield the cautions about a full structure and its cases, which run on a reduced model where it is sparse.

    Of several contacts, and of one without mass, there are none.
    """
    if structure.coordinates is not None and structure.contacts is None:
        yield from _from_files(structure, cases)
    if isinstance(structure, Sparse):
        structure, cases = model.structure, model.project(cases)
    if structure.contacts is not None:
        return
    try:
        cases = at_rest(structure, cases) if is_static else cases
    except NoEquilibriumError:
        return  # its cases fail with this message
    yield from _static_reach(structure, cases)
    with np.errstate(all="ignore"):
        yield from _without_contact(cases, free_reach(structure, cases, duration))
    yield from _friction_limits(structure, cases)


def _from_files(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield doubts about matrices from a file: the direction in which heat moves the tip, and its stiffness."""
    shares = static_tip_growth(structure) * structure.thermal.constraint
    closing = float(shares.sum())
    if cases.alpha.max() > 0 and closing < -_CANCELLED * np.abs(shares).max():
        yield (
            f"friction heat moves the tip away from the casing, {-closing:.3g} m for each kelvin at the tip, and no "
            "alpha is critical; where heat should close the gap, check the sign of `coupling` (equation 1a has K12 θ "
            "on the left) and the direction of `contact`"
        )
    if np.isfinite(tip_flexibility(structure)):
        lost = rounding_of_flexibility(structure)
        if lost > ROUNDED:
            yield (
                f"`stiffness` holds the tip's static stiffness to about {lost:.1g}: entries that are far larger are "
                "rounded in the file; join what near-rigid links hold together, or make them softer"
            )


def _static_reach(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield that the load, applied statically, would move the tip by more than :data:`_FAR` gaps."""
    flexibility = tip_flexibility(structure)
    if structure.load is not None or not np.isfinite(flexibility):
        return
    moved = flexibility * (np.abs(cases.mean) + cases.load_harmonics.reach)
    far = (moved > _FAR * cases.gap) & (cases.gap > 0)
    if np.any(far):
        k = int(np.argmax(np.where(far, moved, 0.0)))
        yield (
            f"the load alone would move the tip by {measure(moved[k], 'm', 3)}, over a gap of "
            f"{measure(cases.gap[k], 'm', 3)}: check the units of stiffness and load"
        )


def _without_contact(cases: Cases, reach: Array) -> Iterator[str]:
    """Yield the gaps at which no case's tip reaches the casing; NaN is no bound."""
    reaches = ~(reach < cases.gap - cases.casing_harmonics.reach)
    clear = [gap for gap in np.unique(cases.gap) if not np.any(reaches[cases.gap == gap])]
    if clear:
        most = float(reach[np.isin(cases.gap, clear)].max())
        yield (
            f"the tip cannot reach the casing at gap = {listed(measure(gap, 'm', 6) for gap in clear)}: without "
            f"contact it stays below {measure(most, 'm', 3)} (static and harmonic answer, and a bound of what "
            "the start adds)"
        )


def _friction_limits(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield the friction coefficients at which contact has no unique solution or no stable rest."""
    if structure.tangent is None:
        return
    critical, most = critical_friction(structure), float(cases.friction.max(initial=0.0))
    if most >= critical.impact:
        yield (
            f"from a friction coefficient of {critical.impact:.4g} on contact has no unique solution "
            f"(n·M⁻¹(n - µt) <= 0: an impulse pushes the tip into the casing); the largest here is {most:g}"
        )
    if most >= critical.standstill:
        yield (
            f"from a friction coefficient of {critical.standstill:.4g} on a tip in lasting contact has no stable place "
            f"(n·K⁻¹(n - µt) <= 0): its contact force grows without bound; the largest here is {most:g}"
        )


def soft_spring(structure: Structure, stiffness: float, label: str) -> Iterator[str]:
    """Yield that a contact spring [N/m] is softer than the full structure at its tip, or at any of its contacts."""
    flexibility = tip_flexibility(structure) if structure.contacts is None else statics(structure)[0]
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


@dataclass(frozen=True, eq=False)
class SchemeStep:
    """A step of a scheme on a structure.

    Attributes
    ----------
    scheme, options, h
        The scheme, its options and its step, s.
    structure, modes
        The structure it steps, and its free modes.
    friction
        Smallest and largest coefficient of friction of the cases.
    frequency
        Largest frequency of load and casing, Hz.
    """

    scheme: Scheme
    options: Any
    h: float
    structure: Structure
    modes: FreeModes
    friction: tuple[float, float]
    frequency: float


class StepCaution(NamedTuple):
    """An effect of a step, its amount in words (empty where it has none), and a number that grows with it."""

    what: str
    amount: str
    size: float


def step_cautions(step: SchemeStep) -> Iterator[StepCaution]:
    """Yield the cautions about a step: it diverges, or is unstable in contact, damps or is coarse."""
    scheme, modes, h = step.scheme, step.modes, step.h
    if "h" not in scheme.READS or scheme.amplification is None or scheme.thermal_amplification is None:
        return
    free = np.abs(scheme.amplification(modes.omega, modes.damping, h, step.options))
    heat = np.abs(scheme.thermal_amplification(modes.rates, h, step.options))
    growth = float(max(free.max(initial=0.0), heat.max(initial=0.0)))
    if growth > 1 + _GROWS:
        yield StepCaution("diverges, its free step grows", f"{growth:.6g}-fold", growth)
        return
    if scheme.contact_limit is not None:
        limit = min(scheme.contact_limit(step.structure, step.options, coefficient) for coefficient in step.friction)
        if h > limit:
            yield StepCaution("is unstable in contact above a step of", f"{limit_text(limit)} s", -limit)
    yield from _numerical_damping(scheme, step)
    if step.frequency * h * _COARSE > 1:
        yield StepCaution("takes few steps per load period,", f"{1 / (step.frequency * h):.3g}", step.frequency * h)


def _numerical_damping(scheme: Scheme, step: SchemeStep) -> Iterator[StepCaution]:
    """Yield the numerical damping of an underdamped first mode, where it exceeds the physical one.

    A step multiplies the mode by z = exp(s h) and damps it by ζ = -Re s/|s| of critical; z = 0 stops it at once.
    """
    assert scheme.amplification is not None
    omega, damping = step.modes.omega[:1], step.modes.damping[:1]
    if not (omega[0] > 0 and damping[0] < 2 * omega[0]):
        return
    z = complex(scheme.amplification(omega, damping, step.h, step.options)[0, 0])
    exponent = complex(np.log(z)) if z else complex(-1.0)
    physical = float(damping[0] / (2 * omega[0]))
    numerical = (-exponent.real / abs(exponent) if exponent else 0.0) - physical
    if numerical > physical + _GROWS:
        own = f"more than its own {physical:.2g} of critical" if physical else "which has no damping of its own"
        what = f"damps the first mode ({omega[0] / (2 * np.pi):.4g} Hz) {own}, numerically by"
        yield StepCaution(what, f"{numerical:.2g}", numerical)


def listed(texts: Iterable[str]) -> str:
    """Join a few texts, or the ends of many."""
    few = list(texts)
    return ", ".join(few) if len(few) <= FEW else f"{few[0]} to {few[-1]}"
