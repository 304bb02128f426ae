"""Random small chains that several tests draw."""

from __future__ import annotations

from hypothesis import strategies as st

from scenes import chain
from workflow.models import Rayleigh


def random_chain(draw: st.DrawFn, heat: bool) -> tuple:
    n = draw(st.integers(1, 6))
    numbers = st.floats(0.2, 5.0)
    free_root = draw(st.booleans())
    stiffness = [draw(numbers) for _ in range(n)]
    if free_root:
        stiffness[0] = 0.0
    lumps = {
        "nodes": n,
        "mass": tuple(draw(numbers) for _ in range(n)),
        "stiffness": tuple(stiffness),
        "damping": Rayleigh(draw(st.sampled_from([0.0, 0.1, 3.0])), draw(st.sampled_from([0.0, 0.02, 2.0]))),
    }
    if heat:
        lumps |= {
            "spacing": 1.0,
            "expansion": draw(st.sampled_from([0.0, 0.05])),
            "heat_capacity": tuple(draw(numbers) for _ in range(n)),
            "conductance": draw(st.sampled_from([0.0, 1.0])),
            "convection": draw(st.sampled_from([0.0, 0.3])),
        }
    return chain(**lumps), n
