"""What to beware of in a study's scene, whatever the scheme: a tip that stays clear, springs and bases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid
from workflow.grid._operators import full_structure, model_on, projection_residual_of, reduced, reduced_structure
from workflow.grid._perturbation import cases_of
from workflow.judges.cautions import scene_cautions, soft_spring
from workflow.models import Cases, Chain
from workflow.reduction import DEFAULT
from workflow.study import CaseSettings

LOST = 1e-3
"""Share of initial states and constant loads that a basis may lose without a word, see ``projection_residual``."""

_SPEEDS = 100.0, 20e3
"""Least and largest speed of sound of a blade, m/s: of soft rubber and above diamond's."""

_LIGHTEST = 100.0
"""Density below which nothing is a blade, kg/m³: that of cork or foam."""

MOST_CASES, MOST_OUTER = 500, 64
"""Cases of an outer index and outer indices that are looked at; of more cases a regular choice."""


def cautions_of_scene(grid: Grid) -> Iterator[str]:
    """Yield what to beware of in springs, structures with the conditions of their cases, and bases."""
    parameters = f"scene.{grid.study.scene.model}."
    for settings in _distinct_settings(grid, "scheme", "schemes.", parameters):
        scheme, structure = schemes.load(settings.scheme.method), reduced_structure(settings)
        if scheme.contact_stiffness_of is not None and not scheme.refusal(structure, settings.scheme.options):
            stiffness = scheme.contact_stiffness_of(structure, settings.scheme.options)
            yield from soft_spring(full_structure(settings), stiffness, settings.scheme.label)
    yield from _units([one.scene.parameters for one in _distinct_settings(grid, parameters)])
    for settings in _distinct_settings(grid, parameters):
        structure, duration = full_structure(settings), grid.sampling.duration
        is_static = settings.scene.initial == "static"
        if not isinstance(structure, Chain) or structure.has_matrices:  # of others the modes are not at hand
            model = model_on(reduced(settings))
            yield from scene_cautions(structure, model, _cases(grid, settings), duration, is_static=is_static)
    worst: dict[str, float] = {}
    for settings in _distinct_settings(grid, "reduction", "mechanical_modes", "thermal_modes", parameters):
        basis = basis_text(settings)
        lost = float(np.nanmax(projection_residual_of(settings, _cases(grid, settings)), initial=0.0))
        worst[basis] = max(worst.get(basis, 0.0), lost)
    for basis, lost in worst.items():
        if lost > LOST:
            yield (
                f"{basis} lose {lost:.2g} of initial states or constant loads (projection_residual): what they cannot "
                "hold is left out of the reduced model"
            )


def _units(every: Sequence[Any]) -> Iterator[str]:
    """Yield that a density or the speed of sound is that of no blade, of parameters that have them."""
    density = min((one.density for one in every if hasattr(one, "density")), default=np.inf)
    if density < _LIGHTEST:
        yield f"a density of {density:.3g} kg/m3 is that of no blade: check its unit, kg/m3 or e.g. `4.43 g/cm**3`"
    speeds = [one.wave_speed for one in every if getattr(one, "wave_speed", 0) > 0]
    for speed in (min(speeds, default=np.inf), max(speeds, default=0.0)):
        if 0 < speed < _SPEEDS[0] or _SPEEDS[1] < speed < np.inf:
            yield f"sound would pass at {speed:.3g} m/s: check the units of stiffness, density and lengths"


def _distinct_settings(grid: Grid, *beginnings: str) -> Iterator[CaseSettings]:
    """Yield the first settings that differ along axes whose path begins so."""
    for outer in grid.kinds(lambda path: path.startswith(beginnings))[:MOST_OUTER]:
        yield grid.settings(outer)


def _cases(grid: Grid, settings: CaseSettings) -> Cases:
    """Return cases to look at: all, or a regular choice that has the first and the last."""
    inner = np.unique(np.linspace(0, grid.inner_count - 1, min(grid.inner_count, MOST_CASES)).round().astype(np.int64))
    return cases_of(settings, grid.inner_values(inner), inner.size)[1]


def basis_text(settings: CaseSettings) -> str:
    """Name the reduced model of settings."""
    modes = f"{settings.mechanical_modes} + {settings.thermal_modes} modes"
    return modes if settings.reduction == DEFAULT else f"{modes} of {settings.reduction}"
