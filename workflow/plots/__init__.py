"""Pictures of an archive with Matplotlib; imported when something is drawn."""

from __future__ import annotations

from workflow.plots._axes import metric_by_axis
from workflow.plots._precision import convergence, work_precision
from workflow.plots._response import Curve, abstract_figure, overview, tip_response
from workflow.plots._scenes import growth_against_prediction, impact_speed_map
from workflow.plots._style import save

__all__ = [
    "Curve",
    "abstract_figure",
    "convergence",
    "growth_against_prediction",
    "impact_speed_map",
    "metric_by_axis",
    "overview",
    "save",
    "tip_response",
    "work_precision",
]
