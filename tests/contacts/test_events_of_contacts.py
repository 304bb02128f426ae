"""Events of several contacts: each entry takes an impulse, begins or ends a contact."""

import numpy as np
import pytest
from random_contacts import DURATION, drawn

from scenes import step
from workflow.schemes import Sampling, Status

SEEDS = [*range(4), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 40))]


@pytest.mark.parametrize("seed", SEEDS)
def test_listed_impulses_are_the_impacts_of_each_contact(seed: int) -> None:
    case = drawn(seed)
    over = Sampling(DURATION, DURATION / 10, 11, events=3000)
    results = step(case.structure, case.cases, 0.0, over, "event_driven")
    if results.status[0] != Status.OK or results.events["event_count"][0] > over.events:
        pytest.skip("not all events are listed")
    impulse, contact = (results.events[name][0] for name in ("event_impulse", "event_contact"))
    listed = np.isfinite(impulse)
    assert np.count_nonzero(listed) == results.events["event_count"][0]
    assert np.all(impulse[listed] >= 0)
    for c, impacts in enumerate(results.metrics["impacts"][0]):
        # a contact that its neighbour strikes again at one instant has one entry; what stops a low bounce is no impact
        count = np.count_nonzero(impulse[listed & (contact == c)] > 0)
        assert abs(count - impacts) <= 0.02 * impacts + 1
