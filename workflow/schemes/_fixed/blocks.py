"""Structures whose modes damping couples, or whose load acts elsewhere than on the tip, in real blocks that step alone.

In the modes of the free tip every scheme with a fixed step takes ξ = z - lever·v and v by

    ξ' = ξ + h v,   Ŵ (v' - v) = -h (K ξ + (C + s K) v) + h (f - G τ_θ) + impulses:

lever = hθ, s = 2hθ, Ŵ = M + hθC + h²θ²K of the θ-method; lever = s = h, Ŵ = M + h/2 C (M where damping lags) of central
differences. ξ of a rigid mode moves nothing and is left out, so that its double pole is a single one; the others and v
are X, X' = X + hF X. Real blocks of F (:mod:`workflow.poles.real_blocks`) step alone,

    u' = u - h (c u + k η),   η' = η + h u,

one of first order has no η. Where damping couples no modes each mode is a block, η = ξ and u = v. A thermal mode,
τ' = D τ, drags a response R τ along, D R = S R + g with the step S of a block and the pull g of τ.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.lanes import lane_rows
from workflow.models import Array, Cases, Structure, project
from workflow.poles import RealBlocks, missed_share, real_blocks
from workflow.schemes._fixed.block_lanes import BlockAccount, BlockStep
from workflow.schemes._fixed.contact import Contact, TipStep
from workflow.schemes._fixed.decoupled import NEAR_RESONANCE, Decoupled, Motion
from workflow.schemes._fixed.modal_lanes import MODE_HEAT_PLACE, Coefficients, by_mode
from workflow.schemes._fixed.outcome import ROUNDING

NO_DECAY = 1e-30
"""Stands for a thermal factor D of exactly 0, by which what enters is divided: nothing beside 1."""

_MISSED = 1e-9
"""Share of F that blocks may miss: where two pairs of poles coincide it is 1e-9 to 1e-8, where three poles do 1e-6."""

_PARTED = 1e-8
"""Share by which damping is changed where poles coincide: three part by its third root, 2e-3 of themselves."""


class Step(NamedTuple):
    """How a scheme steps the modes of a structure."""

    tip: TipStep
    inertia: Array
    """Ŵ, ``(mode, mode)``."""
    stiffening: float
    """s, s."""
    lever: float
    """Of places, s."""
    decay: Array
    """D, ``(thermal mode,)``."""
    warm: Array
    """What a step makes of heat at the tip, τ per J, ``(thermal mode,)``."""
    pulls: Array
    """Weight with which τ at a step's beginning pulls in it, ``(thermal mode,)``."""
    at_once: float
    """Share with which that pulls in its own step: θ of the θ-method, 0 of central differences."""
    heat_theta: float
    """Weight of the temperatures at a step's end in what it loses."""
    heat_counts: bool
    """Whether τ at a step's end holds the heat of the contact in it: not that of central differences, a step behind."""
    lagged: bool
    """Whether the velocity at the step's beginning damps."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """A structure in the blocks of a scheme's step; rows of a block are u and η."""

    modal: Decoupled
    step: Step
    damping: Array
    """c, 1/s, ``(block,)``."""
    stiffness: Array
    """k, 1/s², ``(block,)``; 0 of blocks of first order."""
    inward: Array
    """u and η per X = [ξ of elastic modes, v], ``(2, block, X)``."""
    outward: Array
    """X per u and η, ``(X, 2, block)``."""
    response: Array
    """R, ``(2, block, thermal mode)``; 0 for pairs near resonance."""
    pairs: NDArray[np.int64]
    """Indices (block, thermal mode) of these, ``(pair, 2)``."""
    pull: Array
    """g, ``(2, block, thermal mode)``."""

    @property
    def tip(self) -> Array:
        """Velocity of the tip per u and η, ``(2, block)``."""
        modes = self.modal.frequency.size
        return np.asarray(np.tensordot(self.modal.tip, self.outward[-modes:], 1))

    @property
    def shown(self) -> Array:
        """What a kernel's τ drags along: central differences have it a step behind, ``(2, block, thermal mode)``."""
        return self.response if self.step.heat_counts else self.step.decay * self.response

    @property
    def growth(self) -> float:
        """Largest factor of a free step; two that nearly coincide are their mean, which rounding leaves alone."""
        h, half = self.step.tip.h, self.damping / 2
        square = half**2 - self.stiffness
        root = h * np.sqrt(np.where(np.abs(square) <= 64 * ROUNDING * half**2, 0.0, square) + 0j)
        pairs = np.abs([1 - h * half + root, 1 - h * half - root])[:, self.stiffness != 0]
        alone = np.abs(np.append(1 - h * self.damping[self.stiffness == 0], self.step.decay))
        return float(np.append(pairs, alone).max(initial=0.0))

    def of_velocities(self, velocities: Any) -> Array:
        """Return u and η per velocities of the modes ``(mode, …)``, ``(2, block, …)``."""
        return np.asarray(np.tensordot(self.inward[..., -len(velocities) :], velocities, 1))

    def of_impulses(self, impulses: Array) -> Array:
        """Return u and η per impulses on the modes, ``(2, block, …)``."""
        return self.of_velocities(np.linalg.solve(self.step.inertia, impulses))

    def of_heat(self, heat: Array) -> Array:
        """Return u and η, less what is dragged along, per heat that has entered τ, ``(2, block, …)``."""
        pulls = -self.step.tip.h * self.step.at_once * (self.modal.coupling @ heat)
        return np.asarray(self.of_impulses(pulls) - np.tensordot(self.response, heat, 1))

    def ahead(self, states: Array) -> Array:
        """Return states ``(2, block, …)`` a free step later, without what acts on them."""
        h, c, k = self.step.tip.h, self.damping[:, None], self.stiffness[:, None]
        u, eta = states
        return np.stack([u - h * (c * u + k * eta), eta + h * u])


def separate(modal: Decoupled, step: Step) -> Blocks:
    """Separate the step of a structure: each mode by itself where damping couples none."""
    h, n, elastic = step.tip.h, modal.frequency.size, np.flatnonzero(modal.frequency > 0)
    K, C = np.diag(modal.frequency**2), np.diag(modal.damping) if modal.damper is None else modal.damper
    stiffness, damping = (np.linalg.solve(step.inertia, matrix) for matrix in (K, C + step.stiffening * K))
    size = elastic.size + n
    if modal.damper is None:
        c, k = np.diag(damping).copy(), np.diag(stiffness).copy()
        inward = np.zeros((2, n, size))
        inward[0, :, elastic.size :] = np.eye(n)
        inward[1, elastic, : elastic.size] = np.eye(elastic.size)
        outward = inward.transpose(2, 0, 1)
    else:
        F = np.zeros((size, size))
        F[: elastic.size, elastic.size :] = np.eye(n)[elastic]
        F[elastic.size :, : elastic.size], F[elastic.size :, elastic.size :] = -stiffness[:, elastic], -damping
        parts = _in_blocks(F, elastic.size)
        seconds, firsts = parts.damping.size, parts.rate.size
        c, k = np.append(parts.damping, parts.rate), np.append(parts.stiffness, np.zeros(firsts))
        inward = np.zeros((2, c.size, size))
        inward[0], inward[1, :seconds] = parts.inward[seconds:], parts.inward[:seconds]
        outward = np.zeros((size, 2, c.size))
        outward[:, 0], outward[:, 1, :seconds] = parts.outward[:, seconds:], parts.outward[:, :seconds]
    pull = np.tensordot(inward[..., elastic.size :], np.linalg.solve(step.inertia, -h * modal.coupling * step.pulls), 1)
    return Blocks(modal, step, c, k, inward, outward, *_dragged(c, k, pull, h, step.decay), pull)


def _in_blocks(F: Array, places: int) -> RealBlocks:
    """Return the blocks of F, where poles coincide of one whose damping is changed by as little as parts them.

    Raises
    ------
    numpy.linalg.LinAlgError
        They still do.
    """
    for share in (0.0, _PARTED):
        F[places:, places:] *= 1 + share
        with suppress(np.linalg.LinAlgError):
            parts = real_blocks(F)
            if missed_share(F, parts) <= _MISSED:
                return parts
    raise np.linalg.LinAlgError("poles of the damped structure coincide: change its damping by a millionth")


def _dragged(c: Array, k: Array, pull: Array, h: float, decay: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return R, and the pairs near resonance, which have 0 there: (D - S) R = g, block by block."""
    d, c, k, (g, place) = (decay - 1) / h, c[:, None], k[:, None], pull / h
    first = k == 0
    terms = np.stack(np.broadcast_arrays(np.where(first, d, d * d), np.where(first, c, c * d), k))
    whole = terms.sum(axis=0)
    near = np.abs(whole) <= NEAR_RESONANCE * np.abs(terms).max(axis=0)
    speed, value = np.where(first, g, d * g - k * place), np.where(first, 0.0, (d + c) * place + g)
    response = np.stack([speed, value]) / np.where(near, np.inf, whole)
    return response, np.argwhere(near & ((g != 0) | (place != 0)))


def start(blocks: Blocks, cases: Cases, begun: Motion, velocity: Array) -> Array:
    """Return u and η of all cases at t = 0 less what heat drags along, ``(2, block, case)``.

    ``velocity`` are those of the modes, ``(case, mode)``; half a step before t = 0 for central differences.
    """
    modal, step = blocks.modal, blocks.step
    places = project(modal.to_modes, cases.displacement) - step.lever * velocity
    X = np.concatenate([places[:, modal.frequency > 0], velocity], axis=1)
    dragged = _of_cases(blocks.response, begun.heat)
    return np.asarray(_of_cases(blocks.inward, X) - dragged)


def drives(blocks: Blocks, cases: Cases, begun: Motion) -> Array:
    """Return what acts on each block, ``(block, 4, case)``.

    That is u and η per impulse along the contact, with friction and heat of that impulse, and what constant loads and
    heating add in a step.
    """
    modal, h = blocks.modal, blocks.step.tip.h
    steady = project(modal.shapes.T, cases.steady) - project(modal.coupling, begun.settled)
    constant = _of_cases(blocks.of_impulses(h * np.eye(modal.tip.size)), steady)
    constant += _of_cases(blocks.of_heat(h * np.eye(modal.rate.size)), begun.warming_modes)
    normal, along = blocks.of_impulses(modal.tip), np.zeros_like(modal.tip) if modal.along is None else modal.along
    warm = blocks.of_heat(blocks.step.warm)
    contact = normal[..., None] - blocks.of_impulses(along)[..., None] * cases.friction - warm[..., None] * cases.alpha
    return np.concatenate([contact, constant]).swapaxes(0, 1)


def first_free(blocks: Blocks, states: Array, drives: Array, begun: Motion) -> tuple[Array, Array]:
    """Return u and η after the first step without load and contact, and the tip's velocity then, ``(case,)``."""
    states = blocks.ahead(states) + drives[:, 2:].swapaxes(0, 1)
    for block, mode in blocks.pairs:
        states[:, block] += blocks.pull[:, block, mode, None] * begun.heat[:, mode]
    velocity = np.zeros(len(begun.heat))
    for row, values in zip(blocks.tip, states, strict=True):
        velocity += project(row, values.T)
    return states, velocity + project(np.einsum("rb,rbl->l", blocks.tip, blocks.shown), begun.heat)


def _of_cases(rows: Array, states: Array) -> Array:
    """Return rows ``(2, block, state)`` of states ``(case, state)``, ``(2, block, case)``; a case as it is alone."""
    return np.stack([project(row, states).T for row in rows])


def coefficients(blocks: Blocks, contact: Contact) -> Coefficients:
    """Return the step's coefficients."""
    modal, step = blocks.modal, blocks.step
    h, (speed, place), scale = step.tip.h, blocks.tip, modal.heat_scale
    load = modal.tip if modal.load is None else modal.load
    by_load, (j, k) = blocks.of_impulses(load), blocks.pairs.T
    pull = blocks.pull[:, j, k] / scale[k]
    decay = np.where(step.decay == 0, NO_DECAY, step.decay)
    behind = np.ones_like(decay) if step.heat_counts else decay
    shown = np.einsum("rb,rbl->l", blocks.tip, blocks.shown)
    return Coefficients(
        modes=np.zeros((0, MODE_HEAT_PLACE + 1)),
        heat_modes=by_mode(decay, scale * step.warm / behind, shown / scale),
        pair_mode=j,
        pair_heat=k,
        pair_pull=np.stack([*pull, speed[j] * pull[0] + place[j] * pull[1]], axis=1),
        tip=contact.felt_by(step.tip),
        heat_counts=step.heat_counts,
        blocks=BlockStep(
            by_mode(1 - h * blocks.damping, -h * blocks.stiffness, *by_load, speed, place),
            np.sum(speed * by_load[0] + place * by_load[1]),
        ),
    )


def account(
    blocks: Blocks, structure: Structure, cases: Cases, begun: Motion
) -> tuple[BlockAccount, list[tuple[Array, Array]]]:
    """Return the account of energy, and its rows of lanes with what they take at the beginning, ``(row, case)``."""
    modal, step, scale = blocks.modal, blocks.step, blocks.modal.heat_scale
    n, heats, states = modal.tip.size, modal.rate.size, 2 * blocks.damping.size
    velocities = blocks.outward[-n:]
    shown = np.tensordot(velocities, blocks.shown, 2) / scale
    load = modal.tip if modal.load is None else modal.load
    result = BlockAccount(
        outward=np.hstack([velocities.reshape(n, -1), shown]),
        mass=modal.mass,
        stiffness=modal.frequency**2,
        damping=modal.damper if modal.damper is not None else np.diag(modal.damping),
        coupling=modal.coupling / scale,
        load=load,
        along=np.zeros(n) if modal.along is None else modal.along,
        levers=(step.lever, step.lever) if step.heat_counts else (0.0, step.lever),
        staggered=not step.heat_counts,
        lagged=step.lagged,
        load_share=float(structure.load_direction[-1]),
        steady=lane_rows(n),
        warming=lane_rows(heats),
        states=lane_rows(states + heats),
        mean=lane_rows(heats),
        place=lane_rows(n),
        speed=lane_rows(n),
        former=lane_rows(n),
        force=lane_rows(n),
    )
    steady = project(modal.shapes.T, cases.steady) - project(modal.coupling, begun.settled)
    return result, [(result.steady, steady.T), (result.warming, (begun.warming_modes * scale).T)]
