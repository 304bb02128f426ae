"""Blades whose cells grow from the tip to the root, and the mean of temperature over a depth."""

import numpy as np
import pytest
from scipy.integrate import quad

from scenes import blade, cases, chain, heavy_chain, sampling, step, tip_flexibility
from workflow import models
from workflow.models import Chain


def hottest(structure: Chain) -> float:
    """The largest tip temperature of ``studies/blade.yaml`` at α = 30 and a gap of 20 um, by the exact scheme."""
    case = cases(structure, alpha=30.0, gap=20e-6, amplitude=24.0, frequency=5.0)
    return float(step(structure, case, 0.0, sampling(2.0, 2.0), "event_driven").metrics["max_temperature"][0])


@pytest.mark.parametrize("nodes", [1, 7, 20, 49])
def test_cells_are_equal_to_the_bit_where_no_tip_cell_is_given_or_it_is_the_equal_one(nodes: int) -> None:
    cell, section, share = 0.04 / nodes, 0.03 * 1e-3, np.append(np.ones(nodes - 1), 0.5)
    mass = 4430 * section * cell * share
    for structure in (blade(nodes), blade(nodes, tip_cell=0.04 / nodes)):
        assert np.array_equal(structure.masses, mass)
        assert np.array_equal(structure.springs, np.full(nodes, nodes * 1e6))
        assert np.array_equal(structure.heat_capacities, 560 * mass)
        assert np.array_equal(structure.conduction, np.full(nodes, 7.0 * section / cell))
        assert np.array_equal(structure.convection, 400 * (2 * (0.03 + 1e-3)) * cell * share)
        assert np.array_equal(structure.free_expansion, np.full(nodes, 9e-6 * cell))


@pytest.mark.parametrize(("nodes", "cell"), [(2, 1e-3), (30, 60e-6), (60, 60e-6), (20, 1.9999999e-3), (12, 1e-9)])
def test_cells_grow_by_one_factor_and_fill_the_blade(nodes: int, cell: float) -> None:
    structure = blade(nodes, tip_cell=cell)
    lengths = structure.lengths
    assert lengths[-1] == pytest.approx(cell, rel=1e-12)
    assert lengths.sum() == pytest.approx(0.04, rel=1e-12)
    growth = lengths[:-1] / lengths[1:]
    assert growth == pytest.approx(growth[0], rel=1e-9)
    assert growth[0] > 1
    assert structure.masses.sum() == pytest.approx(4430 * 0.03 * 1e-3 * (0.04 - lengths[0] / 2), rel=1e-12)
    assert tip_flexibility(structure) == pytest.approx(1e-6, rel=1e-11)


@pytest.mark.parametrize(("nodes", "cell"), [(20, 2.1e-3), (1, 1e-3), (3, 1.0)])
def test_a_cell_from_which_no_others_grow_is_refused(nodes: int, cell: float) -> None:
    with pytest.raises(models.UnusableMatricesError, match=f"is too long for {nodes} cells that grow to 0.04 m"):
        blade(nodes, tip_cell=cell)


def test_largest_temperatures_converge_with_the_square_of_the_cells() -> None:
    """Twice the cells, of which each two fill one of before: errors of the limit, 670.7 K, fall fourfold."""
    nodes, cell, growth, found = 15, 120e-6, 1.372, list[float]()
    for _ in range(3):
        structure = blade(nodes, tip_cell=cell)
        growth = float(structure.lengths[0] / structure.lengths[1])
        found.append(hottest(structure))
        nodes, cell = 2 * nodes, cell / (1 + np.sqrt(growth))
    changes = np.abs(np.diff(found))
    assert 3.5 < changes[0] / changes[1] < 4.6
    limit = found[-1] + (found[-1] - found[-2]) / 3
    assert limit == pytest.approx(670.7, abs=0.15)
    assert abs(found[1] - limit) < 0.004 * limit


def once(structure: Chain) -> tuple[float, float]:
    """The largest tip temperature and the time in contact of a blade that flies at 1 m/s and hits once, α = 3."""
    case = cases(structure, alpha=3.0, velocity=1.0)
    metrics = step(structure, case, 0.0, sampling(2e-4, 2e-4), "event_driven").metrics
    return float(metrics["max_temperature"][0]), float(metrics["contact_time"][0])


def test_a_blade_that_hits_once_is_as_hot_as_the_continuum() -> None:
    """A constant force v √(EA ρA) = 72.9 N for L/c = 73 µs would heat a half space by 16.9 K; its fall leaves 15.9."""
    force, time = np.sqrt(1e6 * 0.04 * 4430 * 0.03 * 1e-3), np.sqrt(4430 * 0.03 * 1e-3 * 0.04 / 1e6)
    half_space = 2 * 3 * force * np.sqrt(time / np.pi) / (0.03 * 1e-3 * np.sqrt(7.0 * 4430 * 560))
    assert half_space == pytest.approx(16.9, abs=0.05)
    coarse, fine = once(blade(20)), once(blade(120, tip_cell=5e-6))
    assert coarse[0] == pytest.approx(0.203, abs=5e-4)
    assert fine[0] == pytest.approx(15.9, rel=0.02)
    assert fine[1] == pytest.approx(time, rel=0.02)


POINT = chain(nodes=4, mass=1.0, stiffness=1.0, spacing=(0.3, 0.0, 0.1, 0.2))


@pytest.mark.parametrize("structure", [blade(7), blade(9, tip_cell=1e-4), heavy_chain(nodes=5), POINT])
def test_the_mean_over_a_depth_is_that_of_temperatures_that_are_linear_between_nodes(structure: Chain) -> None:
    whole = float(structure.lengths.sum())
    places = np.append(0.0, np.cumsum(structure.lengths))
    temperatures = np.random.default_rng(3).normal(size=structure.thermal_size)
    for depth in whole * np.array([1e-6, 0.1, 0.5, 0.93, 1.0]):

        def along(s: float) -> float:
            return float(np.interp(s, places, np.append(0.0, temperatures)))

        kinks = [place for place in places[1:-1] if place > whole - depth]
        mean = quad(along, whole - depth, whole, points=kinks or None, epsabs=1e-13, limit=200)[0] / depth
        assert structure.mean_over(depth) @ temperatures == pytest.approx(mean, rel=1e-7, abs=1e-9)
    assert structure.mean_over(1e-9 * whole)[-1] == pytest.approx(1.0, rel=1e-5)
