"""Lanes, packs and groups of modes: layout that must never show in a result."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plain_steps import march
from scenes import alone, cases, chain, heavy_chain, rubs, same_bits, sampling, step, taken
from workflow.kernels.compiled import kernel
from workflow.kernels.lanes import LANES, PACK, lane_rows, lane_table, rows_in, several_rows
from workflow.kernels.pack_operations import BROAD
from workflow.models import Rayleigh
from workflow.schemes import Sampling, schedule
from workflow.schemes._fixed.loads import Wave, start_of, start_waves
from workflow.schemes._fixed.rows import Acting
from workflow.schemes._fixed.stepping import WAITING, Batch, batch_of, keep_idle_off, load_block, rows_of, watch

COUNTS = [1, 2, PACK - 1, PACK, PACK + 1, BROAD + PACK, LANES - BROAD, LANES - 1, LANES + 1, 2 * LANES + PACK]


@pytest.mark.parametrize("count", COUNTS)
def test_any_number_of_cases(count: int) -> None:
    """Whole and broken packs and blocks, with thermal states and without: the bits of the case alone."""
    structure = heavy_chain()
    batch = rubs(structure, 2 * LANES + PACK, temperature=np.linspace(0, 5, 20))
    over = sampling(0.02, 1e-3, balances=False)
    results = step(structure, batch.take(slice(0, count)), 1e-4, over)
    for case in {0, count // 2, count - 1}:
        assert same_bits(step(structure, alone(batch, case), 1e-4, over), taken(results, slice(case, case + 1)))


@pytest.mark.parametrize("link", [0.0, 1e-20, 1e-9])
def test_heat_that_hardly_reaches_the_tip(link: float) -> None:
    """Thermal modes with no or next to no share in the tip's temperature still move the tip."""
    structure = chain(
        nodes=5,
        mass=1.0,
        stiffness=4.0,
        damping=Rayleigh(0.1, 0.01),
        spacing=1.0,
        expansion=0.05,
        conductance=[0.7, 0.7, 0.7, 0.7, link],
    )
    batch = cases(structure, e=0.5, alpha=0.3, gap=0.2, amplitude=2.0, frequency=0.1, temperature=[[1, 2, 3, 2, 0]])
    plain = march(structure, batch, 0.05, 0.7, 200)
    results = step(structure, batch, 0.05, sampling(10.0, 0.05), theta=0.7)
    assert plain.impulse.sum() > 0
    for name, expected in (("displacement", plain.displacement), ("temperature", plain.temperature)):
        assert np.abs(results.histories[name][0] - expected[:, -1]).max() < 1e-10


def test_threads_share_nothing() -> None:
    """Four batches at once on two threads, the kernel without the lock: the bits of one thread."""
    structure = heavy_chain()
    batch = rubs(structure, 20, temperature=np.linspace(0, 5, 20))
    over = sampling(0.1, 1e-3, balances=False)
    expected = step(structure, batch, 1e-4, over)
    with ThreadPoolExecutor(2) as pool:
        for results in pool.map(lambda _: step(structure, batch, 1e-4, over), range(4)):
            assert same_bits(results, expected)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.floats(1e-6, 1.0), st.floats(1e-6, 1.0), st.integers(2, 60))
def test_samples_are_placed_exactly(interval: float, h: float, count: int) -> None:
    """Decimal arithmetic, whether the products fit in int64 or not."""
    samples = schedule(Sampling((count - 1) * interval, interval, count), h)
    ratio = Fraction(repr(interval)) / Fraction(repr(h))
    for k in range(count):
        whole, rest = divmod(k * ratio, 1)
        due, weight = (whole, 1.0) if rest == 0 else (whole + 1, float(rest))
        assert (samples.due[k], samples.weight[k]) == ((due, weight) if due <= samples.steps else (samples.steps, 1.0))


@kernel
def _load(batch: Batch, acts: Sequence[Acting], first: int, used: int) -> None:
    load_block(batch, first)
    keep_idle_off(acts, used, LANES)


def test_idle_lanes_are_at_rest_far_from_their_casing() -> None:
    """Whatever stood in them before, so that they never make a pack look for contact."""
    structure, acts = heavy_chain(), lane_rows(1, rows_in(Acting))
    cases = rubs(structure, LANES + 3, displacement=1e-5, casing_harmonics=[[1e-6, 300.0, 0.0]])
    drive, begins = start_of(structure, cases, 1e-4, 0.5, 1e-3)
    watched = watch(structure, cases, sampling(1e-3, 1e-3), 1e-4, begins, drive)
    batch = batch_of(watched, lane_table(rows_of(watched)), lane_rows(4 * WAITING), LANES)
    block, (act,) = batch.whole, several_rows(Acting, acts)
    (contact,) = block.contacts
    for first, used in ((0, LANES), (LANES, 3)):
        _load(batch, (act,), first, used)
        still = contact.displacement, contact.velocity, contact.temperature, block.load.waves[0].amplitude
        assert np.all(contact.displacement[:used] == 1e-5)
        assert not np.any([row[used:] for row in still])
        assert np.all(np.isinf(act.casing[:LANES]) == (np.arange(LANES) >= used))


@kernel
def _start(waves: Sequence[Wave], lanes: int) -> None:
    start_waves(waves, lanes)


@pytest.mark.parametrize(
    ("amplitude", "frequency", "common"),
    [([0, 0, 2, 3], [0, 7, 5, 5], 5), ([0, 0, 2, 3], [0, 7, 5, 6], None), ([0, 0, 2, 3], [0, np.nan, 5, 5], 5)],
)
def test_lanes_whose_loads_are_alike_share_one_sine(amplitude: list, frequency: list, common: float | None) -> None:
    """Lanes without a load, idle or not, are no hindrance; the sine is that of the first lane."""
    (wave,) = waves = several_rows(Wave, lane_rows(1, rows_in(Wave)))
    wave.amplitude[:4], wave.frequency[:4] = amplitude, frequency
    _start(waves, PACK)
    assert wave.common[0] == (common is not None)
    assert wave.frequency[0] == (common or frequency[0])
