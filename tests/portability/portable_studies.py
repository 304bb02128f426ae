"""Small studies that go through all schemes, models and kinds of results, and the settings they are run under."""

from pathlib import Path

import numpy as np

from workflow.pinning import CHOSEN

CHAIN = """
  chain: {nodes: 6, mass: 2.5e-3, stiffness: 4.0e6, damping: {mass: 10, stiffness: 2.0e-7}, spacing: 2.5e-3,
          expansion: 8.6e-6, heat_capacity: 1.3, conductance: 0.6, convection: 0.02}
"""

STUDIES = {
    "schemes": f"""
scene:{CHAIN}
  casing: {{gap: 20 um}}
  load: {{amplitude: 100, frequency: 50 Hz, phase: 0.3}}
  duration: 60 ms
schemes:
  implicit_euler: {{method: moreau, theta: 1.0}}
  midpoint: {{method: moreau, theta: 0.5}}
  penalty: {{method: penalty}}
  soft: {{method: penalty, integration: implicit}}
axes:
  scheme: [implicit_euler, midpoint, penalty, soft, carpenter, event_driven]
  h: [1e-5, 2e-5]
  e: [0, 0.8]
  alpha: [0, 20]
reference: {{scheme: event_driven}}
output: {{interval: 1 ms}}
""",
    "reduced": f"""
scene:{CHAIN}
  casing: {{gap: 20 um}}
  load: {{mean: 30, amplitude: 100, frequency: 50 Hz}}
  initial: {{temperature: 3}}
  duration: 60 ms
axes:
  scheme: [moreau, event_driven]
  h: {{log: [1e-5, 1e-4, 4]}}
  alpha: [5, 50]
zip:
  model: {{mechanical_modes: [1, 2, full], thermal_modes: [2, 3, full]}}
reference: {{scheme: event_driven, mechanical_modes: full, thermal_modes: full}}
output: {{interval: 1 ms}}
""",
    "loose": """
scene:
  chain: {nodes: 4, mass: [0.1, 0.2, 0.1, 0.05], stiffness: [0, 1.0e4, 0, 1.0e4], damping: {mass: 1}, heat_capacity: 1,
          conductance: [0, 1, 0, 1], heating: 0.5, spacing: 1.0e-3, expansion: 1.0e-5}
  casing: {gap: 1 mm}
  load: {mean: 1, amplitude: 2, frequency: 3 Hz}
  initial: {velocity: 0.1}
  duration: 1 s
axes:
  scheme: [moreau, carpenter, event_driven]
  h: 1e-3
  e: [0, 0.9]
  alpha: [0, 1]
output: {interval: 10 ms}
""",
}

COUPLED = """
scene:
  matrices: {file: coupled.npz}
  casing: {gap: 20 um}
  load: {mean: 30, amplitude: 100, frequency: 50 Hz}
  duration: 40 ms
axes:
  scheme: [moreau, carpenter, penalty, event_driven]
  h: 1e-5
  e: [0, 0.8]
  alpha: [0, 20]
reference: {scheme: event_driven}
output: {interval: 1 ms}
"""
"""A structure of :func:`write_coupled`."""


def write_coupled(place: Path) -> None:
    """Write a chain with a dashpot between two nodes, which couples its modes, by products and sums alone."""
    nodes, one, other = 40, 10, 30
    springs = 2 * np.eye(nodes) - np.eye(nodes, k=1) - np.eye(nodes, k=-1)
    springs[-1, -1] = 1.0
    dashpot = np.zeros((nodes, nodes))
    dashpot[one, one] = dashpot[other, other] = 30.0
    dashpot[one, other] = dashpot[other, one] = -30.0
    np.savez(
        place, mass=2.5e-3 * np.eye(nodes), stiffness=4e6 * springs, damping=dashpot, contact=nodes - 1,
        heat_capacity=1.3 * np.eye(nodes), conductance=0.6 * springs, coupling=-34.0 * np.eye(nodes),
        thermal_contact=nodes - 1,
    )  # fmt: skip


STUDIES["coupled"] = COUPLED

HERE = Path(__file__)
ROOT = HERE.parents[2]

FILES = [*sorted((ROOT / "studies" / "hard").glob("*.yaml")), ROOT / "studies" / "abstract_figure.yaml"]
FILES += [ROOT / "studies" / "blade.yaml"]

PINNED: dict[str, str] = dict(CHOSEN)

SETTINGS: dict[str, dict[str, str]] = {
    "one processor": PINNED,
    "C library without FMA": {**PINNED, "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"},
    "numba for Haswell": {**PINNED, "NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""},
    "numba without AVX": {**PINNED, "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
}
"""What differs among processors that are pinned; with the last two all kernels are compiled anew."""
