"""Springs and central differences with several contacts in plain matrices, their laws solved over all sets of contacts.

Central differences of positions, with the force λ_k at t_k and what a unit force takes from x_k+1,

    x_k+1 = x_free - G λ_k,   G = (M/h² + C1/2h)⁻¹ (w - µ t),

with the law of each contact in terms of s = x_i - d_i: 0 <= λ_k ⊥ s_k+1 + e s_k-1 <= 0, or λ_k = κ s_k + c (s_k+1 -
s_k-1)/2h, not below 0, where s_k > 0. The θ-method has λ at the end of a step: in each contact apart, λ = 0; pressed,
λ = κ s + c s' >= 0 and s >= 0; or, where the damper alone pushes, on its casing, s = 0 and 0 <= λ <= c s'.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from plain_contacts import Motion, complementary, computed, place, speed

from workflow.models import Array, Cases, Structure
from workflow.schemes import HISTORIES, Results, Sampling

Law = Callable[[Array, Array, Array, Array], Array]
"""From s before, now and after the step without contact, and what unit forces take from that, to the forces."""


class Central(NamedTuple):
    """Formulas of damping and heat."""

    lagged: bool = False
    implicit: bool = False


def newton(e: float) -> Law:
    """Return Newton's law between positions two steps apart; that of carpenter at e = 0."""
    return lambda before, now, free, give: complementary(give, free + e * before)


def spring(h: float, stiffness: float, damper: float) -> Law:
    """Return springs and dampers where contacts are beyond their casing."""

    def law(before: Array, now: Array, free: Array, give: Array) -> Array:
        force, inside = np.zeros(now.size), np.flatnonzero(now > 0)
        wanted = (stiffness * now + damper * (free - before) / (2 * h))[inside]
        matrix = np.eye(now.size) + damper / (2 * h) * give
        force[inside] = complementary(matrix[np.ix_(inside, inside)], wanted)
        return force

    return law


def centrally(structure: Structure, h: float, cases: Cases, over: Sampling, law: Law, how: Central) -> Results:
    """Step every case by central differences."""

    def march(case: int, steps: int) -> Motion:
        return _march_centrally(structure, h, cases.take(slice(case, case + 1)), steps, law, how)

    return computed(structure, h, cases, over, march)


def _march_centrally(structure: Structure, h: float, one: Cases, steps: int, law: Law, how: Central) -> Motion:
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    contacts = structure.contacts
    assert contacts is not None
    w, s = contacts.normal, contacts.heat
    ahead = M / h**2 if how.lagged else M / h**2 + C1 / (2 * h)
    give = np.linalg.solve(ahead, (w - one.friction[0] * contacts.tangent).T)
    enters = np.linalg.solve(C2 + h * K2 if how.implicit else C2, s.T)

    def force(t: float) -> Array:
        return np.asarray(one.load_at(t)[0] * structure.load_direction + one.steady[0])

    x, v, T = one.displacement[0], one.velocity[0], one.temperature[0]
    x_before = x - h * v + h**2 / 2 * np.linalg.solve(M, force(0.0) - C1 @ v - K1 @ x - K12 @ T)
    path, impulses, p_before = [], [], np.zeros(len(w))
    for k in range(steps + 1):
        behind, now, after = (place(one, 0, (k + i) * h) for i in (-1, 0, 1))
        right = force(k * h) - K1 @ x - K12 @ T + M @ (2 * x - x_before) / h**2
        right = right - C1 @ (x - x_before) / h if how.lagged else right + C1 @ x_before / (2 * h)
        x_free = np.linalg.solve(ahead, right)
        forces = law(w @ x_before - behind, w @ x - now, w @ x_free - after, w @ give)
        x_after, p = x_free - give @ forces, h * forces
        heat = one.alpha[0] * enters @ p
        shown = T + heat / 2 if k else T
        path.append((w @ x, w @ (x_after - x_before) / (2 * h) if k else w @ v, s @ shown, T, x, shown))
        impulses.append((p_before + p) / 2 if k else 0 * p)
        p_before = p if k else 2 * p
        if how.implicit:
            T = np.linalg.solve(C2 + h * K2, C2 @ T + h * one.heating[0]) + heat
        else:
            T = T + h * np.linalg.solve(C2, one.heating[0] - K2 @ T) + heat
        x_before, x = x, x_after
    return _motion(one, h, np.array(impulses), path)


def _motion(one: Cases, h: float, impulses: Array, path: list[tuple[Array, ...]]) -> Motion:
    displacement, velocity, temperature, *whole = (np.array(states) for states in zip(*path, strict=True))
    running = np.cumsum(impulses, axis=0)
    histories = dict(zip(HISTORIES, (displacement, velocity, temperature, running), strict=True))
    return Motion(impulses, histories, np.array([place(one, 0, k * h) for k in range(len(path))]), *whole)


def pressed(depth: Array, parting: Array, stiffness: float, damper: float, gives: tuple[Array, Array]) -> Array:
    """Return the forces of springs and dampers, of depths and velocities less what unit forces take from them."""
    count, best, least = depth.size, np.zeros(depth.size), np.inf
    deep, slow = gives
    kinds = "apart", "pressed", "held"
    for state in product(kinds if damper else kinds[:2], repeat=count):
        matrix, right = np.eye(count), np.zeros(count)
        for i, kind in enumerate(state):
            if kind == "pressed":
                matrix[i] += stiffness * deep[i] + damper * slow[i]
                right[i] = stiffness * depth[i] + damper * parting[i]
            elif kind == "held":
                matrix[i], right[i] = stiffness * deep[i], stiffness * depth[i]
        force = np.linalg.solve(matrix, right) * [kind != "apart" for kind in state]  # exactly 0
        s, u = depth - deep @ force, parting - slow @ force
        wanted = stiffness * s + damper * u
        broken = [
            {
                "apart": min(stiffness * s[i], wanted[i]),
                "pressed": max(-force[i], -stiffness * s[i]),
                "held": max(-force[i], force[i] - damper * u[i]),
            }[kind]
            for i, kind in enumerate(state)
        ]
        if max(broken) < least:
            best, least = force, max(broken)
    return best


def on_springs(
    structure: Structure, h: float, cases: Cases, over: Sampling, theta: float, stiffness: float, damper: float = 0.0
) -> Results:
    """Step every case by the θ-method with springs and dampers."""

    def march(case: int, steps: int) -> Motion:
        return _march_on_springs(structure, h, cases.take(slice(case, case + 1)), steps, theta, stiffness, damper)

    return computed(structure, h, cases, over, march)


def _march_on_springs(
    structure: Structure, h: float, one: Cases, steps: int, theta: float, stiffness: float, damper: float
) -> Motion:
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    contacts = structure.contacts
    assert contacts is not None
    friction, count = one.friction[0], contacts.count
    w, s, push = contacts.normal, contacts.heat, contacts.normal - friction * contacts.tangent
    flexibility = contacts.flexibility(friction) if contacts.is_massless else np.zeros((count, count))
    along = np.zeros(count) if contacts.residual_load is None else contacts.residual_load
    expands = np.zeros(s.shape) if contacts.residual_coupling is None else contacts.residual_coupling
    W_hat, T_hat = M + h * theta * C1 + (h * theta) ** 2 * K1, C2 + h * theta * K2

    def force(t: float) -> Array:
        return np.asarray(one.load_at(t)[0] * structure.load_direction + one.steady[0])

    def after(k: int, x: Array, v: Array, T: Array, held: Array, ends: Array) -> tuple[Array, Array, Array]:
        """Return x, v and T after a step with forces at its ends."""
        p = h * (theta * ends + (1 - theta) * held)
        T_new = np.linalg.solve(T_hat, C2 @ T - h * (1 - theta) * K2 @ T + h * one.heating[0] + one.alpha[0] * s.T @ p)
        right = M @ v - h * (1 - theta) * C1 @ v - h * K1 @ (x + h * theta * (1 - theta) * v) - push.T @ p
        right += h * (theta * force((k + 1) * h) + (1 - theta) * force(k * h))
        right -= h * K12 @ (theta * T_new + (1 - theta) * T)
        v_new = np.linalg.solve(W_hat, right)
        return x + h * (theta * v_new + (1 - theta) * v), v_new, T_new

    def shown(k: int, x: Array, T: Array, ends: Array) -> Array:
        return np.asarray(w @ x + along * one.load_at(k * h)[0] - flexibility @ ends - expands @ T)

    x, v, T, held = one.displacement[0], one.velocity[0], one.temperature[0], np.zeros(count)
    if contacts.is_massless:
        depth = shown(0, x, T, held) - place(one, 0, 0.0)
        held = pressed(depth, np.zeros(count), stiffness, 0.0, (flexibility, 0 * flexibility))
    impulses, path = [np.zeros(count)], [(shown(0, x, T, held), w @ v, s @ T, T, x, T)]
    for k in range(steps):
        casing, moves = place(one, 0, (k + 1) * h), speed(one, 0, (k + 1) * h, h, theta)

        def apart(ends: Array, k: int = k, x: Array = x, v: Array = v, T: Array = T, held: Array = held) -> Array:
            ahead, faster, warmer = after(k, x, v, T, held, ends)
            return np.array([shown(k + 1, ahead, warmer, ends), w @ faster])

        free = apart(np.zeros(count))
        unit = max(1.0, stiffness * float(np.abs(free[0]).max()))
        taken = np.array([(free - apart(unit * column)) / unit for column in np.eye(count)])
        deep, slow = taken.transpose(1, 2, 0)
        ends = pressed(free[0] - casing, free[1] - moves, stiffness, damper, (deep, slow))
        impulses.append(h * (theta * ends + (1 - theta) * held))
        x, v, T = after(k, x, v, T, held, ends)
        held = ends
        path.append((shown(k + 1, x, T, held), w @ v, s @ T, T, x, T))
    return _motion(one, h, np.array(impulses), path)
