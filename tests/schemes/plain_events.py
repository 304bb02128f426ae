"""An independent solution of the equations of motion, on a casing in motion, in 80-bit arithmetic.

Load and casing are sums of sinusoids; with these, a constant 1 and the impulse J among the states y = [r, v, θ, J, 1,
sines, cosines] the tip moves by y' = A y while it is free, and by another A while it is held. The tip's place and
velocity are those relative to the casing, r = x_n - d and u = v_n - d', so that a gap keeps its digits however small it
is. Steps take exp(A τ) - 1 for τ, τ/2, τ/4 …, which come from the shortest by (1 + F)² - 1 = F² + 2 F; a step in which
something happens is halved until it is the shortest.

It shares nothing with the scheme but the matrices of the structure: no modes, no closed forms, no bounds. It stops
where events cannot be predicted (a tip that grazes, impacts that accumulate) and says how far it came.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from workflow.models import Array, Cases, Harmonics, Structure

Long = np.longdouble
HALVINGS = 52
GRAZES = 1e-3
"""Share of the largest approach speed so far below which an impact amplifies errors too much."""


@dataclass
class Solution:
    displacement: Array
    velocity: Array
    temperature: Array
    impulse: Array
    hottest: Array
    """Largest tip temperature up to each sample."""
    reached: float
    impacts: int
    places: Array
    warmth: Array
    """Displacements and temperatures of all nodes, ``(node, t)``."""


class Phase(NamedTuple):
    """Tip free or held: exp(A τ) - 1 of the steps from the shortest to the longest, and what is watched.

    Rows are the open gap, or the contact force, that ends the phase where it falls through 0, the tip's temperature,
    and the rates of both.
    """

    steps: list[Array]
    rows: Array


def inverse(matrix: Array) -> Array:
    """Return the inverse in 80 bits, by Newton's method from that in 64."""
    matrix, one = matrix.astype(Long), np.eye(len(matrix), dtype=Long)
    result = np.linalg.inv(matrix.astype(float)).astype(Long)
    for _ in range(3):
        result = result + result @ (one - matrix @ result)
    return result


def _waves(harmonics: Harmonics) -> list[tuple[float, float, float]]:
    """Return amplitude, Hz and phase of the harmonics of the first case."""
    return list(zip(*(row[0].tolist() for row in harmonics.rows), strict=True))


class Reference:
    """The motion of the first case of a batch on a structure."""

    def __init__(self, s: Structure, cases: Cases) -> None:
        """Take the equations as they stand."""
        self.s, self.cases = s, cases
        self.nm, self.nt = s.mechanical_size, s.thermal_size
        loads, moves = _waves(cases.load_harmonics), _waves(cases.casing_harmonics)
        waves = [(a, 0.0, f, phi) for a, f, phi in loads] + [(0.0, a, f, phi) for a, f, phi in moves]
        by_load, by_casing, frequency, phase = np.array(waves, dtype=Long).T
        first, turning = 2 * self.nm + self.nt + 2, 8 * np.arctan(Long(1)) * frequency
        count = len(waves)
        sines, cosines = first + np.arange(count), first + count + np.arange(count)
        one = np.eye(first + 2 * count, dtype=Long)
        self.constant = one[first - 1]
        self.load = float(cases.mean[0]) * self.constant + by_load @ one[sines]
        self.turns = np.zeros_like(one)
        self.turns[sines, cosines], self.turns[cosines, sines] = turning, -turning
        self.casing = float(cases.gaps[0, 0]) * self.constant + by_casing @ one[sines]
        self.moving = self.casing @ self.turns
        self.x, self.v = one[: self.nm].copy(), one[self.nm : 2 * self.nm].copy()
        self.theta = one[2 * self.nm : first - 2]
        self.x[-1] += self.casing
        self.v[-1] += self.moving
        self.mobility, self.warming = inverse(s.mass), inverse(s.heat_capacity)
        contact = s.contacts
        self.along = (contact.normal - cases.friction[0] * contact.tangent)[0]
        rate = np.linalg.eigvals((self.mobility @ s.stiffness_matrix).astype(float))
        fastest = np.sqrt(np.abs(rate).max()) + np.abs(self.mobility @ s.damping_matrix).max()
        self.longest = 0.12 / float(max(fastest, turning.max(), 1e-3))
        self.start = np.concatenate(
            [cases.displacement[0], cases.velocity[0], cases.temperature[0], [0, 1], np.sin(phase), np.cos(phase)]
        ).astype(Long)
        self.start[self.nm - 1] -= self.casing @ self.start
        self.start[2 * self.nm - 1] -= self.moving @ self.start

    def phase(self, held: bool, step: float) -> Phase:
        """Return the motion with the tip free, or held on the casing."""
        s, c, n, heats = self.s, self.cases, self.nm, slice(2 * self.nm, 2 * self.nm + self.nt)
        forces = np.outer(c.steady[0], self.constant) + np.outer(s.load_direction, self.load)
        forces = forces - s.stiffness_matrix @ self.x - s.damping_matrix @ self.v - s.coupling_matrix @ self.theta
        rates, follows = self.turns.copy(), self.moving @ self.turns
        rates[:n], force = self.v, 0 * self.constant
        rates[n - 1] -= self.moving
        if held:  # M_i a_i + (e_n - µt) λ = forces - M_n d''
            answers = inverse(np.column_stack([s.mass[:, :-1], self.along])) @ (
                forces - np.outer(s.mass[:, -1], follows)
            )
            rates[n : 2 * n - 1], force = answers[:-1], answers[-1]
            rates[n - 1] = 0
        else:
            rates[n : 2 * n] = self.mobility @ forces
            rates[2 * n - 1] -= follows
        flows = np.outer(c.heating[0], self.constant) - s.conductance_matrix @ self.theta
        flows[-1] += c.alpha[0] * force
        rates[heats], rates[heats.stop] = self.warming @ flows, force
        gap, hot = -np.eye(len(rates), dtype=Long)[n - 1], self.theta[-1]
        watched = force if held else gap
        small = rates * (Long(step) / 2**HALVINGS)
        steps = [small @ (np.eye(len(rates), dtype=Long) + small @ (np.eye(len(rates)) + small / 3) / 2)]
        for _ in range(HALVINGS):
            steps.append(steps[-1] @ steps[-1] + 2 * steps[-1])
        return Phase(steps, np.array([watched, watched @ rates, hot, hot @ rates]))

    def solve(self, times: Array, most_impacts: int = 50) -> Solution:
        """Return the tip's motion at evenly spaced times from 0."""
        n, tip, speed = self.nm, self.nm - 1, 2 * self.nm - 1
        parts = int(np.ceil((times[1] - times[0]) / self.longest))
        step = (Long(times[-1]) - Long(times[0])) / ((times.size - 1) * parts)
        phases, held = [self.phase(held, step) for held in (False, True)], False
        kick = self.mobility @ self.along
        per_sample, shortest = parts << HALVINGS, step / 2**HALVINGS
        y, now, impacts, fastest = self.start, 0, 0, Long(0)
        out = np.full((5, times.size), np.nan)
        places, warmth = (np.full((size, times.size), np.nan) for size in (self.nm, self.nt))
        hottest, strikes = y[2 * n + self.nt - 1], y[tip] >= 0 and y[speed] >= 0
        struck, at_once, left = -1, 0, 20 * parts * times.size
        while left:
            left -= 1
            if now % per_sample == 0:
                x, v = self.x[-1] @ y, self.v[-1] @ y
                places[:, now // per_sample], warmth[:, now // per_sample] = self.x @ y, self.theta @ y
                out[:, now // per_sample] = x, v, y[2 * n + self.nt - 1], y[2 * n + self.nt], hottest
                if now == (times.size - 1) * per_sample:
                    break
            if strikes:
                at_once = at_once + 1 if struck == now else 0
                struck = now
                if at_once > most_impacts:  # neither flies nor stays: a contact force of 0 but for rounding
                    break
                if held:
                    held = False
                else:
                    approach = y[speed]
                    fastest = max(fastest, approach)
                    impacts += approach > 0
                    p = (1 + self.cases.e[0]) * approach / kick[-1]
                    y = y.copy()
                    y[n : 2 * n] -= p * kick
                    y[2 * n : 2 * n + self.nt] += self.cases.alpha[0] * p * self.warming[:, -1]
                    y[2 * n + self.nt] += p
                    y[tip], y[speed] = 0, -self.cases.e[0] * approach
                    hottest = max(hottest, y[2 * n + self.nt - 1])
                    held = y[speed] == 0 and phases[1].rows[0] @ y > 0
                    grazes = 0 < approach < GRAZES * fastest and not held
                    if grazes or impacts > most_impacts:
                        break
            phase = phases[int(held)]
            watched, rate, hot, warms = phase.rows @ y
            size = min((now & -now).bit_length() - 1, HALVINGS) if now else HALVINGS
            while True:
                after = y + phase.steps[size] @ y
                later, later_rate, later_hot, later_warms = phase.rows @ after
                length = shortest * 2**size
                dips = rate < 0 < later_rate and watched + length * rate < 0
                peaks = warms > 0 > later_warms and hot + length * warms > hottest
                strikes = later < 0
                if size == 0 or not (strikes or dips or peaks):
                    break
                size -= 1
            if not strikes or held:
                y, now, hottest = after, now + 2**size, max(hottest, later_hot)
        return Solution(*out, float(now * shortest), impacts, places, warmth)
