"""The rub of one mass with one impact in n load periods, in closed form (Shaw & Holmes, J. Sound Vib. 90, 1983).

X = [x, v, θ] obeys X' = A X + b sin(Ωt). An impact at t₀ with approach speed v adds p X_1, p = (1+e) m v and
X_1 = [0, -1/m, α/c]; repeated every nT it moves the linear response X_p by v G just before an impact. So

    x_p(t₀) = d - v G_x,   x_p'(t₀) = v (1 - G_v),   (|H| F)² = (d - v G_x)² + (v (1 - G_v)/Ω)².
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar

from scenes import cases, chain
from workflow.models import Cases, Rayleigh, Structure


@dataclass(frozen=True)
class OneImpact:
    """A mass of 1 g on a spring of 1e5 N/m with heat, a load of some frequency, and the rub of n load periods."""

    gap: float
    e: float
    damping: float
    frequency: float
    alpha: float
    expansion: float
    conductance: float
    periods: int = 1

    mass, stiffness = 1e-3, 1e5

    @property
    def structure(self) -> Structure:
        return chain(
            nodes=1, mass=self.mass, stiffness=self.stiffness, damping=Rayleigh(self.damping, 0.0), spacing=1.0,
            expansion=self.expansion, heat_capacity=1.0, conductance=self.conductance,
        )  # fmt: skip

    def scene(self, structure: Structure, force: float) -> Cases:
        values = {"gap": self.gap, "e": self.e, "alpha": self.alpha, "frequency": self.frequency}
        return cases(structure, amplitude=force, **values)

    @cached_property
    def matrix(self) -> np.ndarray:
        k, m = self.stiffness, self.mass
        warm = 0.5 * k * self.expansion / m
        return np.array([[0, 1, 0], [-k / m, -self.damping, warm], [0, 0, -self.conductance]])

    @cached_property
    def omega(self) -> float:
        return 2 * np.pi * self.frequency

    @cached_property
    def span(self) -> float:
        return self.periods / self.frequency

    @cached_property
    def response(self) -> complex:
        """H of x_p = Im(H F exp(iΩt))."""
        return complex(np.linalg.solve(1j * self.omega * np.eye(3) - self.matrix, [0, 1 / self.mass, 0])[0])

    @cached_property
    def moved(self) -> np.ndarray:
        """G: the change of the state just before an impact, over v."""
        jump = (1 + self.e) * self.mass * np.array([0, -1 / self.mass, self.alpha])
        once = expm(self.matrix * self.span)
        return np.linalg.solve(np.eye(3) - once, once @ jump)

    @property
    def grazing(self) -> float:
        """Amplitude at which the linear response grazes."""
        return self.gap / abs(self.response)

    def start(self, v: float) -> tuple[float, float]:
        """Place and velocity of the linear response at an impact with approach speed v."""
        return self.gap - v * self.moved[0], v * (1 - self.moved[1])

    def force(self, v: float) -> float:
        """Amplitude of the load with which impacts have the approach speed v."""
        place, speed = self.start(v)
        return float(np.hypot(place, speed / self.omega) / abs(self.response))

    @property
    def fold(self) -> float:
        """Approach speed at the least amplitude; none where negative."""
        part = (1 - self.moved[1]) / self.omega
        return float(self.gap * self.moved[0] / (self.moved[0] ** 2 + part**2))

    def derivative(self, v: float) -> np.ndarray:
        """DPⁿ from just after an impact, by its saltation matrix."""
        place, speed = self.start(v)
        turn = np.arctan2(place, speed / self.omega)  # of x_p = |H| F sin(turn) at the impact
        load = self.force(v) * np.sin(turn - np.angle(self.response))
        before = np.array([self.gap, v, v * self.moved[2]])
        jump = (1 + self.e) * np.array([0, -1, self.mass * self.alpha])
        push = np.array([0, load / self.mass, 0])
        law = np.eye(3) + np.outer(jump, [0, 1, 0])
        late = self.matrix @ (law @ before) + push - law @ (self.matrix @ before + push)
        return np.asarray(expm(self.matrix * self.span) @ (law + np.outer(late, [1, 0, 0]) / v))

    def doubling_test(self, v: float) -> float:
        return float(np.linalg.det(np.eye(3) + self.derivative(v)))

    def doublings(self, low: float, high: float) -> list[float]:
        """Approach speeds between two at which the period doubles."""
        tried = np.geomspace(max(low, 1e-6 * high), high, 2000)
        values = [self.doubling_test(v) for v in tried]
        return [
            brentq(self.doubling_test, tried[i], tried[i + 1], xtol=1e-15, rtol=1e-14)
            for i in range(len(tried) - 1)
            if values[i] * values[i + 1] < 0
        ]

    def clearance(self, v: float) -> float:
        """Least gap between two impacts, away from them."""
        place, speed = self.start(v)
        turn, size = np.arctan2(place, speed / self.omega), self.force(v) * abs(self.response)
        jump = (1 + self.e) * np.array([0, -1, self.mass * self.alpha])
        after = v * (self.moved + jump)  # less the linear response
        times = np.linspace(0, self.span, 400 * self.periods + 1)

        def gap(t: float) -> float:
            free = expm(self.matrix * t) @ after
            return float(self.gap - free[0] - size * np.sin(turn + self.omega * t))

        gaps = np.array([gap(t) for t in times])
        least = [i for i in range(1, len(times) - 1) if gaps[i] <= gaps[i - 1] and gaps[i] <= gaps[i + 1]]
        options = {"xatol": 1e-12 * self.span}
        found = [
            minimize_scalar(
                gap, (times[i - 1], times[i + 1]), (times[i - 1], times[i + 1]), method="bounded", options=options
            )
            for i in least
        ]
        return min((float(one.fun) for one in found), default=np.inf)


def random_one(seed: int) -> OneImpact:
    """Return a scene whose linear response grazes between 4 and 25 N, every second with heat."""
    random = np.random.default_rng(seed)
    warm = seed % 2
    scene = OneImpact(
        gap=1.0,
        e=float(random.choice([0.0, 0.3, 0.5, 0.8])),
        damping=float(10 ** random.uniform(2.3, 3.5)),
        frequency=float(random.uniform(800, 4000)),
        alpha=warm * float(random.uniform(0.1, 1)),
        expansion=warm * float(10 ** random.uniform(-4, -2.5)),
        conductance=float(random.uniform(30, 300)),
        periods=1 + int(seed % 4 == 3),
    )
    return OneImpact(**{**scene.__dict__, "gap": float(random.uniform(4, 25)) * abs(scene.response)})
