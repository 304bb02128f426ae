"""What a batch leaves behind: the same bits for every case, samples and load periods in their places."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import alone, blade, blade_rub, cases, chain, heavy_chain, same_bits, sampling, step, taken
from workflow import schemes


def varied_batch(count: int) -> tuple:
    structure = heavy_chain()
    rng = np.random.default_rng(1)
    batch = cases(
        structure,
        count,
        e=rng.uniform(0, 1, count),
        alpha=np.where(rng.random(count) < 0.3, 0.0, rng.uniform(0, 60, count)),
        gap=rng.uniform(2e-5, 6e-5, count),
        amplitude=rng.uniform(80, 120, count),
        frequency=rng.choice([20.0, 30.0, 47.0], count),
        phase=rng.uniform(-1, 1, count),
        heating=rng.choice([0.0, 0.1], count)[:, None],
    )
    return structure, batch


def test_bits_do_not_depend_on_the_batch() -> None:
    structure, batch = varied_batch(1000)
    over = sampling(0.05, 1e-3)
    whole = step(structure, batch, 1e-4, over)
    for case in (0, 31, 32, 517, 999):
        assert same_bits(step(structure, alone(batch, case), 1e-4, over), taken(whole, slice(case, case + 1)))
    seven = slice(30, 37)
    assert same_bits(step(structure, batch.take(seven), 1e-4, over), taken(whole, seven))


def test_samples_between_step_ends_are_linear_and_on_them_exact() -> None:
    structure, batch = varied_batch(3)
    fine = step(structure, batch, 1e-4, sampling(0.03, 1e-4)).histories
    coarse = step(structure, batch, 1e-4, sampling(0.03, 2.5e-4)).histories
    for name in schemes.HISTORIES:
        assert np.array_equal(coarse[name][:, ::2], fine[name][:, ::5])
        assert np.allclose(coarse[name][:, 1::2], (fine[name][:, 2::5] + fine[name][:, 3::5]) / 2, rtol=1e-12, atol=0)


def test_last_step_beyond_the_duration_counts_up_to_it() -> None:
    """duration/h = 12.5: the metrics end where the last sample lies."""
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    batch = cases(structure, gap=0.0, mean=1.0)
    results = step(structure, batch, 0.08, sampling(1.0, 0.5))
    assert results.metrics["steps"][0] == 13
    assert results.metrics["contact_time"][0] == pytest.approx(1.0, rel=1e-12)
    assert results.histories["impulse"][0, -1] == pytest.approx(1.0, rel=1e-12)


def test_load_periods_close_exactly() -> None:
    """Impulses of the periods add up, and shares of contact times the period do too."""
    structure = blade()
    results = step(structure, blade_rub(structure), 3e-4, sampling(2.0, 1e-3))
    assert results.period_impulse.shape == (1, 10)
    assert results.period_impulse.sum() == pytest.approx(results.histories["impulse"][0, -1], rel=1e-12)
    assert results.period_contact.sum() * 0.2 == pytest.approx(results.metrics["contact_time"][0], rel=1e-12)
    assert results.period_temperature.max() == results.metrics["max_temperature"][0]
