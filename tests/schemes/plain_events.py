"""An independent solution of the equations of motion, on a casing in motion: DOP853 in physical coordinates.

It shares nothing with the scheme but the matrices of the structure: no modes, no closed forms. It
stops where it can no longer tell events apart (accumulating impacts) and says how far it came.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plain_casing
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar

from workflow.models import Cases, Structure


@dataclass
class Solution:
    displacement: np.ndarray
    temperature: np.ndarray
    impulse: np.ndarray
    hottest: np.ndarray
    """Largest tip temperature up to each sample."""
    reached: float
    impacts: int


class Reference:
    def __init__(self, s: Structure, cases: Cases) -> None:
        """Take the first case of a batch on a structure."""
        self.M, self.C, self.K = s.mass, s.damping_matrix, s.stiffness_matrix
        self.K12, self.C2, self.K2 = s.coupling_matrix, s.heat_capacity, s.conductance_matrix
        self.nm, self.nt = s.mechanical_size, s.thermal_size
        self.Minv, self.C2inv = np.linalg.inv(self.M), np.linalg.inv(self.C2)
        self.direction = s.load_direction
        self.along = plain_casing.direction(s, cases)
        self.kick = self.Minv @ self.along
        self.held_inv = np.linalg.inv(np.column_stack([self.M[:, :-1], self.along]))  # of [a_i, λ]
        self.e, self.alpha, self.gap = (float(v[0]) for v in (cases.e, cases.alpha, cases.gap))
        self.cases = cases
        loads, casing = cases.load_harmonics, cases.casing_harmonics
        self.loads = [(cases.amplitude[0], cases.frequency[0], cases.phase[0])]
        self.loads += list(zip(loads.amplitude[0], loads.frequency[0], loads.phase[0], strict=True))
        self.moves = list(zip(casing.amplitude[0], casing.frequency[0], casing.phase[0], strict=True))
        turning = max(2 * np.pi * f for _, f, _ in self.loads + self.moves)
        fastest = (
            np.sqrt(np.abs(np.linalg.eigvals(self.Minv @ self.K)).max())
            + np.abs(np.linalg.eigvals(self.Minv @ self.C)).max()
        )
        self.max_step = 0.25 / max(fastest, turning, 1.0)

    def force(self, t: float) -> np.ndarray:
        load = self.cases.mean[0] + sum(a * np.sin(2 * np.pi * w * t + phi) for a, w, phi in self.loads)
        return np.asarray(self.cases.steady[0] + load * self.direction)

    def casing(self, t: float) -> np.ndarray:
        """Return d, d' and d''."""
        motion = np.array([self.gap, 0.0, 0.0])
        for a, f, phi in self.moves:
            w = 2 * np.pi * f
            psi = w * t + phi
            motion += a * np.sin(psi), a * w * np.cos(psi), -a * w * w * np.sin(psi)
        return motion

    def split(self, y):
        nm = self.nm
        return y[:nm], y[nm : 2 * nm], y[2 * nm : 2 * nm + self.nt]

    def contact_force(self, t: float, y: np.ndarray) -> tuple[float, np.ndarray]:
        x, v, theta = self.split(y)
        internal = self.force(t) - self.C @ v - self.K @ x - self.K12 @ theta
        a = self.held_inv @ (internal - self.M[:, -1] * self.casing(t)[2])
        force, a[-1] = float(a[-1]), self.casing(t)[2]
        return force, a

    def rate(self, held: bool):
        def fun(t, y):
            x, v, theta = self.split(y)
            if held:
                lam, a = self.contact_force(t, y)
            else:
                lam = 0.0
                a = self.Minv @ (self.force(t) - self.C @ v - self.K @ x - self.K12 @ theta)
            heat = self.cases.heating[0] - self.K2 @ theta
            heat = heat.copy()
            heat[-1] += self.alpha * lam
            return np.concatenate([v, a, self.C2inv @ heat, [lam]])

        return fun

    def signal(self, held: bool, t, y) -> float:
        return self.contact_force(t, y)[0] if held else float(self.casing(t)[0] - self.split(y)[0][-1])

    def solve(self, times: np.ndarray, most_impacts: int = 50) -> Solution:
        c, nm, nt = self.cases, self.nm, self.nt
        y = np.concatenate([c.displacement[0], c.velocity[0], c.temperature[0], [0.0]])
        out = np.full((times.size, 4), np.nan)
        hot = 2 * nm + nt - 1
        hottest = y[hot]
        out[0] = y[nm - 1], y[hot], 0.0, hottest
        k, t, impacts, held = 1, 0.0, 0, False
        fresh = y[nm - 1] >= self.casing(0.0)[0]  # starts at the casing
        just = fresh and y[2 * nm - 1] >= self.casing(0.0)[1]
        last_event = -np.inf
        end = times[-1]
        while t < end:
            if just:
                just = False
                if t - last_event < 4 * self.max_step and last_event > 0 and 0 < self.e < 1:
                    break  # accumulating
                last_event = t
                if held:
                    held = False
                else:
                    place, moving, _ = self.casing(t)
                    v = y[2 * nm - 1] - moving
                    y[nm - 1] = place
                    w = self.kick
                    p = (1 + self.e) * max(v, 0.0) / w[-1]
                    impacts += v > 0
                    if impacts > most_impacts:
                        break
                    y[nm : 2 * nm] -= p * w
                    y[2 * nm : 2 * nm + nt] += self.alpha * p * self.C2inv[:, -1]
                    y[-1] += p
                    hottest = max(hottest, y[hot])
                    if self.e == 0 or v <= 0:
                        y[2 * nm - 1] = moving
                        held = self.contact_force(t, y)[0] > 0
                fresh = True
            solver = DOP853(self.rate(held), t, y, end, rtol=1e-12, atol=1e-14, max_step=self.max_step)
            if fresh and not held:
                solver.h_abs = min(solver.h_abs, 1e-2 * self.max_step)
            while solver.status == "running":
                y_old = solver.y.copy()
                t_old = solver.t
                solver.step()
                dense = solver.dense_output()
                grid = np.linspace(t_old, solver.t, 5)[1:]
                values = [self.signal(held, s, dense(s)) for s in grid[:-1]] + [self.signal(held, solver.t, solver.y)]
                hit = next((i for i, s in enumerate(values) if s < 0), None)
                if hit is not None and fresh and hit == 0 and t_old == t:
                    return Solution(*out.T, t, impacts)  # cannot tell
                t_new, y_new = solver.t, solver.y
                if hit is not None:
                    low = grid[hit - 1] if hit else t_old
                    g = lambda s, d=dense, h=held: self.signal(h, s, d(s))  # noqa: E731
                    if g(low) <= 0:
                        return Solution(*out.T, t, impacts)
                    t_new = brentq(g, low, grid[hit], xtol=1e-15, rtol=1e-15)
                    y_new = y_old
                    for _ in range(3):  # integrate to the event again and correct: dense output is coarse
                        y_new = self.run(held, t_old, y_old, t_new)
                        s = self.signal(held, t_new, y_new)
                        eps = 1e-6 * self.max_step
                        slope = (self.signal(held, t_new + eps, y_new + eps * self.rate(held)(t_new, y_new)) - s) / eps
                        t_new -= s / slope
                    y_new = self.run(held, t_old, y_old, t_new)
                left = t_old
                while k < times.size and times[k] < t_new:
                    y_k = self.run(held, t_old, y_old, times[k])
                    hottest = max(hottest, y_k[hot], self.warmest(dense, left, times[k], hottest))
                    out[k] = y_k[nm - 1], y_k[hot], y_k[-1], hottest
                    left = times[k]
                    k += 1
                hottest = max(hottest, y_new[hot], self.warmest(dense, left, t_new, hottest))
                t, y = t_new, y_new
                fresh = False
                if hit is not None:
                    just = True
                    break
        if k < times.size and t >= end:
            out[k] = y[nm - 1], y[hot], y[-1], hottest
        return Solution(*out.T, t, impacts)

    def warmest(self, dense, left: float, right: float, largest: float) -> float:
        """Return the largest tip temperature of a step's interpolant between two instants, or one below the known."""
        at, index = np.linspace(left, right, 9), 2 * self.nm + self.nt - 1
        values = dense(at)[index]
        i = int(np.argmax(values))
        if values[i] + np.ptp(values) < largest:  # it bends little within a step
            return values[i]
        around = at[max(i - 1, 0)], at[min(i + 1, 8)]
        top = minimize_scalar(lambda s: -dense(s)[index], bounds=around, method="bounded")
        return max(values[i], -top.fun)

    def run(self, held, t0, y0, t1):
        if t1 <= t0:
            return y0.copy()
        s = DOP853(self.rate(held), t0, y0, t1, rtol=1e-12, atol=1e-14)
        while s.status == "running":
            s.step()
        return s.y
