"""The exact scheme on bodies that nothing holds, or next to nothing, against 80-bit arithmetic."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from plain_events import Reference
from plain_structures import plain_chain
from random_structures import Described, described, modes

from scenes import chain, sampling, step
from workflow.models import Rayleigh
from workflow.schemes import Status

ACCURACY = 1e-9
SAMPLES = 60
ROUNDING = 4e-13
"""A thousand roundings."""

PHASES = (Phase.explicit, Phase.generate)
"""Nothing is shrunk: the 80-bit solution takes long where hypothesis finds simple bodies."""


def numbers(draw: st.DrawFn, count: int, low: float, high: float) -> np.ndarray:
    every = st.floats(low, high, allow_subnormal=False)
    return np.array(draw(st.lists(every, min_size=count, max_size=count)))


@st.composite
def bodies(draw: st.DrawFn) -> tuple[float, Described]:
    """Return in how many of the reference's longest steps a sample is due, and a body that nothing holds."""
    kind, n = draw(st.sampled_from(["braked by air", "on dashpots", "of modes"])), draw(st.integers(1, 4))
    if kind == "of modes":
        frequency = np.append(0.0, numbers(draw, n - 1, 50.0, 2e4))
        ratio, tip = numbers(draw, n, 0.0, 0.1), numbers(draw, n, 1.0, 30.0)
        structure, plain, _ = modes(frequency, ratio, tip, np.ones(1), np.ones(1), np.zeros((n, 1)))
    else:
        springs = np.append(0.0, numbers(draw, n - 1, 1e4, 1e8))
        lumps: dict[str, Any] = {"nodes": n, "mass": numbers(draw, n, 1e-3, 0.1), "stiffness": springs}
        lumps |= {"heat_capacity": 1.0}
        drag = draw(st.one_of(st.just(0.0), st.floats(-8.0, 2.0).map(lambda power: 10.0**power)))
        damping = Rayleigh(drag) if kind == "braked by air" else Rayleigh()
        items = {name: value if np.isscalar(value) else tuple(value) for name, value in lumps.items()}
        structure, plain = chain(**items, damping=damping), plain_chain(lumps, damping)
        if kind == "on dashpots":  # from node to node and to the ground
            ends = np.vstack([np.eye(n) - np.eye(n, k=1), np.eye(n)])
            damper = ends.T @ (numbers(draw, 2 * n, 0.0, 30.0)[:, None] * ends)
            structure = replace(structure.matrices(), damper=damper)
            plain = replace(plain, damping_matrix=plain.damping_matrix + damper)
    return draw(st.floats(2.0, 100.0)), described(
        structure,
        plain,
        0.0,
        e=draw(st.one_of(st.just(0.0), st.floats(0.2, 1.0))),
        gap=draw(st.floats(1e-6, 1e-2)),
        mean=draw(st.floats(-50.0, 50.0)),
        amplitude=draw(st.floats(1.0, 100.0)),
        frequency=draw(st.floats(1.0, 2e4)),
        phase=draw(st.floats(0.0, 6.0)),
        velocity=numbers(draw, n, -1.0, 1.0),
    )


@settings(max_examples=60, deadline=None, derandomize=True, phases=PHASES, suppress_health_check=[HealthCheck.too_slow])
@given(bodies())
def test_free_bodies_move_as_in_80_bits(body: tuple[float, Described]) -> None:
    """Relative to the largest motion, up to the first impact that grazes.

    Beside that, what roundings of gap, load and phase become, which impacts amplify, and rounding of the start.
    """
    steps, scene = body
    reference = Reference(scene.plain, scene.plain_case)
    interval = float(f"{steps * reference.longest:.3g}")
    over = sampling(SAMPLES * interval, interval)
    truth = reference.solve(over.times, most_impacts=20)
    given = scene.plain_case
    rounded = {"gap": given.gap * (1 + ROUNDING), "mean": given.mean * (1 + ROUNDING), "phase": given.phase + ROUNDING}
    changed = [replace(given, **{name: value}) for name, value in rounded.items()]
    moved = [Reference(scene.plain, case).solve(over.times, most_impacts=20) for case in changed]
    results = step(scene.structure, scene.case, 0.0, over, "event_driven")
    assert results.status[0] == Status.OK
    reached = over.times < min(each.reached for each in (truth, *moved))
    speed = np.abs(scene.plain_case.velocity).max()  # of nodes that are not at the tip, too
    sizes = {"displacement": scene.case.gap[0] + speed * over.duration, "velocity": speed}
    sizes["impulse"] = speed * float(np.trace(scene.plain.mass))
    for name in ("displacement", "velocity", "impulse"):
        ours, theirs = results.histories[name][0, reached], getattr(truth, name)[reached]
        largest = np.abs(theirs).max(initial=0.0)
        apart = [np.abs(getattr(each, name)[reached] - theirs) for each in moved]
        amplified = np.maximum.accumulate(np.max(apart, axis=0))
        assert np.max(np.abs(ours - theirs) - ACCURACY * largest - amplified, initial=0.0) <= 1e-14 * sizes[name], name
