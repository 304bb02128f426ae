"""Contact by a spring and a damper against plain matrices, closed forms, its limits and the rigid casing."""

from typing import Any

import numpy as np
import pytest

from plain_steps import march, spring
from scenes import cases, chain, heavy_chain, sampling, step, tip_flexibility
from workflow.models import Rayleigh
from workflow.reduction import reduce_structure
from workflow.schemes import penalty


def test_where_neither_branch_is_consistent_the_tip_stays_on_the_casing() -> None:
    """A strong damper throws the tip out of the casing within the step in which it came in."""
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    batch = cases(structure, gap=0.0999, velocity=1.0)
    options = {"stiffness": 1.0, "damping": 1e6, "integration": "implicit", "theta": 1.0}
    histories = step(structure, batch, 0.1, sampling(0.1, 0.1), "penalty", **options).histories
    assert histories["displacement"][0, 1] == pytest.approx(0.0999, rel=1e-12)
    path = march(structure, batch, 0.1, 1.0, 1, spring(0.1, 1.0, 1.0, 1e6))
    assert path.displacement[1, 0] == pytest.approx(0.0999, rel=1e-12)


def restitution(zeta: float) -> float:
    """Schwager and Pöschel, Granular Matter 9 (2007) 465: contact ends when its force would pull."""
    root = np.sqrt(1 - zeta**2)
    turn = np.pi - np.arctan(2 * zeta * root / (1 - 2 * zeta**2))
    return float(np.exp(-zeta / root * turn))


@pytest.mark.parametrize("integration", ["explicit", "implicit"])
@pytest.mark.parametrize("zeta", [0.0, 0.1, 0.4])
def test_a_single_mass_rebounds_as_in_closed_form(integration: str, zeta: float) -> None:
    """Contact stiffness 1e4 N/m on 1 kg, damping ratio ζ; its effective restitution is what is measured."""
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    batch = cases(structure, gap=0.1, velocity=2.0)
    exact = restitution(zeta)

    def run(h: float) -> Any:
        options = {"stiffness": 1e4, "damping": 2 * zeta * 100, "integration": integration, "theta": 0.5}
        return step(structure, batch, h, sampling(0.2, 0.05), "penalty", **options)

    fine = run(1e-5)
    assert fine.histories["velocity"][0, -1] == pytest.approx(-2 * exact, rel=2e-3)
    assert fine.metrics["effective_restitution"][0] == pytest.approx(exact, rel=2e-3)
    assert fine.histories["impulse"][0, -1] == pytest.approx(2 * (1 + exact), rel=2e-3)
    assert abs(fine.metrics["energy_residual"][0]) < (1e-5 if zeta == 0 else 5e-3)
    rough = abs(run(1e-3).metrics["effective_restitution"][0] - exact)
    assert abs(fine.metrics["effective_restitution"][0] - exact) < 0.1 * rough + 1e-6


def test_static_penetration_is_load_over_stiffness() -> None:
    """The default stiffness is ten times that of the tip, in a reduced structure too; static: load over κ."""
    structure = heavy_chain(damping=Rayleigh(2e4, 0.0))
    kappa = 10 / tip_flexibility(structure)
    assert penalty.contact_stiffness_of(structure, penalty.Options()) == pytest.approx(kappa, rel=1e-9)
    reduced = reduce_structure(structure, 3, 12).structure
    assert penalty.contact_stiffness_of(reduced, penalty.Options()) == pytest.approx(kappa, rel=1e-9)
    batch = cases(structure, gap=5e-5, mean=100.0)
    for integration in ("explicit", "implicit"):
        results = step(structure, batch, 1e-5, sampling(0.2, 0.1), "penalty", integration=integration)
        sunk = (100.0 - 5e-5 * kappa / 10) / (kappa + kappa / 10)
        assert results.histories["displacement"][0, -1] - 5e-5 == pytest.approx(sunk, rel=1e-6)


def test_a_free_mass_has_no_default_stiffness() -> None:
    with pytest.raises(ValueError, match="give the scheme's `stiffness`"):
        penalty.init(chain(nodes=1, mass=1.0, stiffness=0.0), 1e-3, penalty.Options())
