"""The step that ``penalty`` says it holds up to, measured again: contact that comes and goes creates no energy."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest

from scenes import blade, cases, heavy_chain, metal_chain, step, tip_flexibility
from workflow.models import Cases, Structure, critical_alpha, frequencies
from workflow.reduction import reduce_structure
from workflow.schemes import Sampling, Status, penalty
from workflow.schemes._fixed.step_limits import contact_modes, lasting_limit, mobility

CASES, PERIODS, MOST_STEPS = 16, 50, 200_000


def scene(seed: int, **integration: Any) -> tuple[Structure, penalty.Options, Cases, float]:
    """Return a random structure, contact spring and cases that meet it, and the period of the first mode, s."""
    rng = np.random.default_rng(seed)
    structure = _structure(seed % 5, rng)
    stiffness, omega = 1 / tip_flexibility(structure), float(frequencies(structure)[0])
    kappa = stiffness * 10 ** rng.uniform(0, 4.5)
    critical_damping = 2 * np.sqrt(kappa / mobility(contact_modes(structure)))
    damper = float(rng.choice([0, 0, 0.1, 1])) * critical_damping
    options = penalty.Options(stiffness=kappa, damping=damper, **integration)
    alpha = critical_alpha(structure) if np.isfinite(critical_alpha(structure)) else 1.0
    n, x = CASES, 5e-5
    batch = cases(
        structure,
        n,
        gap=rng.uniform(0, 1, n) * x,
        amplitude=stiffness * x * rng.uniform(0.5, 4, n),
        mean=stiffness * x * rng.uniform(0, 2, n) * (rng.random(n) < 0.5),
        frequency=omega / (2 * np.pi) * 10 ** rng.uniform(-1.5, 0.5, n),
        phase=rng.uniform(0, 2 * np.pi, n),
        alpha=np.where(np.arange(n) % 2, 0, alpha * 10 ** rng.uniform(-1, 0.5, n)),
    )
    return structure, options, batch, 2 * np.pi / omega


def _structure(kind: int, rng: np.random.Generator) -> Structure:
    if kind < 3:
        return (heavy_chain(), blade(), reduce_structure(heavy_chain(), 3, 12).structure)[kind]
    n = int(rng.integers(1, 21))
    return metal_chain(rng, n, graded=kind == 3)


def created(seed: int, share: float, **integration: Any) -> float:
    """Return the largest energy residual of a scene at a share of the limit, infinite where a case is lost."""
    structure, options, batch, period = scene(seed, **integration)
    h = share * penalty.contact_limit(structure, replace(options, theta=0.5))
    steps = min(round(PERIODS * period / h), MOST_STEPS)
    results = step(structure, batch, h, Sampling(steps * h, steps * h, 2, balances=True), "penalty", **asdict(options))
    residual = np.where(results.status == Status.OK, results.metrics["energy_residual"], np.inf)
    return float(np.max(residual, initial=-np.inf))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("integration", [{}, {"integration": "implicit", "theta": 0.5}], ids=["explicit", "implicit"])
def test_contact_that_comes_and_goes_creates_no_energy_at_the_limit(seed: int, integration: dict[str, Any]) -> None:
    assert created(seed, 1.0, **integration) < 1.0


@pytest.mark.parametrize("seed", [0, 8, 14])
def test_a_method_that_dissipates_has_no_limit(seed: int) -> None:
    """At θ = 0.75 and thirty times the limit of θ = ½: what begins and ends within a step creates nothing."""
    assert created(seed, 30.0, integration="implicit", theta=0.75) < 0


@pytest.mark.parametrize(("times", "integration"), [(3.9, {}), (30.0, {"integration": "implicit", "theta": 0.5})])
def test_some_times_the_limit_is_too_much(times: float, integration: dict[str, Any]) -> None:
    assert np.median([created(seed, times, **integration) for seed in (0, 5, 10, 15)]) > 1.0


def test_the_limit_is_below_that_of_lasting_contact() -> None:
    structure, stiff, soft = heavy_chain(), penalty.Options(stiffness=2e9), penalty.Options(stiffness=1e5)
    assert lasting_limit(contact_modes(structure), 2e9) == pytest.approx(2.225e-6, rel=1e-3)
    assert penalty.contact_limit(structure, stiff) == pytest.approx(0.5 / np.sqrt(2e9 / 2.5e-3), rel=1e-9)
    assert penalty.contact_limit(structure, soft) == 0.95 * lasting_limit(contact_modes(structure), 1e5)
    implicit = [penalty.Options(stiffness=2e9, integration="implicit", theta=theta) for theta in (0.5, 0.7, 0.75, 1.0)]
    limits = [penalty.contact_limit(structure, options) for options in implicit]
    assert limits == pytest.approx([0.25 / np.sqrt(2e9 / 2.5e-3)] * 2 + [np.inf] * 2, rel=1e-9)
