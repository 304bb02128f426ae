"""The two regimes between contact events, tip free and tip held at the gap, in uncoupled real blocks.

    blocks        η' = u + β(t),   u' = -c u - ω² η + γ(t)
    first order   ξ' = -μ ξ + χ(t)

so that a motion of any length costs one exponential per block. Where neither damping nor friction couples the modes,
first-order states are thermal modes, ξ = τ, and blocks are mechanical modes less their response to these,

    η = z - R τ,   u = z' + R μ τ,   R = -G/(μ² - μ c + ω²).

Other couplings are separated by :mod:`workflow.poles`: a damping matrix, the friction heat of a held tip (α times a
rank-one term), friction along a tangent (another such term with the same row), and a mode near a thermal rate.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.poles import real_blocks
from workflow.schemes._exact.layout import tabulate
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._interface import RefusedStructureError

INSEPARABLE = (
    "leaves poles that coincide and share an eigenvector, which event_driven cannot separate; change it by a trifle, "
    "or take a scheme with a fixed step"
)
"""Why a structure is refused whose poles no method separates."""


class InseparablePolesError(RefusedStructureError):
    """Poles of a structure with coupled modes are too near each other to be separated."""

    def __init__(self) -> None:
        super().__init__(f"its damping {INSEPARABLE}")


NEAR_RATE = 1e-3
"""Size of μ² - μ c + ω², over the sum of its terms, below which R has fewer than thirteen digits."""

_OBSERVABLE = 1e-13
"""Reaction of a mode at the tip, over the largest, above which it is kept: the rounding of shapes is some 1e-15, and
the modes below change λ by no more than this, relatively."""


def thermal_response(system: ModalSystem, near: float) -> Array | None:
    """Return R, ``(mode, thermal mode)``; ``None`` where a thermal rate is near the pole of a mode that heat loads."""
    mu, c, omega2, driven = system.rate, system.damping[:, None], system.frequency[:, None] ** 2, system.coupling != 0
    polynomial, size = mu**2 - mu * c + omega2, mu**2 + mu * c + omega2
    if np.any(driven & (np.abs(polynomial) <= near * size)):
        return None
    return -np.divide(system.coupling, polynomial, out=np.zeros_like(polynomial), where=driven)


class Regimes(NamedTuple):
    """Regimes of a batch."""

    rows: Array
    """See :func:`~workflow.schemes._exact.layout.tabulate`, ``(regime, number)``."""
    separable: NDArray[np.bool_]
    """Whether their poles can be separated, ``(regime,)``; the row of others is not filled."""


def fill_row(row: Array, system: ModalSystem, alpha: float = 0.0) -> bool:
    """Store the regime of a structure with its tip free, or held at α [W/N]; return whether its poles can be separated.

    At α > 0 or with friction along t ``system`` is one of :func:`observable` modes. Three poles that coincide cannot be
    separated.
    """
    is_apart = alpha == 0 and system.friction_force is None and not system.is_coupled
    response = thermal_response(system, NEAR_RATE) if is_apart else None
    A, signal, source = state_space(system, alpha)
    try:
        damping, stiffness, rate, inward, outward = real_blocks(A) if response is None else _in_modes(system, response)
    except ValueError:  # poles that coincide, entries that are not finite
        return False
    source = np.concatenate([inward @ source, signal_inputs(system)[None]])
    temperature = system.observed @ outward[2 * system.frequency.size :]
    outputs = damping, stiffness, rate, signal @ outward, temperature
    arrays = *outputs, source.T, inward.T, outward.T, system.entry, system.exit
    tabulate(row, *(np.ascontiguousarray(values, dtype=np.float64) for values in arrays))
    return True


def _in_modes(system: ModalSystem, response: Array) -> tuple[Array, ...]:
    """Return the blocks that are the modes of the system less their response R to thermal modes, as ``real_blocks``."""
    modes = system.frequency.size
    inward = np.eye(2 * modes + system.rate.size)
    inward[:modes, 2 * modes :], inward[modes : 2 * modes, 2 * modes :] = -response, response * system.rate
    return system.damping, system.frequency**2, system.rate, inward, 2 * np.eye(len(inward)) - inward


def observable(held: ModalSystem) -> ModalSystem:
    """Remove the modes that are unobservable in the contact force of the held tip, unless damping couples them.

    Their shapes are free modes as well, with the tip at rest: no output depends on them. Among them are the rigid
    motions of parts that are not linked to the tip, whose double eigenvalue 0 is defective.
    """
    keep = np.abs(held.reaction) > _OBSERVABLE * np.abs(held.reaction).max(initial=0.0)
    if held.is_coupled:
        beside = np.abs(held.damping - np.diag(np.diag(held.damping)))
        keep |= np.any(beside > _OBSERVABLE * np.abs(held.damping).max(initial=0.0), axis=1)
    return replace(
        held,
        frequency=held.frequency[keep],
        damping=held.damping[np.ix_(keep, keep)] if held.is_coupled else held.damping[keep],
        coupling=held.coupling[keep],
        reaction=held.reaction[keep],
        reaction_slope=held.reaction_slope[keep],
        gap_source=held.gap_source[keep],
        shapes=held.shapes[:, keep],
        entry=held.entry[:, keep],
        exit=held.exit[np.append(keep, True)],
        friction_force=None if held.friction_force is None else held.friction_force[keep],
    )
