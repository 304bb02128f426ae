"""The rub of one mass with one impact in n load periods, in closed form (Shaw & Holmes, J. Sound Vib. 90, 1983).

X = [x, v, θ] obeys X' = A X + b sin(Ωt). An impact at t₀ with approach speed v adds p X_1, p = (1+e) m v and
X_1 = [0, -1/m, α/c]; repeated every nT it moves the linear response X_p by v G just before an impact. So

    x_p(t₀) = d - v G_x,   x_p'(t₀) = v (1 - G_v),   (|H| F)² = (d - v G_x)² + (v (1 - G_v)/Ω)².
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm

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
