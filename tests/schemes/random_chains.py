"""Random small chains that several tests draw."""

from __future__ import annotations

import numpy as np

from scenes import chain
from workflow.models import Chain, Rayleigh


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
