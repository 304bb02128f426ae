"""Studies whose structure depends on the speed, or whose contacts have no mass: what runs, and why others do not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from studies import SCENE, parsed, refusal
from workflow import plan_study, read_study, run_study
from workflow.cases import arrange
from workflow.models import structure_of, write_matrices
from workflow.schemes import Status
from workflow.solve._solve import kernel_variants

CHAIN: dict[str, Any] = {
    "nodes": 4, "mass": 2e-4, "stiffness": 2e7, "spacing": "2.5 mm", "expansion": 9e-6,
    "heat_capacity": 0.3, "conductance": 0.1, "convection": 0.02, "spin": {"radius": "0.25 m"},
}  # fmt: skip
HERTZ = [0.0, 60.0]


def study(model: dict[str, Any], **axes: Any) -> dict[str, Any]:
    return {
        "study": "turning",
        "scene": {
            **model,
            "casing": {"gap": "10 um"},
            "load": {"amplitude": 40, "frequency": 2000},
            "duration": "1 ms",
            "initial": "static",
        },
        "schemes": {"half": {"method": "moreau", "theta": 0.5}},
        "axes": {"scheme": ["event_driven", "half"], "e": 0.3, "alpha": 1.0, "h": 1e-6, "scene.speed": HERTZ, **axes},
        "output": {"interval": "50 us"},
    }


@pytest.mark.parametrize("damping", [{"mass": 10, "stiffness": 2e-7}, {"ratio": 0.01}], ids=["rayleigh", "ratio"])
def test_cases_agree_with_those_of_plain_matrices(damping: dict[str, float], tmp_path: Path) -> None:
    """In every scheme, whole and reduced; a structure that is exported and read back rubs as it does."""
    modes = {"model": {"mechanical_modes": [1, "full"], "thermal_modes": [1, "full"]}}
    schemes = ["event_driven", "half", "carpenter", "penalty"]

    def case_of(model: dict[str, Any]) -> dict[str, Any]:
        return study(model, scheme=schemes) | {"zip": modes}

    spun = read_study(case_of({"chain": CHAIN | {"damping": damping}}))
    rest: Any = structure_of("chain", spun.scene.parameters)
    load = rest.masses * (0.25 + np.cumsum(rest.lengths))
    given = {
        "mass": rest.mass, "coupling": rest.coupling_matrix, "heat_capacity": rest.heat_capacity,
        "conductance": rest.conductance_matrix, "contact": 3, "thermal_contact": 3,
    }  # fmt: skip
    square = (2 * np.pi * HERTZ[1]) ** 2
    turning = write_matrices(tmp_path / "a.npz", **given, stiffness=rest.stiffness_matrix, stiffness_speed2=-rest.mass,
                             load_speed2=load)  # fmt: skip
    plain = write_matrices(tmp_path / "b.npz", **given, stiffness=rest.stiffness_matrix - square * rest.mass,
                           steady=square * load)  # fmt: skip
    files = (case_of({"matrices": {"file": str(path), "damping": damping}}) for path in (turning, plain))
    ours, file, straight = (
        run_study(one, tmp_path / f"{k}.nc", threads=1).dataset for k, one in enumerate([spun, *files])
    )
    assert (ours["status"] == 0).all()
    assert float(ours["impacts"].sel(speed=HERTZ[1]).min()) > 0
    assert np.array_equal(ours["impacts"], file["impacts"])
    for name in ("displacement", "temperature", "contact_force", "contact_impulse", "critical_alpha"):
        largest = float(np.abs(ours[name]).max())
        assert float(np.abs(ours[name] - file[name]).max()) < 1e-10 * largest
        fast = file[name].sel(speed=HERTZ[1]) - straight[name].sel(speed=HERTZ[1])
        assert float(np.abs(fast).max()) < 1e-9 * largest


def test_the_speed_is_an_axis_of_structures_only_where_they_depend_on_it() -> None:
    rigid = {name: value for name, value in CHAIN.items() if name != "spin"}
    assert arrange(read_study(study({"chain": CHAIN}))).outer_count == 4
    assert arrange(read_study(study({"chain": rigid}))).outer_count == 2
    drawn = study({"chain": CHAIN}) | {"zip": {"design": {"sample": "latin_hypercube", "points": 3, "of": {
        "scene.speed": [0, 60], "scene.chain.spin.radius": ["0.2 m", "0.3 m"]}}}}  # fmt: skip
    del drawn["axes"]["scene.speed"]
    grid = arrange(read_study(drawn))
    assert grid.outer_count == 6
    speeds = {grid.settings(outer).scene.parameters.speed for outer in range(6)}
    assert len(speeds) == 3
    assert speeds == {grid.settings(outer).scene.speed for outer in range(6)}


def test_plan_says_the_ends_of_the_speeds_and_that_one_is_left_out() -> None:
    plan = plan_study(study({"chain": CHAIN}))
    assert plan.operators[0].startswith("speed        0 rpm: f1 ")
    assert "3600 rpm: f1 " in plan.operators[0]
    assert "of 10 µm" in plan.operators[0]
    left_out = study({"chain": CHAIN})
    del left_out["axes"]["scene.speed"]
    assert any("`scene.speed` is left out" in warning for warning in plan_study(left_out).warnings)


@pytest.mark.parametrize(
    ("axis", "said"),
    [
        ({"scene.speed": [0, 1e5]}, "is not positive definite; stay below"),
        ({"scheme": "event_driven", "scene.speed": {"branch": [1, 2, 5]}}, "is a branch over the speed, on which"),
    ],
)
def test_what_a_turning_structure_refuses(axis: dict[str, Any], said: str) -> None:
    assert said in refusal(read_study, study({"chain": CHAIN}, **axis))


def test_a_case_above_the_critical_speed_of_its_own_structure_fails_alone(tmp_path: Path) -> None:
    soft = study({"chain": CHAIN}, **{"scene.chain.stiffness": [2e7, 2e2]})
    status = run_study(soft, tmp_path / "soft.nc", threads=1).dataset
    assert (status["status"].sel(stiffness=2e7) == 0).all()
    assert (status["status"].sel(stiffness=2e2, speed=HERTZ[1]) == 3).all()
    assert "stay below" in str(status["message"].sel(stiffness=2e2, speed=HERTZ[1]).values.ravel()[0])


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
