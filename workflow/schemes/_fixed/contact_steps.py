"""The θ-method with several contacts, or contacts without mass, in the modes with all contacts open.

With Ŵ = 1 + hθc + h²θ²ω², T̂ = 1 + hθμ, r_i = w_iᵀy - d_i and u_i = w_iᵀy' - V_i, V of :mod:`.loads`, a step is

    Ŵ (v_free - v) = h (g_θ - c v - ω² (y + hθv) - G τ_θ),   T̂ (τ_free - τ) = h (q - μ τ),
    v⁺ = v_free - Σ p_j Ŵ⁻¹ (w_j - µ t_j + α hθ G T̂⁻¹ s_j),   τ⁺ = τ_free + α Σ p_j T̂⁻¹ s_j,
    u⁺ = u_free - W p,   W_ij = w_iᵀ Ŵ⁻¹ (w_j - µ t_j + α hθ G T̂⁻¹ s_j),   r⁺ = r + h (θ u⁺ + (1-θ) u),

y⁺ like r⁺. Contacts **with mass** are active where r + h/2 u >= 0, and take the impulses of Newton's law together,

    0 <= p ⊥ W p - (u_free + e u) >= 0,   u⁺ = -e u to the bit where p > 0:

what is pressed follows its casing without drift. Contacts **without mass** have the force λ = p/h at the step's end,

    0 <= p ⊥ L p - (r + h (θ u_free + (1-θ) u) + ρ F⁺ - R_τ τ_free) >= 0,
    L = hθ W + (R - µ R^t)/h + α R_τ T̂⁻¹ s,

R_τ the residual coupling: no impact law, and any θ. The contacts that were pressed in the step before are tried first
(:mod:`workflow.kernels.lemke`). Cases are stepped one after the other; no pack of lanes holds several.

Source: Acary & Brogliato (2008), chapters 8 and 10.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array, elementary
from workflow.kernels.compiled import inlined, kernel, of_case, part
from workflow.kernels.lemke import Complementarity, problem, solve_complementarity
from workflow.models import ContactBasis
from workflow.schemes._exact.contact_motion import ContactCase
from workflow.schemes._exact.event_loop import COMPLETED, NO_IMPACT_LAW, NOT_FINITE, RUNNING
from workflow.schemes._exact.record import Record
from workflow.schemes._exact.tables import wave

PLACE, SPEED, TEMPERATURE, DEPTH = range(4)
"""Rows of what is shown: x_i [m], x_i' [m/s], θ_i [K] and x_i - d_i [m]."""


class Marks(NamedTuple):
    """Number of steps, and those in which a sample or the end of a load period is due, with its fraction of the step.

    Those of load periods are of a case ``(period,)``, or of all cases ``(case, period)``.
    """

    steps: int
    sample_due: NDArray[np.int64]
    sample_weight: Array
    period_due: NDArray[np.int64]
    period_weight: Array


class Shown(NamedTuple):
    """What the contacts show."""

    before: Array
    after: Array
    """At the beginning and the end of a step, ``(4, contact)``."""
    impulse: Array
    """p of the step, N s, ``(contact,)``."""
    deepest: Array
    """Largest penetration so far, m, ``(contact,)``."""


@inlined
def _between(before: float, after: float, share: float) -> float:
    """Interpolate at a fraction of a step; the step's end itself is exact."""
    return after if share == 1.0 else before + share * (after - before)


@part
def record_end(step: int, h: float, has_impacts: bool, record: Record, marks: Marks, shown: Shown) -> None:
    """Write the samples and load periods that are due within a step, and count its end."""
    first = record.tally[0]
    while first.next_sample < marks.sample_due.size and marks.sample_due[first.next_sample] == step:
        _sample(first.next_sample, marks.sample_weight[first.next_sample], record, shown)
        first.next_sample += 1
    while first.next_period < marks.period_due.size and marks.period_due[first.next_period] == step:
        _close_period(first.next_period, marks.period_weight[first.next_period], h, has_impacts, record, shown)
        first.next_period += 1
    share = marks.sample_weight[-1] if step == marks.steps else 1.0
    for i in range(shown.impulse.size):
        tally, pressed = record.tally[i], shown.impulse[i] > 0.0
        for k in range(4):
            shown.after[k, i] = _between(shown.before[k, i], shown.after[k, i], share)
        tally.max_temperature = max(tally.max_temperature, shown.after[TEMPERATURE, i])
        tally.period_temperature = max(tally.period_temperature, shown.after[TEMPERATURE, i])
        shown.deepest[i] = max(shown.deepest[i], shown.after[DEPTH, i])
        if pressed:
            tally.impacts += has_impacts and not tally.held
            tally.contact_time += share * h
            tally.impulse += share * shown.impulse[i]
        tally.held = pressed


@part
def _sample(k: int, share: float, record: Record, shown: Shown) -> None:
    """Write sample k at a fraction of the step."""
    for i in range(shown.impulse.size):
        for row in range(3):
            record.histories[row, i, k] = _between(shown.before[row, i], shown.after[row, i], share)
        impulse = record.tally[i].impulse
        record.histories[3, i, k] = _between(impulse, impulse + shown.impulse[i], share)


@part
def _close_period(k: int, share: float, h: float, has_impacts: bool, record: Record, shown: Shown) -> None:
    """Write load period k, which ends at a fraction of the step, and begin the next one."""
    for i in range(shown.impulse.size):
        tally, pressed = record.tally[i], shown.impulse[i] > 0.0
        impulse = _between(tally.impulse, tally.impulse + shown.impulse[i], share)
        contact = tally.contact_time + (share * h if pressed else 0.0)
        impacts = tally.impacts + (1 if pressed and has_impacts and not tally.held else 0)
        for row in range(3):
            record.periods[3 + row, i, k] = _between(shown.before[row, i], shown.after[row, i], share)
        reached = record.periods[3 + TEMPERATURE, i, k]
        record.periods[0, i, k] = impulse - tally.period_impulse
        record.periods[1, i, k] = max(tally.period_temperature, reached)
        record.periods[2, i, k] = contact - tally.period_contact
        record.periods[6, i, k] = impacts - tally.period_impacts
        tally.max_temperature = max(tally.max_temperature, reached)
        tally.period_impulse, tally.period_contact = impulse, contact
        tally.period_temperature, tally.period_impacts = reached, impacts


class Stepping(NamedTuple):
    """A step of a structure, as kernels take it."""

    h: float
    theta: float
    massless: bool
    couples: bool
    """Whether damping couples modes: c and Ŵ⁻¹ are ``(mode, mode)`` then, else ``(1, mode)``."""
    stiffness: Array
    """ω², ``(mode,)``."""
    damping: Array
    inverse: Array
    """Ŵ⁻¹."""
    coupling: Array
    """Gᵀ, ``(thermal mode, mode)``."""
    decay: Array
    weight: Array
    """Factor (1 - h(1-θ)μ)/(1 + hθμ) of a free step, and T̂⁻¹, ``(thermal mode,)``."""
    load: Array
    """φᵀb, ``(mode,)``."""
    normal: Array
    """wᵀ, ``(mode, contact)``."""
    heat: Array
    """sᵀ, ``(thermal mode, contact)``."""
    kicks: Array
    """Ŵ⁻¹ w_j, and what it has more per µ and per α, ``(3, contact, mode)``."""
    delassus: Array
    """W, likewise, ``(3, contact, contact)``."""
    law: Array
    """Matrix of the complementarity problem, likewise: W, or L of contacts without mass."""
    residual_load: Array
    residual_coupling: Array
    """ρ, ``(contact,)``, and R_τᵀ, ``(thermal mode, contact)``."""


def stepping(basis: ContactBasis, h: float, theta: float) -> Stepping:
    """Return the step of a basis; Ŵ of damping that couples modes is inverted once."""
    lever, contacts, couples = h * theta, basis.contacts, basis.damping.ndim == 2
    damping, square = np.atleast_2d(basis.damping), basis.frequency**2
    if couples:
        inverse = np.linalg.inv(np.diag(1 + lever**2 * square) + lever * damping)
    else:
        inverse = 1 / (1 + lever * damping + lever**2 * square)
    weight = 1 / (1 + lever * basis.rate)
    warming = weight[:, None] * basis.heat.T
    forces = np.stack([basis.normal, -basis.tangent, lever * (basis.coupling @ warming).T])
    kicks = forces @ inverse if couples else forces * inverse
    law = delassus = basis.normal @ kicks.swapaxes(1, 2)
    if contacts.is_compliant:
        cold = contacts.flexibility(0.0)
        per_friction = contacts.flexibility(1.0) - cold
        law = lever * delassus + np.stack([cold / h, per_friction / h, basis.residual_coupling @ warming])
    arrays = {
        "stiffness": square,
        "damping": damping,
        "inverse": inverse,
        "coupling": basis.coupling.T,
        "decay": (1 - h * (1 - theta) * basis.rate) * weight,
        "weight": weight,
        "load": basis.load,
        "normal": basis.normal.T,
        "heat": basis.heat.T,
        "kicks": kicks,
        "delassus": delassus,
        "law": law,
        "residual_load": basis.residual_load,
        "residual_coupling": basis.residual_coupling.T,
    }
    laid_out = {name: np.ascontiguousarray(values) for name, values in arrays.items()}
    return Stepping(h=h, theta=theta, massless=contacts.is_compliant, couples=couples, **laid_out)


class Now(NamedTuple):
    """State of the case that is stepped, its matrices, and scratch."""

    y: Array
    v: Array
    tau: Array
    """Modal state, ``(mode,)`` and ``(thermal mode,)``."""
    free: Array
    force: Array
    warm: Array
    """v_free and the force on it, ``(mode,)``; τ_free, ``(thermal mode,)``."""
    apart: Array
    parting: Array
    loose: Array
    """r, u and u_free, ``(contact,)``."""
    place: Array
    speed: Array
    """d and V, ``(contact,)``."""
    kicks: Array
    delassus: Array
    law: Array
    """As in :class:`Stepping`, at µ and α of the case."""
    tried: NDArray[np.int64]
    """Contacts in the complementarity problem, ``(contact,)``."""
    problem: Complementarity
    shown: Shown
    """With p."""


def memory(s: Stepping) -> Now:
    """Return memory for one case."""
    (thermal, m), modes = s.heat.shape, s.load.size
    y, v, free, force = np.zeros((4, modes))
    tau, warm = np.zeros((2, thermal))
    apart, parting, loose, place, speed = np.zeros((5, m))
    kicks, (delassus, law) = np.zeros((m, modes)), np.zeros((2, m, m))
    tried, shown = np.zeros(m, dtype=np.int64), Shown(*np.zeros((2, 4, m)), *np.zeros((2, m)))
    contacts = apart, parting, loose, place, speed, kicks, delassus, law
    return Now(y, v, tau, free, force, warm, *contacts, tried, problem(m), shown)


class CasingSteps(NamedTuple):
    """The casing as steps see it."""

    speeds: Array
    """V per cos ψ and sin ψ of each wave, ``(case, wave, 2, contact)``."""
    begun: Array
    """r and u at t = 0, ``(case, 2, contact)``."""


class Ending(NamedTuple):
    """How cases ended, ``(case,)``, and the largest penetration, m, ``(case, contact)``."""

    ended: NDArray[np.int64]
    penetration: Array


@kernel
def step_cases(
    s: Stepping,
    cases: ContactCase,
    casing: CasingSteps,
    which: NDArray[np.int64],
    record: Record,
    marks: Marks,
    now: Now,
    ending: Ending,
) -> None:
    """Step cases one after the other; their states at the end are left in ``cases.modal``."""
    for i in which:
        mine = Record(
            record.times, record.period_ends[i], record.histories[i], record.periods[i], record.tally[i], record.events
        )
        own = Marks(marks.steps, marks.sample_due, marks.sample_weight, marks.period_due[i], marks.period_weight[i])
        ending.ended[i] = _march(s, of_case(cases, i), casing.speeds[i], casing.begun[i], mine, own, now)
        for c in range(now.place.size):
            ending.penetration[i, c] = now.shown.deepest[c]


@part
def _march(s: Stepping, case: ContactCase, speeds: Array, begun: Array, record: Record, marks: Marks, now: Now) -> int:
    """Step a case; return how it ended."""
    load = _begin(s, case, speeds, begun, record, now)
    for step in range(1, marks.steps + 1):
        record.tally[0].time = step * s.h
        before, load = load, _turn(case, speeds, step * s.h, now)
        _step_freely(s, case, s.theta * load + (1.0 - s.theta) * before, now)
        ended = _press(s, case.e, load, now)
        if ended != RUNNING:
            return ended
        if not _end(s, case, marks.sample_weight[-1] if step == marks.steps else 1.0, now):
            return NOT_FINITE
        record_end(step, s.h, not s.massless, record, marks, now.shown)
    n = now.y.size
    for q in range(now.tau.size):
        case.modal[2 * n + q] = now.tau[q]
    return COMPLETED


@part
def _begin(s: Stepping, case: ContactCase, speeds: Array, begun: Array, record: Record, now: Now) -> float:
    """Set state and matrices of a case to its beginning; return the load."""
    n, m = now.y.size, now.place.size
    for j in range(n):
        now.y[j], now.v[j] = case.modal[j], case.modal[n + j]
    for q in range(now.tau.size):
        now.tau[q] = case.modal[2 * n + q]
    load = _turn(case, speeds, 0.0, now)
    for i in range(m):
        now.apart[i], now.parting[i], now.shown.impulse[i] = begun[0, i], begun[1, i], 0.0
        for row in range(3):
            now.shown.after[row, i] = record.histories[row, i, 0]
        now.shown.after[DEPTH, i] = now.shown.after[PLACE, i] - now.place[i]
        record.tally[i].max_temperature = record.tally[i].period_temperature = now.shown.after[TEMPERATURE, i]
        now.shown.deepest[i] = max(0.0, now.shown.after[DEPTH, i])
        for j in range(n):
            now.kicks[i, j] = s.kicks[0, i, j] + case.friction * s.kicks[1, i, j] + case.alpha * s.kicks[2, i, j]
        for j in range(m):
            cold = s.delassus[0, i, j] + case.friction * s.delassus[1, i, j]
            now.delassus[i, j] = cold + case.alpha * s.delassus[2, i, j]
            now.law[i, j] = s.law[0, i, j] + case.friction * s.law[1, i, j] + case.alpha * s.law[2, i, j]
    return load


@part
def _turn(case: ContactCase, speeds: Array, t: float, now: Now) -> float:
    """Set d and V to a time; return the load."""
    inputs, m = now.y.size + now.tau.size, now.place.size
    load = case.constant[inputs]
    for i in range(m):
        now.place[i], now.speed[i] = case.constant[inputs + 1 + i], 0.0
    for k in range(case.acting):
        sin, cos = elementary.sine_cosine(case.waves[k, wave.OMEGA] * t + case.waves[k, wave.PHASE])
        load += case.waves[k, wave.LOAD] * sin
        for i in range(m):
            now.place[i] += case.casing[k, 0, i] * cos + case.casing[k, 1, i] * sin
            now.speed[i] += speeds[k, 0, i] * cos + speeds[k, 1, i] * sin
    return float(load)


@part
def _step_freely(s: Stepping, case: ContactCase, load: float, now: Now) -> None:
    """Fill v_free, τ_free and u_free."""
    n, m, h, lever = now.y.size, now.place.size, s.h, s.h * s.theta
    for j in range(n):
        now.force[j] = case.constant[j] + load * s.load[j] - s.stiffness[j] * (now.y[j] + lever * now.v[j])
    for q in range(now.tau.size):
        now.warm[q] = s.decay[q] * now.tau[q] + h * s.weight[q] * case.constant[n + q]
        mean = s.theta * now.warm[q] + (1.0 - s.theta) * now.tau[q]
        for j in range(n):
            now.force[j] -= s.coupling[q, j] * mean
    if s.couples:
        for k in range(n):
            for j in range(n):
                now.force[j] -= s.damping[k, j] * now.v[k]
        for j in range(n):
            now.free[j] = now.v[j]
        for k in range(n):
            for j in range(n):
                now.free[j] += h * s.inverse[k, j] * now.force[k]
    else:
        for j in range(n):
            now.free[j] = now.v[j] + h * s.inverse[0, j] * (now.force[j] - s.damping[0, j] * now.v[j])
    for i in range(m):
        now.loose[i] = -now.speed[i]
    for j in range(n):
        for i in range(m):
            now.loose[i] += s.normal[j, i] * now.free[j]


@part
def _press(s: Stepping, e: float, load: float, now: Now) -> int:
    """Fill p; return RUNNING or how the case ended."""
    p, impulse, size, meet = now.problem, now.shown.impulse, 0, False
    for i in range(impulse.size):
        if s.massless:
            over = now.apart[i] + s.h * (s.theta * now.loose[i] + (1.0 - s.theta) * now.parting[i])
            over += s.residual_load[i] * load
            for q in range(now.warm.size):
                over -= s.residual_coupling[q, i] * now.warm[q]
        else:
            over = now.loose[i] + e * now.parting[i]
        if not np.isfinite(over):
            return NOT_FINITE
        if s.massless or now.apart[i] + 0.5 * s.h * now.parting[i] >= 0.0:
            p.constant[size], p.active[size], now.tried[size] = -over, impulse[i] > 0.0, i
            size, meet = size + 1, meet or over > 0.0
        impulse[i] = 0.0
    if not meet:
        return RUNNING
    for k in range(size):
        for q in range(size):
            p.matrix[k, q] = now.law[now.tried[k], now.tried[q]]
    if not solve_complementarity(p, size):
        return NO_IMPACT_LAW
    for k in range(size):
        impulse[now.tried[k]] = max(0.0, p.solution[k])
    return RUNNING


@part
def _end(s: Stepping, case: ContactCase, share: float, now: Now) -> bool:
    """Advance the state by the impulses, temperatures to a share of the step; return whether it is finite."""
    n, m, h, theta, shown = now.y.size, now.place.size, s.h, s.theta, now.shown
    for i in range(m):
        p = shown.impulse[i]
        if p > 0.0:
            for j in range(n):
                now.free[j] -= now.kicks[i, j] * p
            for k in range(m):
                now.loose[k] -= now.delassus[k, i] * p
            for q in range(now.tau.size):
                now.warm[q] += case.alpha * s.weight[q] * s.heat[q, i] * p
    for j in range(n):
        now.y[j] += h * (theta * now.free[j] + (1.0 - theta) * now.v[j])
        now.v[j] = now.free[j]
    total = 0.0
    for i in range(m):
        pressed = shown.impulse[i] > 0.0
        u = -case.e * now.parting[i] if pressed and not s.massless else now.loose[i]
        now.apart[i] += h * (theta * u + (1.0 - theta) * now.parting[i])
        now.parting[i] = u
        depth = now.apart[i]
        if s.massless:  # it is -(L p - over), 0 where p > 0
            depth = 0.0 if pressed else -now.problem.constant[i]
            for k in range(m):
                depth -= 0.0 if pressed else now.law[i, k] * shown.impulse[k]
        for row in range(4):
            shown.before[row, i] = shown.after[row, i]
        shown.after[PLACE, i], shown.after[SPEED, i], shown.after[DEPTH, i] = (
            now.place[i] + depth,
            now.speed[i] + u,
            depth,
        )
        shown.after[TEMPERATURE, i] = 0.0
        for q in range(now.tau.size):
            shown.after[TEMPERATURE, i] += s.heat[q, i] * now.warm[q]
        total += abs(depth) + abs(u) + abs(shown.after[TEMPERATURE, i])
    for q in range(now.tau.size):
        now.tau[q] = now.warm[q] if share == 1.0 else now.tau[q] + share * (now.warm[q] - now.tau[q])
    return bool(np.isfinite(total))
