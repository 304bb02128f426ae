"""Doyen, Ern, Piperno (SIAM J. Sci. Comput. 33, 2011): an elastic bar meets a rigid wall, scheme by scheme.

E = 900, ρ = 1, L = 10, wave speed c = 30, as a chain with a free root: n nodes, L/(n-1) apart, the outer ones
with half a mass. Impact: the bar touches the wall with v0 = 10; contact lasts 2L/c with the force ρ c v0,
then it leaves undeformed with -v0. Bounce: it falls 5 m under 10 m/s² first; by d'Alembert the first contact, from
t = 1, lasts 2L/c too, with the force ρ c (10 + 10 (t - 1)), whose impulse is 266.7 N s. ``pytest -s`` prints the table.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from scenes import cases, chain, sampling, step
from workflow.models import Structure
from workflow.schemes import Status

MODULUS, DENSITY, LENGTH, SPEED, GRAVITY = 900.0, 1.0, 10.0, 10.0, 10.0
WAVE = np.sqrt(MODULUS / DENSITY)
LASTS = 2 * LENGTH / WAVE
NODES = 100
CELL = LENGTH / (NODES - 1)
STEP = 0.5 * CELL / WAVE

SCHEMES: dict[str, tuple[str, dict[str, Any]]] = {
    "event_driven": ("event_driven", {}),
    "moreau 1/2": ("moreau", {"theta": 0.5}),
    "moreau 1": ("moreau", {"theta": 1.0}),
    "carpenter": ("carpenter", {}),
    "penalty": ("penalty", {"stiffness": MODULUS / CELL}),
    "penalty x10": ("penalty", {"stiffness": 10 * MODULUS / CELL}),
    "penalty x10 implicit 1/2": (
        "penalty",
        {"stiffness": 10 * MODULUS / CELL, "integration": "implicit", "theta": 0.5},
    ),
    "penalty x10 implicit 1": ("penalty", {"stiffness": 10 * MODULUS / CELL, "integration": "implicit"}),
}
"""Penalty stiffnesses in spring stiffnesses of the chain."""


def bar() -> Structure:
    mass, stiffness = np.full(NODES, DENSITY * CELL), np.full(NODES, MODULUS / CELL)
    mass[[0, -1]] /= 2
    stiffness[0] = 0.0
    return chain(nodes=NODES, mass=tuple(mass), stiffness=tuple(stiffness))


@dataclass(frozen=True)
class Contact:
    """The first contact: mean and spread of the force over its exact value, its length, and what it leaves.

    ``leaves`` is the velocity of the centre of mass after it over the exact one, ``kept`` the kinetic
    energy of that velocity over the exact one, ``made`` the scheme's own energy over the whole run.
    """

    force: float
    spread: float
    lasts: float
    leaves: float
    kept: float
    made: float


def contact(scene: str, scheme: str) -> Contact:
    structure = bar()
    falls = scene == "bounce"
    begins = 1.0 if falls else 0.0
    weight = GRAVITY * np.diag(structure.mass)
    batch = cases(structure, gap=5.0, steady=weight) if falls else cases(structure, gap=0.0, velocity=SPEED)
    over = replace(sampling(begins + 1.0, 0.005), balances=True)
    method, options = SCHEMES[scheme]
    results = step(structure, batch, STEP, over, method, **options)
    assert results.status[0] == Status.OK
    impulse = results.histories["impulse"][0]
    force, middle = np.diff(impulse) / over.interval, over.times[1:] - over.interval / 2 - begins
    gravity = GRAVITY if falls else 0.0
    ratio = force / (DENSITY * WAVE * (SPEED + gravity * middle))
    inner = ratio[(middle > 0.1) & (middle < 0.6)]
    on = np.flatnonzero(force > 1.0)
    mass, total = DENSITY * LENGTH, impulse[-1]
    exact = -SPEED if not falls else 2 * SPEED - WAVE * (SPEED * LASTS + gravity * LASTS**2 / 2) / LENGTH
    velocity = SPEED + (SPEED if falls else 0.0) - total / mass
    return Contact(
        force=float(inner.mean()),
        spread=float(inner.std()),
        lasts=float(over.times[on.max() + 1] - begins),
        leaves=float(velocity / exact),
        kept=float(velocity**2 / exact**2),
        made=float(results.metrics["energy_residual"][0]),
    )


@pytest.fixture(scope="module")
def table() -> dict[tuple[str, str], Contact]:
    contacts = {(scene, scheme): contact(scene, scheme) for scene in ("impact", "bounce") for scheme in SCHEMES}
    print(f"\n{'scene':8}{'scheme':26}{'force':>8}{'spread':>8}{'lasts/s':>9}{'leaves':>8}{'kept':>7}{'made':>11}")
    for (scene, scheme), c in contacts.items():
        numbers = f"{c.force:8.4f}{c.spread:8.4f}{c.lasts:9.3f}{c.leaves:8.4f}{c.kept:7.3f}{c.made:11.2e}"
        print(f"{scene:8}{scheme:26}{numbers}")
    return contacts


@pytest.mark.parametrize("scene", ["impact", "bounce"])
def test_the_bar_at_its_wall(scene: str, table: dict[tuple[str, str], Contact]) -> None:
    of = {scheme: table[scene, scheme] for scheme in SCHEMES}
    smooth = [s for s in SCHEMES if s not in ("penalty x10", "penalty x10 implicit 1/2")]
    for scheme in smooth:
        assert of[scheme].force == pytest.approx(1.0, abs=0.005), scheme
        assert of[scheme].spread < (0.07 if scheme == "penalty" else 0.02), scheme
        assert of[scheme].lasts == pytest.approx(LASTS, abs=0.04), scheme
    # energy: kept by θ = 1/2 and central differences, spent by θ = 1, made by a penalty beyond its limit
    assert abs(of["moreau 1/2"].made) < 1e-12
    assert 0 < of["penalty x10 implicit 1/2"].made < 0.05  # the step in which the spring meets the bar
    for scheme in ("carpenter", "penalty"):
        assert abs(of[scheme].made) < 2e-3, scheme
    for scheme in ("moreau 1", "penalty x10 implicit 1"):
        assert of[scheme].made < -0.05, scheme
        assert of[scheme].kept < 0.9, scheme
    assert of["penalty x10"].made > 0.1
    assert of["penalty x10"].spread > 0.5
    # the tip's half mass loses its energy in an impact without restitution, a share that vanishes with the cell
    for scheme in ("event_driven", "moreau 1/2", "carpenter"):
        assert of[scheme].leaves == pytest.approx(1.0, abs=0.03), scheme
