"""A structure separated into real blocks, each of which a fixed step advances by itself.

In the modes with all contacts open, of displacement z and velocity v, every scheme steps v and ξ = z - lever·v by

    ξ' = ξ + h v,   Ŵ (v' - v) = -h (K ξ + (C + s K) v) + h (f - G τ_θ) + impulses:

lever = hθ, s = 2hθ, Ŵ = M + hθC + h²θ²K of the θ-method; lever = s = h, Ŵ = M + h/2 C (M where damping lags) of central
differences. Where damping couples no modes each mode is a block, η = ξ and u = v,

    u' = u - h (c u + k η),   η' = η + h u.

Else real blocks (:mod:`workflow.poles`) separate X' = X + hF X of X = [ξ, v]; one of first order has no η.
ξ of a rigid mode acts on nothing and is left out of X, so that its double pole is a simple one.

The coupling of equations (1a) and (1b) is one-way, so that each thermal mode τ' = D τ has a response R τ in the blocks,
D R = S R + g with the step S of a block and the thermal load g per τ. The rest of u and η steps without heat.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, ContactBasis, project
from workflow.poles import real_blocks
from workflow.schemes._fixed.law import CentralStep, TipStep

ROUNDING = 16 * np.finfo(float).eps
"""Excess of a spectral radius over 1 up to which it is the rounding of the few operations that compute it."""

LEAST_SHARE = 1e-14
"""Component of a mode at the tip, relative to the largest, up to which it is the rounding of the shape."""

NEAR_RESONANCE = 1e-3
"""Size of D - S, relative to the largest of its terms, up to which a block and a thermal mode stay coupled: above it
their separation loses at most three of sixteen digits."""

_LEAST_SHARE = 1e-30
"""Component of a mode at the tip, mechanical or thermal, that stands for a smaller one, relative to the largest."""

_PARTING = 1e-8
"""Relative change of F that parts three poles with one eigenvector: by its third root, 2e-3 of their size."""


class Step(NamedTuple):
    """Coefficients of a scheme's step in the modes of a structure."""

    tip: TipStep
    inertia: Array
    """Ŵ, ``(mode,)``, or ``(mode, mode)`` where damping couples modes."""
    stiffening: float
    """The factor s of K, s."""
    lever: float
    """The lever in ξ = z - lever·v, s."""
    energy_lever: float
    """ℓ, the lever in the energy that the step conserves, s: see :mod:`~workflow.schemes._fixed.balance`."""
    decay: Array
    """D, ``(thermal mode,)``."""
    heat_gain: Array
    """τ at a step's end per joule of heat at each contact in it, ``(contact, thermal mode)``."""
    slope: Array
    """δ = (D - 1)/h, 1/s, ``(thermal mode,)``."""
    load_weight: Array
    damping_weight: Array
    stiffness_weight: Array
    """w, a and b, ``(thermal mode,)``: τ at a step's beginning loads a mode with w G τ in it, and its response
    ξ = R τ has the dynamic stiffness m δ² + a c δ + b ω². No digit is lost in that, unlike in D - S where hμ and hω are
    large."""
    theta: float
    """Weight of the step's end in the way of the casing, and of a step's contact heat in its thermal load: θ of the
    θ-method, 0 of central differences."""
    heat_theta: float
    """Weight of the temperatures at a step's end in its heat loss."""
    lagged: bool
    """Whether the velocity at the step's beginning damps."""

    @property
    def is_central(self) -> bool:
        """Whether the step is one of central differences: its τ is a step ahead, with the heat of p_k."""
        return isinstance(self.tip, CentralStep)

    def moved_by(self, impulses: Array) -> Array:
        """Return the velocities Ŵ⁻¹ · impulses of the modes, ``(mode, …)``, each column with the same bits as alone."""
        if self.inertia.ndim == 2:
            return project(np.asarray(np.linalg.inv(self.inertia), dtype=np.float64), impulses.T).T
        return np.asarray((impulses.T / self.inertia).T)

    def delassus(self, modal: ContactBasis) -> Array:
        """Return W_ij = w_i Ŵ⁻¹ w_j, and what it has per -µ and per α, 1/kg, ``(3, contact, contact)``.

        W = w_i Ŵ⁻¹ (w_j - µ t_j + α hθ K12 T̂⁻¹ s_j).
        """
        pulled = self.tip.h * self.theta * (modal.coupling @ self.heat_gain.T).T
        moved = (self.moved_by(rows.T).T for rows in (modal.normal, modal.tangent, pulled))
        return np.stack([np.sum(modal.normal[:, None] * rows, axis=2) for rows in moved])

    def sinking(self, modal: ContactBasis, force_weight: float) -> Array:
        """Return the ways per unit impulse of compliant contacts besides their motion, as :meth:`delassus`, m/(N s).

        An impulse p is a force p/(h ``force_weight``) at the step's end: (R - µ R^t + c)/(h weight) + α r T̂⁻¹ s.
        """
        contacts, per_force = modal.contacts, 1 / (self.tip.h * force_weight)
        cold = contacts.flexibility(0.0)
        growth = modal.residual_coupling @ self.heat_gain.T
        return np.stack([contacts.compliance(0.0) * per_force, (cold - contacts.flexibility(1.0)) * per_force, growth])


@dataclass(frozen=True, eq=False)
class Blocks:
    """A structure in the blocks of a scheme's step; states are u and η of blocks, v and ξ of modes."""

    modal: ContactBasis
    step: Step
    damping: Array
    """c, 1/s, ``(block,)``."""
    stiffness: Array
    """k, 1/s², ``(block,)``; 0 of blocks of first order and of rigid modes."""
    inward: Array | None
    """u and η per v and ξ, ``(2, block, 2, mode)``; ``None`` where each mode is a block."""
    outward: Array | None
    """v and ξ per u and η, ``(2, mode, 2, block)``."""
    response: Array
    """R, ``(2, block, thermal mode)``; 0 for pairs near resonance."""
    pairs: NDArray[np.int64]
    """Indices (block, thermal mode) of the pairs near resonance, ``(pair, 2)``."""
    thermal_load: Array
    """g, ``(2, block, thermal mode)``."""

    @property
    def contacts(self) -> Array:
        """Velocity of the contacts per u and η, ``(contact, 2, block)``."""
        normal = self.modal.normal
        if self.outward is None:
            return np.stack([normal, np.zeros_like(normal)], axis=1)
        return np.asarray(np.tensordot(normal, self.outward[0], 1))

    @property
    def scale(self) -> Array:
        """Factor by which kernels scale a block, ``(block,)``: of one contact a mode's component there."""
        if not self.modal.is_single:
            return np.ones_like(self.damping)
        (tip,) = self.modal.normal  # of a mode that moves sensors, but not the tip, less than rounding of it
        hidden = tip == 0 if len(self.modal.sensors) else np.zeros(tip.size, bool)
        return np.asarray(np.where(hidden, _LEAST_SHARE * np.abs(tip).max(initial=0.0), tip))

    @property
    def heat_scale(self) -> Array:
        """Factor by which kernels scale a thermal mode, ``(thermal mode,)``: of one contact its component there."""
        if not self.modal.is_single:
            return np.ones_like(self.modal.rate)
        (heat,) = self.modal.heat
        least = _LEAST_SHARE * np.abs(heat).max(initial=0.0)
        return np.asarray(np.where(np.abs(heat) > least, heat, least))

    @property
    def heat_velocity(self) -> Array:
        """Thermal velocity of the contacts per τ of a kernel, ``(contact, thermal mode)``."""
        return np.asarray(np.einsum("crb,rbl->cl", self.contacts, self.response))

    @property
    def spectral_radius(self) -> float:
        """Spectral radius of the free step; two eigenvalues that nearly coincide are replaced by their mean."""
        h, half = self.step.tip.h, self.damping / 2
        square = half**2 - self.stiffness
        root = h * np.sqrt(np.where(np.abs(square) <= 64 * ROUNDING * half**2, 0.0, square) + 0j)
        pairs = np.abs([1 - h * half + root, 1 - h * half - root])[:, self.stiffness != 0]
        return float(np.append(pairs, np.abs(1 - h * self.damping[self.stiffness == 0])).max(initial=0.0))

    def of_modes(self, states: Array) -> Array:
        """Return u and η of states of the modes, ``(2, mode, column)``, each column with the same bits as alone."""
        return _transformed(self.inward, states)

    def in_modes(self, states: Array) -> Array:
        """Return v and ξ of the modes of states ``(2, block, column)``, each column with the same bits as alone."""
        return _transformed(self.outward, states)

    def of_impulses(self, impulses: Array) -> Array:
        """Return u and η per impulses on the modes, ``(2, block, column)``."""
        moved = self.step.moved_by(impulses)
        return self.of_modes(np.stack([moved, np.zeros_like(moved)]))

    def of_heat(self, heat: Array) -> Array:
        """Return u and η, without the response R τ, per ``heat`` that enters τ, ``(2, block, column)``."""
        pulls = -self.step.tip.h * self.step.theta * project(self.modal.coupling, heat.T).T
        return np.asarray(self.of_impulses(pulls) - self.thermal_response(heat))

    def thermal_response(self, heat: Array) -> Array:
        """Return the response R τ to thermal modes ``(thermal mode, column)``, ``(2, block, column)``."""
        return np.stack([project(rows, heat.T).T for rows in self.response])

    def without_heat(self) -> Blocks:
        """Return the same structure without thermal states, for cases where none can act."""
        none = np.zeros(0)
        return replace(
            self,
            modal=self.modal.unheated,
            step=self.step._replace(
                decay=none,
                heat_gain=self.step.heat_gain[:, :0],
                slope=none,
                load_weight=none,
                damping_weight=none,
                stiffness_weight=none,
            ),
            response=self.response[..., :0],
            pairs=self.pairs[:0],
            thermal_load=self.thermal_load[..., :0],
        )


def modes_at(rows: Array) -> NDArray[np.bool_]:
    """Return which modes move some of the rows, ``(mode,)``."""
    return np.asarray((np.abs(rows) > LEAST_SHARE * np.abs(rows).max(axis=-1, keepdims=True, initial=0.0)).any(axis=0))


def effective_mass(modal: ContactBasis, diagonal: Array, share: float) -> Array:
    """Return Ŵ: its ``diagonal`` ``(mode,)``, with ``share`` [s] times the off-diagonal damping, if any."""
    if modal.damping_matrix is None:
        return diagonal
    return np.diag(diagonal) + share * (modal.damping_matrix - np.diag(modal.damping))


def _transformed(rows: Array | None, states: Array) -> Array:
    """Return rows ``(2, n, 2, m)`` times states ``(2, m, column)``, each column with the same bits as alone."""
    if rows is None:
        return states
    (_, n, _, m), count = rows.shape, states.shape[-1]
    return np.asarray(project(rows.reshape(2 * n, 2 * m), states.reshape(2 * m, count).T).T.reshape(2, n, count))


def separate(modal: ContactBasis, step: Step) -> Blocks:
    """Separate the step of a structure into blocks: each mode is one where damping couples none."""
    h, stiffness = step.tip.h, modal.frequency**2
    pull = step.moved_by(-h * modal.coupling * step.load_weight)
    if modal.damping_matrix is None:
        c, k = step.moved_by(modal.damping + step.stiffening * stiffness), step.moved_by(stiffness)
        damping, spring = modal.damping[:, None], stiffness[:, None]
        terms = step.slope**2, damping * (step.damping_weight * step.slope), spring * step.stiffness_weight
        places, pairs = _response(terms, -modal.coupling * step.load_weight)
        response, g = np.stack([step.slope * places, places]), np.stack([pull, np.zeros_like(pull)])
        return Blocks(modal, step, c, k, None, None, response, pairs, g)
    n, elastic = modal.frequency.size, np.flatnonzero(modal.frequency > 0)
    F = np.zeros((elastic.size + n, elastic.size + n))
    F[: elastic.size, elastic.size :] = np.eye(n)[elastic]
    F[elastic.size :, : elastic.size] = -step.moved_by(np.diag(stiffness))[:, elastic]
    F[elastic.size :, elastic.size :] = -step.moved_by(modal.damping_matrix + step.stiffening * np.diag(stiffness))
    parts = real_blocks(F, h, _PARTING)
    seconds = parts.damping.size
    c, k = np.append(parts.damping, parts.rate), np.append(parts.stiffness, np.zeros(parts.rate.size))
    inward, outward = np.zeros((2, c.size, 2, n)), np.zeros((2, n, 2, c.size))
    inward[0, :, 0], inward[1, :seconds, 0] = np.split(parts.inward[:, elastic.size :], [seconds])[::-1]
    inward[0][:, 1, elastic], inward[1][:seconds, 1, elastic] = np.split(parts.inward[:, : elastic.size], [seconds])[
        ::-1
    ]
    speeds, places = parts.outward[elastic.size :], parts.outward[: elastic.size]
    outward[0, :, 0], outward[0, :, 1, :seconds] = speeds[:, seconds:], speeds[:, :seconds]
    outward[1, elastic, 0], outward[1, elastic, 1, :seconds] = places[:, seconds:], places[:, :seconds]
    g = np.tensordot(inward[:, :, 0], pull, 1)
    return Blocks(modal, step, c, k, inward, outward, *_block_response(c, k, g, step), g)


def _block_response(c: Array, k: Array, pull: Array, step: Step) -> tuple[Array, NDArray[np.int64]]:
    """Solve (D - S) R = g for the response R of blocks; return it and the pairs near resonance."""
    d, c, k, (g, place) = step.slope, c[:, None], k[:, None], pull / step.tip.h
    first = k == 0
    terms = np.where(first, d, d * d), np.where(first, c, c * d), k
    speeds, pairs = _response(terms, np.where(first, g, d * g - k * place))
    values, others = _response(terms, np.where(first, 0.0, (d + c) * place + g))
    return np.stack([speeds, values]), np.unique(np.concatenate([pairs, others]), axis=0)


def _response(terms: tuple[Array, ...], pulled: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the load divided by the sum of some terms, and the pairs near resonance, where the quotient is 0."""
    parts = np.stack(np.broadcast_arrays(*terms))
    whole = parts.sum(axis=0)
    near = np.abs(whole) <= NEAR_RESONANCE * np.abs(parts).max(axis=0)
    return pulled / np.where(near, np.inf, whole), np.argwhere(near & (pulled != 0))
