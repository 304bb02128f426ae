"""An independent solution of the equations of motion, on a casing in motion: DOP853 in physical coordinates.

It shares nothing with the scheme but the matrices of the structure: no modes, no closed forms. It
stops where it can no longer tell events apart (accumulating impacts) and says how far it came.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import plain_casing
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar

from workflow.models import Cases, Harmonics, Structure


@dataclass
class Solution:
    displacement: np.ndarray
    temperature: np.ndarray
    impulse: np.ndarray
    hottest: np.ndarray
    """Largest tip temperature up to each sample."""
    reached: float
    impacts: int


def _waves(harmonics: Harmonics) -> list[tuple[float, float, float]]:
    """Return amplitude, rad/s and phase of the harmonics of the first case."""
    rows = harmonics.amplitude[0], 2 * np.pi * harmonics.frequency[0], harmonics.phase[0]
    return list(zip(*(row.tolist() for row in rows), strict=True))


Rate = Callable[[float, np.ndarray], np.ndarray]


class Reference:
    """The states are y = [x, v, θ, J], J the impulse; y' is linear in them with the tip free, and with the tip held."""

    def __init__(self, s: Structure, cases: Cases) -> None:
        """Take the first case of a batch on a structure."""
        self.nm, self.nt, self.cases = s.mechanical_size, s.thermal_size, cases
        inverse, self.warming = np.linalg.inv(s.mass), np.linalg.inv(s.heat_capacity)
        along = plain_casing.direction(s, cases)
        self.kick = inverse @ along
        held_inverse = np.linalg.inv(np.column_stack([s.mass[:, :-1], along]))  # from forces to [a_i, λ]
        self.e, self.alpha, self.gap = (float(v[0]) for v in (cases.e, cases.alpha, cases.gap))
        self.loads = _waves(cases.load_harmonics)
        self.loads.append((float(cases.amplitude[0]), 2 * math.pi * float(cases.frequency[0]), float(cases.phase[0])))
        self.moves = _waves(cases.casing_harmonics)
        none = np.zeros(self.nm)
        self.free = self._rate(s, inverse, none)
        self.held = self._rate(s, np.vstack([held_inverse[:-1], none]), held_inverse[-1])
        turning = max(w for _, w, _ in self.loads + self.moves)
        fastest = (
            np.sqrt(np.abs(np.linalg.eigvals(inverse @ s.stiffness_matrix)).max())
            + np.abs(np.linalg.eigvals(inverse @ s.damping_matrix)).max()
        )
        self.max_step = 0.25 / max(fastest, turning, 1.0)

    def _rate(self, s: Structure, mobility: np.ndarray, contact: np.ndarray) -> Rate:
        """Return y'(t, y): forces f - C1 v - K1 x - K12 θ times ``mobility`` are v', times ``contact`` λ.

        With the tip held, where λ is not 0, they are less by M_n d'', and the tip's own acceleration is d''.
        """
        n, cases = self.nm, self.cases
        heats = slice(2 * n, 2 * n + self.nt)

        def answers(forces: np.ndarray) -> np.ndarray:
            rates = np.zeros((2 * n + self.nt + 1, *forces.shape[1:]))
            rates[n : 2 * n], rates[-1] = mobility @ forces, contact @ forces
            rates[heats] = np.multiply.outer(self.alpha * self.warming[:, -1], rates[-1])
            return rates

        matrix = np.zeros((2 * n + self.nt + 1,) * 2)
        matrix[:, :-1] = answers(-np.hstack([s.stiffness_matrix, s.damping_matrix, s.coupling_matrix]))
        matrix[:n, n : 2 * n] = np.eye(n)
        matrix[heats, heats] -= self.warming @ s.conductance_matrix
        constant = answers(cases.steady[0] + cases.mean[0] * s.load_direction)
        constant[heats] += self.warming @ cases.heating[0]
        by_load, by_casing = answers(s.load_direction), answers(-s.mass[:, -1])
        by_casing[2 * n - 1] = 1.0
        follows = bool(contact.any() and self.moves)

        def rate(t: float, y: np.ndarray) -> np.ndarray:
            load = sum(a * math.sin(w * t + phi) for a, w, phi in self.loads)
            rates = matrix @ y + (constant + load * by_load)
            return rates + self.casing(t)[2] * by_casing if follows else rates

        return rate

    def casing(self, t: float) -> tuple[float, float, float]:
        """Return d, d' and d''."""
        place, velocity, acceleration = self.gap, 0.0, 0.0
        for a, w, phi in self.moves:
            sin, cos = math.sin(w * t + phi), math.cos(w * t + phi)
            place, velocity, acceleration = place + a * sin, velocity + a * w * cos, acceleration - a * w * w * sin
        return place, velocity, acceleration

    def rate(self, held: bool) -> Rate:
        return self.held if held else self.free

    def signal(self, held: bool, t: float, y: np.ndarray) -> float:
        """Return the contact force, or the open gap."""
        return float(self.held(t, y)[-1] if held else self.casing(t)[0] - y[self.nm - 1])

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
                    y[2 * nm : 2 * nm + nt] += self.alpha * p * self.warming[:, -1]
                    y[-1] += p
                    hottest = max(hottest, y[hot])
                    if self.e == 0 or v <= 0:
                        y[2 * nm - 1] = moving
                        held = self.signal(True, t, y) > 0
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
