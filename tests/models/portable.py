"""Print a hash of what models and reductions compute: the same on every processor up to 300 coordinates."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from scenes import cases, heavy_chain
from workflow import models
from workflow.reduction import projection_residual, reduce_structure


def main() -> None:
    digest, rng = hashlib.sha256(), np.random.default_rng(0)
    for nodes in (4, 20, 120):
        chain = heavy_chain(nodes=nodes, stiffness=2e7 * rng.uniform(0.5, 2, nodes))
        state = rng.uniform(-1, 1, nodes)
        batch = cases(
            chain, 1, displacement=state, velocity=state, temperature=state, steady=state, heating=state, gap=1e-5
        )
        for structure in (chain, chain.matrices()):
            count = min(8, nodes - 1)
            reduction = reduce_structure(structure, count, count)
            small = reduction.structure
            arrays = [value for value in vars(small).values() if isinstance(value, np.ndarray)]
            arrays += [reduction.displacement_projection, projection_residual(structure, reduction, batch)]
            prepared = models.in_contact(structure)
            arrays += [np.array(models.growth(prepared, alpha)) for alpha in (0.0, 0.5, 2000.0)]
            mechanical, thermal = models.mechanical_modes(structure), models.thermal_modes(structure)
            arrays += [mechanical.shapes, thermal.shapes, models.modal_coupling(structure, mechanical, thermal)]
            for of in (structure, small):
                arrays += [
                    models.static_tip_growth(of),
                    np.array([models.critical_alpha(of), models.tip_flexibility(of)]),
                ]
            arrays += models.static_equilibrium(structure, np.abs(state), np.abs(state), 5e-5)
            for values in arrays:
                digest.update(np.ascontiguousarray(values).tobytes())
    print(digest.hexdigest())


main()
