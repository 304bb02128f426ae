"""What goes on from the state in which contacts, with mass or without, end is what would have gone on."""

from typing import Any

import numpy as np
import pytest
from random_contacts import DURATION, drawn

from scenes import halves, sampling

OVER = sampling(DURATION, DURATION / 40)
STEPPED: list[tuple[str, dict[str, Any]]] = [
    ("event_driven", {}),
    ("moreau", {"theta": 1.0}),
    ("moreau", {"theta": 0.5}),
    ("penalty", {"stiffness": 1e7, "integration": "implicit"}),
]


@pytest.mark.parametrize(("method", "options"), STEPPED)
@pytest.mark.parametrize("kind", [pytest.param("mass", marks=pytest.mark.slow), "massless", "elastic"])
def test_contacts_go_on(method: str, options: dict[str, Any], kind: str) -> None:
    """The first velocity of contacts without mass is that of the modes alone."""
    if kind == "elastic" and method == "penalty":
        pytest.skip("takes a rigid casing")
    touched = 0
    for seed in range(6):
        scene = drawn(seed, kind == "massless")
        structure = scene.structure.on_casing(1e-6) if kind == "elastic" else scene.structure
        whole, _, rest = halves(structure, scene.cases, 5e-6, OVER, method, **options)
        assert whole.status == rest.status == 0
        touched += int(rest.metrics["contact_time"].max() > 0)
        for name in ("displacement", "velocity", "temperature"):
            expected, scale = whole.histories[name][..., 21:], np.abs(whole.histories[name]).max()
            np.testing.assert_allclose(rest.histories[name][..., 1:], expected, rtol=0, atol=1e-8 * scale + 1e-20)
    assert touched > 2
