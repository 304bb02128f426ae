"""The step up to which explicit ``penalty`` holds where friction drives what the tip is tied to.

The casing's drive does work, so that an energy balance does not tell what a scheme creates: how far the tip comes is
set beside how far it comes at an eighth of the step.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import NamedTuple

import numpy as np
import pytest

from scenes import cases, step
from sliding import structure
from workflow.models import Cases, Rayleigh, Structure, critical_friction, frequencies, tip_flexibility
from workflow.schemes import Sampling, Status, penalty
from workflow.schemes._fixed.step_limits import lasting_limit, tip_modes

CASES, PERIODS, MOST_STEPS, LENGTH = 16, 50, 200_000, 5e-5

ASIDE = 5
"""A scene in which W is 9.4 times what it is without friction."""


class Scene(NamedTuple):
    structure: Structure
    options: penalty.Options
    batch: Cases
    period: float
    friction: float
    limit: float


def _definite(rng: np.random.Generator, n: int, scale: float, decades: float) -> np.ndarray:
    root, grade = rng.normal(size=(n, n)), 10 ** rng.uniform(-decades, 0, n)
    return scale * (root @ root.T / n + 0.05 * np.eye(n)) * np.sqrt(grade[:, None] * grade)


def scene(seed: int) -> Scene:
    """A random structure without symmetry, its masses over two decades, whose pressed tip oscillates on its spring."""
    rng = np.random.default_rng(seed)
    while True:
        n = int(rng.integers(2, 9))
        mass, stiffness = _definite(rng, n, 0.05, 2), _definite(rng, n, 2e3, 1)
        tangent, normal, friction = rng.normal(size=n), np.eye(n)[-1], float(rng.uniform(0.1, 1))
        tangent[-1] = 0
        damping = Rayleigh(float(rng.choice([0, 0.5])), float(rng.choice([0, 1e-4])))
        built = structure(mass, stiffness, tangent, damping)
        flexibility, kappa = tip_flexibility(built), 10 ** rng.uniform(0, 4.5) / tip_flexibility(built)
        spring = kappa * np.outer(normal - friction * built.tangent, normal)
        squares = np.linalg.eigvals(np.linalg.solve(built.mass, built.stiffness_matrix + spring))
        if friction < min(critical_friction(built)) and np.isreal(squares).all() and squares.real.min() > 0:
            break
    mobility, omega = np.linalg.inv(built.mass)[-1, -1], float(frequencies(built)[0])
    damper = float(rng.choice([0, 0, 0.1, 1])) * 2 * np.sqrt(kappa / mobility)
    batch = cases(
        built,
        CASES,
        gap=rng.uniform(0, 1, CASES) * LENGTH,
        amplitude=LENGTH / flexibility * rng.uniform(0.5, 4, CASES),
        mean=LENGTH / flexibility * rng.uniform(0, 2, CASES) * (rng.random(CASES) < 0.5),
        frequency=omega / (2 * np.pi) * 10 ** rng.uniform(-1.5, 0.5, CASES),
        phase=rng.uniform(0, 2 * np.pi, CASES),
        friction=friction,
    )
    options = penalty.Options(stiffness=kappa, damping=damper)
    limit = penalty.contact_limit(built, options, friction)
    return Scene(built, options, batch, 2 * np.pi / omega, friction, limit)


def farthest(of: Scene, share: float) -> np.ndarray:
    """How far the tip comes at a share of the limit, m, ``(case,)``; infinite where a case is lost."""
    duration = min(PERIODS * of.period, MOST_STEPS * of.limit / 8)
    h = share * of.limit
    steps = round(duration / h)
    over = Sampling(steps * h, steps * h / 1000, 1001)
    results = step(of.structure, of.batch, h, over, "penalty", **asdict(of.options))
    return np.where(results.status == Status.OK, np.abs(results.histories["displacement"]).max(axis=1), np.inf)


def times_as_far(of: Scene, share: float) -> float:
    """How many times as far a case comes at most as at an eighth."""
    return float(np.max(farthest(of, share) / farthest(of, 1 / 8)))


@pytest.mark.parametrize("seed", [0, 9, ASIDE])
def test_sliding_contact_that_comes_and_goes_stays_near_at_the_limit(seed: int) -> None:
    """In scenes that friction itself does not throw off; of 99 such scenes of 120 the largest is 1.84."""
    assert times_as_far(scene(seed), 1.0) < 2


def test_the_limit_of_a_casing_that_does_not_slide_is_none_of_one_that_does() -> None:
    of = scene(ASIDE)
    assert times_as_far(of, penalty.contact_limit(of.structure, of.options) / of.limit) > 1e3


def test_the_limits_are_those_of_the_matrices() -> None:
    of, soft = scene(ASIDE), penalty.Options(stiffness=1.0)
    normal = np.eye(of.structure.mechanical_size)[-1]
    push = normal - of.friction * of.structure.tangent
    yields = normal @ np.linalg.solve(of.structure.mass, push)
    assert of.limit == pytest.approx(0.5 / np.sqrt(of.options.stiffness * yields), rel=1e-9)
    for options in (of.options, soft):
        stiffness = of.structure.stiffness_matrix + options.stiffness * np.outer(push, normal)
        fastest = np.abs(np.linalg.eigvals(np.linalg.solve(of.structure.mass, stiffness))).max()
        lasting = lasting_limit(tip_modes(of.structure, of.friction), options.stiffness)
        assert lasting == pytest.approx(2 / np.sqrt(fastest), rel=1e-9)
    assert penalty.contact_limit(of.structure, soft, of.friction) == 0.95 * lasting
