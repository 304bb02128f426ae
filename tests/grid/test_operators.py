"""What batches share has the same bits wherever it is made."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from studies import SCENE, parsed
from workflow.grid import _operators, arrange, tasks
from workflow.reduction import reduce_structure


def test_a_reduction_does_not_depend_on_the_threads_of_blas() -> None:
    text = "study: a\n" + SCENE.replace("nodes: 4", "nodes: 200") + "axes: {mechanical_modes: 20, thermal_modes: 50}\n"
    grid = arrange(parsed(text))
    _operators.model_on.cache_clear()
    with threadpool_limits(limits=2, user_api="blas"):
        next(tasks(grid))
        cell = grid.settings(0)
        cached = _operators.model_on(_operators.reduced(cell))
    with threadpool_limits(limits=1, user_api="blas"):
        alone = reduce_structure(_operators.structure_of(cell.scene.model, cell.scene.parameters), 20, 50)
    assert _operators.model_on.cache_info().misses == 1
    for name, values in vars(alone.structure).items():
        if isinstance(values, np.ndarray):
            assert values.tobytes() == vars(cached.structure)[name].tobytes(), name
