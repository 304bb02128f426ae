"""Forces and extremes of load periods, each sample in its place, and cases perturbed to either side."""

import numpy as np
import pytest

from scenes import cases, chain, sampling, step
from workflow.judges.distances import perturbed
from workflow.judges.load_periods import SETTLED, change_of_impulse, contact_force, largest_per_period, sections


def test_forces_are_those_of_the_intervals_whose_middle_lies_in_a_period() -> None:
    """Where a period has none, that of the interval around its own middle."""
    over, frequency = sampling(3.0, 0.3), np.array([0.5, 1.0, 2.0, 6.7, 0.0])
    impulse = np.cumsum(np.random.default_rng(0).uniform(size=(5, over.count)), axis=1)
    force = contact_force(impulse, over.interval)[:, 1:]
    np.testing.assert_allclose(force * over.interval, np.diff(impulse, axis=1), rtol=1e-14)
    middle = (over.times[:-1] + over.times[1:]) / 2
    largest = largest_per_period(force, frequency, over, 21)
    for case, f in enumerate(frequency):
        for k in range(21):
            own = force[case, (middle * f >= k) & (middle * f < k + 1)]
            if own.size == 0 and k + 1 <= 3.0 * f:
                own = force[case, np.abs(middle * f - k - 0.5) <= 0.5 * f * over.interval]
            assert np.isnan(largest[case, k]) == (k + 1 > 3.0 * f)
            assert k + 1 > 3.0 * f or largest[case, k] == own.max()


@pytest.mark.parametrize("method", ["event_driven", "moreau"])
def test_extremes_of_a_period_are_at_both_of_its_ends(method: str) -> None:
    """Half a cosine to a period, between whose ends no sample is as large; and another case has shorter periods."""
    lump, over = chain(nodes=1, mass=1.0, stiffness=np.pi**2), sampling(4.0, 0.4)
    batch = cases(lump, 2, gap=9.0, displacement=1.0, frequency=[1.0, 2.0])
    options = {} if method == "event_driven" else {"theta": 0.5}
    found = sections(step(lump, batch, 1e-3, over, method, **options), batch, over, 9)
    for case, f in enumerate([1.0, 2.0]):
        ends = np.cos(np.pi * np.arange(int(4 * f) + 1) / f)
        for name, extreme in (("", np.maximum), ("_min", np.minimum)):
            values = found[f"period_displacement{name}"][case]
            np.testing.assert_allclose(values[: ends.size - 1], extreme(ends[:-1], ends[1:]), atol=1e-4)
            assert np.isnan(values[ends.size - 1 :]).all()


@pytest.mark.parametrize("share", [1e-6, -1e-6])
def test_a_share_widens_gaps_and_takes_as_much_of_loads(share: float) -> None:
    lump, sway = chain(nodes=2, mass=1.0, stiffness=1.0), [[0.5, 3.0, 1.0]]
    gap, mean = np.array([2.0, -2.0, 0.0]), np.array([5.0, -5.0, 0.0])
    one = cases(lump, 3, gap=gap, mean=mean, amplitude=8.0, frequency=1.0, displacement=-4.0, casing_harmonics=sway)
    tip = np.array([[0.0, 1.0]])
    other = perturbed(one, share, 3.0, tip)
    np.testing.assert_allclose(other.gaps[:, 0] - gap, 3.0 * share, rtol=1e-6)
    np.testing.assert_allclose(other.mean - mean, -8.0 * share, rtol=1e-6)
    np.testing.assert_allclose(other.load_harmonics.amplitude - 8.0, -8.0 * share, rtol=1e-6)
    on = cases(lump, 3, displacement=one.casing_of_contacts(0.0)[0], gap=gap, casing_harmonics=sway)
    start = perturbed(on, share, 0.0, tip)
    assert np.all(start.displacement[:, -1] <= start.casing_of_contacts(0.0)[0][:, 0])


@pytest.mark.parametrize("share", [1e-6, -1e-6])
def test_a_share_widens_or_narrows_the_gap_of_each_contact(share: float) -> None:
    """But of one that starts on its casing, which goes with it."""
    lump = chain(nodes=2, mass=1.0, stiffness=1.0)
    one = cases(lump, gaps=[3.0, 1.0], displacement=1.0)
    other = perturbed(one, share, 2.0, np.eye(2))
    np.testing.assert_allclose(other.gaps[0] - one.gaps[0], [3.0 * share, max(2.0 * share, share)], rtol=1e-6)


def test_the_change_of_the_mean_impulse_is_of_the_last_quarters() -> None:
    """Of each contact; without contact 0; behind its last period a case has NaN; fewer than eight are not judged."""
    nan = np.nan
    impulse = np.array(
        [
            [9.0, 9, 9, 9, 9, 1, 3, 2, 2.2, nan],  # (1 + 3)/2, then (2 + 2.2)/2
            [9.0, 9, 9, 9, 0, 0, 0, 0, nan, nan],
            [0.0, 0, 0, 0, 1, 1, 0, 0, nan, nan],
            [1.0, 1, 1, 1, 4, 4, 3, nan, nan, nan],
        ]
    )
    expected = np.array([0.1 / 2.1, 0.0, 1.0, nan])
    np.testing.assert_allclose(change_of_impulse(impulse), expected)
    np.testing.assert_allclose(
        change_of_impulse(impulse[:, None].repeat(2, axis=1)), expected[:, None].repeat(2, axis=1)
    )
    assert change_of_impulse(impulse[0]) < SETTLED


@pytest.mark.parametrize(
    ("periods", "repetitions"), [(84, [2, 3, 4, 6, 12]), (62, [2, 3, 4, 6]), (31, [2, 3, 6]), (14, [2])]
)
def test_a_rub_that_repeats_itself_over_several_periods_has_settled(periods: int, repetitions: list[int]) -> None:
    for each in repetitions:
        assert change_of_impulse(np.arange(periods) % each == 0.0) == 0.0
