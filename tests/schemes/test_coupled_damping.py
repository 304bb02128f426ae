"""The exact scheme on structures whose modes damping couples, tip free and tip held; fixed steps: ``test_damping``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray
from test_event_driven_random import against_reference, compare, moving_scene, scene

from given_matrices import given
from scenes import cases, chain, sampling, with_dashpot
from workflow.models import Array, Matrices, Rayleigh, Structure, structure_from_matrices
from workflow.schemes._exact.modal_system import free_system, held_system, state_space

OVER = sampling(8.0, 0.1)


def random_damper(rng: np.random.Generator, size: int) -> Array:
    """A positive semi-definite matrix: full, of one dashpot, of rank one, or diagonal, up to strongly overdamped."""
    kind, strength = rng.integers(0, 4), float(rng.choice([0.05, 0.5, 5.0]))
    if kind == 0:
        root = rng.normal(size=(size, size))
        return strength * root @ root.T / size
    if kind == 1:
        at, other = rng.choice(size, 2, replace=False)
        along = np.eye(size)[at] - np.eye(size)[other]
        return strength * np.outer(along, along)
    along = rng.normal(size=size)
    return strength * (np.outer(along, along) if kind == 2 else np.diag(rng.uniform(0, 1, size)))


def compare_seed(seed: int) -> int:
    """Compare a random scene as far as it can be predicted and return its number of impacts."""
    rng = np.random.default_rng(seed)
    structure, case = (moving_scene if seed % 3 == 0 else scene)(rng)
    while structure.mechanical_size < 2:
        structure, case = scene(rng)
    damper = random_damper(rng, structure.mechanical_size)
    return compare(replace(structure.matrices(), damper=damper), case, OVER, 1e-9)


def test_random_scenes() -> None:
    """Restitution 0 to 1, with and without heat, permanent contact, casings that move; also loose parts."""
    assert sum(compare_seed(seed) for seed in (2, 4, 11, 27, 54)) > 20


@pytest.mark.slow
def test_a_hundred_random_scenes() -> None:
    assert sum(compare_seed(seed) for seed in range(100)) > 500


HEAT = {"spacing": 1.0, "expansion": 0.1, "conductance": 0.5, "convection": 0.1}


def branches(stiffness: float, mass: float) -> Matrices:
    """Two branches on a tip, one of them this, with a damping ratio of every mode with the tip free."""
    tied = np.array([[100.0, 0.0, -100.0], [0.0, stiffness, -stiffness], [-100.0, -stiffness, 150.0 + stiffness]])
    line = chain(nodes=3, mass=1.0, stiffness=1.0, **HEAT)
    inertia = np.diag([1.0, mass, 1.0])
    return structure_from_matrices(given(line, mass=inertia, stiffness=tied, damping=Rayleigh(ratio=0.3)))


def held_poles(structure: Structure) -> NDArray[np.complex128]:
    """Return the poles of two branches with the tip held, one of each pair."""
    poles = np.linalg.eigvals(state_space(held_system(structure), 0.0)[0][:4, :4])
    return poles[poles.imag > 0]


@pytest.mark.parametrize("alpha", [0.0, 0.3])
def test_held_poles_that_a_damping_ratio_makes_coincide(alpha: float) -> None:
    """Poles part as the root of what is changed: a relative 1e-6 of themselves is rounding of a double one."""

    def apart(place: Array) -> list[float]:
        one, other = held_poles(branches(*place))
        return [((one - other) ** 2).real, ((one - other) ** 2).imag]

    structure = branches(*scipy.optimize.root(apart, [108.7, 0.942], tol=1e-16).x)
    one, other = held_poles(structure)
    assert abs(one - other) < 1e-6 * abs(one)
    rub = cases(structure, e=0.5, alpha=alpha, gap=0.5, mean=60.0, amplitude=30.0, frequency=0.3)
    assert against_reference(structure, rub, OVER) <= 1e-10


@pytest.mark.parametrize("held", [False, True])
def test_a_pole_that_is_a_thermal_rate(held: bool) -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=(1.0, 2.0, 1.5), **HEAT).matrices()
    damped = with_dashpot(structure, 0, None, 9.0)
    system = (held_system if held else free_system)(damped)
    poles = np.linalg.eigvals(state_space(system, 0.0)[0][: 2 * system.frequency.size, : 2 * system.frequency.size])
    rate = -poles[poles.imag == 0].real.max()
    slowed = replace(damped.thermal, inertia=damped.heat_capacity * (system.rate[1] / rate))
    at = replace(damped, thermal=slowed)
    rub = cases(at, e=0.5, alpha=0.0, gap=0.2, mean=0.5, amplitude=0.4, frequency=0.1, temperature=1.0)
    assert against_reference(at, rub, OVER) <= 1e-10


def test_damping_that_feeds_a_real_pole() -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=(1.0, 2.0, 1.5)).matrices()
    fed = replace(structure, damper=np.diag([-9.0, 0.0, 5.0]))
    poles = np.linalg.eigvals(state_space(free_system(fed), 0.0)[0])
    assert (poles.real > 0)[poles.imag == 0].any()
    rub = cases(fed, e=0.5, gap=0.2, mean=0.5, amplitude=0.4, frequency=0.1)
    assert against_reference(fed, rub, OVER) <= 1e-10
