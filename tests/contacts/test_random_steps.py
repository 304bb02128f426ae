"""Every scheme with a fixed step against plain matrices, on random structures of one to five contacts, on all bases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plain_steps import Central, centrally, newton, on_springs, spring
from random_contacts import Drawn, on_basis

from scenes import sampling, step, watched
from workflow.models import Cases, Structure
from workflow.schemes import HISTORIES, Results, Status

H, OVER = 4e-5, sampling(0.006, 5e-5, balances=True)
KAPPA, DAMPER = 3e6, 150.0
METRICS = ("impacts", "contact_time", "max_penetration", "max_temperature", "thermal_closing")

Plain = Callable[[Structure, Cases], Results]


def varied(seed: int, massless: bool) -> Drawn:
    """Return a random structure; every third has damping that couples modes, and some loads and heat of every kind."""
    case, rng = on_basis(seed, massless), np.random.default_rng(seed)
    structure, contacts = case.structure, case.structure.contacts
    assert contacts is not None
    if massless:
        loaded: dict[str, Any] = {"residual_load": 1e-6 * rng.uniform(-1, 1, contacts.count)}
        if case.cases.alpha[0] > 0:
            loaded["residual_coupling"] = 1e-6 * rng.uniform(-1, 1, contacts.heat.shape)
        structure = replace(structure, contacts=replace(contacts, **loaded))
    if seed % 3 == 0:
        along = rng.normal(size=structure.mechanical_size)
        structure = replace(structure, damper=20 * np.outer(along, along))
    return Drawn(watched(structure), case.cases)


def of(method: str, seed: int) -> tuple[dict[str, Any], Plain]:
    """Return options of a scheme and its plain form."""
    theta = (0.5, 0.6, 1.0)[seed // 3 % 3]
    if method in ("carpenter", "paoli_schatzman"):
        how = Central(lagged=seed % 2 == 1, implicit=seed % 4 < 2)
        options = {"damping": ("central", "lagged")[how.lagged], "heat": ("explicit", "implicit")[how.implicit]}
        reads = method == "paoli_schatzman"
        return options, lambda s, c: centrally(s, H, c, OVER, newton(float(c.e[0]) * reads), how)
    damper = DAMPER * (seed % 2)
    options = {"stiffness": KAPPA, "damping": damper}
    if method == "explicit penalty":
        return options, lambda s, c: centrally(s, H, c, OVER, spring(H, KAPPA, damper), Central())
    implicit = {"integration": "implicit", "theta": theta}
    return options | implicit, lambda s, c: on_springs(s, H, c, OVER, theta, KAPPA, damper)


def closes(method: str, options: dict[str, Any], massless: bool) -> bool:
    """Tell whether the balance of energy closes: but for springs that begin and end, and damping of the θ-method."""
    return massless and options["theta"] == 0.5 if "penalty" in method else True


SCHEMES = [
    *((method, False) for method in ("carpenter", "paoli_schatzman", "explicit penalty", "implicit penalty")),
    ("implicit penalty", True),
]
SEEDS = [*range(3), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(3, 64))]


@pytest.mark.parametrize(("method", "massless"), SCHEMES)
@pytest.mark.parametrize("seed", SEEDS)
def test_schemes_step_as_in_plain_matrices(seed: int, method: str, massless: bool) -> None:
    case = varied(seed, massless)
    options, plain = of(method, seed)
    ours = step(case.structure, case.cases, H, OVER, method.split()[-1], **options)
    truth = plain(case.structure, case.cases)
    assert ours.status.tolist() == [Status.OK], ours.messages
    for name in (*HISTORIES, "sensor_value"):
        values = truth.histories[name]
        within = 1e-9 * np.abs(values).max()
        np.testing.assert_allclose(ours.histories[name], values, rtol=0, atol=within, err_msg=name)
    for name in METRICS:
        np.testing.assert_allclose(ours.metrics[name], truth.metrics[name], rtol=1e-9, atol=1e-13, err_msg=name)
    assert abs(ours.metrics["heat_residual"][0]) < 1e-12
    if closes(method, options, massless):
        assert abs(ours.metrics["energy_residual"][0]) < 1e-12
