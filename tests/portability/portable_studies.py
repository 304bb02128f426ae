"""Small studies that go through all schemes, models and kinds of results, and the settings they are run under."""

from pathlib import Path

import numpy as np

from studies import SCENE
from workflow.pinning import CHOSEN

STUDIES = {
    "schemes": f"""{SCENE.replace("50 Hz", "50 Hz, phase: 0.3")}
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
    "coupled": """
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
""",
    "loose": """
scene:
  chain: {nodes: 4, mass: [0.1, 0.2, 0.1, 0.05], stiffness: [0, 1.0e4, 0, 1.0e4], damping: {mass: 1}, heat_capacity: 1,
          conductance: [0, 1, 0, 1], heating: 0.5, spacing: 1.0e-3, expansion: 1.0e-5}
  casing: {gap: 1 mm}
  load: {mean: 1, amplitude: 2, frequency: 3 Hz}
  initial: {velocity: 0.1, temperature: 3}
  duration: 1 s
axes:
  scheme: [moreau, carpenter, event_driven]
  h: 1e-3
  e: [0, 0.9]
  alpha: [0, 1]
output: {interval: 10 ms}
""",
}


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


PLACE = Path(__file__).parents[2] / "studies"
FILES = [*sorted((PLACE / "hard").glob("*.yaml")), PLACE / "abstract_figure.yaml", PLACE / "blade.yaml"]

PINNED: dict[str, str] = dict(CHOSEN)

SETTINGS: dict[str, dict[str, str]] = {
    "one processor": PINNED,
    "C library without FMA": {**PINNED, "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"},
    "numba for Haswell": {**PINNED, "NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""},
    "numba without AVX": {**PINNED, "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
}
"""What differs among processors that are pinned; with the last two all kernels are compiled anew."""
