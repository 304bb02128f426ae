"""Badly conditioned matrices from files: what a well-conditioned chain gives, as near as the files hold it."""

import re

import numpy as np
import pytest
import xarray as xr
from test_hard import STUDIES, opened

from scripts import script
from workflow.models import rounding_of_flexibility, structure_of
from workflow.models._matrix_files import read_entries
from workflow.plan import plan_study
from workflow.run import run_study
from workflow.schemes import Status
from workflow.study import parse_study, read_study

CHAIN = """chain: {nodes: 4, mass: 2.5e-3, stiffness: 4.0e6, damping: {mass: 10, stiffness: 2.0e-7}, spacing: 2.5e-3,
          expansion: 8.6e-6, heat_capacity: 1.3, conductance: 0.6, convection: 0.02}"""


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """The chain itself, by springs: its stiffness is never assembled."""
    text = (STUDIES / "scaled_units.yaml").read_text(encoding="utf-8")
    text, count = re.subn(r"matrices: \{.*\}\n", CHAIN + "\n", text)
    assert count == 1
    text = text.replace("[implicit_euler, carpenter, event_driven]", "[implicit_euler, event_driven]")
    study = parse_study(text, "chain.yaml")
    return run_study(study, tmp_path_factory.mktemp("chain") / "chain.nc").dataset.load()


def apart(results: xr.Dataset, reference: xr.Dataset) -> float:
    """Largest difference of a result of the schemes that both have, over its largest value."""
    worst = 0.0
    for name in ("displacement", "temperature", "contact_impulse", "max_temperature", "critical_alpha"):
        of = results[name].sel(scheme=reference["scheme"])
        worst = max(worst, float(np.abs(of - reference[name]).max() / np.abs(reference[name]).max()))
    return worst


def lost(name: str) -> float:
    scene = read_study(STUDIES / f"{name}.yaml").scene
    return rounding_of_flexibility(structure_of(scene.model, scene.parameters))


@pytest.mark.parametrize("name", ["scaled_units", "near_rigid"])
def test_the_files_are_what_the_script_writes(name: str) -> None:
    stored, computed = read_entries(STUDIES / name), script("hard_matrices").FILES[name]()
    assert set(stored) == set(computed)
    for entry, matrix in computed.items():
        entries = stored[entry].toarray() if hasattr(stored[entry], "toarray") else np.asarray(stored[entry])
        assert np.array_equal(entries.reshape(matrix.shape), matrix)


def test_units_of_displacements_cost_no_digit(chain: xr.Dataset) -> None:
    """Twelve decades on the diagonal of K1, half of the coordinates without mass."""
    diagonal = np.diag(script("hard_matrices").scaled_units()["stiffness"])
    assert diagonal.max() / diagonal.min() > 0.99e12
    archive = opened("scaled_units")
    assert np.all(archive["status"] == Status.OK)
    assert apart(archive, chain) < 1e-13
    assert lost("scaled_units") < 1e-14


def test_near_rigid_links_cost_what_the_plan_says(chain: xr.Dataset) -> None:
    """The file's entries are rounded to 1024 where springs of 4e6 are added to links of 8e18."""
    archive, share = opened("near_rigid"), lost("near_rigid")
    assert 1e-4 < share < 1e-2
    assert share / 100 < apart(archive, chain) < 3 * share
    assert np.all(archive["status"].sel(scheme=["implicit_euler", "event_driven"]) == Status.OK)
    assert np.all(archive["status"].sel(scheme="carpenter") == Status.DIVERGED)
    [caution] = [text for text in plan_study(read_study(STUDIES / "near_rigid.yaml")).warnings if "`stiffness`" in text]
    assert f"by about {share:.1g}" in caution
    assert not [
        text for text in plan_study(read_study(STUDIES / "scaled_units.yaml")).warnings if "`stiffness`" in text
    ]
