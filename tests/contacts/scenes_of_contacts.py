"""Structures with several contacts and studies of them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scenes import cases_of_file, movable, of_entries
from workflow.models import Cases, Structure

CHAIN = 5


def chain(count: int = CHAIN, heated: bool = True) -> dict[str, Any]:
    """Return a clamped chain with contacts at the third and the last node, which expands as it warms."""
    links = np.eye(count) - np.eye(count, k=-1)
    stiffness = 2e5 * links.T @ links
    elongation = 1.5e-6 * (np.eye(count) + np.eye(count, k=-1)) / 2
    rows = np.eye(count)[[2, count - 1]]
    entries: dict[str, Any] = {
        "mass": np.diag(np.linspace(1.0, 0.6, count)),
        "stiffness": stiffness,
        "damping": 20 * np.eye(count) + 2e-5 * stiffness,
        "contact": rows,
        "contact_labels": np.array(["mid", "end"]),
        "load": np.eye(count)[-1],
        "angle": np.array([0.0, 1.3]),
    }
    if heated:
        entries |= {
            "heat_capacity": 1.2 * np.eye(count),
            "conductance": 0.5 * links.T @ links + 0.01 * np.eye(count),
            "coupling": -2e5 * links.T @ elongation,
            "thermal_contact": rows,
        }
    return entries


SCENE: dict[str, Any] = {
    "casing": {"gap": [3e-5, 5.5e-5], "harmonics": [{"order": 3, "amplitude": 5e-6, "phase": 0.2}]},
    "speed": 40.0,
    "load": {"amplitude": 28.0, "frequency": 65.0, "phase": 0.4},
    "duration": 0.04,
}
OUTPUT = {"interval": 5e-4, "histories": ["displacement", "velocity", "temperature", "impulse", "contact_force"]}
AXES = {"scheme": "moreau", "h": 1e-4}


def study(place: Path, entries: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """Return a study of a structure that is written to a file; ``scene`` and other sections replace the usual ones."""
    file = place / "several.npz"
    np.savez(file, **(chain() if entries is None else entries))
    scene = {"matrices": {"file": str(file)}, **SCENE, **more.pop("scene", {})}
    return {"study": "several", "scene": scene, "axes": AXES | more.pop("axes", {}), "output": OUTPUT, **more}


def two_masses(**entries: Any) -> Structure:
    """Return two masses on springs, a contact at each, or with rows that a file is refused for."""
    rows = {
        field: entries.pop(name) for field, name in (("normal", "contact"), ("tangent", "tangent")) if name in entries
    }
    masses = {"mass": np.diag([1.0, 2.0]), "stiffness": np.diag([1e4, 1e4]), "contact": np.eye(2)}
    structure = of_entries({**masses, **entries})
    rows = {name: row @ structure.coordinates.displacement_basis for name, row in rows.items()}
    return replace(structure, contacts=replace(structure.contacts, **rows))


def pressed(structure: Structure, **more: Any) -> Cases:
    """Return a case that is pushed against both its contacts, in equilibrium."""
    return movable(cases_of_file(structure, steady=[30.0, 50.0], **{"gaps": [1e-3, 1e-3], **more}))
