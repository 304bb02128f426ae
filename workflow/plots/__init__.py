"""Pictures of an archive with Matplotlib; imported when something is drawn.

For papers: ``histories``, ``scene_map``, ``work_precision``, ``convergence``, ``sobol_indices``, ``bifurcation`` and
``branches`` each draw a dataset as a ``Figure``.
"""

from __future__ import annotations

from workflow.plots._axes import metric_by_axis
from workflow.plots._bifurcation import bifurcation
from workflow.plots._branches import branches
from workflow.plots._maps import map_dims, middle, scene_map, single_maps
from workflow.plots._precision import convergence, work_precision
from workflow.plots._response import HISTORIES, Curve, histories, tip_response
from workflow.plots._sobol import sobol_indices
from workflow.plots._style import COLOURS, MADE_BY, save, write_figure
