"""Fixed steps with several contacts, or contacts without mass, in the modes with all contacts open.

With r_i = w_iᵀy - d_i and u_i = w_iᵀy' - V_i, V of :mod:`.loads`, and T̂ = 1 + hϑμ the **θ-method** is, ϑ = θ,

    Ŵ (v_free - v) = h (g_θ - c v - ω² (y + hθv) - G τ_θ),   Ŵ = 1 + hθc + h²θ²ω²,
    T̂ (τ_free - τ) = h (q - μ τ),   τ⁺ = τ_free + α Σ p_j T̂⁻¹ s_j,
    v⁺ = v_free - Σ p_j Ŵ⁻¹ (w_j - µ t_j + α hθ G T̂⁻¹ s_j),
    u⁺ = u_free - W p,   W_ij = w_iᵀ Ŵ⁻¹ (w_j - µ t_j + α hθ G T̂⁻¹ s_j),   r⁺ = r + h (θ u⁺ + (1-θ) u),

y⁺ like r⁺. **Central differences** are the same at θ = 0 with Ŵ = 1 + hc/2, or 1 where damping lags, from v = w_k-½ to
v⁺ = w_k+½ by the force at t_k and p_k centred on it, then y⁺ = y + h v⁺, r⁺ = r + h u⁺; ϑ is 1 where heat is implicit,
else 0. What is shown at t_k is that of :mod:`.central`: the mean velocity, half the heat of p_k, and (p_k-1 + p_k)/2.

The impulses of a step solve one complementarity problem (:mod:`workflow.kernels.lemke`); the contacts that were pressed
in the step before are tried first:

- Newton's law, θ-method: 0 <= p ⊥ W p - (u_free + e u) >= 0 over the contacts with r + h/2 u >= 0; u⁺ = -e u to the
  bit where p > 0: what is pressed follows its casing without drift.
- Newton's law, central: 0 <= p ⊥ W p - ((1 + e) r/h + u_free - e u) >= 0; r⁺ = -e (r - h u) to the bit where p > 0.
- By place: contacts without mass, and an elastic casing of flexibility C, have the force λ = p/h at the step's end,
  0 <= p ⊥ L p - (r + h (θ u_free + (1-θ) u) + ρ F⁺ - R_τ τ_free) >= 0, L = hθ W + (R - µ R^t + C)/h + α R_τ T̂⁻¹ s.
- A spring κ and a damper γ, θ-method, p = h (θ λ⁺ + (1-θ) λ): with r⁺ and u⁺ linear in λ⁺, and r⁺ that of the place
  with -(R - µ R^t) λ⁺ of contacts without mass, λ⁺ = max(0, min(κ r⁺ + γ u⁺, λ⁺ + κ r⁺)). The second keeps a contact
  that the damper alone would push out on its casing; with σ >= 0 for what it takes away,
  0 <= λ⁺ ⊥ λ⁺ - κ r⁺ - γ u⁺ + σ >= 0,   0 <= σ ⊥ λ⁺ - γ u⁺ + σ >= 0. Without damper σ = 0 is left out.
- The same, central: 0 <= p ⊥ (1 + hγ/2 W) p - h (κ r + γ/2 (u + u_free)) >= 0 over the contacts with r > 0.

R_τ is the residual coupling. The velocity of a contact without mass, in its record and its damper, is that of the
modes: the residual is a spring without damping. Cases are stepped one after the other; no pack of lanes holds several.

Balances are those of :mod:`.balance`, of the whole motion as in :mod:`.recorder`: the energy of all modes, with
the work of contact by the velocities that its law states; of contacts without mass the modes alone.

Source: Acary & Brogliato (2008), chapters 8 and 10.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array, elementary
from workflow.kernels.compiled import inlined, kernel, of_case, part
from workflow.kernels.lemke import Complementarity, problem, solve_complementarity
from workflow.models import ContactBasis, Contacts
from workflow.schemes._exact.contact_motion import ContactCase
from workflow.schemes._exact.event_loop import COMPLETED, NO_IMPACT_LAW, NOT_FINITE, RUNNING
from workflow.schemes._exact.record import Record, asked_of
from workflow.schemes._exact.tables import wave
from workflow.schemes._fixed.contact_record import (
    DEPTH,
    PLACE,
    SPEED,
    TEMPERATURE,
    Balancing,
    Ending,
    Marks,
    Shown,
    between,
    record_end,
)


class Method(NamedTuple):
    """A fixed step and its contact."""

    theta: float = 0.0
    heat_theta: float = 0.0
    """θ of the motion, 0 of central differences, and ϑ of heat."""
    central: bool = False
    lagged: bool = False
    """Whether steps are central differences; whether the velocity of the step before damps."""
    spring: float = 0.0
    damper: float = 0.0
    """κ [N/m], 0 for none, and γ [N s/m]."""
    rebounds: bool = False
    """Whether Newton's law reads e; else e = 0."""


class Stepping(NamedTuple):
    """A step of a structure, as kernels take it."""

    h: float
    method: Method
    compliant: bool
    casing_flexibility: float
    """Whether contacts are without mass or on an elastic casing; its C, m/N."""
    couples: bool
    """Whether damping couples modes: c and Ŵ⁻¹ are ``(mode, mode)`` then, else ``(1, mode)``."""
    stiffness: Array
    """ω², ``(mode,)``."""
    damping: Array
    inverse: Array
    """Ŵ⁻¹."""
    coupling: Array
    """Gᵀ, ``(thermal mode, mode)``."""
    rate: Array
    decay: Array
    weight: Array
    """μ, factor (1 - h(1-ϑ)μ)/(1 + hϑμ) of a free step, and T̂⁻¹, ``(thermal mode,)``."""
    load: Array
    """φᵀb, ``(mode,)``."""
    normal: Array
    tangent: Array
    """wᵀ and tᵀ, ``(mode, contact)``."""
    heat: Array
    """sᵀ, ``(thermal mode, contact)``."""
    kicks: Array
    """Ŵ⁻¹ w_j, and what it has more per µ and per α, ``(3, contact, mode)``."""
    delassus: Array
    """W, likewise, ``(3, contact, contact)``."""
    law: Array
    """Matrix of the complementarity problem, likewise, ``(3, unknown, unknown)``."""
    residual: Array
    """R and -R^t, ``(2, contact, contact)``."""
    residual_load: Array
    residual_coupling: Array
    """ρ, ``(contact,)``, and R_τᵀ, ``(thermal mode, contact)``."""


def stepping(basis: ContactBasis, h: float, method: Method) -> Stepping:
    """Return the step of a basis; Ŵ of damping that couples modes is inverted once."""
    lever, later, contacts, couples = h * method.theta, h * method.heat_theta, basis.contacts, basis.damping.ndim == 2
    damping, square = np.atleast_2d(basis.damping), basis.frequency**2
    damped = (0.0 if method.lagged else h / 2) if method.central else lever
    if couples:
        inverse = np.linalg.inv(np.diag(1 + lever**2 * square) + damped * damping)
    else:
        inverse = 1 / (1 + damped * damping + lever**2 * square)
    weight = 1 / (1 + later * basis.rate)
    warming = weight[:, None] * basis.heat.T
    forces = np.stack([basis.normal, -basis.tangent, lever * (basis.coupling @ warming).T])
    kicks = forces @ inverse if couples else forces * inverse
    delassus, cold = basis.normal @ kicks.swapaxes(1, 2), contacts.flexibility(0.0)
    residual = np.stack([cold, contacts.flexibility(1.0) - cold])
    arrays = {
        "stiffness": square,
        "damping": damping,
        "inverse": inverse,
        "coupling": basis.coupling.T,
        "rate": basis.rate,
        "decay": (1 - (h - later) * basis.rate) * weight,
        "weight": weight,
        "load": basis.load,
        "normal": basis.normal.T,
        "tangent": basis.tangent.T,
        "heat": basis.heat.T,
        "kicks": kicks,
        "delassus": delassus,
        "law": _law(h, method, delassus, contacts, np.stack([*residual, basis.residual_coupling @ warming])),
        "residual": residual,
        "residual_load": basis.residual_load,
        "residual_coupling": basis.residual_coupling.T,
    }
    laid_out: dict[str, Any] = {name: np.ascontiguousarray(values) for name, values in arrays.items()}
    kind = contacts.is_compliant, contacts.casing_flexibility, couples
    return Stepping(h, method, *kind, **laid_out)


def _law(h: float, method: Method, delassus: Array, contacts: Contacts, residual: Array) -> Array:
    """Return the matrices of the law of a step, from W and from R, -R^t and R_τ T̂⁻¹ s, ``(3, unknown, unknown)``."""
    lever, one = h * method.theta, np.zeros_like(delassus)
    one[0] = np.eye(delassus.shape[1])
    if method.spring == 0.0 and contacts.is_compliant:
        per_impulse = np.array([1 / h, 1 / h, 1.0])[:, None, None]
        return lever * delassus + per_impulse * (residual + contacts.casing_flexibility * one)
    if method.spring == 0.0:
        return delassus
    if method.central:
        return one + 0.5 * h * method.damper * delassus
    per_force = np.array([1.0, 1.0, lever])[:, None, None]
    yields, slows = lever * lever * delassus + per_force * residual, one + lever * method.damper * delassus
    pressed = slows + method.spring * yields
    return pressed if method.damper == 0.0 else np.block([[pressed, one], [slows, one]])


class Now(NamedTuple):
    """State of the case that is stepped, its matrices, and scratch."""

    y: Array
    v: Array
    """Modal state, ``(mode,)``; v is w_k-½ of central differences."""
    tau: Array
    tau_before: Array
    """Thermal modes, and those at the step's beginning, ``(thermal mode,)``."""
    free: Array
    force: Array
    warm: Array
    """v_free and the force on it, ``(mode,)``; τ_free, ``(thermal mode,)``; with the impulses v⁺ and τ⁺."""
    apart: Array
    ahead: Array
    """r and r⁺, ``(contact,)``."""
    parting: Array
    loose: Array
    leaving: Array
    """u, u_free less W p, and u⁺ as the law states it, ``(contact,)``."""
    place: Array
    speed: Array
    speed_before: Array
    """d, V and V a step before, ``(contact,)``."""
    pushes: Array
    pushed: Array
    """λ⁺ of a spring in the θ-method, else what the law finds of p; and that of the step before, ``(contact,)``."""
    impulse: Array
    impulse_before: Array
    """p, and p of the step before, ``(contact,)``."""
    approach: Array
    """u before the present contact began, ``(contact,)``."""
    kicks: Array
    delassus: Array
    law: Array
    flexibility: Array
    """As in :class:`Stepping`, at µ and α of the case, and R - µ R^t."""
    tried: NDArray[np.int64]
    """Unknowns of the law in the complementarity problem: contacts, then σ of each, ``(unknown,)``."""
    problem: Complementarity
    shown: Shown


def memory(s: Stepping, sensors: int) -> Now:
    """Return memory for one case, and so many sensors."""
    (thermal, m), modes, unknowns = s.heat.shape, s.load.size, s.law.shape[1]
    y, v, free, force = np.zeros((4, modes))
    tau, tau_before, warm = np.zeros((3, thermal))
    matrices = np.zeros((m, modes)), np.zeros((m, m)), np.zeros((unknowns, unknowns)), np.zeros((m, m))
    ends, counts = np.zeros((2, 4, m)), np.zeros((2, m))
    shown = Shown(ends[0], ends[1], counts[0], counts[1], np.zeros((2, sensors)))
    scratch = np.zeros(unknowns, dtype=np.int64), problem(unknowns), shown
    rows: Any = (y, v, tau, tau_before, free, force, warm, *np.zeros((13, m)), *matrices, *scratch)
    return Now(*rows)


class CasingSteps(NamedTuple):
    """The casing as steps see it."""

    speeds: Array
    """V per cos ψ and sin ψ of each wave, ``(case, wave, 2, contact)``."""
    begun: Array
    """r and u at t = 0, ``(case, 2, contact)``."""


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
    """Step cases one after the other; their thermal modes at the end are left in ``cases.modal``."""
    for i in which:
        mine = Record(
            record.times,
            record.period_ends[i],
            record.histories[i],
            record.periods[i],
            record.tally[i],
            asked_of(record.asked, i),
        )
        own = Marks(marks.steps, marks.sample_due, marks.sample_weight, marks.period_due[i], marks.period_weight[i])
        casing_of_case = CasingSteps(casing.speeds[i], casing.begun[i])
        ending.ended[i] = _march(s, of_case(cases, i), casing_of_case, mine, own, now, ending.balancing, ending.sums[i])
        for c in range(now.place.size):
            ending.penetration[i, c] = now.shown.deepest[c]
        _fill_state(s, cases.alpha[i], now, ending.state[i])


@part
def _fill_state(s: Stepping, alpha: float, now: Now, state: Array) -> None:
    """Fill [y, y', τ] after the last step; of central differences those that are shown at its beginning."""
    n, central = now.y.size, s.method.central
    for j in range(n):
        state[j], state[n + j] = now.y[j], 0.5 * (now.v[j] + now.free[j]) if central else now.v[j]
    for q in range(now.tau.size):
        state[2 * n + q] = now.tau[q]
        for i in range(now.impulse.size if central else 0):
            state[2 * n + q] += 0.5 * alpha * s.weight[q] * s.heat[q, i] * now.impulse[i]


@part
def _march(
    s: Stepping,
    case: ContactCase,
    casing: CasingSteps,
    record: Record,
    marks: Marks,
    now: Now,
    balancing: Balancing,
    sums: Any,
) -> int:
    """Step a case; return how it ended."""
    load, central, share, ended = _begin(s, case, casing, record, now), s.method.central, 1.0, RUNNING
    _begin_sums(s, now, balancing, sums)
    if central:
        ended = _press(s, case, load, load, now, balancing, sums)
        for i in range(now.impulse.size):
            now.impulse_before[i] = (2.0 if s.method.spring == 0.0 else 1.0) * now.impulse[i]  # see central
    for step in range(1, marks.steps + 1):
        if ended != RUNNING:
            return ended
        record.tally[0].time = step * s.h
        if central:
            _advance(s, case, now, balancing, sums)
        before, load = load, _turn(case, casing.speeds, step * s.h, now)
        ended = _press(s, case, before, load, now, balancing, sums)
        if ended == RUNNING:
            if central:
                finite = _show_centrally(s, case, now)
            else:
                _advance(s, case, now, balancing, sums)
                finite = _show(s, load, now)
            _sense(s, case, record.asked.rows, now)
            if not finite:
                return NOT_FINITE
            share = marks.sample_weight[-1] if step == marks.steps else 1.0
            record_end(step, s.h, not s.compliant, record, marks, now.shown)
    for q in range(now.tau.size):
        sums.gained += balancing.content[q] * now.tau[q]
        case.modal[2 * now.y.size + q] = between(now.tau_before[q], now.tau[q], share)
    return COMPLETED if ended == RUNNING else ended


@part
def _begin(s: Stepping, case: ContactCase, casing: CasingSteps, record: Record, now: Now) -> float:
    """Set state and matrices of a case to its beginning; return the load."""
    n, m, unknowns = now.y.size, now.place.size, s.law.shape[1]
    for j in range(n):
        now.y[j], now.v[j] = case.modal[j], case.modal[n + j]
    for q in range(now.tau.size):
        now.tau[q] = now.tau_before[q] = case.modal[2 * n + q]
    for k in range(now.shown.sensed.shape[1]):
        now.shown.sensed[1, k] = record.asked.sensed[k, 0]
    _turn(case, casing.speeds, -s.h, now)
    load = _turn(case, casing.speeds, 0.0, now)
    for i in range(m):
        now.apart[i], now.parting[i] = casing.begun[0, i], casing.begun[1, i]
        now.pushes[i] = now.approach[i] = 0.0
        for row in range(3):
            now.shown.after[row, i] = record.histories[row, i, 0]
        now.shown.after[DEPTH, i] = now.shown.after[PLACE, i] - now.place[i]
        record.tally[i].max_temperature = record.tally[i].period_temperature = now.shown.after[TEMPERATURE, i]
        now.shown.deepest[i] = max(0.0, now.shown.after[DEPTH, i])
        if s.compliant and s.method.spring > 0.0:
            now.pushes[i] = s.method.spring * now.shown.deepest[i]
        for j in range(n):
            now.kicks[i, j] = s.kicks[0, i, j] + case.friction * s.kicks[1, i, j] + case.alpha * s.kicks[2, i, j]
        for j in range(m):
            cold = s.delassus[0, i, j] + case.friction * s.delassus[1, i, j]
            now.delassus[i, j] = cold + case.alpha * s.delassus[2, i, j]
            now.flexibility[i, j] = s.residual[0, i, j] + case.friction * s.residual[1, i, j]
    for i in range(unknowns):
        for j in range(unknowns):
            now.law[i, j] = s.law[0, i, j] + case.friction * s.law[1, i, j] + case.alpha * s.law[2, i, j]
    return load


@part
def _turn(case: ContactCase, speeds: Array, t: float, now: Now) -> float:
    """Set d and V to a time; return the load."""
    inputs, m = now.y.size + now.tau.size, now.place.size
    load = case.constant[inputs]
    for i in range(m):
        now.place[i], now.speed_before[i], now.speed[i] = case.constant[inputs + 1 + i], now.speed[i], 0.0
    for k in range(case.acting):
        sin, cos = elementary.sine_cosine(case.waves[k, wave.OMEGA] * t + case.waves[k, wave.PHASE])
        load += case.waves[k, wave.LOAD] * sin
        for i in range(m):
            now.place[i] += case.casing[k, 0, i] * cos + case.casing[k, 1, i] * sin
            now.speed[i] += speeds[k, 0, i] * cos + speeds[k, 1, i] * sin
    return float(load)


@part
def _press(
    s: Stepping, case: ContactCase, before: float, load: float, now: Now, balancing: Balancing, sums: Any
) -> int:
    """Fill p, v⁺, u⁺, r⁺ and τ⁺ of a step between two loads; return RUNNING or how the case ended."""
    method, h = s.method, s.h
    mean = load if method.central else method.theta * load + (1.0 - method.theta) * before
    _step_freely(s, case, mean, now)
    for i in range(now.impulse.size):
        now.impulse[i], now.pushed[i] = 0.0, now.pushes[i]
        if method.spring > 0.0 and not method.central and now.pushes[i] > 0.0:
            _strike(s, case, i, h * (1.0 - method.theta) * now.pushes[i], now)
    ended = _solve(s, case, load, now)
    if ended != RUNNING:
        return ended
    for i in range(now.impulse.size):
        pressed = now.pushes[i] > 0.0
        now.leaving[i] = now.loose[i]
        if method.central:
            now.ahead[i] = now.apart[i] + h * now.leaving[i]
            if pressed and method.spring == 0.0:
                now.ahead[i] = -case.e * (now.apart[i] - h * now.parting[i])
                now.leaving[i] = (now.ahead[i] - now.apart[i]) / h
        else:
            if pressed and method.spring == 0.0 and not s.compliant:
                now.leaving[i] = -case.e * now.parting[i]
            now.ahead[i] = now.apart[i] + h * (method.theta * now.leaving[i] + (1.0 - method.theta) * now.parting[i])
        if pressed and now.pushed[i] <= 0.0:
            now.approach[i] = now.parting[i]
        elif now.pushed[i] > 0.0 and not pressed:
            sums.approached += now.approach[i] * now.approach[i]
            sums.separated -= now.approach[i] * now.leaving[i]
    if balancing.counts:
        _count_work(s, case, mean, now, sums)
    return RUNNING


@part
def _step_freely(s: Stepping, case: ContactCase, load: float, now: Now) -> None:
    """Fill v_free, τ_free and u_free."""
    n, m, h, theta = now.y.size, now.place.size, s.h, s.method.theta
    for j in range(n):
        now.force[j] = case.constant[j] + load * s.load[j] - s.stiffness[j] * (now.y[j] + h * theta * now.v[j])
    for q in range(now.tau.size):
        now.warm[q] = s.decay[q] * now.tau[q] + h * s.weight[q] * case.constant[n + q]
        mean = theta * now.warm[q] + (1.0 - theta) * now.tau[q]
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
def _strike(s: Stepping, case: ContactCase, i: int, p: float, now: Now) -> None:
    """Add an impulse of contact ``i`` to those of the step, with what it does to v⁺, u⁺ and τ⁺."""
    now.impulse[i] += p
    for j in range(now.free.size):
        now.free[j] -= now.kicks[i, j] * p
    for k in range(now.loose.size):
        now.loose[k] -= now.delassus[k, i] * p
    for q in range(now.warm.size):
        now.warm[q] += case.alpha * s.weight[q] * s.heat[q, i] * p


@inlined
def _place_ahead(s: Stepping, i: int, load: float, now: Now) -> float:
    """Return r of contact ``i`` at the end of a step of the θ-method, with its residual but for the force there."""
    place = now.apart[i] + s.h * (s.method.theta * now.loose[i] + (1.0 - s.method.theta) * now.parting[i])
    if s.compliant:
        place += s.residual_load[i] * load
        for q in range(now.warm.size):
            place -= s.residual_coupling[q, i] * now.warm[q]
    return float(place)


@inlined
def _demand(s: Stepping, case: ContactCase, i: int, load: float, now: Now) -> tuple[float, bool]:
    """Return b of contact ``i``, what its law lacks without forces at the end, and whether it may press then."""
    method, h = s.method, s.h
    if method.spring > 0.0 and method.central:
        mean = 0.5 * (now.parting[i] + now.loose[i])
        return h * (method.spring * now.apart[i] + method.damper * mean), now.apart[i] > 0.0
    if method.spring > 0.0:
        place = _place_ahead(s, i, load, now)
        return method.spring * place + method.damper * now.loose[i], place > 0.0
    if method.central:
        return (1.0 + case.e) * (now.apart[i] / h) + now.loose[i] - case.e * now.parting[i], True
    if s.compliant:
        return _place_ahead(s, i, load, now), True
    return now.loose[i] + case.e * now.parting[i], now.apart[i] + 0.5 * h * now.parting[i] >= 0.0


@part
def _solve(s: Stepping, case: ContactCase, load: float, now: Now) -> int:
    """Solve the law of the step, and strike by its impulses; return RUNNING or how the case ended."""
    p, m, count, meets = now.problem, now.pushes.size, 0, False
    ends = s.method.spring > 0.0 and not s.method.central  # its unknowns are forces at the end, of all contacts
    for i in range(m):
        lacks, may = _demand(s, case, i, load, now)
        if not np.isfinite(lacks):
            return NOT_FINITE
        if may or ends:
            p.constant[count], p.active[count], now.tried[count] = -lacks, now.pushes[i] > 0.0, i
            count, meets = count + 1, meets or (may and lacks > 0.0)
        now.pushes[i] = 0.0
    if not meets:
        return RUNNING
    size = count
    if ends and s.method.damper > 0.0:
        for i in range(m):  # σ
            p.constant[size], p.active[size], now.tried[size] = -s.method.damper * now.loose[i], False, m + i
            size += 1
    for k in range(size):
        for q in range(size):
            p.matrix[k, q] = now.law[now.tried[k], now.tried[q]]
    if not solve_complementarity(p, size):
        return NO_IMPACT_LAW
    for k in range(count):
        if p.solution[k] > 0.0:
            now.pushes[now.tried[k]] = p.solution[k]
            _strike(s, case, now.tried[k], (s.h * s.method.theta if ends else 1.0) * p.solution[k], now)
    return RUNNING


@part
def _advance(s: Stepping, case: ContactCase, now: Now, balancing: Balancing, sums: Any) -> None:
    """Move on to the end of a step."""
    theta, later = 1.0 if s.method.central else s.method.theta, s.method.heat_theta
    for j in range(now.y.size):
        now.y[j] += s.h * (theta * now.free[j] + (1.0 - theta) * now.v[j])
        now.v[j] = now.free[j]
    lost = 0.0
    for q in range(now.tau.size):
        now.tau_before[q], now.tau[q] = now.tau[q], now.warm[q]
        if balancing.counts:
            loss = later * now.tau[q] + (1.0 - later) * now.tau_before[q]
            lost += s.h * balancing.content[q] * s.rate[q] * loss
    sums.lost += lost
    sums.turned_over += abs(lost)
    for i in range(now.apart.size):
        now.apart[i], now.parting[i] = now.ahead[i], now.leaving[i]
        sums.friction_heat += case.alpha * now.impulse[i]
    if balancing.counts and not s.method.central:
        _measure(s, now.v, 0.0, now, sums)


@part
def _show(s: Stepping, load: float, now: Now) -> bool:
    """Fill what a step of the θ-method shows at its end; return whether it is finite."""
    shown, total, by_place = now.shown, 0.0, s.method.spring == 0.0 and s.compliant
    for i in range(now.apart.size):
        depth, pressed = now.apart[i], now.pushes[i] > 0.0
        if s.compliant:
            depth += s.residual_load[i] * load
            for q in range(now.tau.size):
                depth -= s.residual_coupling[q, i] * now.tau[q]
            for k in range(now.apart.size):
                depth -= now.flexibility[i, k] * (now.pushes[k] / s.h if by_place else now.pushes[k])
        if by_place and pressed:
            depth = s.casing_flexibility * now.pushes[i] / s.h
        temperature = 0.0
        for q in range(now.tau.size):
            temperature += s.heat[q, i] * now.tau[q]
        total += _show_contact(shown, i, now.place[i] + depth, now.speed[i] + now.parting[i], temperature, depth)
        shown.impulse[i] = now.impulse[i]
    return bool(np.isfinite(total))


@part
def _show_centrally(s: Stepping, case: ContactCase, now: Now) -> bool:
    """Fill what central differences show at t_k; return whether it is finite."""
    shown, total = now.shown, 0.0
    for i in range(now.apart.size):
        speed = 0.5 * (now.parting[i] + now.speed_before[i] + now.leaving[i] + now.speed[i])
        temperature = 0.0
        for q in range(now.tau.size):
            heat = 0.0
            for k in range(now.apart.size):
                heat += s.heat[q, k] * now.impulse[k]
            temperature += s.heat[q, i] * (now.tau[q] + 0.5 * case.alpha * s.weight[q] * heat)
        total += _show_contact(shown, i, now.place[i] + now.apart[i], speed, temperature, now.apart[i])
        shown.impulse[i] = 0.5 * (now.impulse_before[i] + now.impulse[i])
        now.impulse_before[i] = now.impulse[i]
    return bool(np.isfinite(total))


@part
def _sense(s: Stepping, case: ContactCase, rows: Array, now: Now) -> None:
    """Fill what sensors show at the end of a step, or of central differences at t_k, with half the heat of p_k."""
    shown, modes = now.shown, now.y.size
    for k in range(rows.shape[0]):
        shown.sensed[0, k], value = shown.sensed[1, k], 0.0
        for j in range(modes):
            value += rows[k, j] * now.y[j]
        for q in range(now.tau.size):
            heat = 0.0
            for i in range(now.impulse.size if s.method.central else 0):
                heat += 0.5 * case.alpha * s.weight[q] * s.heat[q, i] * now.impulse[i]
            value += rows[k, modes + q] * (now.tau[q] + heat)
        shown.sensed[1, k] = value


@inlined
def _show_contact(shown: Shown, i: int, place: float, speed: float, temperature: float, depth: float) -> float:
    """Fill what a contact shows at the end of a step; return a number that is finite where that is."""
    for row in range(4):
        shown.before[row, i] = shown.after[row, i]
    shown.after[PLACE, i], shown.after[SPEED, i] = place, speed
    shown.after[TEMPERATURE, i], shown.after[DEPTH, i] = temperature, depth
    return abs(place) + abs(speed) + abs(temperature)


@part
def _begin_sums(s: Stepping, now: Now, balancing: Balancing, sums: Any) -> None:
    """Set the sums of a case to t = 0."""
    if balancing.counts:
        for q in range(now.tau.size):
            sums.gained -= balancing.content[q] * now.tau[q]
        _measure(s, now.v, -s.h if s.method.central else 0.0, now, sums)
        sums.first_energy = sums.last_energy


@part
def _measure(s: Stepping, v: Array, lever: float, now: Now, sums: Any) -> None:
    """Compute the energy, (v² + ω² y (y + lever v))/2 over all modes."""
    energy = 0.0
    for j in range(now.y.size):
        energy += 0.5 * (v[j] * v[j] + s.stiffness[j] * now.y[j] * (now.y[j] + lever * v[j]))
    sums.last_energy = energy
    sums.largest_energy = max(sums.largest_energy, energy)


@part
def _count_work(s: Stepping, case: ContactCase, load: float, now: Now, sums: Any) -> None:
    """Add what damping, heat and contact take from the motion in a step, less what loads give."""
    n, h, method = now.y.size, s.h, s.method
    taken = 0.0
    for j in range(n):
        now.force[j] = -case.constant[j] - load * s.load[j]
    for q in range(now.tau.size):
        tau = now.tau[q] if method.central else 0.5 * (now.tau[q] + now.warm[q])
        for j in range(n):
            now.force[j] += s.coupling[q, j] * tau
    for k in range(n):
        damps = now.v[k] if method.lagged else 0.5 * (now.v[k] + now.free[k])
        if s.couples:
            for j in range(n):
                now.force[j] += s.damping[k, j] * damps
        else:
            now.force[k] += s.damping[0, k] * damps
    for j in range(n):
        taken += 0.5 * h * now.force[j] * (now.v[j] + now.free[j])
    for i in range(now.impulse.size):
        p = now.impulse[i]
        if p > 0.0:
            along = 0.5 * (now.parting[i] + now.speed_before[i] + now.leaving[i] + now.speed[i])
            for j in range(n):
                along -= 0.5 * case.friction * s.tangent[j, i] * (now.v[j] + now.free[j])
            taken += p * along
        if method.spring > 0.0 and not s.compliant:
            taken += method.spring * _spring_gain(s, i, now)
    sums.dissipated += taken
    if method.central:
        _measure(s, now.free, h, now, sums)


@part
def _spring_gain(s: Stepping, i: int, now: Now) -> float:
    """Return the energy that a contact spring of stiffness 1 creates in a step, as in :func:`.contact.contact_gain`."""
    h, theta, begins, ends = s.h, s.method.theta, now.apart[i], now.ahead[i]
    if s.method.central:
        behind = begins - h * now.parting[i]
        return float(0.5 * max(0.0, begins) * (min(0.0, behind) - min(0.0, ends)))
    before, after = max(0.0, begins), max(0.0, ends)
    worked = (theta * after + (1.0 - theta) * before) * (0.5 * h * (now.parting[i] + now.leaving[i]))
    return float(0.5 * (after * after - before * before) - worked)
