"""The θ-method and central differences of ARCHITECTURE in plain matrices, their laws of contact solved over all sets.

With w_i, t_i and s_i the rows of contact i, Ŵ = M + hθC1 + h²θ²K1 and T̂ = C2 + hθK2, impulses p of a step of the
θ-method take W p from the velocities of contacts at its end,

    W_ij = w_iᵀ Ŵ⁻¹ (w_j - µ t_j + α hθ K12 T̂⁻¹ s_j),

and central differences of positions are, with the force λ_k at t_k and what a unit force takes from x_k+1,

    x_k+1 = x_free - G λ_k,   G = (M/h² + C1/2h)⁻¹ (w - µ t).
"""

from collections.abc import Callable
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

from workflow.models import Array, Cases, Structure
from workflow.schemes import HISTORIES, Results, Sampling, Status, complete_periods, schedule

ROUNDED = 1e-14
"""Violation of complementarity that is rounding, over the largest entry of b."""


class Motion(NamedTuple):
    """One case at all step ends, ``(step, …)``."""

    displacement: Array
    velocity: Array
    temperature: Array
    """As samples show it: central differences have half of the heat of p_k in it."""
    carried: Array
    """Temperatures without it."""
    place: Array
    """Displacements of contacts; those without mass give way."""
    impulse: Array
    """Of the step that ends there, ``(step, contact)``."""


class Step(NamedTuple):
    """A step of the θ-method as a law sees it: contacts relative to their casing, and what unit impulses take."""

    place: Array
    velocity: Array
    force: Array
    """At the beginning, as place and velocity."""
    free: Array
    """Velocity at the end without impulses."""
    depth: Array
    """Place at the end without impulses."""
    taken: Array
    """From the velocity at the end."""
    sunk: Array
    """From the place at the end, without what contacts give way."""
    flexibility: Array


Law = Callable[[Step], tuple[Array, Array]]
"""Gives impulses of a step and forces at its end."""
CentralLaw = Callable[[Array, Array, Array, Array], Array]
"""From s before, now and after the step without contact, and what unit forces take from that, to the forces."""


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


def newton(h: float, e: float) -> Law:
    """0 <= p ⊥ W p - b >= 0, b_i = w_iᵀv_free - V_i' + e u_i, over contacts with x_i - d_i + h/2 u_i >= 0."""

    def law(at: Step) -> tuple[Array, Array]:
        p, active = np.zeros(at.free.size), np.flatnonzero(at.place + h / 2 * at.velocity >= 0)
        p[active] = complementary(at.taken[np.ix_(active, active)], (at.free + e * at.velocity)[active])
        return p, 0 * p

    return law


def by_place(h: float) -> Law:
    """Contacts without mass: the same of their places at the end, λ = p/h."""

    def law(at: Step) -> tuple[Array, Array]:
        p = complementary(at.sunk + at.flexibility / h, at.depth)
        return p, p / h

    return law


class CoatedCasing:
    """A law of contacts on an elastic casing with a coating, of one case: all states of all contacts are tried."""

    def __init__(self, one: Cases, h: float, flexibility: float) -> None:
        own = one.coating
        assert own is not None
        self.first, self.hardening, self.sectors = own.yield_force[0], own.hardening[0], int(own.sectors[0])
        self.speed, self.turns, self.worn = own.speed[0], own.turns[0], own.worn[0].copy()
        self.h, self.c, self.steps = h, flexibility, 0

    def begin(self, depth: Array, gives: Array) -> Array:
        """Return the forces of contacts that have ended a step, and wear the sectors in which they are."""
        turns = self.turns + self.speed * self.steps * self.h
        here = np.arange(turns.size), np.floor(self.sectors * turns + 1e-9).astype(int) % self.sectors
        force, self.worn[here] = self._pressed(depth, gives, self.worn[here])
        return force

    def __call__(self, at: Step) -> tuple[Array, Array]:
        """Return impulses of a step and forces at its end."""
        self.steps += 1
        force = self.begin(at.depth, self.h * at.sunk + at.flexibility)
        return self.h * force, force

    def _pressed(self, depth: Array, gives: Array, worn: Array) -> tuple[Array, Array]:
        best, least = (0 * worn, worn), np.inf
        for state in product(("open", "elastic", "crushing"), repeat=worn.size):
            matrix, right = np.eye(worn.size), np.zeros(worn.size)
            for i, kind in enumerate(state):
                if kind == "elastic":
                    matrix[i] = gives[i] + self.c * np.eye(worn.size)[i]
                    right[i] = depth[i] - worn[i]
                elif kind == "crushing":
                    matrix[i] = self.hardening * gives[i] + (1 + self.hardening * self.c) * np.eye(worn.size)[i]
                    right[i] = self.first + self.hardening * depth[i]
            force = np.linalg.solve(matrix, right)
            deep = (depth - gives @ force - worn) / self.c
            level = self.first + self.hardening * worn
            wrong = {"open": deep, "elastic": np.maximum(-force, force - level), "crushing": force - deep}
            broken = max(wrong[kind][i] for i, kind in enumerate(state))
            if broken < least:
                crushes = np.array(state) == "crushing"
                best, least = (force, np.where(crushes, depth - gives @ force - self.c * force, worn)), broken
            if least <= 1e-11 * np.abs(level).max():
                break
        return best


def spring(h: float, theta: float, stiffness: float, damper: float = 0.0) -> Law:
    """Springs and dampers, whose forces act at both ends of a step."""

    def law(at: Step) -> tuple[Array, Array]:
        begun = h * (1 - theta) * at.force
        gives = h * theta * at.sunk + at.flexibility, h * theta * at.taken
        ends = pressed(at.depth - at.sunk @ begun, at.free - at.taken @ begun, stiffness, damper, gives)
        return begun + h * theta * ends, ends

    return law


def pressed(depth: Array, parting: Array, stiffness: float, damper: float, gives: tuple[Array, Array]) -> Array:
    """Return the forces of springs and dampers, of depths and velocities less what unit forces take from them.

    In each contact apart, λ = 0; pressed, λ = κ s + c s' >= 0 and s >= 0; or, where the damper alone pushes, on its
    casing, s = 0 and 0 <= λ <= c s'.
    """
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


def load(one: Cases, t: float) -> float:
    """Return f(t) of the first case."""
    waves = one.load_harmonics
    return float(one.mean[0] + np.sum(waves.amplitude[0] * np.sin(2 * np.pi * waves.frequency[0] * t + waves.phase[0])))


def _angles(one: Cases, t: float) -> Array:
    moves = one.casing_harmonics
    return np.asarray(2 * np.pi * moves.frequency[0] * t + moves.phase[0] + one.turns[0])


def place(one: Cases, t: float) -> Array:
    """Return d_i(t) of the first case, m, ``(contact,)``."""
    return np.asarray(one.gaps[0] + (one.casing_harmonics.amplitude[0] * np.sin(_angles(one, t))).sum(axis=1))


def speed(one: Cases, t: float, h: float, theta: float) -> Array:
    """Return V_i(t) = Σ Im[g a e^{i(ωt + φ + kψ_i)}], g = (e^{iωh} - 1)/(h (1 - θ + θ e^{iωh})), m/s."""
    moves = one.casing_harmonics
    turn = np.exp(2j * np.pi * moves.frequency[0] * h)
    g = (turn - 1) / (h * (1 - theta + theta * turn))
    return np.asarray(np.imag(g * moves.amplitude[0] * np.exp(1j * _angles(one, t))).sum(axis=1))


def march(
    structure: Structure, one: Cases, h: float, theta: float, steps: int, law: Law | None = None, give: float = 0.0
) -> Motion:
    """Step the first case by the θ-method: by Newton's law, or by place without mass, else by a law that gives way."""
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    contacts, alpha, friction = structure.contacts, one.alpha[0], one.friction[0]
    w, s, count, compliant = contacts.normal, contacts.heat, contacts.count, contacts.is_compliant
    law = law or (by_place(h) if compliant else newton(h, one.e[0]))
    flexibility = contacts.flexibility(friction) if compliant else np.zeros((count, count))
    along = np.zeros(count) if contacts.residual_load is None else contacts.residual_load
    expands = np.zeros(s.shape) if contacts.residual_coupling is None else contacts.residual_coupling
    W_hat, T_hat = M + h * theta * C1 + (h * theta) ** 2 * K1, C2 + h * theta * K2
    warm = np.linalg.solve(T_hat, s.T)
    kick = np.linalg.solve(W_hat, (w - friction * contacts.tangent).T + alpha * h * theta * K12 @ warm)
    taken = w @ kick
    sunk = h * theta * taken + alpha * expands @ warm

    def force(t: float) -> Array:
        return np.asarray(load(one, t) * structure.load_direction + one.steady[0])

    def shown(t: float, x: Array, T: Array, forces: Array) -> Array:
        return np.asarray(w @ x + along * load(one, t) - flexibility @ forces - expands @ T)

    x, v, T, held = one.displacement[0], one.velocity[0], one.temperature[0], np.zeros(count)
    if isinstance(law, CoatedCasing):
        held = law.begin(shown(0.0, x, T, held) - place(one, 0.0), flexibility)
    elif compliant:
        held = complementary(flexibility + give * np.eye(count), shown(0.0, x, T, held) - place(one, 0.0))
    r, V = w @ x - place(one, 0.0), speed(one, 0.0, h, theta)
    path = [(x, v, T, T, shown(0.0, x, T, held), np.zeros(count))]
    for k in range(steps):
        end = (k + 1) * h
        T_free = np.linalg.solve(T_hat, C2 @ T - h * (1 - theta) * K2 @ T + h * one.heating[0])
        right = M @ v - h * (1 - theta) * C1 @ v - h * K1 @ (x + h * theta * (1 - theta) * v)
        right += h * (theta * force(end) + (1 - theta) * force(k * h))
        right -= h * K12 @ (theta * T_free + (1 - theta) * T)
        free, ahead = np.linalg.solve(W_hat, right), speed(one, end, h, theta)
        depth = shown(end, x + h * (theta * free + (1 - theta) * v), T_free, 0 * held) - place(one, end)
        p, held = law(Step(r, w @ v - V, held, w @ free - ahead, depth, taken, sunk, flexibility))
        v_new, T = free - kick @ p, T_free + alpha * warm @ p
        x = x + h * (theta * v_new + (1 - theta) * v)
        r, V, v = r + h * (theta * (w @ v_new - ahead) + (1 - theta) * (w @ v - V)), ahead, v_new
        path.append((x, v, T, T, shown(end, x, T, held), p))
    return Motion(*(np.array(states) for states in zip(*path, strict=True)))


def rebound(e: float) -> CentralLaw:
    """0 <= λ_k ⊥ s_k+1 + e s_k-1 <= 0, Newton's law between positions two steps apart; that of carpenter at e = 0."""
    return lambda before, now, free, give: complementary(give, free + e * before)


def central_spring(h: float, stiffness: float, damper: float) -> CentralLaw:
    """λ_k = κ s_k + c (s_k+1 - s_k-1)/2h, not below 0, where s_k > 0."""

    def law(before: Array, now: Array, free: Array, give: Array) -> Array:
        force, inside = np.zeros(now.size), np.flatnonzero(now > 0)
        wanted = (stiffness * now + damper * (free - before) / (2 * h))[inside]
        matrix = np.eye(now.size) + damper / (2 * h) * give
        force[inside] = complementary(matrix[np.ix_(inside, inside)], wanted)
        return force

    return law


def march_centrally(
    structure: Structure,
    one: Cases,
    h: float,
    steps: int,
    law: CentralLaw,
    lagged: bool = False,
    implicit: bool = False,
) -> Motion:
    """Step the first case by central differences; velocities are central, impulses half of both ends' forces."""
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    w, s, tangent = structure.contacts.normal, structure.contacts.heat, structure.contacts.tangent
    ahead = M / h**2 if lagged else M / h**2 + C1 / (2 * h)
    give = np.linalg.solve(ahead, (w - one.friction[0] * tangent).T)
    enters = np.linalg.solve(C2 + h * K2 if implicit else C2, s.T)

    def force(t: float) -> Array:
        return np.asarray(load(one, t) * structure.load_direction + one.steady[0])

    x, v, T = one.displacement[0], one.velocity[0], one.temperature[0]
    x_before = x - h * v + h**2 / 2 * np.linalg.solve(M, force(0.0) - C1 @ v - K1 @ x - K12 @ T)
    path, p_before = [], np.zeros(len(w))
    for k in range(steps + 1):
        behind, now, after = (place(one, (k + i) * h) for i in (-1, 0, 1))
        right = force(k * h) - K1 @ x - K12 @ T + M @ (2 * x - x_before) / h**2
        right = right - C1 @ (x - x_before) / h if lagged else right + C1 @ x_before / (2 * h)
        x_free = np.linalg.solve(ahead, right)
        forces = law(w @ x_before - behind, w @ x - now, w @ x_free - after, w @ give)
        x_after, p = x_free - give @ forces, h * forces
        heat = one.alpha[0] * enters @ p
        shown = T + heat / 2 if k else T
        path.append(
            (x, (x_after - x_before) / (2 * h) if k else v, shown, T, w @ x, (p_before + p) / 2 if k else 0 * p)
        )
        p_before = p if k else 2 * p
        if implicit:
            T = np.linalg.solve(C2 + h * K2, C2 @ T + h * one.heating[0]) + heat
        else:
            T = T + h * np.linalg.solve(C2, one.heating[0] - K2 @ T) + heat
        x_before, x = x, x_after
    return Motion(*(np.array(states) for states in zip(*path, strict=True)))


Marching = Callable[[Cases, int], Motion]
"""Steps the first of some cases so many times."""


def stepped_as(s: Structure, h: float, method: str, options: dict[str, Any]) -> Marching:
    """Return what steps a structure as a scheme with these options does."""
    if method == "moreau":
        return lambda one, steps: march(s, one, h, options["theta"], steps)
    if method in ("carpenter", "paoli_schatzman"):
        how = {"lagged": options.get("damping") == "lagged", "implicit": options.get("heat") != "explicit"}
        reads = method == "paoli_schatzman"
        return lambda one, steps: march_centrally(s, one, h, steps, rebound(float(one.e[0]) * reads), **how)
    stiffness, damper = options["stiffness"], options.get("damping", 0.0)
    if options.get("integration") != "implicit":
        return lambda one, steps: march_centrally(s, one, h, steps, central_spring(h, stiffness, damper))
    theta = options["theta"]
    law = spring(h, theta, stiffness, damper)
    return lambda one, steps: march(s, one, h, theta, steps, law, 1 / stiffness)


def results(structure: Structure, h: float, cases: Cases, sampling: Sampling, stepped: Marching) -> Results:
    """Step every case by ``stepped(case, steps)``, and sample its step ends linearly."""
    contacts = structure.contacts
    when = schedule(sampling, h)
    ends = h * np.arange(when.steps + 1)
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
        one = cases.take(slice(case, case + 1))
        motion = stepped(one, when.steps)
        if structure.sensors is not None:
            shown = structure.sensors.of(motion.displacement, motion.temperature)
            parts.setdefault("sensor_value", []).append(sampled(shown + motion.place @ structure.sensors.shares.T))
        at_contacts = motion.place, motion.velocity @ contacts.normal.T, motion.temperature @ contacts.heat.T
        histories = dict(zip(HISTORIES, (*at_contacts, np.cumsum(motion.impulse, axis=0)), strict=True))
        touches = motion.impulse > 0
        starts = touches & ~np.vstack([np.zeros_like(touches[:1]), touches[:-1]])
        edges = np.arange(counts.max(initial=0) + 1) / max(float(cases.period_frequency[case]), 1e-300)
        held = np.cumsum(h * touches, axis=0)
        hottest = np.full((contacts.count, edges.size - 1), np.nan)
        for k in range(counts[case]):
            inside = (ends >= edges[k]) & (ends <= edges[k + 1])
            hottest[:, k] = histories["temperature"][inside].max(axis=0)
        over = np.arange(edges.size - 1) >= counts[case]

        def per_period(values: Array, edges: Array = edges, over: Array = over) -> Array:
            at = np.array([np.interp(edges, ends, column) for column in values.T])
            return np.where(over, np.nan, np.diff(at, axis=1))

        depth = motion.place - [place(one, t) for t in ends]
        values = {name: sampled(states) for name, states in histories.items()} | {
            "impacts": 0.0 * starts.sum(axis=0) if contacts.is_compliant else starts.sum(axis=0),
            "contact_time": held[-1],
            "max_penetration": np.maximum(depth.max(axis=0), 0.0),
            "max_temperature": histories["temperature"].max(axis=0),
            "thermal_closing": max(row @ motion.carried[-1] for row in growth),
            "steps": when.steps,
            "period_impulse": per_period(histories["impulse"]),
            "period_temperature": hottest,
            "period_contact": per_period(held) * max(float(cases.period_frequency[case]), 0.0),
        }
        for name, value in values.items():
            parts.setdefault(name, []).append(np.asarray(value, dtype=float))
    arrays = {name: np.array(every) for name, every in parts.items()}
    sensors = {name: arrays.pop(name) for name in ("sensor_value",) if name in arrays}
    if contacts.count == 1:
        arrays = {name: values[:, 0] if values.ndim > 1 else values for name, values in arrays.items()}
    finite = np.isfinite(arrays["displacement"].reshape(cases.count, -1)).all(axis=1)
    return Results(
        histories={name: arrays.pop(name) for name in HISTORIES} | sensors,
        **{name: arrays.pop(name) for name in ("period_impulse", "period_temperature", "period_contact")},
        metrics=arrays,
        status=np.where(finite, Status.OK, Status.DIVERGED).astype(np.int8),
        messages={int(k): "not finite" for k in np.flatnonzero(~finite)},
    )
