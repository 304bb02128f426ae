"""A tip without mass, as the bases macneal and massless leave it: modes, static answers and growth by dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from scenes import blade, heavy_chain, held_matrix
from workflow.models import Structure, frequencies, growth_rate, mechanical_modes
from workflow.reduction import reduce_structure


@pytest.fixture(params=["macneal", "massless", "free root"])
def structure(request: pytest.FixtureRequest) -> Structure:
    if request.param == "free root":
        return reduce_structure(heavy_chain(stiffness=(0.0, *[2e7] * 19)), 4, 4, "massless").structure
    return reduce_structure(heavy_chain(), 4, 4, request.param).structure


def test_modes_diagonalise_mass_and_stiffness(structure: Structure) -> None:
    modes = mechanical_modes(structure)
    assert modes.inertia.tolist() == [1, 1, 1, 1, 0]
    mass, stiffness = (modes.shapes.T @ a @ modes.shapes for a in (structure.mass, structure.stiffness_matrix))
    assert np.abs(mass - np.diag(modes.inertia)).max() < 1e-12
    assert np.abs(stiffness - np.diag(modes.values**2)).max() < 1e-12 * stiffness.max()
    omega = frequencies(structure)
    inverse = scipy.linalg.eigh(structure.mass, structure.stiffness_matrix + structure.mass, eigvals_only=True)
    assert np.allclose(np.sqrt(1 / inverse[:0:-1] - 1), omega[:-1], rtol=1e-9, atol=1e-3)
    assert omega[-1] == np.inf


def test_static_solutions(structure: Structure) -> None:
    load = np.random.default_rng(0).normal(size=5)
    displacements = structure.mechanical.static_solutions(load[None, :])[0]
    if mechanical_modes(structure).values[0] == 0:
        rigid = mechanical_modes(structure).shapes[:, 0]
        load = load - structure.mass @ rigid * (rigid @ load)
    assert structure.stiffness_matrix @ displacements == pytest.approx(load, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("basis", ["macneal", "massless"])
@pytest.mark.parametrize("alpha", [0.0, 5.0, 100.0])
def test_growth_rate_is_an_eigenvalue_of_the_held_tip(basis: str, alpha: float) -> None:
    """y'' + C y' + K y + K12 θ = 0 inside, λ from the tip's row without inertia, C2 θ' + K2 θ = α λ e_n."""
    whole = blade()
    small = reduce_structure(whole, 3, 5, basis).structure
    exact = np.linalg.eigvals(held_matrix(small, alpha)).real.max()
    assert growth_rate(small, alpha) == pytest.approx(exact, rel=1e-8, abs=1e-9)
    assert alpha == 0 or (exact > 0) == (alpha > 2.756)
