"""Impacts that accumulate, and those that the load lifts off before they have, against a loop over every bounce."""

from typing import Any

import numpy as np
import pytest
from bare_motion import add_decay, bare_motion
from numpy.polynomial.polynomial import polyder, polyval

from scenes import cases, chain, sampling, step
from workflow.kernels import Array
from workflow.kernels.compiled import kernel
from workflow.models import Rayleigh
from workflow.schemes import Results, Status
from workflow.schemes._exact.chattering import Bounces, end_of_chattering
from workflow.schemes._exact.motion import Motion


def run(damping: float, e: float, **options: int) -> Results:
    """A lump that 0.02 N at 20 Hz press on its casing twice."""
    lump = chain(nodes=1, mass=1e-3, stiffness=1e3, damping=Rayleigh(damping, 0.0), spacing=1.0, expansion=0.0)
    batch = cases(lump, e=e, gap=1e-5, amplitude=0.02, frequency=20.0)
    return step(lump, batch, 0.0, sampling(0.1, 1e-4), "event_driven", **options)


@pytest.mark.slow
def test_contact_time_goes_on_steadily_towards_elastic_bounces() -> None:
    """The last share of the time at rest falls with the logarithm of 1 - e, without a jump."""
    times = [run(1e4, 1 - 10.0**-k).metrics["contact_time"][0] for k in (4, 5, 6, 7)]
    steps = -np.diff(times)
    expected = 2 * np.log(10.0) * 3 / 1e4  # two contacts, each rests where exp(γ t/3) has made up for 1/(1 - e)
    np.testing.assert_allclose(steps, expected, rtol=0.1)


TOUCHING = [  # nodes, mass, stiffness, damping, load, frequency, phase, e: what rounding did to them took 10⁶ steps
    (1, 3.5486174233796e-3, 1409.3221831040019, (100.0, 1e-4),
     0.016691559005893048, 102.19761023773185, 5.467865925526087, 0.9995),
    (4, 3.245398001943489e-4, 978391.283239058, (100.0, 1e-6),
     0.05811978493703326, 114.27059872123228, 3.5053059189835487, 0.99),
    (6, 1.1842971517825544e-3, 114829.68279516882, (1e4, 1e-6),
     2.1374202019635637, 102.22207684921331, 2.206045059741541, 0.5),
    (6, 1.7684290186896698e-3, 2839.102922619561, (1e4, 1e-4),
     0.02250587708192685, 108.45480602465254, 4.4959627172167815, 0.1),
]  # fmt: skip


@pytest.mark.parametrize("scene", TOUCHING)
def test_a_pressing_load_that_touches_zero(scene: tuple[Any, ...]) -> None:
    """F0 (1 + sin ωt) with gap 0: the tip stays on its casing but for flights of the height of rounding."""
    nodes, mass, stiffness, damping, load, frequency, phase, e = scene
    structure = chain(nodes=nodes, mass=mass, stiffness=stiffness, damping=Rayleigh(*damping))
    batch = cases(structure, e=e, mean=load, amplitude=load, frequency=frequency, phase=phase)
    over = sampling(4 / frequency, 0.1 / frequency)
    results = step(structure, batch, 0.0, over, "event_driven", events=10_000)
    assert results.status[0] == Status.OK
    assert not results.messages
    assert results.metrics["contact_time"][0] >= 0.99 * 4 / frequency


def test_bounces_end_where_the_load_only_just_presses() -> None:
    """The force of the load touches 0 at 0.75 s; between a touch more and a touch less the time in contact is alike."""
    ball, times = chain(nodes=1, mass=0.25, stiffness=0.0), sampling(2.0, 1e-2)
    batch = cases(ball, 3, e=0.5, gap=1e-6, mean=1.0, amplitude=np.array([1 + 1e-7, 1.0, 1 - 1e-7]), frequency=1.0)
    results = step(ball, batch, 0.0, times, "event_driven")
    assert np.all(results.status == Status.OK)
    least, between, most = results.metrics["contact_time"]
    assert least <= between <= most <= least + 1e-3


@kernel
def _end(m: Motion, u: float, bounces: Bounces, ends: Array) -> None:
    ends[0] = end_of_chattering(m, 0.0, u, bounces)[0]


def bounced(bounces: Bounces, u: float, steady: float, share: float, rate: float) -> float:
    """Return the time in which all bounces end, each flight by its Taylor series."""
    t, tau, s = 0.0, 1.0, np.zeros(12)
    while tau > 1e-16 * t:
        s[1], push = u, bounces.mobility * share * np.exp(-rate * t)
        s[2] = -0.5 * (bounces.drag * u + bounces.mobility * steady + push)
        for n in range(3, s.size):
            push *= -rate / (n - 2)
            s[n] = -(bounces.drag * (n - 1) * s[n - 1] + push) / (n * (n - 1))
        tau = -u / s[2]
        for _ in range(4):
            tau -= polyval(tau, s[1:]) / polyval(tau, polyder(s[1:]))
        t, u = t + tau, -bounces.e * polyval(tau, polyder(s))
    return t


@pytest.mark.parametrize("lasts", [1e-4, 1e-2])
@pytest.mark.parametrize("e", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("force", [(0.4, 0.6, 2.0), (0.4, 0.6, -2.0), (0.6, -0.2, 5.0)])
def test_the_sum_of_all_bounces_is_of_second_order(force: tuple[float, float, float], e: float, lasts: float) -> None:
    """Over what they last, with drag, under a force that fades or grows: without the first corrections it is of one."""
    bounces, ends = Bounces(e, mobility=2.0, drag=3.0, height=1.0, end=10.0), np.zeros(1)
    u = 0.5 * lasts * (1 - e) * bounces.mobility * (force[0] + force[1])
    held = bare_motion(0, firsts=1, growth=max(0.0, -force[2]))
    held.outputs[0] = force[0]
    add_decay(held, *force[1:])
    _end(held, u, bounces, ends)
    exact = bounced(bounces, u, *force)
    assert abs(ends[0] - exact) < 8.0 * lasts**2 * exact
