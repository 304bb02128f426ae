"""Random scenes of a chain of twelve nodes: a load near resonance, heated, initially warm, graded, in turn."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from scenes import chain
from workflow.models import frequencies

NODES = 12
KINDS = ("near resonance", "heated", "initially warm", "graded")
BASES = ("craig_bampton", "krylov", "rubin", "weakly_coupled")


def random_scene(seed: int) -> str:
    """Return a study of one scene at three tolerances that decide both counts of modes; JSON is YAML."""
    random = np.random.default_rng(seed)
    kind, basis = KINDS[seed % 4], BASES[seed // 4 % 4]
    grade = np.geomspace(1, 0.2, NODES) if kind == "graded" else np.ones(NODES)
    lumps: dict[str, Any] = {
        "mass": (4e-3 * random.uniform(0.8, 1.2) * grade).tolist(),
        "stiffness": (1.2e7 * grade).tolist(),
        "spacing": 4e-3,
        "expansion": 8.6e-6,
        "heat_capacity": (2.2 * grade).tolist(),
        "conductance": (0.36 * grade).tolist(),
        "convection": 0.03,
    }
    structure = chain(nodes=NODES, **{name: tuple(np.broadcast_to(value, NODES)) for name, value in lumps.items()})
    first = float(frequencies(structure)[0])
    resonant = kind == "near resonance"
    frequency = first / (2 * np.pi) * random.uniform(0.9, 1.1) if resonant else random.uniform(20, 200)
    duration = float(f"{(25 if resonant else 8) / frequency:.3g}")
    damping = {"mass": random.uniform(5, 40), "stiffness": random.uniform(1e-7, 1e-6)}
    heating = random.uniform(0, 2, NODES).tolist() if kind == "heated" else 0.0
    scene = {
        "chain": {"nodes": NODES, **lumps, "damping": damping, "heating": heating},
        "casing": {"gap": random.uniform(1e-5, 6e-5)},
        "load": {
            "mean": random.uniform(0, 20),
            "amplitude": random.uniform(5, 20) if resonant else random.uniform(40, 150),
            "frequency": frequency,
        },
        "initial": {"temperature": random.uniform(5, 40) if kind == "initially warm" else 0.0},
        "duration": duration,
    }
    axes = {"scheme": "event_driven", "e": random.uniform(0, 0.8), "alpha": random.uniform(0, 40), "reduction": basis}
    axes |= {"mechanical_modes": "auto", "thermal_modes": "auto", "tolerance": [1e-2, 1e-3, 1e-4]}
    output = {"interval": duration / 512, "balances": False}
    return json.dumps({"study": "random", "scene": scene, "axes": axes, "output": output})
