"""A chain without matrices: what a few sweeps along it give against singular values and least squares."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes import chain, heavy_chain, static_equilibrium, tip_flexibility
from workflow import models
from workflow.models import (
    Chain,
    NoEquilibriumError,
    TooManyCoordinatesError,
    critical_alpha,
    frequencies,
    mechanical_modes,
    rates,
    static_growth,
    thermal_modes,
)
from workflow.models.chain import ChainPair


@st.composite
def chains(draw: st.DrawFn, broken: bool = True) -> Chain:
    """A chain of uneven lumps; springs and conductors may be missing."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    n = draw(st.integers(1, 12))

    def some(values: np.ndarray, missing: float) -> np.ndarray:
        return np.where(rng.random(n) < (missing if broken else 0.0), 0.0, values)

    return chain(
        nodes=n,
        mass=rng.uniform(0.5, 2.0, n),
        stiffness=some(rng.uniform(1.0, 6.0, n), draw(st.sampled_from([0.0, 0.3]))),
        spacing=1.0,
        expansion=rng.uniform(0.01, 0.1, n),
        heat_capacity=rng.uniform(0.5, 2.0, n),
        conductance=some(rng.uniform(0.1, 1.0, n), draw(st.sampled_from([0.0, 0.3]))),
        convection=rng.uniform(0.0, 0.2, n) * (rng.random(n) < draw(st.sampled_from([0.0, 0.3]))),
    )


@settings(max_examples=100, deadline=None, derandomize=True)
@given(chains())
def test_static_figures(structure: Chain) -> None:
    by_modes = structure.matrices()
    assert tip_flexibility(structure) == pytest.approx(tip_flexibility(by_modes), rel=1e-12)
    growth = static_growth(by_modes)
    assert np.abs(static_growth(structure) - growth).max() <= 1e-13 * max(1.0, np.abs(growth).max())
    assert critical_alpha(structure) == pytest.approx(critical_alpha(by_modes), rel=1e-10)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(chains(), st.integers(0, 10**6))
def test_equilibrium(structure: Chain, seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = structure.mechanical_size
    load, heating, gap = rng.normal(size=n), rng.normal(size=n) * rng.integers(0, 2), rng.uniform(-0.1, 0.3)
    try:
        expected = static_equilibrium(structure.matrices(), load, heating, gap)
    except NoEquilibriumError:
        with pytest.raises(NoEquilibriumError):
            static_equilibrium(structure, load, heating, gap)
        return
    for ours, theirs in zip(static_equilibrium(structure, load, heating, gap), expected, strict=True):
        assert np.abs(ours - theirs).max() <= 1e-10 * max(1.0, np.abs(theirs).max())


@settings(max_examples=60, deadline=None, derandomize=True)
@given(chains())
def test_ends_of_the_spectrum(structure: Chain) -> None:
    omega, mu = mechanical_modes(structure).values, thermal_modes(structure).values
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("workflow.models.chain.MOST_FULL", 0)
        patch.setattr("workflow.models.chain.MOST_BY_JACOBI", 0)
        assert frequencies(structure) == pytest.approx(omega[[0, -1]], rel=1e-12)
        assert rates(structure) == pytest.approx(mu[[0, -1]], rel=1e-12)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(chains(), st.integers(0, 11))
def test_modes_of_a_path(structure: Chain, kept: int) -> None:
    """Orthonormal, and each solves its eigenvalue problem: also double ones, and those of loose parts."""
    kept = min(kept, structure.thermal_size - 1)
    modes = structure.thermal.lowest(kept + 1)
    gram = modes.shapes.T @ (structure.heat_capacities[:, None] * modes.shapes)
    assert np.abs(gram - np.eye(kept + 1)).max() < 1e-8
    rest = structure.conductance_matrix @ modes.shapes
    rest -= structure.heat_capacities[:, None] * modes.shapes * modes.values
    assert np.abs(rest).max() < 1e-8
    assert modes.values == pytest.approx(thermal_modes(structure).values[: kept + 1], abs=1e-9)


def test_low_modes_of_a_long_uniform_chain() -> None:
    """ω_k = 2 √(k/m) sin((2k-1) π / (2 (2n+1))), the exact values for a chain with a free end."""
    n = 50_000
    pair = ChainPair(np.full(n, 3.0), np.full(n, 2.0), np.zeros(n))
    k = np.arange(1, 4)
    exact = 2 * np.sqrt(3.0 / 2.0) * np.sin((2 * k - 1) * np.pi / (2 * (2 * n + 1)))
    assert np.sqrt(pair.lowest(3).values) == pytest.approx(exact, rel=1e-10)


def test_a_long_chain_has_no_matrices_and_says_so() -> None:
    structure = heavy_chain(nodes=2001)
    for build in (mechanical_modes, models.Chain.matrices):
        with pytest.raises(TooManyCoordinatesError, match="2001 coordinates cannot be kept full"):
            build(structure)
    assert frequencies(structure).size == rates(structure).size == 2
    exact = 2 * np.sqrt(2.0e7 / 2.5e-3) * np.sin(np.pi / (2 * (2 * 2001 + 1)))
    assert frequencies(structure)[0] == pytest.approx(exact, rel=1e-10)
    assert tip_flexibility(structure) == pytest.approx(2001 / 2.0e7, rel=1e-12)
    load = np.zeros(2001)
    load[-1] = 3.0
    displacement, temperature = static_equilibrium(structure, load, np.zeros(2001), 1.0)
    assert displacement == pytest.approx(3.0 / 2.0e7 * np.arange(1, 2002), rel=1e-11)
    assert not temperature.any()
