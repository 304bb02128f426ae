"""Random small chains that several tests draw."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from scenes import chain
from workflow.models import Chain, Rayleigh


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


def metal_chain(rng: np.random.Generator, nodes: int, graded: bool = False) -> Chain:
    """Lumps of 0.1 to 100 g on springs of 1e5 to 1e8 N/m, all alike or ``graded``, each of its own."""
    own = nodes if graded else 1
    return chain(
        nodes=nodes,
        mass=np.broadcast_to(10 ** rng.uniform(-4, -1, own), nodes).tolist(),
        stiffness=np.broadcast_to(10 ** rng.uniform(5, 8, own), nodes).tolist(),
        damping=Rayleigh(float(rng.choice([0, 10, 100])), float(rng.choice([0, 2e-7]))),
        spacing=1e-2,
        expansion=1e-5,
        heat_capacity=10 ** rng.uniform(-1, 1),
        conductance=10 ** rng.uniform(-1, 1),
        convection=0.1,
    )
