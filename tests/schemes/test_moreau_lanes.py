"""Lanes, packs, threads and samples between steps: what must never show in a result."""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes import alone, heavy_chain, rubs, same_bits, sampling, step, taken
from workflow.kernels.lanes import LANES, PACK
from workflow.kernels.pack_operations import BROAD
from workflow.schemes import Sampling, schedule

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
