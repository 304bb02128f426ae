"""Figures of structures: first frequency, stiffness, thermal times, critical coupling."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from workflow import models
from workflow.cases import Grid, cases_of, full_structure
from workflow.declare import measure
from workflow.models import Chain, critical_alphas, frequencies, rates, set_text, statics
from workflow.study import CaseSettings


@dataclass(frozen=True)
class Figures:
    """Frequencies, stiffness, thermal times and critical coupling of a structure."""

    label: str
    """Which structure."""
    first_frequency: float
    """f1, Hz; 0 for a free body."""
    tip_stiffness: float
    """1/S, N/m; 0 for a free body."""
    stiffness_by: str
    """Parameter that gives it, of a model that takes one of several; else empty."""
    slowest: float
    fastest: float
    """``slowest``, ``fastest``: longest and shortest thermal time 1/μ, s; ``inf`` for an adiabatic mode."""
    critical_alpha: float
    critical_set: str
    """``critical_alpha``, ``critical_set``: α_c, W/N, the least of the friction coefficients given and of all closed
    sets, and the one it is of, in words; empty for one contact."""
    alpha: tuple[float, float]
    """Smallest and largest α of its cases, W/N."""


def figures(settings: CaseSettings, friction: Iterable[float], alpha: tuple[float, float]) -> Figures:
    """Return the figures of the full structure of a case, for some friction coefficients and the ends of α."""
    structure = full_structure(settings)
    with np.errstate(divide="ignore"):
        times = 1.0 / rates(structure)
    flexibility = float(statics(structure)[0].max())
    alphas = [(alpha, k) for each in {*friction} for k, alpha in critical_alphas(structure, each).items()]
    critical, labels = min(alphas, key=lambda one: one[0])
    return Figures(
        label=f"{settings.scene.model}, {size_text(settings)}{_condensed(settings)}",
        first_frequency=float(frequencies(structure)[0] / (2 * np.pi)),
        tip_stiffness=0.0 if np.isinf(flexibility) else 1.0 / flexibility,
        stiffness_by=_stiffness_by(settings),
        slowest=float(times.max()),
        fastest=float(times.min()),
        critical_alpha=critical,
        critical_set=set_text(labels) if structure.contacts.count > 1 else "",
        alpha=alpha,
    )


def speed_lines(grid: Grid) -> tuple[str, ...]:
    """Return a line on the ends of the speeds on which a structure depends: f1, and what constant loads close."""
    if not grid.study.depends_on_speed:
        return ()
    kinds, ends = grid.kinds(lambda path: path == "scene.speed"), (0, grid.points - 1)
    every = (grid.at_point(outer, point) for outer in kinds for point in ends)
    ordered = sorted(every, key=lambda settings: settings.scene.speed)
    parts = []
    for settings in dict.fromkeys((ordered[0], ordered[-1])):
        structure = full_structure(settings)
        first = float(np.sqrt(structure.mechanical.modes(1).values[0])) / (2 * np.pi)
        case = cases_of(settings, grid.inner_values(np.zeros(1, np.int64)), 1)[1]
        load = case.steady[0] + case.mean[0] * structure.load_direction
        closed = "no equilibrium of constant loads"
        if not structure.mechanical.moves(load):
            x = float((structure.contacts.normal @ structure.mechanical.solve(load)).max())
            closed = f"constant loads close {measure(x, 'm', 4)} of {measure(float(case.clearances.min()), 'm', 4)}"
        parts.append(f"{60 * settings.scene.speed:.6g} rpm: f1 {first:.5g} Hz, {closed}")
    return (f"speed        {'; '.join(parts)}",)


def _stiffness_by(settings: CaseSettings) -> str:
    names = getattr(models.load(settings.scene.model), "EITHER", ())
    return next((name for name in names if getattr(settings.scene.parameters, name) is not None), "")


def size_text(settings: CaseSettings) -> str:
    """Return the size of a case's structure: nodes of a chain, coordinates of displacement and heat of others."""
    mechanical, thermal = models.sizes(settings.scene.model, settings.scene.parameters)
    is_chain = isinstance(full_structure(settings), Chain)
    return f"{mechanical} nodes" if is_chain else f"{mechanical} + {thermal} coordinates"


def _condensed(settings: CaseSettings) -> str:
    """Return how many degrees of freedom are condensed statically, or held by their file; empty for none."""
    coordinates = full_structure(settings).coordinates
    if coordinates is None:
        return ""
    kinds = ("without mass, condensed", "without heat capacity, condensed", "held", "held at temperature 0")
    counts = zip((*coordinates.condensed, *coordinates.held), kinds, strict=True)
    return "".join(f" + {count} {kind}" for count, kind in counts if count)
