"""The θ-method with several contacts in plain matrices: the law of a step is solved over all sets of closed contacts.

With w_i, t_i and s_i the rows of contact i, Ŵ = M + hθC1 + h²θ²K1 and T̂ = C2 + hθK2,

    W_ij = w_iᵀ Ŵ⁻¹ (w_j - µ t_j + α hθ K12 T̂⁻¹ s_j),   0 <= p ⊥ W p - b >= 0,   b_i = w_iᵀv_free - V_i' + e u_i

over the contacts with x_i - d_i + h/2 u_i >= 0, u_i = w_iᵀv - V_i. Contacts without mass have
0 <= p ⊥ (hθ W + (R - µ R^t)/h + α r T̂⁻¹ s) p - (x_free - d') >= 0 instead, λ = p/h, and x_i takes
-(R - µ R^t) λ - r T besides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from workflow.declare import quantity
from workflow.models import Array, Cases, Contacts, Structure
from workflow.schemes import HISTORIES, Results, Sampling, Status, complete_periods, schedule

READS = frozenset({"e", "h", "alpha"})
HARMONICS = frozenset({"load", "casing"})
GENERAL = frozenset({"contacts", "damping", "load", "friction", "massless"})
MOST = 8
"""Contacts: 256 sets of them are tried."""

ROUNDED = 1e-14
"""Violation of complementarity that is rounding, over the largest entry of b."""


@dataclass(frozen=True)
class Options:
    """Weight of the end of a step."""

    theta: float = quantity("1", "weight of a step's end", default=1.0, above=0, at_most=1)


class Operator(NamedTuple):
    """Structure, step and weight."""

    structure: Structure
    h: float
    theta: float


def init(structure: Structure, h: float, options: Options) -> Operator:
    """Keep what a batch shares."""
    return Operator(structure, h, options.theta)


def complementary(matrix: Array, b: Array) -> Array:
    """Return the p with 0 <= p ⊥ matrix p - b >= 0: of the first set of contacts that violates it by rounding only.

    Of several contacts that just touch no set may be better than that: then it is the one that violates it least.
    """
    best, least, diagonal = np.zeros(b.size), max(0.0, float(np.max(b, initial=0.0))), np.diag(matrix)
    rounded = ROUNDED * float(np.abs(b).max(initial=0.0))
    sets = (chosen for count in range(1, b.size + 1) for chosen in combinations(range(b.size), count))
    while least > rounded and (chosen := next(sets, None)):
        p = np.zeros(b.size)
        p[list(chosen)] = np.linalg.solve(matrix[np.ix_(chosen, chosen)], b[list(chosen)])
        rest = np.delete(matrix @ p - b, chosen)
        violation = max(float(np.max(-p * diagonal)), float(np.max(-rest, initial=0.0)))
        if violation < least:
            best, least = p, violation
    return np.maximum(best, 0.0)


class Motion(NamedTuple):
    """One case at all step ends, ``(step, …)``: impulses, what the contacts do, their casing, and all temperatures."""

    impulses: Array
    histories: dict[str, Array]
    casing: Array
    temperature: Array
    displacement: Array
    shown: Array
    """Displacements and temperatures of all coordinates, as samples show them."""


def place(cases: Cases, case: int, t: float) -> Array:
    """Return d_i(t) of a case, m, ``(contact,)``."""
    moves = cases.casing_harmonics
    angles = 2 * np.pi * moves.frequency[case] * t + moves.phase[case] + cases.turns[case]
    return np.asarray(cases.gaps[case] + (moves.amplitude[case] * np.sin(angles)).sum(axis=1))


def speed(cases: Cases, case: int, t: float, h: float, theta: float) -> Array:
    """Return V_i(t) = Σ Im[g a e^{i(ωt + φ + kψ_i)}], m/s, ``(contact,)``."""
    moves = cases.casing_harmonics
    omega = 2 * np.pi * moves.frequency[case]
    turn = np.exp(1j * omega * h)
    g = (turn - 1) / (h * (1 - theta + theta * turn))
    angles = omega * t + moves.phase[case] + cases.turns[case]
    return np.asarray(np.imag(g * moves.amplitude[case] * np.exp(1j * angles)).sum(axis=1))


def march(operator: Operator, contacts: Contacts, cases: Cases, case: int, steps: int) -> Motion:
    """Step one case."""
    structure, h, theta = operator
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    alpha, friction, e = cases.alpha[case], cases.friction[case], cases.e[case]
    w, count = contacts.normal, contacts.count
    W_hat, T_hat = M + h * theta * C1 + (h * theta) ** 2 * K1, C2 + h * theta * K2
    warm = np.linalg.solve(T_hat, contacts.heat.T)
    kick = np.linalg.solve(W_hat, (w - friction * contacts.tangent).T + alpha * h * theta * K12 @ warm)
    delassus = w @ kick
    flexibility = contacts.flexibility(friction) if contacts.is_compliant else np.zeros((count, count))
    along = np.zeros(count) if contacts.residual_load is None else contacts.residual_load
    x, v, T = cases.displacement[case], cases.velocity[case], cases.temperature[case]
    expands = np.zeros((count, T.size)) if contacts.residual_coupling is None else contacts.residual_coupling

    def load(t: float) -> float:
        return float(cases.take(slice(case, case + 1)).load_at(t)[0])

    def force(t: float) -> Array:
        return np.asarray(load(t) * structure.load_direction + cases.steady[case])

    def elastic(t: float, impulse: Array, T: Array) -> Array:
        return np.asarray(along * load(t) - flexibility @ impulse / h - expands @ T)

    pressed = np.zeros(count)
    if contacts.is_compliant:
        pressed = h * complementary(flexibility, w @ x + elastic(0.0, pressed, T) - place(cases, case, 0.0))
    r, V = w @ x - place(cases, case, 0.0), speed(cases, case, 0.0, h, theta)
    impulses, path = [np.zeros(count)], [(w @ x + elastic(0.0, pressed, T), w @ v, contacts.heat @ T, T, x, T)]
    for k in range(steps):
        T_new = np.linalg.solve(T_hat, C2 @ T - h * (1 - theta) * K2 @ T + h * cases.heating[case])
        right = M @ v - h * (1 - theta) * C1 @ v - h * K1 @ (x + h * theta * (1 - theta) * v)
        right += h * (theta * force((k + 1) * h) + (1 - theta) * force(k * h))
        right -= h * K12 @ (theta * T_new + (1 - theta) * T)
        free, ahead = np.linalg.solve(W_hat, right), speed(cases, case, (k + 1) * h, h, theta)
        p, end = np.zeros(count), (k + 1) * h
        if contacts.is_compliant:
            over = w @ (x + h * (theta * free + (1 - theta) * v)) + elastic(end, p, T_new)
            law = h * theta * delassus + flexibility / h + alpha * expands @ warm
            p = complementary(law, over - place(cases, case, end))
        else:
            u = w @ v - V
            active = np.flatnonzero(r + h / 2 * u >= 0)
            b = (w @ free - ahead + e * u)[active]
            p[active] = complementary(delassus[np.ix_(active, active)], b)
        v_new, T = free - kick @ p, T_new + alpha * warm @ p
        x = x + h * (theta * v_new + (1 - theta) * v)
        r, V = r + h * (theta * (w @ v_new - ahead) + (1 - theta) * (w @ v - V)), ahead
        v = v_new
        impulses.append(p)
        path.append((w @ x + elastic(end, p, T), w @ v, contacts.heat @ T, T, x, T))
    displacement, velocity, temperature, *whole = (np.array(states) for states in zip(*path, strict=True))
    running = np.cumsum(impulses, axis=0)
    histories = dict(zip(HISTORIES, (displacement, velocity, temperature, running), strict=True))
    casing = np.array([place(cases, case, k * h) for k in range(steps + 1)])
    return Motion(np.array(impulses), histories, casing, *whole)


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step every case."""
    contacts = operator.structure.contacts
    assert contacts is not None
    return computed(
        operator.structure, operator.h, cases, sampling, lambda *which: march(operator, contacts, cases, *which)
    )


def computed(
    structure: Structure, h: float, cases: Cases, sampling: Sampling, march: Callable[[int, int], Motion]
) -> Results:
    """Step every case by ``march(case, steps)``, and sample its step ends linearly."""
    contacts = structure.contacts
    assert contacts is not None
    assert contacts.count <= MOST
    when = schedule(sampling, h)
    times, ends = sampling.times, h * np.arange(when.steps + 1)
    growth = [-structure.mechanical.solve(normal) @ structure.coupling_matrix for normal in contacts.normal]
    if contacts.residual_coupling is not None:
        growth = [row - expands for row, expands in zip(growth, contacts.residual_coupling, strict=True)]
    counts = complete_periods(cases.period_frequency, sampling)
    parts: dict[str, list[Any]] = {}

    def sampled(values: Array) -> Array:
        ahead = values[when.due]
        before = values[np.maximum(when.due - 1, 0)]
        return np.asarray((before + when.weight[:, None] * (ahead - before)).T)

    for case in range(cases.count):
        motion = march(case, when.steps)
        if structure.sensors is not None:
            shown = structure.sensors.of(motion.displacement, motion.shown)
            shown += motion.histories["displacement"] @ structure.sensors.shares.T
            parts.setdefault("sensor_value", []).append(sampled(shown))
        touches = motion.impulses > 0
        starts = touches & ~np.vstack([np.zeros_like(touches[:1]), touches[:-1]])
        edges = np.arange(counts.max(initial=0) + 1) / max(float(cases.period_frequency[case]), 1e-300)
        held = np.cumsum(h * touches, axis=0)
        hottest = np.full((contacts.count, edges.size - 1), np.nan)
        for k in range(counts[case]):
            inside = (ends >= edges[k]) & (ends <= edges[k + 1])
            hottest[:, k] = motion.histories["temperature"][inside].max(axis=0)
        over = np.arange(edges.size - 1) >= counts[case]

        def per_period(values: Array, edges: Array = edges, over: Array = over) -> Array:
            at = np.array([np.interp(edges, ends, column) for column in values.T])
            return np.where(over, np.nan, np.diff(at, axis=1))

        depth = motion.histories["displacement"] - motion.casing
        values = {name: sampled(states) for name, states in motion.histories.items()} | {
            "impacts": 0.0 * starts.sum(axis=0) if contacts.is_compliant else starts.sum(axis=0),
            "contact_time": held[-1],
            "max_penetration": np.maximum(depth.max(axis=0), 0.0),
            "max_temperature": motion.histories["temperature"].max(axis=0),
            "thermal_closing": max(row @ motion.temperature[-1] for row in growth),
            "steps": when.steps,
            "period_impulse": per_period(motion.histories["impulse"]),
            "period_temperature": hottest,
            "period_contact": per_period(held) * max(float(cases.period_frequency[case]), 0.0),
        }
        for name, value in values.items():
            parts.setdefault(name, []).append(np.asarray(value, dtype=float))
    arrays = {name: np.array(every) for name, every in parts.items()}
    sensors = {"sensor_value": arrays.pop("sensor_value")} if structure.sensors is not None else {}
    if contacts.count == 1:
        arrays = {name: values[:, 0] if values.ndim > 1 else values for name, values in arrays.items()}
    finite = np.isfinite(arrays["displacement"].reshape(cases.count, -1)).all(axis=1)
    assert times.size == sampling.count
    return Results(
        histories={name: arrays.pop(name) for name in HISTORIES} | sensors,
        period_impulse=arrays.pop("period_impulse"),
        period_temperature=arrays.pop("period_temperature"),
        period_contact=arrays.pop("period_contact"),
        metrics=arrays,
        status=np.where(finite, Status.OK, Status.DIVERGED).astype(np.int8),
        messages={int(k): "not finite" for k in np.flatnonzero(~finite)},
    )
