"""Random structures of up to five contacts with friction, heat and a casing that moves, and a case of each."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from scenes import cases_of_file, of_entries, watched
from workflow.models import Array, Cases, Structure, independent_rows
from workflow.reduction import reduce_structure

DURATION = 0.02
"""s: about two periods of the slowest mode."""


class Drawn(NamedTuple):
    """A structure and its one case."""

    structure: Structure
    cases: Cases


def positive(rng: np.random.Generator, size: int, least: float) -> Array:
    """Return a symmetric matrix whose eigenvalues lie between ``least`` and 1."""
    turned, _ = np.linalg.qr(rng.normal(size=(size, size)))
    matrix = (turned * rng.uniform(least, 1.0, size)) @ turned.T
    return np.asarray((matrix + matrix.T) / 2)


def random_entries(
    rng: np.random.Generator, count: int, size: int, thermal: int, rubs: bool, massless: bool
) -> dict[str, Any]:
    """Return the entries of a file, with a row for each contact."""
    mass, stiffness = 0.1 * positive(rng, size, 0.5), 4e5 * positive(rng, size, 0.05)
    shares = rng.uniform(0.1, 1.0, (count, thermal))
    entries: dict[str, Any] = {
        "mass": mass,
        "stiffness": stiffness,
        "damping": 5.0 * mass + 2e-5 * stiffness,
        "contact": np.eye(count, size) + 0.15 * rng.normal(size=(count, size)),
        "load": rng.normal(size=size),
        "heat_capacity": positive(rng, thermal, 0.3),
        "conductance": 0.2 * positive(rng, thermal, 0.3),
        "coupling": 10.0 * rng.normal(size=(size, thermal)),
        "thermal_contact": shares / shares.sum(axis=1, keepdims=True),
        "angle": rng.uniform(-1, 1, count),
    }
    if rubs:
        entries["tangent"] = 0.3 * rng.normal(size=(count, size))
    if massless:
        entries["residual_flexibility"] = 4e-6 * positive(rng, count, 0.3)
        if rubs:
            entries["residual_tangent"] = 2e-7 * rng.normal(size=(count, count))
    return entries


def drawn(seed: int, massless: bool = False, count: int = 0) -> Drawn:
    """Return a structure of so many contacts, or of up to 5, some with friction, some with heat."""
    rng = np.random.default_rng(seed)
    count = count or int(rng.integers(1 if massless else 2, 6))
    size, thermal = count + int(rng.integers(1, 4)), int(rng.integers(1, 4))
    rubs, warms = rng.random() < 0.5, rng.random() < 0.5
    entries = random_entries(rng, count, size, thermal, rubs, massless)
    structure = of_entries(entries)
    amplitudes, frequencies, phases = [4e-6, 3e-6], rng.uniform(30, 150, 2), rng.uniform(-3, 3, 2)
    turns = entries["angle"][:, None] * np.array([rng.integers(1, 4), 0])
    x, v = 3e-5 * rng.normal(size=size), 0.01 * rng.normal(size=size)
    begins = entries["contact"] @ x - (amplitudes * np.sin(phases + turns)).sum(axis=1)
    given = {
        "gaps": begins + rng.uniform(1e-6, 4e-5, count),
        "e": rng.choice([0.0, 0.3, 0.7]),
        "alpha": rng.uniform(1, 20) if warms else 0.0,
        "mean": rng.uniform(0, 4),
        "amplitude": rng.uniform(1, 6),
        "frequency": rng.uniform(60, 200),
        "phase": rng.uniform(-3, 3),
        "friction": 0.15 if rubs else 0.0,
    }
    waves = {"casing_harmonics": list(zip(amplitudes, frequencies, phases, strict=True)), "turns": turns}
    return Drawn(structure, cases_of_file(structure, displacement=x, velocity=v, **given, **waves))


WHOLE = 3
"""Seeds below which structures are not reduced."""

BASES = {False: ("craig_bampton", "krylov", "", "rubin", "weakly_coupled"), True: ("macneal", "", "massless")}
"""Bases of contacts with mass, and those that leave contacts without; empty for a whole structure."""


def on_basis(seed: int, massless: bool, count: int = 0) -> Drawn:
    """Return a structure on one of all bases in turn; every seventh has one contact, if no ``count`` is given."""
    basis = BASES[massless][seed // 2 % len(BASES[massless])] if seed >= WHOLE else ""
    case = drawn(seed, massless and not basis, count or int(seed % 7 == 6))
    if not basis:
        return case
    full = case.structure
    held, heated = independent_rows(full.contacts)
    modes = min(2, full.mechanical_size - held), min(1, full.thermal_size - heated)
    reduction = reduce_structure(full, *modes, basis, DURATION)
    assert reduction.structure.contacts.is_massless == massless
    return Drawn(reduction.structure, reduction.project(case.cases))


def varied(seed: int, massless: bool, count: int = 0) -> Drawn:
    """Return a random structure; every third has damping that couples modes, and some loads and heat of every kind."""
    case, rng = on_basis(seed, massless, count), np.random.default_rng(seed)
    structure, contacts = case.structure, case.structure.contacts
    if massless:
        loaded: dict[str, Any] = {"residual_load": 1e-6 * rng.uniform(-1, 1, contacts.count)}
        if case.cases.alpha[0] > 0:
            loaded["residual_coupling"] = 1e-6 * rng.uniform(-1, 1, contacts.heat.shape)
        structure = replace(structure, contacts=replace(contacts, growth=None, **loaded))
    if seed % 3 == 0:
        along = rng.normal(size=structure.mechanical_size)
        structure = replace(structure, damper=20 * np.outer(along, along))
    return Drawn(watched(structure), case.cases)
