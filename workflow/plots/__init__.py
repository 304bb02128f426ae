"""Pictures of an archive with Matplotlib; imported when something is drawn.

For papers: ``histories``, ``contacts``, ``scene_map``, ``work_precision``, ``convergence``, ``sobol_indices``,
``bifurcation``, ``branches``, ``boundary``, ``clearance``, ``interaction_map``, ``sweep`` and ``wear_map`` each draw a
dataset as a ``Figure``, ``campbell`` a study.
"""

from __future__ import annotations

from workflow.plots._along import bifurcation, boundary, branches, metric_by_axis, sobol_indices, sweep
from workflow.plots._contacts import contacts, wear_map
from workflow.plots._maps import LEAST_VALUES, map_dims, middle, scene_map, single_maps
from workflow.plots._precision import convergence, work_precision
from workflow.plots._response import HISTORIES, Curve, histories, tip_response
from workflow.plots._speed import campbell, clearance, interaction_map
from workflow.plots._style import COLOURS, MADE_BY, save, write_figure
