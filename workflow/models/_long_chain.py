"""What is asked of a chain that is too long for matrices, in a few sweeps along it."""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.models._chain import Chain


def tip_flexibility(chain: Chain) -> float:
    """Return Σ 1/k_i, m/N; ``inf`` where a spring is broken."""
    return np.sum(1 / chain.springs) if np.all(chain.springs > 0) else float("inf")


def static_tip_growth(chain: Chain) -> Array:
    """Return -e_nᵀ K1⁻¹ K12, m/K, ``(node,)``: the free expansion of the springs up to the tip.

    Where the tip's part is free, a spring that expands by ε moves the tip by ε times the share of
    the part's mass that lies below the spring, as its centre of mass rests.
    """
    broken = np.flatnonzero(chain.springs == 0)
    moves = np.ones(chain.mechanical_size)
    if broken.size:
        first = broken[-1]
        below = np.cumsum(chain.masses[first:])
        moves[: first + 1] = 0.0
        moves[first + 1 :] = below[:-1] / below[-1]
    by_spring = moves * chain.free_expansion / 2
    return np.asarray(by_spring + np.append(by_spring[1:], 0.0))


def critical_alpha(chain: Chain) -> float:
    """Return α_c = S/β, m/s; ``inf`` where heat at the tip does not push it out, 0 where it stays."""
    if np.any(chain.springs == 0):
        return float("inf")
    growth, path = static_tip_growth(chain), chain.thermal.path
    tip = np.zeros(chain.thermal_size)
    tip[-1] = 1.0
    temperature = path.solve(tip)
    if temperature is None:  # heat stays in the tip's part, which it warms evenly in the end
        first = int(np.flatnonzero(chain.conduction == 0)[-1])
        return 0.0 if np.sum(growth[first:]) > 0 else float("inf")
    beta = np.dot(growth, temperature)
    return tip_flexibility(chain) / beta if beta > 0 else float("inf")


def static_equilibrium(chain: Chain, load: Array, heating: Array, gap: float) -> tuple[Array | None, Array | None]:
    """Return displacement and temperature at rest, casing included, each ``None`` where there is none."""
    temperature = chain.thermal.path.solve(heating)
    if temperature is None:
        return None, None
    thermal = chain.spring_forces(temperature)
    force = load - thermal + np.append(thermal[1:], 0.0)
    path = chain.mechanical.path
    free = path.solve(force)
    if free is not None and free[-1] <= gap:
        return free, temperature
    pressing = force[:-1].copy()
    if pressing.size:
        pressing[-1] += chain.springs[-1] * gap
    interior = path.without_tip().solve(pressing)
    if interior is None:
        return None, temperature
    pressed = np.append(interior, gap)
    before = pressed[-2] if pressed.size > 1 else 0.0
    reaction = force[-1] - chain.springs[-1] * (gap - before)
    tolerated = 1e-9 * (abs(force[-1]) + chain.springs[-1] * (abs(gap) + abs(before)))  # as for short chains
    return (pressed if reaction >= -tolerated else None), temperature
