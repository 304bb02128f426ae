"""Schemes crossed with bases whose contact has no mass: what can run runs, the rest says why, uncompiled."""

from pathlib import Path

import pytest
import xarray as xr

from studies import SCENE, parsed
from workflow.cases import arrange
from workflow.plan import plan_study
from workflow.run import run_study
from workflow.schemes import Status
from workflow.solve._solve import kernel_variants

CROSSED = f"""study: a
{SCENE}
schemes:
  midpoint: {{method: moreau, theta: 0.5}}
axes:
  scheme: [moreau, midpoint, penalty, carpenter, event_driven]
  reduction: [craig_bampton, macneal, massless]
  h: [1e-5]
  alpha: [5]
zip: {{model: {{mechanical_modes: [1, 2, full], thermal_modes: [1, 2, full]}}}}
reference: {{scheme: event_driven, mechanical_modes: full, thermal_modes: full}}
output: {{interval: 1 ms}}
"""
CENTRAL = ("penalty", "carpenter")
"""Schemes of central differences, which take no contact without mass."""


@pytest.mark.parametrize("run", range(2))
def test_a_scheme_that_cannot_fails_its_own_cases(run: int, tmp_path: Path) -> None:
    """On two threads, as often as it is tried; the others have their errors, of the scheme and of the basis."""
    archive = run_study(parsed(CROSSED), tmp_path / "a.nc", threads=2).dataset.isel(h=0, alpha=0)
    archive = archive.transpose("reduction", "scheme", "model", ...)
    light = archive["reduction"].isin(["macneal", "massless"]) & (archive["mechanical_modes"] < 3)
    refused = light & archive["scheme"].isin(CENTRAL)
    assert (archive["status"] == xr.where(refused, Status.FAILED, Status.OK)).all()
    messages = archive["message"].where(refused, drop=True).values.ravel()
    assert all("mass" in text for text in messages if isinstance(text, str))
    reduced = archive.sel(reduction="massless").isel(model=0)
    for name in ("displacement", "temperature", "impulse"):
        for scheme in ("moreau", "midpoint", "event_driven"):
            one = reduced.sel(scheme=scheme)
            whole, by_scheme, by_model = (float(one[f"{name}{part}_error"]) for part in ("", "_scheme", "_model"))
            assert by_model > 0
            assert (by_scheme > 0) == (scheme != "event_driven")
            assert whole <= (by_scheme + by_model) * (1 + 1e-12)


def test_the_plan_says_so_beforehand() -> None:
    failing = [text for text in plan_study(parsed(CROSSED)).warnings if "fails with m" in text]
    assert sorted(text.split()[0] for text in failing) == sorted(2 * CENTRAL)


def test_a_refused_basis_is_not_compiled() -> None:
    """The first case of each scheme has a contact without mass, which two of them take."""
    study = parsed(CROSSED.replace("craig_bampton, macneal, massless", "macneal, massless"))
    assert {one.method for one in kernel_variants(arrange(study))} == {"moreau", "event_driven"}
